//! Risk in words: the verdict, the readings and the checks.

use std::fmt::{self, Display, Formatter, Write};

use super::checks::Checks;
use super::limits::RiskLimits;
use super::pool::RiskEstimate;
use super::report::{EgoRisk, RiskBounds, RiskCost, RiskReadings, RiskReport};
use super::run_faults::RunFaults;
use crate::report::TextTable;
use crate::rulebook::Counts;
use crate::run_dir::counted;

/// Most kinds of failure in the table, and in the claim.
const LISTED: usize = 6;
const NAMED: usize = 3;

impl RiskReport {
    fn readings_of(&self, f: &mut String, ego: &EgoRisk) -> fmt::Result {
        match &ego.between {
            Some(between) => readings_between(f, ego, between)?,
            None => readings_alone(f, ego)?,
        }
        if !ego.modes.is_empty() {
            writeln!(f, "of the failures:")?;
        }
        for mode in ego.modes.iter().take(LISTED) {
            writeln!(
                f,
                "{:5.1} %  {:.1e}  {}",
                100.0 * mode.share,
                mode.risk.probability,
                mode.mode
            )?;
        }
        if let Some(others) = ego.modes.get(LISTED..).filter(|it| !it.is_empty()) {
            let share: f64 = others.iter().map(|it| it.share).sum();
            let kinds = counted(others.len(), "other kind");
            writeln!(f, "{:5.1} %  of {kinds}", 100.0 * share)?;
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
        let aside = match checks.set_aside_probability {
            Some(p) => format!("{} set aside with {}", checks.set_aside, number(p)),
            None => format!("{} set aside", checks.set_aside),
        };
        writeln!(
            f,
            "rounds    {} count, {aside}, {} found in rounds only; the upper bound is of {} \
             natural runs",
            checks.rounds,
            counted(checks.late_kinds, "kind"),
            self.cost.natural
        )?;
        writeln!(
            f,
            "checks    k̂ {k}, unseen weights {:.1} %, {}, largest {:.1} %, probes {covered} of {probes} \
             covered, natural failures {}, beyond {}",
            100.0 * unseen,
            counted(checks.hits, "failure"),
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
        // Last, because narrow intervals rest on the kinds found, and the
        // other claims do not.
        let narrow = self.egos.iter().filter_map(if_all_kinds);
        claims.chain(self.ratio_in_words()).chain(narrow).collect()
    }

    fn ratio_in_words(&self) -> Option<String> {
        let [first, second, ..] = &self.egos[..] else {
            return None;
        };
        // Without faults both readings are one.
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
                // Bounds hold even if the estimate was refused.
                bounds_alone(f, ego)?;
            }
            RiskReport::faults(f, ego)?;
            if ego.impossible > 0 {
                writeln!(
                    f,
                    "warning: the traffic excludes {}, with probability 0",
                    counted(ego.impossible, "known counterexample")
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
            // Counted runs are that number themselves.
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
            searching,
            rounds,
            surrogate,
            learning,
            ..
        } = self.cost;
        write!(
            f,
            "runs per ego: {natural} natural, {exploring} exploring, {searching} searching for \
             kinds, {rounds} in rounds"
        )?;
        // Runs in a surrogate are on its plant, which the second wording would hide.
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
        let limits = self.limits.as_ref();
        let rows = pairs(least, most).map(|(row, [least, most])| {
            let mut cells = vec![row.name.to_owned()];
            cells.extend(limits.iter().flat_map(|it| row.ends(it)));
            cells.push(cell(least));
            // Without faults both readings are one, and a second column would repeat it.
            cells.extend(self.between.is_some().then(|| cell(most)));
            cells.push(row.share_of(self));
            cells
        });
        let mut columns = vec!["run"];
        columns.extend(limits.iter().flat_map(|_| ["at least", "at most"]));
        columns.extend(match (&self.between, limits) {
            (Some(_), _) => &["if no fault is a failure", "if every fault is one"][..],
            (None, Some(_)) => &["if the kinds found are all, 95 % interval"][..],
            (None, None) => &["probability, 95 % interval"][..],
        });
        columns.push("share of");
        TextTable::new(columns, rows)
    }
}

/// Writes readings of runs of which some ended in a fault.
fn readings_between(f: &mut String, ego: &EgoRisk, between: &RiskBounds) -> fmt::Result {
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
    Ok(())
}

/// Writes readings without faults, after the bounds that hold whatever was missed.
fn readings_alone(f: &mut String, ego: &EgoRisk) -> fmt::Result {
    let name = &ego.ego;
    let Some(limits) = &ego.limits else {
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
        return Ok(());
    };
    writeln!(
        f,
        "{name:24}at least at most  if the kinds found are all  ESS    share of"
    )?;
    for (row, [risk, _]) in pairs(&ego.readings, &ego.readings) {
        let (name, of, [least, most]) = (row.name, row.share_of(ego), row.ends(limits));
        let [narrow, ess] = match risk {
            Some(it) => [
                format!("{}, {}", number(it.probability), interval(&it)),
                format!("{:.0}", it.ess),
            ],
            None => ["none observed".to_owned(), String::new()],
        };
        writeln!(f, "{name:24}{least:<9}{most:<9}{narrow:<28}{ess:<7}{of}")?;
    }
    Ok(())
}

/// Writes the bounds of an ego without a result.
fn bounds_alone(f: &mut String, ego: &EgoRisk) -> fmt::Result {
    let Some(limits) = &ego.limits else {
        return Ok(());
    };
    writeln!(f, "{:24}at least at most  share of", "")?;
    for (row, _) in pairs(&ego.readings, &ego.readings) {
        let [least, most] = row.ends(limits);
        // Rows of natural runs alone have no bounds.
        if !most.is_empty() {
            let of = row.share_of(ego);
            writeln!(f, "{:24}{least:<9}{most:<9}{of}", row.name)?;
        }
    }
    Ok(())
}

/// Line of the table of readings.
struct ReadingRow {
    name: &'static str,
    of: ShareOf,
    /// Its bounds. `None`: it is of natural runs alone.
    limits: Option<fn(&RiskLimits) -> [f64; 2]>,
}

/// Runs of which a reading is a share.
#[derive(Clone, Copy)]
enum ShareOf {
    All,
    Lawful,
    Judged,
}

impl ReadingRow {
    /// Returns its bounds in words, both empty without any.
    fn ends(&self, limits: &RiskLimits) -> [String; 2] {
        match self.limits {
            Some(of) => of(limits).map(number),
            None => [String::new(), String::new()],
        }
    }

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
    let pair = |row: ReadingRow, get: fn(&RiskReadings) -> Option<RiskEstimate>| {
        (row, [get(least), get(most)])
    };
    let row = |name, of, limits: fn(&RiskLimits) -> [f64; 2]| ReadingRow {
        name,
        of,
        limits: Some(limits),
    };
    let lawful = ReadingRow {
        name: "lawful",
        of: ShareOf::Judged,
        limits: None,
    };
    let (all, given) = (ShareOf::All, ShareOf::Lawful);
    [
        pair(row("fails", all, |it| it.fails), |it| it.fails),
        pair(row("fails, lawful", all, |it| it.fails_lawful), |it| {
            it.fails_lawful
        }),
        pair(
            row("fails, preventable", all, |it| it.fails_preventable),
            |it| it.fails_preventable,
        ),
        pair(
            row("fails, no driver model", all, |it| it.fails_unjudged),
            |it| it.fails_unjudged,
        ),
        pair(
            row("fails, given lawful", given, |it| it.fails_given_lawful),
            |it| it.fails_given_lawful,
        ),
        pair(lawful, |it| it.lawful),
    ]
}

/// Returns the share of runs in which an ego may be said to fail, with its interval or bounds.
fn claim(ego: &EgoRisk) -> String {
    let RunFaults { runs, invalid, .. } = &ego.faults;
    let faults = match &ego.between {
        Some(_) => format!(", since {invalid} of {runs} runs ended in a fault"),
        None => String::new(),
    };
    let Some(limits) = &ego.limits else {
        return counted_claim(ego, &faults);
    };
    let [least, most] = limits.fails;
    let mut text = String::new();
    // A lower bound of 0 excludes nothing, so the claim leaves it out.
    if least > 0.0 {
        text = format!(
            "at least {} of runs (whatever was missed can only add) and at most {} (trusts no \
             proposal), 95 %",
            number(least),
            number(most)
        );
    } else {
        text.push_str(&format!(
            "at most {} of runs (trusts no proposal), 95 %",
            number(most)
        ));
    }
    text.push_str(&faults);
    if !ego.refusals().is_empty() {
        text.push_str(". No narrower estimate is a result");
    }
    text
}

/// Returns the claim of counted natural runs, which no proposal can blind.
fn counted_claim(ego: &EgoRisk, faults: &str) -> String {
    let Some([least, most]) = ego.least_and_most() else {
        // Without any run, nothing is excluded.
        return "any share of runs. No estimate is a result".to_owned();
    };
    if ego.between.is_some() {
        let [lo, hi] = [least.interval[0], most.interval[1]].map(number);
        return format!("at least {lo} and at most {hi} of runs (95 %){faults}");
    }
    let p = number(least.probability);
    format!("{p} of runs (95 % interval {})", interval(&least))
}

/// Returns the narrow claim of weighted runs, with the kinds of failure on which it rests.
fn if_all_kinds(ego: &EgoRisk) -> Option<String> {
    // Counted runs do not rest on the kinds that were found.
    ego.limits.as_ref()?;
    let [least, most] = ego.least_and_most()?;
    let name = &ego.ego;
    let risk = if ego.between.is_some() {
        let [lo, hi] = [least.interval[0], most.interval[1]].map(number);
        format!("{lo} … {hi} (95 %, with every fault or none)")
    } else {
        let p = number(least.probability);
        format!("{p} (95 % interval {})", interval(&least))
    };
    let mut kinds: Vec<String> = ego
        .modes
        .iter()
        .take(NAMED)
        .map(|it| format!("{:.0} % {}", 100.0 * it.share, it.mode))
        .collect();
    if ego.modes.len() > NAMED {
        kinds.push(counted(ego.modes.len() - NAMED, "other"));
    }
    let kinds = kinds.join("; ");
    Some(format!(
        "if the kinds found are all, `{name}` fails in {risk}: {kinds}"
    ))
}

pub(super) fn number(value: f64) -> String {
    // Small risks need an exponent, and larger numbers compare better without.
    if value == 0.0 {
        "0".to_owned()
    } else if value < 0.01 {
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
