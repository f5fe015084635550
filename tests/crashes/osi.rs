//! Crashes as traces of the Open Simulation Interface.

use std::fs::File;

use brakecheck::crashes::{ExportSettings, Regressions, export_with};
use brakecheck_traffic::read_mcap;

use super::openx::{all, regressions};

/// Greatest distance of a written place from the trace, in metres.
const BAR_M: f64 = 0.01;

#[test]
fn an_osi_trace_has_the_places_of_the_recorded_samples() {
    let directory = tempfile::tempdir().unwrap();
    let kept = Regressions::load(regressions()).unwrap();
    let settings = ExportSettings { osi: true };
    let exported = export_with(&kept, directory.path(), settings).unwrap();
    let traces = exported
        .files
        .iter()
        .filter(|it| it.extension().is_some_and(|it| it == "mcap"));
    assert_eq!(traces.count(), all().len());
    let mut compared = 0;
    for case in all() {
        let name = case.kept.path.file_stem().unwrap().to_string_lossy();
        let path = directory.path().join(format!("{name}.mcap"));
        let recording = read_mcap(File::open(path).unwrap(), &name).unwrap();
        let scenario = case.kept.counterexample.scenario(&case.kept.path).unwrap();
        let agents = &scenario.drive().unwrap().spec().agents;
        assert_eq!(recording.tracks.len(), agents.len(), "{name}");
        for (agent, track) in agents.iter().zip(&recording.tracks) {
            let column = |of: &str| case.trace.signal(&format!("{}.{of}", agent.name)).unwrap();
            let (x_m, y_m, heading_rad) = (column("x"), column("y"), column("heading"));
            assert!(
                (track.length_m - agent.body.length_m).abs() < 1e-9,
                "{name}"
            );
            // The last sample of a contact is between two instants of the grid.
            let samples = track.len().min(case.trace.len()) - 1;
            for i in 0..samples {
                let back_m = 0.5 * agent.body.length_m;
                let centre_m = [
                    x_m[i] - back_m * libm::cos(heading_rad[i]),
                    y_m[i] - back_m * libm::sin(heading_rad[i]),
                ];
                let [ox, oy] = recording.origin_m;
                let off_m = libm::hypot(
                    ox + track.x_m[i] - centre_m[0],
                    oy + track.y_m[i] - centre_m[1],
                );
                assert!(
                    off_m < BAR_M,
                    "{name}, {} at sample {i}: {off_m} m",
                    agent.name
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 1000, "{compared} places");
}

#[test]
fn equal_crashes_give_equal_osi_traces() {
    let alone = Regressions::load(&all()[0].kept.path).unwrap();
    let settings = ExportSettings { osi: true };
    let written = [(); 2].map(|()| {
        let directory = tempfile::tempdir().unwrap();
        let exported = export_with(&alone, directory.path(), settings).unwrap();
        assert_eq!(exported.files.len(), 4);
        std::fs::read(&exported.files[3]).unwrap()
    });
    assert!(written[0] == written[1]);
}
