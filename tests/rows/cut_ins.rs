//! Cut-ins among the behaviours of an ado.

use brakecheck::trace::Trace;
use brakecheck::world::Scenario;
use brakecheck_scene::natural::behaviour::behaviours;
use brakecheck_traffic::CutInState;

/// Cut-ins of an ado 20 m ahead, if both move between these lanes in 2 s.
fn cut_ins(ego: [usize; 2], ado: [usize; 2]) -> Vec<CutInState> {
    let world = Scenario::shipped("cut_in")
        .expect("shipped")
        .expect("sound");
    let driving = world.drive().expect("a road").world();
    let road = &driving.spec().road;
    let bench = world.bench();
    let mut trace = Trace::new(std::sync::Arc::clone(bench.schema()));
    let column = |name: &str| bench.schema().position(name).expect("published");
    let samples = 40;
    for sample in 0..samples {
        let mut row = vec![0.0; bench.schema().len()];
        let share = f64::from(sample) / f64::from(samples - 1);
        for (name, ahead_m, [from, to]) in [("ego", 0.0, ego), ("ado", 20.0, ado)] {
            let [from_m, to_m] = [from, to].map(|lane| road.lane_middle_m(lane));
            row[column(&format!("{name}.x"))] = ahead_m + f64::from(sample);
            row[column(&format!("{name}.y"))] = from_m + share * (to_m - from_m);
            row[column(&format!("{name}.speed"))] = 20.0;
        }
        trace.push(&row).expect("finite");
    }
    let all = behaviours(driving, &trace, samples as usize);
    let (_, driven) = all.into_iter().find(|(name, _)| name == "ado").expect("it");
    driven.cut_ins
}

#[test]
fn only_the_ado_s_own_change_of_lane_is_a_cut_in() {
    let found = cut_ins([0, 0], [1, 0]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].lateral_mps.abs() > 1.0 && found[0].gap_m > 10.0);
    // The ego changes into the lane of the ado.
    assert_eq!(cut_ins([1, 0], [0, 0]), []);
    assert_eq!(cut_ins([0, 0], [0, 1]), []);
}
