#![cfg(test)]
//! Properties of every interval, for any outcomes.

use super::*;

/// `ones` solved starts, then `zeros` unsolved starts.
fn marks(ones: usize, zeros: usize) -> String {
    format!("{}{}", "1".repeat(ones), "0".repeat(zeros))
}

// Marks are the shortest notation of outcomes.
fn parsed(marks: &[&str]) -> Vec<Outcomes> {
    let parsed = marks.iter().map(|marks| marks.parse());
    parsed.collect::<Result<_, _>>().expect("marks")
}

fn seeds_interval(marks: &[&str]) -> [f64; 2] {
    super::seeds_interval(&parsed(marks).iter().collect::<Vec<_>>())
}

fn runs_interval(marks: &[&str]) -> [f64; 2] {
    super::runs_interval(&parsed(marks).iter().collect::<Vec<_>>())
}

fn paired_difference(a: &[&str], b: &[&str]) -> (f64, [f64; 2]) {
    mean_difference(&[(a.to_vec(), b.to_vec())])
}

fn mean_difference(pairs: &[(Vec<&str>, Vec<&str>)]) -> (f64, [f64; 2]) {
    let parsed: Vec<_> = pairs.iter().map(|(a, b)| (parsed(a), parsed(b))).collect();
    let pairs = parsed
        .iter()
        .map(|(a, b)| (a.iter().collect(), b.iter().collect()));
    super::mean_difference(&pairs.collect::<Vec<_>>())
}

fn texts(marks: &[String]) -> Vec<&str> {
    marks.iter().map(String::as_str).collect()
}

/// Trainings with given numbers of solved starts, which differ between trainings.
fn trainings(ones: &[usize], starts: usize) -> Vec<String> {
    let mark = |training: usize, ones: usize, start: usize| {
        // 7 is coprime to all numbers of starts here, so places are a
        // permutation.
        let place = (7 * start + 191 * training) % starts;
        if place < ones { '1' } else { '0' }
    };
    let all = ones.iter().enumerate();
    all.map(|(training, &ones)| {
        (0..starts)
            .map(|start| mark(training, ones, start))
            .collect()
    })
    .collect()
}

#[test]
fn wilson_agrees_with_published_values() {
    // Newcombe 1998, Table I: 81 of 263, and 0 of 20.
    let [lo, hi] = wilson(81, 263);
    assert!((lo - 0.2553).abs() < 1e-4 && (hi - 0.3662).abs() < 1e-4);
    let [lo, hi] = wilson(0, 20);
    assert!(lo == 0.0 && (hi - 0.1611).abs() < 1e-4);
    for n in 1..200 {
        assert_eq!((wilson(0, n)[0], wilson(n, n)[1]), (0.0, 1.0));
    }
}

#[test]
fn at_the_bound_nothing_is_seen_once_in_twenty_times() {
    assert_eq!(at_most(0), 1.0);
    for n in [1, 20, 284, 500, 100_000] {
        let nothing = libm::pow(1.0 - at_most(n), n as f64);
        assert!((nothing - 0.05).abs() < 1e-9, "{n}: {nothing}");
    }
    // Clopper and Pearson: 0 of 20 is at most 13.9 % (Louis 1981).
    assert!((at_most(20) - 0.1391).abs() < 1e-4);
}

#[test]
fn one_training_is_wilsons() {
    let solved = format!("t{}-x", marks(80, 20));
    assert_eq!(seeds_interval(&[&solved]), wilson(80, 100));
    assert_eq!(seeds_interval(&["tt-x"]), [0.0, 1.0]);
    assert_eq!(seeds_interval(&[]), [0.0, 1.0]);
    assert_eq!(seeds_interval(&["t-", "t-"]), [0.0, 1.0]);
    assert_eq!(paired_difference(&["t1"], &["0x"]), (0.0, [-1.0, 1.0]));
    assert_eq!(mean_difference(&[]), (0.0, [-1.0, 1.0]));
}

