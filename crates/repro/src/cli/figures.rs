//! The paper's Figs. 2, 3 and 5 from our worlds.

use brakecheck::cli::terminal::bar;
use serde_json::json;

use super::{Failure, Made, StudyRun, save};
use crate::{FigureError, Shown, three_merges, two_at_the_light, two_behaviours};
use brakecheck::experiment::{Watch, verdict_instant};
use brakecheck::rulebook::Verdict;
use brakecheck::testbench::Episode;
use brakecheck::world::Scenario;
use brakecheck_report::report::figures::{Behaviour, Distances, figure_2, figure_3, figure_5};

/// Writes the three figures as SVG files.
pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let shown = bar(&study.args.common, "figures");
    let watch = shown.watch();
    let acc = study.world("acc")?;
    let merge = study.world("merge")?;
    let light = study.world("yellow_light")?;
    let figures = match drawn(&acc, &merge, &light, &watch) {
        // An interrupted search can look like a missing behaviour, so this is tested
        // first.
        _ if watch.stopped() => return Ok(None),
        Ok(figures) => figures,
        Err(error) => {
            let help = "the figures need the shipped worlds: name their directory with `--worlds`";
            return Err(Failure::input(error.to_string(), help));
        }
    };
    let mut markdown = String::new();
    for figure in &figures {
        save(&study.args.output, figure.file, figure.svg.as_bytes())?;
        markdown.push_str(&format!(
            "![{}]({})\n\n{}\n\n",
            figure.file, figure.file, figure.caption
        ));
    }
    let files: Vec<&str> = figures.iter().map(|figure| figure.file).collect();
    Ok(Some(Made {
        rows: Vec::new(),
        markdown,
        json: json!({ "figures": files }),
    }))
}

struct Figure {
    file: &'static str,
    caption: String,
    svg: String,
}

fn drawn(
    acc: &Scenario,
    merge: &Scenario,
    light: &Scenario,
    watch: &Watch<'_>,
) -> Result<[Figure; 3], FigureError> {
    let behaviours = |scenario: &Scenario, shown: &[Shown], distance: &str| -> Vec<Behaviour> {
        let all = shown.iter();
        all.map(|one| behaviour(scenario, one, distance)).collect()
    };
    // Found by search and not by a trained ado, so that every machine draws the same.
    let two = two_behaviours(acc, watch)?;
    let three = three_merges(merge, watch)?;
    let at_light = two_at_the_light(light, watch)?;
    let second = caption(
        "Fig. 2: two behaviours of the lead car from one start (both cars at 12 m/s, 15 m apart), \
         both ending in a violation.",
        acc,
        &two,
    );
    let third = caption(
        "Fig. 3: three merges from one start (both cars at 12 m/s, 16 m apart): far away; cutting \
         in against the rule; a violation with every rule kept.",
        merge,
        &three,
    );
    let fifth = caption(
        "Fig. 5: distance to the stop line of ego and ado, from one start. The ego runs the red \
         light where its curve enters the shaded region.",
        light,
        &at_light,
    );
    let headways = behaviours(acc, &two, "headway");
    let gaps = behaviours(merge, &three, "d_2");
    let to_line: Vec<Distances> = at_light.iter().map(|one| distances(light, one)).collect();
    Ok([
        Figure {
            file: "figure-2.svg",
            svg: figure_2(&headways, constant(acc, "d_safe"), &second),
            caption: second,
        },
        Figure {
            file: "figure-3.svg",
            svg: figure_3(&gaps, constant(merge, "d_safe"), &third),
            caption: third,
        },
        Figure {
            file: "figure-5.svg",
            svg: figure_5(&to_line, &fifth),
            caption: fifth,
        },
    ])
}

fn caption(what: &str, scenario: &Scenario, shown: &[Shown]) -> String {
    format!(
        "{what} World {}, {} plant. The actions were found by search over all sequences with at most {}, not by a trained ado.",
        scenario.name(),
        scenario.plant(),
        limits(shown),
    )
}

