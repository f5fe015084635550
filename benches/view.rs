//! What recording an episode costs, per sample.
//!
//! `cargo bench --bench view`. `by_column` sends everything, text and layout
//! included; `row_by_row` sends only bodies, signals and robustness, the way
//! one would log from a loop. `film` plays the episode again, which any
//! recording has to, and `whole` is all of it up to the bytes of the file.

use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, film, play};
use brakecheck::view::Recording;
use brakecheck::world::Scenario;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use rerun::{RecordingStream, RecordingStreamBuilder, Scalars, Transform3D};

fn main() {
    divan::main();
}

fn episode() -> (Scenario, Episode) {
    let world = Scenario::parse("acc.ron", include_str!("../worlds/acc.ron")).expect("shipped");
    let start = Start(vec![20.0, 40.0, 20.0]);
    let episode = play(
        &mut world.bench(),
        &start,
        0,
        &mut Constant(1),
        Aftermath::Play,
    );
    assert_eq!(episode.trace.len(), 301);
    (world, episode)
}

fn stream() -> (RecordingStream, rerun::sink::MemorySinkStorage) {
    let builder = RecordingStreamBuilder::new("bench").enabled(true);
    builder.memory().expect("memory")
}

#[divan::bench]
fn by_column(bencher: Bencher) {
    let (world, episode) = episode();
    let recording = Recording::new(&world, &episode, "");
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench(|| recording.messages().expect("messages"));
}

#[divan::bench]
fn row_by_row(bencher: Bencher) {
    let (world, episode) = episode();
    let mut bench = world.bench();
    let frames = film(&mut bench, &episode);
    let trace = &episode.trace;
    bencher
        .counter(ItemsCount::new(trace.len()))
        .with_inputs(stream)
        .bench_values(|(stream, storage)| {
            for (sample, frame) in frames.iter().enumerate() {
                stream.set_time_sequence("step", sample as i64);
                stream.set_duration_secs("sim_time", sample as f64 * trace.dt_s());
                for (name, place) in ["world/ego", "world/ado", "follow"]
                    .iter()
                    .zip(frame.placements.iter().chain(frame.placements.first()))
                {
                    let motion = Transform3D::from_translation_rotation(
                        place.centre_m.map(|at| at as f32),
                        rerun::Quaternion::from_xyzw(
                            place.rotation.coords.map(|part| part as f32).into(),
                        ),
                    );
                    stream.log(*name, &motion).expect("logged");
                }
                for group in 0..8 {
                    let values = [2 * group, 2 * group + 1].map(|i| {
                        let signal = i % trace.schema().len();
                        trace.column(signal)[sample]
                    });
                    let entity = format!("signals/{group}");
                    stream.log(entity, &Scalars::new(values)).expect("logged");
                }
                for formula in 0..3 {
                    let value = trace.column(formula)[sample];
                    let entity = format!("robustness/{formula}");
                    stream.log(entity, &Scalars::new([value])).expect("logged");
                }
            }
            storage.take().len()
        });
}

#[divan::bench]
fn film_only(bencher: Bencher) {
    let (world, episode) = episode();
    let mut bench = world.bench();
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench_local(|| film(&mut bench, black_box(&episode)));
}

#[divan::bench]
fn film_and_formulas(bencher: Bencher) {
    let (world, episode) = episode();
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench(|| {
            black_box(Recording::new(&world, black_box(&episode), ""));
        });
}

#[divan::bench]
fn whole(bencher: Bencher) {
    let (world, episode) = episode();
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench(|| Recording::new(&world, &episode, "").encode());
}
