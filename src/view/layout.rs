//! The blueprint: which views there are, where, and what they look at first.
//!
//! Written archetype by archetype, because the builder of the viewer's library
//! reaches neither the 3D camera nor the axes of plots.

use rerun::AsComponents;
use rerun::blueprint::components::{
    BackgroundKind, ContainerKind, Corner2D, Eye3DKind, IncludedContent, PanelState, PlayState,
};
use rerun::blueprint::datatypes as datatypes_blueprint;
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend,
    ScalarAxis, TextLogColumns, TimeAxis, TimePanelBlueprint, ViewBlueprint, ViewContents,
    ViewportBlueprint, VisualBounds2D,
};
use rerun::external::re_sdk_types::datatypes::{self, Range1D};

use super::journal::{Journal, nanos};
use super::space::FOLLOW;
use super::story::Story;
use super::{ViewError, curves, grid};

/// Writes the blueprint of `story` to a blueprint's journal.
pub(super) fn log(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let mut layout = Layout { journal, next: 0 };
    let (mut views, mut shares) = match story.scenario.grid() {
        Some(world) => (
            vec![layout.map(f64::from(world.spec().arena.size))?],
            vec![7.0],
        ),
        None => {
            let around = Around::of(story);
            let views = vec![layout.scene(&around)?, layout.top_view(&around)?];
            (views, vec![5.0, 2.0])
        }
    };
    let actions = layout.view(
        "StateTimeline",
        match story.stage.lights.is_empty() {
            true => "actions of the ado",
            false => "actions of the ado, and lights",
        },
        "/actions",
        &["$origin/**", "+ /lights/**"],
    )?;
    let events = layout.view("TextLog", "events", "/verdict/events", &["$origin"])?;
    layout.property(&events, "TextLogColumns", &bodies_only())?;
    views.extend([actions, events]);
    shares.extend([lanes_share(story), 1.6]);
    let space = layout.container(ContainerKind::Vertical, "space", &views, &shares)?;
    let plots = layout.plots(story)?;
    let verdict = layout.view("TextDocument", "verdict", "/verdict", &["$origin"])?;
    let root = layout.container(
        ContainerKind::Horizontal,
        story.scenario.name.as_str(),
        &[space, plots, verdict],
        &[5.0, 4.0, 2.6],
    )?;
    layout.panels(&root)
}

struct Layout<'a> {
    journal: &'a mut Journal,
    next: u64,
}