#[test]
fn runs_of_a_start_are_no_new_starts() {
    let solved = marks(70, 30);
    // Ten runs with equal outcomes contain no more information than one.
    for runs in [vec![&*solved], vec![&*solved; 10]] {
        let ([lo, hi], [l, h]) = (runs_interval(&runs), wilson(70, 100));
        assert!((lo - l).abs() < 1e-9 && (hi - h).abs() < 1e-9, "{lo} {hi}");
    }
    assert_eq!(runs_interval(&[&*marks(0, 50); 4]), wilson(0, 50));
    assert_eq!(runs_interval(&["xx", "tt"]), [0.0, 1.0]);
    // If chance alone decides, runs are as good as starts.
    let lucky = trainings(&[70, 70, 70, 70], 100);
    let ([lo, hi], [l, h]) = (runs_interval(&texts(&lucky)), wilson(280, 400));
    assert!((lo - l).abs() < 0.02 && (hi - h).abs() < 0.02, "{lo} {hi}");
}

#[test]
fn the_posterior_is_what_fine_integration_gives() {
    // Sums over 3000 values of φ and 6001 of μ, in Python with SciPy.
    let table: [(&[f64], f64, [f64; 2]); 6] = [
        (&[0.0, 0.0, 0.0], 300.0, [0.00001, 0.08683]),
        (&[1.0, 1.0, 1.0, 1.0, 1.0], 500.0, [0.95080, 1.0]),
        (&[0.9, 0.85, 0.8], 400.0, [0.68614, 0.91125]),
        (&[0.5, 0.5, 0.5], 4000.0, [0.47372, 0.52628]),
        (&[0.05, 0.06, 0.03, 0.05, 0.08], 300.0, [0.03829, 0.09230]),
        (&[0.2, 0.7], 100.0, [0.16225, 0.77858]),
    ];
    for (rates, starts, [lo, hi]) in table {
        let [l, h] = trainings::interval(rates, starts);
        let off = (l - lo).abs().max((h - hi).abs());
        assert!(
            off < 0.02 * (hi - lo),
            "{rates:?}: [{l}, {h}], not [{lo}, {hi}]"
        );
    }
}

#[test]
fn intervals_stay_in_range_and_hold_the_rate() {
    for starts in [1, 2, 12, 100] {
        for of_first in 0..=starts {
            for others in [0, starts / 3, starts] {
                for count in [2, 3, 8] {
                    let mut ones = vec![others; count];
                    ones[0] = of_first;
                    let solved = trainings(&ones, starts);
                    let [lo, hi] = seeds_interval(&texts(&solved));
                    let all: usize = ones.iter().sum();
                    let rate = all as f64 / (count * starts) as f64;
                    assert!(
                        lo >= 0.0 && lo <= rate + 1e-12,
                        "{ones:?} of {starts}: {lo}"
                    );
                    assert!(
                        rate <= hi + 1e-12 && hi <= 1.0,
                        "{ones:?} of {starts}: {hi}"
                    );
                    assert!(lo < hi, "{ones:?} of {starts}");
                }
            }
        }
    }
}

