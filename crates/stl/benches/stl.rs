//! Monitors beside the loop one would write by hand.
//!
//! Traces have 100,000 samples: 100 µs are 1 ns per sample.
//! `cargo bench --bench stl`

use std::hint::black_box;

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Formula, Monitor, Scratch};
use divan::Bencher;
use divan::counter::ItemsCount;

const SAMPLES: usize = 100_000;

fn main() {
    divan::main();
}

fn trace() -> Trace {
    trace_of(SAMPLES)
}

fn trace_of(samples: usize) -> Trace {
    let signals = ["x", "y"].map(|name| Signal::real(name, "m", "a number"));
    let mut trace = Trace::new(Schema::new(0.1, signals).unwrap().into());
    let mut state = 1u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for _ in 0..samples {
        trace.push(&[next(), next()]).unwrap();
    }
    trace
}

fn monitor(text: &str, trace: &Trace) -> Monitor {
    text.parse::<Formula>()
        .unwrap()
        .bind(trace.schema(), &Constants::new())
        .unwrap()
}

/// The robustness at every sample.
fn at_every_sample(bencher: Bencher, text: &str) {
    let trace = trace();
    let monitor = monitor(text, &trace);
    let (mut scratch, mut out) = (Scratch::new(), Vec::new());
    bencher.bench_local(|| {
        monitor.robustness_into(black_box(&trace), &mut scratch, &mut out);
        black_box(out.last().copied())
    });
}

fn at_start(bencher: Bencher, text: &str) {
    let trace = trace();
    let monitor = monitor(text, &trace);
    let mut scratch = Scratch::new();
    bencher.bench_local(|| monitor.robustness(black_box(&trace), &mut scratch));
}

/// The plain kernel of van Herk, Gil and Werman, with two arrays.
fn by_hand(
    input: &[f64],
    width: usize,
    pick: impl Fn(f64, f64) -> f64,
    out: &mut Vec<f64>,
    work: &mut [Vec<f64>; 2],
) {
    let n = input.len();
    let [ahead, behind] = work;
    ahead.clear();
    ahead.resize(n, 0.0);
    behind.clear();
    behind.resize(n, 0.0);
    for start in (0..n).step_by(width) {
        let end = n.min(start + width);
        behind[start] = input[start];
        for i in start + 1..end {
            behind[i] = pick(behind[i - 1], input[i]);
        }
        ahead[end - 1] = input[end - 1];
        for i in (start..end - 1).rev() {
            ahead[i] = pick(ahead[i + 1], input[i]);
        }
    }
    out.clear();
    out.extend((0..n).map(|i| pick(ahead[i], behind[(i + width - 1).min(n - 1)])));
}

/// What `python/examples/speed.py` measures as well: a million samples, the
/// answer in a fresh vector.
#[divan::bench(args = [
    "x > 0.5",
    "always[0, 5] (x > 0.5)",
    "always (x > 0.5 implies eventually[0, 3] (y > 0.5))",
])]
fn a_million_samples(bencher: Bencher, text: &str) {
    let trace = trace_of(1_000_000);
    let monitor = monitor(text, &trace);
    bencher.bench_local(|| {
        let mut out = Vec::new();
        monitor.robustness_into(black_box(&trace), &mut Scratch::new(), &mut out);
        out
    });
}

mod always_0_100 {
    use super::*;

    #[divan::bench]
    fn monitor(bencher: Bencher) {
        at_every_sample(bencher, "always[0, 10] (x >= 0.5)");
    }

    #[divan::bench]
    fn by_hand(bencher: Bencher) {
        let trace = trace();
        let (mut leaf, mut out, mut work) = (Vec::new(), Vec::new(), Default::default());
        bencher.bench_local(|| {
            leaf.clear();
            leaf.extend(black_box(&trace).column(0).iter().map(|x| x - 0.5));
            super::by_hand(&leaf, 101, f64::min, &mut out, &mut work);
            black_box(out.last().copied())
        });
    }
}

mod always_0_100_eventually_0_50 {
    use super::*;

    #[divan::bench]
    fn monitor(bencher: Bencher) {
        at_every_sample(bencher, "always[0, 10] eventually[0, 5] (x >= 0.5)");
    }

