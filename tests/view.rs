//! Recordings: whole, small, complete, and without effect on what they show.

#![cfg(feature = "rerun")]

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};

use brakecheck::experiment::{Audience, ShownEpisode, Watch};
use brakecheck::run_dir::{Calibration, Progress};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, Replay, play};
use brakecheck::training::{TrainRequest, TrainSession};
use brakecheck::view::{EpisodeStream, LiveView, Recording, ShownShare, ViewError, record};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_view::view::panels::entities;
use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;

fn world() -> Scenario {
    Scenario::parse("acc.ron", include_str!("../worlds/acc.ron")).unwrap()
}

/// The lead car brakes, recovers, and brakes again.
fn crash(world: &Scenario) -> Episode {
    let actions: Vec<usize> = [vec![0; 8], vec![2; 3], vec![0; 10]].concat();
    let start = Start(vec![12.21, 9.57, 17.9]);
    let mut actor = Replay::holding(&actions);
    play(&mut world.bench(), &start, 0, &mut actor, Aftermath::Play)
}

/// Nothing happens until the horizon: as long as an episode can be.
fn uneventful(world: &Scenario) -> Episode {
    let start = Start(vec![20.0, 40.0, 20.0]);
    play(
        &mut world.bench(),
        &start,
        0,
        &mut Constant(1),
        Aftermath::Play,
    )
}

/// Entity → (rows, timelines, components) of everything but the blueprint.
type Content = BTreeMap<String, (usize, Vec<String>, Vec<String>)>;

fn read_back(bytes: &[u8]) -> Content {
    let mut content = Content::new();
    for message in DecoderApp::decode_lazy(Cursor::new(bytes)) {
        let LogMsg::ArrowMsg(store, arrow) = message.unwrap() else {
            continue;
        };
        if store.is_blueprint() {
            continue;
        }
        let chunk = Chunk::from_arrow_msg(&arrow).unwrap();
        let (rows, timelines, components) =
            content.entry(chunk.entity_path().to_string()).or_default();
        *rows = chunk.num_rows().max(*rows);
        timelines.extend(chunk.timelines().keys().map(ToString::to_string));
        components.extend(chunk.components_identifiers().map(|id| id.to_string()));
        timelines.sort();
        timelines.dedup();
        components.sort();
    }
    content
}

#[test]
fn full_episodes_are_small() {
    let world = world();
    // Judged to the horizon, a crash has as many samples as anything.
    let text = include_str!("../worlds/acc.ron").replace("UntilViolation", "WholeRun");
    let whole = Scenario::parse("whole.ron", &text).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("full.rrd");
    for (world, episode) in [(&world, uneventful(&world)), (&whole, crash(&whole))] {
        let recorded = record(world, &episode, "", &out).unwrap();
        assert_eq!(recorded.samples, 301);
        assert_eq!(recorded.bytes, std::fs::metadata(&out).unwrap().len());
        // Almost half of them is the index.
        assert!(recorded.bytes <= 450_000, "{} bytes", recorded.bytes);
    }
}

#[test]
fn a_crash_is_recorded_with_everything_about_it() {
    let world = world();
    let episode = crash(&world);
    assert!(episode.verdict.is_success() && episode.contact.is_some());
    let bytes = Recording::new(&world, &episode, "a caption")
        .encode()
        .unwrap();
    let content = read_back(&bytes);
    let samples = episode.trace.len();
    let expected = [
        ("/world/ego", samples, "Transform3D:translation"),
        ("/world/ado", samples, "Mesh3D:vertex_positions"),
        ("/world/ado/velocity", samples, "Arrows3D:vectors"),
        ("/world/road", 1, "LineStrips3D:strips"),
        ("/trails", 1, "LineStrips3D:strips"),
        ("/contact", 1, "Arrows3D:vectors"),
        ("/signals/speed", samples, "Scalars:scalars"),
        ("/signals/distance", samples, "Scalars:scalars"),
        ("/signals/acceleration", samples, "Scalars:scalars"),
        ("/robustness/ego_spec", samples, "Scalars:scalars"),
        ("/robustness/zero", 2, "Scalars:scalars"),
        ("/marks/verdict", 2, "Scalars:scalars"),
        ("/marks/contact", 2, "Scalars:scalars"),
        ("/actions/ado", 3, "StateChange:state"),
        ("/verdict", 1, "TextDocument:text"),
        // One of them is the collision after the contact.
        ("/verdict/events", 7, "TextLog:text"),
    ];
    for (entity, rows, component) in expected {
        let (found, timelines, components) = content
            .get(entity)
            .unwrap_or_else(|| panic!("no {entity} in {:?}", content.keys()));
        assert_eq!(*found, rows, "rows of {entity}");
        assert!(
            components.iter().any(|name| name == component),
            "{entity} has {components:?}"
        );
        if rows > 1 {
            assert_eq!(
                timelines,
                &["sim_time", "step", "until_contact"],
                "{entity}"
            );
        }
    }
    for rule in &world.rulebook().rules {
        let entity = format!("/robustness/rule/{}", rule.name.replace(' ', "\\ "));
        assert_eq!(content[&entity].0, samples, "{entity}");
    }
}

