//! Options that `eval`, `gate` and `sweep` share.

use std::num::NonZeroU64;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::answer::AnswerArgs;
use super::common::one_of;
use super::defaults::PLANT;
use super::headings::{ADOS, TEST};
use super::keep::KeepArgs;
use super::live::RerunArgs;
use super::number_args::{STARTS, count, start_count, switch_count};
use super::terminal::{self, Common};
use super::traffic_args::TrafficArgs;
use crate::adversary::{ADO_WORDS, AdoWord};
use crate::ego::Process;
use crate::evaluation::{Evaluation, Sampling};
use crate::experiment::{EgoError, EgoUnderTest, Watch};
use crate::run_dir::{RunDir, counted};
use crate::sim::PlantKind;
use crate::world::Scenario;

/// Text of `--help` on a program after `--`.
pub(super) const PROGRAM: &str = "\
Program to run as the ego, after `--`, which consents to start it

Its commands act without actuator lag (`lag_s` 0). To set a lag, give `--ego` a file with
`Process(…)` instead (docs/reference/egos.md)";

/// Ego under test, by name, file or program.
#[derive(Args, Debug)]
pub(super) struct EgoArgs {
    /// Ego to test: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// Program to run as the ego, after `--`, which consents to start it.
    #[arg(last = true, value_name = "COMMAND", long_help = PROGRAM)]
    program: Vec<String>,
}

impl EgoArgs {
    /// Returns the egos in a world.
    pub(super) fn find(&self, world: &Scenario) -> Result<Vec<EgoUnderTest>, EgoError> {
        let egos = EgoUnderTest::find_or_program(world, &self.ego, &self.program)?;
        // A comparison with itself would look like an answer.
        for ego in egos
            .iter()
            .filter(|it| it.is_nominal() && it.name() != "nominal")
        {
            terminal::note(&format!(
                "warning: `{}` changes nothing, so it is the world's own ego",
                ego.name()
            ));
        }
        Ok(egos)
    }
}

/// Notes the cost of each program that is the ego of some of `egos`.
pub(super) fn note_program_costs(egos: &[EgoUnderTest], watch: &Watch<'_>) {
    let mut programs: Vec<&Process> = Vec::new();
    for program in egos.iter().filter_map(|ego| ego.scenario().program()) {
        // Changes of one world share its program.
        if !programs.iter().any(|known| known.shares_cost(program)) {
            programs.push(program);
        }
    }
    for program in programs {
        let cost = program.cost();
        // A mean over no command would be 0/0.
        if cost.steps > 0 {
            watch.note(&format!(
                "`{}` gave {} in {}, also in trivial starts and checks; \
                 waiting for them took {:.1} s in all, {:.2} ms each, on {}",
                program.command.join(" "),
                counted(cost.steps, "command"),
                counted(cost.episodes, "episode"),
                cost.waited_s,
                1e3 * cost.waited_s / cost.steps as f64,
                counted(cost.starts, "process")
            ));
        }
        // Repetitions cost processes that a user did not ask for, so they are stated.
        let compared = program.transcripts().compared();
        if compared > 0 {
            watch.note(&format!(
                "{compared} of its episodes were played again, each in a new process, to \
                 compare the commands"
            ));
        }
    }
}

/// Starts, ados and effort of a test.
#[derive(Args, Debug)]
pub(super) struct TestArgs {
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    pub(super) starts: usize,
    /// Ado to play (repeatable) [default: trained, more with `--runs`].
    #[arg(long, value_parser = ado_word(), value_name = "ADO")]
    pub(super) ado: Vec<AdoWord>,
    /// The physics to test in, instead of the run's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    pub(super) plant: Option<PlantKind>,
    /// Also search with at most M switches of action, which gives recall.
    #[arg(long, value_name = "M", value_parser = switch_count())]
    pub(super) search: Option<usize>,
    /// Also search each start with at most N runs that the trained ado proposes.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1..=1_000_000), help_heading = TEST)]
    pub(super) tries: u64,
    /// Also draw the trained ado's actions: softmax of its values over T.
    #[arg(long, value_name = "T", value_parser = temperature, help_heading = ADOS)]
    pub(super) temperature: Option<f64>,
    /// Draws per start for `--temperature`.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000), requires = "temperature", help_heading = ADOS)]
    pub(super) draws: u32,
    /// Runs of each ego to record and adapt the ado to: at least 10, 100 for most egos.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=100_000), help_heading = TEST)]
    pub(super) runs: u64,
    #[command(flatten)]
    pub(super) traffic: TrafficArgs,
    #[command(flatten)]
    pub(super) keep: KeepArgs,
    #[command(flatten)]
    pub(super) live: RerunArgs,
    #[command(flatten)]
    pub(super) answer: AnswerArgs,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    pub(super) seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

impl TestArgs {
    /// Returns the request of an evaluation, without its ados.
    ///
    /// It is beside the options, so that a new one is added in one file.
    pub(super) fn evaluation<'a>(
        &self,
        run: &'a RunDir,
        nominal: &'a Scenario,
        egos: &'a [EgoUnderTest],
    ) -> Evaluation<'a> {
        Evaluation {
            starts: (self.starts, self.seed),
            search: self.search,
            tries: self.tries,
            sampling: self.sampling(),
            runs: NonZeroU64::new(self.runs),
            ..Evaluation::new(run, nominal, egos)
        }
    }

    /// Returns the requested drawing of actions.
    fn sampling(&self) -> Option<Sampling> {
        let draws = self.draws;
        self.temperature
            .map(|temperature| Sampling { temperature, draws })
    }
}

/// Reads a word of `--ado`, explained as in the library's list.
fn ado_word() -> impl TypedValueParser<Value = AdoWord> {
    let values = ADO_WORDS.map(|group| PossibleValue::new(group.word).help(group.about));
    // Invariant: the words are those of the list.
    PossibleValuesParser::new(values).try_map(|word| AdoWord::named(&word).ok_or(word))
}

/// Reads a temperature, which divides values by neither zero nor infinity.
pub(super) fn temperature(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>();
    value
        .ok()
        .filter(|value| (1e-6..=1e6).contains(value))
        .ok_or_else(|| "give a number from 0.000001 to 1000000, such as 0.1".to_owned())
}
