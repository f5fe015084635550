//! Texts that `brakecheck report` writes.

use std::path::Path;

use serde_json::json;

use super::common::print_json;
use super::failure::Failure;
use super::report_args::ReportArgs;
use super::terminal;
use crate::run_dir::write_output;

/// Episodes that the page of points or of kept crashes shows moving.
pub(super) const MOST_EXAMPLES: usize = 12;

/// Texts of a page and of its JUnit file.
pub(super) struct ReportTexts {
    /// Verdict to print.
    pub(super) verdict: Vec<String>,
    pub(super) html: String,
    pub(super) junit: String,
}

impl ReportTexts {
    /// Writes the page and the JUnit file, and prints the verdict and their paths.
    pub(super) fn write(&self, args: &ReportArgs, html: &Path) -> Result<(), Failure> {
        let junit = html.with_extension("junit.xml");
        write_output(html, self.html.as_bytes())?;
        write_output(&junit, self.junit.as_bytes())?;
        // The paths are printed last, so that they name files that exist.
        if args.common.json {
            print_json(&json!({
                "report": html.display().to_string(),
                "junit": junit.display().to_string(),
            }))
        } else {
            let paths = [html, &junit].map(|path| path.display().to_string());
            terminal::data(&[&self.verdict[..], &paths].concat().join("\n"))
        }
    }
}
