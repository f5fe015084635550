//! The bridge to CARLA against a stub of CARLA's documented Python interface.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

use super::{code, path, root, scratch, stderr};

/// Place of the world's origin in the axes of OpenDRIVE, y to the left.
const ORIGIN: [f64; 3] = [120.0, -40.0, 0.6];
const HEIGHT_M: f64 = 12.0;
const GRADE: f64 = 0.03;

/// A run of the bridge, and what CARLA and brakecheck saw of it.
struct Bridged {
    output: Output,
    /// Frames of CARLA, and the state in which it was left.
    frames: Vec<Value>,
    left: Value,
    /// Messages to brakecheck and its answers, without `hello`.
    sent: Vec<Value>,
    answered: Vec<Value>,
}

/// Returns the world of the tests, with or without its place in CARLA's map.
fn world(dir: &tempfile::TempDir, name: &str, has_origin: bool) -> String {
    let [x_m, y_m, heading_rad] = ORIGIN;
    let origin = format!(
        "origin: (file: \"Stub.xodr\", x_m: {x_m}, y_m: {y_m}, z_m: {HEIGHT_M}, heading_rad: {heading_rad}),"
    );
    let origin = if has_origin { origin } else { String::new() };
    let text =
        std::fs::read_to_string(root().join(format!("worlds/{name}.ron"))).expect("the world");
    let text = text
        .replacen("plant: Rigid", "plant: Kinematic", 1)
        .replacen(
            "    agents: [",
            &format!("    {origin} grades: [(0.0, {GRADE})],\n    agents: ["),
            1,
        );
    let file = path(dir, &format!("{name}.ron"));
    std::fs::write(&file, text).expect("written");
    file
}

fn lines(file: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let lines = text.lines().map(serde_json::from_str);
    lines.collect::<Result<_, _>>().expect("JSON lines")
}

