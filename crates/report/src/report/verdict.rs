//! Outcome of a counterexample in one sentence.
//!
//! It states the contact and its speed, the rules, and the reference drivers
//! that avoid it.

use super::Example;
use super::fault::{StyledFault, fault};
use crate::ego::Phase;
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::run_dir::{Answer, LastChance, Severity};
use crate::scene::Role;
use crate::scene::drive::Drive;
use crate::severity::{CrashKind, Side};
use crate::sim::wrapped;
use crate::testbench::Episode;
use crate::world::{Scenario, ScenarioKind};

/// Parts of the sentence.
pub(super) struct VerdictWords {
    /// Contact, or the requirement that the ego violated.
    pub what: String,
    /// Statement about the ados' rules. `None` if the outcome contains it.
    pub rules: Option<String>,
    /// Reference drivers that avoid it. `None` if nothing is known.
    pub care: Option<String>,
    /// Blame in two or three words, and the CSS class of its colour.
    pub blame: StyledFault,
}

impl VerdictWords {
    /// Returns the outcome of an example.
    pub(super) fn of(scenario: &Scenario, example: &Example) -> VerdictWords {
        VerdictWords {
            what: what(scenario, example),
            rules: rules(example),
            care: care(example),
            blame: fault(scenario, example),
        }
    }

    /// Returns the whole sentence.
    pub(super) fn sentence(&self) -> String {
        let rules = self.rules.as_ref().map(|rules| format!(", {rules}"));
        let care = self.care.as_ref().map(|care| format!("; {care}"));
        let (rules, care) = (rules.unwrap_or_default(), care.unwrap_or_default());
        format!("{}{rules}{care}.", self.what)
    }
}

/// Outcome of an episode in a few words, such as `held: ρ 0.238, no contact`.
pub fn outcome_in_words(scenario: &Scenario, episode: &Episode) -> String {
    let rho = format!("ρ {:.3}", episode.robustness);
    let contact = match &episode.contact {
        Some(touch) => format!("contact at {:.1} m/s", touch.closing_speed_mps),
        None => "no contact".to_owned(),
    };
    match episode.verdict {
        Verdict::Held { .. } => format!("held: {rho}, {contact}"),
        Verdict::Counterexample { .. } => format!("failed: {rho}, {contact}"),
        Verdict::Uncounted { .. } => format!("failed, but not so that it counts: {rho}, {contact}"),
        Verdict::Foul { rule, .. } => {
            let rule = &scenario.rulebook().rules[rule];
            format!("foul: {} broke “{}”, {contact}", rule.ado, rule.name)
        }
        Verdict::Invalid => "did not run".to_owned(),
    }
}

/// Returns true if the ego failed, and false for a foul, a success or no run.
pub(super) fn ego_failed(episode: &Episode) -> bool {
    let verdict = episode.verdict;
    matches!(
        verdict,
        Verdict::Counterexample { .. } | Verdict::Uncounted { .. }
    )
}

fn what(scenario: &Scenario, example: &Example) -> String {
    if !ego_failed(&example.episode) {
        let words = outcome_in_words(scenario, &example.episode);
        return match example.episode.verdict {
            // The words of a table become a sentence.
            Verdict::Held { .. } => format!("The ego {}", words.replacen(':', ",", 1)),
            _ => capital(&words),
        };
    }
    let Some(touch) = &example.episode.contact else {
        return without_contact(scenario, example);
    };
    // On a grid there are no speeds or sides.
    if let ScenarioKind::Grid(_) = scenario.kind() {
        return format!("The ado caught the ego after {:.0} s", touch.time_s);
    }
    let speed = format!("at {:.1} m/s", touch.closing_speed_mps);
    let (one, other) = &touch.between;
    let agents = scenario.bench().stage().agents;
    let is_ego = |name: &String| {
        let found = agents.iter().find(|agent| agent.name == *name);
        found.is_some_and(|agent| agent.role == Role::Ego)
    };
    let (ego, opponent) = match (is_ego(one), is_ego(other)) {
        (true, _) => (one, other),
        (_, true) => (other, one),
        // A specification of the ego may be violated by a contact between
        // others.
        _ => return format!("{one} and {other} touched {speed}"),
    };
    let ego = match ego.as_str() {
        "ego" => "the ego".to_owned(),
        name => format!("the ego ({name})"),
    };
    // Without a severity the sides are unknown, and the words name none.
    let words = match &example.about.severity {
        Some(severity) => hit(&ego, opponent, severity, turned(scenario, example)),
        None => format!("{ego} and {opponent} met"),
    };
    format!("{} {speed}", capital(&words))
}

