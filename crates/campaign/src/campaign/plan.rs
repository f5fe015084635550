//! Plan of a campaign: what is played, and its cut into pieces.

use std::ops::Range;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::file::RequestedStarts;
use crate::content_hash::{BLANK, seal, sha256};
use crate::evaluation::GateOn;
use crate::run_dir::{AdversaryId, ChangedEgo};
use crate::sim::PlantKind;

/// Version of the layout of plans and pieces.
pub(super) const FORMAT: u32 = 2;

/// Campaign in pieces, which depend on nothing else.
///
/// Pieces are numbered: first the trainings, then the starts, unit by unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the layout.
    pub(super) format: u32,
    /// SHA-256 of this file.
    pub(super) sha256: String,
    /// Version that made the plan. Other versions do not run it.
    pub brakecheck: String,
    /// Name of the campaign.
    pub name: String,
    /// Worlds, stored beside the plan.
    pub(crate) worlds: Vec<PlannedWorld>,
    /// Run directories of trained ados, copied beside the plan.
    pub(crate) ados: Vec<PlannedRun>,
    /// Ados that the campaign trains.
    pub(crate) trainings: Vec<PlannedTraining>,
    /// Starts that are played in each world.
    pub(crate) starts: RequestedStarts,
    /// Whether counterexamples are judged by the reference drivers.
    pub preventability: bool,
    /// Ego that every other ego is compared with, and the reasons that close the gate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate: Option<(String, Vec<GateOn>)>,
    /// Region in which a regulation requires the ego to hold.
    ///
    /// It has a name and a formula on the first sample of a start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<(String, String)>,
    /// Pairs of an ego and an ado that are played.
    pub units: Vec<Unit>,
}

/// World of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlannedWorld {
    /// Name of the world.
    pub name: String,
    /// File in the directory of the plan.
    pub file: String,
    /// SHA-256 of that file.
    pub sha256: String,
    /// Plant to test on. `None`: the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plant: Option<PlantKind>,
}

/// Run directory of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlannedRun {
    /// Path in the directory of the plan.
    pub dir: String,
    /// SHA-256 of its policy.
    pub policy_sha256: String,
    /// Seed of its training.
    pub seed: u64,
}

/// Training that is a piece of the campaign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlannedTraining {
    /// Position of its world.
    pub world: usize,
    /// Seed of the training.
    pub seed: u64,
    /// Number of decisions. `None`: the world's own number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decisions: Option<u64>,
}

/// Pair of an ego and an ado in a world, on all starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    /// Position of the world.
    pub world: usize,
    /// Ego, with its name in rows and its difference from the world's own.
    pub ego: ChangedEgo,
    /// Ado of the unit.
    pub(crate) ado: PlannedAdo,
    /// Number of starts.
    pub starts: usize,
    /// Number of starts per piece. The last piece may have fewer.
    pub each: usize,
}

/// Ado of a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlannedAdo {
    /// Its id.
    pub id: AdversaryId,
    /// Position of the run whose policy it plays, for a trained ado of another run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<usize>,
    /// Position of the training whose policy it plays, for an ado of the campaign.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<usize>,
}

impl From<AdversaryId> for PlannedAdo {
    /// Returns an ado without a policy.
    fn from(id: AdversaryId) -> PlannedAdo {
        PlannedAdo {
            id,
            run: None,
            training: None,
        }
    }
}

/// Piece of a campaign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CampaignPiece {
    /// Number of the piece.
    pub number: usize,
    /// Work of the piece.
    pub work: Work,
}

/// Work of a piece.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// Training of the plan.
    Training(usize),
    /// Starts of a unit of the plan.
    Starts {
        /// Position of the unit.
        unit: usize,
        /// Range of its starts.
        starts: Range<usize>,
    },
}

impl CampaignPiece {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        match &self.work {
            Work::Training(_) => 0,
            Work::Starts { starts, .. } => starts.len(),
        }
    }
}

impl Unit {
    /// Returns the number of pieces of the unit.
    pub fn pieces(&self) -> usize {
        self.starts.div_ceil(self.each.max(1))
    }
}

