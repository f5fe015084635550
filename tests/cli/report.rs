//! Reports: whole, well-formed, escaped, and honest about what is missing.

use std::path::Path;

use brakecheck::run_dir::RunDir;
use brakecheck::world::Scenario;

use super::{brakecheck, code, json, path, refused, root, scratch, small_run, stderr};

/// Elements of HTML that have no end.
const VOID: [&str; 4] = ["meta", "br", "input", "!DOCTYPE"];

/// Asserts that every element ends where it should; returns their names.
fn well_formed(text: &str) -> Vec<String> {
    let mut open: Vec<&str> = Vec::new();
    let mut names = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        assert!(!rest[..at].contains("\u{0}"));
        rest = &rest[at + 1..];
        let end = rest.find('>').expect("a tag ends");
        let tag = &rest[..end];
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in <{tag}>");
        assert!(!tag.contains('<'), "<{tag}>");
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}>");
        } else if !tag.starts_with('?') {
            let name = tag.split_whitespace().next().expect("a name");
            names.push(name.to_owned());
            if !VOID.contains(&name) && !tag.ends_with('/') {
                open.push(name);
            }
            // Neither holds elements.
            if ["style", "script"].contains(&name) {
                let end = rest.find(&format!("</{name}>")).expect("it ends");
                rest = &rest[end..];
            }
        }
    }
    assert!(open.is_empty(), "never ended: {open:?}");
    names
}

fn read(file: &str) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn count(names: &[String], name: &str) -> usize {
    names.iter().filter(|other| *other == name).count()
}

#[test]
fn a_report_is_one_page_that_needs_nothing_else() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let page = path(&dir, "page.html");
    let (other, _) = small_run(&dir, "other", &["--seed", "1"]);
    let output = brakecheck(&[
        "report", &run, "-o", &page, "--starts", "80", "--with", &other, "--json",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["report"], page);
    let html = read(&page);
    let names = well_formed(&html);
    assert_eq!(count(&names, "link") + count(&names, "img"), 0);
    // One script, in the page, that asks nobody for anything.
    assert_eq!(count(&names, "script"), 1);
    for asks in [
        "@import",
        "url(",
        " src=",
        "fetch",
        "XMLHttpRequest",
        "import(",
    ] {
        assert!(!html.contains(asks), "{asks}");
    }
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    let addresses = html.matches("http").count();
    assert_eq!(
        addresses,
        html.matches("http://www.w3.org/2000/svg").count()
    );
    for word in [
        "Which starts fail",
        "Most informative counterexamples",
        "always[0, T] (headway &gt;= d_safe)",
        "softer brakes",
        "fouls before contact",
        "seed 1",
        "--expect recorded",
        "fails on",
    ] {
        assert!(html.contains(word), "{word}");
    }
    // The command at the end makes this very page.
    let made = html.find("brakecheck report ").expect("the command");
    let made = html[made..].lines().next().expect("a line");
    let words: Vec<&str> = made.split_whitespace().skip(1).collect();
    let again = brakecheck(&words);
    assert_eq!(code(&again), 0, "{made}: {}", stderr(&again));
    assert!(read(&page) == html, "{made}");
    // Three axes of starts give three maps; then histogram, two of training.
    assert!(count(&names, "svg") >= 6, "{}", count(&names, "svg"));
    let junit = read(&path(&dir, "page.junit.xml"));
    let names = well_formed(&junit);
    // One case per start of the trained ado; a baseline is none.
    let listing = json(&brakecheck(&["check", "worlds/acc.ron", "--json"]));
    let egos = listing["egos"].as_array().expect("egos").len();
    let (cases, failures) = (count(&names, "testcase"), count(&names, "failure"));
    assert!(egos * 18 <= cases && failures > 0, "{cases} {failures}");
    assert_eq!(junit.matches(", start ").count(), cases);
    assert!(!junit.contains("ado hold") && junit.contains("headway &gt;= d_safe"));
}