/// Violation of the ego without a contact.
///
/// It is a distance, a red light, or the leaf of ψ_ego with its values.
fn without_contact(scenario: &Scenario, example: &Example) -> String {
    // The explanation must not read samples after the verdict.
    let judged = example.episode.judged_trace();
    let explanation = scenario.rulebook().spec.explain(&judged);
    let Some(leaf) = explanation.leaf() else {
        return "No contact, but the ego broke what is asked of it".to_owned();
    };
    let begun = scenario.of_episode(&example.episode);
    let stage = begun.bench().stage();
    // Names of agents and lights are parts of dotted signal names.
    let part_of = |signal: &str, name: &str| signal.split('.').any(|part| part == name);
    for (signal, value) in &explanation.signals {
        let mut others = stage.agents.iter().filter(|agent| agent.role != Role::Ego);
        let near = others.find(|agent| part_of(signal, &agent.name));
        if let Some(near) = near.filter(|_| signal.ends_with(".gap")) {
            return format!(
                "No contact, but the ego came within {value:.2} m of {}",
                near.name
            );
        }
        let light = stage
            .lights
            .iter()
            .position(|light| part_of(signal, &light.name));
        // Phases belong to the sample at which the leaf is violated.
        let frame = example.frames.get(leaf.sample);
        let phase = light.and_then(|light| frame.map(|frame| frame.phases[light]));
        if let (Some(light), Some(Phase::Red)) = (light, phase) {
            // A world with a single light usually calls it `light`, so its name
            // is omitted.
            return match stage.lights[light].name.as_str() {
                "light" => "No contact, but the ego ran the red light".to_owned(),
                name => format!("No contact, but the ego ran the red light {name}"),
            };
        }
    }
    let values: Vec<String> = explanation
        .signals
        .iter()
        .map(|(name, value)| format!("{name} = {value:.2}"))
        .collect();
    let (formula, values) = (&leaf.formula, values.join(", "));
    format!("No contact, but the ego broke {formula} ({values})")
}

/// Least turn in radians that counts as turning.
const TURNS_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Road user that turned before a contact of two roads.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TurnedAcross {
    Ego,
    Opponent,
}

/// Returns which of the two that touched had turned across the path of the other.
///
/// `None` on one road, whose bends both follow.
fn turned(scenario: &Scenario, example: &Example) -> Option<TurnedAcross> {
    let agents = &scenario.drive()?.spec().agents;
    let (one, other) = &example.episode.contact.as_ref()?.between;
    let place = |name: &String| agents.iter().position(|agent| agent.name == *name);
    let both = [place(one)?, place(other)?];
    let is_ego = |who: usize| matches!(agents[who].drive, Drive::Ego);
    let [ego, opponent] = if is_ego(both[0]) {
        both
    } else {
        [both[1], both[0]]
    };
    if agents[ego].road == agents[opponent].road {
        return None;
    }
    // Over the whole drive, because a turn is complete only at its end.
    let (first, last) = (example.frames.first()?, example.frames.last()?);
    let turn_rad = |who: usize| {
        let [from, to] = [first, last].map(|frame| frame.placements[who].heading_rad());
        wrapped(to - from).abs()
    };
    let (own_rad, its_rad) = (turn_rad(ego), turn_rad(opponent));
    match own_rad.max(its_rad) {
        turn_rad if turn_rad < TURNS_RAD => None,
        _ if own_rad < its_rad => Some(TurnedAcross::Opponent),
        _ => Some(TurnedAcross::Ego),
    }
}

