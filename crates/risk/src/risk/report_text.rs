//! Risk in words: the verdict, the readings and the checks.

use std::fmt::{self, Display, Formatter, Write};

use super::checks::Checks;
use super::pool::RiskEstimate;
use super::report::{EgoRisk, RiskCost, RiskReadings, RiskReport};
use super::run_faults::RunFaults;
use crate::report::TextTable;
use crate::rulebook::Counts;

impl RiskReport {
    fn readings_of(&self, f: &mut String, ego: &EgoRisk) -> fmt::Result {
        match &ego.between {
            Some(between) => {
                let [held, failing] = ["if no fault is a failure", "if every fault is one"];
                writeln!(f, "{:24}{held:30}{failing:30}share of", ego.ego)?;
                for (row, [least, most]) in pairs(&between.least, &between.most) {
                    let cell = |it: Option<RiskEstimate>| match it {
                        Some(it) => format!("{}, {}", number(it.probability), interval(&it)),
                        None => "none observed".to_owned(),
                    };
                    let (name, of) = (row.name, row.share_of(ego));
                    writeln!(f, "{name:24}{:30}{:30}{of}", cell(least), cell(most))?;
                }
            }
            None => {
                let name = &ego.ego;
                writeln!(
                    f,
                    "{name:24}probability    95 % interval          ESS     share of"
                )?;
                for (row, [risk, _]) in pairs(&ego.readings, &ego.readings) {
                    let (name, of) = (row.name, row.share_of(ego));
                    match risk {
                        Some(risk) => writeln!(
                            f,
                            "{name:24}{:<15}{:<23}{:<8.0}{of}",
                            number(risk.probability),
                            interval(&risk),
                            risk.ess
                        )?,
                        None => writeln!(f, "{name:24}{:46}{of}", "none observed")?,
                    }
                }
            }
        }
        if !ego.modes.is_empty() {
            writeln!(f, "of the failures:")?;
        }
        for mode in &ego.modes {
            writeln!(
                f,
                "{:5.1} %  {:.1e}  {}",
                100.0 * mode.share,
                mode.risk.probability,
                mode.mode
            )?;
        }
        if let Some(share) = ego.known_share {
            let share = 100.0 * share;
            writeln!(f, "{share:5.1} %  of kinds that known counterexamples show")?;
        }
        if let (Some(exposure), Some(risks)) = (self.exposure, ego.least_and_most()) {
            let [least, most] = risks.map(|it| it.scaled(exposure.encounters()));
            let rate = match &ego.between {
                Some(_) => format!(
                    "{} to {}",
                    number(least.probability),
                    number(most.probability)
                ),
                None => number(least.probability),
            };
            writeln!(
                f,
                "{} encounters {}: {rate} failures, {} … {}",
                exposure.encounters(),
                exposure.unit(),
                number(least.interval[0]),
                number(most.interval[1])
            )?;
        }
        Ok(())
    }

    fn faults(f: &mut String, ego: &EgoRisk) -> fmt::Result {
        let RunFaults { runs, invalid, .. } = &ego.faults;
        // Most programs never fail, and their report says nothing of faults.
        if *invalid == 0 {
            return Ok(());
        }
        let share = 100.0 * ego.faults.share();
        writeln!(
            f,
            "invalid: {invalid} of {runs} runs ended in a fault ({share:.2} %), and each might have \
             been a failure"
        )?;
        for fault in &ego.faults.faults {
            writeln!(f, "invalid: {}: {fault}", ego.ego)?;
        }
        Ok(())
    }

    fn checked(&self, f: &mut String, checks: &Checks) -> fmt::Result {
        let k = checks
            .pareto_k
            .map_or("none".to_owned(), |k| format!("{k:.2}"));
        // A heavy tail can expect more than the whole risk above its greatest weight.
        let unseen = checks.unseen_share.unwrap_or(0.0).min(1.0);
        let [covered, probes] = checks.probes;
        writeln!(
            f,
            "whatever the proposals missed: at most {}, of {} natural runs",
            number(checks.bound),
            self.cost.natural
        )?;
        writeln!(
            f,
            "checks    k̂ {k}, unseen weights {:.1} %, {} failures, largest {:.1} %, probes {covered} of {probes} \
             covered, natural failures {}, beyond {}",
            100.0 * unseen,
            checks.hits,
            100.0 * checks.greatest_share,
            checks.natural_failures,
            checks.natural_beyond
        )
    }

