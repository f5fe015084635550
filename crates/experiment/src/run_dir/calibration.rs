//! Calibration of a training: evidence that the ado learned its world.

use serde::{Deserialize, Serialize};

/// Comparison of an ado with a cheap search, on starts that no result reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Calibration {
    /// Starts of the comparison.
    pub starts: u64,
    /// Greatest number of action switches that the search tried.
    pub switches: u64,
    /// Starts that the search solved.
    pub searched: u64,
    /// Starts that both solved.
    pub both: u64,
    /// Starts that only the ado solved.
    pub ado_only: u64,
    /// Simulations of the comparison, including the search.
    pub simulations: u64,
}

/// Least number of starts that a search must solve for a meaningful share.
const ENOUGH: u64 = 10;
/// Percentage from which an ado counts as trained.
const LEARNED: u64 = 90;
/// Percentage from which training need not continue.
const COMPLETE: u64 = 97;

impl Calibration {
    /// Returns the number of starts that the ado solved.
    pub fn solved(&self) -> u64 {
        self.both + self.ado_only
    }

    /// Returns the share of the search-solved starts that the ado solves too.
    ///
    /// `None` if the search solved too few starts.
    pub fn recall(&self) -> Option<f64> {
        (self.searched >= ENOUGH).then(|| self.both as f64 / self.searched as f64)
    }

    /// Returns true if the ado solves nearly all of enough search-solved starts.
    pub fn is_complete(&self) -> bool {
        // Whole numbers, so that no rounding moves the threshold.
        ENOUGH <= self.searched && COMPLETE * self.searched <= 100 * self.both
    }

    /// Returns the warning of an ado that is not reliable. `None` if it is.
    pub fn warning(&self) -> Option<CalibrationWarning> {
        let search = format!(
            "a short search with at most {} {} of action",
            self.switches,
            if self.switches == 1 {
                "switch"
            } else {
                "switches"
            }
        );
        let (searched, both, starts) = (self.searched, self.both, self.starts);
        let what = match (searched, self.solved()) {
            (0, 0) => {
                return Some(CalibrationWarning {
                    what: format!(
                        "neither the ado nor {search} makes the ego fail on any of {starts} \
                         calibration starts: there may be nothing to find"
                    ),
                    help: "look whether the ados' actions and rules leave room for it, \
                           then whether the ego's specification asks for what you mean"
                        .to_owned(),
                });
            }
            // Too few to judge. An ado that solves none of them gets the
            // stronger warning below.
            (few, _) if few < ENOUGH && (0 < both || few == 0) => {
                return Some(CalibrationWarning {
                    what: format!(
                        "{search} solves only {searched} of {starts} calibration starts, too few \
                         to say whether the ado has learned this world: it solves {}",
                        self.solved()
                    ),
                    help:
                        "the search of a training has few simulations; compare the ado with a full \
                           one: `brakecheck eval RUN --starts 1000 --search 2`"
                            .to_owned(),
                });
            }
            _ if LEARNED * searched <= 100 * both => return None,
            (_, 0) => format!(
                "the ado solves none of the {searched} calibration starts, out of {starts}, that \
                 {search} solves: it never learned this world"
            ),
            _ => format!(
                "the ado solves {both} of the {searched} calibration starts, out of {starts}, that \
                 {search} solves: it has not learned this world"
            ),
        };
        Some(CalibrationWarning {
            what,
            help: "look whether the ado observes what its rules and the ego's specification read \
                   (`brakecheck check`), and leave out `--decisions` if you gave it: the default \
                   training goes on and searches where the ado fails"
                .to_owned(),
        })
    }
}

/// Warning of a training without the expected result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CalibrationWarning {
    /// Observation.
    pub what: String,
    /// Advice.
    pub help: String,
}

/// Reason for the end of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TrainingEnd {
    /// The requested number of decisions was taken.
    Asked,
    /// The ado solves the starts that a search solves.
    Learned,
    /// Further training brought no improvement.
    Settled,
    /// The settings allow no longer training.
    Longest,
}

impl TrainingEnd {
    /// Returns the reason in words, to follow "ended:".
    pub fn in_words(self) -> &'static str {
        match self {
            TrainingEnd::Asked => "the decisions asked for are taken",
            TrainingEnd::Learned => "on calibration starts the ado solves what a search solves",
            TrainingEnd::Settled => "going on did not help any more",
            TrainingEnd::Longest => "its settings allow no longer training",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration(searched: u64, both: u64, ado_only: u64) -> Calibration {
        Calibration {
            starts: 100,
            switches: 1,
            searched,
            both,
            ado_only,
            simulations: 0,
        }
    }

    #[test]
    fn an_ado_that_misses_what_search_finds_is_warned_of_and_others_are_not() {
        let says = |calibration: Calibration| calibration.warning().map(|warning| warning.what);
        let never = says(calibration(40, 0, 0)).expect("a warning");
        assert!(never.contains("none of the 40"), "{never}");
        assert!(never.contains("never learned"), "{never}");
        let half = says(calibration(40, 20, 3)).expect("a warning");
        assert!(half.contains("20 of the 40"), "{half}");
        assert!(half.contains("has not learned"), "{half}");
        let nothing = says(calibration(0, 0, 0)).expect("a warning");
        assert!(nothing.contains("nothing to find"), "{nothing}");
        assert_eq!(says(calibration(40, 38, 0)), None);
        let few = says(calibration(5, 0, 0)).expect("a warning");
        assert!(few.contains("none of the 5"), "{few}");
        // Fewer than the search must solve, or more than the search found.
        let unsure = says(calibration(9, 4, 1)).expect("a warning");
        assert!(
            unsure.contains("only 9 of 100") && unsure.ends_with("it solves 5"),
            "{unsure}"
        );
        let unsure = says(calibration(0, 0, 30)).expect("a warning");
        assert!(
            unsure.contains("only 0 of 100") && unsure.ends_with("it solves 30"),
            "{unsure}"
        );
    }

    #[test]
    fn a_training_goes_on_where_search_still_finds_more() {
        assert!(!calibration(40, 38, 60).is_complete());
        assert!(calibration(40, 39, 0).is_complete());
        // Too few search-solved starts.
        assert!(!calibration(5, 5, 0).is_complete());
        assert!(!calibration(0, 0, 30).is_complete());
        assert_eq!(calibration(5, 5, 0).recall(), None);
        assert_eq!(calibration(40, 30, 9).recall(), Some(0.75));
    }
}
