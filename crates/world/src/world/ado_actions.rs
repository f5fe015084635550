//! Actions of an ado and the kinds of bodies that they suit.

use super::check::within;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::Actions;
use crate::sim::BodyControl;
use crate::world_file::AdoFile;

/// Checks the actions of an ado: their range, and their fit for its body.
pub(super) fn check(problems: &mut Problems, path: &ValuePath, ado: &AdoFile, body: ActsAs) {
    let list = path.to("actions");
    let numbers: Vec<(ValuePath, f64)> = match &ado.actions {
        Actions::Accelerations(accelerations) => {
            let numbered = accelerations.iter().enumerate();
            numbered.map(|(i, a)| (list.at(0).at(i), *a)).collect()
        }
        Actions::Grid(grid) => {
            if grid.lateral_mps <= 0.0 || grid.lateral_mps > 5.0 {
                let what = format!("a lateral speed of {} m/s", grid.lateral_mps);
                let help = Some("above 0 and at most 5; `Left` and `Right` say where".to_owned());
                problems.add(&list.to("lateral_mps"), what, "out of range", help);
            }
            within(
                problems,
                &list.to("lateral_lag_s"),
                grid.lateral_lag_s,
                0.0,
                5.0,
            );
            let numbered = grid.accelerations.iter().enumerate();
            let place = list.to("accelerations");
            numbered.map(|(i, a)| (place.at(i), *a)).collect()
        }
        Actions::Walks(walks) => {
            let numbered = walks.iter().enumerate();
            numbered
                .flat_map(|(i, &(along, left))| {
                    let place = list.at(0).at(i);
                    [(place.at(0), along), (place.at(1), left)]
                })
                .collect()
        }
        // Each rate has a range of its own, which `weather` checks.
        // `road_ado` checks curvatures.
        // `turns` checks the names in turns.
        Actions::Phases(_) | Actions::Rates(_) | Actions::Curvatures(_) | Actions::Turns(_) => {
            Vec::new()
        }
        Actions::Deviate(added) => {
            let parts = [
                ("accelerations", &added.accelerations),
                ("lateral_mps", &added.lateral_mps),
            ]
            .into_iter()
            .flat_map(|(field, values)| {
                let place = list.to(field);
                let numbered = values.iter().enumerate();
                numbered.map(move |(i, value)| (place.at(i), *value))
            });
            parts.collect()
        }
    };
    // One bound for all: 30 m/s² and 30 m/s are both beyond any body.
    for (place, value) in numbers {
        within(problems, &place, value, -30.0, 30.0);
    }
    if ado.actions.is_empty() {
        let what = "an ado without actions";
        problems.add(&list, what, "give at least one", None);
    }
    // A wrong plan is the cause of wrong actions, so only one of both is reported.
    if let Some((what, help)) = misplanned(ado, body) {
        problems.add(&list, what, "here", Some(help.to_owned()));
    } else if ado.base.is_none() && !fits(&ado.actions, body) {
        let what = format!("{} cannot do this", body.words());
        problems.add(&list, what, "not its actions", Some(body.help().to_owned()));
    }
    if ado.actions.len() <= ado.neutral {
        let what = format!(
            "neutral action {} of {} actions",
            ado.neutral,
            ado.actions.len()
        );
        let help = Some("actions count from 0".to_owned());
        problems.add(&path.to("neutral"), what, "no such action", help);
    }
    within(problems, &path.to("lag_s"), ado.lag_s, 0.0, 10.0);
}

/// Returns true if the actions suit a kind of ado.
pub(super) fn fits(actions: &Actions, body: ActsAs) -> bool {
    match actions {
        Actions::Accelerations(_) | Actions::Grid(_) => body == ActsAs::Vehicle,
        Actions::Walks(_) => body == ActsAs::Walker,
        Actions::Phases(_) => body == ActsAs::Light,
        Actions::Rates(_) => body == ActsAs::Weather,
        Actions::Curvatures(_) => body == ActsAs::Road,
        Actions::Turns(_) => body == ActsAs::Turns,
        // Deviations require a plan, and a plan belongs to one world.
        Actions::Deviate(_) => false,
    }
}

/// Mistake of a plan that is missing, or is no base for the actions.
fn misplanned(ado: &AdoFile, body: ActsAs) -> Option<(&'static str, &'static str)> {
    // Ados without a way come first, since no other advice suits them.
    match (&ado.base, &ado.actions) {
        (Some(_), _) if body == ActsAs::Light => Some((
            "a traffic light has no way to plan",
            "leave `base` out; a light on a schedule has `drive: Schedule([…])`",
        )),
        (Some(_), _) if body == ActsAs::Weather => {
            Some(("weather has no way to plan", "leave `base` out"))
        }
        (Some(_), _) if body == ActsAs::Road => {
            Some(("a road has no way to plan", "leave `base` out"))
        }
        (Some(_), _) if body == ActsAs::Turns => {
            Some(("turns have no way to plan", "leave `base` out"))
        }
        (None, Actions::Deviate(_)) => Some((
            "there is no plan from which to deviate",
            "write a `storyboard` that moves it, or give it a `base: Script([…])` or `base: Meet(…)`",
        )),
        (Some(_), actions) if !matches!(actions, Actions::Deviate(_)) => Some((
            "an ado with a plan deviates from it",
            "write `actions: Deviate(accelerations: […], lateral_mps: […])`, or leave `base` out",
        )),
        _ => None,
    }
}

/// Kind of an ado, with regard to its actions.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ActsAs {
    Vehicle,
    Walker,
    Light,
    Weather,
    Road,
    Turns,
}

impl From<BodyControl> for ActsAs {
    fn from(control: BodyControl) -> ActsAs {
        match control {
            BodyControl::Drive => ActsAs::Vehicle,
            BodyControl::Walk => ActsAs::Walker,
        }
    }
}

impl ActsAs {
    pub(super) fn words(self) -> &'static str {
        match self {
            ActsAs::Vehicle => "a vehicle",
            ActsAs::Walker => "a pedestrian",
            ActsAs::Light => "a traffic light",
            ActsAs::Weather => "weather",
            ActsAs::Road => "a road",
            ActsAs::Turns => "an ado that gives turns",
        }
    }

    fn help(self) -> &'static str {
        match self {
            ActsAs::Vehicle => {
                "write `Accelerations([-3.0, 0.0, 3.0])` or `Grid(accelerations: […], lateral: […])`"
            }
            ActsAs::Walker => {
                "write `Walks([(0.0, 0.0), (0.0, 1.4)])`: along the road, to the left"
            }
            ActsAs::Light => "write `Phases([Hold, Advance])`",
            ActsAs::Weather => "write `Rates([(friction_per_s: -0.1), (), (friction_per_s: 0.1)])`",
            ActsAs::Road => {
                "write `Curvatures([-0.01, 0.0, 0.01])`: 1 / radius, positive to the left"
            }
            ActsAs::Turns => "write `Turns([Idle, All, Only(\"NAME\")])` with placed ados",
        }
    }
}