impl Layout<'_> {
    /// The scene from behind the ego, with room for whom it follows.
    fn scene(&mut self, around: &Around) -> Result<Node, ViewError> {
        let view = self.view("3D", "scene", FOLLOW, &SPACE)?;
        let sky = Background::new(BackgroundKind::SolidColor)
            .with_color(rerun::Color::from_rgb(17, 20, 26));
        self.property(&view, "Background", &sky)?;
        let back_m = (-around.ahead_m.0).max(around.behind_m).clamp(0.0, 25.0);
        let eye_m = [-10.0 - back_m, 3.6 + 0.2 * back_m, 4.6 + 0.2 * back_m];
        self.look(&view, eye_m, [3.0, 0.0, 0.4], [0.0, 0.0, 1.0])?;
        Ok(view)
    }

    /// The scene from above, forward to the right.
    fn top_view(&mut self, around: &Around) -> Result<Node, ViewError> {
        let view = self.view("3D", "from above", FOLLOW, &SPACE[..3])?;
        let (eye_m, at_m) = around.seen_from_above();
        self.look(&view, eye_m, at_m, [0.0, 1.0, 0.0])?;
        Ok(view)
    }

    /// A grid's map of `size` cells a side, whole.
    fn map(&mut self, size: f64) -> Result<Node, ViewError> {
        let view = self.view("2D", "map", grid::MAP, &["$origin/**"])?;
        let dark = Background::new(BackgroundKind::SolidColor)
            .with_color(rerun::Color::from_rgb(17, 20, 26));
        self.property(&view, "Background", &dark)?;
        let range = Range1D([-grid::MARGIN_CELLS, size + grid::MARGIN_CELLS]);
        let bounds = VisualBounds2D::new(datatypes::Range2D {
            x_range: range,
            y_range: range,
        });
        self.property(&view, "VisualBounds2D", &bounds)?;
        Ok(view)
    }

    /// Places the camera in the frame that follows the ego.
    fn look(
        &mut self,
        view: &Node,
        eye_m: [f32; 3],
        at_m: [f32; 3],
        up: [f32; 3],
    ) -> Result<(), ViewError> {
        let eye = EyeControls3D::new()
            .with_kind(Eye3DKind::Orbital)
            .with_position(eye_m)
            .with_look_target(at_m)
            .with_eye_up(up);
        self.property(view, "EyeControls3D", &eye)?;
        let grid = LineGrid3D::new().with_visible(false);
        self.property(view, "LineGrid3D", &grid)
    }

    fn plots(&mut self, story: &Story<'_>) -> Result<Node, ViewError> {
        let legend = Some(Corner2D::RightTop);
        let axis = curves::robustness_axis(story);
        let robustness = self.plot(story, "running robustness ρ", "/robustness", axis, legend)?;
        let (mut column, mut shares) = (vec![robustness], vec![1.6]);
        let mut rest = vec!["+ /signals/**".to_owned()];
        for plot in curves::plots(story)
            .into_iter()
            .filter(|plot| plot.prominent)
        {
            let legend = plot.needs_legend().then_some(Corner2D::RightTop);
            let entity = plot.entity.to_string();
            rest.push(format!("- {entity}/**"));
            column.push(self.plot(
                story,
                &plot.title,
                &entity,
                curves::roomy(plot.span),
                legend,
            )?);
            shares.push(1.0);
        }
        // What is less telling waits behind the last prominent plot.
        let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
        let rest = self.view("TimeSeries", "other signals", "/signals", &rest)?;
        let tabs: Vec<Node> = column.pop().into_iter().chain([rest]).collect();
        column.push(self.container(ContainerKind::Tabs, "more", &tabs, &[])?);
        self.container(ContainerKind::Vertical, "curves", &column, &shares)
    }

    fn plot(
        &mut self,
        story: &Story<'_>,
        title: &str,
        origin: &str,
        axis: (f64, f64),
        legend: Option<Corner2D>,
    ) -> Result<Node, ViewError> {
        let marks = format!("+ {}/**", curves::MARKS);
        let view = self.view("TimeSeries", title, origin, &["$origin/**", &marks])?;
        // Marks reach beyond every axis, which has to be fixed for that.
        if curves::has_marks(story) || origin == "/robustness" {
            let axis = ScalarAxis::new().with_range(Range1D([axis.0, axis.1]));
            self.property(&view, "ScalarAxis", &axis)?;
        }
        let legend = match legend {
            Some(corner) => PlotLegend::new().with_corner(corner),
            None => PlotLegend::new().with_visible(false),
        };
        self.property(&view, "PlotLegend", &legend)?;
        // A little room at the end, so that what happens last is seen.
        let end_s = 1.04 * story.end_s().max(0.1);
        let instant =
            |time_s: f64| datatypes::TimeRangeBoundary::Absolute(datatypes::TimeInt(nanos(time_s)));
        let axis = TimeAxis::new().with_view_range(datatypes::TimeRange {
            start: instant(0.0),
            end: instant(end_s),
        });
        self.property(&view, "TimeAxis", &axis)?;
        Ok(view)
    }

    fn panels(&mut self, root: &Node) -> Result<(), ViewError> {
        let viewport = ViewportBlueprint::new()
            .with_root_container(datatypes::Uuid {
                bytes: root.id.to_be_bytes(),
            })
            .with_auto_layout(false)
            .with_auto_views(false);
        self.journal.layout("viewport".into(), &viewport)?;
        for panel in ["blueprint_panel", "selection_panel"] {
            let hidden = PanelBlueprint::new().with_state(PanelState::Collapsed);
            self.journal.layout(panel.into(), &hidden)?;
        }
        // Following opens at the last sample, where most episodes have their
        // crash; playing from there starts over at the speed of life.
        let time = TimePanelBlueprint::new()
            .with_state(PanelState::Collapsed)
            .with_timeline("sim_time")
            .with_playback_speed(1.0)
            .with_play_state(PlayState::Following);
        self.journal.layout("time_panel".into(), &time)
    }

    /// A view; returns its path in the blueprint.
    fn view(
        &mut self,
        class: &str,
        title: &str,
        origin: &str,
        contents: &[&str],
    ) -> Result<Node, ViewError> {
        let view = self.node("view");
        let class = rerun::blueprint::components::ViewClass(class.into());
        let about = ViewBlueprint::new(class)
            .with_display_name(title)
            .with_space_origin(origin);
        self.journal.layout(view.path.as_str().into(), &about)?;
        let queries = contents.iter().copied().map(String::from);
        let queries =
            queries.map(|query| rerun::blueprint::components::QueryExpression(query.into()));
        self.property(&view, "ViewContents", &ViewContents::new(queries))?;
        Ok(view)
    }

    /// A container; returns its path in the blueprint.
    fn container(
        &mut self,
        kind: ContainerKind,
        title: &str,
        contents: &[Node],
        shares: &[f32],
    ) -> Result<Node, ViewError> {
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
            ContainerKind::Tabs | ContainerKind::Grid => {}
        }
        self.journal
            .layout(container.path.as_str().into(), &about)?;
        Ok(container)
    }

    fn property(
        &mut self,
        view: &Node,
        name: &str,
        value: &dyn AsComponents,
    ) -> Result<(), ViewError> {
        self.journal.layout(format!("{}/{name}", view.path), value)
    }

    /// The viewer wants ids of this shape; any will do.
    fn node(&mut self, kind: &str) -> Node {
        self.next += 1;
        let id = 0xb7a6_e000_0000_4000_8000_0000_0000_0000_u128 + u128::from(self.next);
        let hex = format!("{id:032x}");
        let parts = [
            &hex[..8],
            &hex[8..12],
            &hex[12..16],
            &hex[16..20],
            &hex[20..],
        ];
        Node {
            path: format!("{kind}/{}", parts.join("-")),
            id,
        }
    }
}

