//! What a user sees in a recording, read back from its bytes.

#![cfg(feature = "rerun")]

use std::io::{Cursor, Write};
use std::sync::{Arc, Mutex};

use brakecheck_experiment::experiment::{ShownEpisode, decided};
use brakecheck_scene::scene::Start;
use brakecheck_scene::testbench::{Aftermath, Constant, Episode, Replay, play};
use brakecheck_view::view::{EpisodeStream, Recording};
use brakecheck_world::world::Scenario;
use re_chunk::Chunk;
use re_log_encoding::{Decodable, DecoderApp, StreamFooter};
use re_log_types::LogMsg;

fn world() -> Scenario {
    Scenario::shipped("acc").unwrap().unwrap()
}

/// World that judges an episode to the horizon.
fn whole_run() -> Scenario {
    let text = include_str!("../../../worlds/acc.ron").replace("UntilViolation", "WholeRun");
    Scenario::parse("whole.ron", &text).unwrap()
}

/// The lead car brakes, recovers, and brakes again.
fn crash(world: &Scenario) -> Episode {
    let actions: Vec<usize> = [vec![0; 8], vec![2; 3], vec![0; 10]].concat();
    let start = Start(vec![12.21, 9.57, 17.9]);
    let mut actor = Replay::holding(&actions);
    play(&mut world.bench(), &start, 0, &mut actor, Aftermath::Play)
}

/// Nothing happens until the horizon.
fn uneventful(world: &Scenario) -> Episode {
    let start = Start(vec![20.0, 40.0, 20.0]);
    let mut actor = Constant(1);
    play(&mut world.bench(), &start, 0, &mut actor, Aftermath::Play)
}

/// Bytes that a stream writes.
#[derive(Clone, Default)]
struct Pipe(Arc<Mutex<Vec<u8>>>);

