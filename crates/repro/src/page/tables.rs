//! Tables of the pages.

use super::{OLD, RecordedRows};
use crate::case_studies::{CaseStudy, WorldResult};
use crate::crashes::{CrashRow, CrashStudy};
use crate::letter::LetterEnds;
use crate::near::NearFailing;
use crate::paper_rows::{Measured, Reached};
use crate::record::{RecordError, ResultRow};
use crate::reuse_study::ReuseBlocks;
use crate::structures::StructureMeans;
use crate::table1::GridCaptures;
use brakecheck_report::report::table::{TextTable, known_if};
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// Worlds of README, in its order.
const IN_README: [&str; 4] = ["acc", "merge_fair", "pedestrian", "cut_in"];
/// Worlds of the main table, in its order. Others follow.
const WORLDS: [&str; 10] = [
    "acc",
    "merge_fair",
    "merge",
    "yellow_light",
    "yellow_light_fixed",
    "pedestrian",
    "cut_in",
    "sandwich",
    "light_ado",
    "bend",
];

/// Result of the paper for a driving scene.
struct PaperNumber {
    scene: &'static str,
    /// Share of falsified starts or episodes, and hours.
    result: &'static str,
    counts: &'static str,
    /// Row here: study and name.
    here: (&'static str, &'static str),
    here_counts: &'static str,
    /// Row with the paper's learning to the letter.
    letter: &'static str,
}

const PAPER: [PaperNumber; 4] = [
    PaperNumber {
        scene: "ACC, DQN",
        result: "54.8 % in 1.93 h",
        counts: "distance below `d_safe`",
        here: ("case-studies", "acc"),
        here_counts: "distance below `d_safe`",
        letter: "acc_letter dqn",
    },
    PaperNumber {
        scene: "ACC, Q-table",
        result: "55.79 % in 4.83 h",
        counts: "distance below `d_safe`",
        here: ("paper-rows", "acc QTable"),
        here_counts: "the same, kinematic plant",
        letter: "acc_letter q_table",
    },
    PaperNumber {
        scene: "merge, 371 episodes",
        result: "75.76 % in 9.44 h",
        counts: "training episodes that end in a collision",
        here: ("case-studies", "merge"),
        here_counts: "distance below `d_safe`, rules kept",
        letter: "merge_letter dqn",
    },
    PaperNumber {
        scene: "yellow light, 247 episodes",
        result: "64 % in 2.59 h",
        counts: "running the red light",
        here: ("case-studies", "yellow_light"),
        here_counts: "running the red light, rules kept",
        letter: "yellow_light_letter dqn",
    },
];

/// Returns every table of the page with its name.
///
/// # Errors
/// The numbers of a row do not have the form of their table.
pub(super) fn all(rows: &RecordedRows<'_>) -> Result<Vec<(&'static str, String)>, RecordError> {
    let table = |study: &str, lines: TextTable| noted(rows, study, &lines.to_markdown());
    Ok(vec![
        ("worlds", table("case-studies", worlds(rows)?)),
        // Its other rows have their notes below the tables of their own studies.
        ("paper", table("letter", paper(rows)?)),
        ("episodes", table("paper-rows", episodes(rows)?)),
        ("table1", table("table1", captures(rows)?)),
        ("near", table("near-starts", near(rows)?)),
        ("crashes", table("crashes", crashes(rows)?)),
        ("reuse", noted(rows, "reuse", &reuse(rows)?)),
        ("structures", table("structures", structures(rows)?)),
        ("planners", table("planners", planners(rows)?)),
        ("others", others(rows)?),
        ("origins", origins(rows)),
    ])
}

fn noted(rows: &RecordedRows<'_>, study: &str, table: &str) -> String {
    format!("{}\n\n{}", compact(table), rows.notes(study).trim_end())
}