    #[divan::bench]
    fn by_hand(bencher: Bencher) {
        let trace = trace();
        let (mut leaf, mut inner, mut out, mut work) =
            (Vec::new(), Vec::new(), Vec::new(), Default::default());
        bencher.bench_local(|| {
            leaf.clear();
            leaf.extend(black_box(&trace).column(0).iter().map(|x| x - 0.5));
            super::by_hand(&leaf, 51, f64::max, &mut inner, &mut work);
            super::by_hand(&inner, 101, f64::min, &mut out, &mut work);
            black_box(out.last().copied())
        });
    }
}

mod until_0_100 {
    use super::*;

    #[divan::bench]
    fn monitor(bencher: Bencher) {
        at_every_sample(bencher, "(x >= 0.5) until[0, 10] (y >= 0.9)");
    }

    #[divan::bench]
    fn by_hand(bencher: Bencher) {
        let trace = trace();
        let (mut goal, mut out, mut work) = (Vec::new(), Vec::new(), Default::default());
        bencher.bench_local(|| {
            goal.clear();
            goal.extend(black_box(&trace).column(1).iter().map(|y| y - 0.9));
            super::by_hand(&goal, 101, f64::max, &mut out, &mut work);
            let mut running = f64::NEG_INFINITY;
            for i in (0..SAMPLES).rev() {
                running = goal[i].max((trace.column(0)[i] - 0.5).min(running));
                out[i] = out[i].min(running);
            }
            black_box(out.last().copied())
        });
    }
}

mod always_at_start {
    use super::*;

    #[divan::bench]
    fn monitor(bencher: Bencher) {
        at_start(bencher, "always (x >= 0.5)");
    }

    #[divan::bench]
    fn by_hand(bencher: Bencher) {
        let trace = trace();
        bencher.bench_local(|| {
            black_box(&trace)
                .column(0)
                .iter()
                .map(|x| x - 0.5)
                .fold(f64::INFINITY, f64::min)
        });
    }
}

/// The cost per sample does not depend on the window.
mod windows {
    use super::*;

    #[divan::bench(args = [10, 100, 1000, 10_000])]
    fn always(bencher: Bencher, width: usize) {
        at_every_sample(
            bencher,
            &format!("always[0, {}] (x >= 0.5)", width as f64 / 10.0),
        );
    }

    #[divan::bench(args = [10, 100, 1000, 10_000])]
    fn once(bencher: Bencher, width: usize) {
        at_every_sample(
            bencher,
            &format!("once[0, {}] (x >= 0.5)", width as f64 / 10.0),
        );
    }

    #[divan::bench(args = [10, 100, 1000, 10_000])]
    fn until(bencher: Bencher, width: usize) {
        at_every_sample(
            bencher,
            &format!(
                "(x >= 0.5) until[1, {}] (y >= 0.9)",
                1.0 + width as f64 / 10.0
            ),
        );
    }
}

/// Whole runs sample by sample: again 100 µs are 1 ns per sample.
mod online {
    use super::*;

    fn push_all(bencher: Bencher, text: &str) {
        push_all_of(bencher, text, SAMPLES);
    }

    /// Runs of other lengths: compare their samples per second.
    pub fn push_all_of(bencher: Bencher, text: &str, samples: usize) {
        let trace = trace_of(samples);
        let monitor = monitor(text, &trace);
        let mut online = monitor.online_for(samples);
        let (x, y) = (trace.column(0), trace.column(1));
        bencher.counter(ItemsCount::new(samples)).bench_local(|| {
            online.reset();
            for (x, y) in x.iter().zip(y) {
                black_box(online.push(&[*x, *y]).unwrap());
            }
        });
    }

    #[divan::bench]
    fn acc_spec(bencher: Bencher) {
        push_all(bencher, "always[0, 9999.9] (x >= 0.5)");
    }

    #[divan::bench]
    fn bounded_response(bencher: Bencher) {
        push_all(
            bencher,
            "always (x > 0.9 implies eventually[0, 2] (y > 0.5))",
        );
    }

