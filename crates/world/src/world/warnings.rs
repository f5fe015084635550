//! Warnings: allowed but odd content, and its confirmation by the world.

use strum::{IntoStaticStr, VariantArray};

use super::Scenario;
use super::scenario_kind::{DriveScenario, ScenarioKind};
use crate::ego::ControllerSpec;
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::rulebook::Rule;
use crate::scene::Clock;
use crate::scene::drive::Actions;
use crate::sim::PlantKind;
use crate::stl::{Formula, Monitor};
use crate::world_file::{
    AdoFile, AgentFile, Change, DriveFile, LightFile, RuleFile, ScenarioFile, StartFile,
};

/// Greatest usual speed of a start or a controller on a road: 252 km/h.
const FAST_MPS: f64 = 70.0;
/// Greatest usual lag of an actuator, in s.
const SLOW_S: f64 = 5.0;

/// Kinds of warnings, which `allow` of a world file can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub(super) enum Oddity {
    /// A bound of a formula is beyond the end of every run.
    #[strum(serialize = "bounds_beyond_T")]
    BoundsBeyondT,
    /// A decision lasts longer than a run.
    DecisionBeyondHorizon,
    /// An ado has a rule twice.
    DuplicateRule,
    /// An ado observes a signal twice.
    DuplicateObservation,
    /// All actions of an ado are equal.
    EqualActions,
    /// A change changes nothing.
    EmptyChange,
    /// A start speed is unusually high.
    FastStart,
    /// A speed of a controller is unusually high.
    FastEgo,
    /// The lag of an actuator is unusually long.
    LongLag,
    /// The world has no question.
    EmptyQuestion,
    /// An ado has no rule.
    EmptyRulebook,
    /// A coasting run neither keeps nor breaks a formula.
    Tie,
    /// No run kept two rules together.
    ExcludingRules,
    /// No run kept a rule to its end.
    NeverKept,
    /// No run can break a rule.
    UnbreakableRule,
    /// A formula is decided before anything moves.
    FirstSampleOnly,
    /// A rule was broken in all of too few runs.
    BarelyTried,
    /// A formula reads signals that no ado can observe.
    Unseen,
    /// The specification of the ego reads nothing of the ego.
    SpecWithoutEgo,
    /// Every lateral move of an ado leaves the road.
    OffRoadMove,
    /// The ego cannot stop before an obstacle.
    ObstacleTooNear,
    /// Wind blows in a world on the kinematic plant, which has no side motion.
    WindWithoutSlip,
}

/// Oddities of one world, with their paths.
pub(super) struct Warnings {
    allowed: Vec<&'static str>,
    found: Vec<(Oddity, Problem)>,
    noted: Vec<(Oddity, ValuePath, WarningText)>,
}

/// Statement, label and fix of an oddity.
type WarningText = (String, &'static str, &'static str);

/// Label and fix.
type LabelAndFix = (&'static str, &'static str);

/// Returns whether several actions all do the same.
///
/// A single action is a choice of its author.
fn are_equal(actions: &Actions) -> bool {
    fn all<T: PartialEq>(values: &[T]) -> bool {
        values.windows(2).all(|pair| pair[0] == pair[1])
    }
    let equal = match actions {
        Actions::Accelerations(values) | Actions::Curvatures(values) => all(values),
        Actions::Grid(grid) => all(&grid.accelerations) && all(&grid.lateral),
        Actions::Deviate(added) => all(&added.accelerations) && all(&added.lateral_mps),
        Actions::Walks(values) => all(values),
        Actions::Phases(values) => all(values),
        Actions::Rates(values) => all(values),
        Actions::Turns(values) => all(values),
    };
    equal && actions.len() > 1
}

impl Warnings {
    /// Reads `allow`, and reports unknown warnings.
    pub(super) fn allowing(
        problems: &mut Problems,
        path: &ValuePath,
        allow: &[String],
    ) -> Warnings {
        let known: Vec<&'static str> = Oddity::VARIANTS.iter().map(Into::into).collect();
        let mut allowed = Vec::new();
        for (i, name) in allow.iter().enumerate() {
            match known.iter().find(|known| *known == name) {
                Some(name) => allowed.push(*name),
                None => problems.unknown(&path.at(i), "warning", name, &known),
            }
        }
        Warnings {
            allowed,
            found: Vec::new(),
            noted: Vec::new(),
        }
    }

    /// Adds warnings of the trial runs.
    pub(super) fn found(&mut self, found: impl IntoIterator<Item = (Oddity, Problem)>) {
        self.found.extend(found);
    }