#[test]
fn recording_twice_gives_equal_content_and_leaves_the_episode_alone() {
    let world = world();
    let episode = crash(&world);
    let before = episode.clone();
    let encode = || Recording::new(&world, &episode, "").encode().unwrap();
    let (first, second) = (encode(), encode());
    assert_eq!(read_back(&first), read_back(&second));
    assert!(first.len().abs_diff(second.len()) < 2_000);
    assert_eq!(episode, before);
    assert_eq!(crash(&world), before);
}

#[test]
fn fouls_prefixes_and_single_samples_are_recorded_too() {
    let world = world();
    let start = Start(vec![10.0, 60.0, 6.0]);
    let foul = |aftermath| play(&mut world.bench(), &start, 0, &mut Constant(0), aftermath);
    assert_eq!(foul(Aftermath::Skip).verdict.word(), "foul");
    let mut single = uneventful(&world);
    single.trace.truncate(1);
    single.judged = 1;
    single.actions.clear();
    for episode in [foul(Aftermath::Skip), foul(Aftermath::Play), single] {
        let bytes = Recording::new(&world, &episode, "").encode().unwrap();
        let content = read_back(&bytes);
        assert_eq!(content["/world/ego"].0, episode.trace.len());
        assert!(!content.contains_key("/contact"));
    }
}

#[test]
fn an_unwritable_output_is_an_error_that_names_it() {
    let world = world();
    let episode = crash(&world);
    let directory = tempfile::tempdir().unwrap();
    let outs = [
        directory.path().join("no such directory/a.rrd"),
        directory.path().to_owned(),
    ];
    for out in outs {
        let error = record(&world, &episode, "", &out).unwrap_err();
        assert!(matches!(error, ViewError::Write { .. }), "{error:?}");
        let name = out.display().to_string();
        assert!(error.to_string().contains(&name), "{error}");
        assert!(!error.help().is_empty());
    }
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[cfg(unix)]
#[test]
fn a_recording_goes_into_a_pipe_and_through_a_link_and_replaces_neither() {
    let world = world();
    let episode = crash(&world);
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("file.rrd"), "old").unwrap();
    std::os::unix::fs::symlink(at("file.rrd"), at("link.rrd")).unwrap();
    let recorded = record(&world, &episode, "", &at("link.rrd")).unwrap();
    assert!(at("link.rrd").is_symlink());
    let bytes = std::fs::read(at("file.rrd")).unwrap();
    assert_eq!(bytes.len() as u64, recorded.bytes);
    let pipe = at("pipe.rrd");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let from = pipe.clone();
    let reader = std::thread::spawn(move || std::fs::read(from).unwrap());
    let recorded = record(&world, &episode, "", &pipe).unwrap();
    assert!(!pipe.is_file(), "the pipe is a pipe still");
    assert_eq!(reader.join().unwrap().len() as u64, recorded.bytes);
}