/// Returns a table without blanks around its cells, because nobody edits this page.
fn compact(table: &str) -> String {
    let lines = table.trim_end().lines().map(|line| {
        let cells = line.replace(" | ", "|");
        let inner = cells
            .strip_prefix("| ")
            .and_then(|it| it.strip_suffix(" |"));
        inner.map_or(cells.clone(), |inner| format!("|{inner}|"))
    });
    lines.collect::<Vec<String>>().join("\n")
}

/// Returns the programs and machines of all rows that probes vouch for.
fn origins(rows: &RecordedRows<'_>) -> String {
    let measured = rows
        .results
        .rows()
        // Rows that were measured by hand have their day in their own table.
        .filter(|(_, row)| !row.depends.is_empty());
    let mut origins: Vec<(String, Vec<&str>)> = Vec::new();
    for (study, row) in measured {
        let origin = &row.origin;
        let text = format!(
            "version {}, commit `{}`, {}, {}",
            origin.version, origin.commit, origin.date, origin.machine
        );
        match origins.iter_mut().find(|(known, _)| *known == text) {
            // A study is named once, however many of its rows have this origin.
            Some((_, studies)) if studies.contains(&study) => {}
            Some((_, studies)) => studies.push(study),
            None => origins.push((text, vec![study])),
        }
    }
    let lines = origins
        .iter()
        .map(|(text, studies)| format!("- {}: {text}\n", studies.join(", ")));
    lines.collect()
}

/// Returns the rows of a study with their numbers.
fn read<'a, T: DeserializeOwned>(
    rows: &'a RecordedRows<'_>,
    study: &str,
) -> Result<Vec<(&'a ResultRow, T)>, RecordError> {
    let all = rows.of(study).iter();
    // A row that is left out would be missed by nobody.
    all.map(|row| Ok((row, row.read(study)?))).collect()
}

/// Returns the numbers of a row, if it was measured.
fn read_one<T: DeserializeOwned>(
    study: &str,
    row: Option<&ResultRow>,
) -> Result<Option<T>, RecordError> {
    row.map(|row| row.read(study)).transpose()
}

/// Returns a name with the mark of an earlier version, if it is.
fn marked(name: &str, is_fresh: bool) -> String {
    if is_fresh {
        name.to_owned()
    } else {
        format!("{name} {OLD}")
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn share(part: usize, whole: usize) -> String {
    known_if(whole > 0, || {
        format!("{:.0} %", 100.0 * part as f64 / whole as f64)
    })
}

fn with_interval(rate: f64, [lo, hi]: [f64; 2]) -> String {
    format!("{} [{:.1}, {:.1}]", percent(rate), 100.0 * lo, 100.0 * hi)
}

fn or_dash(cell: Option<String>) -> String {
    cell.unwrap_or_else(|| "–".to_owned())
}

fn recall(recall: f64) -> String {
    format!("{recall:.2}")
}

fn contact(result: &WorldResult) -> [String; 3] {
    let contacts = &result.contacts;
    let closing = contacts
        .closing_mps
        .map(|closing| format!("{:.1}", closing.median));
    // No driver applies to any contact, which is not the same as none avoided.
    let avoided = known_if(contacts.judged > 0, || {
        share(contacts.avoided, contacts.successes)
    });
    [
        share(contacts.contacts, contacts.successes),
        or_dash(closing),
        avoided,
    ]
}

/// Formats the studies as the table of the page, with warnings below.
pub fn case_studies_markdown(studies: &[CaseStudy], results: &[WorldResult]) -> String {
    let mut text = worlds_table(results.iter().map(|result| (result, true))).to_markdown();
    // Warnings follow the table, so a failed training cannot be overlooked.
    for row in studies.iter().flat_map(|study| &study.rows) {
        if let (Some(warning), Some(seed)) = (&row.warning, row.train_seed) {
            text.push_str(&format!(
                "- warning: {}, training {seed}: {}\n",
                row.world, warning.what
            ));
        }
    }
    text
}

/// Formats worlds as the main table. A false mark is an earlier version.
fn worlds_table<'a>(results: impl Iterator<Item = (&'a WorldResult, bool)>) -> TextTable {
    let columns = [
        "world",
        "starts (trivial)",
        "success [95 %]",
        "with contact",
        "closing m/s",
        "avoided",
        "rule violations",
        "recall (least)",
        "recall of 3",
        "search ≤ 2",
        "held",
        "random",
        "constant",
        "CPU s",
    ];
    let lines = results.map(|(result, is_fresh)| {
        let [with_contact, closing, avoided] = contact(result);
        let [held, random, constant] = result.baselines.map(percent);
        let deeper = &result.deeper;
        let search = match result.search.1 {
            // Worlds with many actions are searched with fewer switches.
            2 => percent(result.search.0),
            most => format!("{} (≤ {most})", percent(result.search.0)),
        };
        [
            marked(&result.world, is_fresh),
            format!("{} ({})", result.starts, result.trivial),
            with_interval(result.success.0, result.success.1),
            with_contact,
            closing,
            avoided,
            percent(result.fouls),
            or_dash(
                result
                    .recall
                    .map(|[median, least]| format!("{median:.2} ({least:.2})")),
            ),
            or_dash(
                deeper
                    .recall_median
                    .map(|median| format!("{median:.2} of {}", deeper.solved)),
            ),
            search,
            held,
            random,
            constant,
            format!("{:.0}", result.train_cpu_s),
        ]
    });
    TextTable::new(columns, lines)
}

