//! Lookup of the egos of a campaign in a world.

use super::Checker;
use crate::campaign::error::CampaignError;
use crate::campaign::file::EgoEntry;
use crate::evaluation::Sweep;
use crate::experiment::EgoUnderTest;
use crate::ron_file::ValuePath;
use crate::run_dir::ChangedEgo;
use crate::seed::{Purpose, StartKey};

/// Largest number of members of a family.
const MAX_MEMBERS: u64 = 10_000;

impl Checker {
    /// Returns the egos of a world without duplicates.
    pub(super) fn egos(
        &self,
        world: usize,
        entries: &[EgoEntry],
    ) -> Result<Vec<ChangedEgo>, CampaignError> {
        let mut egos: Vec<ChangedEgo> = Vec::new();
        for (nth, entry) in entries.iter().enumerate() {
            let at = ValuePath::top().to("egos").at(nth);
            for ego in self.found(&at, world, entry)? {
                self.same_starts(&at, world, &ego)?;
                let ego = ChangedEgo {
                    name: ego.name().to_owned(),
                    change: ego.change().clone(),
                };
                match egos.iter().find(|known| known.name == ego.name) {
                    // `all` may repeat an ego that is also named alone.
                    Some(known) if *known == ego => {}
                    Some(_) => {
                        let what = format!("two egos are called `{}`", ego.name);
                        let help = "rows tell them apart by their names".to_owned();
                        return Err(self.source.wrong(&at, what, Some(help)));
                    }
                    None => egos.push(ego),
                }
            }
        }
        Ok(egos)
    }

    fn found(
        &self,
        at: &ValuePath,
        world: usize,
        entry: &EgoEntry,
    ) -> Result<Vec<EgoUnderTest>, CampaignError> {
        let played = &self.worlds[world].0;
        let wrong = self.source.at(at);
        match entry {
            // A file is recognised by its extension, so egos may have any other name.
            EgoEntry::Ego(requested) if requested.ends_with(".ron") => {
                let path = self.dir.join(requested);
                let (change, _) = played.changed_by(&path)?;
                // The file is relative to the campaign file, wherever the command is run.
                EgoUnderTest::changed(played, requested, &change, "mend the file")
                    .map(|ego| vec![ego])
                    .map_err(wrong)
            }
            EgoEntry::Ego(requested) => EgoUnderTest::find(played, requested).map_err(wrong),
            EgoEntry::Sweep(text) => {
                let sweep = Sweep::parse(text).map_err(self.source.at(at))?;
                sweep.egos(played).map_err(wrong)
            }
            EgoEntry::Changed { name, change } => {
                let help = "mend this change";
                let ego = EgoUnderTest::changed(played, name, change, help).map_err(wrong)?;
                Ok(vec![ego])
            }
            EgoEntry::Family { members, seed } => {
                // Without members nothing would be played, and an empty campaign fails nowhere.
                if !(1..=MAX_MEMBERS).contains(members) {
                    let what = format!("{members} members: there are 1 to {MAX_MEMBERS}");
                    return Err(self.source.wrong(at, what, None));
                }
                let Some(family) = played.family() else {
                    let what = format!("`{}` names no family", played.name());
                    let help = "add `train_against: Family(…)` to the world: docs/guide/reuse.md";
                    return Err(self.source.wrong(at, what, Some(help.to_owned())));
                };
                // Members are drawn by index, so more members keep the earlier ones.
                let member = |index: u64| {
                    let key = StartKey {
                        // Members of the test stream are none of those that a training
                        // draws.
                        purpose: Purpose::Test,
                        seed: *seed,
                        index,
                    };
                    let change = family.change(&family.draw(played.name(), key));
                    let name = format!("member {seed}-{index}");
                    EgoUnderTest::changed(played, &name, &change, "narrow the family's ranges")
                };
                let egos: Result<Vec<_>, _> = (0..*members).map(member).collect();
                egos.map_err(wrong)
            }
        }
    }

    /// Refuses an ego with other starts, which would not pair with those of other egos.
    fn same_starts(
        &self,
        at: &ValuePath,
        world: usize,
        ego: &EgoUnderTest,
    ) -> Result<(), CampaignError> {
        let (played, _) = &self.worlds[world];
        if ego.scenario().axes() == played.axes() {
            Ok(())
        } else {
            let (name, world) = (ego.name(), played.name());
            let what = format!("`{name}` starts elsewhere than `{world}`");
            let help = "write a world file of that map, and name it under `worlds`";
            Err(self.source.wrong(at, what, Some(help.to_owned())))
        }
    }
}
