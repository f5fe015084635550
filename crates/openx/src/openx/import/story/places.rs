//! Places and trajectories of a file, in the frame of its world.

use super::StoryWriter;
use super::numbers::StatedIn;
use super::speeds::following;
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::trajectories::states_heading;
use crate::sim::Pose;
use crate::story::values::{
    ClothoidPiece, ControlPoint, Effect, StoryNumber, StoryPosition, StoryTrajectory,
    TrajectoryTiming, TrajectoryVertex,
};

/// Greatest order of a NURBS curve.
const MOST_ORDER: f64 = 20.0;

impl StoryWriter<'_> {
    /// Returns a `Position`, without a heading.
    pub(super) fn position(&self, at: StatedIn<'_>) -> Result<StoryPosition, ImportError> {
        self.turned_position(at, false)
    }

    /// Returns a `Position`, with the heading of who is there.
    pub(super) fn turned_position(
        &self,
        at: StatedIn<'_>,
        turns: bool,
    ) -> Result<StoryPosition, ImportError> {
        let it = at.node.only()?;
        let inside = at.at(it);
        let other = || self.entity(it, &at.scope.text(it, "entityRef")?);
        let heading_rad = self
            .relative_heading(inside)
            .map(|heading| heading.filter(|_| turns));
        let or_zero = |name: &str| self.numbers.or(inside, name, 0.0);
        match it.name.as_str() {
            "RelativeObjectPosition" => Ok(StoryPosition::RelativeObject {
                entity: other()?,
                dx_m: or_zero("dx")?,
                dy_m: or_zero("dy")?,
                heading_rad: heading_rad?,
            }),
            "RelativeWorldPosition" => {
                let (dx_m, dy_m) = (
                    at.scope.number_or_zero(it, "dx")?,
                    at.scope.number_or_zero(it, "dy")?,
                );
                let moved = |x_m: f64, y_m: f64| {
                    let spot = Pose {
                        x_m,
                        y_m,
                        heading_rad: 0.0,
                    };
                    self.in_world(&spot)
                };
                // The world is turned against the file, and so are its axes.
                let (from, to) = (moved(0.0, 0.0), moved(dx_m, dy_m));
                let names = ["dx", "dy"];
                Ok(StoryPosition::RelativeWorld {
                    entity: other()?,
                    dx_m: self.numbers.stated(inside, &names, to.x_m - from.x_m),
                    dy_m: self.numbers.stated(inside, &names, to.y_m - from.y_m),
                    heading_rad: heading_rad?,
                })
            }
            "RelativeRoadPosition" => Ok(StoryPosition::RelativeRoad {
                entity: {
                    self.keeps_direction(inside)?;
                    other()?
                },
                ds_m: or_zero("ds")?,
                dt_m: or_zero("dt")?,
                heading_rad: heading_rad?,
            }),
            "RelativeLanePosition" => Ok(StoryPosition::RelativeLane {
                entity: {
                    self.keeps_direction(inside)?;
                    other()?
                },
                lanes: at.scope.lane(it, "dLane")?,
                ds_m: or_zero(if it.raw("dsLane").is_some() {
                    "dsLane"
                } else {
                    "ds"
                })?,
                offset_m: or_zero("offset")?,
                heading_rad: heading_rad?,
            }),
            _ => {
                let placed = self.ground.place(at.node, at.scope)?;
                let spot = self.in_world(&placed.spot);
                Ok(StoryPosition::World {
                    x_m: self.numbers.stated(at, &[], spot.x_m),
                    y_m: self.numbers.stated(at, &[], spot.y_m),
                    heading_rad: turns.then(|| self.numbers.stated(at, &[], spot.heading_rad)),
                })
            }
        }
    }

    /// Refuses a place relative to an entity whose road has another direction, or other
    /// lanes, in the world than in the file.
    fn keeps_direction(&self, at: StatedIn<'_>) -> Result<(), ImportError> {
        let name = at.scope.text(at.node, "entityRef")?;
        let Some(frame) = &self.frame else {
            return Ok(());
        };
        let Some(of) = frame.all.iter().find(|it| it.entity.name == name) else {
            return Ok(());
        };
        let goes_on = of.entity.placed.lane.as_ref().is_some_and(|on| on.forward);
        if goes_on && self.shares_lanes(at.node, frame, of).is_ok() {
            return Ok(());
        }
        let help = "place it in the world, on a lane, or relative to the object itself";
        let what = format!("a place along the road of `{name}` is not read on the way");
        Err(at.node.refused(what, help))
    }

    /// Returns the turn of a place against what it is relative to.
    fn relative_heading(&self, at: StatedIn<'_>) -> Result<Option<StoryNumber>, ImportError> {
        let Some(orientation) = at.node.child("Orientation") else {
            return Ok(None);
        };
        let is_relative = match orientation.raw("type") {
            Some(kind) => kind == "relative",
            None => self.ground.turns_relative,
        };
        let turn_rad = self.numbers.or(at.at(orientation), "h", 0.0)?;
        // Pitch and roll alone turn nothing in the plane.
        if is_relative || orientation.raw("h").is_none() {
            return Ok(Some(turn_rad));
        }
        let help = "write type=\"relative\"";
        let what = "an absolute heading of a relative place is not read here";
        Err(orientation.refused(what, help))
    }

    fn in_world(&self, spot: &Pose) -> Pose {
        let frame = self.frame.as_ref();
        frame.map_or(*spot, |frame| frame.concrete.in_plane(spot))
    }

    pub(super) fn trajectory(&self, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        let reference = it.child("TrajectoryRef").unwrap_or(it);
        let (trajectory, own) = self.ground.trajectory(reference, at.scope)?;
        if own.is_true(&trajectory, "closed")? {
            let help = "write closed=\"false\"";
            return Err(trajectory.refused("a trajectory that begins again is not read", help));
        }
        let shape = trajectory.inner("Shape")?.only()?;
        if names_entity(shape) {
            let help = "place it in the world or on lanes";
            let what = "a trajectory relative to an agent is not read on the way";
            return Err(shape.refused(what, help));
        }
        let inside = StatedIn {
            node: shape,
            scope: &own,
            owner: at.owner,
        };
        let timing = self.timing(at)?;
        let mode = it.child("TrajectoryFollowingMode");
        let mode = mode.or(it.child("FollowingMode"));
        Ok(Effect::FollowTrajectory {
            trajectory: match shape.name.as_str() {
                "Polyline" => self.polyline(inside, timing.is_some())?,
                "Clothoid" => self.clothoid(inside)?,
                "ClothoidSpline" => self.spline(inside)?,
                "Nurbs" => self.nurbs(inside)?,
                other => {
                    let help = "write a Polyline, a Clothoid, a ClothoidSpline or a Nurbs";
                    return Err(shape.refused(format!("a way along a `{other}` is not read"), help));
                }
            },
            timing,
            following: match mode {
                Some(mode) => following(mode.raw("followingMode"), mode)?,
                None => following(None, it)?,
            },
            initial_distance_m: self.numbers.or(at, "initialDistanceOffset", 0.0)?,
        })
    }

    fn timing(&self, at: StatedIn<'_>) -> Result<Option<TrajectoryTiming>, ImportError> {
        let timing = at
            .node
            .child("TimeReference")
            .and_then(|it| it.child("Timing"));
        let Some(timing) = timing else {
            return Ok(None);
        };
        let at = at.at(timing);
        let scale = self.numbers.or(at, "scale", 1.0)?;
        let offset_s = self.numbers.or(at, "offset", 0.0)?;
        Ok(Some(match timing.raw("domainAbsoluteRelative") {
            Some("relative") => TrajectoryTiming::Relative { scale, offset_s },
            Some("absolute") => TrajectoryTiming::Absolute { scale, offset_s },
            _ => {
                let help = "write domainAbsoluteRelative=\"relative\" or \"absolute\"";
                return Err(timing.refused("times of no kind", help));
            }
        }))
    }

    fn spot(&self, at: StatedIn<'_>, name: &str) -> Result<Pose, ImportError> {
        let placed = self.ground.place(at.node.inner(name)?, at.scope)?;
        Ok(self.in_world(&placed.spot))
    }

    /// Returns an attribute as a number, or `None` without it.
    fn if_stated(&self, at: StatedIn<'_>, name: &str) -> Result<Option<StoryNumber>, ImportError> {
        let stated = at.node.raw(name);
        stated
            .map(|_| self.numbers.of(at, name, |it| it))
            .transpose()
    }

    fn polyline(&self, at: StatedIn<'_>, is_timed: bool) -> Result<StoryTrajectory, ImportError> {
        let mut vertices = Vec::new();
        for vertex in at.node.all("Vertex") {
            let at = at.at(vertex);
            let spot = self.spot(at, "Position")?;
            // Without a heading of its own a vertex faces along the line.
            let heading = states_heading(vertex).then_some(spot.heading_rad);
            vertices.push(TrajectoryVertex {
                x_m: self.numbers.stated(at, &[], spot.x_m),
                y_m: self.numbers.stated(at, &[], spot.y_m),
                heading_rad: heading.map(|it| self.numbers.stated(at, &[], it)),
                // Without a timing the file's times mean nothing.
                time_s: if is_timed {
                    self.if_stated(at, "time")?
                } else {
                    None
                },
            });
        }
        Ok(StoryTrajectory::Polyline(vertices))
    }

    fn clothoid(&self, at: StatedIn<'_>) -> Result<StoryTrajectory, ImportError> {
        let shape = at.node;
        let begins = self.spot(at, "Position")?;
        // The attribute has had both names.
        let name = match shape.raw("curvaturePrime") {
            Some(_) => "curvaturePrime",
            None => "curvatureDot",
        };
        let length_m = at.scope.number(shape, "length")?;
        let from_per_m = at.scope.number(shape, "curvature")?;
        let to_per_m = from_per_m + at.scope.number_or_zero(shape, name)? * length_m;
        let piece = ClothoidPiece {
            length_m: self.numbers.stated(at, &["length"], length_m),
            from_per_m: self.numbers.stated(at, &["curvature"], from_per_m),
            to_per_m: self
                .numbers
                .stated(at, &[name, "curvature", "length"], to_per_m),
            time_s: self.if_stated(at, "stopTime")?,
        };
        let time_s = self.if_stated(at, "startTime")?;
        Ok(self.along(at, begins, time_s, vec![piece]))
    }

    fn spline(&self, at: StatedIn<'_>) -> Result<StoryTrajectory, ImportError> {
        let mut pieces: Vec<ClothoidPiece> = Vec::new();
        let mut begins = None;
        let mut time_s = None;
        for segment in at.node.all("ClothoidSplineSegment") {
            let at = at.at(segment);
            if segment.child("PositionStart").is_some() {
                if begins.is_some() {
                    let help = "keep the `PositionStart` of the first segment only";
                    return Err(segment.refused("a way that begins anew is not read", help));
                }
                begins = Some(self.spot(at, "PositionStart")?);
            }
            // A segment begins where and when the one before it ends.
            let begins_s = self.if_stated(at, "timeStart")?;
            match pieces.last_mut() {
                Some(before) => before.time_s = begins_s,
                None => time_s = begins_s,
            }
            // A heading offset between segments would be a corner.
            if at.scope.number_or_zero(segment, "hOffset")? != 0.0 {
                let help = "leave out `hOffset`";
                return Err(segment.refused("a way with corners or times is not read", help));
            }
            let number = |name: &str| self.numbers.of(at, name, |it| it);
            pieces.push(ClothoidPiece {
                length_m: number("length")?,
                from_per_m: number("curvatureStart")?,
                to_per_m: number("curvatureEnd")?,
                time_s: None,
            });
        }
        let Some(begins) = begins else {
            let help = "give its first segment a `PositionStart`";
            return Err(at.node.refused("nothing says where it begins", help));
        };
        // The time at the end belongs to the whole curve.
        if let Some(last) = pieces.last_mut() {
            last.time_s = self.if_stated(at, "timeEnd")?;
        }
        Ok(self.along(at, begins, time_s, pieces))
    }

    fn along(
        &self,
        at: StatedIn<'_>,
        begins: Pose,
        time_s: Option<StoryNumber>,
        pieces: Vec<ClothoidPiece>,
    ) -> StoryTrajectory {
        StoryTrajectory::Clothoid {
            x_m: self.numbers.stated(at, &[], begins.x_m),
            y_m: self.numbers.stated(at, &[], begins.y_m),
            heading_rad: self.numbers.stated(at, &[], begins.heading_rad),
            time_s,
            pieces,
        }
    }

    fn nurbs(&self, at: StatedIn<'_>) -> Result<StoryTrajectory, ImportError> {
        let order = at.scope.number_in(at.node, "order", 2.0..=MOST_ORDER)?;
        let points = at.node.all("ControlPoint").map(|node: &XmlNode| {
            let at = at.at(node);
            let spot = self.spot(at, "Position")?;
            Ok(ControlPoint {
                x_m: self.numbers.stated(at, &[], spot.x_m),
                y_m: self.numbers.stated(at, &[], spot.y_m),
                weight: self.if_stated(at, "weight")?,
                time_s: self.if_stated(at, "time")?,
            })
        });
        let knots = at.node.all("Knot");
        let knots = knots.map(|it| self.numbers.of(at.at(it), "value", |value| value));
        Ok(StoryTrajectory::Nurbs {
            // The range holds whole numbers only up to its end.
            order: order as usize,
            knots: knots.collect::<Result<_, ImportError>>()?,
            control_points: points.collect::<Result<_, ImportError>>()?,
        })
    }
}

/// Returns whether a place inside is relative to an entity, which may move.
fn names_entity(node: &XmlNode) -> bool {
    node.raw("entityRef").is_some() || node.children.iter().any(names_entity)
}