    #[divan::bench(args = [10, 100, 1000, 10_000])]
    fn once(bencher: Bencher, width: usize) {
        push_all(
            bencher,
            &format!("always once[0, {}] (x >= 0.5)", width as f64 / 10.0),
        );
    }

    #[divan::bench(args = [10, 100, 1000, 10_000])]
    fn since(bencher: Bencher, width: usize) {
        let width = width as f64 / 10.0;
        push_all(
            bencher,
            &format!("always ((x > 0.1) since[0, {width}] (y > 0.5))"),
        );
    }

    #[divan::bench]
    fn unless(bencher: Bencher) {
        push_all(bencher, "(x > -1) unless (y > 1)");
    }
}

/// Future operators below another: the cost per sample depends neither on the window nor on
/// the run.
mod nested {
    use super::online::push_all_of;
    use super::*;

    /// Replaces W by the window in seconds.
    fn windows(bencher: Bencher, text: &str, width: usize) {
        let text = text.replace('W', &(width as f64 / 10.0).to_string());
        // The window moves for three quarters of the run.
        push_all_of(bencher, &text, SAMPLES.max(4 * width));
    }

    #[divan::bench(args = [10, 100, 1000, 10_000, 100_000])]
    fn eventually(bencher: Bencher, width: usize) {
        windows(bencher, "always eventually[0, W] (x >= 0.5)", width);
    }

    #[divan::bench(args = [10, 100, 1000, 10_000, 100_000])]
    fn response(bencher: Bencher, width: usize) {
        let text = "always (x > 0.9 implies eventually[0, W] (y > 0.5))";
        windows(bencher, text, width);
    }

    #[divan::bench(args = [10, 100, 1000, 10_000, 100_000])]
    fn always(bencher: Bencher, width: usize) {
        let text = "always (x > 0.9 implies always[0, W] (y > 0.5))";
        windows(bencher, text, width);
    }

    #[divan::bench(args = [10, 100, 1000, 10_000, 100_000])]
    fn until(bencher: Bencher, width: usize) {
        let text = "always (x > 0.9 implies ((y > 0.1) until[0, W] (x > 0.5)))";
        windows(bencher, text, width);
    }

    #[divan::bench(args = [10_000, 100_000, 1_000_000])]
    fn endless_response(bencher: Bencher, samples: usize) {
        let text = "always (x > 0.9 implies eventually (y > 0.5))";
        push_all_of(bencher, text, samples);
    }

    #[divan::bench(args = [10_000, 100_000, 1_000_000])]
    fn bounded_response(bencher: Bencher, samples: usize) {
        let text = "always (x > 0.9 implies eventually[0, 2] (y > 0.5))";
        push_all_of(bencher, text, samples);
    }
}

/// The robustness at every sample, with a delay.
#[divan::bench(args = [
    "always[0, 1000] (x > 0.5)",
    "always[0, 100] eventually[0, 1000] (x > 0.5)",
    "always[0, 10] (x > 0.9 implies eventually[0, 2] (y > 0.5))",
    "(x > 0.1) until[1, 1000] (y > 0.9)",
    "always (x > 0.9 implies eventually[0, 2] (y > 0.5))",
])]
fn stream(bencher: Bencher, text: &str) {
    let trace = trace();
    let monitor = monitor(text, &trace);
    let mut stream = monitor.stream();
    let (x, y) = (trace.column(0), trace.column(1));
    bencher.bench_local(|| {
        stream.reset();
        for (x, y) in x.iter().zip(y) {
            black_box(stream.push(&[*x, *y]).unwrap());
        }
        stream.finish()
    });
}

/// From text to a monitor.
mod read {
    use super::*;

    #[divan::bench(args = [
        "always[0, 15] (x >= 0.5)",
        "(x > 4.7) unless (y <= 1.8)",
        "always[0, 15] ((rise(x > 1)) implies (eventually[100 ms, 2] (abs(x - y) <= 0.3)))",
    ])]
    fn parse_and_bind(bencher: Bencher, text: &str) {
        let schema = trace().schema().clone();
        let constants = Constants::from([("T".to_owned(), 15.0)]);
        bencher.bench_local(|| {
            black_box(text)
                .parse::<Formula>()
                .unwrap()
                .bind(&schema, &constants)
                .unwrap()
        });
    }
}