    /// Writes the violations that count, unless all do.
    fn counted_violations(&self, f: &mut String) -> fmt::Result {
        match &self.counts {
            Counts::Violation => Ok(()),
            Counts::Contact { closing_mps } => writeln!(
                f,
                "a failure is a contact of the ego with a closing speed of {closing_mps} m/s or \
                 more (`counts`)"
            ),
            Counts::Preventable { by, closing_mps } => {
                let by: Vec<String> = by.iter().map(|it| it.words().to_owned()).collect();
                writeln!(
                    f,
                    "a failure is a contact of the ego with a closing speed of {closing_mps} m/s or \
                     more that {} avoids (`counts`)",
                    by.join(" or ")
                )
            }
        }
    }

    fn law_of_starts(&self, f: &mut String) -> fmt::Result {
        if !self.uniform_axes.is_empty() {
            let axes = self.uniform_axes.join(", ");
            writeln!(
                f,
                "starts uniform over the world's ranges, without a law: {axes}"
            )?;
        }
        // Nearly all of a law is usually inside, which needs no remark.
        if self.inside < 0.999 {
            let share = 100.0 * self.inside;
            writeln!(
                f,
                "{share:.1} % of the law of starts is inside the world's ranges"
            )?;
        }
        Ok(())
    }

    /// Returns a statement per ego that the result supports, and one on the ratio.
    pub fn verdict(&self) -> Vec<String> {
        let claims = self.egos.iter().map(|ego| {
            format!(
                "in traffic “{}”, on the {} plant, in runs of {} s, `{}` fails in {}",
                self.traffic,
                self.plant,
                self.horizon_s,
                ego.ego,
                claim(ego)
            )
        });
        claims.chain(self.ratio_in_words()).collect()
    }

    fn ratio_in_words(&self) -> Option<String> {
        let [first, second, ..] = &self.egos[..] else {
            return None;
        };
        let [least, most] = self.ratio_between.or(self.ratio.map(|it| [it; 2]))?;
        let probability = if self.ratio_between.is_some() {
            format!("{:.2} to {:.2}", least.probability, most.probability)
        } else {
            format!("{:.2}", least.probability)
        };
        let (first, second) = (&first.ego, &second.ego);
        let [lo, hi] = [least.interval[0], most.interval[1]];
        Some(format!(
            "ratio of `{first}` to `{second}`: {probability}, {lo:.2} … {hi:.2}"
        ))
    }

    /// Returns the readings of every ego, with its kinds of failure and its faults.
    pub fn readings(&self) -> String {
        let mut text = String::new();
        // Invariant: writing to a text does not fail.
        let _ = self.write_readings(&mut text);
        text
    }

    /// Returns the checks behind the numbers, the runs, and statements to avoid.
    pub fn details(&self) -> String {
        let mut text = String::new();
        // Invariant: writing to a text does not fail.
        let _ = self.write_details(&mut text);
        text
    }

    fn write_readings(&self, f: &mut String) -> fmt::Result {
        self.counted_violations(f)?;
        for (nth, ego) in self.egos.iter().enumerate() {
            if nth > 0 {
                writeln!(f)?;
            }
            if ego.refusals().is_empty() {
                self.readings_of(f, ego)?;
            } else {
                writeln!(f, "{}: no result", ego.ego)?;
            }
            RiskReport::faults(f, ego)?;
            if ego.impossible > 0 {
                let n = ego.impossible;
                writeln!(
                    f,
                    "warning: {n} known counterexamples have probability 0 here"
                )?;
            }
        }
        Ok(())
    }

    fn write_details(&self, f: &mut String) -> fmt::Result {
        self.law_of_starts(f)?;
        for ego in &self.egos {
            if self.egos.len() > 1 {
                writeln!(f, "{}:", ego.ego)?;
            }
            match &ego.checks {
                Some(checks) => self.checked(f, checks)?,
                None => writeln!(f, "counted among {} natural runs", self.cost.natural)?,
            }
            if let Some(crude) = ego.crude_runs.filter(|_| ego.is_weighted()) {
                writeln!(
                    f,
                    "counting alone would need {crude:.1e} runs for this width"
                )?;
            }
        }
        self.runs(f)?;
        // A risk is easy to overstate.
        writeln!(
            f,
            "you may not say a rate on the road, safe below it, or better by two intervals \
             (docs/background/claims.md)"
        )
    }

