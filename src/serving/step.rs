//! Step of the other simulator, where it is not the sample time of the world.

use crate::scene::Clock;
use crate::world::Scenario;

/// Least step, s.
const LEAST_S: f64 = 0.001;
/// Most steps of an episode, as samples of a world.
const MOST_STEPS: f64 = 1e5;
/// Rounding of a ratio of decimal fractions.
const ROUNDING: f64 = 1e-6;

/// Returns the world with a sample per step of the simulator.
///
/// Decisions and starts are those of the world, and a physics step is no longer than there.
///
/// # Errors
/// The step does not fit the world, with the reason.
pub(super) fn stepped(world: &Scenario, step_s: f64) -> Result<Scenario, String> {
    let Some(drive) = world.drive() else {
        // Grids are refused before their step is of interest.
        return Ok(world.clone());
    };
    let clock = drive.spec().clock;
    // The world itself keeps the bits of its episodes, whatever a change would round.
    if step_s == clock.sample_s {
        return Ok(world.clone());
    }
    check(step_s, &clock)?;
    let physics_s = clock.sample_s / f64::from(clock.substeps);
    // Rounded up, so that no physics step is longer than the world's.
    // A rounding error alone must not add a step.
    let substeps = (step_s / physics_s - ROUNDING).ceil().max(1.0) as u32;
    drive.sampled_every(step_s, substeps).ok_or_else(|| {
        let sample_s = clock.sample_s;
        format!(
            "`step_s` = {step_s} does not fit this world, whose trained ados or formulas \
             require samples of {sample_s} s: leave it out"
        )
    })
}

fn check(step_s: f64, clock: &Clock) -> Result<(), String> {
    let Clock {
        horizon_s,
        decision_s,
        ..
    } = *clock;
    if step_s.is_nan() || step_s <= 0.0 {
        return Err(format!(
            "`step_s` = {step_s} is no time: give seconds, above 0"
        ));
    }
    if step_s > horizon_s {
        return Err(format!(
            "`step_s` = {step_s} is longer than the episode of {horizon_s} s"
        ));
    }
    // A step of nanoseconds would make a trace of gigabytes.
    let least_s = LEAST_S.max(horizon_s / MOST_STEPS);
    if step_s < least_s {
        return Err(format!("`step_s` = {step_s} is below {least_s} s"));
    }
    for (what, time_s) in [
        ("time between two decisions", decision_s),
        ("length of an episode", horizon_s),
    ] {
        let ratio = time_s / step_s;
        if (ratio - ratio.round()).abs() > ROUNDING || ratio.round() < 1.0 {
            let least = ratio.ceil() as u32;
            let parts = (least..10 * least).map(|parts| time_s / f64::from(parts));
            // The longest that is a plain decimal number, where there is one.
            let is_plain = |part_s: &f64| (part_s * 1e4 - (part_s * 1e4).round()).abs() < ROUNDING;
            let part_s = parts.clone().find(is_plain).or(parts.clone().next());
            // Rounding to nanoseconds removes binary noise.
            let fits_s = part_s.map_or(time_s, |part_s| (part_s * 1e9).round() / 1e9);
            return Err(format!(
                "`step_s` = {step_s} is no part of {time_s} s, the {what}: give {time_s} / n, \
                 such as {fits_s}"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn acc() -> Scenario {
        Scenario::parse("acc.ron", include_str!("../../worlds/acc.ron")).expect("sound")
    }

    #[test]
    fn a_step_that_fits_no_decision_is_refused_with_one_that_does() {
        let world = acc();
        for (step_s, says) in [
            (0.0, "`step_s` = 0 is no time"),
            (-0.05, "`step_s` = -0.05 is no time"),
            (f64::NAN, "`step_s` = NaN is no time"),
            (f64::INFINITY, "longer than the episode of 15 s"),
            (15.5, "longer than the episode of 15 s"),
            (0.0001, "below 0.001 s"),
            (0.3, "give 0.5 / n, such as 0.25"),
            (0.75, "no part of 0.5 s, the time between two decisions"),
        ] {
            let error = stepped(&world, step_s).expect_err("refused");
            assert!(error.contains(says), "{step_s}: {error}");
        }
    }

    #[test]
    fn physics_is_never_coarser_and_decisions_keep_their_times() {
        let world = acc();
        let own = *world.world().clock();
        // The world has physics steps of 0.0125 s.
        for (step_s, substeps) in [(0.05, 4), (0.01, 1), (0.1, 8), (0.5, 40), (0.02, 2)] {
            let clock = *stepped(&world, step_s).expect("fits").world().clock();
            assert_eq!((clock.sample_s, clock.substeps), (step_s, substeps));
            assert_eq!(clock.decisions(), own.decisions());
            assert_eq!(clock.decision_s, own.decision_s);
        }
    }
}