/// Returns the worlds in the order of the page, with their freshness.
fn ordered(rows: &RecordedRows<'_>) -> Result<Vec<(WorldResult, bool)>, RecordError> {
    let found = read(rows, "case-studies")?.into_iter();
    let mut all: Vec<(WorldResult, bool)> = found
        .map(|(row, result)| (result, rows.is_fresh(row)))
        .collect();
    let place = |name: &str| WORLDS.iter().position(|world| *world == name);
    all.sort_by_key(|(result, _): &(WorldResult, bool)| {
        // Worlds that the page does not know come last.
        place(&result.world).unwrap_or(WORLDS.len())
    });
    Ok(all)
}

fn worlds(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let all = ordered(rows)?;
    let results = all.iter().map(|(result, is_fresh)| (result, *is_fresh));
    Ok(worlds_table(results))
}

/// Table of README, with the rows that are not of this version below.
///
/// # Errors
/// The numbers of a row do not have the form of the table.
pub(super) fn readme(rows: &RecordedRows<'_>) -> Result<String, RecordError> {
    let columns = [
        "world",
        "success [95 %]",
        "with contact, closing speed",
        "search ≤ 2 switches",
        "random, held",
        "best constant",
        "training CPU s",
    ];
    let all = ordered(rows)?;
    let shown = all
        .iter()
        .filter(|(result, _)| IN_README.contains(&result.world.as_str()));
    let lines = shown.map(|(result, is_fresh)| {
        let [with_contact, closing, _] = contact(result);
        [
            marked(&result.world, *is_fresh),
            with_interval(result.success.0, result.success.1),
            format!("{with_contact}, {closing} m/s"),
            percent(result.search.0),
            percent(result.baselines[0]),
            percent(result.baselines[2]),
            format!("{:.0}", result.train_cpu_s),
        ]
    });
    let mut text = TextTable::new(columns, lines).to_markdown();
    let of_page = || {
        let all = rows.of("case-studies").iter();
        all.filter(|row| IN_README.contains(&row.name.as_str()))
    };
    // Rows of one study may be recorded by commands with different seeds.
    let mut seeds: Vec<&str> = of_page().map(|row| row.seeds.as_str()).collect();
    seeds.sort_unstable();
    seeds.dedup();
    text.push_str(&format!("\nThe rows have {}.\n", seeds.join(" or ")));
    for row in of_page().filter(|row| !rows.is_fresh(row)) {
        text.push_str(&format!("\n{OLD} {}: {}.\n", row.name, rows.reason(row)));
    }
    Ok(text)
}

