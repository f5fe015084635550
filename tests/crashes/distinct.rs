//! Which counterexamples are the same one over and over.

use brakecheck::testbench::Episode;
use brakecheck_experiment::experiment::clustering::{CrashFeatures, NEAR, clusters};

use super::found::{acc, acc_found, cut_in, cut_in_found, replayed};
use super::near;

#[test]
fn alike_is_what_is_near_and_of_one_kind() {
    let episodes = cut_in_found();
    let shapes: Vec<CrashFeatures> = episodes
        .iter()
        .map(|it| CrashFeatures::of(cut_in(), it))
        .collect();
    for (a, one) in shapes.iter().enumerate() {
        near(one.distance(one), 0.0);
        assert!(one.is_like(one));
        for (b, other) in shapes.iter().enumerate() {
            near(one.distance(other), other.distance(one));
            assert_eq!(one.is_like(other), other.is_like(one));
            let touch = |at: usize| {
                let contact = episodes[at].contact.as_ref()?;
                Some((contact.impact.map(|it| it.kind), contact.between.clone()))
            };
            if touch(a) != touch(b) || one.distance(other) > NEAR {
                assert!(!one.is_like(other));
            }
        }
    }
}

/// The root mean square over one signal that differs by a constant, by hand.
#[test]
fn the_distance_is_in_half_ranges() {
    let world = acc();
    let one = &acc_found()[0];
    let at = one.trace.schema();
    let position = at.position("ado.speed").expect("published");
    let shifted = |by: f64| {
        let mut trace = one.trace.clone();
        trace.clear();
        let mut row = vec![0.0; at.len()];
        for sample in 0..one.trace.len() {
            one.trace.read_row(sample, &mut row);
            row[position] += by;
            trace.push(&row).expect("finite");
        }
        let episode = Episode {
            trace,
            ..one.clone()
        };
        CrashFeatures::of(world, &episode)
    };
    let observed = world.world().observed();
    let speed = observed
        .iter()
        .find(|it| it.name == "ado.speed")
        .expect("observed");
    let expected = 3.0 / speed.half / (observed.len() as f64).sqrt();
    let distance = shifted(3.0).distance(&shifted(0.0));
    assert!(
        (distance - expected).abs() < 1e-9,
        "{distance}, not {expected}"
    );
}

#[test]
fn every_one_is_in_one_cluster_that_its_first_leads() {
    let mut episodes = acc_found().to_vec();
    // The same one once more is in the cluster of the first.
    let again = replayed(acc(), &episodes[0], &episodes[0].actions);
    episodes.push(again);
    let shapes: Vec<CrashFeatures> = episodes
        .iter()
        .map(|it| CrashFeatures::of(acc(), it))
        .collect();
    let clusters = clusters(&shapes);
    let mut all: Vec<usize> = clusters.iter().flatten().copied().collect();
    all.sort_unstable();
    assert_eq!(all, (0..shapes.len()).collect::<Vec<_>>());
    let last = shapes.len() - 1;
    assert!(
        clusters
            .iter()
            .any(|it| it.contains(&0) && it.contains(&last))
    );
    for (n, cluster) in clusters.iter().enumerate() {
        assert!(
            cluster
                .iter()
                .all(|at| shapes[cluster[0]].is_like(&shapes[*at]))
        );
        assert!(cluster.windows(2).all(|pair| pair[0] < pair[1]));
        // Nobody leads who is like an earlier leader.
        let earlier = clusters[..n].iter();
        let mut leaders = earlier.map(|other| &shapes[other[0]]);
        assert!(!leaders.any(|leader| leader.is_like(&shapes[cluster[0]])));
    }
}
