//! Fault of a counterexample in a few words, as far as the data show it.
//!
//! Where reference drivers apply, the words state the number that avoids it.
//! Otherwise they state the right of way, the lane, or the effect of braking.

use super::Example;
use crate::preventability::{Label, NotApplicable};
use crate::road::Direction;
use crate::run_dir::{Answer, LastChance};
use crate::scene::drive::DriveWorld;
use crate::sim::Pose;
use crate::world::Scenario;

/// Words, and the CSS class of their colour.
pub(super) type StyledFault = (String, &'static str);

/// Returns the fault of an example.
pub(super) fn fault(scenario: &Scenario, example: &Example) -> StyledFault {
    let said = |words: &str, class| (words.to_owned(), class);
    let Some(known) = &example.about.preventability else {
        return said("no contact", "b-open");
    };
    let [avoid, _] = known.drivers();
    let (some, all) = (avoid.len(), known.handover.len());
    let drivers = format!("avoided by {some} of {all} drivers");
    let why = example.about.why.as_ref();
    let chance = why.and_then(|why| why.last_chance.as_ref());
    // Exoneration comes first: it holds whatever the reference drivers do.
    match (known.exonerated, known.label, known.not_applicable) {
        (Some(_), ..) => said("not the ego's fault", "b-not"),
        (None, Label::AvoidedByAll, _) => said(&drivers, "b-ego"),
        (None, Label::AvoidedBySome, _) => said(&drivers, "b-hard"),
        (None, Label::OnlyByPerfect | Label::OnlyByForesight, _) => said(&drivers, "b-hard"),
        (None, Label::UnavoidableByBraking, _) => match chance.map(LastChance::answer) {
            Some(Answer::NotAvoided) | None => said("unavoidable by braking", "b-hard"),
            // The last chance is replayed in another way, too.
            Some(_) => said(&drivers, "b-hard"),
        },
        (None, _, Some(NotApplicable::WithoutEgo)) => said("not the ego's contact", "b-not"),
        _ => by_right_of_way(scenario, example).unwrap_or_else(|| by_braking(chance)),
    }
}

/// Fault by right of way or lane, if the roads of both agents decide it.
fn by_right_of_way(scenario: &Scenario, example: &Example) -> Option<StyledFault> {
    let world = scenario.drive()?.world();
    let (one, other) = &example.episode.contact.as_ref()?.between;
    let egos: Vec<usize> = world.spec().egos().collect();
    let ego = &world.spec().agents[*egos.first()?].name;
    let opponent = if one == ego { other } else { one };
    match world.goes_before(ego, opponent) {
        Some(true) => Some((format!("{opponent} had to give way"), "b-not")),
        Some(false) => Some((format!("{ego} had to give way"), "b-ego")),
        None => by_lane(world, example, ego, opponent),
    }
}

/// Fault by lane, of two agents on one road in opposite directions.
fn by_lane(
    world: &DriveWorld,
    example: &Example,
    ego: &str,
    opponent: &str,
) -> Option<StyledFault> {
    let agents = &world.spec().agents;
    let of = |name: &str| agents.iter().position(|agent| agent.name == name);
    let (own, its) = (of(ego)?, of(opponent)?);
    let is_oncoming = agents[its].direction == Direction::Against && agents[its].road == 0;
    if !is_oncoming {
        return None;
    }
    // The last frame is that of the contact.
    let place = example.frames.last()?.placements.get(own)?;
    let begun = world
        .at_start(&example.episode.start)
        .along(&example.episode.trace);
    let at = begun.course().locate(&Pose {
        // The lane of a position does not depend on the heading.
        x_m: place.centre_m[0],
        y_m: place.centre_m[1],
        heading_rad: 0.0,
    });
    // The ego's own lane is that of its start, whose place is that at the width of
    // the world.
    let lane = world.spec().road.lane_at(agents[own].lateral_m.lo);
    let road = &begun.spec().road;
    let off_m = (at.lateral_m - road.lane_middle_m(lane)).abs();
    // By its centre: a vehicle that only touches the line has not left its
    // lane.
    Some(if off_m < 0.5 * road.lane_width_m() {
        (format!("{opponent} was in {ego}'s lane"), "b-not")
    } else {
        (format!("{ego} had left its lane"), "b-ego")
    })
}

/// Fault by braking, which states no more than is known.
fn by_braking(chance: Option<&LastChance>) -> StyledFault {
    let words = match chance.map(LastChance::answer) {
        Some(Answer::Avoided) => "avoidable by braking",
        Some(Answer::NotAvoided) => "unavoidable by braking",
        Some(Answer::NoAnswer(_)) | None => return ("fault not judged".to_owned(), "b-open"),
    };
    (words.to_owned(), "b-hard")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::animation::tests::{crash, world};

    /// Replaces the text from `from` up to `to` by `by`.
    fn put(text: &str, (from, to): (&str, &str), by: &str) -> String {
        let at = text.find(from).expect("where it begins");
        let end = at + text[at..].find(to).expect("where it ends");
        format!("{}{by}{}", &text[..at], &text[end..])
    }

    /// Words for the first crash that a constant action causes.
    fn said(text: &str) -> Option<String> {
        let without_rules = put(text, ("rulebook: [", "\n                ]"), "rulebook: [");
        // The ego coasts, so the contact happens. Variants that change its
        // controller are removed too.
        let blind = "Ego(Coast(accel_mps2: 0.0, lag_s: 0.0)),\n        ),\n";
        let coasting = put(&without_rules, ("Ego(", "        Vehicle("), blind);
        let scenario = world(&put(&coasting, ("    reuse: {", "\n)\n"), ""));
        by_right_of_way(&scenario, &crash(&scenario)).map(|(words, _)| words)
    }

    #[test]
    fn who_comes_from_the_right_goes_first() {
        let right = include_str!("../../../../worlds/crossroads.ron");
        assert_eq!(said(right).as_deref(), Some("ego had to give way"));
        let left = put(
            right,
            ("y_m: -60.0", ", lanes"),
            "y_m: 60.0, heading_rad: -1.5707963)",
        );
        assert_eq!(said(&left).as_deref(), Some("ado had to give way"));
    }

    #[test]
    fn who_is_met_on_the_wrong_side_was_in_the_egos_lane() {
        let oncoming = include_str!("../../../../worlds/oncoming.ron");
        assert_eq!(said(oncoming).as_deref(), Some("ado was in ego's lane"));
    }

    #[test]
    fn nobody_had_to_give_way_to_who_drives_ahead() {
        assert_eq!(said(include_str!("../../../../worlds/acc.ron")), None);
    }
}
