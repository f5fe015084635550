//! What recording an episode costs, per sample.
//!
//! `cargo bench --bench view`. `by_column` makes the messages. `film_only` plays the
//! episode again, `film_and_formulas` also evaluates its formulas, and `whole` is
//! everything up to the bytes of a file. `streamed` is an episode of a stream.

use brakecheck::experiment::ShownEpisode;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::view::{EpisodeStream, Recording};
use brakecheck::world::Scenario;
use brakecheck_scene::testbench::film::film;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};

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

#[divan::bench]
fn by_column(bencher: Bencher) {
    let (world, episode) = episode();
    let recording = Recording::new(&world, &episode, "");
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench(|| recording.messages().expect("messages"));
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

#[divan::bench]
fn streamed(bencher: Bencher) {
    let (world, episode) = episode();
    let shown = ShownEpisode {
        scenario: &world,
        episode: &episode,
        caption: "",
        decisions: Some((0, 60)),
    };
    let out = Box::new(std::io::sink());
    let mut stream = EpisodeStream::new(out, "bench", true).expect("a stream");
    bencher
        .counter(ItemsCount::new(episode.trace.len()))
        .bench_local(|| stream.episode(&shown));
}
