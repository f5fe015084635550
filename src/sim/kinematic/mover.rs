//! One body of the kinematic plant, and its motion during one `advance`.

use core::f64::consts::{PI, TAU};

use crate::sim::Pose;
use crate::sim::body::Walker;
use crate::sim::limits::{Drive, Limits};
use crate::sim::planar::{Extent, Rect, Shape};
use crate::sim::walk::{Ramp, Stride, length};

/// A body: its size, where it is, and what moves it.
#[derive(Clone, Debug)]
pub(super) struct Mover {
    pub extent: Extent,
    /// Fixed point of the motion model, ahead of the centre: rear axle or centre.
    pub anchor_ahead_m: f64,
    /// Fixed point: position, heading with its cosine and sine, speeds.
    pub at: Anchor,
    pub accel_mps2: f64,
    pub engine: Engine,
}

/// What moves a body, and what it is asked to do.
#[derive(Clone, Debug)]
pub(super) enum Engine {
    Wheels {
        limits: Limits,
        accel_mps2: f64,
        curvature_per_m: f64,
    },
    Legs {
        walker: Walker,
        target_mps: (f64, f64),
    },
    /// Carried along a recorded motion: where the fixed point is to be next.
    Rails {
        x_m: f64,
        y_m: f64,
        heading_rad: f64,
    },
}

/// State of the fixed point of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    pub cos: f64,
    pub sin: f64,
    /// A vehicle's speed along its heading.
    pub speed_mps: f64,
    pub curvature_per_m: f64,
    /// Velocity in the world frame of a walker, or of who is carried.
    pub walk_mps: (f64, f64),
    /// Turning rate of who is carried.
    pub yaw_rate_rad_per_s: f64,
}

/// A body's motion during one `advance`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    pub start: Anchor,
    pub kind: PathKind,
    /// Bounds over the step, for any point of the body.
    pub speed_bound_mps: f64,
    pub accel_bound_mps2: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum PathKind {
    Arc(Drive),
    Ramp(Ramp),
    /// At the velocity and the turning rate of the start.
    Even,
}

impl Mover {
    pub fn shape<'a>(&'a self, rect: &'a Rect) -> Shape<'a> {
        Shape {
            rect,
            extent: &self.extent,
        }
    }

    pub fn is_gliding(&self) -> bool {
        matches!(self.engine, Engine::Rails { .. })
    }

    /// From now on carried; `to` is where the front bumper is to be next.
    pub fn glide(&mut self, to: &Pose) {
        let (sin, cos) = libm::sincos(to.heading_rad);
        let back_m = self.extent.half_length_m - self.anchor_ahead_m;
        if let Engine::Wheels { .. } = self.engine {
            let Anchor {
                speed_mps,
                cos,
                sin,
                ..
            } = self.at;
            self.at.walk_mps = (speed_mps * cos, speed_mps * sin);
        }
        self.engine = Engine::Rails {
            x_m: to.x_m - back_m * cos,
            y_m: to.y_m - back_m * sin,
            heading_rad: to.heading_rad,
        };
    }

    pub fn rect(&self, at: &Anchor) -> Rect {
        let (speed_mps, lateral_mps, yaw_rate_rad_per_s) = at.motion(&self.engine);
        let back_m = -self.anchor_ahead_m;
        let left_mps = lateral_mps + yaw_rate_rad_per_s * back_m;
        Rect {
            x_m: at.x_m + back_m * at.cos,
            y_m: at.y_m + back_m * at.sin,
            cos: at.cos,
            sin: at.sin,
            vx_mps: speed_mps * at.cos - left_mps * at.sin,
            vy_mps: speed_mps * at.sin + left_mps * at.cos,
            yaw_rate_rad_per_s,
        }
    }

    pub fn path(&self, dt_s: f64) -> Path {
        let start = self.at;
        match &self.engine {
            Engine::Wheels {
                limits,
                accel_mps2,
                curvature_per_m,
            } => {
                let drive = limits.drive(*accel_mps2, start.speed_mps, dt_s);
                let end_mps = drive.speed_mps(start.speed_mps, dt_s);
                let top_mps = start.speed_mps.abs().max(end_mps.abs());
                let curvature_per_m =
                    limits.curvature_per_m(*curvature_per_m, drive.tyre_mps2, top_mps);
                let start = Anchor {
                    curvature_per_m,
                    ..start
                };
                // Farthest point from the rear axle: turning adds to its motion.
                let arm_m = self.anchor_ahead_m.abs() + self.extent.radius_m;
                let turn = curvature_per_m.abs() * arm_m;
                let centripetal_mps2 = top_mps * top_mps * curvature_per_m.abs() * (1.0 + turn);
                Path {
                    start,
                    kind: PathKind::Arc(drive),
                    speed_bound_mps: top_mps * (1.0 + turn),
                    accel_bound_mps2: drive.net_mps2.abs() * (1.0 + turn) + centripetal_mps2,
                }
            }
            Engine::Legs { walker, target_mps } => {
                let ramp = walker.ramp(start.walk_mps, *target_mps);
                Path {
                    start,
                    kind: PathKind::Ramp(ramp),
                    speed_bound_mps: length(start.walk_mps).max(length(*target_mps)),
                    accel_bound_mps2: length(ramp.accel_mps2),
                }
            }
            Engine::Rails {
                x_m,
                y_m,
                heading_rad,
            } => {
                let velocity_mps = ((x_m - start.x_m) / dt_s, (y_m - start.y_m) / dt_s);
                let turn_rad = libm::remainder(heading_rad - start.heading_rad, TAU);
                self.even_path(velocity_mps, turn_rad / dt_s)
            }
        }
    }

