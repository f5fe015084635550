//! Pictures that play by themselves: as the documents show them, and honest.

use brakecheck::ego::ReferenceDriver;
use brakecheck::rulebook::RulesUntilContact;
use brakecheck::run_dir::{About, Counterexample};

use super::{brakecheck, code, json, path, refused, root, scratch, stderr};

/// The crash on top of the README, and who is shown beside it.
const CRASH: &str = "tests/regressions/acc_iso-nominal-0005.ron";
const BESIDE: &str = "CC";

fn read(file: impl AsRef<std::path::Path>) -> String {
    let file = file.as_ref();
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

/// The crash on top of the README, with what its file says.
fn kept() -> (Counterexample, About) {
    let kept = Counterexample::load(&root().join(CRASH)).expect("a kept crash");
    let about = kept.about.clone().expect("labels");
    (kept, about)
}

/// What of a crash a text must say in these words, by the labels of its file;
/// each with the beginning by which a sentence that says otherwise is found.
fn facts() -> Vec<(String, &'static str)> {
    let (kept, about) = kept();
    let known = about.preventability.expect("drivers");
    let rules = kept.scenario(&root().join(CRASH)).expect("a world");
    let rules = rules.rulebook().rules.len();
    let kept_rules = kept.rules_until_contact == Some(RulesUntilContact::Kept);
    assert!(kept_rules, "{:?}", kept.rules_until_contact);
    let why = about.why.and_then(|why| why.last_chance).expect("a chance");
    let before_s = why.violated_s - why.at_s.expect("a last chance");
    let persistence = about.persistence.expect("variations");
    let (share, variations) = (100.0 * persistence.share(), persistence.variations.len());
    let beside: ReferenceDriver = BESIDE.parse().expect("a driver");
    let misses_m = known.handover[&beside].margin.expect("a gap");
    assert!(known.is_avoided_by(beside));
    vec![
        (known.who_avoids().expect("drivers"), "avoided by"),
        (
            format!(
                "losing speed {:.1} m/s",
                about.severity.expect("a contact").closing_speed_mps
            ),
            "losing speed",
        ),
        (format!("rules kept: {rules} of {rules}"), "rules kept"),
        (
            format!(
                "last chance: {} {before_s:.2} s before the failure",
                why.driver
            ),
            "last chance",
        ),
        (
            format!("still fails in {share:.0} % of {variations} variations"),
            "still fails in",
        ),
        (format!("n its place {} ", beside.words()), "n its place"),
        (format!("misses by {misses_m:.1} m"), "misses by"),
    ]
}

/// What of a text is not so by the labels of the file.
fn untrue(text: &str) -> Vec<String> {
    let facts = facts();
    let missing = facts.iter().filter(|(fact, begins)| {
        // As often as it is begun it is told, and at least once.
        let told = text.matches(fact.as_str()).count();
        told == 0 || told != text.matches(begins).count()
    });
    let mut untrue: Vec<String> = missing.map(|(fact, _)| fact.clone()).collect();
    let blames = ["careful driver", "careful human", "the ego's fault"];
    untrue.extend(
        blames
            .iter()
            .filter(|it| text.contains(*it))
            .map(|it| (*it).to_owned()),
    );
    untrue
}

/// The alternative text of the README's picture.
fn alt_text(readme: &str) -> &str {
    let before = readme.split("](docs/img/opening.svg)").next();
    let text = before.and_then(|text| text.rsplit("![").next());
    text.expect("a picture")
}

/// The words that stand on a picture, and those that it is read out with.
fn words_of(svg: &str) -> (String, String) {
    let title = svg
        .split("<title>")
        .nth(1)
        .and_then(|it| it.split("</title>").next());
    let said = svg.split("<text class=\"said").skip(1).filter_map(|it| {
        let text = it.split('>').nth(1)?;
        text.split('<').next()
    });
    (
        title.expect("a title").to_owned(),
        said.collect::<Vec<_>>().join(" "),
    )
}

#[test]
fn the_picture_of_the_readme_is_what_its_command_draws() {
    let readme = read(root().join("README.md"));
    let command = format!("brakecheck view {CRASH} -o crash.svg --beside {BESIDE}");
    assert!(readme.contains(&command) && readme.contains("docs/img/opening.svg"));
    let dir = scratch();
    let out = path(&dir, "crash.svg");
    let output = brakecheck(&["view", CRASH, "-o", &out, "--beside", BESIDE]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let drawn = read(&out);
    assert!(
        drawn == read(root().join("docs/img/opening.svg")),
        "docs/img/opening.svg is not what the command draws: run docs/pictures.sh"
    );
    for forbidden in ["<script", "foreignObject", "1999/xhtml", "var("] {
        assert!(!drawn.contains(forbidden), "{forbidden}");
    }
}

/// Inkscape 1.2 draws nothing for a `use` without the older namespace, and finds no
/// shape by a selector that begins with the root.
#[test]
fn programs_with_an_older_svg_find_every_shape_of_a_picture() {
    let drawn = read(root().join("docs/img/opening.svg"));
    let used: Vec<&str> = drawn
        .split("<use ")
        .skip(1)
        .map(|it| {
            let named = it
                .strip_prefix("xlink:href=\"#")
                .and_then(|it| it.split('"').next());
            named.expect("a shape in the older namespace")
        })
        .collect();
    // The road and both bodies, in both halves.
    assert!(used.len() >= 6, "{used:?}");
    for id in used {
        assert!(drawn.contains(&format!("id=\"{id}\"")), "{id}");
    }
    assert!(drawn.contains("xmlns:xlink=\"http://www.w3.org/1999/xlink\""));
    let style = drawn.split("</style>").next().expect("a style");
    for rule in style.split('}') {
        assert!(!rule.trim_start().starts_with("svg "), "{rule}");
    }
}

/// Whoever looks at the picture, or has its words read out, is told what the
/// file says: who avoids it, how fast, which rules, until when, how often.
#[test]
fn the_words_on_and_under_the_picture_follow_from_the_labels_of_the_file() {
    let readme = read(root().join("README.md"));
    let alt = alt_text(&readme).to_owned();
    let (title, drawn) = words_of(&read(root().join("docs/img/opening.svg")));
    for text in [&alt, &title, &drawn] {
        assert_eq!(untrue(text), Vec::<String>::new(), "{text}");
        // A planted word is found, wherever it stands.
        for (fact, begins) in facts() {
            for planted in [
                fact.replacen(begins, "", 1),
                format!("{begins} 7 of 9 (RSS)"),
            ] {
                let lie = text.replacen(&fact, &planted, 1);
                assert!(!untrue(&lie).is_empty(), "{lie}");
            }
        }
        let lie = format!("{text} A careful driver would have avoided it.");
        assert!(!untrue(&lie.replace("A careful", "a careful")).is_empty());
        assert!(!untrue(&format!("{text} It is avoided by all.")).is_empty());
    }
    // One who competes with no other: the competent driver, and most others.
    let known = kept().1.preventability.expect("drivers");
    assert!(known.is_avoided_by(ReferenceDriver::Cc) && known.drivers()[0].len() >= 4);
}

/// A run of another ego is told as what it is, not by the recorded one's labels.
#[test]
fn a_picture_of_another_ego_is_of_its_own_run() {
    let dir = scratch();
    let (out, ego) = (path(&dir, "x.svg"), path(&dir, "rss.ron"));
    std::fs::write(&ego, "Change(controller: RssDriver())").expect("written");
    let output = brakecheck(&["view", CRASH, "-o", &out, "--ego", &ego]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let drawn = read(&out);
    let (title, _) = words_of(&drawn);
    assert!(
        drawn.contains("Held: ρ ") && title.starts_with("The ego held, ρ "),
        "{title}"
    );
    assert!(
        title.contains("different from the recorded run from t = "),
        "{title}"
    );
    for failure in [
        "Contact at",
        "Broken:",
        "losing speed",
        "last chance",
        "the failure",
        "avoided by",
    ] {
        assert!(
            !title.contains(failure) && !drawn.contains(&format!(">{failure}")),
            "{failure}: {title}"
        );
    }
    let output = brakecheck(&["replay", CRASH, "--ego", &ego, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let row = json(&output)["rows"][0].clone();
    assert_eq!(
        (&row["identical"], &row["verdict"]),
        (&false.into(), &"held".into())
    );
    assert!(
        row["different_from_s"].is_number() && row["about"]["severity"].is_null(),
        "{row}"
    );
    let output = brakecheck(&["replay", CRASH, "--ego", &ego]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        said.contains("held: ρ ") && said.contains("different from the recorded run"),
        "{said}"
    );
    assert!(
        !said.contains("identical ") && !said.contains("rear-end"),
        "{said}"
    );
}

/// Big-endian number of 32 bits at a place of a file.
#[cfg(feature = "raster")]
fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

#[cfg(feature = "raster")]
#[test]
fn a_still_and_a_loop_have_the_size_of_the_picture() {
    let dir = scratch();
    let file = |name: &str| {
        let out = path(&dir, name);
        let output = brakecheck(&["view", CRASH, "-o", &out, "--beside", BESIDE]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        std::fs::read(out).expect("a file")
    };
    let svg = String::from_utf8(file("crash.svg")).expect("text");
    let size = svg
        .split("viewBox=\"0 0 ")
        .nth(1)
        .and_then(|it| it.split('"').next());
    let size: Vec<u32> = size
        .expect("a size")
        .split(' ')
        .map(|it| it.parse().expect("a number"))
        .collect();
    let png = file("crash.png");
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.ends_with(b"IEND\xaeB`\x82"));
    assert_eq!(
        (number(&png, 16), number(&png, 20)),
        (2 * size[0], 2 * size[1])
    );
    let gif = file("crash.GIF");
    assert!(gif.starts_with(b"GIF89a") && gif.ends_with(b";"));
    let sides = [6, 8].map(|at| u32::from(u16::from_le_bytes([gif[at], gif[at + 1]])));
    assert_eq!(sides[..], size[..]);
    // A loop of frames that begin with a control block each, in a file of bounded size.
    let has = |words: &[u8]| gif.windows(words.len()).filter(|it| *it == words).count();
    assert_eq!(has(b"NETSCAPE2.0"), 1);
    assert!(has(b"\x21\xf9\x04") > 40);
    assert!(gif.len() <= brakecheck::raster::MOST_GIF_BYTES);
}

#[test]
fn a_picture_says_what_it_cannot_show() {
    let dir = scratch();
    let svg = path(&dir, "x.svg");
    let pedestrian = "tests/regressions/pedestrian-nominal-0001.ron";
    let grid = "tests/regressions/grid-hard-nominal-cells-0-0000.ron";
    let [webp, bare] = [path(&dir, "x.webp"), path(&dir, "x")];
    let cases: [(&[&str], &str); 6] = [
        (&["view", CRASH, "-o", &webp], "a `.gif`, for a loop"),
        (&["view", CRASH, "-o", &bare], "name a `.rrd`"),
        (
            &["view", pedestrian, "-o", &svg, "--beside", "FSM"],
            "leave `--beside` out",
        ),
        (
            &["view", grid, "-o", &svg, "--beside", "CC"],
            "leave `--beside` out",
        ),
        (&["view", CRASH, "--beside", "FSM"], "`-o crash.svg`"),
        (&["view", CRASH, "-o", &svg, "--beside", "FMS"], "FSM"),
    ];
    for (args, says) in cases {
        refused(args, says);
        let written = std::fs::read_dir(dir.path()).expect("a directory").count();
        assert_eq!(written, 0, "{args:?}");
    }
    for kept in [pedestrian, grid] {
        let output = brakecheck(&["view", kept, "-o", &svg]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(read(&svg).ends_with("</svg>"));
    }
}
