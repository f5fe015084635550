//! Binding of declared laws of actions to a world.

use std::sync::Arc;

use super::action_law::{ActionLaw, AdoLaw, FittedLaw, LawKind, MarkovLaw, Onset};
use crate::ron_file::{Ordered, Problems, ValuePath};
use crate::scene::drive::{Actions, DriveSpec};
use crate::stl::Expr;
use crate::trace::Schema;
use crate::world::{AdoLawFile, FittedFile, MarkovFile, OnsetFile};
use brakecheck_driver_model::{DECISION_S, TrafficModel};

/// Context of the binding of laws.
pub(super) struct LawBinder<'a, 'b> {
    pub(super) spec: &'a DriveSpec,
    pub(super) schema: &'a Schema,
    /// Place of the traffic in its file.
    pub(super) top: ValuePath,
    pub(super) model: Option<Arc<TrafficModel>>,
    pub(super) problems: &'a mut Problems<'b>,
}

impl LawBinder<'_, '_> {
    /// Binds the law of every ado. Without a file, all are fitted.
    pub(super) fn bind(&mut self, file: Option<&Ordered<AdoLawFile>>) -> Option<ActionLaw> {
        let place = self.top.to("ados");
        let sets: Vec<(String, Actions, usize)> = self
            .spec
            .action_sets()
            .map(|(name, set, neutral)| (name.to_owned(), set.clone(), neutral))
            .collect();
        let known = |name: &String| sets.iter().any(|(known, ..)| known == name);
        let unknown = file.and_then(|file| file.0.keys().find(|name| !known(name)));
        if let Some(name) = unknown {
            let names: Vec<&str> = sets.iter().map(|(name, ..)| name.as_str()).collect();
            let help = format!("the ados of the world are {}", names.join(", "));
            let what = format!("unknown ado `{name}`");
            self.problems
                .add(&place.to(name), what, "not an ado", Some(help));
        }
        let mut ados = Vec::new();
        for (name, set, neutral) in sets {
            // A model alone has a law for every ado, but a file must name them all.
            let law = match file {
                None => self.fitted(&place, &name, &set, None),
                Some(file) => match file.0.get(&name) {
                    Some(law) => self.law(&place.to(&name), &name, &set, law),
                    None => self.missing(&place, &name),
                },
            };
            ados.extend(law.map(|kind| AdoLaw {
                name: name.clone(),
                actions: set.len(),
                neutral,
                kind,
            }));
        }
        // One ado without a law has no entry above, and its digit would be missing.
        self.problems.is_empty().then_some(ActionLaw { ados })
    }

    fn missing(&mut self, place: &ValuePath, name: &str) -> Option<LawKind> {
        let what = format!("the ado `{name}` has no law of actions");
        let help = format!("add `\"{name}\": Markov(stay: […], leave: […])`, or `Fitted()`");
        self.problems.add(place, what, "missing law", Some(help));
        None
    }

    fn law(
        &mut self,
        place: &ValuePath,
        name: &str,
        set: &Actions,
        law: &AdoLawFile,
    ) -> Option<LawKind> {
        match law {
            AdoLawFile::Markov(file) => {
                let labels: Vec<String> = (0..set.len()).map(|it| set.label(it)).collect();
                self.markov(place, name, &labels, file).map(LawKind::Markov)
            }
            AdoLawFile::Fitted(file) => self.fitted(place, name, set, Some(file)),
        }
    }

    fn markov(
        &mut self,
        place: &ValuePath,
        name: &str,
        labels: &[String],
        file: &MarkovFile,
    ) -> Option<MarkovLaw> {
        let transitions = match transitions(file, labels.len()) {
            Ok(transitions) => transitions,
            Err(what) => {
                let (actions, written) = (labels.len(), actions_of(file));
                let list = labels.join(", ");
                // A law of the right size has another mistake, which `what` names.
                let (what, help) = match written.filter(|it| *it != actions) {
                    Some(written) => (
                        format!("the ado `{name}` has {actions} actions, and this law {written}"),
                        format!(
                            "it is for another world: name its own traffic, or write a law for {list}"
                        ),
                    ),
                    None => (what, format!("the actions are {list}")),
                };
                self.problems.add(place, what, "not a law", Some(help));
                return None;
            }
        };
        let place = place.to("onsets");
        let onsets = file
            .onsets
            .0
            .iter()
            .map(|(name, onset)| self.onset(&place.to(name), labels, onset));
        Some(MarkovLaw {
            transitions,
            onsets: onsets.collect::<Option<Vec<Onset>>>()?,
            decision_s: self.spec.clock.decision_s,
        })
    }

