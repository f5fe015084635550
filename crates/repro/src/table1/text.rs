//! Markdown of Table I.

use super::{GridStudy, LearnerOnMap, MapResult, References, verdict_on};
use brakecheck::world::AtWall;
use brakecheck_report::report::table::TextTable;

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
        // `AtWall::reading` knows the letters A and B only.
        _ => AtWall::FirstInMap,
    };
    text.push_str(&format!(
        "## Table I, reading {} (`{}`)\n\n{}\n\n",
        study.reading,
        study.world,
        verdict_on(wall)
    ));
    let seeds: Vec<String> = study.seeds.iter().map(u64::to_string).collect();
    let costs: Vec<String> = study
        .learners
        .iter()
        .zip(&study.decisions)
        .zip(&study.train_cpu_s)
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

fn captures(study: &GridStudy, text: &mut String) {
    let before = ["question", "map", "starts", "paper %", "optimum %"];
    let learners = study.learners.iter().map(String::as_str);
    let columns = before
        .into_iter()
        .chain(learners)
        .chain(["random %", "tables %", "chaser %"]);
    let lines = study.cells.iter().map(|cell| {
        let before = [
            cell.question.clone(),
            cell.map.clone(),
            cell.starts.to_string(),
            paper(cell),
            percent(cell.references.optimum),
        ];
        let learners = cell.trained.iter().map(share);
        before
            .into_iter()
            .chain(learners)
            .chain(untrained(&cell.references))
    });
    push_table(text, &TextTable::new(columns, lines));
}

/// Adds a table and the blank line after it.
fn push_table(text: &mut String, table: &TextTable) {
    text.push_str(&table.to_markdown());
    text.push('\n');
}

/// Formats the captures of the ados that do not learn.
fn untrained(references: &References) -> [String; 3] {
    [
        percent(references.random),
        percent(references.random_tables),
        percent(references.chaser),
    ]
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
    text.push_str("RQ1's baselines on n = 4, k = 2:\n\n");
    let columns = [
        "random ados",
        "paper %",
        "random actions %",
        "random fixed tables %",
    ];
    let of = |(share, ci95)| format!("{} {}", percent(share), interval(ci95));
    let lines = study.random_ados.iter().map(|random| {
        [
            random.ados.to_string(),
            percent(random.paper),
            of(random.actions),
            of(random.tables),
        ]
    });
    push_table(text, &TextTable::new(columns, lines));
}

fn near(study: &GridStudy, text: &mut String) {
    let near = &study.near_starts;
    text.push_str(
        "RQ4: trained on 100 random starts of n = 10, k = 1; around 5 of the counterexamples met in training, the share of \
         all δ-near starts (|V − V'| < δ, V the learner's own) from which the ego fails, median (worst seed). \
         Condition: of all chosen counterexamples those with δ < γ^T (g(τ) + 1), and the share around them.\n\n",
    );
    let learners = study.learners.iter();
    let pairs = learners.flat_map(|name| [format!("{name} %"), format!("{name} condition")]);
    let columns = ["δ", "paper %"].map(str::to_owned).into_iter().chain(pairs);
    let mut lines: Vec<Vec<String>> = Vec::new();
    for row in &near.deltas {
        let trained = row.trained.iter().flat_map(|share| {
            let around = share.where_satisfied.map_or("–".to_owned(), percent);
            [
                format!("{} ({})", percent(share.median), percent(share.min)),
                format!("{}: {around}", share.satisfying),
            ]
        });
        let before = [row.delta.to_string(), percent(row.paper)].into_iter();
        lines.push(before.chain(trained).collect());
    }
    let everywhere = near
        .everywhere
        .iter()
        // No δ applies to all starts, so their condition is empty.
        .flat_map(|share| [percent(*share), String::new()]);
    let before = ["all starts", "–"].map(str::to_owned).into_iter();
    lines.push(before.chain(everywhere).collect());
    text.push_str(&TextTable::new(columns, lines).to_markdown());
    let alphas: Vec<String> = study
        .learners
        .iter()
        .zip(&near.alpha)
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
            let own: Vec<String> = near
                .centres
                .iter()
                .filter(|centre| centre.learner == learner && centre.seed == *seed)
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
    let learners = study.learners.iter().flat_map(|name| {
        ["by cell %", "own view %", "related", "else"].map(|c| format!("{name} {c}"))
    });
    let before = [
        "ε",
        "paper %",
        "related states",
        "related starts",
        "optimum %",
    ];
    let after = ["random %", "tables %", "chaser %"].map(str::to_owned);
    let columns = before
        .map(str::to_owned)
        .into_iter()
        .chain(learners)
        .chain(after);
    let lines = study.refined.iter().map(|map| {
        let of = |whole: usize, part: usize| format!("{part} of {whole}");
        let trained: Vec<String> = map
            .trained
            .iter()
            .flat_map(|ado| {
                [
                    share(&ado.by_cell),
                    share(&ado.own_view),
                    of(ado.related.0, ado.related.1),
                    of(ado.unrelated.0, ado.unrelated.1),
                ]
            })
            .collect();
        let before = [
            map.refine.to_string(),
            percent(map.paper),
            of(map.candidates, map.related),
            of(map.starts, map.related_starts),
            percent(map.references.optimum),
        ];
        before
            .into_iter()
            .chain(trained)
            .chain(untrained(&map.references))
    });
    push_table(text, &TextTable::new(columns, lines));
}

fn open_loop(study: &GridStudy, text: &mut String) {
    text.push_str(
        "Fig. 1: the action sequences with which each policy captures, played back open loop elsewhere.\n\
         Own start, other starts: shares captured by the sequence, from where it was found and from all others; \
         the policy there: by the policy itself.\n\n",
    );
    let columns = [
        "ado",
        "from its own start %",
        "from the other starts %",
        "the policy there %",
        "own start, k = 1 %",
        "the policy there %",
    ];
    let lines = study.open_loop.iter().map(|row| {
        [
            study.learners[row.learner].clone(),
            percent(row.own_start),
            percent(row.other_starts),
            percent(row.policy_other_starts),
            percent(row.other_step),
            percent(row.policy_other_step),
        ]
    });
    push_table(text, &TextTable::new(columns, lines));
}