#[test]
fn every_kept_crash_of_every_world_can_be_watched() {
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regressions");
    let kept = brakecheck::crashes::Regressions::load(dir).unwrap();
    let out = tempfile::tempdir().unwrap();
    let (mut unseen, mut seen) = (Vec::new(), Vec::new());
    for replayed in kept.replay().unwrap() {
        let file = out.path().join("crash.rrd");
        let caption = replayed.path.display().to_string();
        let recorded = record(&replayed.scenario, &replayed.episode, &caption, &file).unwrap();
        let content = read_back(&std::fs::read(&file).unwrap());
        assert_eq!(recorded.samples, replayed.episode.trace.len(), "{caption}");
        for agent in &replayed.scenario.bench().stage().agents {
            let shown = content.keys().any(|entity| entity.ends_with(&agent.name));
            assert!(shown, "{caption}: {}", agent.name);
        }
        assert!(content.contains_key("/verdict"), "{caption}");
        // What panels write is what they say.
        let listed: Vec<&str> = entities(&replayed.scenario).map(|it| it.path).collect();
        for entity in content.into_keys().filter(|it| !it.starts_with("/__")) {
            let is_listed = listed.iter().any(|path| is_of(&entity, path));
            assert!(is_listed, "{caption}: {entity} is of no panel");
            seen.push(entity);
        }
        unseen.extend(listed);
    }
    // No kept crash has sensors that miss a body.
    let near = include_str!("../worlds/acc.ron").replacen(
        "plant: Rigid,",
        "plant: Rigid, sensors: (range_m: 15.0),",
        1,
    );
    let near = Scenario::parse("near.ron", &near).unwrap();
    let episode = uneventful(&near);
    let bytes = Recording::new(&near, &episode, "").encode().unwrap();
    seen.extend(read_back(&bytes).into_keys());
    unseen.retain(|path| !seen.iter().any(|entity| is_of(entity, path)));
    assert!(unseen.is_empty(), "nobody wrote {unseen:?}");
}

#[test]
fn lights_are_shown_as_they_turn() {
    let text = include_str!("../worlds/yellow_light.ron");
    let world = Scenario::parse("yellow_light.ron", text).unwrap();
    let mut bench = world.bench();
    let middle = bench.axes().iter().map(|axis| 0.5 * (axis.lo + axis.hi));
    let start = Start(middle.collect());
    let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
    let bytes = Recording::new(&world, &episode, "").encode().unwrap();
    let content = read_back(&bytes);
    // It begins yellow and turns red.
    let (rows, timelines, _) = &content["/lights/light"];
    assert_eq!((*rows, timelines.len()), (2, 2));
    let has = |entity: &str, component: &str| {
        let (_, _, components) = &content[entity];
        components.iter().any(|name| name == component)
    };
    assert!(has("/world/light", "Boxes3D:half_sizes"));
    assert!(has("/world/light", "Transform3D:translation"));
    assert!(has("/world/light/lit", "Points3D:labels"));
    assert!(bytes.len() <= 400_000, "{} bytes", bytes.len());
}

#[test]
fn an_episode_of_a_grid_world_can_be_watched() {
    let text = include_str!("../worlds/grid_hard.ron");
    let world = Scenario::parse("grid_hard.ron", text).unwrap();
    let mut bench = world.bench();
    let start = world.starts().unwrap()[17].clone();
    let mut actor = Constant(0);
    let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Play);
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("grid.rrd");
    let recorded = record(&world, &episode, "one way only", &file).unwrap();
    assert_eq!(recorded.samples, episode.trace.len());
    let content = read_back(&std::fs::read(&file).unwrap());
    assert!(content.contains_key("/verdict"), "{:?}", content.keys());
    assert!(content.keys().any(|entity| entity.contains("ego")));
}

/// Bytes that another thread writes.
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

/// Times of an entity on a timeline of a stream, in the order of its messages.
fn times(bytes: &[u8], entity: &str, timeline: &str) -> Vec<i64> {
    let messages = DecoderApp::decode_lazy(Cursor::new(bytes));
    let chunks = messages.filter_map(|message| match message.unwrap() {
        LogMsg::ArrowMsg(_, arrow) => Some(Chunk::from_arrow_msg(&arrow).unwrap()),
        _ => None,
    });
    let of_entity = chunks.filter(|chunk| chunk.entity_path().to_string() == entity);
    let columns = of_entity.flat_map(|chunk| {
        let timelines = chunk.timelines().iter();
        let wanted = timelines.filter(|(name, _)| name.as_str() == timeline);
        wanted
            .flat_map(|(_, column)| column.times_raw().to_vec())
            .collect::<Vec<i64>>()
    });
    columns.collect()
}

/// Texts of the log and their times, in seconds.
fn log_lines(bytes: &[u8]) -> Vec<(f64, String)> {
    let messages = DecoderApp::decode_lazy(Cursor::new(bytes));
    let mut lines = Vec::new();
    for message in messages {
        let LogMsg::ArrowMsg(_, arrow) = message.unwrap() else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(&arrow).unwrap();
        if chunk.entity_path().to_string() != "/verdict/events" {
            continue;
        }
        let mut clocks = chunk.timelines().iter();
        let (_, clock) = clocks
            .find(|(name, _)| name.as_str() == "sim_time")
            .unwrap();
        let texts = chunk.iter_slices::<String>("TextLog:text".into());
        for (time, text) in clock.times_raw().iter().zip(texts) {
            lines.push((1e-9 * *time as f64, text[0].to_string()));
        }
    }
    lines
}

