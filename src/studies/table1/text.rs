//! Table I as Markdown.

use super::{GridStudy, LearnerOnMap, MapResult, verdict_on};
use crate::scene::grid::AtWall;

/// The studies, the headline first.
pub fn table1_markdown(studies: &[GridStudy]) -> String {
    let mut text = String::new();
    for study in studies {
        one(study, &mut text);
    }
    text
}

fn one(study: &GridStudy, text: &mut String) {
    let wall = match study.reading {
        'A' => AtWall::Stays,
        _ => AtWall::FirstInMap,
    };
    text.push_str(&format!(
        "## Table I, reading {} (`{}`)\n\n{}\n\n",
        study.reading,
        study.world,
        verdict_on(wall)
    ));
    let seeds: Vec<String> = study.seeds.iter().map(u64::to_string).collect();
    let costs = study
        .learners
        .iter()
        .zip(&study.decisions)
        .zip(&study.train_cpu_s);
    let costs: Vec<String> = costs
        .map(|((name, decisions), cpu_s)| {
            format!("{name} {decisions} decisions in {cpu_s:.1} CPU-seconds")
        })
        .collect();
    text.push_str(&format!(
        "Trained on n = 4, k = 2, all starts, training seeds {}: {}.\n\
         Learners: median over seeds of the share of captured starts, and [95 % interval of the mean over trainings and starts].\n\
         Optimum, chaser and random (uniform actions, in expectation) are exact; tables are the mean of 20 fixed random tables.\n\
         paper: what the paper has for its trained ado (and its random one); starts: all there are, or as many drawn.\n\n",
        seeds.join(", "),
        costs.join(", ")
    ));
    captures(study, text);
    randoms(study, text);
    near(study, text);
    open_loop(study, text);
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

fn interval([lo, hi]: [f64; 2]) -> String {
    format!("[{}, {}]", percent(lo), percent(hi))
}

fn header(fixed: &str, study: &GridStudy, rest: &str, text: &mut String) {
    let line = format!("| {fixed} | {} |{rest}\n", study.learners.join(" | "));
    let rule = "| --- ".repeat(line.matches('|').count() - 1);
    text.push_str(&format!("{line}{rule}|\n"));
}

fn captures(study: &GridStudy, text: &mut String) {
    header(
        "question | map | starts | paper % | optimum %",
        study,
        " random % | tables % | chaser % |",
        text,
    );
    for cell in &study.cells {
        let trained: Vec<String> = cell.trained.iter().map(share).collect();
        text.push_str(&format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            cell.question,
            cell.map,
            starts(cell),
            paper(cell),
            percent(cell.optimum),
            trained.join(" | "),
            percent(cell.random),
            percent(cell.random_tables),
            percent(cell.chaser),
        ));
    }
    text.push('\n');
}

fn share(trained: &LearnerOnMap) -> String {
    format!("{} {}", percent(trained.median), interval(trained.ci95))
}

fn starts(cell: &MapResult) -> String {
    match cell.all_starts {
        true => format!("all {}", cell.starts),
        false => format!("{} drawn", cell.starts),
    }
}

fn paper(cell: &MapResult) -> String {
    match cell.paper_random {
        Some(random) => format!("{} (random {})", percent(cell.paper), percent(random)),
        None => percent(cell.paper),
    }
}

fn randoms(study: &GridStudy, text: &mut String) {
    text.push_str(
        "RQ1's baselines on n = 4, k = 2:\n\n\
         | random ados | paper % | random actions % | random fixed tables % |\n| --- | --- | --- | --- |\n",
    );
    for random in &study.random_ados {
        text.push_str(&format!(
            "| {} | {} | {} {} | {} {} |\n",
            random.ados,
            percent(random.paper),
            percent(random.actions.0),
            interval(random.actions.1),
            percent(random.tables.0),
            interval(random.tables.1),
        ));
    }
    text.push('\n');
}

fn near(study: &GridStudy, text: &mut String) {
    text.push_str(
        "RQ4: trained on 100 random starts of n = 10, k = 1; around 5 counterexample starts, the share of \
         all δ-near starts (|V − V'| < δ, V the learner's own) from which the ego fails, median (worst seed); optimum: of the best ado:\n\n",
    );
    header("δ | paper % | optimum %", study, "", text);
    for row in &study.delta_near {
        let trained = row.trained.iter();
        let trained: Vec<String> = trained
            .map(|near| format!("{} ({})", percent(near.median), percent(near.min)))
            .collect();
        text.push_str(&format!(
            "| {} | {} | {} | {} |\n",
            row.delta,
            percent(row.paper),
            percent(row.optimum),
            trained.join(" | "),
        ));
    }
    if let Some(row) = study.delta_near.first() {
        let alphas = study.learners.iter().zip(&row.trained);
        let alphas: Vec<String> = alphas
            .map(|(name, near)| format!("{name} {:.2}", near.alpha))
            .collect();
        text.push_str(&format!(
            "\nα = max |V − V*| over all starts (Theorem 2), mean over seeds: {}.\n",
            alphas.join(", ")
        ));
    }
    text.push('\n');
}

fn open_loop(study: &GridStudy, text: &mut String) {
    text.push_str(
        "Fig. 1: the action sequences with which each policy captures, played back open loop elsewhere.\n\
         Own start, other starts: shares captured by the sequence, from where it was found and from all others; \
         the policy there: by the policy itself.\n\n\
         | ado | from its own start % | from the other starts % | the policy there % | own start, k = 1 % | the policy there % |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    for row in &study.open_loop {
        text.push_str(&format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            study.learners[row.learner],
            percent(row.own_start),
            percent(row.other_starts),
            percent(row.policy_other_starts),
            percent(row.other_step),
            percent(row.policy_other_step),
        ));
    }
    text.push('\n');
}
