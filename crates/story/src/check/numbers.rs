//! Check of numbers, and of shapes that consist of them.

use super::{Check, MOST};
use crate::ron_file::ValuePath;
use crate::values::{
    ClothoidPiece, ControlPoint, Dimension, DistanceOrTime, DynamicLimits, DynamicsShape,
    FinalSpeed, SpeedPoint, StoryNumber, StoryPosition, StoryTrajectory, TrajectoryTiming,
    TrajectoryVertex, TransitionDynamics,
};
use crate::view::{ActorTransition, PlaceFrame, StoryPlace};

/// Least rate, below which a change would hardly end, and least limit.
const LEAST_RATE: f64 = 1e-3;

impl Check<'_, '_> {
    /// Returns the value of a number, which must be at least `least`.
    pub(super) fn number(&mut self, path: &ValuePath, number: &StoryNumber, least: f64) -> f64 {
        let (value, caption) = match number {
            StoryNumber::Number(value) => (*value, value.to_string()),
            StoryNumber::Parameter(name) => {
                let at = self.index(path, "parameter", name, &self.names.parameters);
                self.has_parameters = true;
                let Some(value) = self.values.get(at) else {
                    // It is unknown, which is reported.
                    return least;
                };
                (*value, format!("{value}, a value of `{name}`,"))
            }
        };
        // The range excludes NaN, which compares with nothing.
        if !(least..=MOST).contains(&value) {
            let help = format!("write a number from {least} to {MOST}");
            self.wrong(path, format!("{caption} is out of bounds"), &help);
        }
        value
    }

    fn number_if(
        &mut self,
        path: &ValuePath,
        number: &Option<StoryNumber>,
        least: f64,
    ) -> Option<f64> {
        number.as_ref().map(|it| self.number(path, it, least))
    }

    pub(super) fn limits(
        &mut self,
        path: &ValuePath,
        limits: &DynamicLimits,
    ) -> DynamicLimits<f64> {
        let mut of = |field: &str, limit| self.number_if(&path.to(field), limit, LEAST_RATE);
        DynamicLimits {
            max_speed_mps: of("max_speed_mps", &limits.max_speed_mps),
            max_accel_mps2: of("max_accel_mps2", &limits.max_accel_mps2),
            max_decel_mps2: of("max_decel_mps2", &limits.max_decel_mps2),
        }
    }

    pub(super) fn distance(
        &mut self,
        path: &ValuePath,
        distance: &DistanceOrTime,
    ) -> DistanceOrTime<f64> {
        let at = path.at(0);
        match distance {
            DistanceOrTime::Metres(metres) => DistanceOrTime::Metres(self.number(&at, metres, 0.0)),
            DistanceOrTime::Seconds(time_s) => {
                DistanceOrTime::Seconds(self.number(&at, time_s, 0.0))
            }
        }
    }

    pub(super) fn final_speed(&mut self, path: &ValuePath, speed: &FinalSpeed) -> FinalSpeed<f64> {
        let at = path.at(0);
        match speed {
            FinalSpeed::Absolute(mps) => FinalSpeed::Absolute(self.number(&at, mps, 0.0)),
            FinalSpeed::RelativeToMaster(by_mps) => {
                FinalSpeed::RelativeToMaster(self.number(&at, by_mps, -MOST))
            }
        }
    }

    pub(super) fn dynamics(
        &mut self,
        path: &ValuePath,
        dynamics: &TransitionDynamics,
    ) -> ActorTransition {
        let at = path.to("dimension").at(0);
        let dimension = match &dynamics.dimension {
            // A step needs no size.
            _ if dynamics.shape == DynamicsShape::Step => Dimension::Time(0.0),
            None => {
                let help = "write its `dimension`, or the shape `Step`";
                self.wrong(path, "a change without a size".to_owned(), help);
                Dimension::Time(0.0)
            }
            Some(Dimension::Rate(rate)) => Dimension::Rate(self.number(&at, rate, LEAST_RATE)),
            Some(Dimension::Time(time_s)) => Dimension::Time(self.number(&at, time_s, 0.0)),
            Some(Dimension::Distance(way_m)) => Dimension::Distance(self.number(&at, way_m, 0.0)),
        };
        ActorTransition {
            shape: dynamics.shape,
            dimension,
        }
    }

