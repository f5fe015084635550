//! Messages for the viewer, assembled in this thread.
//!
//! The SDK's own recording stream batches rows on a separate thread, which
//! helps programs that log row by row. Here the data of an episode is known
//! beforehand, in columns. Starting and joining that thread would cost more
//! than the recording itself.

use re_chunk::{Chunk, ChunkId, RowId, TimeColumn, TimePoint, Timeline};
use re_log_types::{EntityPath, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreKind, StoreSource};
use re_sdk_types::{AsComponents, SerializationError, SerializedComponentColumn};

use super::error::ViewError;
use crate::experiment::SampleInstant;

/// Application under which the viewer keeps the user's layout.
const APPLICATION: &str = "brakecheck";
/// Timeline that ends at an instant, at which a recording opens.
///
/// A viewer that follows a timeline opens at its end. Blueprints have no other way to
/// select the opening time.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpeningTimeline {
    pub name: &'static str,
    pub end_s: f64,
}
/// Timeline of a stream: the episodes one after another, in simulated time.
pub(super) const SHOWN_TIME: &str = "shown_time";
/// Timeline of a stream: the number of the episode.
pub(super) const EPISODE: &str = "episode";
/// Timeline of a stream: the decisions of the training.
pub(super) const DECISIONS: &str = "decisions";

/// Place of an episode on the timelines of a stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct StreamPlace {
    /// Start on the timeline [`SHOWN_TIME`], in nanoseconds.
    pub from_ns: i64,
    /// Number of the episode, from 1.
    pub episode: i64,
    /// Training decisions before and after the episode, if it is one of a training.
    pub decisions: Option<(i64, i64)>,
    /// Number of samples between two decisions.
    pub samples_per_decision: i64,
}

impl StreamPlace {
    /// Decision that was taken last at a sample. An aftermath has none of its own.
    fn decision(&self, sample: i64) -> Option<i64> {
        let (from, to) = self.decisions?;
        // The aftermath has samples beyond the last decision.
        Some((from + sample / self.samples_per_decision.max(1)).min(to))
    }

    fn at(&self, sample: usize, time_s: f64) -> TimePoint {
        let shown = TimePoint::default()
            .with(
                Timeline::new_duration(SHOWN_TIME),
                self.from_ns + nanos(time_s),
            )
            .with(Timeline::new_sequence(EPISODE), self.episode);
        match self.decision(sample as i64) {
            Some(decision) => shown.with(Timeline::new_sequence(DECISIONS), decision),
            None => shown,
        }
    }

    fn columns(&self, [times, steps]: &[TimeColumn; 2]) -> Vec<TimeColumn> {
        let shown = times.times_raw().iter().map(|time| self.from_ns + time);
        let episodes = times.times_raw().iter().map(|_| self.episode);
        let decisions = steps.times_raw().iter().map(|step| self.decision(*step));
        let mut columns = vec![
            TimeColumn::new_duration_nanos(SHOWN_TIME, shown),
            TimeColumn::new_sequence(EPISODE, episodes),
        ];
        if let Some(decisions) = decisions.collect::<Option<Vec<i64>>>() {
            columns.push(TimeColumn::new_sequence(DECISIONS, decisions));
        }
        columns
    }
}

/// Messages of one store: a recording, or a blueprint.
pub(super) struct LogWriter {
    store: StoreId,
    messages: Vec<LogMsg>,
    /// Timeline that ends at the opening time, if the recording continues after it.
    opening: Option<OpeningTimeline>,
    /// Place of the current episode, in a stream.
    place: Option<StreamPlace>,
}