    /// The path at a constant velocity of the fixed point and turning rate.
    fn even_path(&self, velocity_mps: (f64, f64), yaw_rate_rad_per_s: f64) -> Path {
        let arm_m = self.anchor_ahead_m.abs() + self.extent.radius_m;
        let turning_mps = yaw_rate_rad_per_s.abs() * arm_m;
        Path {
            start: Anchor {
                walk_mps: velocity_mps,
                yaw_rate_rad_per_s,
                ..self.at
            },
            kind: PathKind::Even,
            speed_bound_mps: length(velocity_mps) + turning_mps,
            accel_bound_mps2: turning_mps * yaw_rate_rad_per_s.abs(),
        }
    }

    pub fn follow(&mut self, path: &Path, elapsed_s: f64) {
        let (before_mps, ..) = self.at.motion(&self.engine);
        self.at = path.at(elapsed_s);
        if PI < self.at.heading_rad.abs() {
            self.at.heading_rad -= TAU * libm::round(self.at.heading_rad / TAU);
        }
        let (after_mps, ..) = self.at.motion(&self.engine);
        self.accel_mps2 = (after_mps - before_mps) / elapsed_s;
    }
}

impl Anchor {
    /// Speed along the heading, speed to the left, and yaw rate.
    pub fn motion(&self, engine: &Engine) -> (f64, f64, f64) {
        match engine {
            Engine::Wheels { .. } => (self.speed_mps, 0.0, self.speed_mps * self.curvature_per_m),
            Engine::Legs { .. } | Engine::Rails { .. } => {
                let (vx, vy) = self.walk_mps;
                (
                    vx * self.cos + vy * self.sin,
                    vy * self.cos - vx * self.sin,
                    self.yaw_rate_rad_per_s,
                )
            }
        }
    }
}

impl Path {
    pub fn at(&self, after_s: f64) -> Anchor {
        let start = self.start;
        match self.kind {
            PathKind::Arc(drive) => {
                let moving_s = after_s.min(drive.rest_after_s);
                let length_m = moving_s * (start.speed_mps + 0.5 * drive.net_mps2 * moving_s);
                let speed_mps = drive.speed_mps(start.speed_mps, after_s);
                let moved = Anchor { speed_mps, ..start };
                if start.curvature_per_m == 0.0 {
                    let (x_m, y_m) = (
                        start.x_m + length_m * start.cos,
                        start.y_m + length_m * start.sin,
                    );
                    return Anchor { x_m, y_m, ..moved };
                }
                // The chord of an arc of angle 2u is sin(u)/u of its length.
                let half_turn_rad = 0.5 * start.curvature_per_m * length_m;
                let (half_sin, half_cos) = libm::sincos(half_turn_rad);
                let chord_m = if half_turn_rad.abs() < 1e-6 {
                    length_m
                } else {
                    length_m * half_sin / half_turn_rad
                };
                let middle_cos = start.cos * half_cos - start.sin * half_sin;
                let middle_sin = start.sin * half_cos + start.cos * half_sin;
                let heading_rad = start.heading_rad + 2.0 * half_turn_rad;
                let (sin, cos) = libm::sincos(heading_rad);
                let (x_m, y_m) = (
                    start.x_m + chord_m * middle_cos,
                    start.y_m + chord_m * middle_sin,
                );
                Anchor {
                    x_m,
                    y_m,
                    heading_rad,
                    cos,
                    sin,
                    ..moved
                }
            }
            PathKind::Ramp(ramp) => {
                let stride = Stride {
                    at_m: (start.x_m, start.y_m),
                    velocity_mps: start.walk_mps,
                };
                let Stride {
                    at_m: (x_m, y_m),
                    velocity_mps: walk_mps,
                } = stride.after(&ramp, after_s);
                Anchor {
                    x_m,
                    y_m,
                    walk_mps,
                    ..start
                }
            }
            PathKind::Even => {
                let heading_rad = start.heading_rad + start.yaw_rate_rad_per_s * after_s;
                let (sin, cos) = match start.yaw_rate_rad_per_s == 0.0 {
                    true => (start.sin, start.cos),
                    false => libm::sincos(heading_rad),
                };
                Anchor {
                    x_m: start.x_m + start.walk_mps.0 * after_s,
                    y_m: start.y_m + start.walk_mps.1 * after_s,
                    heading_rad,
                    cos,
                    sin,
                    ..start
                }
            }
        }
    }
}
