//! Costs of reading recordings, fitting lanes and evaluating rules.
//!
//! `cargo bench -p brakecheck-traffic` prints the throughput on synthetic rows.

#[expect(dead_code, reason = "tests use the rest")]
mod synthetic;

use brakecheck_traffic::{
    BoundRules, ColumnMap, LaneFrame, Leads, TrafficRecording, TrafficRuleFile, read_csv,
};
use divan::counter::{BytesCount, ItemsCount};
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

fn text() -> String {
    synthetic::dlr(&synthetic::traffic(1, 30, 120.0).0, 1.003)
}

fn recording(text: &str) -> TrafficRecording {
    let map = ColumnMap::shipped("dlr").expect("shipped");
    read_csv(text.as_bytes(), "log.csv", &map).expect("rows")
}

#[divan::bench(sample_count = 5)]
fn read(bencher: Bencher) {
    let text = text();
    bencher
        .counter(BytesCount::of_str(&text))
        .bench_local(|| recording(black_box(&text)));
}

#[divan::bench(sample_count = 5)]
fn fit_lanes(bencher: Bencher) {
    let recording = recording(&text());
    bencher
        .counter(ItemsCount::new(recording.counts.rows))
        .bench_local(|| LaneFrame::fit(black_box(&recording)));
}

#[divan::bench(sample_count = 5)]
fn ten_rules(bencher: Bencher) {
    let recording = recording(&text());
    let frame = LaneFrame::fit(&recording);
    let leads = Leads::find(&recording, &frame);
    let file = TrafficRuleFile::parse(TrafficRuleFile::motorway_text()).expect("shipped");
    let rules = BoundRules::bind(&file, &recording).expect("shipped");
    bencher
        .counter(ItemsCount::new(recording.counts.rows))
        .bench_local(|| rules.evaluate(black_box(&recording), &frame, &leads));
}