    fn onset(&mut self, place: &ValuePath, labels: &[String], file: &OnsetFile) -> Option<Onset> {
        let mut to = vec![0.0; labels.len()];
        for (name, weight) in &file.to.0 {
            // The comparison also refuses NaN.
            let Some(action) = action_named(labels, name).filter(|_| *weight >= 0.0) else {
                let what = format!("unknown action `{name}`, or a weight below 0");
                let help = format!("the actions are {}", labels.join(", "));
                let place = place.to("to").to(name);
                self.problems.add(&place, what, "not an action", Some(help));
                return None;
            };
            to[action] += weight;
        }
        // Weights of one action add up, because an abbreviation may name it twice.
        let Some(to) = shares(&to) else {
            let what = "an onset leads to no action";
            self.problems.add(&place.to("to"), what, "no weight", None);
            return None;
        };
        let constants = &self.spec.constants;
        let expr: Result<Expr, _> = file.rate_per_s.parse();
        match expr.and_then(|expr| expr.bind(self.schema, constants)) {
            Ok(rate_per_s) => Some(Onset {
                text: file.rate_per_s.clone(),
                rate_per_s,
                to,
            }),
            Err(error) => {
                self.problems.stl(&place.to("rate_per_s"), &error);
                None
            }
        }
    }

    fn fitted(
        &mut self,
        place: &ValuePath,
        name: &str,
        set: &Actions,
        file: Option<&FittedFile>,
    ) -> Option<LawKind> {
        let mut refuse = |what: String, help: &str| {
            self.problems
                .add(place, what, "no fitted law", Some(help.to_owned()));
            None
        };
        let (accelerations, moves) = match set {
            Actions::Accelerations(list) => (list, Vec::new()),
            Actions::Grid(grid) => (&grid.accelerations, grid.lateral.clone()),
            _ => {
                let what = format!("models of traffic have no law for the actions of `{name}`");
                return refuse(what, "declare a `Markov` law for it");
            }
        };
        // Each of two equal ones would get the whole share of their cell.
        let mut each = accelerations.iter().enumerate();
        if let Some((_, twice)) = each.find(|(i, it)| accelerations[..*i].contains(it)) {
            let what = format!("`{name}` accelerates by {twice} m/s² in two actions");
            return refuse(what, "leave one of the two out, or declare a `Markov` law");
        }
        let Some(model) = &self.model else {
            let what = "a `Fitted` law requires a model".to_owned();
            return refuse(what, "add `model: \"motorway\"`, or a file of `log --fit`");
        };
        let decision_s = self.spec.clock.decision_s;
        let hold = libm::round(DECISION_S / decision_s);
        // A tolerance, since 0.1 s and its multiples are no binary fractions.
        if hold < 1.0 || (hold * decision_s - DECISION_S).abs() > 1e-9 {
            let what = format!("decisions of {decision_s} s do not divide the model's 0.5 s");
            return refuse(what, "declare a `Markov` law");
        }
        let model = model.driver;
        let declared = file.and_then(|file| file.lateral.as_ref());
        let lateral = match (moves.is_empty(), declared) {
            (true, None) => None,
            (false, Some(file)) => {
                let labels: Vec<String> = moves
                    .iter()
                    .map(|it| format!("{it:?}").to_lowercase())
                    .collect();
                Some(self.markov(&place.to("lateral"), name, &labels, file)?)
            }
            (true, Some(_)) => {
                let what = format!("`{name}` has no lateral moves");
                return refuse(what, "leave `lateral` out");
            }
            (false, None) => {
                let what = format!("the lateral moves of `{name}` have no law");
                return refuse(what, "add `lateral: (stay: […], leave: […])`");
            }
        };
        Some(LawKind::Fitted(FittedLaw {
            model,
            cells: cells(accelerations),
            accelerations_mps2: accelerations.clone(),
            hold: hold as usize,
            lateral,
        }))
    }
}

