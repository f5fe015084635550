//! Ctrl-C in the middle of a search: counts with bounds, and what was found is kept.

use std::process::{Command as Process, Stdio};

use super::{json, path, root, scratch};

/// Never brakes, and presses Ctrl-C at the beginning of its thirtieth episode.
const IMPATIENT: &str = r#"
import json, os, signal, sys, time
episodes = 0
for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        answer = {"hello": {"protocol": 1, "name": "impatient"}}
    elif "reset" in message:
        episodes += 1
        if episodes == 30:
            while not os.path.exists(sys.argv[1]):
                time.sleep(0.001)
            os.kill(int(open(sys.argv[1]).read()), signal.SIGINT)
        answer = {"id": message["id"], "ready": True}
    elif "step" in message:
        answer = {"id": message["id"], "accel_mps2": 0.5}
    else:
        break
    print(json.dumps(answer), flush=True)
"#;

#[cfg(unix)]
#[test]
fn an_interrupted_search_states_bounds_and_keeps_what_it_found() {
    let dir = scratch();
    let (program, pid) = (path(&dir, "impatient.py"), path(&dir, "pid"));
    std::fs::write(&program, IMPATIENT).expect("written");
    let ego = path(&dir, "impatient.ron");
    let change = format!(
        "Change(controller: Some(Process(command: [\"python3\", {program:?}, {pid:?}], \
         timeout_s: 60.0)))"
    );
    std::fs::write(&ego, change).expect("written");
    let kept = path(&dir, "kept");
    let keep = format!("{kept},most=2");
    let search = "search acc --plant kinematic --method hold --budget 12 --starts 16 --jobs 1 \
                  --json --allow-programs";
    let child = Process::new(assert_cmd::cargo::cargo_bin("brakecheck"))
        .current_dir(root())
        .args(search.split(' ').filter(|word| !word.is_empty()))
        .args(["--ego", &ego, "--keep", &keep])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    // Renamed, so that the program never reads half of it.
    let written = path(&dir, "pid.new");
    std::fs::write(&written, child.id().to_string()).expect("written");
    std::fs::rename(&written, &pid).expect("renamed");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{said}");
    let row = json(&output)["rows"][0].clone();
    let count = |key: &str| row[key].as_u64().expect("a count");
    let (decided, of) = (&row["partial"]["decided"], &row["partial"]["of"]);
    let (decided, of) = (decided.as_u64().expect("some"), of.as_u64().expect("all"));
    assert!(decided < of && of <= 16, "{row}");
    assert!(row["ci95"].is_null() && row["anytime"].is_null(), "{row}");
    let least = count("successes") as f64 / of as f64;
    assert_eq!(row["success_rate"].as_f64(), Some(least));
    assert!(count("successes") > 0, "{row}");
    let files = std::fs::read_dir(&kept).expect("kept");
    let names = files.map(|file| file.expect("an entry").file_name());
    let crashes = names.filter(|name| name.to_string_lossy().ends_with(".ron"));
    assert!(crashes.count() > 0, "{said}");
    assert!(said.contains("kept as found"), "{said}");
}
