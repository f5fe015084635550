//! Calibration of a training: evidence that the ado learned its world.

use serde::{Deserialize, Serialize};

use super::counted;
use crate::stats::wilson;
use crate::testbench::Sampling;

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
    /// Starts that the search solved with at most one switch.
    #[serde(default)]
    pub one_switch: u64,
    /// Starts that neither solved and on which the search did not try all sequences.
    ///
    /// A full search might solve them.
    #[serde(default)]
    pub undecided: u64,
    /// Starts of the search that the ado solves only with drawn actions.
    #[serde(default)]
    pub drawn: u64,
    /// Simulations of the search.
    #[serde(default)]
    pub search_simulations: u64,
    /// Sequences with at most one switch and with at most two switches.
    #[serde(default)]
    pub sequences: [u64; 2],
}

/// Least number of starts that a search must solve for a meaningful share.
const ENOUGH: u64 = 10;
/// Share from which an ado counts as trained.
const LEARNED: f64 = 0.9;
/// Share of undecided starts from which the search was too short to judge an ado.
const STARVED: f64 = 0.2;
/// Percentage from which training need not continue.
const COMPLETE: u64 = 97;
/// Starts of the comparison that a warning suggests, and simulations of a sampling search.
const FULL: (u64, u64) = (100, 100);
/// Simulations and processor time from which a suggested comparison is too costly.
const COSTLY: (u64, f64) = (1_000_000, 3600.0);

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

    /// Returns Wilson's 95 % interval of the recall. `None` if the search solved nothing.
    pub fn recall_ci95(&self) -> Option<[f64; 2]> {
        let solved = self.searched as usize;
        (solved > 0).then(|| wilson(self.both as usize, solved))
    }

    /// Returns true if the ado solves nearly all of enough search-solved starts.
    pub fn is_complete(&self) -> bool {
        // Whole numbers, so that no rounding moves the threshold.
        self.searched >= ENOUGH && COMPLETE * self.searched <= 100 * self.both
    }

    /// Returns the search in words.
    fn search(&self) -> String {
        let switches = counted(self.switches, "switch");
        // Calibrations of earlier versions have no cost of their search.
        match self.search_simulations {
            0 => format!("a search with at most {switches} of action"),
            some => {
                let simulations = counted(some, "simulation");
                format!("a search with at most {switches} of action and {simulations}")
            }
        }
    }

    /// Returns the result: the ado's share, its interval and the search behind it.
    pub fn in_words(&self) -> String {
        let (starts, search) = (self.starts, self.search());
        let Some(ci95) = self.recall_ci95() else {
            return format!(
                "{search} solves none of {starts} calibration starts, and the ado solves {}",
                self.solved()
            );
        };
        let [lo, hi] = ci95.map(|share| 100.0 * share);
        let mut text = format!(
            "the ado solves {} of the {} calibration starts, out of {starts}, that {search} solves \
             (95 % interval {lo:.0} to {hi:.0} %)",
            self.both, self.searched
        );
        if self.drawn > 0 {
            let Sampling { temperature, draws } = Sampling::SECOND_LOOK;
            text.push_str(&format!(
                "; with {draws} draws of its actions at temperature {temperature} it also solves \
                 {} of the {} that it misses",
                self.drawn,
                self.searched - self.both
            ));
        }
        if self.undecided > 0 {
            text.push_str(&format!(
                "; the search gave up on {} that the ado does not solve either",
                self.undecided
            ));
        }
        text
    }

    /// Returns the warning of an ado that is not reliable. `None` if it is.
    pub fn warning(&self) -> Option<CalibrationWarning> {
        self.warning_at(None)
    }

    /// Returns the warning, with the cost of its advice.
    ///
    /// `seconds` is the processor time of a simulation of the search, if known.
    pub fn warning_at(&self, seconds: Option<f64>) -> Option<CalibrationWarning> {
        let warn = |what: String, help: String| Some(CalibrationWarning { what, help });
        let (searched, both, starts) = (self.searched, self.both, self.starts);
        if searched == 0 && self.solved() == 0 {
            return warn(
                format!(
                    "neither the ado nor {} makes the ego violate its specification on any of \
                     {starts} calibration starts: there may be nothing to find",
                    self.search()
                ),
                format!(
                    "look whether the ados' actions and rules leave room for it, then whether the \
                     ego's specification asks for what you mean, then {}",
                    self.comparison(seconds)
                ),
            );
        }
        // Too few to judge. An ado that solves none of them gets the stronger warning below.
        if searched < ENOUGH && (both > 0 || searched == 0) {
            return warn(
                format!(
                    "{} solves only {searched} of {starts} calibration starts, too few to say \
                     whether the ado has learned this world: it solves {}",
                    self.search(),
                    self.solved()
                ),
                self.comparison(seconds),
            );
        }
        // Invariant: without a start that the search solves, a branch above has returned.
        let [lo, hi] = self.recall_ci95()?;
        let result = self.in_words();
        // A recall of 0 has an upper bound of 0.8 at most, so it is always below.
        if hi < LEARNED {
            let never = if self.solved() == 0 {
                "it never learned this world"
            } else {
                "it has not learned this world"
            };
            return warn(
                format!("{result}: {never}"),
                "look whether the ado observes what its rules and the ego's specification read \
                 (`brakecheck check`), and leave out `--decisions` if you gave it: the default \
                 training goes on and searches where the ado fails"
                    .to_owned(),
            );
        }
        let bar = 100.0 * LEARNED;
        if lo < LEARNED {
            return warn(
                format!(
                    "{result}: so few starts do not show that it has learned this world, {bar:.0} %"
                ),
                self.comparison(seconds),
            );
        }
        // If all undecided starts had a success, the ado would miss it on each of them.
        let perhaps = (searched + self.ado_only + self.undecided) as f64;
        if self.undecided as f64 > STARVED * perhaps {
            return warn(
                format!("{result}, so a larger search may find more"),
                self.comparison(seconds),
            );
        }
        None
    }

    /// Returns the advice to compare the ado with a better search, and its cost.
    fn comparison(&self, seconds: Option<f64>) -> String {
        let (starts, budget) = FULL;
        let costly = |simulations: u64| {
            let cpu_s = seconds.map(|seconds| seconds * simulations as f64);
            // Without a measured speed, the number alone must decide.
            cpu_s.map_or(simulations > COSTLY.0, |cpu_s| cpu_s > COSTLY.1)
        };
        // A second switch is worth its cost only where it solved something.
        let wanted = if self.searched > self.one_switch {
            2
        } else {
            1
        };
        // The larger search first, because it shows more wherever it is affordable.
        let all_walks = (1..=wanted).rev().map(|switches: usize| {
            let each = self.sequences[switches - 1];
            (switches, starts.saturating_mul(each))
        });
        // Where the search solves nothing, more of the same hardly helps.
        let mut walks = all_walks.filter(|(_, all)| self.searched > 0 && *all > 0 && !costly(*all));
        let (command, simulations) = match walks.next() {
            Some((switches, all)) => (
                format!("brakecheck eval RUN --starts {starts} --search {switches}"),
                all,
            ),
            None => (
                format!("brakecheck search RUN --method cem --budget {budget} --starts {starts}"),
                starts * budget,
            ),
        };
        let time = seconds.map_or(String::new(), |seconds| {
            format!(", at most about {}", duration(seconds * simulations as f64))
        });
        format!(
            "compare the ado with a larger search: `{command}` (at most {simulations} \
             simulations{time})"
        )
    }
}