    fn runs(&self, f: &mut String) -> fmt::Result {
        let RiskCost {
            natural,
            exploring,
            rounds,
            surrogate,
            learning,
            ..
        } = self.cost;
        write!(
            f,
            "runs per ego: {natural} natural, {exploring} exploring, {rounds} in rounds"
        )?;
        if surrogate > 0 {
            write!(f, ", {surrogate} for its surrogate, {learning} in it")?;
        } else if learning > 0 {
            write!(f, ", {learning} on another plant")?;
        }
        writeln!(f)
    }
}

impl Display for RiskReport {
    /// Writes the verdict, the readings and the details.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for line in self.verdict() {
            writeln!(f, "{line}")?;
        }
        write!(f, "\n{}\n{}", self.readings(), self.details())
    }
}

impl EgoRisk {
    /// Returns the readings as a table, with both meanings of a fault if runs ended in one.
    pub(super) fn table(&self) -> TextTable {
        let cell = |it: Option<RiskEstimate>| match it {
            Some(it) => format!("{}, {}", number(it.probability), interval(&it)),
            None => "none observed".to_owned(),
        };
        let (least, most) = match &self.between {
            Some(between) => (&between.least, &between.most),
            None => (&self.readings, &self.readings),
        };
        let rows = pairs(least, most).map(|(row, [least, most])| {
            let mut cells = vec![row.name.to_owned(), cell(least)];
            cells.extend(self.between.is_some().then(|| cell(most)));
            cells.push(row.share_of(self));
            cells
        });
        let columns: &[&str] = if self.between.is_some() {
            &[
                "run",
                "if no fault is a failure",
                "if every fault is one",
                "share of",
            ]
        } else {
            &["run", "probability, 95 % interval", "share of"]
        };
        TextTable::new(columns.iter().copied(), rows)
    }
}

/// Line of the table of readings.
struct ReadingRow {
    name: &'static str,
    of: ShareOf,
}

/// Runs of which a reading is a share.
#[derive(Clone, Copy)]
enum ShareOf {
    All,
    Lawful,
    Judged,
}

impl ReadingRow {
    fn share_of(&self, ego: &EgoRisk) -> String {
        match self.of {
            ShareOf::All => "all runs".to_owned(),
            ShareOf::Lawful => "lawful runs".to_owned(),
            ShareOf::Judged => format!("{} natural runs", ego.judged),
        }
    }
}

/// Returns the lines of the table, each with a value of both readings.
fn pairs(
    least: &RiskReadings,
    most: &RiskReadings,
) -> [(ReadingRow, [Option<RiskEstimate>; 2]); 6] {
    let pair = |name, of, get: fn(&RiskReadings) -> Option<RiskEstimate>| {
        (ReadingRow { name, of }, [get(least), get(most)])
    };
    [
        pair("fails", ShareOf::All, |it| it.fails),
        pair("fails, lawful", ShareOf::All, |it| it.fails_lawful),
        pair("fails, preventable", ShareOf::All, |it| {
            it.fails_preventable
        }),
        pair("fails, no driver model", ShareOf::All, |it| {
            it.fails_unjudged
        }),
        pair("fails, given lawful", ShareOf::Lawful, |it| {
            it.fails_given_lawful
        }),
        pair("lawful", ShareOf::Judged, |it| it.lawful),
    ]
}

/// Returns the share of runs in which an ego may be said to fail, with its interval or bound.
fn claim(ego: &EgoRisk) -> String {
    let bound = ego.checks.as_ref().map(|checks| number(checks.bound));
    let Some([least, most]) = ego.least_and_most() else {
        // Without any check, nothing is excluded.
        let bound = bound.unwrap_or_else(|| number(1.0));
        return format!("at most {bound} of runs (95 % bound). No estimate is a result");
    };
    let RunFaults { runs, invalid, .. } = &ego.faults;
    let mut text = match &ego.between {
        Some(_) => format!(
            "at least {} and at most {} of runs (95 %), since {invalid} of {runs} runs ended in a \
             fault",
            number(least.interval[0]),
            number(most.interval[1])
        ),
        None => format!(
            "{} of runs (95 % interval {})",
            number(least.probability),
            interval(&least)
        ),
    };
    if let Some(bound) = bound {
        text.push_str(&format!(
            ", as far as its runs show every kind of failure, and in at most {bound} whatever they \
             missed"
        ));
    }
    text
}

pub(super) fn number(value: f64) -> String {
    // Small risks need an exponent, and larger numbers compare better without.
    if value < 0.01 {
        format!("{value:.2e}")
    } else {
        format!("{value:.4}")
    }
}

pub(super) fn interval(risk: &RiskEstimate) -> String {
    format!(
        "{} … {}",
        number(risk.interval[0]),
        number(risk.interval[1])
    )
}