#[test]
fn failures_are_successes_seen_from_the_other_side() {
    for ones in [
        [0, 0, 0],
        [0, 1, 30],
        [3, 3, 3],
        [100, 100, 90],
        [100, 100, 100],
    ] {
        let solved = trainings(&ones, 100);
        let swap = |mark: char| if mark == '1' { '0' } else { '1' };
        let failed: Vec<String> = solved
            .iter()
            .map(|m| m.chars().map(swap).collect())
            .collect();
        let [lo, hi] = seeds_interval(&texts(&solved));
        let [from, to] = seeds_interval(&texts(&failed));
        assert!(
            (lo + to - 1.0).abs() < 1e-9 && (hi + from - 1.0).abs() < 1e-9,
            "{ones:?}"
        );
        let rates: Vec<f64> = ones.iter().map(|&ones| ones as f64 / 100.0).collect();
        let fails: Vec<f64> = rates.iter().map(|rate| 1.0 - rate).collect();
        // So many starts that a small parameter is lost in a sum with them.
        let [lo, hi] = trainings::interval(&rates, 1e9);
        let [from, to] = trainings::interval(&fails, 1e9);
        assert!(
            (lo + to - 1.0).abs() < 1e-6 && (hi + from - 1.0).abs() < 1e-6,
            "{ones:?}"
        );
        let other = trainings(&[40, 60], 100);
        let (forth, [lo, hi]) = paired_difference(&texts(&solved), &texts(&other));
        let (back, [from, to]) = paired_difference(&texts(&other), &texts(&solved));
        assert!((forth + back).abs() < 1e-12);
        assert!(
            (lo + to).abs() < 1e-12 && (hi + from).abs() < 1e-12,
            "{ones:?}"
        );
    }
}

#[test]
fn marks_that_do_not_count_change_nothing() {
    let (a, b) = (trainings(&[60, 70, 80], 100), trainings(&[40, 50], 100));
    let with = |marks: &[String]| -> Vec<String> {
        marks
            .iter()
            .map(|m| format!("t-{}x-{}t", &m[..50], &m[50..]))
            .collect()
    };
    let (wide_a, wide_b) = (with(&a), with(&b));
    assert_eq!(seeds_interval(&texts(&a)), seeds_interval(&texts(&wide_a)));
    assert_eq!(
        paired_difference(&texts(&a), &texts(&b)),
        paired_difference(&texts(&wide_a), &texts(&wide_b))
    );
    // A start that only one side was judged on is no pair.
    let single = |mark: &str, rest: &str| format!("{mark}{rest}");
    for (mine, theirs) in [("1", "x"), ("x", "1"), ("t", "0"), ("0", "-"), ("x", "x")] {
        let (mine, theirs) = (single(mine, &a[0]), single(theirs, &b[0]));
        assert_eq!(
            paired_difference(&[&mine], &[&theirs]),
            paired_difference(&[&a[0]], &[&b[0]])
        );
    }
    // One training's broken episode leaves the start to the others.
    let mut broken = a.clone();
    broken[1].replace_range(0..1, "x");
    let ([lo, hi], [l, h]) = (seeds_interval(&texts(&a)), seeds_interval(&texts(&broken)));
    assert!((lo - l).abs() < 0.01 && (hi - h).abs() < 0.01);
}

#[test]
fn trainings_that_differ_widen_the_interval_and_more_trainings_narrow_it() {
    let width = |ones: &[usize]| {
        let [lo, hi] = seeds_interval(&texts(&trainings(ones, 300)));
        hi - lo
    };
    assert!(width(&[270, 270, 270]) < width(&[285, 270, 255]));
    assert!(width(&[285, 270, 255]) < width(&[300, 270, 240]));
    assert!(width(&[270; 5]) < width(&[270; 3]) && width(&[270; 10]) < width(&[270; 5]));
    assert!(
        width(&[300, 0]) > 0.85,
        "of two trainings one works: nothing is known"
    );
}

#[test]
fn trainings_that_agree_on_every_start_tell_no_more_of_starts_than_one() {
    let one = marks(250, 50);
    let [lo, hi] = seeds_interval(&[&one, &one, &one, &one, &one]);
    let [wilson_lo, wilson_hi] = wilson(250, 300);
    assert!(
        lo <= wilson_lo + 0.005 && wilson_hi - 0.005 <= hi,
        "{lo} {hi}"
    );
    assert!(hi - lo < 1.2 * (wilson_hi - wilson_lo), "{lo} {hi}");
}

#[test]
fn equal_rates_of_a_few_trainings_are_no_proof_that_none_ever_fails() {
    let all = marks(500, 0);
    let [lo, hi] = seeds_interval(&[&all, &all, &all]);
    assert!(lo > 0.85 && lo < 0.95 && hi == 1.0, "{lo}");
    let [lo, _] = seeds_interval(&[&*all; 10]);
    assert!(lo > 0.95 && lo < 0.99, "{lo}");
}

