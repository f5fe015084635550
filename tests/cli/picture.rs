//! Pictures that play by themselves: as the documents show them, and honest.

use super::{brakecheck, code, path, root, scratch, stderr};

const CRASH: &str = "tests/regressions/cut_in_clear-idm-0074.ron";

fn read(file: impl AsRef<std::path::Path>) -> String {
    let file = file.as_ref();
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

#[test]
fn the_picture_of_the_readme_is_what_its_command_draws() {
    let readme = read(root().join("README.md"));
    let command =
        "brakecheck view tests/regressions/cut_in_clear-idm-0074.ron -o crash.svg --beside FSM";
    assert!(readme.contains(command) && readme.contains("docs/img/opening.svg"));
    let dir = scratch();
    let out = path(&dir, "crash.svg");
    let output = brakecheck(&["view", CRASH, "-o", &out, "--beside", "FSM"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let drawn = read(&out);
    assert!(
        drawn == read(root().join("docs/img/opening.svg")),
        "docs/img/opening.svg is not what the command draws: run docs/pictures.sh"
    );
    // What README says of it is written on it.
    let caption = readme
        .split("docs/img/opening.svg")
        .next()
        .expect("a caption");
    let caption = caption.rsplit("![").next().expect("a caption");
    for number in caption
        .split_whitespace()
        .filter(|word| word.starts_with(|c: char| c.is_ascii_digit()))
    {
        let number = number.trim_end_matches([',', '.', ';', ']', '(']);
        assert!(
            drawn.contains(number),
            "{number} of the README is not on the picture"
        );
    }
    assert!(!drawn.contains("<script") && !drawn.contains("http://www.w3.org/1999"));
}

#[test]
fn a_picture_says_what_it_cannot_show() {
    let dir = scratch();
    let svg = path(&dir, "x.svg");
    let pedestrian = "tests/regressions/pedestrian-nominal-0001.ron";
    let grid = "tests/regressions/grid-hard-nominal-cells-0-0000.ron";
    let cases: [(&[&str], &str); 4] = [
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
        let output = brakecheck(args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(
            stderr(&output).contains(says),
            "{args:?}: {}",
            stderr(&output)
        );
        assert!(!std::path::Path::new(&svg).exists(), "{args:?}");
    }
    for kept in [pedestrian, grid] {
        let output = brakecheck(&["view", kept, "-o", &svg]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(read(&svg).ends_with("</svg>"));
    }
}
