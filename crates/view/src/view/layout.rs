//! Parts of a blueprint: views, containers and the window around them.
//!
//! It is written archetype by archetype, because the library's builder reaches
//! neither the 3D camera nor the axes of plots.

use re_sdk_types::AsComponents;
use re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, PanelBlueprint, PlotLegend, ScalarAxis, TimeAxis, TimePanelBlueprint,
    ViewBlueprint, ViewContents, ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    ContainerKind, Corner2D, IncludedContent, PanelState, PlayState,
};
use re_sdk_types::datatypes::{self, Range1D};

use super::error::ViewError;
use super::log_writer::{LogWriter, SHOWN_TIME, nanos};
use super::viewed_episode::ViewedEpisode;

/// Height of a plot, of a line of its legend, and of the legend's frame.
const PLOT_PX: f32 = 140.0;
const LEGEND_LINE_PX: f32 = 27.0;
const LEGEND_ROOM_PX: f32 = 62.0;

/// Share of a column that a plot takes, so that a legend of some lines fits.
///
/// Without a legend it is smaller.
pub(super) fn height_of(legend_lines: usize) -> f32 {
    match legend_lines {
        0 => 0.75,
        lines => ((LEGEND_ROOM_PX + LEGEND_LINE_PX * lines as f32) / PLOT_PX).max(0.9),
    }
}

/// Corner of legends, because the last moments of an episode decide.
const LEGEND: Corner2D = Corner2D::LeftTop;

/// Factor by which the time axis of plots is longer than the time up to the verdict.
const ROOM: f64 = 1.03;

/// Time axis of a stream: about the length of an episode before the current time.
fn latest_episode(story: &ViewedEpisode<'_>) -> TimeAxis {
    let from_now = |time_s: f64| {
        datatypes::TimeRangeBoundary::CursorRelative(datatypes::TimeInt(nanos(time_s)))
    };
    let length_s = story.motion_end_s().max(1.0);
    TimeAxis::new().with_view_range(datatypes::TimeRange {
        // Relative to the current time, because a stream has no known end.
        start: from_now(-ROOM * length_s),
        end: from_now((ROOM - 1.0) * length_s),
    })
}

/// Range of the values of a plot.
#[derive(Clone, Copy, Debug)]
pub(super) enum PlotRange {
    /// That of the visible curves.
    Fitted,
    /// From the least to the greatest value.
    Fixed(f64, f64),
}

/// Builder of a blueprint, node by node.
pub(super) struct BlueprintBuilder<'a> {
    journal: &'a mut LogWriter,
    next: u64,
    /// True for a stream, false for a recording of one episode.
    is_stream: bool,
}