/// Runs a bridge with these arguments behind its world. `stub` adds to CARLA's settings.
fn bridged(bridge: &str, world: &str, args: &[&str], stub: &Value) -> Bridged {
    let dir = scratch();
    let (log, sent, answered) = (
        path(&dir, "carla.jsonl"),
        path(&dir, "sent.jsonl"),
        path(&dir, "answered.jsonl"),
    );
    let [x_m, y_m, heading_rad] = ORIGIN;
    let mut carla = json!({
        "log": log, "x": x_m, "y": -y_m, "z": HEIGHT_M, "yaw": -heading_rad.to_degrees(), "grade": GRADE,
    });
    let settings = carla.as_object_mut().expect("an object");
    settings.extend(stub.as_object().expect("an object").clone());
    // What goes through the pipes is on the disk, too. The shell holds neither end of them.
    let program = path(&dir, "brakecheck");
    let script = format!(
        "#!/bin/sh\nexec 3<&0\ntee '{sent}' <&3 | '{}' \"$@\" | tee '{answered}' 3<&- &\n\
         exec >&- 3<&-\nwait\n",
        env!("CARGO_BIN_EXE_brakecheck")
    );
    std::fs::write(&program, script).expect("written");
    let file = path(&dir, "bridge.py");
    std::fs::write(&file, bridge).expect("written");
    let output = Command::new("python3")
        .arg(&file)
        .arg(world)
        .args(args)
        .env("PYTHONPATH", root().join("tests/data/carla"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("CARLA_STUB", carla.to_string())
        .env("BRAKECHECK", run_by_sh(&program))
        .output()
        .expect("python3");
    let mut frames = lines(&log);
    let last = frames.pop().unwrap_or_default();
    let without_hello = |file: &str| lines(file).into_iter().skip(1).collect();
    Bridged {
        output,
        frames,
        left: last["left"].clone(),
        sent: without_hello(&sent),
        answered: without_hello(&answered),
    }
}

/// Makes a script executable, and returns its path.
fn run_by_sh(program: &str) -> &Path {
    use std::os::unix::fs::PermissionsExt;
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(program, executable).expect("its permissions");
    Path::new(program)
}

fn bridge() -> String {
    std::fs::read_to_string(root().join("examples/cosim/carla_bridge.py")).expect("the bridge")
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or(f64::NAN)
}

fn close(seen: f64, wanted: f64, what: &str) -> Result<(), String> {
    if (seen - wanted).abs() < 1e-6 {
        return Ok(());
    }
    Err(format!("{what}: {seen} instead of {wanted}"))
}

/// The state that brakecheck must get of an actor, from CARLA's own numbers.
fn state_of(actor: &Value) -> [(&'static str, f64); 6] {
    let [x_m, y_m, heading_rad] = ORIGIN;
    let yaw_rad = number(actor, "yaw").to_radians();
    let front_m = number(actor, "front");
    // In CARLA's axes, y to the right.
    let to_m = [
        number(actor, "x") + front_m * yaw_rad.cos() - x_m,
        number(actor, "y") + front_m * yaw_rad.sin() + y_m,
    ];
    let ahead = [heading_rad.cos(), -heading_rad.sin()];
    let right = [heading_rad.sin(), heading_rad.cos()];
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let velocity = [number(actor, "vx"), number(actor, "vy")];
    let turn_rad_per_s = -number(actor, "turn").to_radians();
    let to_the_right_mps = dot(velocity, [-yaw_rad.sin(), yaw_rad.cos()]);
    [
        ("x_m", dot(to_m, ahead)),
        ("y_m", -dot(to_m, right)),
        ("heading_rad", -yaw_rad - heading_rad),
        ("speed_mps", dot(velocity, [yaw_rad.cos(), yaw_rad.sin()])),
        ("lateral_mps", turn_rad_per_s * front_m - to_the_right_mps),
        ("yaw_rate_rad_per_s", turn_rad_per_s),
    ]
}

/// Returns the first difference between a body of brakecheck and its actor in CARLA.
fn is_there(body: &Value, actor: &Value) -> Result<(), String> {
    for (key, seen) in state_of(actor).into_iter().take(3) {
        close(seen, number(body, key), key)?;
    }
    let [x_m, y_m, heading_rad] = ORIGIN;
    let along_m = (number(actor, "x") - x_m) * heading_rad.cos()
        - (number(actor, "y") + y_m) * heading_rad.sin();
    let lift_m = number(actor, "lift");
    close(number(actor, "z"), HEIGHT_M + GRADE * along_m + lift_m, "z")?;
    // CARLA lifts the front by a positive pitch, and brakecheck lowers it.
    close(
        number(actor, "pitch"),
        -number(body, "pitch_rad").to_degrees(),
        "pitch",
    )?;
    close(
        number(actor, "roll"),
        number(body, "roll_rad").to_degrees(),
        "roll",
    )?;
    // Along the road its front is higher, and across it a side.
    if number(body, "pitch_rad").hypot(number(body, "roll_rad")) < 0.9 * GRADE {
        return Err(format!("{body} is not on a slope"));
    }
    Ok(())
}

/// Returns what a bridge does wrong, from all that CARLA and brakecheck saw.
fn flaw(it: &Bridged, step_s: f64, starts: usize) -> Result<(), String> {
    let said = stderr(&it.output);
    if it.left
        != json!({ "synchronous": false, "managers": [false], "actors": 0, "ticks": it.left["ticks"] })
    {
        return Err(format!("CARLA is left as {}: {said}", it.left));
    }
    if code(&it.output) != 0 {
        return Err(said);
    }
    let driven = it.frames.iter().filter(|frame| {
        let actors = frame["actors"].as_array().into_iter().flatten();
        let mut heroes = actors.filter(|actor| actor["role"] == "hero");
        heroes.any(|actor| actor["autopilot"] == true)
    });
    let mut driven = driven.map(|frame| frame["actors"].as_array().expect("a list"));
    let (mut before, mut resets) = (&Value::Null, 0);
    for (sent, answer) in it.sent.iter().zip(&it.answered) {
        if sent.get("reset").is_some() {
            close(number(answer, "step_s"), step_s, "step_s")?;
            resets += 1;
        }
        if let Some(ego) = sent.get("sample").map(|it| &it["ego"]) {
            let actors = driven.next().ok_or("a sample without a tick")?;
            let of = |role: &str| actors.iter().find(|actor| actor["role"] == role);
            let (hero, ado) = (of("hero").ok_or("no hero")?, of("ado").ok_or("no ado")?);
            for (key, wanted) in state_of(hero) {
                close(number(ego, key), wanted, &format!("the ego's {key}"))?;
            }
            let begun_mps = number(&before["bodies"]["ego"], "speed_mps");
            if before["ready"] == true && (number(ego, "speed_mps") - begun_mps).abs() > 0.5 {
                return Err(format!("the ego begins at {begun_mps} m/s: {ego}"));
            }
            // A body appears with the tick after brakecheck placed it.
            is_there(&before["bodies"]["ado"], ado).map_err(|why| format!("the ado's {why}"))?;
            if [&hero["physics"], &ado["physics"]] != [true, false] {
                return Err("physics of the ado, or none of the ego".to_owned());
            }
        }
        before = answer;
    }
    if resets != starts || driven.next().is_some() || it.sent.len() != it.answered.len() {
        return Err(format!("{resets} episodes, or ticks without a sample"));
    }
    let stdout = String::from_utf8_lossy(&it.output.stdout);
    let last = stdout.lines().last().unwrap_or_default();
    if !last.ends_with(&format!("of {starts} starts, every rule judged")) {
        return Err(format!("no verdicts: {stdout}"));
    }
    Ok(())
}

#[test]
fn carla_shows_what_brakecheck_moves_and_is_left_as_it_was() {
    let dir = scratch();
    let world = world(&dir, "cut_in", true);
    for (step_s, args) in [
        (0.05, &["--starts", "2", "--ado", "search"][..]),
        (
            0.01,
            &["--starts", "1", "--ado", "search", "--step", "0.01"],
        ),
        (0.05, &["--starts", "1", "--ado", "random"]),
    ] {
        let starts = args[1].parse().expect("a number");
        let it = bridged(&bridge(), &world, args, &json!({}));
        assert_eq!(flaw(&it, step_s, starts), Ok(()), "{args:?}");
        let moved = it.answered.iter().any(|it| {
            let heading_rad = number(&it["bodies"]["ado"], "heading_rad");
            heading_rad.abs() > 0.01
        });
        assert!(moved, "the ado does not turn");
    }
    // A walker, whose origin is in its middle.
    let world = self::world(&dir, "pedestrian", true);
    let args = ["--starts", "1", "--ado", "random"];
    let it = bridged(&bridge(), &world, &args, &json!({}));
    assert_eq!(flaw(&it, 0.05, 1), Ok(()));
    let actors = it.frames[0]["actors"].as_array().expect("a list");
    let mut kinds = actors.iter().filter_map(|actor| actor["type_id"].as_str());
    assert!(kinds.any(|it| it == "walker.pedestrian.0015"), "{actors:?}");
}

/// Faults against CARLA's documentation, each as a change of the bridge's text.
const FAULTS: [(&str, &str); 21] = [
    // A transform before the first tick is zero.
    (
        "        self.world.tick()  # before it, CARLA reports zeros\n",
        "",
    ),
    // Synchronous mode and actors outlive the program, also where it fails.
    ("            world.apply_settings(before)\n", ""),
    (
        "            before.synchronous_mode = False\n            manager",
        "            before.synchronous_mode = True\n            before.fixed_delta_seconds = 0.05\n            manager",
    ),
    ("            manager.set_synchronous_mode(False)\n", ""),
    ("            bodies.destroy()\n", "            pass\n"),
    ("    manager.set_synchronous_mode(True)\n", ""),
    (
        "settings.synchronous_mode, settings.fixed_delta_seconds = True, step_s",
        "settings.synchronous_mode = True",
    ),
    (
        "        location.z = the_map.get_waypoint(location).transform.location.z + lift_m\n",
        "",
    ),
    ("RAISED_M = 0.3", "RAISED_M = 0.0"),
    // Boxes are those of the blueprint, by half sizes around a centre.
    (
        "box.location.x + box.extent.x\n",
        "0.5 * agent[\"length_m\"]\n",
    ),
    (
        "box.location.x + box.extent.x\n",
        "box.location.x + 2.0 * box.extent.x\n",
    ),
    ("box.location.x + box.extent.x\n", "box.extent.x\n"),
    (
        "sorted(library.filter(\"walker.pedestrian.*\" if agent[\"on_foot\"] else model), key=lambda it: it.id)",
        "[library.find(\"vehicle.tesla.model3\")]",
    ),
    // Axes are left-handed, and angles degrees.
    (
        "location = carla.Location(x_m, -y_m, 0.0)",
        "location = carla.Location(x_m, y_m, 0.0)",
    ),
    (
        "yaw=-math.degrees(self.heading_rad + heading_rad)",
        "yaw=-(self.heading_rad + heading_rad)",
    ),
    (
        "pitch=-math.degrees(body[\"pitch_rad\"])",
        "pitch=math.degrees(body[\"pitch_rad\"])",
    ),
    (
        "turn_rad_per_s = -math.radians(actor.get_angular_velocity().z)",
        "turn_rad_per_s = -actor.get_angular_velocity().z",
    ),
    (
        "turn_rad_per_s = -math.radians(actor.get_angular_velocity().z)",
        "turn_rad_per_s = math.radians(actor.get_angular_velocity().z)",
    ),
    // A target velocity takes two frames, in which the ego leaves its start.
    (
        "            self.world.tick()\n            if abs(self.place.state(ego, 0.0)[\"speed_mps\"] - speed_mps) < 0.5:\n",
        "            if True:\n",
    ),
    (
        "does not get to its speed of {speed_mps:.1f} m/s\")\n        self.move(bodies, self.actors)\n",
        "does not get to its speed of {speed_mps:.1f} m/s\")\n",
    ),
    (
        "actor.set_simulate_physics(name == self.ego)",
        "actor.set_simulate_physics(True)",
    ),
];

#[test]
fn a_bridge_that_breaks_the_documentation_of_carla_is_found() {
    let dir = scratch();
    let world = world(&dir, "cut_in", true);
    let whole = bridge();
    for (right, wrong) in FAULTS {
        assert_eq!(whole.matches(right).count(), 1, "{right}");
        let faulty = whole.replacen(right, wrong, 1);
        let it = bridged(&faulty, &world, &["--starts", "1"], &json!({}));
        let found = flaw(&it, 0.05, 1);
        assert!(found.is_err(), "`{right}` as `{wrong}` is not found");
    }
}

/// A program that fails leaves no synchronous mode and no actors behind.
#[test]
fn carla_is_left_as_it_was_where_the_bridge_fails() {
    let dir = scratch();
    let world = world(&dir, "cut_in", true);
    let whole = bridge();
    let not_finally = |at: &str, indent: &str| {
        let wrong = format!("{indent}except ZeroDivisionError:\n{indent}    pass\n{indent}else:\n");
        assert_eq!(whole.matches(at).count(), 1, "{at}");
        whole.replacen(at, &wrong, 1)
    };
    let settings = not_finally(
        "        finally:  # in synchronous mode, CARLA waits for ticks that nobody sends any more\n",
        "        ",
    );
    let actors = not_finally(
        "        finally:  # CARLA keeps the actors of a program that ends\n",
        "        ",
    );
    let left = |bridge: &str| {
        let it = bridged(
            bridge,
            &world,
            &["--starts", "1"],
            &json!({ "fails_at": 30 }),
        );
        assert!(
            stderr(&it.output).contains("time-out"),
            "{}",
            stderr(&it.output)
        );
        (it.left["synchronous"].clone(), it.left["actors"].clone())
    };
    assert_eq!(left(&whole), (json!(false), json!(0)));
    // Without `finally` only a good run would clean up.
    assert_eq!(left(&settings), (json!(true), json!(0)));
    assert_eq!(left(&actors), (json!(false), json!(2)));
}

#[test]
fn the_bridge_refuses_what_does_not_fit_carlas_map() {
    let dir = scratch();
    let placed = world(&dir, "cut_in", true);
    let other = scratch();
    let nowhere = world(&other, "cut_in", false);
    let none = json!({});
    let (yaw_deg, far) = ((-ORIGIN[2]).to_degrees().to_string(), "9000");
    let turned = (90.0 - ORIGIN[2].to_degrees()).to_string();
    let here = [ORIGIN[0].to_string(), (-ORIGIN[1]).to_string()];
    for (world, args, stub, says) in [
        (
            &nowhere,
            vec![],
            &none,
            "this world has no `origin` in a road file: give --origin",
        ),
        (
            &placed,
            vec!["--origin", &here[0], far, &yaw_deg],
            &none,
            "is on no lane of the map Stub",
        ),
        (
            &placed,
            vec!["--origin", &here[0], &here[1], &turned],
            &none,
            "the lane at the world's origin has a yaw of",
        ),
        (
            &placed,
            vec!["--step", "0.25"],
            &none,
            "CARLA needs a step of 0.1 s at most",
        ),
        (
            &placed,
            vec!["--step", "0.03"],
            &none,
            "give 0.25 / n, such as 0.025",
        ),
        (
            &placed,
            vec!["--model", "vehicle.tesla.*"],
            &none,
            "CARLA has no blueprint `vehicle.tesla.*` for `ado`",
        ),
        (
            &placed,
            vec!["--ado", "trained"],
            &none,
            "a trained ado requires its run",
        ),
        (
            &placed,
            vec![],
            &json!({ "blocked": true }),
            "CARLA has no room for `ego`",
        ),
    ] {
        let it = bridged(&bridge(), world, &args, stub);
        let said = stderr(&it.output);
        assert_eq!(code(&it.output), 1, "{args:?}: {said}");
        assert!(said.contains(says), "{args:?}: {said}");
        assert_eq!(it.left["synchronous"], false, "{args:?}");
        assert_eq!(it.left["actors"], 0, "{args:?}");
    }
    // The place of a world without an origin is an argument.
    let origin = ["--starts", "1", "--origin", &here[0], &here[1], &yaw_deg];
    let it = bridged(&bridge(), &nowhere, &origin, &none);
    assert_eq!(flaw(&it, 0.05, 1), Ok(()));
}
