//! Markdown of Table I.

use super::{GridStudy, LearnerOnMap, MapResult, verdict_on};
use brakecheck::scene::grid::AtWall;

/// Formats the studies, the headline first.
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
         paper: what the paper has for its trained ado (and its random one); all starts count.\n\n",
        seeds.join(", "),
        costs.join(", ")
    ));
    captures(study, text);
    randoms(study, text);
    near(study, text);
    refined(study, text);
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
    // The rule has as many columns as the header, whatever the number of learners.
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
            cell.starts,
            paper(cell),
            percent(cell.references.optimum),
            trained.join(" | "),
            percent(cell.references.random),
            percent(cell.references.random_tables),
            percent(cell.references.chaser),
        ));
    }
    text.push('\n');
}

fn share(trained: &LearnerOnMap) -> String {
    format!("{} {}", percent(trained.median), interval(trained.ci95))
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
    let near = &study.near_starts;
    text.push_str(
        "RQ4: trained on 100 random starts of n = 10, k = 1; around 5 of the counterexamples met in training, the share of \
         all δ-near starts (|V − V'| < δ, V the learner's own) from which the ego fails, median (worst seed). \
         Condition: of all chosen counterexamples those with δ < γ^T (g(τ) + 1), and the share around them.\n\n",
    );
    let learners = study.learners.iter();
    let columns: Vec<String> = learners
        .flat_map(|name| [format!("{name} %"), format!("{name} condition")])
        .collect();
    text.push_str(&format!("| δ | paper % | {} |\n", columns.join(" | ")));
    text.push_str(&format!("{}|\n", "| --- ".repeat(2 + columns.len())));
    for row in &near.deltas {
        let trained = row.trained.iter().flat_map(|share| {
            let met = share.where_met.map_or("–".to_owned(), percent);
            [
                format!("{} ({})", percent(share.median), percent(share.min)),
                format!("{}: {met}", share.meets),
            ]
        });
        let trained: Vec<String> = trained.collect();
        text.push_str(&format!(
            "| {} | {} | {} |\n",
            row.delta,
            percent(row.paper),
            trained.join(" | "),
        ));
    }
    let everywhere: Vec<String> = near
        .everywhere
        .iter()
        .flat_map(|share| [percent(*share), String::new()])
        .collect();
    text.push_str(&format!(
        "| all starts | – | {} |\n",
        everywhere.join(" | ")
    ));
    let alphas = study.learners.iter().zip(&near.alpha);
    let alphas: Vec<String> = alphas
        .map(|(name, alpha)| format!("{name} {alpha:.2}"))
        .collect();
    text.push_str(&format!(
        "\nRandom actions capture from {} % of all starts, in expectation.\n\
         α = max |V − V*| over all starts, V* discounted as the learner's V, mean over seeds: {}.\n\n\
         The chosen counterexamples, T: γ^T (g(τ) + 1):\n\n",
        percent(near.random),
        alphas.join(", ")
    ));
    for (learner, name) in study.learners.iter().enumerate() {
        for seed in &study.seeds {
            let own = near.centres.iter();
            let own = own.filter(|centre| centre.learner == learner && centre.seed == *seed);
            let own: Vec<String> = own
                .map(|centre| format!("{}: {:.3}", centre.decision, centre.reach))
                .collect();
            text.push_str(&format!("- {name}, seed {seed}: {}\n", own.join(", ")));
        }
    }
    text.push('\n');
}

fn refined(study: &GridStudy, text: &mut String) {
    text.push_str(
        "RQ5: trained on 200 random starts of n = 10, k = 1; every cell cut into ε × ε, the ego moves ε fine cells, \
         3 × 300 drawn starts. By cell: the ado acts on the coarse cells, as in the paper. Own view: it looks at the refined map. \
         Related: starts in the greatest bisimulation whose coarse start is a counterexample, captured of these by cell, all seeds. \
         Else: the same of the others.\n\n",
    );
    let columns: Vec<String> = study
        .learners
        .iter()
        .flat_map(|name| {
            ["by cell %", "own view %", "related", "else"].map(|c| format!("{name} {c}"))
        })
        .collect();
    text.push_str(&format!(
        "| ε | paper % | related states | related starts | optimum % | {} | random % | tables % | chaser % |\n",
        columns.join(" | ")
    ));
    text.push_str(&format!("{}|\n", "| --- ".repeat(8 + columns.len())));
    for map in &study.refined {
        let of = |(whole, part): (usize, usize)| format!("{part} of {whole}");
        let trained = map.trained.iter().flat_map(|ado| {
            [
                share(&ado.by_cell),
                share(&ado.own_view),
                of(ado.related),
                of(ado.unrelated),
            ]
        });
        let trained: Vec<String> = trained.collect();
        text.push_str(&format!(
            "| {} | {} | {} of {} | {} of {} | {} | {} | {} | {} | {} |\n",
            map.refine,
            percent(map.paper),
            map.related,
            map.candidates,
            map.related_starts,
            map.starts,
            percent(map.references.optimum),
            trained.join(" | "),
            percent(map.references.random),
            percent(map.references.random_tables),
            percent(map.references.chaser),
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