/// Who is near the ego when it matters: least and greatest places, seen from it.
struct Around {
    /// Along its heading.
    ahead_m: (f32, f32),
    /// To its left.
    left_m: (f32, f32),
    /// By how much its rear is farther back than a car's.
    behind_m: f32,
}

impl Around {
    /// Beyond this nobody is worth a look from farther away.
    const FAR_M: f64 = 60.0;

    /// At the sample of the verdict, or at the last one.
    fn of(story: &Story<'_>) -> Around {
        let mut around = Around {
            ahead_m: (0.0, 0.0),
            left_m: (0.0, 0.0),
            behind_m: (story.stage.cast[story.ego()].size_m[0] - 4.5) as f32,
        };
        let last = story.frames.len().saturating_sub(1);
        let Some(frame) = story.frames.get(story.decided.unwrap_or(last)) else {
            return around;
        };
        let ego = frame.placements[story.ego()];
        let [_, _, turn, real] = ego.rotation;
        let (sin, cos) = (2.0 * turn.atan2(real)).sin_cos();
        for other in &frame.placements {
            let [dx, dy] = [0, 1].map(|axis| other.centre_m[axis] - ego.centre_m[axis]);
            let (ahead_m, left_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
            if ahead_m.abs() <= Around::FAR_M && left_m.abs() <= Around::FAR_M {
                around.ahead_m = grown(around.ahead_m, ahead_m);
                around.left_m = grown(around.left_m, left_m);
            }
        }
        around
    }

    /// A camera that sees all of them from above, and what it looks at.
    fn seen_from_above(&self) -> ([f32; 3], [f32; 3]) {
        let ((rear_m, front_m), (right_m, left_m)) = (self.ahead_m, self.left_m);
        // The view shows about 4.8 times the camera's height along, once across.
        let height_m = ((front_m - rear_m + 16.0) / 4.8).max(left_m - right_m + 4.0);
        let ahead_m = match height_m <= 9.0 {
            // Most happens ahead.
            true => 3.0_f32.min(9.0 + rear_m).max(front_m - 12.0),
            false => 0.5 * (rear_m + front_m),
        };
        let aside_m = 0.5 * (right_m + left_m);
        let eye_m = [ahead_m, aside_m - 0.01, height_m.max(9.0)];
        (eye_m, [ahead_m, aside_m, 0.0])
    }
}

fn grown((least, greatest): (f32, f32), by: f64) -> (f32, f32) {
    // The one cast from places to cameras.
    (least.min(by as f32), greatest.max(by as f32))
}

/// The share of the lanes of actions and lights, which need room for each.
fn lanes_share(story: &Story<'_>) -> f32 {
    let ados = match story.scenario.drive() {
        Some(spec) => spec.action_sets().count(),
        None => 1,
    };
    let lanes = ados + story.stage.lights.len();
    0.5 + 0.5 * lanes as f32
}

/// A view or a container in the blueprint.
struct Node {
    path: String,
    id: u128,
}

/// When and what; all lines of the log come from one entity.
fn bodies_only() -> TextLogColumns {
    TextLogColumns::update_fields().with_text_log_columns([datatypes_blueprint::TextLogColumn {
        kind: datatypes_blueprint::TextLogColumnKind::Body,
        visible: true.into(),
    }])
}

/// What the spatial views show.
const SPACE: [&str; 4] = [
    "+ /world/**",
    "+ /trails/**",
    "+ /contact/**",
    "+ /verdict/mark",
];
