//! Avoidability of a crash, as gates and campaigns count it.

use super::outcome::{Label, Preventability};

/// Avoidability of a crash by reference drivers in the ego's place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Avoidability {
    /// A human model of UN R157 avoids it, CC_LATCHED or FSM.
    Preventable,
    /// Another driver avoids it, or a driver that drives from the start.
    ///
    /// The other drivers are the rest of the panel and full braking without delay.
    Avoidable,
    /// The drivers apply, and none of them avoids it, not even without delay.
    Unavoidable,
    /// The drivers do not apply, or were not asked.
    #[default]
    Unknown,
}

impl Avoidability {
    /// Returns whether a human model avoids it. `None`: unknown.
    pub fn preventable(self) -> Option<bool> {
        (self != Avoidability::Unknown).then_some(self == Avoidability::Preventable)
    }

    /// Returns whether no driver avoids it. `None`: unknown.
    pub fn unavoidable(self) -> Option<bool> {
        (self != Avoidability::Unknown).then_some(self == Avoidability::Unavoidable)
    }

    /// Combines the values of `preventable` and `unavoidable` in a stored row.
    pub fn of_row(preventable: Option<bool>, unavoidable: Option<bool>) -> Avoidability {
        match (preventable, unavoidable) {
            (Some(true), _) => Avoidability::Preventable,
            (Some(false), Some(true)) => Avoidability::Unavoidable,
            (Some(false), Some(false)) => Avoidability::Avoidable,
            _ => Avoidability::Unknown,
        }
    }
}

impl Preventability {
    /// Returns the avoidability of the crash.
    ///
    /// A self-inflicted crash is avoidable, because a driver from the start avoids it.
    /// A crash that only full braking from the very start avoids is unavoidable, because
    /// that brake knows the future.
    pub fn avoidability(&self) -> Avoidability {
        match self.label {
            // The human models come first, because the label does not tell drivers
            // apart.
            _ if self.human_model_avoids() == Some(true) => Avoidability::Preventable,
            _ if self.self_inflicted => Avoidability::Avoidable,
            Label::AvoidedByAll | Label::AvoidedBySome | Label::OnlyByPerfect => {
                Avoidability::Avoidable
            }
            Label::OnlyByForesight | Label::UnavoidableByBraking => Avoidability::Unavoidable,
            Label::NotApplicable => Avoidability::Unknown,
        }
    }
}

#[cfg(test)]
mod tests;