    fn note(&mut self, oddity: Oddity, path: ValuePath, what: String, (label, help): LabelAndFix) {
        self.noted.push((oddity, path, (what, label, help)));
    }

    /// Returns the warnings that the world does not allow.
    ///
    /// Each mentions the word that would allow it.
    pub(super) fn of(self, text: &str) -> Vec<Problem> {
        let noted = self.noted.into_iter().map(|(oddity, path, note)| {
            let (what, label, help) = note;
            let problem = Problem {
                what,
                span: path.find(text),
                label: label.to_owned(),
                help: Some(help.to_owned()),
            };
            (oddity, problem)
        });
        let all = self.found.into_iter().chain(noted);
        let said = all.filter(|(oddity, _)| !self.allowed.contains(&<&str>::from(oddity)));
        said.map(|(oddity, mut problem)| {
            let word = <&str>::from(oddity);
            let meant = format!("if it is meant so, write allow: [\"{word}\"]");
            problem.help = Some(match problem.help {
                Some(help) => format!("{help}; {meant}"),
                None => meant,
            });
            problem
        })
        .collect()
    }

    /// Warns of a world without a question.
    pub(super) fn question(&mut self, question: &str) {
        if question.trim().is_empty() {
            self.note(
                Oddity::EmptyQuestion,
                ValuePath::top().to("question"),
                "the world asks nothing".to_owned(),
                (
                    "empty",
                    "say in a sentence what is tested: reports open with it",
                ),
            );
        }
    }

    /// Warns of an ado's rules and observations.
    pub(super) fn ado(&mut self, path: &ValuePath, rules: &[RuleFile], observe: &[String]) {
        if rules.is_empty() {
            self.note(
                Oddity::EmptyRulebook,
                path.to("rulebook"),
                "this ado has no rule, so whatever it does is lawful".to_owned(),
                (
                    "empty",
                    "give it rules, such as one against driving backwards",
                ),
            );
        }
        // Compared as formulas, since texts may differ in spaces or brackets.
        let formulas: Vec<Option<Formula>> = rules
            .iter()
            .map(|rule| rule.stl().parse::<Formula>().ok())
            .collect();
        for (j, rule) in rules.iter().enumerate() {
            // Formulas that do not parse equal none, since other errors report them.
            let same = |i: &usize| {
                rules[*i].name() == rule.name()
                    || formulas[j].is_some() && formulas[*i] == formulas[j]
            };
            if let Some(i) = (0..j).find(same) {
                let what = if rules[i].name() == rule.name() {
                    format!("two rules are called `{}`", rule.name())
                } else {
                    format!("`{}` asks what `{}` does", rule.name(), rules[i].name())
                };
                let words = ("second one", "leave one of them out, or name them apart");
                self.note(
                    Oddity::DuplicateRule,
                    path.to("rulebook").at(j),
                    what,
                    words,
                );
            }
        }
        for (j, name) in observe.iter().enumerate() {
            if observe[..j].contains(name) {
                let what = format!("`{name}` is observed twice, and counts once");
                let place = path.to("observe").at(j);
                let words = ("second one", "leave one of them out");
                self.note(Oddity::DuplicateObservation, place, what, words);
            }
        }
    }

    /// Warns of wind that moves no body aside.
    fn wind(&mut self, file: &ScenarioFile) {
        if file.wind.is_some() && file.plant == PlantKind::Kinematic {
            self.note(
                Oddity::WindWithoutSlip,
                ValuePath::top().to("wind"),
                "on the kinematic plant wind moves nothing aside".to_owned(),
                ("drag only", "write plant: Rigid"),
            );
        }
    }

    /// Warns of a driving world's text.
    pub(super) fn driving(&mut self, file: &ScenarioFile) {
        let top = ValuePath::top();
        self.question(&file.question);
        self.clock(&top.to("clock"), &file.clock);
        self.changed_egos(file);
        self.wind(file);
        for (i, agent) in file.agents.iter().enumerate() {
            let path = top.to("agents").at(i);
            match agent {
                AgentFile::Vehicle { start, drive, .. }
                | AgentFile::Pedestrian { start, drive, .. } => {
                    self.start(&path.to("start"), start);
                    self.drive(&path.to("drive"), drive);
                }
                // An obstacle stands still and decides nothing.
                AgentFile::Obstacle { .. } => {}
                AgentFile::Weather(weather) => {
                    self.driven_ado(&path.to("drive"), weather.drive.ado());
                }
                AgentFile::Road(road) => {
                    self.driven_ado(&path.to("drive"), road.drive.ado());
                }
                AgentFile::Turns { drive, .. } => {
                    self.driven_ado(&path.to("drive"), drive.ado());
                }
                AgentFile::Light { drive, .. } => {
                    if let LightFile::Ado(ado) = drive {
                        self.driven_ado(&path.to("drive"), ado);
                    }
                }
            }
        }
    }