impl Write for Pipe {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Pipe {
    fn bytes(&self) -> Vec<u8> {
        self.0.lock().unwrap().clone()
    }
}

/// Chunks of an entity.
fn of_entity(bytes: &[u8], entity: &str) -> impl Iterator<Item = Chunk> {
    let chunks = chunks(bytes).into_iter();
    chunks.filter(move |chunk| chunk.entity_path().to_string() == entity)
}

/// Times of an entity on a timeline, in the order of its messages.
fn times(bytes: &[u8], entity: &str, timeline: &str) -> Vec<i64> {
    let columns = of_entity(bytes, entity).flat_map(|chunk| {
        let timelines = chunk.timelines().iter();
        let wanted = timelines.filter(|(name, _)| name.as_str() == timeline);
        wanted
            .flat_map(|(_, column)| column.times_raw().to_vec())
            .collect::<Vec<i64>>()
    });
    columns.collect()
}

fn chunks(bytes: &[u8]) -> Vec<Chunk> {
    let messages = DecoderApp::decode_lazy(Cursor::new(bytes));
    let chunks = messages.filter_map(|message| match message.unwrap() {
        LogMsg::ArrowMsg(_, arrow) => Some(Chunk::from_arrow_msg(&arrow).unwrap()),
        _ => None,
    });
    chunks.collect()
}

/// Points, vectors or quaternions of an entity, row by row.
fn rows<const N: usize>(bytes: &[u8], entity: &str, component: &'static str) -> Vec<[f32; N]> {
    let rows = of_entity(bytes, entity).flat_map(|chunk| {
        let rows = chunk.iter_slices::<[f32; N]>(component.into());
        rows.map(|row| row[0]).collect::<Vec<[f32; N]>>()
    });
    rows.collect()
}

/// Scalars of the views' axes: least and greatest value.
fn ranges(bytes: &[u8]) -> Vec<[f64; 2]> {
    let rows = chunks(bytes).into_iter().flat_map(|chunk| {
        let rows = chunk.iter_slices::<[f64; 2]>("ScalarAxis:range".into());
        rows.map(|row| row[0]).collect::<Vec<[f64; 2]>>()
    });
    rows.collect()
}

fn recorded(world: &Scenario, episode: &Episode) -> Vec<u8> {
    Recording::new(world, episode, "a caption")
        .encode()
        .unwrap()
}

/// Cut-in in which the ado brakes and moves to the right at once.
fn cut_in() -> (Scenario, Episode) {
    let world = Scenario::shipped("cut_in").unwrap().unwrap();
    let mut actor = Replay::holding(&[5, 5, 5, 4]);
    let start = Start(vec![24.506718203774593, 6.213589348769963]);
    let noise = 5809757876728845851;
    let episode = play(
        &mut world.bench(),
        &start,
        noise,
        &mut actor,
        Aftermath::Play,
    );
    (world, episode)
}

#[test]
fn files_and_streams_end_with_the_index_that_readers_begin_with() {
    let world = world();
    let episode = crash(&world);
    let pipe = Pipe::default();
    let mut stream = EpisodeStream::new(Box::new(pipe.clone()), "one", false).unwrap();
    show(&mut stream, &world, &episode);
    stream.finish().unwrap();
    for bytes in [recorded(&world, &episode), pipe.bytes()] {
        let end = bytes.len() - StreamFooter::ENCODED_SIZE_BYTES;
        let footer = StreamFooter::from_rrd_bytes(&bytes[end..]).expect("a footer");
        let span = &footer.entries[0].rrd_footer_byte_span_from_start_excluding_header;
        assert_eq!(footer.entries.len(), 1);
        assert_eq!(span.start + span.len, end as u64);
        // A second stream behind the first would be outside of the index.
        let beginnings = bytes.windows(4).filter(|it| *it == b"RRF2").count();
        assert_eq!(beginnings, 1 + 1, "header and footer alone have the mark");
    }
}

#[test]
fn arrows_are_as_long_as_the_way_in_half_a_second() {
    let world = world();
    let episode = crash(&world);
    let bytes = recorded(&world, &episode);
    let speeds_mps = episode.trace.signal("ego.speed").unwrap();
    let arrows = rows::<3>(&bytes, "/world/ego/velocity", "Arrows3D:vectors");
    assert!(arrows.len() >= speeds_mps.len());
    for (arrow, speed_mps) in arrows.iter().zip(speeds_mps).skip(1) {
        let length = (arrow[0].powi(2) + arrow[1].powi(2) + arrow[2].powi(2)).sqrt();
        let error = f64::from(length) - 0.5 * speed_mps;
        assert!(error.abs() < 0.3, "{arrow:?} at {speed_mps} m/s");
    }
    assert!(f64::from(arrows[1][0]) > 0.4 * speeds_mps[1], "forward");
}

#[test]
fn arrows_turn_with_their_bodies() {
    let world = Scenario::shipped("bend").unwrap().unwrap();
    let mut bench = world.bench();
    let middle = bench.axes().iter().map(|axis| 0.5 * (axis.lo + axis.hi));
    let start = Start(middle.collect());
    let episode = play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Play);
    let bytes = recorded(&world, &episode);
    let turns = rows::<4>(&bytes, "/world/ego", "Transform3D:quaternion");
    let headings = turns.iter().map(|turn| 2.0 * turn[2].atan2(turn[3]));
    let most = headings.map(f32::abs).fold(0.0, f32::max);
    assert!(most > 0.3, "the road turns by {most} rad");
    // The frame is that of the body, which drives ahead.
    for arrow in rows::<3>(&bytes, "/world/ego/velocity", "Arrows3D:vectors") {
        assert!(arrow[1].abs() <= 0.1 * arrow[0].abs() + 0.05, "{arrow:?}");
    }
}

#[test]
fn plots_end_at_the_verdict_and_show_where_the_margin_crosses_zero() {
    let whole = whole_run();
    let mut seen = 0;
    for (world, episode) in [(world(), crash(&world())), (whole.clone(), crash(&whole))] {
        let bytes = recorded(&world, &episode);
        let decided = decided(&world, &episode).expect("a crash");
        let contact_s = episode.contact.as_ref().expect("a contact").time_s;
        let end_s = decided.time_s.max(contact_s);
        let ends = time_axes(&bytes);
        assert!(ends.len() > 3, "{ends:?}");
        for axis_s in ends {
            assert!(
                end_s <= axis_s && axis_s <= 1.05 * end_s,
                "{axis_s} of {end_s}"
            );
            seen += 1;
        }
        let margins = scalars(&bytes, "/robustness/ego_spec");
        let [least, greatest] = ranges(&bytes)[0];
        // All values are in the recording, and the axis shows the last two seconds of them.
        assert!(margins[0] > 1.5 * greatest, "{} of {greatest}", margins[0]);
        assert!(least < margins[decided.sample] && margins[decided.sample] < 0.0);
        let near = (2.0 / episode.trace.dt_s()) as usize;
        let before = margins[decided.sample - near];
        assert!(
            (0.5..1.5).contains(&(greatest / before)),
            "{greatest} of {before}"
        );
        assert!(least > -greatest);
    }
    assert!(seen > 6);
}