/// Contact in words, by its kind, the sides that touched, and who turned.
fn hit(ego: &str, opponent: &str, severity: &Severity, turned: Option<TurnedAcross>) -> String {
    let impact = &severity.impact;
    let side = |side: Side| match side {
        Side::Front => "front",
        Side::Left => "left side",
        Side::Right => "right side",
        Side::Rear => "rear",
    };
    let (own, its) = (impact.ego_side, impact.other_side);
    match (impact.kind, own) {
        // A pedestrian who touches another side of the ego has walked into it.
        (CrashKind::Pedestrian, Side::Front) => format!("{ego} hit {opponent}"),
        (CrashKind::Pedestrian, _) => format!("{opponent} ran into the {} of {ego}", side(own)),
        (CrashKind::HeadOn | CrashKind::Crossing | CrashKind::SideSwipe, _)
            if let Some(turned) = turned =>
        {
            let (own, its) = (side(own), side(its));
            match turned {
                TurnedAcross::Ego => format!(
                    "the {own} of {ego}, which turned across the path of {opponent}, hit its {its}"
                ),
                TurnedAcross::Opponent => format!(
                    "the {own} of {ego} hit the {its} of {opponent}, which turned across its path,"
                ),
            }
        }
        (CrashKind::HeadOn, _) => format!("{ego} and {opponent} met head-on"),
        (CrashKind::SideSwipe, _) => {
            format!(
                "the {} of {ego} and the {} of {opponent} brushed",
                side(own),
                side(its)
            )
        }
        (_, Side::Front) => format!("{ego} hit the {} of {opponent}", side(its)),
        _ if its == Side::Front => format!("{opponent} hit the {} of {ego}", side(own)),
        _ => format!(
            "the {} of {ego} and the {} of {opponent} met",
            side(own),
            side(its)
        ),
    }
}

fn rules(example: &Example) -> Option<String> {
    // The words for a foul and an invalid episode already mention the rules.
    if let Verdict::Foul { .. } | Verdict::Invalid = example.episode.verdict {
        return None;
    }
    Some(match &example.episode.rules_until_contact {
        Some(RulesUntilContact::Broken { rule, time_s, .. }) => format!(
            "every rule kept up to the failure, but “{rule}” broken at {time_s:.2} s, before the contact"
        ),
        _ => "every rule kept".to_owned(),
    })
}

fn care(example: &Example) -> Option<String> {
    let chance = example
        .about
        .why
        .as_ref()
        .and_then(|why| why.last_chance.as_ref());
    // Reference drivers take precedence over full braking, which is the last
    // resort.
    let Some(known) = &example.about.preventability else {
        return chance.map(by_braking);
    };
    if let Some(why) = known.exonerated {
        return Some(format!("not the ego's fault: {}", why.words()));
    }
    let Some(words) = known.who_avoids() else {
        return chance.map(by_braking);
    };
    let own = if known.self_inflicted {
        ", and the ego had brought itself there"
    } else {
        ""
    };
    Some(format!("{words}{own}"))
}

fn by_braking(chance: &LastChance) -> String {
    let driver = &chance.driver;
    match (chance.at_s, chance.answer()) {
        (Some(at_s), _) => {
            // A rounding error must not print a negative time.
            let before_s = (chance.violated_s - at_s).max(0.0);
            format!("{driver} {before_s:.2} s before the failure would have avoided it")
        }
        (None, Answer::NoAnswer(_)) => format!("no answer whether {driver} would have avoided it"),
        (None, _) => format!("{driver} would not have avoided it at any time"),
    }
}

/// Text with a capital first letter.
pub(super) fn capital(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::animation::tests::{crash, shown};
    use crate::scene::Start;
    use crate::testbench::{Aftermath, Replay, play};

    #[test]
    fn a_turn_across_is_called_turning_and_a_cut_in_is_not() {
        let shipped = |name: &str| Scenario::shipped(name).expect("shipped").expect("sound");
        let scenario = shipped("turn_across");
        let start = Start(vec![
            13.642700187642795,
            18.60647215464056,
            6.2141864479071565,
        ]);
        let actions = [0, 0, 2, 3, 3, 3, 3, 3, 3, 3, 3];
        let mut ado = Replay::holding(&actions);
        let episode = play(&mut scenario.bench(), &start, 0, &mut ado, Aftermath::Play);
        let example = shown(&scenario, episode);
        assert_eq!(turned(&scenario, &example), Some(TurnedAcross::Opponent));
        let sentence = VerdictWords::of(&scenario, &example).sentence();
        assert!(
            sentence.starts_with("The left side of the ego hit the left side of ado, which turned across its path, at "),
            "{sentence}"
        );
        let cut_in = shipped("cut_in");
        let example = crash(&cut_in);
        assert_eq!(turned(&cut_in, &example), None);
        let sentence = VerdictWords::of(&cut_in, &example).sentence();
        assert!(!sentence.contains("turned"), "{sentence}");
    }
}