    fn drive(&mut self, path: &ValuePath, drive: &DriveFile) {
        match drive {
            DriveFile::Ego(ego) => {
                self.lag(&path.at(0).to("lag_s"), ego.lag_s);
                self.controller(&path.at(0), &ego.controller);
            }
            DriveFile::Ado(ado) => self.driven_ado(path, ado),
            // A trained ado was warned of in its own world, and the others decide
            // nothing.
            DriveFile::Trained(_)
            | DriveFile::Scripted(_)
            | DriveFile::Story
            | DriveFile::Script(_)
            | DriveFile::Meet(_) => {}
        }
    }

    fn driven_ado(&mut self, path: &ValuePath, ado: &AdoFile) {
        let observe = ado.observe.as_deref().unwrap_or_default();
        self.ado(path, &ado.rulebook, observe);
        if are_equal(&ado.actions) {
            let what = "this ado has no choice, since all its actions are equal".to_owned();
            let words = ("all equal", "give it actions that differ");
            self.note(Oddity::EqualActions, path.to("actions"), what, words);
        }
        self.lag(&path.to("lag_s"), ado.lag_s);
    }

    fn clock(&mut self, path: &ValuePath, clock: &Clock) {
        let Clock {
            decision_s,
            horizon_s,
            ..
        } = *clock;
        if horizon_s < decision_s {
            let what = format!("a decision of {decision_s} s in a run of {horizon_s} s");
            let words = ("longer than a run", "so the ado decides once: shorten it");
            let place = path.to("decision_s");
            self.note(Oddity::DecisionBeyondHorizon, place, what, words);
        }
    }

    fn start(&mut self, path: &ValuePath, start: &StartFile) {
        let (StartFile::At { speed_mps, .. } | StartFile::Ahead { speed_mps, .. }) = start;
        let most_mps = speed_mps.0.lo.abs().max(speed_mps.0.hi.abs());
        if most_mps > FAST_MPS {
            let kmh = 3.6 * most_mps;
            let what = format!("a start at {most_mps} m/s, which is {kmh:.0} km/h");
            let words = ("very fast", "speeds are in m/s");
            self.note(Oddity::FastStart, path.to("speed_mps"), what, words);
        }
    }

    /// Warns of speeds of a controller that look like km/h.
    fn controller(&mut self, path: &ValuePath, controller: &ControllerSpec) {
        for parameter in controller.parameters() {
            self.speed(path, parameter.name, parameter.value);
        }
    }

    /// Warns of a speed of a controller. Parameters of other units are ignored.
    fn speed(&mut self, path: &ValuePath, name: &str, value: f64) {
        if name.ends_with("_mps") && value > FAST_MPS {
            let kmh = 3.6 * value;
            let what = format!("`{name}` is {value} m/s, which is {kmh:.0} km/h");
            let words = ("very fast", "speeds are in m/s");
            self.note(Oddity::FastEgo, path.to(name), what, words);
        }
    }

    /// Warns of speeds of the egos under `reuse` and of the family that look like km/h.
    fn changed_egos(&mut self, file: &ScenarioFile) {
        for (name, change) in &file.reuse.0 {
            let path = ValuePath::top().to("reuse").to(name);
            if *change == Change::default() {
                let what = format!("`{name}` changes nothing, so it is the world's own ego");
                let words = ("empty", "change something, or leave it out");
                self.note(Oddity::EmptyChange, path.clone(), what, words);
            }
            if let Some(controller) = &change.controller {
                self.controller(&path.to("controller").at(0), &controller.controller);
            }
            for (name, value) in &change.ego.0 {
                self.speed(&path.to("ego"), name, *value);
            }
        }
        let family = file.train_against.iter();
        // The upper end alone: if it is usual, so is the lower end.
        for (name, (_, hi)) in family.flat_map(|family| &family.ego.0) {
            self.speed(&ValuePath::top().to("train_against").to("ego"), name, *hi);
        }
    }