#[test]
fn bodies_move_on_after_the_contact_and_its_events_are_lines_of_the_log() {
    let text = include_str!("../worlds/acc.ron")
        .replace("plant: Rigid,", "plant: Rigid, after_contact_s: 1.5,");
    let world = Scenario::parse("acc.ron", &text).unwrap();
    let episode = crash(&world);
    let contact_s = episode.contact.as_ref().expect("a crash").time_s;
    let bytes = Recording::new(&world, &episode, "").encode().unwrap();
    let seconds = |entity: &str| -> Vec<f64> {
        let all = times(&bytes, entity, "sim_time").into_iter();
        all.map(|time| 1e-9 * time as f64).collect()
    };
    for entity in ["/world/ego", "/world/ado", "/follow"] {
        let poses_s = seconds(entity);
        assert!(poses_s.is_sorted(), "{entity}");
        // 1.5 s at 20 samples a second, beyond those of the episode.
        assert_eq!(poses_s.len(), episode.trace.len() + 30, "{entity}");
        assert!((poses_s.last().unwrap() - contact_s - 1.5).abs() < 1e-6);
    }
    // It opens at the contact, with the marks and the poses of that instant.
    for entity in [
        "/world/ego",
        "/signals/speed",
        "/robustness/ego_spec",
        "/marks/contact",
    ] {
        let until = times(&bytes, entity, "until_contact");
        let last_s = 1e-9 * *until.iter().max().expect("on the timeline") as f64;
        assert!(
            (0.0..0.06).contains(&(last_s - contact_s + 1e-6)),
            "{entity} {last_s}"
        );
    }
    // Curves end as before.
    assert_eq!(seconds("/signals/speed").len(), episode.trace.len());
    let lines = log_lines(&bytes);
    let after = episode.after_contact.expect("played on");
    assert!(!after.collisions.is_empty());
    for (time_s, event) in after.events() {
        let line = format!("after the contact: {event}");
        let found = lines.iter().find(|(_, text)| *text == line);
        let (shown_s, _) = found.unwrap_or_else(|| panic!("no {line} in {lines:?}"));
        assert!((shown_s - time_s).abs() < 1e-6, "{line} at {shown_s}");
    }
}

fn progress(decisions: u64) -> Progress {
    Progress {
        decisions,
        episodes: 2,
        window: 2,
        aborted: 0,
        solved_share: 0.5,
        mean_return: 0.1,
        exploration: 0.9,
        mean_loss: Some(0.02),
    }
}

#[test]
fn a_stream_has_its_episodes_one_after_another_beside_the_learning_curves() {
    let world = world();
    let (first, second) = (crash(&world), uneventful(&world));
    let pipe = Pipe::default();
    let mut stream = EpisodeStream::new(Box::new(pipe.clone()), "two episodes", true).unwrap();
    let mut from = 1000;
    for episode in [&first, &second] {
        let to = from + episode.actions.len() as u64 - 1;
        stream
            .episode(&ShownEpisode {
                scenario: &world,
                episode,
                caption: "a caption",
                decisions: Some((from, to)),
            })
            .unwrap();
        // A growing file can be read at any time.
        assert!(times(&pipe.bytes(), "/world/ego", "decisions").contains(&(to as i64)));
        from = to + 500;
    }
    stream.progress(&progress(2000)).unwrap();
    let calibration = Calibration {
        starts: 60,
        switches: 1,
        searched: 20,
        both: 19,
        ado_only: 0,
        simulations: 100,
        ..Calibration::default()
    };
    stream.calibration(2000, &calibration).unwrap();
    stream.finish().unwrap();
    let bytes = pipe.bytes();
    let content = read_back(&bytes);
    let (_, timelines, _) = &content["/robustness/ego_spec"];
    assert_eq!(timelines, &["decisions", "episode", "shown_time"]);
    let shown = times(&bytes, "/robustness/ego_spec", "shown_time");
    assert_eq!(shown.len(), first.trace.len() + second.trace.len() + 4);
    assert!(shown.is_sorted(), "the second episode follows the first");
    let decisions = times(&bytes, "/robustness/ego_spec", "decisions");
    let last = from as i64 - 500;
    assert_eq!((decisions[0], decisions.last()), (1000, Some(&last)));
    for curve in [
        "share/success",
        "share/exploration",
        "share/calibration",
        "return",
        "loss",
    ] {
        let entity = format!("/learning/{curve}");
        assert_eq!(times(&bytes, &entity, "decisions"), [2000], "{entity}");
    }
    // What the second episode lacks is cleared, such as the contact of the first.
    let contact = times(&bytes, "/contact", "episode");
    assert_eq!(contact.last(), Some(&2));
}