fn paper(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "the paper's row",
        "the paper",
        "it counts",
        "here [95 %]",
        "counted here",
        "of these with contact",
        "to the letter [95 %]",
        "held, constant there",
    ];
    let each = PAPER.iter().map(|paper| {
        let (study, name) = paper.here;
        let row = rows.of(study).iter().find(|row| row.name == name);
        // A row that was never measured is not of an earlier version either.
        let fresh = row.is_none_or(|row| rows.is_fresh(row));
        // The form of a row is that of its study.
        let of = |wanted: &str| row.filter(|_| study == wanted);
        let world: Option<WorldResult> = read_one(study, of("case-studies"))?;
        let measured: Option<Measured> = read_one(study, of("paper-rows"))?;
        let last = measured.as_ref().and_then(|it| it.reached.last());
        let of_curve = last.map(|it: &Reached| (it.success_rate, it.ci95));
        let success = world.as_ref().map(|world| world.success).or(of_curve);
        let letter = rows
            .of("letter")
            .iter()
            .find(|row| row.name == paper.letter);
        let ends: Option<LetterEnds> = read_one("letter", letter)?;
        // The first of `JUDGES` judges the whole run, as the paper does.
        let whole = ends.as_ref().and_then(|ends| ends.letter.judged.first());
        let baselines = ends.as_ref().and_then(|ends| ends.baselines.first());
        let fresh = fresh && letter.is_none_or(|row| rows.is_fresh(row));
        Ok([
            marked(paper.scene, fresh),
            paper.result.to_owned(),
            paper.counts.to_owned(),
            or_dash(success.map(|(rate, ends)| with_interval(rate, ends))),
            paper.here_counts.to_owned(),
            or_dash(world.as_ref().map(|world| contact(world)[0].clone())),
            or_dash(whole.map(|judged| with_interval(judged.success_rate, judged.ci95))),
            // The order of `letter_baselines`: search, held, random, constant.
            or_dash(baselines.map(|[_, held, _, constant]| {
                format!("{}, {}", percent(*held), percent(*constant))
            })),
        ])
    });
    let lines = each.collect::<Result<Vec<_>, RecordError>>()?;
    Ok(TextTable::new(columns, lines))
}

fn episodes(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "world",
        "learner",
        "episodes",
        "success [95 %]",
        "training CPU s",
    ];
    let all = read::<Measured>(rows, "paper-rows")?.into_iter();
    let lines = all.flat_map(|(row, measured)| {
        let name = marked(&measured.world, rows.is_fresh(row));
        // The paper's own counts are all below a thousand.
        let (last, earlier) = measured.reached.split_last().unzip();
        let counts = earlier.into_iter().flatten();
        // The last count is a measurement of its own, however large.
        let few = counts.filter(|reached: &&Reached| reached.episodes < 1_000.0);
        let shown: Vec<Reached> = few.chain(last).cloned().collect();
        shown.into_iter().map(move |reached| {
            [
                name.clone(),
                measured.learner.clone(),
                format!("{:.0}", reached.episodes),
                with_interval(reached.success_rate, reached.ci95),
                format!("{:.1}", reached.cpu_s),
            ]
        })
    });
    Ok(TextTable::new(columns, lines))
}

/// Captures of the paper's learner under the harder reading, which a chaser does not solve.
fn captures(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "question",
        "map",
        "paper %",
        "PPO % [95 %]",
        "random %",
        "chaser %",
    ];
    let tenth = |share: f64| format!("{:.1}", 100.0 * share);
    let all = read::<GridCaptures>(rows, "table1")?.into_iter();
    // Under the other reading a chaser is as good as the best ado, which shows nothing.
    let hard = all.filter(|(row, _)| row.name == "grid_hard");
    let lines = hard.flat_map(|(row, captures)| {
        let is_fresh = rows.is_fresh(row);
        // Found by name, because the world file decides the order of the learners.
        let ppo = captures.learners.iter().position(|name| name == "PPO");
        captures.cells.into_iter().map(move |cell| {
            let learned = ppo.and_then(|ppo| cell.trained.get(ppo)).map(|trained| {
                let [lo, hi] = trained.ci95.map(tenth);
                format!("{} [{lo}, {hi}]", tenth(trained.median))
            });
            [
                marked(&cell.question, is_fresh),
                cell.map,
                tenth(cell.paper),
                or_dash(learned),
                tenth(cell.references.random),
                tenth(cell.references.chaser),
            ]
        })
    });
    Ok(TextTable::new(columns, lines))
}

