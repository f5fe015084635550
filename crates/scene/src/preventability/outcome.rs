//! Results of an assessment, as kept in files and printed.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::HUMAN_MODELS;
use super::moments::CutIn;
use crate::ego::reference::ReferenceDriver;

/// Summary of the drivers that avoid a contact. The first that fits applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Label {
    /// Every reference driver of the [panel](super::PANEL) avoids it.
    AvoidedByAll,
    /// At least one driver avoids it, and at least one does not.
    ///
    /// Earlier versions wrote `AvoidedByCompetent` if CC_LATCHED or FSM avoided it.
    #[serde(alias = "AvoidedByCompetent")]
    AvoidedBySome,
    /// No driver avoids it, but full braking without delay does.
    OnlyByPerfect,
    /// Only full braking before the first danger avoids it.
    OnlyByForesight,
    /// No driver and no full braking avoids it. A driver who steers might.
    ///
    /// Earlier versions tried full braking from the start and the first danger only.
    UnavoidableByBraking,
    /// The drivers do not apply to such a contact.
    NotApplicable,
}

impl Label {
    /// Returns the label in words.
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

/// Reason why the drivers do not apply to a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum NotApplicable {
    /// Nothing drives in this world.
    NotDriven,
    /// The episode has no contact.
    NoContact,
    /// Two other agents touched each other.
    WithoutEgo,
    /// The ego touched a pedestrian.
    OnFoot,
    /// The other crossed the ego's path.
    Crossing,
    /// The other came towards the ego.
    Oncoming,
    /// The other drove into the ego from behind.
    FromBehind,
    /// Before the contact, no agent was ahead to react to.
    NobodyAhead,
    /// Weather or friction may change on the way, and replays have those of the start.
    ChangingWeather,
    /// An ado laid the road during the episode.
    ChangingRoad,
}

/// Reason why the ego is not at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Exoneration {
    /// The ego was standing, at 0.5 m/s or less.
    Standing,
    /// The ego was struck from behind in its lane.
    StruckFromBehind,
}

/// Position of the other at a contact, relative to the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Struck {
    /// The other's middle was not behind the ego's.
    Front,
    /// The other's middle was behind the ego's, and sides touched.
    Side,
    /// The other's middle was behind the ego's, and the ego's rear was struck.
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
    /// Side of the ego that was struck.
    pub struck: Struck,
}

/// Outcome of a driver in the ego's place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriverOutcome {
    /// True if the ego had no contact.
    pub avoided: bool,
    /// Least gap in m, or minus the closing speed of the contact in m/s.
    ///
    /// The gap is to an agent ahead in the ego's path.
    ///
    /// `None` if no agent was ever there.
    pub margin: Option<f64>,
    /// Contact of the replay, if any.
    pub contact: Option<ReplayContact>,
    /// Closing speed of the recorded contact minus that of this contact.
    pub saved_mps: f64,
    /// Time of the first danger that the driver detected, since the episode's start.
    pub reacted_s: Option<f64>,
    /// True if the ados' rules are kept in the replay.
    ///
    /// The ados of a replay do not react. `None`: not evaluated, as for rules about plans or
    /// actions, which a recorded motion does not hold, and in every world with traffic
    /// lights, because the phases after the contact are unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules_kept: Option<bool>,
    /// ρ(ψ_ego) of the replay, since a specification may demand more than no contact.
    ///
    /// `None` as for [`DriverOutcome::rules_kept`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robustness: Option<f64>,
}

/// Assessment of a contact: who could have prevented it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preventability {
    /// Summary, from the handover on.
    pub label: Label,
    /// Reason why the drivers do not apply, if they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_applicable: Option<NotApplicable>,
    /// Reason why the ego is not at fault, `None` if it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exonerated: Option<Exoneration>,
    /// True if a driver avoids it from the start, but not from the handover.
    ///
    /// The ego then caused the situation itself.
    #[serde(default)]
    pub self_inflicted: bool,
    /// Time at which the drivers take over, since the start of the episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handover_s: Option<f64>,
    /// Time at which the driver without delay takes over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub danger_s: Option<f64>,
    /// Outcome of each driver from the handover on. The recorded ego drives before.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub handover: IndexMap<ReferenceDriver, DriverOutcome>,
    /// Outcome of each driver from the start on.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub t0: IndexMap<ReferenceDriver, DriverOutcome>,
    /// Outcome of full braking from the first sign of danger.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perfect: Option<DriverOutcome>,
    /// Outcome of full braking from the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foresight: Option<DriverOutcome>,
    /// Result of UN R157's formula for the cut-in, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cut_in: Option<CutIn>,
}