/// Returns the number of actions that a law is written for, if its lists agree on one.
fn actions_of(file: &MarkovFile) -> Option<usize> {
    let rows = file.transitions.iter().flatten().map(Vec::len);
    let lists = [&file.stay, &file.leave]
        .into_iter()
        .flatten()
        .map(Vec::len);
    let number_of_rows = file.transitions.as_ref().map(Vec::len);
    // Any list may be the wrong one, so a number is named only if all agree.
    let mut all = lists.chain(number_of_rows).chain(rows);
    let first = all.next()?;
    all.all(|other| other == first).then_some(first)
}

/// Returns the rows of a law, each of sum 1.
pub(super) fn transitions(file: &MarkovFile, actions: usize) -> Result<Vec<Vec<f64>>, String> {
    match (&file.stay, &file.leave, &file.transitions) {
        (None, None, Some(rows)) => {
            if rows.len() != actions || rows.iter().any(|row| row.len() != actions) {
                return Err(format!(
                    "`transitions` requires {actions} rows of {actions} weights"
                ));
            }
            let rows: Option<Vec<Vec<f64>>> = rows.iter().map(|row| shares(row)).collect();
            rows.ok_or_else(|| "a row of `transitions` has no weight, or one below 0".to_owned())
        }
        (Some(stay), Some(leave), None) => {
            let inside = stay.iter().all(|it| (0.0..=1.0).contains(it));
            if [stay.len(), leave.len()] != [actions; 2] || !inside {
                return Err(format!(
                    "`stay` requires {actions} probabilities, and `leave` {actions} weights"
                ));
            }
            let row = |last: usize| {
                let mut others = leave.clone();
                // An action cannot leave to itself, so its own weight has no effect.
                others[last] = 0.0;
                // An action that leaves to no other one is kept.
                let Some(mut row) = shares(&others) else {
                    let mut same = vec![0.0; actions];
                    same[last] = 1.0;
                    return same;
                };
                row.iter_mut().for_each(|it| *it *= 1.0 - stay[last]);
                row[last] = stay[last];
                row
            };
            // Here, because a row itself cannot be refused.
            if leave.iter().any(|it| *it < 0.0) {
                return Err("a weight of `leave` is below 0".to_owned());
            }
            Ok((0..actions).map(row).collect())
        }
        _ => Err("a Markov law has either `stay` and `leave`, or `transitions`".to_owned()),
    }
}

/// Returns weights as shares of their sum. `None`: there is none, or one is below 0.
fn shares(weights: &[f64]) -> Option<Vec<f64>> {
    let sum: f64 = weights.iter().sum();
    let fits = sum > 0.0 && weights.iter().all(|it| *it >= 0.0);
    fits.then(|| weights.iter().map(|it| it / sum).collect())
}

/// Returns the action of a label, of which the unit may be left out.
fn action_named(labels: &[String], name: &str) -> Option<usize> {
    let exact = labels.iter().position(|label| label == name);
    let begins = |label: &String| {
        label
            .strip_prefix(name)
            .is_some_and(|it| it.starts_with(' '))
    };
    // An abbreviation that fits several actions would be a guess.
    let mut short = (0..labels.len()).filter(|action| begins(&labels[*action]));
    let first = short.next().filter(|_| short.next().is_none());
    // An exact name wins, or `0 m/s²` could not be named beside `0 m/s² left`.
    exact.or(first)
}