/// Returns a processor time in the unit of its size, rounded up.
fn duration(cpu_s: f64) -> String {
    // From two of a unit on, since a single one that is rounded up may be twice the time.
    match cpu_s {
        few if few < 120.0 => format!("{:.0} CPU seconds", few.ceil()),
        some if some < 7200.0 => format!("{:.0} CPU minutes", (some / 60.0).ceil()),
        many => format!("{:.0} CPU hours", (many / 3600.0).ceil()),
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
    /// Returns the reason in words, to follow "ended:", with its evidence.
    pub fn in_words(self, calibration: Option<&Calibration>) -> String {
        match (self, calibration) {
            (TrainingEnd::Learned, Some(calibration)) => calibration.in_words(),
            (TrainingEnd::Learned, None) => {
                "on calibration starts the ado solves what a search solves".to_owned()
            }
            (TrainingEnd::Asked, _) => "the decisions asked for are taken".to_owned(),
            (TrainingEnd::Settled, _) => "going on did not help any more".to_owned(),
            (TrainingEnd::Longest, _) => "its settings allow no longer training".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration(searched: u64, both: u64, ado_only: u64) -> Calibration {
        Calibration {
            starts: 100,
            switches: 2,
            searched,
            both,
            ado_only,
            one_switch: searched,
            search_simulations: 5000,
            sequences: [90, 4000],
            ..Calibration::default()
        }
    }

    fn says(calibration: Calibration) -> Option<String> {
        calibration.warning().map(|warning| warning.what)
    }

    #[test]
    fn an_ado_that_misses_what_search_finds_is_warned_of_and_others_are_not() {
        let never = says(calibration(40, 0, 0)).expect("a warning");
        assert!(never.contains("0 of the 40"), "{never}");
        assert!(never.contains("never learned"), "{never}");
        let half = says(calibration(40, 20, 3)).expect("a warning");
        assert!(half.contains("20 of the 40"), "{half}");
        assert!(half.contains("has not learned"), "{half}");
        let nothing = says(calibration(0, 0, 0)).expect("a warning");
        assert!(nothing.contains("nothing to find"), "{nothing}");
        assert_eq!(says(calibration(90, 88, 0)), None);
        let few = says(calibration(5, 0, 0)).expect("a warning");
        assert!(few.contains("0 of the 5"), "{few}");
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
    fn few_starts_show_no_recall_and_a_starved_search_is_named() {
        let unsure = says(calibration(51, 46, 0)).expect("a warning");
        for part in [
            "46 of the 51 calibration starts, out of 100",
            "at most 2 switches of action and 5000 simulations",
            "95 % interval 79 to 96 %",
            "do not show that it has learned this world, 90 %",
        ] {
            assert!(unsure.contains(part), "{part}: {unsure}");
        }
        let starved = Calibration {
            undecided: 28,
            ..calibration(72, 70, 0)
        };
        let words = says(starved).expect("a warning");
        assert!(words.contains("gave up on 28 that"), "{words}");
        assert!(words.ends_with("a larger search may find more"), "{words}");
        // Even if a full search solves both of them, the ado has learned the world.
        let undecided = Calibration {
            undecided: 2,
            ..calibration(90, 88, 0)
        };
        assert_eq!(says(undecided), None);
        let none = calibration(0, 0, 100).in_words();
        assert!(none.contains("solves none of 100"), "{none}");
        assert!(!none.contains("of the 0"), "{none}");
    }

    #[test]
    fn the_advice_states_its_cost_and_no_second_switch_that_solved_nothing() {
        let help = |calibration: Calibration, seconds: Option<f64>| {
            let warning = calibration.warning_at(seconds).expect("a warning");
            warning.help
        };
        let one = help(calibration(51, 46, 0), None);
        assert!(
            one.contains("--starts 100 --search 1` (at most 9000 "),
            "{one}"
        );
        let two = Calibration {
            one_switch: 40,
            ..calibration(51, 46, 0)
        };
        let cheap = help(two, Some(1e-4));
        let cost = "--search 2` (at most 400000 simulations, at most about 40 CPU seconds)";
        assert!(cheap.contains(cost), "{cheap}");
        // 4,000 s of two switches are too much, and 90 s of one are not.
        let dear = help(two, Some(1e-2));
        assert!(dear.contains("--search 1` (at most 9000 "), "{dear}");
        let nothing = help(calibration(0, 0, 0), Some(1.0));
        let cost = "--method cem --budget 100 --starts 100` (at most 10000 simulations, at most \
                    about 3 CPU hours)";
        assert!(nothing.contains(cost), "{nothing}");
    }

    #[test]
    fn a_second_look_with_drawn_actions_is_reported() {
        let drawn = Calibration {
            drawn: 3,
            ..calibration(51, 46, 0)
        };
        let words = TrainingEnd::Learned.in_words(Some(&drawn));
        let says = "with 20 draws of its actions at temperature 0.1 it also solves 3 of the 5 that \
                    it misses";
        assert!(words.contains(says), "{words}");
        assert!(!calibration(51, 46, 0).in_words().contains("draws"));
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
