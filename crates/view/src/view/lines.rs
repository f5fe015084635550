//! Curves over time, and the marks of all plots.

use re_chunk::TimeColumn;
use re_log_types::EntityPath;
use re_sdk_types::archetypes::{Scalars, SeriesLines, StateChange};
use re_sdk_types::components::Color;

use super::entity::path;
use super::error::ViewError;
use super::log_writer::{LogWriter, after_last, clock};
use super::palette::{self, Rgb};
use super::viewed_episode::ViewedEpisode;
use crate::experiment::SampleInstant;

/// Entity of the marks.
pub(super) const MARKS: &str = "/marks";
/// Extent of a mark upward and downward, beyond the axis of any plot.
const MARK_REACH: f64 = 1e6;

/// Number of instants to mark.
pub(super) fn marks(story: &ViewedEpisode<'_>) -> usize {
    usize::from(story.shown.decided.is_some()) + usize::from(story.episode.contact.is_some())
}

/// Logs vertical lines at the instants of the verdict and of the contact.
pub(super) fn log_marks(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    // A stream marks each verdict by the end of its curves.
    if journal.is_stream() {
        return Ok(());
    }
    let mut upright = |what: &str, sample: usize, time_s: f64, name: &str, rgb: Rgb| {
        // A curve has one value per instant, so the line takes two instants.
        let instants = clock([(sample, time_s), (sample, time_s + 1e-6)]);
        let entity = path(["marks", what]);
        let ends = vec![-MARK_REACH, MARK_REACH];
        log_lines(entity, &[(name, rgb, 1.2)], instants, ends, journal)
    };
    if let Some(SampleInstant { sample, time_s }) = story.shown.decided {
        let name = format!("{} {time_s:.2} s", story.episode.verdict.word());
        upright("verdict", sample, time_s, &name, palette::DECIDED)?;
    }
    if let Some(touch) = &story.episode.contact {
        // A contact lies between two samples, and the later sample shows it.
        let sample = story.sample_of(touch.time_s);
        let name = format!("contact {:.2} s", touch.time_s);
        upright("contact", sample, touch.time_s, &name, palette::CONTACT)?;
    }
    Ok(())
}

/// Style of a line: name, colour, width.
pub(super) type Pen<'a> = (&'a str, Rgb, f32);

/// Logs the lines of one entity. `values` has one value per pen for every instant.
///
/// In a stream the lines end after the last instant, so that those of the next episode are
/// apart from them.
pub(super) fn log_lines(
    entity: EntityPath,
    pens: &[Pen<'_>],
    mut instants: [TimeColumn; 2],
    mut values: Vec<f64>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    if journal.is_stream() {
        // The viewer connects neighbours, but nothing with a value that is no number.
        instants = after_last(&instants);
        values.extend(pens.iter().map(|_| f64::NAN));
    }
    // After the NaN row of a stream, which counts as a row.
    let rows = values.len() / pens.len();
    let style = SeriesLines::new()
        .with_names(pens.iter().map(|(name, _, _)| *name))
        .with_colors(pens.iter().map(|(_, rgb, _)| colour(*rgb)))
        .with_widths(pens.iter().map(|(_, _, width)| *width));
    journal.always(entity.clone(), &[&style])?;
    let scalars = Scalars::new(values).columns(vec![pens.len(); rows]);
    journal.columns(entity, instants, scalars)
}

/// Logs the states of a coloured lane, each from its instant on.
///
/// In a stream the last one ends with the motion of the episode.
pub(super) fn log_states<'a>(
    entity: EntityPath,
    instants: impl Iterator<Item = (usize, f64)>,
    states: impl Iterator<Item = &'a str>,
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let last = story.pose_instants().last();
    let end = last
        .filter(|_| journal.is_stream())
        // Later than all of them, so that the order of the instants stays that of time.
        .map(|(sample, time_s)| (sample, time_s.max(story.end_s()) + 1e-6));
    // The viewer shows an empty state as a gap.
    let changes = StateChange::update_fields().with_state(states.chain(end.map(|_| "")));
    let columns = changes.columns_of_unit_batches();
    journal.columns(entity, clock(instants.chain(end)), columns)
}

/// Both timelines at every sample.
pub(super) fn every_sample(story: &ViewedEpisode<'_>) -> [TimeColumn; 2] {
    clock((0..story.samples()).map(|sample| (sample, story.time_s(sample))))
}

/// Axis with some room above and, for labels, below.
pub(super) fn roomy(span: (f64, f64)) -> (f64, f64) {
    let (least, greatest) = span;
    // A constant curve still gets an axis of height 1.
    let height = (greatest - least).max(1.0);
    (least - 0.12 * height, greatest + 0.05 * height)
}

pub(super) fn colour([r, g, b]: Rgb) -> Color {
    Color::from_rgb(r, g, b)
}

/// Least and greatest of some finite numbers.
pub(super) fn span(values: &[f64]) -> (f64, f64) {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (least, greatest)
}

pub(super) fn union(spans: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    let grow = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    spans
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), grow)
}