    pub(super) fn speed_points(
        &mut self,
        path: &ValuePath,
        points: &[SpeedPoint],
        least_mps: f64,
    ) -> Vec<SpeedPoint<f64>> {
        let mut checked = Vec::with_capacity(points.len());
        for (i, point) in points.iter().enumerate() {
            let at = path.at(i);
            checked.push(SpeedPoint {
                time_s: self.number_if(&at.to("time_s"), &point.time_s, 0.0),
                speed_mps: self.number(&at.to("speed_mps"), &point.speed_mps, least_mps),
            });
        }
        checked
    }

    pub(super) fn place(&mut self, path: &ValuePath, position: &StoryPosition) -> StoryPlace {
        use StoryPosition as At;
        let frame = match position {
            At::World { .. } => PlaceFrame::World,
            At::Road { road, .. } => {
                let named = road.as_ref();
                PlaceFrame::Road(named.map(|it| self.road(&path.to("road"), Some(it))))
            }
            At::RelativeWorld { entity, .. } => {
                PlaceFrame::AgentInWorld(self.agent(&path.to("entity"), entity))
            }
            At::RelativeObject { entity, .. } => {
                PlaceFrame::Agent(self.agent(&path.to("entity"), entity))
            }
            At::RelativeRoad { entity, .. } => {
                PlaceFrame::AgentOnRoad(self.agent(&path.to("entity"), entity))
            }
            At::RelativeLane { entity, lanes, .. } => {
                PlaceFrame::AgentLane(self.agent(&path.to("entity"), entity), *lanes)
            }
        };
        // The names of the fields go along, so that a problem points at
        // its number in the file.
        let ((along, along_m), (left, left_m)) = match position {
            At::World { x_m, y_m, .. } => (("x_m", x_m), ("y_m", y_m)),
            At::Road { s_m, t_m, .. } => (("s_m", s_m), ("t_m", t_m)),
            At::RelativeWorld { dx_m, dy_m, .. } | At::RelativeObject { dx_m, dy_m, .. } => {
                (("dx_m", dx_m), ("dy_m", dy_m))
            }
            At::RelativeRoad { ds_m, dt_m, .. } => (("ds_m", ds_m), ("dt_m", dt_m)),
            At::RelativeLane { ds_m, offset_m, .. } => (("ds_m", ds_m), ("offset_m", offset_m)),
        };
        let (At::World { heading_rad, .. }
        | At::Road { heading_rad, .. }
        | At::RelativeWorld { heading_rad, .. }
        | At::RelativeObject { heading_rad, .. }
        | At::RelativeRoad { heading_rad, .. }
        | At::RelativeLane { heading_rad, .. }) = position;
        StoryPlace {
            frame,
            along_m: self.number(&path.to(along), along_m, -MOST),
            left_m: self.number(&path.to(left), left_m, -MOST),
            heading_rad: self.number_if(&path.to("heading_rad"), heading_rad, -MOST),
        }
    }

    /// Returns the number of a road, which is that of the world without a name.
    pub(super) fn road(&mut self, path: &ValuePath, name: Option<&String>) -> usize {
        match name {
            Some(name) => 1 + self.index(path, "road", name, &self.names.roads),
            None => 0,
        }
    }