impl Plan {
    /// Returns every piece in order.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = CampaignPiece> + '_ {
        let trainings = (0..self.trainings.len()).map(Work::Training);
        let units = self.units.iter().enumerate();
        let starts = units.flat_map(|(unit, planned)| {
            (0..planned.pieces()).map(move |nth| Work::Starts {
                unit,
                starts: nth * planned.each..((nth + 1) * planned.each).min(planned.starts),
            })
        });
        let all = trainings.chain(starts).enumerate();
        all.map(|(number, work)| CampaignPiece { number, work })
    }

    /// Returns the number of pieces.
    pub fn len(&self) -> usize {
        self.trainings.len() + self.units.iter().map(Unit::pieces).sum::<usize>()
    }

    /// Returns whether the plan has no pieces.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the plant on which a unit's ego is tested, if not the world's own.
    pub(super) fn plant(&self, unit: &Unit) -> Option<PlantKind> {
        self.worlds.get(unit.world)?.plant
    }

    /// Returns the seed of the training of an ado, if it was trained.
    pub(super) fn train_seed(&self, ado: &PlannedAdo) -> Option<u64> {
        let run = ado.run.and_then(|run| Some(self.ados.get(run)?.seed));
        run.or_else(|| Some(self.trainings.get(ado.training?)?.seed))
    }

    /// Returns the piece of a number.
    pub(crate) fn piece(&self, number: usize) -> Option<CampaignPiece> {
        // Trainings have the first numbers.
        let Some(mut nth) = number.checked_sub(self.trainings.len()) else {
            let work = Work::Training(number);
            return Some(CampaignPiece { number, work });
        };
        for (unit, planned) in self.units.iter().enumerate() {
            if let Some(later) = nth.checked_sub(planned.pieces()) {
                nth = later;
                continue;
            }
            let starts = nth * planned.each..((nth + 1) * planned.each).min(planned.starts);
            let work = Work::Starts { unit, starts };
            return Some(CampaignPiece { number, work });
        }
        None
    }

    /// Returns the hash of everything that the result of a piece depends on.
    ///
    /// A file with another question is foreign, whatever its name.
    pub(super) fn question(&self, work: &Work) -> String {
        let world = |position: usize| self.worlds.get(position);
        let request = match work {
            Work::Training(position) => {
                let training = self.trainings.get(*position);
                json!([training, training.and_then(|it| world(it.world))])
            }
            Work::Starts { unit, starts } => {
                let planned = self.units.get(*unit);
                let run = planned.and_then(|planned| self.ados.get(planned.ado.run?));
                // Another training gives another policy and other rows, so it is part of
                // the question.
                let training =
                    planned.and_then(|planned| self.trainings.get(planned.ado.training?));
                // The gate and the boundary are read by the merge only, so they are
                // not part of the question.
                json!({
                    "world": planned.and_then(|planned| world(planned.world)),
                    "ego": planned.map(|planned| &planned.ego),
                    "ado": planned.map(|planned| &planned.ado),
                    "run": run,
                    "training": training,
                    "starts": self.starts,
                    "from": starts.start,
                    "to": starts.end,
                    "preventability": self.preventability,
                })
            }
        };
        // The version is part of the question, since another version may play differently.
        let question = json!({ "format": FORMAT, "brakecheck": self.brakecheck, "asked": request });
        sha256(question.to_string().as_bytes())
    }

    /// Returns the text of the plan's file, with its hash.
    pub(super) fn text(&self) -> Result<String, serde_json::Error> {
        let unsealed = Plan {
            // The hash is computed over the text with a blank in its place.
            sha256: BLANK.to_owned(),
            ..self.clone()
        };
        Ok(seal(&format!(
            "{}\n",
            serde_json::to_string_pretty(&unsealed)?
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        let unit = |starts, each| Unit {
            world: 0,
            ego: ChangedEgo {
                name: "nominal".to_owned(),
                change: crate::world::Change::default(),
            },
            ado: AdversaryId::Hold.into(),
            starts,
            each,
        };
        Plan {
            format: FORMAT,
            sha256: String::new(),
            brakecheck: "0".to_owned(),
            name: "some".to_owned(),
            worlds: Vec::new(),
            ados: Vec::new(),
            trainings: vec![PlannedTraining {
                world: 0,
                seed: 1,
                decisions: None,
            }],
            starts: RequestedStarts::Drawn { count: 7, seed: 1 },
            preventability: false,
            gate: None,
            boundary: None,
            units: vec![unit(7, 3), unit(0, 5), unit(4, 4)],
        }
    }

    #[test]
    fn every_start_is_in_one_piece_and_every_piece_is_found_by_its_number() {
        let plan = plan();
        let all: Vec<CampaignPiece> = plan.pieces().collect();
        let works: Vec<Work> = all.iter().map(|piece| piece.work.clone()).collect();
        let of = |unit, starts| Work::Starts { unit, starts };
        let want = [
            Work::Training(0),
            of(0, 0..3),
            of(0, 3..6),
            of(0, 6..7),
            of(2, 0..4),
        ];
        assert_eq!(works, want);
        assert_eq!(plan.len(), all.len());
        for (number, piece) in all.iter().enumerate() {
            assert_eq!(plan.piece(number).as_ref(), Some(piece));
        }
        assert_eq!(plan.piece(all.len()), None);
    }

    #[test]
    fn another_question_has_another_hash() {
        let plan = plan();
        let work = Work::Starts {
            unit: 0,
            starts: 0..3,
        };
        let requested = plan.question(&work);
        let mut other = plan.clone();
        other.starts = RequestedStarts::Drawn { count: 7, seed: 2 };
        assert_ne!(other.question(&work), requested);
        let mut other = plan.clone();
        other.preventability = true;
        assert_ne!(other.question(&work), requested);
        let other = Work::Starts {
            unit: 0,
            starts: 0..2,
        };
        assert_ne!(plan.question(&other), requested);
        // Settings of the comparison are not part of what is played.
        let mut same = plan.clone();
        same.gate = Some(("nominal".to_owned(), vec![GateOn::Any]));
        same.units[0].each = 2;
        assert_eq!(same.question(&work), requested);
    }
}