/// Returns the numbers of switches of the searches, by behaviour if they differ.
fn limits(shown: &[Shown]) -> String {
    let limit = |one: &Shown| match one.switches {
        1 => "1 switch".to_owned(),
        several => format!("{several} switches"),
    };
    if let [first, others @ ..] = shown
        && others.iter().all(|one| one.switches == first.switches)
    {
        return limit(first);
    }
    let each = shown
        .iter()
        .map(|one| format!("{} (“{}”)", limit(one), one.name));
    each.collect::<Vec<_>>().join(" or ")
}

fn constant(scenario: &Scenario, name: &str) -> f64 {
    let value = scenario.names().constants.get(name);
    value.copied().unwrap_or(0.0)
}

fn behaviour(scenario: &Scenario, one: &Shown, distance: &str) -> Behaviour {
    let episode = &one.episode;
    let rules = &scenario.rulebook().rules;
    let word = match episode.verdict {
        Verdict::Counterexample { .. } => "ψ_ego violated".to_owned(),
        Verdict::Uncounted { .. } => "ψ_ego violated, uncounted".to_owned(),
        Verdict::Foul { rule, .. } => format!("breaks “{}”", rules[rule].name),
        Verdict::Held { .. } => "ψ_ego held".to_owned(),
        Verdict::Invalid => "invalid".to_owned(),
    };
    Behaviour {
        name: one.name.clone(),
        ego_speed_mps: over_time(episode, "ego.speed"),
        ado_speed_mps: over_time(episode, "ado.speed"),
        distance_m: over_time(episode, distance),
        paths_m: paths(scenario, episode),
        // A period such as 0.05 s has no exact binary form, so its reciprocal is rounded.
        per_second: (1.0 / episode.trace.dt_s()).round() as usize,
        decided: (verdict_instant(scenario, episode).time_s, word),
    }
}

/// The ways of ego and ado, where there is more than one lane.
fn paths(scenario: &Scenario, episode: &Episode) -> [Vec<(f64, f64)>; 2] {
    let lanes = scenario
        .drive()
        .map_or(1, |driving| driving.spec().road.lanes());
    ["ego", "ado"].map(|name| {
        let column = |axis: &str| episode.trace.signal(&format!("{name}.{axis}"));
        match (column("x"), column("y").or(column("lateral"))) {
            // On a single lane the paths are a straight line.
            (Some(x), Some(y)) if lanes > 1 => x.iter().copied().zip(y.iter().copied()).collect(),
            _ => Vec::new(),
        }
    })
}

fn distances(scenario: &Scenario, one: &Shown) -> Distances {
    let episode = &one.episode;
    let red = over_time(episode, "light.red");
    // A light that never turns red has an empty region at the end.
    let first = red.iter().find(|(_, red)| *red > 0.0);
    let last = red.last().map_or(0.0, |(time, _)| *time);
    Distances {
        name: one.name.clone(),
        ego_m: over_time(episode, "ego.light.line"),
        ado_m: over_time(episode, "ado.light.line"),
        red_s: (first.map_or(last, |(time, _)| *time), last),
        junction_m: constant(scenario, "delta"),
    }
}

fn over_time(episode: &Episode, signal: &str) -> Vec<(f64, f64)> {
    let values = episode.trace.signal(signal).unwrap_or_default();
    let dt_s = episode.trace.dt_s();
    let values = values.iter().enumerate();
    values.map(|(i, value)| (i as f64 * dt_s, *value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use brakecheck::seed::{Purpose, StartKey};
    use brakecheck::testbench::{Aftermath, Constant, play};

    #[test]
    fn captions_have_the_switches_of_every_search() {
        let text = include_str!("../../../../worlds/acc.ron");
        let world = Scenario::parse("acc.ron", text).expect("a sound world");
        let mut bench = world.bench();
        let start = bench.draw(StartKey {
            purpose: Purpose::Test,
            seed: 0,
            index: 0,
        });
        let episode = play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Skip);
        let of = |name: &str, switches: usize| Shown {
            name: name.to_owned(),
            episode: episode.clone(),
            switches,
        };
        let one = caption("Fig.", &world, &[of("early", 2), of("late", 2)]);
        assert!(one.contains(" at most 2 switches, not by"), "{one}");
        let all = caption("Fig.", &world, &[of("far", 1), of("near", 2)]);
        let limits = " at most 1 switch (“far”) or 2 switches (“near”), not by";
        assert!(all.contains(limits), "{all}");
    }
}