    pub(super) fn timing(
        &mut self,
        path: &ValuePath,
        timing: &TrajectoryTiming,
    ) -> TrajectoryTiming<f64> {
        let (TrajectoryTiming::Absolute { scale, offset_s }
        | TrajectoryTiming::Relative { scale, offset_s }) = timing;
        // With a factor of 0 all points would have one time.
        let factor = self.number(&path.to("scale"), scale, LEAST_RATE);
        let sum_s = self.number(&path.to("offset_s"), offset_s, -MOST);
        match timing {
            TrajectoryTiming::Absolute { .. } => TrajectoryTiming::Absolute {
                scale: factor,
                offset_s: sum_s,
            },
            TrajectoryTiming::Relative { .. } => TrajectoryTiming::Relative {
                scale: factor,
                offset_s: sum_s,
            },
        }
    }

    pub(super) fn trajectory(
        &mut self,
        path: &ValuePath,
        trajectory: &StoryTrajectory,
    ) -> StoryTrajectory<f64> {
        match trajectory {
            StoryTrajectory::Polyline(vertices) => {
                let at = path.at(0);
                let all = vertices.iter().enumerate();
                StoryTrajectory::Polyline(all.map(|(i, it)| self.vertex(&at.at(i), it)).collect())
            }
            StoryTrajectory::Clothoid {
                x_m,
                y_m,
                heading_rad,
                time_s,
                pieces,
            } => {
                let at = path.to("pieces");
                let all = pieces.iter().enumerate();
                StoryTrajectory::Clothoid {
                    x_m: self.number(&path.to("x_m"), x_m, -MOST),
                    y_m: self.number(&path.to("y_m"), y_m, -MOST),
                    heading_rad: self.number(&path.to("heading_rad"), heading_rad, -MOST),
                    time_s: self.number_if(&path.to("time_s"), time_s, -MOST),
                    pieces: all.map(|(i, it)| self.piece(&at.at(i), it)).collect(),
                }
            }
            StoryTrajectory::Nurbs {
                order,
                knots,
                control_points,
            } => {
                let (at_knots, at) = (path.to("knots"), path.to("control_points"));
                let all_knots = knots.iter().enumerate();
                let all = control_points.iter().enumerate();
                StoryTrajectory::Nurbs {
                    order: *order,
                    knots: all_knots
                        .map(|(i, it)| self.number(&at_knots.at(i), it, -MOST))
                        .collect(),
                    control_points: all
                        .map(|(i, it)| self.control_point(&at.at(i), it))
                        .collect(),
                }
            }
        }
    }

    fn vertex(&mut self, path: &ValuePath, vertex: &TrajectoryVertex) -> TrajectoryVertex<f64> {
        TrajectoryVertex {
            x_m: self.number(&path.to("x_m"), &vertex.x_m, -MOST),
            y_m: self.number(&path.to("y_m"), &vertex.y_m, -MOST),
            heading_rad: self.number_if(&path.to("heading_rad"), &vertex.heading_rad, -MOST),
            // Negative times are possible, because the timing adds its offset to them.
            time_s: self.number_if(&path.to("time_s"), &vertex.time_s, -MOST),
        }
    }

    fn piece(&mut self, path: &ValuePath, piece: &ClothoidPiece) -> ClothoidPiece<f64> {
        ClothoidPiece {
            // The curvature changes over the length, by which it is divided.
            length_m: self.number(&path.to("length_m"), &piece.length_m, LEAST_RATE),
            from_per_m: self.number(&path.to("from_per_m"), &piece.from_per_m, -MOST),
            to_per_m: self.number(&path.to("to_per_m"), &piece.to_per_m, -MOST),
            time_s: self.number_if(&path.to("time_s"), &piece.time_s, -MOST),
        }
    }

    fn control_point(&mut self, path: &ValuePath, point: &ControlPoint) -> ControlPoint<f64> {
        ControlPoint {
            x_m: self.number(&path.to("x_m"), &point.x_m, -MOST),
            y_m: self.number(&path.to("y_m"), &point.y_m, -MOST),
            // Weights above 0 keep the denominator of the spline above 0.
            weight: self.number_if(&path.to("weight"), &point.weight, LEAST_RATE),
            time_s: self.number_if(&path.to("time_s"), &point.time_s, -MOST),
        }
    }
}
