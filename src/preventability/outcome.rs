//! What an assessment says, as it is kept and shown.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::moments::CutIn;
use crate::ego::reference::ReferenceDriver;

/// Who avoids a contact, summed up; the first that fits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Label {
    /// Every reference driver of the [panel](super::PANEL) avoids it.
    AvoidedByAll,
    /// At least one of them does, and at least one does not.
    AvoidedBySome,
    /// None of them does; full braking without delay does.
    OnlyByPerfect,
    /// Only full braking from the very beginning does.
    OnlyByForesight,
    /// Not even that one; a driver who steers might.
    UnavoidableByBraking,
    /// The drivers do not apply to such a contact.
    NotApplicable,
}

impl Label {
    /// The label in words.
    pub fn words(self) -> &'static str {
        match self {
            Label::AvoidedByAll => "avoided by all",
            Label::AvoidedBySome => "avoided by some",
            Label::OnlyByPerfect => "only by a perfect driver",
            Label::OnlyByForesight => "only by foresight",
            Label::UnavoidableByBraking => "unavoidable by braking",
            Label::NotApplicable => "not applicable",
        }
    }
}

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.words())
    }
}

/// Why the drivers say nothing of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum NotApplicable {
    /// Nothing drives in this world.
    NotDriven,
    /// Nobody was hit.
    NoContact,
    /// Two others hit each other.
    WithoutEgo,
    /// Somebody on foot was hit.
    OnFoot,
    /// The other came across the ego's way.
    Crossing,
    /// The other came towards the ego.
    Oncoming,
    /// The other drove into the ego from behind.
    FromBehind,
    /// Before the contact nobody was ahead whom a driver could have answered.
    NobodyAhead,
}

/// Why the ego is not at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Exoneration {
    /// It stood: its speed was 0.5 m/s or less.
    Standing,
    /// It was struck from behind while it was in its lane.
    StruckFromBehind,
}

/// Where the other was at a contact, seen from the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Struck {
    /// Its middle was not behind the ego's.
    Front,
    /// It was, and sides touched.
    Side,
    /// It was, and the ego's rear was hit.
    Rear,
}

/// A contact in a replay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayContact {
    /// Name of the agent that the ego touched.
    pub with: String,
    /// Time of the first touch, since the start of the episode.
    pub time_s: f64,
    /// Approach speed along the contact normal.
    pub closing_speed_mps: f64,
    /// Where the ego was struck.
    pub struck: Struck,
}

/// How a driver fared in the ego's place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriverOutcome {
    /// Whether nothing touched the ego.
    pub avoided: bool,
    /// Least gap to somebody ahead in the ego's path at a sample, m, or minus
    /// the closing speed of the contact, m/s; `None`: nobody was ever there.
    pub margin: Option<f64>,
    /// The contact, if there was one.
    pub contact: Option<ReplayContact>,
    /// Closing speed of the recorded contact less this one's.
    pub saved_mps: f64,
    /// When it first saw danger, since the start of the episode.
    pub reacted_s: Option<f64>,
    /// Whether the ados' rules hold on the replay, though its ados react to
    /// nothing; `None`: not looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules_kept: Option<bool>,
    /// ρ(ψ_ego) on the replay: avoiding the contact is not all that is asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robustness: Option<f64>,
}

/// Whether a contact was preventable, and by whom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preventability {
    /// The sum of it, from the handover on.
    pub label: Label,
    /// Why it says nothing, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_applicable: Option<NotApplicable>,
    /// Why the ego is not at fault; `None`: it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exonerated: Option<Exoneration>,
    /// Whether a driver avoids it from the start, though not from the handover:
    /// the ego had brought itself there.
    #[serde(default)]
    pub self_inflicted: bool,
    /// When drivers take over, since the start of the episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handover_s: Option<f64>,
    /// When the driver without delay takes over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub danger_s: Option<f64>,
    /// Each driver from the handover on; before, the recorded ego drives.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub handover: IndexMap<ReferenceDriver, DriverOutcome>,
    /// Each driver from the start on.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub t0: IndexMap<ReferenceDriver, DriverOutcome>,
    /// Full braking from the first sign of danger.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perfect: Option<DriverOutcome>,
    /// Full braking from the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foresight: Option<DriverOutcome>,
    /// What UN R157's formula says of the cut-in, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_in: Option<CutIn>,
}

impl Exoneration {
    /// The reason as a clause, for tables and pages.
    pub fn words(self) -> &'static str {
        match self {
            Exoneration::Standing => "the ego stands",
            Exoneration::StruckFromBehind => "the ego is struck from behind in its lane",
        }
    }
}

impl NotApplicable {
    /// The reason as a clause, for tables and pages.
    pub fn words(self) -> &'static str {
        match self {
            NotApplicable::NotDriven => "nothing drives in this world",
            NotApplicable::NoContact => "nobody was hit",
            NotApplicable::WithoutEgo => "two others hit each other",
            NotApplicable::OnFoot => "somebody on foot was hit",
            NotApplicable::Crossing => "the other came across",
            NotApplicable::Oncoming => "the other was oncoming",
            NotApplicable::FromBehind => "the other came from behind",
            NotApplicable::NobodyAhead => "nobody was ahead to be answered",
        }
    }
}