#[test]
fn pairing_sees_what_unpaired_intervals_hide() {
    // b solves the starts of a except for eight: clearly worse, if paired.
    let (a, b) = (marks(60, 40), marks(52, 48));
    let (difference, [lo, hi]) = paired_difference(&[&a], &[&b]);
    assert!((difference - 0.08).abs() < 1e-12);
    assert!(lo > 0.0 && hi < 0.2, "{lo} {hi}");
    assert!(wilson(60, 100)[0] < wilson(52, 100)[1]);
    // No difference on a hundred starts leaves up to three in a hundred.
    let (none, [lo, hi]) = paired_difference(&[&a], &[&a]);
    assert!(
        none == 0.0 && lo == -hi && hi > 0.02 && hi < 0.04,
        "{lo} {hi}"
    );
}

#[test]
fn a_pair_without_trainings_is_bonett_and_prices() {
    // Of 100 starts, 12 that only a solves and 4 that only b solves.
    let a = format!("{}{}{}", marks(12, 0), marks(0, 4), marks(50, 34));
    let b = format!("{}{}{}", marks(0, 12), marks(4, 0), marks(50, 34));
    let (difference, [lo, hi]) = paired_difference(&[&a], &[&b]);
    assert!((difference - 0.08).abs() < 1e-12);
    // Their formula: (13 − 5) / 102 ± 1.96 √((13 + 5)/102 − (8/102)²) / √102.
    let (p, q) = (13.0 / 102.0, 5.0 / 102.0);
    let centre: f64 = p - q;
    let half = Z * ((p + q - centre * centre) / 102.0_f64).sqrt();
    assert!(
        (lo - (centre - half)).abs() < 0.002,
        "{lo} {}",
        centre - half
    );
    assert!(
        (hi - (centre + half)).abs() < 0.002,
        "{hi} {}",
        centre + half
    );
}

#[test]
fn a_start_that_is_easy_for_every_ego_counts_once() {
    // Ten egos that fail on the same starts contain no more information than
    // one.
    let (a, b) = (marks(60, 40), marks(52, 48));
    let pair = || (vec![a.as_str()], vec![b.as_str()]);
    let ten: Vec<_> = (0..10).map(|_| pair()).collect();
    let (one, [lo, hi]) = mean_difference(&[pair()]);
    let (mean, [lo10, hi10]) = mean_difference(&ten);
    assert!((one - 0.08).abs() < 1e-12 && (mean - 0.08).abs() < 1e-12);
    assert!((lo - lo10).abs() < 1e-12 && (hi - hi10).abs() < 1e-12);
    let mixed = [pair(), (vec![&*b], vec![&*a])];
    assert!(mean_difference(&mixed).0.abs() < 1e-12);
    // An ego without a start that counts has no effect.
    let none = marks(0, 0) + &"t".repeat(100);
    let (mean, interval) = mean_difference(&[pair(), (vec![&*none], vec![&*b])]);
    assert!((mean - one).abs() < 1e-12 && (interval[0] - lo).abs() < 1e-12);
}

#[test]
fn a_training_that_failed_fails_on_every_ego() {
    // Two trainings, one of which failed: ten egos contain no more information
    // about that than one.
    let (good, bad) = (marks(100, 0), marks(0, 100));
    let pair = || (vec![good.as_str(), bad.as_str()], vec![bad.as_str()]);
    let ten: Vec<_> = (0..10).map(|_| pair()).collect();
    let (mean, [lo, hi]) = mean_difference(&ten);
    assert!((mean - 0.5).abs() < 1e-12);
    assert!(lo < 0.1 && hi > 0.9, "{lo} {hi}");
    assert_eq!(
        mean_difference(&[pair()]).1.map(|end| (1e9 * end).round()),
        [lo, hi].map(|end| (1e9 * end).round())
    );
}