#[test]
fn a_margin_that_comes_from_its_limit_is_shown_where_it_has_a_value() {
    let world = Scenario::shipped("yellow_light").unwrap().unwrap();
    let mut bench = world.bench();
    let middle = bench.axes().iter().map(|axis| 0.5 * (axis.lo + axis.hi));
    let start = Start(middle.collect());
    let mut actor = Constant(0);
    let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Play);
    let bytes = recorded(&world, &episode);
    let limit = world.rulebook().reward.rho_max();
    let margins = scalars(&bytes, "/robustness/ego_spec");
    assert_eq!(margins[0], limit, "the light is yellow");
    let [_, greatest] = ranges(&bytes)[0];
    assert!(greatest < 0.9 * limit, "{greatest} of {limit}");
}

/// Ends of the plots' time axes in seconds, of those with an absolute one.
fn time_axes(bytes: &[u8]) -> Vec<f64> {
    use re_sdk_types::Loggable as _;
    let mut ends_s = Vec::new();
    for chunk in chunks(bytes) {
        let Some(column) = chunk.raw_component_array("TimeAxis:view_range".into()) else {
            continue;
        };
        let ranges = re_sdk_types::datatypes::TimeRange::from_arrow(column).unwrap();
        for range in ranges {
            if let re_sdk_types::datatypes::TimeRangeBoundary::Absolute(end) = range.end {
                ends_s.push(1e-9 * end.0 as f64);
            }
        }
    }
    ends_s
}

fn scalars(bytes: &[u8], entity: &str) -> Vec<f64> {
    let rows = of_entity(bytes, entity).flat_map(|chunk| {
        let rows = chunk.iter_slices::<f64>("Scalars:scalars".into());
        rows.map(|row| row[0]).collect::<Vec<f64>>()
    });
    rows.collect()
}

#[test]
fn no_line_joins_two_episodes_of_a_stream() {
    let world = world();
    let pipe = Pipe::default();
    let mut stream = EpisodeStream::new(Box::new(pipe.clone()), "two", false).unwrap();
    for episode in [crash(&world), uneventful(&world)] {
        show(&mut stream, &world, &episode);
    }
    stream.finish().unwrap();
    let bytes = pipe.bytes();
    for entity in [
        "/robustness/ego_spec",
        "/robustness/zero",
        "/signals/acceleration",
    ] {
        let values = scalars(&bytes, entity);
        let gaps = values.iter().filter(|value| value.is_nan()).count();
        assert_eq!(gaps, 2, "{entity}");
        // The gap follows the last value of its episode before the next one begins.
        let first = values.iter().position(|value| value.is_nan()).unwrap();
        let shown = times(&bytes, entity, "shown_time");
        assert!(
            shown.is_sorted() && first > 0 && first + 1 < values.len(),
            "{entity}"
        );
    }
    let states = texts(&bytes, "/actions/ado", "StateChange:state");
    assert_eq!(states.iter().filter(|state| state.is_empty()).count(), 2);
    // A recording of one episode has no gaps.
    let alone = recorded(&world, &crash(&world));
    assert!(
        scalars(&alone, "/robustness/ego_spec")
            .iter()
            .all(|it| it.is_finite())
    );
}

fn texts(bytes: &[u8], entity: &str, component: &'static str) -> Vec<String> {
    let rows = of_entity(bytes, entity).flat_map(|chunk| {
        let rows = chunk.iter_slices::<String>(component.into());
        rows.flat_map(|row| row.iter().map(ToString::to_string).collect::<Vec<_>>())
            .collect::<Vec<String>>()
    });
    rows.collect()
}

#[test]
fn actions_have_the_colour_of_their_effect() {
    let (world, episode) = cut_in();
    let bytes = recorded(&world, &episode);
    let labels = texts(&bytes, "/actions/ado", "StateConfiguration:labels");
    let colours = chunks(&bytes).into_iter().flat_map(|chunk| {
        let rows = chunk.iter_slices::<u32>("StateConfiguration:colors".into());
        rows.flat_map(|row| row.to_vec()).collect::<Vec<u32>>()
    });
    let colours: Vec<u32> = colours.collect();
    assert_eq!(labels.len(), colours.len());
    assert!(
        labels
            .iter()
            .any(|label| label.starts_with('-') && label.ends_with("right"))
    );
    let mut seen = colours.clone();
    for (label, colour) in labels.iter().zip(&colours) {
        let [r, g, b, _] = colour.to_be_bytes().map(i32::from);
        match label.as_bytes()[0] {
            b'-' => assert!(r > g + 20 && r > b + 20, "{label}: {r} {g} {b}"),
            _ if label.starts_with("+0") => assert!(b >= r && b >= g, "{label}: {r} {g} {b}"),
            _ => assert!(g > r + 20 && g > b + 20, "{label}: {r} {g} {b}"),
        }
    }
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), labels.len(), "each action has its own colour");
}