impl std::fmt::Display for Preventability {
    /// One line: who avoids it and who does not, and whose fault it is not.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.who_avoids() {
            Some(who) => f.write_str(&who)?,
            None => write!(f, "reference drivers: {}", self.label)?,
        }
        if let Some(why) = self.not_applicable {
            write!(f, ", since {}", why.words())?;
        }
        let [_, others] = self.drivers();
        if self.label == Label::AvoidedBySome {
            write!(f, ", not by {}", others.join(", "))?;
        }
        if self.self_inflicted {
            f.write_str("; self-inflicted")?;
        }
        match self.exonerated {
            Some(why) => write!(f, "; not the ego's fault: {}", why.words()),
            None => Ok(()),
        }
    }
}

impl Preventability {
    /// Nothing can be said.
    pub fn not_applicable(why: NotApplicable) -> Preventability {
        Preventability {
            label: Label::NotApplicable,
            not_applicable: Some(why),
            exonerated: None,
            self_inflicted: false,
            handover_s: None,
            danger_s: None,
            handover: IndexMap::new(),
            t0: IndexMap::new(),
            perfect: None,
            foresight: None,
            cut_in: None,
        }
    }

    /// Names of the drivers that avoid it from the handover on, and of those
    /// that do not.
    pub fn drivers(&self) -> [Vec<&'static str>; 2] {
        [true, false].map(|avoided| {
            let drivers = self.handover.iter();
            let drivers = drivers.filter(|(_, outcome)| outcome.avoided == avoided);
            drivers.map(|(driver, _)| driver.name()).collect()
        })
    }

    /// How many of the reference drivers avoid it, and which; where none does,
    /// what braking could do.
    ///
    /// `None`: the drivers do not apply.
    pub fn who_avoids(&self) -> Option<String> {
        let all = self.handover.len();
        let [names, _] = self.drivers();
        if !names.is_empty() {
            let (some, names) = (names.len(), names.join(", "));
            return Some(format!(
                "avoided by {some} of {all} reference drivers ({names})"
            ));
        }
        let besides = match self.label {
            Label::OnlyByPerfect => "only full braking without delay avoids it",
            Label::OnlyByForesight => "only full braking from the very start avoids it",
            Label::UnavoidableByBraking => "no braking avoids it",
            // Invariant: of these labels two have drivers that avoid it.
            Label::AvoidedByAll | Label::AvoidedBySome | Label::NotApplicable => return None,
        };
        Some(format!(
            "avoided by none of {all} reference drivers; {besides}"
        ))
    }

    /// Whether a human model of UN R157 avoids it, CC_LATCHED or FSM.
    ///
    /// `None`: the drivers do not apply.
    pub fn human_model_avoids(&self) -> Option<bool> {
        let applies = self.label != Label::NotApplicable;
        let humans = [ReferenceDriver::CcLatched, ReferenceDriver::Fsm];
        applies.then(|| humans.into_iter().any(|driver| self.is_avoided_by(driver)))
    }

    /// Whether the ego touched somebody and nothing says that it is not at fault.
    pub fn is_at_fault(&self) -> bool {
        use NotApplicable::{NoContact, NotDriven, WithoutEgo};
        let why = self.not_applicable;
        let touched = !why.is_some_and(|it| [NoContact, NotDriven, WithoutEgo].contains(&it));
        touched && self.exonerated.is_none()
    }

    /// Whether a driver of the panel avoids it from the handover on.
    pub fn is_avoided_by(&self, driver: ReferenceDriver) -> bool {
        let outcome = match driver {
            ReferenceDriver::Ideal => self.perfect.as_ref(),
            _ => self.handover.get(&driver),
        };
        outcome.is_some_and(|outcome| outcome.avoided)
    }

    /// Takes label and self-infliction from the outcomes. Without any, they stay as
    /// they are.
    pub(super) fn label_outcomes(&mut self) {
        let held = |outcome: &Option<DriverOutcome>| outcome.as_ref().is_some_and(|it| it.avoided);
        let [avoids, hits] = self.drivers();
        self.label = match (avoids.is_empty(), hits.is_empty()) {
            (true, true) => return,
            (false, true) => Label::AvoidedByAll,
            (false, false) => Label::AvoidedBySome,
            _ if held(&self.perfect) => Label::OnlyByPerfect,
            _ if held(&self.foresight) => Label::OnlyByForesight,
            _ => Label::UnavoidableByBraking,
        };
        let from_start = self.t0.iter().filter(|(_, outcome)| outcome.avoided);
        let driver = from_start.map(|(driver, _)| *driver);
        self.self_inflicted = driver.into_iter().any(|driver| !self.is_avoided_by(driver));
    }
}