    fn lag(&mut self, path: &ValuePath, lag_s: f64) {
        if lag_s > SLOW_S {
            let what = format!("an actuator that lags by {lag_s} s");
            let words = ("hardly moves", "lags are in seconds; 0.1 to 0.5 are usual");
            self.note(Oddity::LongLag, path.clone(), what, words);
        }
    }

    /// Warns of a specification that reads nothing of the ego.
    ///
    /// An ado then violates it by itself, and the ego is not tested.
    pub(super) fn spec_without_ego(&mut self, scenario: DriveScenario<'_>) {
        let signals = scenario.world().schema().signals();
        let read: Vec<String> = scenario
            .rulebook()
            .spec
            .signals()
            .into_iter()
            .map(|signal| signals[signal].name.clone())
            .collect();
        if scenario.spec().reads_the_ego(&read) {
            return;
        }
        let names: Vec<String> = read.iter().map(|name| format!("`{name}`")).collect();
        let what = format!(
            "the ego's specification reads nothing of the ego, only {}",
            names.join(", ")
        );
        let words = (
            "not about the ego",
            "mention a signal of the ego, such as its distance from another agent",
        );
        let place = ValuePath::top().to("ego_spec");
        self.note(Oddity::SpecWithoutEgo, place, what, words);
    }

    /// Warns of formulas with signals that no ado can observe.
    ///
    /// An ado then keeps or breaks them by chance only.
    pub(super) fn unseen(&mut self, scenario: DriveScenario<'_>) {
        let spec = scenario.spec();
        // Without learning, no observation is required.
        if spec.action_sets().next().is_none() {
            return;
        }
        let signals = scenario.world().schema().signals();
        let read = |monitor: &Monitor| -> Vec<String> {
            let positions = monitor.signals().into_iter();
            positions
                .map(|position| signals[position].name.clone())
                .collect()
        };
        for (who, place, monitor) in formulas(&scenario) {
            let read = read(monitor);
            let unseen: Vec<String> = spec
                .unseen(&read)
                .iter()
                .map(|name| format!("`{name}`"))
                .collect();
            if !unseen.is_empty() {
                let what = format!(
                    "{who} reads {}, and no ado observes anything of it",
                    unseen.join(", ")
                );
                let words = (
                    "not seen",
                    "observe it; without `observe` an ado sees where everybody is from the ego, how fast all are, and the time",
                );
                self.note(Oddity::Unseen, place, what, words);
            }
        }
    }

    /// Warns of bounds of formulas beyond the end of every run.
    pub(super) fn bounds(&mut self, scenario: &Scenario) {
        let clock = scenario.world().clock();
        // A window longer than this reaches beyond the end from every sample.
        let last = clock.samples() - 1;
        let end = clock.horizon_s;
        // The clock of a grid counts steps.
        let unit = match scenario.kind() {
            ScenarioKind::Drive(_) => "s",
            ScenarioKind::Grid(_) => "steps",
        };
        let reach_s = |monitor: &Monitor| {
            let reach = monitor.longest_window_samples();
            (last < reach).then_some(reach as f64 * clock.sample_s)
        };
        for (who, place, monitor) in formulas(scenario) {
            if let Some(reach_s) = reach_s(monitor) {
                // Rounded to remove the digits of binary fractions.
                let reach_s = (reach_s * 1e9).round() / 1e9;
                let what =
                    format!("{who} looks {reach_s} {unit} away, and a run ends at {end} {unit}");
                let words = ("a bound beyond T", "write T, or lengthen the horizon");
                self.note(Oddity::BoundsBeyondT, place, what, words);
            }
        }
    }
}

/// Specification and rules: name, place and monitor of each.
pub(super) fn formulas(scenario: &Scenario) -> Vec<(String, ValuePath, &Monitor)> {
    let rulebook = scenario.rulebook();
    let place = ValuePath::top().to("ego_spec");
    let spec = ("the ego's specification".to_owned(), place, &rulebook.spec);
    let rules = rulebook.rules.iter().map(|rule| {
        let place = rule_place(scenario, rule);
        (format!("the rule `{}`", rule.name), place, &rule.monitor)
    });
    std::iter::once(spec).chain(rules).collect()
}

/// Returns the place of a rule in the file of its world.
pub(super) fn rule_place(scenario: &Scenario, rule: &Rule) -> ValuePath {
    let mut rules = scenario.rules.iter();
    // Rules of two ados may share a name.
    let found = rules.find(|spec| spec.name == rule.name && spec.ado == rule.ado);
    found.map_or_else(ValuePath::top, |spec| spec.place.clone())
}
