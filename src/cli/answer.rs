//! Output of a verb for people: the verdict, its table, and more on request.

use clap::Args;

use super::display::is_quiet;
use super::headings::OUTPUT;

/// Options of printed answers.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(super) struct AnswerArgs {
    /// Also print the reasons of the verdict: more tables, remarks and labels.
    // A JSON object has all details anyway.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    pub(super) details: bool,
    /// Also print the meaning of the columns.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    explain: bool,
}

/// Output of a verb, in the order in which it is printed.
#[derive(Clone, Debug, Default)]
pub(super) struct PrintedAnswer {
    /// Verdict, in one to three lines.
    pub(super) verdict: Vec<String>,
    /// Table of the verb.
    pub(super) table: String,
    /// Remarks without which the table would mislead.
    pub(super) warnings: String,
    /// More tables and remarks, for `--details`.
    pub(super) details: String,
    /// Meaning of the columns, for `--explain`.
    pub(super) legend: String,
}

impl PrintedAnswer {
    /// Puts this answer before another, whose verdict and table become details.
    ///
    /// Warnings of either stay. Without a table, it adds its verdict and details to the
    /// other.
    pub(super) fn before(self, rows: PrintedAnswer) -> PrintedAnswer {
        // Without a table of its own, the rows stay the main result.
        if self.table.is_empty() {
            return PrintedAnswer {
                verdict: [rows.verdict, self.verdict].concat(),
                details: format!("{}\n{}", rows.details, self.details),
                ..rows
            };
        }
        let details = [
            self.details.as_str(),
            &rows.verdict.join("\n"),
            &rows.table,
            &rows.details,
        ];
        PrintedAnswer {
            verdict: self.verdict,
            table: self.table,
            warnings: format!("{}\n{}", self.warnings, rows.warnings),
            details: details.map(|part| part.trim_matches('\n')).join("\n"),
            legend: format!("{}\n{}", self.legend, rows.legend),
        }
    }

    /// Returns the text to print.
    pub(super) fn text(&self, args: AnswerArgs) -> String {
        let verdict = self.verdict.join("\n");
        // The verdict alone is what a quiet script reads.
        if is_quiet() {
            return verdict;
        }
        let mut parts = vec![verdict.as_str(), &self.table, &self.warnings];
        let mut more = Vec::new();
        for (part, is_wanted, option) in [
            (&self.details, args.details, "more with --details"),
            (&self.legend, args.explain, "columns with --explain"),
        ] {
            if is_wanted {
                parts.push(part);
            } else if !part.trim().is_empty() {
                // An option that would print nothing is not advertised.
                more.push(option);
            }
        }
        let more = more.join(", ");
        parts.push(&more);
        // Some parts begin or end with a newline, which would leave blank lines.
        let parts = parts.iter().map(|part| part.trim_matches('\n'));
        let parts: Vec<&str> = parts.filter(|part| !part.is_empty()).collect();
        parts.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn details_and_columns_are_printed_on_request_only() {
        let answer = PrintedAnswer {
            verdict: vec!["it fails".to_owned()],
            table: "table\n".to_owned(),
            warnings: String::new(),
            details: "\nwhy".to_owned(),
            legend: "meaning".to_owned(),
        };
        let text = |details, explain| answer.text(AnswerArgs { details, explain });
        assert_eq!(
            text(false, false),
            "it fails\ntable\nmore with --details, columns with --explain"
        );
        assert_eq!(text(true, true), "it fails\ntable\nwhy\nmeaning");
        assert_eq!(
            text(true, false),
            "it fails\ntable\nwhy\ncolumns with --explain"
        );
        let bare = PrintedAnswer {
            verdict: answer.verdict.clone(),
            ..PrintedAnswer::default()
        };
        assert_eq!(bare.text(AnswerArgs::default()), "it fails");
    }

    #[test]
    fn warnings_stay_if_their_table_becomes_details() {
        let of = |verdict: &str, warnings: &str| PrintedAnswer {
            verdict: vec![verdict.to_owned()],
            table: format!("table of {verdict}"),
            warnings: warnings.to_owned(),
            ..PrintedAnswer::default()
        };
        let answer = of("gate", "").before(of("rows", "\nwarning: it never learned"));
        assert_eq!(
            answer.text(AnswerArgs::default()),
            "gate\ntable of gate\nwarning: it never learned\nmore with --details"
        );
    }
}
