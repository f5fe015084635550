//! `brakecheck drive`: a page in the browser, in which you drive.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;

use clap::Args;
use serde_json::json;

use super::common::{load_world, one_of, open_run, placed, print_json, with_consent};
use super::defaults::PLANT;
use super::display::is_quiet;
use super::failure::{Exit, Failure, plain_theme};
use super::headings::{OUTPUT, RUNNING, TEST};
use super::number_args::count;
use super::progress;
use super::run_under_test::is_world;
use super::terminal::{self, Common};
use super::test_args::PROGRAM;
use super::world_input::{self, ReadWorld};
use crate::drive::{DriveSettings, Reload, Reloaded, Sandbox, WatchedWorld, serve};
use crate::rl::Policy;
use crate::sim::PlantKind;
use crate::training::{TrainRequest, TrainSession};
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct DriveArgs {
    /// A world file, the name of a shipped world, or a run directory with a trained ado.
    #[arg(value_name = "WORLD|RUN")]
    what: PathBuf,
    /// Train an ado before, for N decisions on the kinematic plant, and drive against it
    /// [default: 20,000].
    // Without the equals sign, the world behind the option would be taken for the number.
    #[arg(
        long,
        value_name = "N",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "20_000",
        value_parser = count(1..=u64::MAX)
    )]
    train: Option<u64>,
    /// Your seat: the ego, or an ado, whose actions you choose.
    #[arg(long = "as", value_name = "ego|ADO", default_value = "ego")]
    seat: String,
    /// Load the world again when its file is saved, and show its problems on the page.
    #[arg(long)]
    watch: bool,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    /// Test start to begin with, from 0.
    #[arg(long, value_name = "INDEX", default_value_t = 0, value_parser = count(0..=999_999))]
    start: u64,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    /// The physics to drive in, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    /// Directory for the counterexamples that you keep.
    #[arg(long, value_name = "DIR", default_value = "driven", help_heading = OUTPUT)]
    keep: PathBuf,
    /// Port of the page on 127.0.0.1, 0 for any that is free.
    #[arg(long, value_name = "PORT", default_value_t = 0, help_heading = RUNNING)]
    port: u16,
    /// Print the address as one JSON object on stdout instead of a message.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
    /// Start the programs that the world's file names as egos.
    #[arg(long, help_heading = RUNNING)]
    allow_programs: bool,
    /// Program to choose as an ego, after `--`, which consents to start it.
    #[arg(last = true, value_name = "COMMAND", long_help = PROGRAM)]
    program: Vec<String>,
}

impl DriveArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            allow_programs: self.allow_programs,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &DriveArgs) -> Result<Exit, Failure> {
    // Before a training, so that a world that is saved during it is loaded again.
    let watch = watched(args)?;
    let Some(sandbox) = sandbox(args)? else {
        return Ok(Exit::Interrupted);
    };
    let sandbox = sandbox.with_program(&args.program);
    let settings = DriveSettings {
        keep: args.keep.clone(),
        seed: args.seed,
        // The parser allows fewer than a million, so the conversion never fails.
        index: usize::try_from(args.start).unwrap_or(usize::MAX),
        watch,
    };
    let ready = |address: &str| announce(args, address);
    let served = serve(
        sandbox,
        settings,
        args.port,
        terminal::stop(),
        &ready,
        &terminal::note,
    )?;
    terminal::note(&format!("the drive has ended after {} pages", served.pages));
    // Ctrl-C is how a drive ends, and nothing of it is lost.
    Ok(Exit::Done)
}

