//! Learning curves of a training, in a stream.

use re_chunk::{TimePoint, Timeline};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Scalars, SeriesLines};

use super::error::ViewError;
use super::layout::{BlueprintBuilder, Views};
use super::lines::{Pen, colour};
use super::log_writer::{DECISIONS, LogWriter, SHOWN_TIME};
use crate::run_dir::{Calibration, Progress};

const SUCCESS: &str = "learning/share/success";
const EXPLORATION: &str = "learning/share/exploration";
const CALIBRATION: &str = "learning/share/calibration";
const RETURN: &str = "learning/return";
const LOSS: &str = "learning/loss";

/// Curves with their pens.
const CURVES: [(&str, Pen<'_>); 5] = [
    (SUCCESS, ("solved while learning", [255, 112, 67], 2.2)),
    (EXPLORATION, ("exploration ε", [140, 150, 165], 1.4)),
    (
        CALIBRATION,
        ("recall on calibration starts", [126, 211, 133], 2.2),
    ),
    (RETURN, ("mean return", [74, 158, 255], 2.0)),
    (LOSS, ("mean loss", [190, 147, 255], 1.8)),
];

/// Logs the names and colours of the curves.
pub(super) fn log_pens(journal: &mut LogWriter) -> Result<(), ViewError> {
    for (entity, (name, rgb, width)) in CURVES {
        let style = SeriesLines::new()
            .with_names([name])
            .with_colors([colour(rgb)])
            .with_widths([width]);
        journal.throughout(entity, &[&style])?;
    }
    Ok(())
}

/// Logs a report of the learner.
pub(super) fn log_progress(
    journal: &mut LogWriter,
    shown_ns: i64,
    progress: &Progress,
) -> Result<(), ViewError> {
    let at = at(shown_ns, progress.decisions);
    let curves = [
        (SUCCESS, Some(progress.solved_share)),
        (EXPLORATION, Some(f64::from(progress.exploration))),
        (RETURN, Some(progress.mean_return)),
        (LOSS, progress.mean_loss),
    ];
    for (entity, value) in curves {
        if let Some(value) = value {
            log_point(journal, &at, entity, value)?;
        }
    }
    Ok(())
}

/// Logs the share of the search-solved calibration starts that the ado solves.
pub(super) fn log_calibration(
    journal: &mut LogWriter,
    shown_ns: i64,
    decisions: u64,
    calibration: &Calibration,
) -> Result<(), ViewError> {
    match calibration.recall() {
        Some(recall) => log_point(journal, &at(shown_ns, decisions), CALIBRATION, recall),
        None => Ok(()),
    }
}

fn log_point(
    journal: &mut LogWriter,
    at: &TimePoint,
    entity: &str,
    value: f64,
) -> Result<(), ViewError> {
    let point = Scalars::single(value);
    let parts: [&dyn AsComponents; 1] = [&point];
    journal.at(entity, at.clone(), &parts)
}

fn at(shown_ns: i64, decisions: u64) -> TimePoint {
    let decisions = i64::try_from(decisions).unwrap_or(i64::MAX);
    TimePoint::default()
        .with(Timeline::new_duration(SHOWN_TIME), shown_ns)
        .with(Timeline::new_sequence(DECISIONS), decisions)
}

/// Adds the plots of the learning curves.
pub(super) fn views(layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let mut plot = |title: &str, origin: &str, height: f32| {
        let view = layout.curves(title, origin)?;
        Ok::<_, ViewError>((view, height))
    };
    Ok(vec![
        plot("training", "/learning/share", 1.3)?,
        plot("mean return", "/learning/return", 0.8)?,
        plot("mean loss", "/learning/loss", 0.8)?,
    ])
}
