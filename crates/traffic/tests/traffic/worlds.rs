//! Recorded leads as plans of world files.

use brakecheck_traffic::{Analysis, SpeedPlan, following_worlds};

use crate::situations::recorded;
use crate::synthetic;

/// Positions of a hard braking, with a recorder's noise of 2 cm.
fn positions() -> Vec<f64> {
    let mut draws = synthetic::Draws(7);
    let (mut s_m, mut speed_mps) = (100.0, 25.0);
    (0..=200)
        .map(|i| {
            let t = f64::from(i) * 0.05;
            let accel = -3.0 * (-(t - 4.0) * (t - 4.0)).exp();
            speed_mps += accel * 0.05;
            s_m += speed_mps * 0.05;
            s_m + 0.02 * draws.normal()
        })
        .collect()
}

#[test]
fn a_plan_stays_within_a_decimetre_of_the_positions() {
    let positions = positions();
    let plan = SpeedPlan::fit(&positions, 0.05).expect("ten seconds");
    assert_eq!(plan.to_mps.len(), 20);
    assert!(plan.worst_m < 0.1, "{}", plan.worst_m);
    assert!((plan.start_mps - 25.0).abs() < 0.2, "{}", plan.start_mps);
}

#[test]
fn integrated_speeds_would_miss_the_positions() {
    // Recorded speeds that are 0.3 % off, as those of the synthetic recorder.
    let positions = positions();
    let mut s_m = positions[0];
    let mut worst: f64 = 0.0;
    for pair in positions.windows(2) {
        s_m += 1.003 * (pair[1] - pair[0]);
        worst = worst.max((s_m - pair[1]).abs());
    }
    assert!(0.3 < worst, "{worst}");
}

/// Speeds and rates of a script, read from its text.
fn steps(text: &str) -> Vec<(f64, f64)> {
    let number = |line: &str, name: &str| -> f64 {
        let (_, rest) = line.split_once(name).expect(name);
        let end = rest.find([',', ')']).expect("an end");
        rest[..end].trim().parse().expect("a number")
    };
    let lines = text.lines().filter(|line| line.contains("Speed(to_mps"));
    lines
        .map(|line| (number(line, "to_mps:"), number(line, "rate_mps2:")))
        .collect()
}

/// Plays a script as a world does: a step ends when its speed is reached.
fn played(start_mps: f64, steps: &[(f64, f64)], time_s: f64) -> f64 {
    let (mut s_m, mut speed_mps, mut left_s) = (0.0, start_mps, time_s);
    for (to_mps, rate_mps2) in steps {
        let takes_s = (to_mps - speed_mps).abs() / rate_mps2;
        let within_s = takes_s.min(left_s);
        let accel = rate_mps2 * (to_mps - speed_mps).signum();
        s_m += speed_mps * within_s + 0.5 * accel * within_s * within_s;
        speed_mps += accel * within_s;
        left_s -= within_s;
        if left_s <= 0.0 {
            return s_m;
        }
    }
    s_m + speed_mps * left_s
}

#[test]
fn the_script_in_the_text_replays_the_recording() {
    let (rows, _) = synthetic::traffic(21, 25, 60.0);
    let analysis = Analysis::of(recorded(&rows));
    let worlds = following_worlds(&analysis, 24);
    assert_eq!(worlds.len(), 24);
    assert!(
        worlds
            .windows(2)
            .all(|it| it[1].slowing_mps <= it[0].slowing_mps)
    );
    assert!(1.0 < worlds[0].slowing_mps, "{}", worlds[0].slowing_mps);
    for world in &worlds {
        assert!(world.worst_m < 0.1, "{}: {} m", world.name, world.worst_m);
        let steps = steps(&world.text);
        assert_eq!(steps.len(), 20, "{}", world.text);
        let (lead, start) = lead_of(&analysis, &world.text);
        let (_, rest) = world.text.split_once("headway_m: ").expect("a start");
        let (_, rest) = rest.split_once("speed_mps: ").expect("a speed");
        let speed_mps = rest[..rest.find(')').expect("an end")]
            .parse()
            .expect("a number");
        // Along the lead's own path, which in a bend is not as long as the right lane.
        let mut way_m = 0.0;
        let mut worst: f64 = 0.0;
        for i in (10..200).step_by(10) {
            let [a, b] = [lead[start + i - 10], lead[start + i]];
            way_m += (b[0] - a[0]).hypot(b[1] - a[1]);
            let time_s = i as f64 * 0.05;
            worst = worst.max((played(speed_mps, &steps, time_s) - way_m).abs());
        }
        // The first position may be off by as much as any other.
        assert!(worst < 0.12, "{}: {worst} m", world.name);
    }
}

/// Positions of the lead that a text names, and its first sample in the window.
fn lead_of(analysis: &Analysis, text: &str) -> (Vec<[f64; 2]>, usize) {
    let (_, rest) = text.split_once("Road user ").expect("a lead");
    let id = &rest[..rest.find(' ').expect("an end")];
    let (_, rest) = text.split_once("log.csv, at ").expect("a source");
    let time_s: f64 = rest[..rest.find(' ').expect("an end")]
        .parse()
        .expect("a time");
    let sample = (time_s / 0.05).round() as usize;
    let mut tracks = analysis.recording.tracks.iter();
    let track = tracks.find(|track| track.id == id).expect("a track");
    let places = track.x_m.iter().zip(&track.y_m);
    let places = places.map(|(x, y)| [*x, *y]).collect();
    (places, sample - track.first_sample)
}