/// Returns the world with its players, or `None` if the training was interrupted.
fn sandbox(args: &DriveArgs) -> Result<Option<Sandbox>, Failure> {
    let common = args.common();
    // A path that does not exist is read as a world, whose error suggests shipped names.
    if is_world(&args.what) || !args.what.is_dir() {
        let world = load_world(&args.what, &common)?;
        let placed = placed(world.clone(), args.plant)?;
        let sandbox = Sandbox::new(placed, &args.seat)?;
        let Some(decisions) = args.train else {
            return Ok(Some(sandbox));
        };
        // The training takes the world of the file, because it chooses its plant itself.
        let policy = trained(&world, decisions, &common)?;
        return Ok(policy.map(|policy| sandbox.with_trained(policy)));
    }
    // A run has its ado already, and a second training would replace it silently.
    if args.train.is_some() {
        let what = args.what.display();
        return Err(Failure::input(
            format!("`--train` requires a world, and `{what}` is a run with a trained ado"),
            "leave `--train` out",
        ));
    }
    let run = open_run(&args.what, &common)?;
    let world = placed(run.scenario()?, args.plant)?;
    let policy = Arc::from(run.policy()?);
    let sandbox = Sandbox::new(world, &args.seat)?;
    Ok(Some(sandbox.with_trained(policy)))
}

/// Trains an ado for this drive only. `None`: interrupted.
fn trained(
    world: &Scenario,
    decisions: u64,
    common: &Common,
) -> Result<Option<Arc<dyn Policy>>, Failure> {
    // The directory vanishes with this function, and only the policy is used afterwards.
    let scratch = tempfile::tempdir().map_err(|error| {
        Failure::input(
            format!("cannot create a directory for the training: {error}"),
            "make room in the directory for temporary files",
        )
    })?;
    let request = TrainRequest {
        decisions: Some(decisions),
        // The kinematic plant is the faster one, and a driver waits for the training.
        plant: Some(PlantKind::Kinematic),
        ..TrainRequest::default()
    };
    let mut session = TrainSession::begin(world, &scratch.path().join("run"), &request)?;
    let bar = progress::bar(common, "");
    let trained = session.train(&bar.watch())?;
    drop(bar);
    // A half-trained ado would pass for the requested one on the page.
    if trained.interrupted {
        return Ok(None);
    }
    Ok(Some(Arc::from(session.run().policy()?)))
}

/// Returns the world's file to watch, if that is requested.
fn watched(args: &DriveArgs) -> Result<Option<WatchedWorld>, Failure> {
    if !args.watch {
        return Ok(None);
    }
    if !args.what.is_file() {
        let what = args.what.display();
        return Err(Failure::input(
            format!("`--watch` needs a world file, and `{what}` is none"),
            "copy a file of the folder `worlds`, or write one: `brakecheck new mine`",
        ));
    }
    let (path, common, plant) = (args.what.clone(), args.common(), args.plant);
    let load = move || {
        let ReadWorld { world, files } = world_input::read(&path);
        let on_plant = || placed(with_consent(world?, &common), plant);
        Reloaded {
            // On a page there are no colours of a terminal.
            world: on_plant().map_err(|it| it.render(plain_theme(), 100)),
            files,
        }
    };
    // A change of an included file alters the world, too.
    let files = world_input::read(&args.what).files;
    let reload: Reload = Box::new(load);
    Ok(Some(WatchedWorld::new(files, reload)))
}

fn announce(args: &DriveArgs, address: &str) {
    if args.json {
        // The page works also where nobody reads its address.
        let _ = print_json(&json!({ "address": address }));
    } else if is_quiet() {
        // The address is the answer.
        let _ = terminal::data(address);
    } else {
        terminal::note(&format!(
            "drive at {address} (Ctrl-C ends it; nobody without this address gets in)"
        ));
    }
    if args.open {
        open(address);
    }
}

/// Opens an address in the browser, and says so where that fails.
fn open(address: &str) {
    let command = match std::env::consts::OS {
        "macos" => "open",
        // `start` is built into the shell there, so it is no program to spawn.
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let failed = move |why: &str| {
        terminal::note(&format!("`{command}` {why}: open the address yourself"));
    };
    let opener = Command::new(command)
        .arg(address)
        // Its words are no part of this program's output.
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    match opener {
        Err(error) => failed(&format!("cannot be started ({error})")),
        // Some openers end with the browser only, so nobody waits for them here.
        Ok(mut opener) => {
            std::thread::spawn(move || match opener.wait() {
                // Windows' explorer has a code of its own for success.
                Ok(status) if status.success() || command == "explorer" => {}
                Ok(status) => failed(&format!("failed ({status})")),
                Err(error) => failed(&format!("cannot be waited for ({error})")),
            });
        }
    }
}