/// Widest and narrowest neighbourhood of each world.
fn near(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "world",
        "δ",
        "near starts",
        "of those fail [95 %]",
        "never met in training",
    ];
    let all = read::<NearFailing>(rows, "near-starts")?.into_iter();
    let lines = all.flat_map(|(row, near)| {
        let name = marked(&near.world, rows.is_fresh(row));
        let starts = near.starts;
        let mut shown = near.rows;
        // A file may have the values of δ in any order, and the last one left is the
        // least.
        shown.sort_by(|a, b| b.delta.total_cmp(&a.delta));
        if let Some(narrowest) = shown.pop() {
            shown.truncate(1);
            shown.push(narrowest);
        }
        shown.into_iter().map(move |row| {
            let share = row.failing as f64 / row.near.max(1) as f64;
            [
                name.clone(),
                row.delta.to_string(),
                format!("{} of {starts}", row.near),
                with_interval(share, row.ci95),
                row.never_seen.to_string(),
            ]
        })
    });
    Ok(TextTable::new(columns, lines))
}

fn crashes(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "world",
        "starts with a crash",
        "avoided, open loop",
        "avoided, closed loop",
        "side-swipes",
        "closing m/s",
        "held",
        "constant",
        "search ≤ 1",
    ];
    let all = read::<CrashStudy>(rows, "crashes")?.into_iter();
    let lines = all.map(|(row, study)| {
        // Only a trained ado has a seed, which separates trainings from baselines.
        let (trained, others): (Vec<&CrashRow>, Vec<&CrashRow>) =
            study.rows.iter().partition(|row| row.seed.is_some());
        // One value per training.
        let each = |cell: &dyn Fn(&CrashRow) -> String| {
            let cells: Vec<String> = trained.iter().map(|row| cell(row)).collect();
            cells.join(", ")
        };
        let of_found =
            |part: Option<usize>, row: &CrashRow| or_dash(part.map(|part| share(part, row.found)));
        // The order of `crash_study`.
        let other = |at: usize| or_dash(others.get(at).map(|row| share(row.found, row.starts)));
        [
            marked(&study.world, rows.is_fresh(row)),
            each(&|row| share(row.found, row.starts)),
            each(&|row| of_found(row.avoided, row)),
            each(&|row| of_found(row.avoided_closed_loop, row)),
            each(&|row| row.side_swipes.to_string()),
            each(&|row| or_dash(row.closing_mps.map(|it| format!("{:.1}", it.median)))),
            other(0),
            other(1),
            other(2),
        ]
    });
    Ok(TextTable::new(columns, lines))
}

/// Ados of the table about reuse, with their names there. The file has more.
const REUSED: [(&str, &str); 8] = [
    ("nominal ado", "nominal ado, reused"),
    ("wide", "wide ado, reused"),
    ("wide, tries", "wide ado, up to 30 runs"),
    ("replays", "ten nearest counterexamples, replayed"),
    ("mutate, 30", "counterexamples, mutated"),
    ("search, held, 100", "held random search"),
    ("heuristic", "tuned rule"),
    ("constant", "best constant"),
];