#[test]
fn a_closed_viewer_ends_the_stream_and_nothing_else() {
    /// A pipe whose reader closes after some bytes.
    struct Closing(usize);
    impl Write for Closing {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 = self
                .0
                .checked_sub(bytes.len())
                .ok_or(std::io::ErrorKind::BrokenPipe)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let world = world();
    let episode = crash(&world);
    let stream = EpisodeStream::new(Box::new(Closing(5_000)), "closing", false).unwrap();
    let live = LiveView::start(stream, ShownShare::InTime).unwrap();
    assert!(live.is_ready());
    show(&live, &world, &episode);
    let end = live.finish().expect("not ended before");
    assert!(matches!(end.error, Some(ViewError::Closed)), "{end:?}");
    assert_eq!(end.shown, 0);
    assert!(!live.is_ready());
    show(&live, &world, &episode);
    assert!(live.finish().is_none());
}

#[test]
fn a_viewer_that_reads_nothing_never_delays_the_work() {
    /// A full pipe, which accepts its first bytes only.
    struct Full(usize, Receiver<()>);
    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if self.0 < bytes.len() {
                let _ = self.1.recv();
            }
            self.0 = self.0.saturating_sub(bytes.len());
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let world = world();
    let episode = crash(&world);
    let (open, closed) = channel();
    let stream = EpisodeStream::new(Box::new(Full(5_000, closed)), "full", false).unwrap();
    let live = LiveView::start(stream, ShownShare::InTime).unwrap();
    assert!(live.is_ready());
    show(&live, &world, &episode);
    // The episode is being written, so the next ones are left out.
    for _ in 0..3 {
        assert!(!live.is_ready());
    }
    // More reports than may wait.
    for decisions in 0..5_000 {
        live.progress(&progress(decisions));
    }
    drop(open);
    let end = live.finish().expect("not ended before");
    assert_eq!((end.shown, end.left_out, end.error.is_none()), (1, 3, true));
}

fn show(live: &LiveView, world: &Scenario, episode: &Episode) {
    live.episode(&ShownEpisode {
        scenario: world,
        episode,
        caption: "",
        decisions: None,
    });
}

#[test]
fn a_watched_training_writes_the_same_bytes() {
    let world = world().on(PlantKind::Kinematic);
    let directory = tempfile::tempdir().unwrap();
    let request = TrainRequest {
        // Enough episodes for a report.
        decisions: Some(12_000),
        ..TrainRequest::default()
    };
    let pipe = Pipe::default();
    let stream = EpisodeStream::new(Box::new(pipe.clone()), "a training", true).unwrap();
    let live = LiveView::start(stream, ShownShare::InTime).unwrap();
    let mut files = Vec::new();
    for (name, audience) in [("alone", None), ("watched", Some(&live as &dyn Audience))] {
        let run = directory.path().join(name);
        let mut session = TrainSession::begin(&world, &run, &request).unwrap();
        session
            .train(&Watch::unwatched().shown_to(audience))
            .unwrap();
        let bytes = |file: &str| std::fs::read(run.join(file)).unwrap();
        files.push(
            [
                "policy.safetensors",
                "progress.jsonl",
                "counterexamples.jsonl",
            ]
            .map(bytes),
        );
    }
    assert_eq!(files[0], files[1]);
    let end = live.finish().expect("not ended before");
    assert!(end.error.is_none() && end.shown > 0, "{end:?}");
    let bytes = pipe.bytes();
    let decisions = times(&bytes, "/world/ego", "decisions");
    assert!(decisions.is_sorted() && decisions[0] > 0, "{decisions:?}");
    assert!(!times(&bytes, "/learning/loss", "decisions").is_empty());
}

/// Whether an entity is one of those listed as `/world/<agent>`.
fn is_of(entity: &str, listed: &str) -> bool {
    let (parts, listed): (Vec<_>, Vec<_>) =
        (entity.split('/').collect(), listed.split('/').collect());
    let alike = |(part, want): (&&str, &&str)| want.starts_with('<') || part == want;
    parts.len() == listed.len() && parts.iter().zip(&listed).all(alike)
}