/// Returns the accelerations that are nearest to each of a list.
pub(super) fn cells(accelerations: &[f64]) -> Vec<[f64; 2]> {
    // Accelerations are listed in any order, but cells lie between neighbours.
    let mut sorted = accelerations.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let cell = |own: &f64| {
        let at = sorted.partition_point(|it| it < own);
        let lo = at.checked_sub(1).map(|it| 0.5 * (sorted[it] + own));
        let hi = sorted.get(at + 1).map(|it| 0.5 * (it + own));
        // The outer cells have no end, so that all shares add up to 1.
        [lo.unwrap_or(f64::NEG_INFINITY), hi.unwrap_or(f64::INFINITY)]
    };
    accelerations.iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::super::action_law::LawMemory;
    use super::super::manoeuvre::Manoeuvre;
    use super::*;
    use crate::trace::Signal;

    fn markov() -> MarkovLaw {
        let schema = Schema::new(0.5, [Signal::real("v", "m/s", "speed")]).expect("sound");
        let rate: Expr = "0.1 * v".parse().expect("sound");
        let file = MarkovFile {
            stay: Some(vec![0.5, 0.9, 0.2]),
            leave: Some(vec![0.0, 3.0, 1.0]),
            transitions: None,
            onsets: crate::ron_file::Ordered::default(),
        };
        MarkovLaw {
            transitions: transitions(&file, 3).expect("fits"),
            onsets: vec![Onset {
                text: "0.1 * v".to_owned(),
                rate_per_s: rate.bind(&schema, &Default::default()).expect("sound"),
                to: vec![1.0, 0.0, 0.0],
            }],
            decision_s: 0.5,
        }
    }

    #[test]
    fn a_markov_law_stays_leaves_and_is_interrupted_by_onsets() {
        let law = markov();
        assert_eq!(law.probabilities(&[0.0], 0), [0.5, 0.375, 0.125]);
        assert_eq!(law.probabilities(&[-5.0], 1), [0.0, 0.9, 1.0 - 0.9]);
        assert_eq!(law.probabilities(&[f64::NAN], 1)[0], 0.0);
        let interrupted = law.probabilities(&[4.0], 1);
        let none = libm::exp(-0.2);
        assert!((interrupted[0] - (1.0 - none)).abs() < 1e-12);
        assert!((interrupted[1] - 0.9 * none).abs() < 1e-12);
    }

    #[test]
    fn a_joint_law_is_a_product_with_the_first_ado_as_the_lowest_digit() {
        let ado = |neutral| AdoLaw {
            name: "ado".to_owned(),
            actions: 3,
            neutral,
            kind: LawKind::Markov(markov()),
        };
        let law = ActionLaw {
            ados: vec![ado(0), ado(1)],
        };
        let mut memory = law.begin();
        let joint = law.probabilities(&[0.0], &memory);
        assert_eq!(joint.len(), 9);
        assert!((joint.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // The first ado takes action 2, the second one repeats action 1.
        assert!((joint[2 + 3] - 0.125 * 0.9).abs() < 1e-12);
        law.note(&mut memory, 2 + 3);
        assert_eq!(memory.last, [[0, 2], [1, 1]]);
    }

    #[test]
    fn fitted_probabilities_add_to_one_and_prefer_the_model_s_centre() {
        let model = TrafficModel::motorway().driver;
        let list = vec![0.5, 0.0, -0.5, -3.0];
        let law = FittedLaw {
            model,
            cells: cells(&list),
            accelerations_mps2: list,
            hold: 2,
            lateral: None,
        };
        let kept = law.probabilities(&[], [3, 2], 1);
        assert_eq!(kept, [0.0, 0.0, 1.0, 0.0]);
        let next = law.probabilities(&[], [1, 1], 2);
        assert!((next.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(next[1] > 0.8 && next[3] < 1e-3, "{next:?}");
    }

    #[test]
    fn labels_may_leave_their_unit_out_if_one_action_is_meant() {
        let labels = ["-3 m/s²", "-3 m/s² right", "+0 m/s²"].map(str::to_owned);
        assert_eq!(action_named(&labels, "+0"), Some(2));
        assert_eq!(action_named(&labels, "-3"), None);
        assert_eq!(action_named(&labels, "-3 m/s²"), Some(0));
        assert_eq!(action_named(&labels, "-"), None);
    }

    #[test]
    fn markov_laws_have_a_row_for_each_action() {
        let file = |stay: &[f64], leave: &[f64]| MarkovFile {
            stay: Some(stay.to_vec()),
            leave: Some(leave.to_vec()),
            transitions: None,
            onsets: crate::ron_file::Ordered::default(),
        };
        let rows = |rows: &[&[f64]]| MarkovFile {
            stay: None,
            leave: None,
            transitions: Some(rows.iter().map(|it| it.to_vec()).collect()),
            onsets: crate::ron_file::Ordered::default(),
        };
        let law = transitions(&file(&[0.5, 1.0], &[0.0, 2.0]), 2).expect("a law");
        // Action 1 has no other to leave to, and action 0 leaves to it alone.
        assert_eq!(law, [[0.5, 0.5], [0.0, 1.0]]);
        let law = transitions(&file(&[0.5, 0.25], &[0.0, 2.0]), 2).expect("a law");
        assert_eq!(law[1], [0.0, 1.0]);
        let law = transitions(&rows(&[&[1.0, 3.0], &[0.0, 2.0]]), 2).expect("a law");
        assert_eq!(law, [[0.25, 0.75], [0.0, 1.0]]);
        let number = "`stay` requires 2 probabilities, and `leave` 2 weights";
        let weight = "a row of `transitions` has no weight, or one below 0";
        let either = "a Markov law has either `stay` and `leave`, or `transitions`";
        let rows_of = "`transitions` requires 2 rows of 2 weights";
        let both = MarkovFile {
            transitions: rows(&[&[1.0, 0.0], &[0.0, 1.0]]).transitions,
            ..file(&[0.5, 0.5], &[1.0, 1.0])
        };
        let half = MarkovFile {
            leave: None,
            ..file(&[0.5, 0.5], &[1.0, 1.0])
        };
        for (file, says) in [
            (file(&[0.5], &[1.0, 1.0]), number),
            (file(&[0.5, 0.5], &[1.0]), number),
            (file(&[0.5, 1.1], &[1.0, 1.0]), number),
            (file(&[-0.1, 0.5], &[1.0, 1.0]), number),
            (
                file(&[0.5, 0.5], &[1.0, -1.0]),
                "a weight of `leave` is below 0",
            ),
            (rows(&[&[1.0, 0.0]]), rows_of),
            (rows(&[&[1.0], &[1.0]]), rows_of),
            (rows(&[&[1.0, 0.0], &[0.0, 0.0]]), weight),
            (rows(&[&[1.0, 0.0], &[2.0, -1.0]]), weight),
            (both, either),
            (half, either),
        ] {
            assert_eq!(transitions(&file, 2).err().as_deref(), Some(says));
        }
    }

    #[test]
    fn actions_represent_what_is_nearest_to_them() {
        let inf = f64::INFINITY;
        assert_eq!(
            cells(&[0.0, -3.0, 2.0]),
            [[-1.5, 1.0], [-inf, -1.5], [1.0, inf]]
        );
        // Equal accelerations represent the same, and one alone represents all.
        assert_eq!(cells(&[1.0, 1.0, 3.0])[..2], [[-inf, 2.0]; 2]);
        assert_eq!(cells(&[1.0]), [[-inf, inf]]);
    }

    #[test]
    fn laws_that_fit_no_world_are_refused_with_a_fix() {
        use crate::risk::{RiskTraffic, RiskTrafficError};
        use crate::world::{LoadError, Scenario};
        let [acc, cut_in, pedestrian] = ["acc", "cut_in", "pedestrian"]
            .map(|name| Scenario::shipped(name).expect("shipped").expect("sound"));
        let text = include_str!("../../../../worlds/acc.ron");
        let text = text.replace("0.0, 3.0]), neutral", "0.0, 3.0, 3.0]), neutral");
        let twice = Scenario::parse("acc.ron", &text).expect("sound");
        let markov = |onset: &str| {
            format!(
                "\"ado\": Markov(stay: [0.5, 0.5, 0.5], leave: [1, 1, 1], onsets: {{ \"on\": {onset} }})"
            )
        };
        let lateral = "lateral: (stay: [0.9, 0.5], leave: [1, 1])";
        for (world, model, ados, says) in [
            (
                &acc,
                "",
                "\"ado\": Fitted()".to_owned(),
                "a `Fitted` law requires a model",
            ),
            (
                &acc,
                "motorway",
                format!("\"ado\": Fitted({lateral})"),
                "`ado` has no lateral moves",
            ),
            (
                &twice,
                "motorway",
                "\"ado\": Fitted()".to_owned(),
                "`ado` accelerates by 3 m/s² in two actions",
            ),
            (
                &cut_in,
                "motorway",
                "\"ado\": Fitted()".to_owned(),
                "the lateral moves of `ado` have no law",
            ),
            (
                &pedestrian,
                "motorway",
                "\"ado\": Fitted()".to_owned(),
                "models of traffic have no law for the actions of",
            ),
            (
                &acc,
                "",
                "\"ado\": Fitted(), \"other\": Fitted()".to_owned(),
                "unknown ado `other`",
            ),
            (
                &acc,
                "",
                String::new(),
                "the ado `ado` has no law of actions",
            ),
            (
                &acc,
                "",
                markov("(rate_per_s: \"1\", to: { \"-3\": 0 })"),
                "an onset leads to no action",
            ),
            (
                &acc,
                "",
                markov("(rate_per_s: \"1\", to: { \"-3\": -1 })"),
                "unknown action `-3`, or a weight below 0",
            ),
            (
                &acc,
                "",
                markov("(rate_per_s: \"1 +\", to: { \"-3\": 1 })"),
                "",
            ),
        ] {
            let model = match model {
                "" => String::new(),
                name => format!("model: \"{name}\","),
            };
            let text =
                format!("Traffic(source: \"test\", {model} starts: {{}}, ados: {{ {ados} }})");
            let Err(RiskTrafficError::File(LoadError::Scenario(placed))) =
                RiskTraffic::parse(world, "t.ron", &text)
            else {
                panic!("{text}");
            };
            let what = &placed.problems[0].what;
            assert!(what.contains(says), "{what}");
        }
        // Decisions of 0.25 s repeat an action of the model once.
        let text = format!(
            "Traffic(source: \"test\", model: \"motorway\", starts: {{}}, ados: {{ \"ado\": Fitted({lateral}) }})"
        );
        let law = RiskTraffic::parse(&cut_in, "t.ron", &text)
            .expect("sound")
            .actions;
        assert!(matches!(&law.ados[0].kind, LawKind::Fitted(law) if law.hold == 2));
        assert_eq!((law.ados[0].actions, law.ados[0].neutral), (6, 1));
    }

    #[test]
    fn a_memory_is_read_as_one_hot_codes_of_what_a_law_depends_on() {
        let markov_ado = AdoLaw {
            name: "one".to_owned(),
            actions: 3,
            neutral: 1,
            kind: LawKind::Markov(markov()),
        };
        let list = vec![1.0, 0.0];
        let fitted = FittedLaw {
            model: TrafficModel::motorway().driver,
            cells: cells(&list),
            accelerations_mps2: list,
            hold: 2,
            lateral: None,
        };
        let law = ActionLaw {
            ados: vec![
                markov_ado,
                AdoLaw {
                    name: "other".to_owned(),
                    actions: 2,
                    neutral: 1,
                    kind: LawKind::Fitted(fitted),
                },
            ],
        };
        let phases = Manoeuvre::FEATURES;
        assert_eq!(law.features(), 3 + 2 * 2 + 2 * phases);
        let mut memory = law.begin();
        let read = |memory: &LawMemory| {
            let mut all = Vec::new();
            memory.features(&law, &mut all);
            // The phases follow the actions of each ado.
            [&all[..3], &all[3 + phases..][..4]].concat()
        };
        assert_eq!(read(&memory), [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        // Both take action 0. The model looks back by two decisions, the other law by one.
        law.note(&mut memory, 0);
        assert_eq!(read(&memory), [1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
        law.note(&mut memory, 2);
        assert_eq!(read(&memory), [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
        law.note(&mut memory, 2 + 3);
        assert_eq!(read(&memory), [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn lateral_moves_are_the_higher_digit_of_a_fitted_action() {
        let list = vec![1.0, -1.0];
        let file = MarkovFile {
            stay: Some(vec![0.75, 0.5]),
            leave: Some(vec![1.0, 1.0]),
            transitions: None,
            onsets: crate::ron_file::Ordered::default(),
        };
        let law = FittedLaw {
            model: TrafficModel::motorway().driver,
            cells: cells(&list),
            accelerations_mps2: list,
            hold: 2,
            lateral: Some(MarkovLaw {
                transitions: transitions(&file, 2).expect("a law"),
                onsets: Vec::new(),
                decision_s: 0.25,
            }),
        };
        // Between two decisions of the model the acceleration stays, and the move need not.
        assert_eq!(law.probabilities(&[], [0, 1], 1), [0.0, 0.75, 0.0, 0.25]);
        assert_eq!(law.probabilities(&[], [0, 2], 1), [0.5, 0.0, 0.5, 0.0]);
        let drawn = law.probabilities(&[], [3, 3], 2);
        assert!((drawn[0] + drawn[1] - 0.5).abs() < 1e-12, "{drawn:?}");
    }

    #[test]
    fn a_fitted_law_needs_decisions_that_divide_those_of_its_model() {
        use crate::risk::{RiskTraffic, RiskTrafficError};
        use crate::world::{LoadError, Scenario};
        let text = "Traffic(source: \"test\", model: \"motorway\", starts: {}, \
                    ados: { \"ado\": Fitted() })";
        let hold = |decision_s: &str| {
            let world = include_str!("../../../../worlds/acc.ron");
            let clock = format!("horizon_s: 12.0, decision_s: {decision_s}");
            let world = world.replace("horizon_s: 15.0, decision_s: 0.5", &clock);
            let world = Scenario::parse("acc.ron", &world).expect("sound");
            match RiskTraffic::parse(&world, "t.ron", text) {
                Ok(traffic) => match &traffic.actions.ados[0].kind {
                    LawKind::Fitted(law) => Ok(law.hold),
                    LawKind::Markov(_) => panic!("a fitted law"),
                },
                Err(RiskTrafficError::File(LoadError::Scenario(placed))) => {
                    Err(placed.problems[0].what.clone())
                }
                Err(error) => panic!("{error}"),
            }
        };
        for (decision_s, decisions) in [("0.5", 1), ("0.25", 2), ("0.1", 5), ("0.05", 10)] {
            assert_eq!(hold(decision_s), Ok(decisions), "{decision_s}");
        }
        // Too long, and no part of half a second.
        for decision_s in ["2.0", "1.0", "0.4", "0.2"] {
            let said = hold(decision_s).expect_err(decision_s);
            assert!(said.ends_with("do not divide the model's 0.5 s"), "{said}");
        }
    }

    #[test]
    fn onsets_share_their_probability_by_their_rates_and_their_weights() {
        let schema = Schema::new(0.5, [Signal::real("v", "m/s", "speed")]).expect("sound");
        let onset = |rate: &str, to: &[f64]| Onset {
            text: rate.to_owned(),
            rate_per_s: rate
                .parse::<Expr>()
                .and_then(|rate| rate.bind(&schema, &Default::default()))
                .expect("sound"),
            to: to.to_vec(),
        };
        let law = MarkovLaw {
            onsets: vec![
                onset("0.3", &[1.0, 0.0, 0.0]),
                onset("0.1", &[0.0, 0.25, 0.75]),
            ],
            ..markov()
        };
        let found = law.probabilities(&[0.0], 0);
        let none = libm::exp(-0.4 * 0.5);
        let expected = [
            0.5 * none + 0.75 * (1.0 - none),
            0.375 * none + 0.25 * 0.25 * (1.0 - none),
            0.125 * none + 0.25 * 0.75 * (1.0 - none),
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        }
        // A certain event has no limit that is no number.
        let certain = MarkovLaw {
            onsets: vec![onset("1 / (v * 0)", &[0.0, 0.0, 1.0])],
            ..markov()
        };
        let found = certain.probabilities(&[1.0], 0);
        assert_eq!(found, [0.0, 0.0, 1.0]);
    }
}