fn reuse(rows: &RecordedRows<'_>) -> Result<String, RecordError> {
    let mut text = String::new();
    for (row, blocks) in read::<ReuseBlocks>(rows, "reuse")? {
        let [inside, outside] = blocks.egos;
        let trainings = match blocks.seeds {
            1 => "one training".to_owned(),
            several => format!("{several} trainings"),
        };
        text.push_str(&format!(
            "{}, {} starts, {trainings}, {inside} egos inside the family and {outside} outside:\n\n",
            marked(&format!("`{}`", blocks.world), rows.is_fresh(row)),
            blocks.starts,
        ));
        let columns = [
            "ado",
            "simulations per start",
            "recall inside (least)",
            "recall outside (least)",
        ];
        let shown = REUSED.iter().filter_map(|(word, name)| {
            // A study may lack an ado, such as the rule that was not tuned.
            let ado = blocks.ados.iter().find(|ado| ado.ado == *word)?;
            Some((name, ado))
        });
        let lines = shown.map(|(name, ado)| {
            let cell = |at: usize| {
                or_dash(ado.recall[at].map(|mean| match &ado.least[at] {
                    Some((least, ego)) => {
                        format!("{} ({}, {ego})", recall(mean), recall(*least))
                    }
                    None => recall(mean),
                }))
            };
            [
                (*name).to_owned(),
                format!("{:.1}", ado.sims_per_start),
                cell(0),
                cell(1),
            ]
        });
        text.push_str(&TextTable::new(columns, lines).to_markdown());
        text.push('\n');
        if let Some(starts) = blocks.cheaper_from {
            text.push_str(&format!(
                "The wide ado, with its training, costs fewer simulations than held random search from {starts:.0} starts per ego on.\n\n"
            ));
        }
    }
    Ok(text)
}

fn structures(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "world",
        "egos",
        "adapted",
        "adapted, 3 tries",
        "30 runs",
        "reused",
        "held",
        "constant",
        "switch",
        "as expected",
    ];
    let all = read::<StructureMeans>(rows, "structures")?.into_iter();
    let lines = all.map(|(row, means)| {
        let cell = |mean: Option<f64>| or_dash(mean.map(recall));
        let expected = means
            .expected
            .map(|[in_interval, all]| format!("{in_interval} of {all}"));
        [
            marked(&means.world, rows.is_fresh(row)),
            means.egos.to_string(),
            cell(means.adapted),
            cell(means.again),
            cell(means.few),
            cell(means.trained),
            cell(means.held),
            cell(means.constant),
            cell(means.switch),
            or_dash(expected),
        ]
    });
    Ok(TextTable::new(columns, lines))
}

/// Published planner that the ado of `acc_iso` played, measured by hand.
#[derive(Deserialize)]
struct PlannerRow {
    ego: String,
    reused: String,
    held: String,
    search: String,
    adapted: String,
    closing: String,
}

fn planners(rows: &RecordedRows<'_>) -> Result<TextTable, RecordError> {
    let columns = [
        "ego",
        "reused ado [95 %]",
        "held",
        "search ≤ 1 switch",
        "adapted [95 %]",
        "closing m/s",
    ];
    let all = read::<PlannerRow>(rows, "planners")?.into_iter();
    let lines = all.map(|(row, it)| {
        let ego = marked(&it.ego, rows.is_fresh(row));
        [ego, it.reused, it.held, it.search, it.adapted, it.closing]
    });
    Ok(TextTable::new(columns, lines))
}

/// Measurement by another program, entered by hand.
#[derive(Deserialize)]
struct Other {
    measurement: String,
    result: String,
}

fn others(rows: &RecordedRows<'_>) -> Result<String, RecordError> {
    let columns = ["measurement", "result", "command", "day"];
    let all = read::<Other>(rows, "others")?.into_iter();
    let lines = all.map(|(row, it)| {
        [
            marked(&it.measurement, rows.is_fresh(row)),
            it.result,
            format!("`{}`", row.command),
            row.origin.date.clone(),
        ]
    });
    let table = TextTable::new(columns, lines).to_markdown();
    let shown = compact(&table);
    Ok(format!("{shown}\n\n{OLD} of an earlier version."))
}
