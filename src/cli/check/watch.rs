//! `brakecheck check --watch`: a world is checked again when it is saved.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::super::failure::{Exit, Failure};
use super::super::terminal;
use super::super::world_input::{self, ReadWorld};
use super::CheckArgs;
use crate::run_files::WatchedFiles;

/// Between two looks at the files.
// Short enough to seem immediate, and long enough to leave the processor idle.
const EVERY: Duration = Duration::from_millis(200);

/// Checks a world file until Ctrl-C.
pub(super) fn run(args: &CheckArgs, world: &Path) -> Result<Exit, Failure> {
    if !world.is_file() {
        return Err(Failure::input(
            format!("`--watch` requires a world file, not `{}`", world.display()),
            "copy a shipped world (`brakecheck worlds acc -o mine.ron`), or write one: \
             `brakecheck new mine`",
        ));
    }
    // Watched before the first reading, so that a save during it is seen.
    let mut watched = WatchedFiles::new([world.to_owned()]);
    while !terminal::stopped() {
        let ReadWorld { world: read, files } = world_input::read(world);
        // A save may add or remove included files, so the list is renewed at every
        // reading.
        watched.follow(files);
        if !args.json {
            // Verdicts of several saves follow each other, and times tell them apart.
            terminal::data(&time_of_day(SystemTime::now()))?;
        }
        let checked = super::checked(args, read);
        let shown = checked.and_then(|(it, named)| super::show(args, world, &it, &named));
        // A mistake is the usual case while a world is edited, so it ends nothing.
        if let Err(failure) = shown {
            terminal::refuse(&failure);
        }
        while !terminal::stopped() && !watched.changed() {
            std::thread::sleep(EVERY);
        }
    }
    // Ctrl-C is how watching ends.
    Ok(Exit::Done)
}

/// Returns the time of day, as in `14:03:12 UTC`.
fn time_of_day(now: SystemTime) -> String {
    // A clock before 1970 is wrong anyway.
    let since = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    let second = since.as_secs() % 86_400;
    let (hour, minute) = (second / 3600, second / 60 % 60);
    format!("{hour:02}:{minute:02}:{:02} UTC", second % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_day_has_hours_minutes_and_seconds() {
        // 43,384 s are 12 h, 3 min and 4 s.
        let noon = UNIX_EPOCH + Duration::from_secs(86_400 * 20_000 + 43_384);
        assert_eq!(time_of_day(noon), "12:03:04 UTC");
    }
}