#[test]
fn a_pedestrian_is_not_below_its_label() {
    let world = Scenario::shipped("pedestrian").unwrap().unwrap();
    let mut bench = world.bench();
    let middle = bench.axes().iter().map(|axis| 0.5 * (axis.lo + axis.hi));
    let start = Start(middle.collect());
    let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
    let bytes = recorded(&world, &episode);
    for agent in &bench.stage().agents {
        let entity = format!("/world/{}", agent.name);
        let place = rows::<3>(&bytes, &entity, "Points3D:positions")[0];
        let [length_m, width_m, height_m] = agent.size_m.map(|it| it as f32);
        assert!(place[2] > 0.5 * height_m + 0.3, "{}: {place:?}", agent.name);
        let is_beside =
            place[0].abs() > 0.5 * length_m + 0.4 || place[1].abs() > 0.5 * width_m + 0.4;
        assert!(is_beside, "{}: {place:?}", agent.name);
        let labels = texts(&bytes, &entity, "Points3D:labels");
        assert_eq!(labels, [agent.name.as_str()]);
    }
}

#[test]
fn all_panels_have_one_instant_of_the_verdict() {
    let (world, episode) = cut_in();
    let bytes = recorded(&world, &episode);
    let decided = decided(&world, &episode).expect("decided");
    let nanos = (1e9 * decided.time_s).round() as i64;
    assert_eq!(times(&bytes, "/marks/verdict", "sim_time")[0], nanos);
    assert_eq!(times(&bytes, "/verdict/mark", "sim_time"), [nanos]);
    let in_words = format!("{:.2} s", decided.time_s);
    let document = texts(&bytes, "/verdict", "TextDocument:text").concat();
    assert!(
        document.contains(&format!("| decided at | {in_words} |")),
        "{document}"
    );
    let marks = texts(&bytes, "/marks/verdict", "SeriesLines:names").concat();
    assert!(marks.contains(&in_words), "{marks}");
    assert_eq!(document.matches("decided at").count(), 1, "{document}");
    // The sample of a contact has its instant, not that of the grid.
    let late = format!("{:.2} s", decided.sample as f64 * episode.trace.dt_s());
    assert!(late == in_words || !document.contains(&late), "{document}");
}

fn show(stream: &mut EpisodeStream, world: &Scenario, episode: &Episode) {
    stream
        .episode(&ShownEpisode {
            scenario: world,
            episode,
            caption: "",
            decisions: None,
        })
        .unwrap();
}

#[test]
fn a_body_that_the_ego_does_not_see_has_a_frame_until_it_is_seen() {
    let text = include_str!("../../../worlds/acc.ron");
    let near = text.replacen(
        "plant: Rigid,",
        "plant: Rigid, sensors: (range_m: 15.0),",
        1,
    );
    let near = Scenario::parse("near.ron", &near).unwrap();
    let episode = uneventful(&near);
    let bytes = recorded(&near, &episode);
    let states = texts(&bytes, "/sight/ado", "StateChange:state");
    assert_eq!(states[0], "hidden from the ego", "it begins 40 m ahead");
    // A headway is that of the front bumpers, and the range counts to the rear of the ado.
    let headways_m = episode.trace.signal("headway").unwrap().iter();
    let gaps_m: Vec<f64> = headways_m.map(|headway_m| headway_m - 4.54).collect();
    let turns = times(&bytes, "/sight/ado", "step");
    let samples = turns.iter().zip(&states);
    for (sample, state) in samples.filter(|(sample, _)| **sample >= 0) {
        let Some(gap_m) = gaps_m.get(usize::try_from(*sample).unwrap()) else {
            continue;
        };
        let is_hidden = state == "hidden from the ego";
        assert!(
            is_hidden == (*gap_m > 15.0) || (gap_m - 15.0).abs() < 1.0,
            "{state} at {gap_m} m"
        );
    }
    let frames = texts(&bytes, "/world/ado/hidden", "Boxes3D:labels");
    assert_eq!(
        frames.len(),
        states
            .iter()
            .filter(|state| state.starts_with("hidden"))
            .count()
    );
    // Perfect sensors miss nothing.
    let perfect = recorded(&world(), &uneventful(&world()));
    assert!(of_entity(&perfect, "/sight/ado").next().is_none());
    assert!(of_entity(&perfect, "/world/ado/hidden").next().is_none());
}
