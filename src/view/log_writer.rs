//! Messages for the viewer, assembled in this thread.
//!
//! The library's own recording stream batches rows on a separate thread, which
//! helps programs that log while they run. Here all data is known beforehand,
//! in columns. Starting and joining that thread would cost more than the
//! recording itself.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{Chunk, ChunkId, LogMsg, RowId};
use rerun::time::{TimePoint, Timeline};
use rerun::{
    AsComponents, EntityPath, RecordingStreamError, SerializationError, SerializedComponentColumn,
    StoreId, StoreKind, TimeColumn,
};

use super::error::ViewError;

/// Application under which the viewer keeps the user's layout.
const APPLICATION: &str = "brakecheck";
/// Timeline that ends with the verdict, for episodes that continue after it.
pub(super) const UNTIL_VERDICT: &str = "until_verdict";

/// Messages of one store: a recording, or a blueprint.
pub(super) struct LogWriter {
    store: StoreId,
    messages: Vec<LogMsg>,
    /// End of the timeline [`UNTIL_VERDICT`], in nanoseconds.
    until: Option<i64>,
}

impl LogWriter {
    /// Returns a journal that opens a new store.
    pub(super) fn new(kind: StoreKind) -> LogWriter {
        let store = StoreId::random(kind, APPLICATION);
        let source = StoreSource::Other(concat!("brakecheck ", env!("CARGO_PKG_VERSION")).into());
        let opening = LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info: StoreInfo::new(store.clone(), source),
        });
        LogWriter {
            store,
            messages: vec![opening],
            until: None,
        }
    }

    /// Adds a timeline that ends at `time_s` to all later messages up to that time.
    ///
    /// A viewer that follows a timeline opens at its end. Blueprints have no
    /// other way to select the opening time.
    pub(super) fn ending_at(mut self, time_s: Option<f64>) -> LogWriter {
        // Marks extend one microsecond beyond their instant.
        self.until = time_s.map(|time_s| nanos(time_s + 2e-6));
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
        self.row(entity.into(), TimePoint::default(), parts)
    }

    /// Logs components that hold from an instant (a sample and its time) on.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub(super) fn from(
        &mut self,
        (sample, time_s): (usize, f64),
        entity: impl Into<EntityPath>,
        parts: &[&dyn AsComponents],
    ) -> Result<(), ViewError> {
        let instant = TimePoint::default()
            .with(Timeline::new_sequence("step"), sample as i64)
            .with(Timeline::new_duration("sim_time"), nanos(time_s));
        let instant = match self.until {
            Some(until) if nanos(time_s) <= until => {
                instant.with(Timeline::new_duration(UNTIL_VERDICT), nanos(time_s))
            }
            _ => instant,
        };
        self.row(entity.into(), instant, parts)
    }

    /// Logs a part of a blueprint.
    pub(super) fn layout(
        &mut self,
        node: String,
        part: &dyn AsComponents,
    ) -> Result<(), ViewError> {
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
        let times: Vec<i64> = clock[0].times_raw().to_vec();
        let clock = clock.map(|times| (*times.timeline().name(), times));
        let columns = columns.map_err(RecordingStreamError::from)?;
        let chunk = Chunk::from_auto_row_ids(
            ChunkId::new(),
            entity.into(),
            clock.into_iter().collect(),
            columns
                .map(|column| (column.descriptor, column.list_array))
                .collect(),
        );
        let chunk = chunk.map_err(RecordingStreamError::from)?;
        let until = self.until.unwrap_or(i64::MIN);
        // Rows are sorted by time, so those of the shorter timeline come first.
        let early = times.partition_point(|time| *time <= until);
        if early == 0 {
            return self.push(chunk);
        }
        // All rows of a chunk have the same timelines, so it is split at the
        // end of the shorter timeline.
        let mut first = chunk.row_sliced_shallow(0, early);
        let times_s = times[..early].iter().map(|time| 1e-9 * *time as f64);
        let column = TimeColumn::new_duration_secs(UNTIL_VERDICT, times_s);
        first
            .add_timeline(column)
            .map_err(RecordingStreamError::from)?;
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
        let batches = parts.iter().flat_map(|part| part.as_serialized_batches());
        let chunk = Chunk::builder(entity)
            .with_serialized_batches(RowId::new(), at, batches)
            .build();
        self.push(chunk.map_err(RecordingStreamError::from)?)
    }

    fn push(&mut self, chunk: Chunk) -> Result<(), ViewError> {
        let message = chunk.to_arrow_msg().map_err(RecordingStreamError::from)?;
        self.messages
            .push(LogMsg::ArrowMsg(self.store.clone(), message));
        Ok(())
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

/// Seconds in the viewer's unit.
pub(super) fn nanos(time_s: f64) -> i64 {
    (1e9 * time_s).round() as i64
}
