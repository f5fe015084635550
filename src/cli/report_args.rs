//! Arguments of `brakecheck report`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::headings::{INPUT, OUTPUT, TEST};
use super::number_args::{STARTS, count, start_count};
use super::output_path::new_file;
use super::terminal::Common;
use crate::visible::shell_word;

#[derive(Args, Debug)]
pub(super) struct ReportArgs {
    /// A run, a world with points, kept crashes, or the JSON of `gate` or `risk`.
    #[arg(value_name = "RUN|WORLD.ron|DIR|FILE.json")]
    pub(super) run: PathBuf,
    /// The page to write, with JUnit XML beside it [default: RUN/report.html].
    #[arg(short, long, value_name = "FILE.html", value_parser = new_file())]
    pub(super) output: Option<PathBuf>,
    /// Another run of the same world, to show beside it (repeatable).
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(super) with: Vec<PathBuf>,
    /// Rows to show, from `eval`, `gate`, `sweep` or `search` with `--json` (repeatable).
    #[arg(long, value_name = "FILE.json", help_heading = INPUT)]
    pub(super) rows: Vec<PathBuf>,
    /// Test starts for the nominal ego.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    pub(super) starts: usize,
    /// Test starts for every changed ego, without `--rows` [default: as many as
    /// 1000 episodes allow, 20 to 100].
    #[arg(long, value_name = "N", value_parser = start_count(), help_heading = TEST)]
    pub(super) reuse_starts: Option<usize>,
    /// Also write each counterexample of the page as OpenSCENARIO, into a directory
    /// beside it, and link it.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) scenarios: bool,
    /// Ego of the page: nominal, a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    pub(super) ego: Option<String>,
    /// Program to run as the ego of the page, after `--` (`lag_s` is 0).
    #[arg(last = true, value_name = "COMMAND")]
    pub(super) program: Vec<String>,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    pub(super) seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

impl ReportArgs {
    /// Returns the command that makes this very page, with every option that it depends on.
    ///
    /// Pages of kept crashes and of results have no test starts of their own.
    pub(super) fn this_page(&self, has_starts: bool) -> String {
        let mut words = vec![shell_word(&shown(&self.run))];
        let mut option = |name: &str, values: Vec<String>| {
            words.push(name.to_owned());
            words.extend(values.iter().map(|value| shell_word(value)));
        };
        if let Some(output) = &self.output {
            option("-o", vec![shown(output)]);
        }
        // This option takes several values, and `--rows` is repeated for each.
        if !self.with.is_empty() {
            option("--with", self.with.iter().map(|run| shown(run)).collect());
        }
        for file in &self.rows {
            option("--rows", vec![shown(file)]);
        }
        // Defaults are written out, because a later version may change them.
        if has_starts {
            option("--starts", vec![self.starts.to_string()]);
        }
        if let Some(starts) = self.reuse_starts {
            option("--reuse-starts", vec![starts.to_string()]);
        }
        if has_starts {
            option("--seed", vec![self.seed.to_string()]);
        }
        if self.scenarios {
            option("--scenarios", Vec::new());
        }
        if self.common.allow_programs {
            option("--allow-programs", Vec::new());
        }
        if self.common.fresh {
            option("--fresh", Vec::new());
        }
        if let Some(ego) = &self.ego {
            option("--ego", vec![ego.clone()]);
        }
        if self.common.allow_invalid > 0.0 {
            option(
                "--allow-invalid",
                vec![self.common.allow_invalid.to_string()],
            );
        }
        // Behind `--` all words belong to the program, so it comes last.
        if !self.program.is_empty() {
            words.push("--".to_owned());
            words.extend(self.program.iter().map(|word| shell_word(word)));
        }
        format!("brakecheck report {}", words.join(" "))
    }
}

pub(super) fn shown(path: &Path) -> String {
    path.display().to_string()
}