impl LogWriter {
    /// Returns a journal that opens a new store.
    pub(super) fn new(kind: StoreKind) -> LogWriter {
        // Two runs with one id would be merged into one recording by the viewer.
        let store = StoreId::random(kind, APPLICATION);
        let source = StoreSource::Other(concat!("brakecheck ", env!("CARGO_PKG_VERSION")).into());
        let opening = LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info: StoreInfo::new(store.clone(), source),
        });
        LogWriter {
            store,
            messages: vec![opening],
            opening: None,
            place: None,
        }
    }

    /// Places all later messages on the timelines of a stream.
    ///
    /// Messages for all times then hold from the start of the episode on.
    pub(super) fn place(&mut self, place: StreamPlace) {
        self.place = Some(place);
    }

    /// Returns whether the messages are those of a stream of episodes.
    pub(super) fn is_stream(&self) -> bool {
        self.place.is_some()
    }

    /// Returns the messages since the last call.
    pub(super) fn take_messages(&mut self) -> Vec<LogMsg> {
        std::mem::take(&mut self.messages)
    }

    /// Adds a timeline to all later messages up to its end.
    pub(super) fn opening_at(mut self, opening: Option<OpeningTimeline>) -> LogWriter {
        self.opening = opening;
        self
    }

    /// Returns the store that the journal writes.
    pub(super) fn store(&self) -> &StoreId {
        &self.store
    }

    /// Returns all messages.
    pub(super) fn into_messages(self) -> Vec<LogMsg> {
        self.messages
    }

    /// Logs components that hold at all times.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub(super) fn always(
        &mut self,
        entity: impl Into<EntityPath>,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        let at = self.place.map(|place| place.at(0, 0.0));
        self.row(entity.into(), at.unwrap_or_default(), parts)
    }

    /// Logs components at a point of the timelines.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub(super) fn at(
        &mut self,
        entity: impl Into<EntityPath>,
        at: TimePoint,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        self.row(entity.into(), at, parts)
    }

    /// Logs components that hold for the whole stream, whatever its place.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub(super) fn throughout(
        &mut self,
        entity: impl Into<EntityPath>,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        self.row(entity.into(), TimePoint::default(), parts)
    }

    /// Logs components that hold from an instant on.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub(super) fn from(
        &mut self,
        instant: SampleInstant,
        entity: impl Into<EntityPath>,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        let SampleInstant { sample, time_s } = instant;
        // In a stream the timelines are those of all episodes together.
        if let Some(place) = self.place {
            return self.row(entity.into(), place.at(sample, time_s), parts);
        }
        let clock = TimePoint::default()
            .with(Timeline::new_sequence("step"), sample as i64)
            .with(Timeline::new_duration("sim_time"), nanos(time_s));
        let point = match &self.opening {
            Some(opening) if nanos(time_s) <= opening.end_ns() => {
                clock.with(Timeline::new_duration(opening.name), nanos(time_s))
            }
            _ => clock,
        };
        self.row(entity.into(), point, parts)
    }

    /// Logs a part of a blueprint.
    pub(super) fn layout(
        &mut self,
        node: String,
        part: &dyn AsComponents,
    ) -> Result<(), ViewError> {
        // Viewers read layouts on this timeline alone.
        let once = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        self.row(node.into(), once, &[part])
    }

    /// Logs one row per instant.
    pub(super) fn columns(
        &mut self,
        entity: impl Into<EntityPath>,
        clock: [TimeColumn; 2],
        columns: Result<impl Iterator<Item = SerializedComponentColumn>, SerializationError>,
    ) -> Result<(), ViewError> {
        // Read first, because the clock is moved into the chunk.
        let times: Vec<i64> = clock[0].times_raw().to_vec();
        let clock = (match &self.place {
            Some(place) => place.columns(&clock),
            None => clock.into(),
        })
        .into_iter()
        .map(|times| (*times.timeline().name(), times));
        let chunk = Chunk::from_auto_row_ids(
            ChunkId::new(),
            entity.into(),
            clock.collect(),
            columns?
                .map(|column| (column.descriptor, column.list_array))
                .collect(),
        )?;
        // Without another timeline, all rows stay in one chunk.
        let Some(opening) = self.opening else {
            return self.push(chunk);
        };
        // Rows are sorted by time, so those of the shorter timeline come first.
        let early = times.partition_point(|time| *time <= opening.end_ns());
        if early == 0 {
            return self.push(chunk);
        }
        // All rows of a chunk have the same timelines, so it is split at the
        // end of the shorter timeline.
        let mut first = chunk.row_sliced_shallow(0, early);
        let times_s = times[..early].iter().map(|time| 1e-9 * *time as f64);
        let column = TimeColumn::new_duration_secs(opening.name, times_s);
        first.add_timeline(column)?;
        self.push(first)?;
        match times.len() - early {
            0 => Ok(()),
            late => self.push(chunk.row_sliced_shallow(early, late)),
        }
    }

    fn row(
        &mut self,
        entity: EntityPath,
        at: TimePoint,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        // All parts in one row, so that the viewer never shows a half of them.
        let batches = parts.iter().flat_map(|part| part.as_serialized_batches());
        let chunk = Chunk::builder(entity)
            .with_serialized_batches(RowId::new(), at, batches)
            .build();
        self.push(chunk?)
    }

    fn push(&mut self, chunk: Chunk) -> Result<(), ViewError> {
        let message = chunk.to_arrow_msg()?;
        self.messages
            .push(LogMsg::ArrowMsg(self.store.clone(), message));
        Ok(())
    }
}

impl OpeningTimeline {
    fn end_ns(&self) -> i64 {
        // Marks extend one microsecond beyond their instant.
        nanos(self.end_s + 2e-6)
    }
}

/// Both timelines at some instants, given as samples and times.
pub(super) fn clock(instants: impl IntoIterator<Item = (usize, f64)>) -> [TimeColumn; 2] {
    let (steps, times_s): (Vec<i64>, Vec<f64>) = instants
        .into_iter()
        .map(|(sample, time_s)| (sample as i64, time_s))
        .unzip();
    [
        TimeColumn::new_duration_secs("sim_time", times_s),
        TimeColumn::new_sequence("step", steps),
    ]
}

/// Both timelines with another instant, 1 µs after the last one.
pub(super) fn after_last([times, steps]: &[TimeColumn; 2]) -> [TimeColumn; 2] {
    let (times, steps) = (times.times_raw(), steps.times_raw());
    let after = times.last().map(|time| time + 1_000);
    [
        TimeColumn::new_duration_nanos("sim_time", times.iter().copied().chain(after)),
        TimeColumn::new_sequence("step", steps.iter().chain(steps.last()).copied()),
    ]
}

/// Seconds in the viewer's unit.
pub(super) fn nanos(time_s: f64) -> i64 {
    // Rounded, so that products of the sample time give equal instants everywhere.
    (1e9 * time_s).round() as i64
}
