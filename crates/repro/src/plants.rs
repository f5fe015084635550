//! Starts whose outcome depends on the plant, for one fixed adversary.
//!
//! The adversary of a start is the plan that a search finds on the kinematic plant with
//! the world's own bodies. Without a plan the ado holds its first action. The same actions
//! are played on both plants, with the world's own bodies and with validated bodies.

use serde::{Deserialize, Serialize};

use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch};
use brakecheck::search::{Adversary, Search};
use brakecheck::testbench::Testbench;
use brakecheck::world::PlantKind;
use brakecheck::world::{Scenario, ScenarioError};
use brakecheck_experiment::experiment::episode_loop::EpisodeLoop;
use brakecheck_report::report::table::TextTable;

/// Largest number of switches of the plans.
const SWITCHES: usize = 2;
/// Bodies of worlds and the validated bodies in their place.
const VALIDATED: [(&str, &str); 3] = [
    ("sedan", "bmw_320i"),
    ("truck", "lorry_40t"),
    ("semitrailer", "lorry_40t"),
];

/// Outcomes on both plants with the same bodies.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct PlantOutcomes {
    /// Starts from which the ego fails on the kinematic plant, with all rules kept.
    pub kinematic: usize,
    /// The same on the rigid plant.
    pub rigid: usize,
    /// Starts whose verdicts are of different kinds.
    pub differ: usize,
}

/// Outcomes in a world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlantRow {
    /// Name of the world.
    pub world: String,
    /// Starts, without the trivial ones.
    pub starts: usize,
    /// With the world's own bodies.
    pub own: PlantOutcomes,
    /// With validated bodies, if the world has bodies that these can replace.
    pub validated: Option<PlantOutcomes>,
}

/// Returns the world with validated bodies, or `None` if none of its bodies has one.
///
/// # Errors
/// The world refuses the bodies.
pub fn with_validated_bodies(scenario: &Scenario) -> Result<Option<Scenario>, ScenarioError> {
    let mut text = scenario.text().to_owned();
    for (body, validated) in VALIDATED {
        text = text.replace(
            &format!("body: \"{body}\""),
            &format!("body: \"{validated}\""),
        );
    }
    if text == scenario.text() {
        return Ok(None);
    }
    Scenario::parse(scenario.source(), &text).map(Some)
}

/// Plays the adversary of each start on both plants. `None`: stopped, or no such adversary.
pub fn plant_row(
    scenario: &Scenario,
    validated: Option<&Scenario>,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<PlantRow> {
    let ego = EgoUnderTest::nominal(&scenario.on(PlantKind::Kinematic));
    let cell = Search::switches(SWITCHES).play(&ego, starts, watch)?;
    let indices: Vec<usize> = (0..starts.starts.len())
        .filter(|index| !starts.trivial[*index])
        .collect();
    let outcomes = |world: &Scenario| {
        let benches = || -> [Testbench; 2] {
            [PlantKind::Kinematic, PlantKind::Rigid].map(|plant| world.on(plant).bench())
        };
        let pairs = EpisodeLoop::uncounted(watch).each(&indices, benches, |benches, index, _| {
            let [kinematic, rigid] = benches;
            let of = |bench: &mut Testbench| cell.replay(bench, *index).verdict;
            Some((of(kinematic), of(rigid)))
        });
        let mut sums = PlantOutcomes::default();
        for (kinematic, rigid) in pairs.into_iter().flatten() {
            sums.kinematic += usize::from(kinematic.is_success());
            sums.rigid += usize::from(rigid.is_success());
            sums.differ += usize::from(kinematic.word() != rigid.word());
        }
        sums
    };
    let row = PlantRow {
        world: scenario.name().to_owned(),
        starts: indices.len(),
        own: outcomes(scenario),
        validated: validated.map(outcomes),
    };
    (!watch.stopped()).then_some(row)
}

/// Formats the rows as a Markdown table.
pub fn plants_markdown(rows: &[PlantRow]) -> String {
    let line = |row: &PlantRow| {
        let percent =
            |part: usize| format!("{:.0} %", 100.0 * part as f64 / row.starts.max(1) as f64);
        let cells = |outcomes: Option<PlantOutcomes>| {
            outcomes.map_or(["–".to_owned(), "–".to_owned()], |outcomes| {
                let PlantOutcomes {
                    kinematic,
                    rigid,
                    differ,
                } = outcomes;
                [format!("{kinematic} / {rigid}"), percent(differ)]
            })
        };
        let mut texts = vec![row.world.clone(), row.starts.to_string()];
        texts.extend(cells(Some(row.own)));
        texts.extend(cells(row.validated));
        texts
    };
    let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
    TextTable::new(
        [
            "world",
            "starts",
            "own bodies: failing kinematic / rigid",
            "differ",
            "validated bodies: failing kinematic / rigid",
            "differ",
        ],
        lines,
    )
    .to_markdown()
}