impl Exoneration {
    /// Returns the reason as a clause, for tables and pages.
    pub fn words(self) -> &'static str {
        match self {
            Exoneration::Standing => "the ego stands",
            Exoneration::StruckFromBehind => "the ego is struck from behind in its lane",
        }
    }
}

impl NotApplicable {
    /// Returns the reason as a clause, for tables and pages.
    pub fn words(self) -> &'static str {
        match self {
            NotApplicable::NotDriven => "nothing drives in this world",
            NotApplicable::NoContact => "there was no contact",
            NotApplicable::WithoutEgo => "two others hit each other",
            NotApplicable::OnFoot => "a pedestrian was hit",
            NotApplicable::Crossing => "the other came across",
            NotApplicable::Oncoming => "the other was oncoming",
            NotApplicable::FromBehind => "the other came from behind",
            NotApplicable::NobodyAhead => "no road user was ahead",
            NotApplicable::ChangingWeather => "the weather changed on the way",
            NotApplicable::ChangingRoad => "the road was laid on the way",
        }
    }
}

impl std::fmt::Display for Preventability {
    /// Writes a line: the drivers that avoid it, those that do not, exoneration.
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
    /// Creates an assessment to which the drivers do not apply.
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

    /// Returns the names of drivers that avoid it from the handover on, and the others.
    pub fn drivers(&self) -> [Vec<&'static str>; 2] {
        [true, false].map(|avoided| {
            let drivers = self
                .handover
                .iter()
                .filter(|(_, outcome)| outcome.avoided == avoided);
            drivers.map(|(driver, _)| driver.name()).collect()
        })
    }

    /// Returns the number and names of drivers that avoid it, as a clause.
    ///
    /// If no driver avoids it, the clause states the effect of braking. `None` if the
    /// drivers do not apply.
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
            Label::OnlyByForesight => "only full braking before the first danger avoids it",
            Label::UnavoidableByBraking => {
                "full braking from the first danger or from the start does not avoid it either"
            }
            // Invariant: of these labels two have drivers that avoid it.
            Label::AvoidedByAll | Label::AvoidedBySome | Label::NotApplicable => return None,
        };
        Some(format!(
            "avoided by none of {all} reference drivers; {besides}"
        ))
    }

    /// Returns a driver that avoids it, from the handover or from the start on.
    pub fn any_driver(&self) -> Option<ReferenceDriver> {
        let mut outcomes = self.handover.iter().chain(&self.t0);
        let (driver, _) = outcomes.find(|(_, outcome)| outcome.avoided)?;
        Some(*driver)
    }

    /// Returns whether a human model of UN R157 avoids it, CC_LATCHED or FSM.
    ///
    /// `None` if the drivers do not apply.
    pub fn human_model_avoids(&self) -> Option<bool> {
        let applies = self.label != Label::NotApplicable;
        let mut humans = HUMAN_MODELS.into_iter();
        // A model that was never asked has not failed.
        applies.then(|| humans.any(|driver| self.is_avoided_by(driver)))
    }

    /// Returns whether a driver avoids it from the handover on.
    pub fn is_avoided_by(&self, driver: ReferenceDriver) -> bool {
        let outcome = match driver {
            // It takes over at the first danger, so it is none of those at the
            // handover.
            ReferenceDriver::Ideal => self.perfect.as_ref(),
            _ => self.handover.get(&driver),
        };
        outcome.is_some_and(|outcome| outcome.avoided)
    }

    /// Derives label and self-infliction from the outcomes.
    ///
    /// Without outcomes both stay unchanged.
    pub(super) fn label_outcomes(&mut self) {
        let held = |outcome: &Option<DriverOutcome>| outcome.as_ref().is_some_and(|it| it.avoided);
        let [avoids, hits] = self.drivers();
        self.label = match (avoids.is_empty(), hits.is_empty()) {
            // No driver was asked, so the label stays the one of the reason why.
            (true, true) => return,
            (false, true) => Label::AvoidedByAll,
            (false, false) => Label::AvoidedBySome,
            // From the mildest demand to the hardest, so that the first that holds is the
            // label.
            _ if held(&self.perfect) => Label::OnlyByPerfect,
            _ if held(&self.foresight) => Label::OnlyByForesight,
            _ => Label::UnavoidableByBraking,
        };
        // A driver that avoids it only from the start shows that the ego caused it.
        let from_start = self.t0.iter().filter(|(_, outcome)| outcome.avoided);
        let driver = from_start.map(|(driver, _)| *driver);
        self.self_inflicted = driver.into_iter().any(|driver| !self.is_avoided_by(driver));
    }
}