impl<'a> BlueprintBuilder<'a> {
    pub(super) fn new(journal: &'a mut LogWriter) -> BlueprintBuilder<'a> {
        BlueprintBuilder {
            journal,
            next: 0,
            is_stream: false,
        }
    }

    /// Creates the builder of a stream, which opens at the end of its episodes.
    pub(super) fn of_stream(journal: &'a mut LogWriter) -> BlueprintBuilder<'a> {
        BlueprintBuilder {
            is_stream: true,
            ..BlueprintBuilder::new(journal)
        }
    }

    /// Adds a plot of curves over the complete timeline.
    pub(super) fn curves(&mut self, title: &str, origin: &str) -> Result<BlueprintNode, ViewError> {
        let view = self.lines(title, origin, &["$origin/**"], true)?;
        let all = TimeAxis::new().with_view_range(datatypes::TimeRange {
            start: datatypes::TimeRangeBoundary::Infinite,
            end: datatypes::TimeRangeBoundary::Infinite,
        });
        self.property(&view, "TimeAxis", &all)?;
        Ok(view)
    }

    /// Adds a plot of curves over the time up to the verdict.
    pub(super) fn plot(
        &mut self,
        story: &ViewedEpisode<'_>,
        title: &str,
        contents: &[&str],
        range: PlotRange,
        has_legend: bool,
    ) -> Result<BlueprintNode, ViewError> {
        let view = self.lines(title, "/", contents, has_legend)?;
        if let PlotRange::Fixed(least, greatest) = range {
            let axis = ScalarAxis::new().with_range(Range1D([least, greatest]));
            self.property(&view, "ScalarAxis", &axis)?;
        }
        if self.is_stream {
            self.property(&view, "TimeAxis", &latest_episode(story))?;
            return Ok(view);
        }
        let instant =
            |time_s: f64| datatypes::TimeRangeBoundary::Absolute(datatypes::TimeInt(nanos(time_s)));
        // All plots have the same axis, so that they are comparable.
        let axis = TimeAxis::new().with_view_range(datatypes::TimeRange {
            start: instant(0.0),
            // An episode may end at its first sample, and an axis needs an
            // extent.
            end: instant(ROOM * story.plotted_until_s().max(0.1)),
        });
        self.property(&view, "TimeAxis", &axis)?;
        Ok(view)
    }

    fn lines(
        &mut self,
        title: &str,
        origin: &str,
        contents: &[&str],
        has_legend: bool,
    ) -> Result<BlueprintNode, ViewError> {
        let view = self.view("TimeSeries", title, origin, contents)?;
        let legend = if has_legend {
            PlotLegend::new().with_corner(LEGEND)
        } else {
            PlotLegend::new().with_visible(false)
        };
        self.property(&view, "PlotLegend", &legend)?;
        Ok(view)
    }

    /// Returns whether the layout is that of a stream.
    pub(super) fn is_stream(&self) -> bool {
        self.is_stream
    }

    /// Adds the window: no panels of the viewer itself, and the time at its end.
    pub(super) fn window(
        &mut self,
        story: &ViewedEpisode<'_>,
        root: &BlueprintNode,
    ) -> Result<(), ViewError> {
        let viewport = ViewportBlueprint::new()
            .with_root_container(datatypes::Uuid {
                bytes: root.id.to_be_bytes(),
            })
            // The viewer would otherwise add views of its own for every new entity.
            .with_auto_layout(false)
            .with_auto_views(false);
        self.journal.layout("viewport".into(), &viewport)?;
        for panel in ["blueprint_panel", "selection_panel"] {
            let hidden = PanelBlueprint::new().with_state(PanelState::Collapsed);
            self.journal.layout(panel.into(), &hidden)?;
        }
        // Following opens at the end of a timeline, which is the contact or the verdict.
        // Playing from there starts again at real speed.
        let timeline = if self.is_stream {
            SHOWN_TIME
        } else {
            story.opening().map_or("sim_time", |opening| opening.name)
        };
        let time = TimePanelBlueprint::new()
            .with_state(PanelState::Collapsed)
            .with_timeline(timeline)
            .with_playback_speed(1.0)
            .with_play_state(PlayState::Following);
        self.journal.layout("time_panel".into(), &time)
    }

    /// Adds a view and returns its node.
    pub(super) fn view(
        &mut self,
        class: &str,
        title: &str,
        origin: &str,
        contents: &[&str],
    ) -> Result<BlueprintNode, ViewError> {
        let view = self.node("view");
        let class = re_sdk_types::blueprint::components::ViewClass(class.into());
        let about = ViewBlueprint::new(class)
            .with_display_name(title)
            .with_space_origin(origin);
        self.journal.layout(view.path.as_str().into(), &about)?;
        let queries = contents
            .iter()
            .copied()
            .map(String::from)
            .map(|query| re_sdk_types::blueprint::components::QueryExpression(query.into()));
        self.property(&view, "ViewContents", &ViewContents::new(queries))?;
        Ok(view)
    }

    /// Adds a container and returns its node.
    pub(super) fn container(
        &mut self,
        kind: ContainerKind,
        title: &str,
        contents: &[BlueprintNode],
        shares: &[f32],
    ) -> Result<BlueprintNode, ViewError> {
        let container = self.node("container");
        let children = contents
            .iter()
            .map(|child| IncludedContent(child.path.as_str().into()));
        let mut about = ContainerBlueprint::new(kind)
            .with_display_name(title)
            .with_contents(children);
        match kind {
            ContainerKind::Horizontal => about = about.with_col_shares(shares.iter().copied()),
            ContainerKind::Vertical => about = about.with_row_shares(shares.iter().copied()),
            // Tabs lie behind each other, so shares have no meaning.
            ContainerKind::Tabs | ContainerKind::Grid => {}
        }
        self.journal
            .layout(container.path.as_str().into(), &about)?;
        Ok(container)
    }

    pub(super) fn property(
        &mut self,
        view: &BlueprintNode,
        name: &str,
        value: &dyn AsComponents,
    ) -> Result<(), ViewError> {
        self.journal.layout(format!("{}/{name}", view.path), value)
    }

    /// Returns a new node with an id of the shape that the viewer requires.
    fn node(&mut self, kind: &str) -> BlueprintNode {
        // Consecutive ids keep equal layouts equal, unlike random ids.
        self.next += 1;
        // The digits 4 and 8 mark version and variant of a UUID.
        let id = 0xb7a6_e000_0000_4000_8000_0000_0000_0000_u128 + u128::from(self.next);
        let hex = format!("{id:032x}");
        let parts = [
            &hex[..8],
            &hex[8..12],
            &hex[12..16],
            &hex[16..20],
            &hex[20..],
        ];
        BlueprintNode {
            path: format!("{kind}/{}", parts.join("-")),
            id,
        }
    }
}

/// Views from top to bottom, with their shares of a column's height.
pub(super) type Views = Vec<(BlueprintNode, f32)>;

/// View or container in the blueprint.
pub(super) struct BlueprintNode {
    path: String,
    id: u128,
}
