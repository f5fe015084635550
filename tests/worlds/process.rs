//! An ego that is another program: what it may do wrong is never a success.

use brakecheck::ego::Fault;
use brakecheck::rulebook::Verdict;
use brakecheck::scenario::Scenario;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};

/// The ACC world with a shell script as the ego.
fn world(script: &str) -> Scenario {
    // Only the program that hangs is worth a short wait; machines are busy.
    let timeout_s = if script == HANGS { 0.5 } else { 60.0 };
    let text = include_str!("../../worlds/acc.ron");
    let from = text.find("drive: Ego(Acc(").expect("the ego");
    let to = from + text[from..].find(")),").expect("its end") + 3;
    let drive = format!(
        "drive: Ego(Process(command: [\"sh\", \"-c\", r#\"{script}\"#], timeout_s: {timeout_s:.1})),"
    );
    let text = format!("{}{drive}{}", &text[..from], &text[to..]);
    // Changes of the controller's parameters do not fit another controller.
    let from = text.find("reuse: {").expect("reuse");
    let text = format!("{})\n", &text[..from]);
    Scenario::parse("acc.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

fn coast(world: &Scenario, start: [f64; 3]) -> Episode {
    let mut bench = world.bench();
    let mut actor = Constant(bench.spaces().neutral);
    play(
        &mut bench,
        &Start(start.to_vec()),
        7,
        &mut actor,
        Aftermath::Skip,
    )
}

/// Reads everything and says nothing.
const HANGS: &str = "cat > /dev/null";

const FAR: [f64; 3] = [10.0, 50.0, 20.0];

fn answering(answer: &str) -> String {
    format!(
        "while read -r line; do case $line in *reset*) echo '{{\"ready\":true}}';; \
         *) {answer};; esac; done"
    )
}

#[test]
fn a_program_drives_the_ego() {
    let brakes = world(&answering("echo '{\"accel_mps2\":-2.0}'"));
    let episode = coast(&brakes, FAR);
    assert_eq!(episode.fault, None);
    assert!(matches!(episode.verdict, Verdict::Held { .. }));
    let speed = episode.trace.signal("ego.speed").expect("published");
    // From 10 m/s at -2 m/s²: 5 m/s after 2.5 s, and at rest from 5 s on.
    assert!((speed[50] - 5.0).abs() < 0.05, "{}", speed[50]);
    assert!(speed[300].abs() < 1e-6);
    // It is asked again and again: a second episode in the same process.
    assert_eq!(coast(&brakes, FAR), episode);
}

#[test]
fn whatever_a_program_does_wrong_makes_the_episode_invalid() {
    let cases = [
        ("exit 3", "the program ended"),
        (HANGS, "no answer within 0.5 s"),
        (&answering("echo nonsense"), "it answered `nonsense`"),
        (&answering("echo '{\"accel\":1}'"), "unknown field"),
        (&answering("exit 0"), "the program ended"),
        ("yes", "it answered `y`"),
        (
            "head -c 200000 /dev/zero | tr '\\0' 'x'",
            "over 65536 bytes",
        ),
        ("read -r line; echo '{\"ready\":false}'", "not ready"),
    ];
    for (script, says) in cases {
        let episode = coast(&world(script), FAR);
        assert_eq!(episode.verdict, Verdict::Invalid, "{script}");
        let Some(Fault::Ego { what }) = episode.fault else {
            panic!("{script}: {:?}", episode.fault);
        };
        // A program that ends may do so before or after its pipe is noticed.
        let gone = ["pipe", "closed", "ended"]
            .iter()
            .any(|word| what.contains(word));
        assert!(
            what.contains(says) || (says.contains("ended") && gone),
            "{script}: {what}"
        );
    }
}

#[test]
fn a_missing_program_is_named() {
    let text = world("true").text.replace("\"sh\"", "\"no-such-program\"");
    let world = Scenario::parse("acc.ron", &text).expect("a sound world");
    let Some(Fault::Ego { what }) = coast(&world, FAR).fault else {
        panic!("no fault");
    };
    assert!(what.contains("no-such-program"), "{what}");
}
