//! Plans of entities in the form of a world file: meetings and scripts.

use super::concrete::Concrete;
use super::conditions::{TriggerParameters, formula};
use super::draft::Draft;
use super::entity::{ImportedLaw, ImportedStep, Steady};
use super::seen::{EntityInFrame, EntityPath, ego_lever_m, named};
use crate::opendrive::error::ImportError;
use crate::road::ChangeShape;

/// Writes the plan of an entity, as its `drive` or as the base of an ado.
///
/// # Errors
///
/// Returns an error for a second condition, and for a place outside of the
/// frame.
pub(super) fn plan(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
    triggers: &mut Vec<(String, f64)>,
) -> Result<(), ImportError> {
    let name = &it.name;
    if let Some(approach) = &it.entity.approach {
        let at = &it.entity.at;
        let ego = concrete.station(&approach.ego, at)?;
        let here = match it.path {
            EntityPath::Own(..) => concrete.in_frame(&approach.here, at)?,
            _ => concrete.station(&approach.here, at)?,
        };
        // Places are those of reference points, and worlds state fronts.
        let here_m = match it.path {
            EntityPath::Left | EntityPath::Right => here.y_m + it.front_left_m(),
            EntityPath::Own(begins, on) => {
                // On a bent path, the station is the distance along the pieces.
                let along_m = match &approach.here.way {
                    Some(here) if here.way == on.way && on.way.piece_count() > 0 => here.along_m,
                    _ if on.is_lane => on.station_m(&approach.here.spot),
                    _ => begins.sees(&here).x_m,
                };
                along_m + it.front_along_m()
            }
            _ => here.x_m + it.front_along_m(),
        };
        draft.text("Meet(ego_at_m: ");
        draft.hole(&format!("{name}.meet.ego_at"), ego.x_m + ego_lever_m(all));
        draft.text(", here_at_m: ");
        draft.hole(&format!("{name}.meet.here_at"), here_m);
        draft.text(", speed_mps: ");
        draft.hole(&format!("{name}.meet.speed"), approach.speed_mps);
        let (kind, value) = match approach.steady {
            Steady::Metres(value) => ("Metres", value),
            Steady::Seconds(value) => ("Seconds", value),
        };
        draft.text(&format!(", steady: {kind}("));
        draft.hole(&format!("{name}.meet.steady"), value);
        draft.text("))");
        return Ok(());
    }
    draft.text("Script([");
    let mut number = 1;
    for step in &it.entity.steps {
        number = step_of(draft, concrete, all, it, step, number, triggers)?;
    }
    draft.text(if it.entity.steps.is_empty() {
        "])"
    } else {
        "\n            ])"
    });
    Ok(())
}

/// Writes a step, and returns the number of the next.
fn step_of(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
    step: &ImportedStep,
    first: usize,
    triggers: &mut Vec<(String, f64)>,
) -> Result<usize, ImportError> {
    let mut number = first;
    let mut when = String::new();
    if let Some(watch) = &step.when {
        let mut parameters = TriggerParameters {
            name: &it.name,
            list: triggers,
        };
        let (formula, is_edge) = formula(concrete, all, watch, &mut parameters, number == 1)?;
        if is_edge {
            // An empty step waits until the formula is false.
            draft.text(&format!(
                "\n                (when: \"not ({formula})\", does: []),"
            ));
            number += 1;
        }
        when = format!("when: \"{formula}\", ");
    }
    // Names of axes start with the entity and the number of the step, so they are
    // unique.
    let axis = |what: &str| format!("{}.step{number}.{what}", it.name);
    draft.mark(step.at.as_ref().unwrap_or(&it.entity.at));
    draft.text(&format!("\n                ({when}"));
    if step.after_s != 0.0 {
        draft.text("after_s: ");
        draft.hole(&axis("after"), step.after_s);
        draft.text(", ");
    }
    draft.text("does: [");
    for (i, law) in step.laws.iter().enumerate() {
        if i > 0 {
            draft.text(", ");
        }
        law_of(draft, concrete, it, law, &axis);
    }
    draft.text(if step.overlaps {
        "], overlaps: true),"
    } else {
        "]),"
    });
    Ok(number + 1)
}

fn law_of(
    draft: &mut Draft,
    concrete: &Concrete,
    it: &EntityInFrame,
    law: &ImportedLaw,
    axis: &impl Fn(&str) -> String,
) {
    let mut call = |law: &str, fields: [(&str, &str, f64); 2]| {
        let before = [format!("{law}("), ", ".to_owned()];
        for (before, (field, of, value)) in before.iter().zip(fields) {
            draft.text(&format!("{before}{field}: "));
            draft.hole(&axis(of), value);
        }
        draft.text(")");
    };
    let side = it.entity.side(matches!(it.path, EntityPath::Against));
    match law {
        ImportedLaw::Speed {
            to_mps,
            relative_to,
            rate_mps2,
            shape,
        } => {
            draft.text("Speed(to_mps: ");
            draft.hole(&axis("speed.to"), *to_mps);
            if let Some(other) = relative_to {
                draft.text(&format!(", relative_to: \"{}\"", named(other)));
            }
            if let Some(rate_mps2) = rate_mps2 {
                draft.text(", rate_mps2: ");
                draft.hole(&axis("speed.rate"), *rate_mps2);
                if *shape != ChangeShape::Linear {
                    draft.text(&format!(", shape: {shape:?}"));
                }
            }
            draft.text(")");
        }
        ImportedLaw::LaneChange {
            by_m,
            rate_mps,
            shape,
        } => {
            draft.text("LaneChange(by_m: ");
            draft.hole(&axis("lane_change.by"), by_m * side);
            draft.text(", rate_mps: ");
            draft.hole(&axis("lane_change.rate"), *rate_mps);
            if *shape != ChangeShape::Cosine {
                draft.text(&format!(", shape: {shape:?}"));
            }
            draft.text(")");
        }
        ImportedLaw::Beside {
            t_m,
            most_lateral_mps2,
        } => {
            let width_m = concrete.lane_width_m;
            // World files state offsets from the middle of the initial lane.
            let middle_m = concrete.lane_at(it.spot.y_m) * width_m;
            let way = it.entity.placed.way.as_ref().filter(|on| on.is_lane);
            let to_m = match (way, &it.path) {
                (None, _) => t_m - concrete.zero_m() - middle_m,
                // A way of its own leads through the place of the entity.
                (Some(_), EntityPath::Own(..)) => side * (t_m - it.start_t_m()),
                (Some(_), _) => it.spot.y_m + side * (t_m - it.start_t_m()) - middle_m,
            };
            let most = (
                "most_lateral_mps2",
                "lane_offset.most_lateral",
                *most_lateral_mps2,
            );
            call("LaneOffset", [("to_m", "lane_offset.to", to_m), most]);
        }
        ImportedLaw::Walk { speed_mps, way_m } => {
            let speed = ("speed_mps", "walk.speed", *speed_mps);
            call("Walk", [speed, ("way_m", "walk.way", *way_m)]);
        }
    }
}
