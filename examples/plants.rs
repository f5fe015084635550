//! Starts whose outcome depends on the plant.
//!
//! A search finds a plan for each start on the kinematic plant, and the ado without a plan
//! holds its first action. Both plants play it, with own and with validated bodies.
//!
//! ```sh
//! cargo run --release --example plants -- acc merge
//! ```

use brakecheck::experiment::{EgoUnderTest, Watch, test_starts};
use brakecheck::search::{Adversary, Search};
use brakecheck::world::{PlantKind, Scenario};

const VALIDATED: [[&str; 2]; 3] = [
    ["sedan", "bmw_320i"],
    ["truck", "lorry_40t"],
    ["semitrailer", "lorry_40t"],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let watch = Watch::unwatched();
    for name in std::env::args().skip(1) {
        let own = Scenario::shipped(&name).ok_or("no shipped world")??;
        let text = VALIDATED.iter().fold(own.text().to_owned(), |text, pair| {
            let [body, validated] = pair.map(|body| format!("body: \"{body}\""));
            text.replace(&body, &validated)
        });
        let validated = Scenario::parse(own.source(), &text)?;
        let starts = test_starts(&own, 0, 80, &watch).ok_or("no starts")?;
        let ego = EgoUnderTest::nominal(&own.on(PlantKind::Kinematic));
        let plans = Search::switches(2).play(&ego, &starts, &watch);
        let plans = plans.ok_or("no search")?;
        for (bodies, world) in [("own", &own), ("validated", &validated)] {
            let plants = [PlantKind::Kinematic, PlantKind::Rigid];
            let mut benches = plants.map(|plant| world.on(plant).bench());
            let (mut fails, mut differ, mut all) = ([0; 2], 0, 0);
            for start in (0..starts.starts.len()).filter(|start| !starts.trivial[*start]) {
                let verdicts = benches.each_mut().map(|it| plans.replay(it, start).verdict);
                for (fails, verdict) in fails.iter_mut().zip(&verdicts) {
                    *fails += usize::from(verdict.is_success());
                }
                differ += usize::from(verdicts[0].word() != verdicts[1].word());
                all += 1;
            }
            let [kinematic, rigid] = fails;
            println!(
                "{name}, {bodies} bodies: {all} starts, {kinematic} / {rigid} fail, {differ} differ"
            );
        }
    }
    Ok(())
}