/// The lines of a run's page from the command that trains it again.
fn training_lines(dir: &tempfile::TempDir, run: &str) -> Vec<String> {
    let page = path(dir, "again.html");
    let output = brakecheck(&["report", run, "-o", &page, "--starts", "5"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let html = read(&page);
    let begin = format!("brakecheck train {run}/world.ron ");
    let at = html.find(&begin).expect("the command");
    let lines = html[at..].lines().map(str::to_owned);
    lines
        .take_while(|line| !line.starts_with("brakecheck eval"))
        .collect()
}

#[test]
fn the_training_of_a_page_is_repeated_by_its_command_or_the_page_says_what_is_missing() {
    let dir = scratch();
    let train = |run: &str, more: &[&str]| {
        let head = ["train", "worlds/acc.ron", "-o", run, "--plant", "kinematic"];
        let short = ["--decisions", "600", "--starts", "5"];
        let output = brakecheck(&[&head[..], &short[..], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    };
    let policy = |run: &str| std::fs::read(Path::new(run).join("policy.safetensors"));
    let (limited, again) = (path(&dir, "limited"), path(&dir, "again"));
    train(&limited, &["--natural", "20", "--goal", "severe"]);
    let lines = training_lines(&dir, &limited);
    assert_eq!(lines.len(), 1, "{lines:?}");
    assert!(
        lines[0].ends_with("--goal severe --traffic motorway --natural 20"),
        "{lines:?}"
    );
    let mut words: Vec<&str> = lines[0].split_whitespace().skip(1).collect();
    let at = words.iter().position(|word| *word == "-o").expect("a run");
    words[at + 1] = &again;
    let output = brakecheck(&words);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(
        policy(&again).expect("a policy"),
        policy(&limited).expect("a policy")
    );

    let tuned = path(&dir, "tuned");
    train(&tuned, &["--from", &limited, "--ego", "softer brakes"]);
    let lines = training_lines(&dir, &tuned);
    assert!(lines[0].contains("--ego 'softer brakes'"), "{lines:?}");
    let said = lines.join("\n");
    for part in [
        "# This command alone does not repeat the training",
        "--from RUN",
        "tuned/from.safetensors (SHA-256 ",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(lines.len(), 3, "{said}");
}

/// The numbers after a word, wherever it stands on a page.
fn numbers_after(html: &str, word: &str) -> Vec<f64> {
    let after = html.split(word).skip(1);
    let number = |rest: &str| -> Option<f64> {
        let end = rest.find(|c: char| c != '.' && !c.is_ascii_digit())?;
        rest[..end].parse().ok()
    };
    after.filter_map(number).collect()
}

#[test]
fn counterexamples_are_shown_moving_the_worst_first() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let few = ["--starts", "80", "--reuse-starts", "5", "--scenarios"];
    let output = brakecheck(&[&["report", &run][..], &few].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let html = read(&format!("{run}/report.html"));
    let shown = html.matches("<figure class=\"film\"").count();
    assert!(shown >= 2, "{shown}");
    assert_eq!(html.matches("data-film=").count(), shown);
    // Each is linked as three files beside the page, which are there.
    let links: Vec<&str> = html
        .split("href=\"report.scenarios/")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert_eq!(links.len(), 3 * shown, "{links:?}");
    for link in links {
        well_formed(&read(&format!("{run}/report.scenarios/{link}")));
    }
    // Of one kind of contact a higher Δv is a higher risk.
    let risks = numbers_after(&html, "MAIS 3+ of the ego's occupants: ");
    assert!(risks.len() >= 2, "{risks:?}");
    assert!(risks.is_sorted_by(|a, b| b <= a), "{risks:?}");
    for word in [
        "The ego hit the rear of ado at ",
        "every rule kept",
        "k-contact",
        "k-broken",
    ] {
        assert!(html.contains(word), "{word}");
    }
}

#[test]
fn whatever_a_world_says_is_escaped() {
    let dir = scratch();
    let world = path(&dir, "hostile.ron");
    let text = read(&root().join("worlds/acc.ron").display().to_string());
    let hostile = text
        .replace(
            "question: \"Can",
            "question: \"<script>alert('&')</script> \\\"x\\\" Can",
        )
        .replace(
            "keeps the speed limit",
            "</pre></main><u onclick=\\\"x\\\">&",
        )
        .replace("\"wet road\"", "\"<i>]]> wet\\u{1} & road\"")
        .replace("decisions: 300_000", "decisions: 4_000");
    std::fs::write(&world, hostile).expect("written");
    let run = path(&dir, "run");
    let output = brakecheck(&[
        "train",
        &world,
        "-o",
        &run,
        "--plant",
        "kinematic",
        "--starts",
        "20",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = brakecheck(&["report", &run, "--starts", "30", "--reuse-starts", "10"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let html = read(&format!("{run}/report.html"));
    let names = well_formed(&html);
    assert_eq!(
        // The page's own script, and marks of moments over the lanes.
        (
            count(&names, "script") <= 1,
            count(&names, "u"),
            html.matches("<i>").count()
        ),
        (true, 0, 0)
    );
    assert!(html.contains("&lt;script&gt;alert("));
    let junit = read(&format!("{run}/report.junit.xml"));
    well_formed(&junit);
    assert!(junit.contains("&lt;i&gt;") && !junit.contains('\u{1}'));
}

#[test]
fn what_is_missing_is_said() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    // Killed before the first checkpoint: no policy, a line cut short.
    let begun = path(&dir, "begun");
    let world = Scenario::load(&root().join("worlds/acc.ron")).expect("a world");
    RunDir::create(Path::new(&begun), &world, 0).expect("a run");
    std::fs::write(Path::new(&begun).join("progress.jsonl"), "{\"decisions\":1").expect("written");
    // A page of nothing is written, but it is no success.
    let output = brakecheck(&["report", &begun]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("nothing was evaluated") && said.contains("--resume"));
    let html = read(&format!("{begun}/report.html"));
    well_formed(&html);
    assert!(html.contains("is not finished") && html.contains("No progress is recorded"));
    well_formed(&read(&format!("{begun}/report.junit.xml")));

    // An ado that never succeeds, and rows from elsewhere.
    let rows = path(&dir, "rows.json");
    std::fs::write(&rows, "{\"rows\": []}").expect("written");
    let output = brakecheck(&[
        "report", &run, "--starts", "1", "--seed", "5", "--rows", &rows,
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    std::fs::write(&rows, "[1, 2]").expect("written");
    refused(&["report", &run, "--rows", &rows], "holds no rows");
    // A sweep is shown beside the rows, unless its counts contradict each other.
    let swept = |failing: usize| {
        let point = format!(r#"{{"value": 0.5, "starts": 4, "failing": {failing}}}"#);
        let swept = format!(
            r#"{{"parameter": "<b>gap", "points": [{point}], "safe_from": null, "safe_up_to": null}}"#
        );
        std::fs::write(&rows, format!(r#"{{"rows": [], "swept": {swept}}}"#)).expect("written");
    };
    swept(5);
    refused(
        &["report", &run, "--rows", &rows],
        "more failing starts than starts at",
    );
    swept(1);
    let output = brakecheck(&["report", &run, "--starts", "1", "--rows", &rows]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let html = read(&format!("{run}/report.html"));
    well_formed(&html);
    assert!(html.contains("&lt;b&gt;gap = 0.5: 1 of 4 starts fail, 25 % ["));
    let output = brakecheck(&["report", &run, "--with", &path(&dir, "none")]);
    assert_eq!(code(&output), 2);
}

#[test]
fn a_grid_is_reported_too() {
    let dir = scratch();
    let run = path(&dir, "grid");
    let output = brakecheck(&[
        "train",
        "worlds/grid.ron",
        "-o",
        &run,
        "--decisions",
        "6000",
        "--starts",
        "60",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let page = path(&dir, "grid.html");
    let output = brakecheck(&[
        "report",
        &run,
        "-o",
        &page,
        "--starts",
        "240",
        "--reuse-starts",
        "30",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let html = read(&page);
    well_formed(&html);
    assert!(html.contains("d_man") && html.contains("10 x 10"));
}

#[test]
fn a_break_even_is_compared_on_its_own_starts_and_says_when_it_is_a_bound() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let mut search = vec!["search", &run, "--method", "hold", "--budget", "2"];
    search.extend(["--starts", "30", "--plant", "kinematic", "--json"]);
    let searched = brakecheck(&search);
    assert_eq!(code(&searched), 0, "{}", stderr(&searched));
    let even = json(&searched)["break_even"][0].clone();
    assert_eq!(even["matched"], false, "two simulations are few: {even}");
    let rows = path(&dir, "rows.json");
    std::fs::write(&rows, &searched.stdout).expect("written");
    let reported = brakecheck(&["report", &run, "--starts", "50", "--rows", &rows]);
    assert_eq!(code(&reported), 0, "{}", stderr(&reported));
    let page = read(&format!("{run}/report.html"));
    well_formed(&page);
    let costs = &page[page.find("What it costs").expect("the costs")..];
    let percent = |of: &str| {
        let share = even[of]["success_rate"].as_f64().expect("a rate");
        format!("{:.1} %", 100.0 * share)
    };
    for of in ["ado", "search"] {
        assert!(costs.contains(&percent(of)), "{of}: {}", percent(of));
    }
    let starts = even["starts"].as_f64().expect("starts");
    assert!(costs.contains(&format!("at most {starts:.0}")), "{starts}");
    // The given rows are of another ego, so the page plays its own.
    let asked = ["report", &run, "--starts", "4", "--rows", &rows];
    let reported = brakecheck(&[&asked[..], &["--ego", "wet road"]].concat());
    assert_eq!(code(&reported), 0, "{}", stderr(&reported));
    let junit = read(&format!("{run}/report.junit.xml"));
    let cases = junit.matches("ego wet road against ado").count();
    assert_eq!(cases, 4, "{junit}");
}

/// The nominal ego fails from two of these points by itself, the other ego from three.
#[test]
fn every_ego_of_a_page_about_points_leaves_out_its_own_failures() {
    let dir = scratch();
    let world = path(&dir, "points.ron");
    let text = read(&root().join("worlds/acc.ron").display().to_string());
    let points = "points: (axes: [\"ego.speed\", \"ado.headway\", \"ado.speed\"], rows: [[25.0, 8.0, \
                  5.0], [10.0, 40.0, 20.0], [25.0, 44.0, 5.0], [25.0, 50.0, 5.0]]), agents: [";
    let text =
        text.replacen("agents: [", points, 1)
            .replacen("plant: Rigid", "plant: Kinematic", 1);
    std::fs::write(&world, text).expect("written");
    let ego = path(&dir, "weak.ron");
    std::fs::write(&ego, "Change(ego: (max_brake_mps2: 2.0))").expect("written");
    let (run, page) = (path(&dir, "run"), path(&dir, "page.html"));
    let few = ["--decisions", "3000", "--starts", "4"];
    let trained = brakecheck(&[&["train", &world, "-o", &run][..], &few].concat());
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let report = brakecheck(&["report", &run, "--ego", &ego, "-o", &page, "--starts", "4"]);
    assert_eq!(code(&report), 0, "{}", stderr(&report));
    let html = read(&page);
    for (ego, starts) in [("nominal", "/2)"), ("weak.ron", "/1)")] {
        let mut rows = html
            .split("<tr")
            .filter(|row| row.contains(&format!("{ego}</td>")) && row.contains(">hold</td>"));
        let row = rows.next().expect("a row of held actions");
        assert!(row.contains(starts), "{ego}: {row}");
    }
}
