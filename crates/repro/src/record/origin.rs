//! Program, day and machine of a measurement.

use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// Program, day and machine of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RowOrigin {
    /// Version of brakecheck.
    pub version: String,
    /// Commit of the repository. A plus sign follows if files differed from it.
    pub commit: String,
    /// Day, as YYYY-MM-DD in UTC.
    pub date: String,
    /// Processor, cores and operating system.
    pub machine: String,
}

impl RowOrigin {
    /// Returns the origin of a measurement that this program makes now.
    pub(crate) fn here(root: &Path) -> RowOrigin {
        RowOrigin {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: commit(root).unwrap_or_else(|| "unknown".to_owned()),
            date: today(),
            machine: machine(),
        }
    }
}

fn commit(root: &Path) -> Option<String> {
    let git = |args: &[&str]| {
        // Without git, as in an unpacked archive, the commit stays unknown.
        let output = Command::new("git")
            .current_dir(root)
            .args(args)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=10", "HEAD"])?;
    // Pages and results differ while they are made, so only the program counts.
    let program = [
        "status",
        "--porcelain",
        "--",
        "src",
        "crates",
        "worlds",
        "assets",
        // Versions and features of other libraries decide results, too.
        "Cargo.toml",
        "Cargo.lock",
    ];
    let is_clean = git(&program).is_some_and(|changed| changed.is_empty());
    Some(if is_clean {
        commit
    } else {
        format!("{commit}+")
    })
}

fn today() -> String {
    // A clock before 1970 is wrong anyway.
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    date(now.unwrap_or_default().as_secs() / 86_400)
}

/// Returns the day that is so many days after 1970-01-01 (Hinnant 2013).
fn date(days: u64) -> String {
    // Years begin in March here, so that a leap day is the last day of a year.
    // From 0000-03-01 to 1970-01-01 there are 719,468 days.
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // From March on, every five months have 153 days.
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

fn machine() -> String {
    let line = |file: &str, name: &str| {
        let text = std::fs::read_to_string(file).ok()?;
        let line = text.lines().find(|line| line.starts_with(name))?;
        // The first file separates names from values by colons, the second by equal
        // signs.
        let value = line.split([':', '=']).nth(1)?;
        Some(value.trim().trim_matches('"').to_owned())
    };
    let model = line("/proc/cpuinfo", "model name");
    let processor = model.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let release = line("/etc/os-release", "PRETTY_NAME");
    let system = release.unwrap_or_else(|| std::env::consts::OS.to_owned());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {cores} cores, {system}")
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::{commit, date};

    #[test]
    fn a_changed_library_marks_the_commit() {
        let folder = tempfile::tempdir().expect("scratch");
        let root = folder.path();
        let write = |name: &str, text: &str| {
            std::fs::write(root.join(name), text).expect("written");
        };
        let git = |args: &[&str]| {
            let identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"];
            let mut git = Command::new("git");
            let done = git.current_dir(root).args(identity).args(args).output();
            assert!(done.expect("git").status.success(), "{args:?}");
        };
        write("Cargo.lock", "one");
        git(&["init", "--quiet"]);
        git(&["add", "."]);
        git(&["commit", "--quiet", "--no-gpg-sign", "-m", "one"]);
        // A page differs while it is made, which does not count.
        write("page.md", "a page");
        let clean = commit(root).expect("a commit");
        write("Cargo.lock", "two");
        assert_eq!(commit(root), Some(format!("{clean}+")));
        assert!(!clean.ends_with('+'));
    }

    #[test]
    fn days_have_their_dates() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (20_787, "2026-11-30"),
            (20_818, "2026-12-31"),
            (20_819, "2027-01-01"),
        ] {
            assert_eq!(date(days), expected);
        }
    }
}
