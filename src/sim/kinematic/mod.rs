//! The 2D plant: bicycle models in closed form, f64 throughout.
//!
//! Within one `advance` a vehicle keeps its acceleration and curvature, so its
//! rear axle runs along an arc, and a walker's velocity changes evenly until it
//! is what was asked for. Both have closed forms, so substeps change nothing.
//! Contacts are found by conservative advancement on the separating axes: exact
//! to 1e-9 m, one evaluation for bodies on one line at constant speed.

use core::f64::consts::{PI, TAU};

use super::body::{Body, BodyKind, Walker};
use super::limits::{Drive, Limits};
use super::planar::{Extent, Rect, Separation, Shape, TOUCH_M, far_apart};
use super::walk::{Ramp, Stride, length};
use super::{BodyId, BodyState, Command, Contact, Ground, Placement, Plant, PlantKind, Pose};

/// Clearance at which an approach counts as a touch.
const TOLERANCE_M: f64 = 1e-9;
/// Evaluations after which a grazing approach is taken for a touch.
const MAX_EVALUATIONS: u32 = 1000;
/// Distance from the origin beyond which the plant calls itself unsound.
const BOUND_M: f64 = 1e6;

/// The kinematic plant.
#[derive(Clone, Debug)]
pub struct Kinematic {
    ground: Ground,
    movers: Vec<Mover>,
    /// Paths of the running `advance`, kept to save the allocation.
    paths: Vec<Path>,
    faulty: bool,
}

#[derive(Clone, Debug)]
struct Mover {
    extent: Extent,
    /// Fixed point of the motion model, ahead of the centre: rear axle or centre.
    anchor_ahead_m: f64,
    /// Fixed point: position, heading with its cosine and sine, speeds.
    at: Anchor,
    accel_mps2: f64,
    engine: Engine,
}

/// State of the fixed point of a body.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    cos: f64,
    sin: f64,
    /// A vehicle's speed along its heading.
    speed_mps: f64,
    curvature_per_m: f64,
    /// A walker's velocity in the world frame.
    walk_mps: (f64, f64),
}

#[derive(Clone, Debug)]
enum Engine {
    Wheels {
        limits: Limits,
        accel_mps2: f64,
        curvature_per_m: f64,
    },
    Legs {
        walker: Walker,
        target_mps: (f64, f64),
    },
}

/// A body's motion during one `advance`.
#[derive(Clone, Copy, Debug)]
struct Path {
    start: Anchor,
    kind: PathKind,
    /// Bounds over the step, for any point of the body.
    speed_bound_mps: f64,
    accel_bound_mps2: f64,
}

#[derive(Clone, Copy, Debug)]
enum PathKind {
    Arc(Drive),
    Ramp(Ramp),
}

impl Kinematic {
    /// An empty plant.
    pub fn new(ground: Ground) -> Kinematic {
        Kinematic {
            ground,
            movers: Vec::new(),
            paths: Vec::new(),
            faulty: false,
        }
    }

    fn first_contact(&self, dt_s: f64) -> Option<Contact> {
        let mut first: Option<Contact> = None;
        let mut horizon_s = dt_s;
        for (b, mover_b) in self.movers.iter().enumerate() {
            for (a, mover_a) in self.movers.iter().enumerate().take(b) {
                let paths = (&self.paths[a], &self.paths[b]);
                if let Some(contact) = meet((mover_a, mover_b), paths, horizon_s) {
                    horizon_s = contact.after_s;
                    first = Some(Contact {
                        pair: (BodyId(a), BodyId(b)),
                        ..contact
                    });
                }
            }
        }
        first
    }
}

impl Plant for Kinematic {
    fn kind(&self) -> PlantKind {
        PlantKind::Kinematic
    }

    fn clear(&mut self, ground: Ground) {
        self.ground = ground;
        self.movers.clear();
        self.paths.clear();
        self.faulty = false;
    }

    fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) -> BodyId {
        let (sin, cos) = libm::sincos(pose.heading_rad);
        let (anchor_ahead_m, engine, walk_mps) = match &body.kind {
            BodyKind::Vehicle(vehicle) => {
                let limits = Limits::new(body, vehicle, self.ground);
                let engine = Engine::Wheels {
                    limits,
                    accel_mps2: 0.0,
                    curvature_per_m: 0.0,
                };
                (vehicle.rear_axle_ahead_m(body), engine, (0.0, 0.0))
            }
            BodyKind::Walker(walker) => {
                let walk_mps = walker.within_limit((speed_mps * cos, speed_mps * sin));
                (
                    0.0,
                    Engine::Legs {
                        walker: walker.clone(),
                        target_mps: walk_mps,
                    },
                    walk_mps,
                )
            }
        };
        let back_m = body.half_length_m() - anchor_ahead_m;
        let at = Anchor {
            x_m: pose.x_m - back_m * cos,
            y_m: pose.y_m - back_m * sin,
            heading_rad: pose.heading_rad,
            cos,
            sin,
            speed_mps,
            curvature_per_m: 0.0,
            walk_mps,
        };
        self.movers.push(Mover {
            extent: Extent::of(body),
            anchor_ahead_m,
            at,
            accel_mps2: 0.0,
            engine,
        });
        BodyId(self.movers.len() - 1)
    }

    fn command(&mut self, id: BodyId, command: Command) {
        let Some(command) = super::finite(command) else {
            self.faulty = true;
            return;
        };
        match (&mut self.movers[id.0].engine, command) {
            (
                Engine::Wheels {
                    accel_mps2,
                    curvature_per_m,
                    ..
                },
                Command::Drive {
                    accel_mps2: a,
                    curvature_per_m: k,
                },
            ) => {
                (*accel_mps2, *curvature_per_m) = (a, k);
            }
            (Engine::Legs { walker, target_mps }, Command::Walk { x_mps, y_mps }) => {
                *target_mps = walker.within_limit((x_mps, y_mps));
            }
            _ => self.faulty = true,
        }
    }

    fn advance(&mut self, dt_s: f64, _substeps: u32) -> Option<Contact> {
        self.paths.clear();
        self.paths
            .extend(self.movers.iter().map(|mover| mover.path(dt_s)));
        let contact = self.first_contact(dt_s);
        let elapsed_s = contact.map_or(dt_s, |contact| contact.after_s);
        if 0.0 < elapsed_s {
            for (mover, path) in self.movers.iter_mut().zip(&self.paths) {
                mover.follow(path, elapsed_s);
            }
        }
        contact
    }

    fn state(&self, id: BodyId) -> BodyState {
        let mover = &self.movers[id.0];
        let Anchor {
            x_m,
            y_m,
            heading_rad,
            cos,
            sin,
            ..
        } = mover.at;
        let ahead_m = mover.extent.half_length_m - mover.anchor_ahead_m;
        let pose = Pose {
            x_m: x_m + ahead_m * cos,
            y_m: y_m + ahead_m * sin,
            heading_rad,
        };
        let (speed_mps, lateral_mps, yaw_rate_rad_per_s) = mover.at.motion(&mover.engine);
        BodyState {
            pose,
            speed_mps,
            lateral_mps: lateral_mps + yaw_rate_rad_per_s * ahead_m,
            yaw_rate_rad_per_s,
            accel_mps2: mover.accel_mps2,
        }
    }

    fn placement(&self, id: BodyId) -> Placement {
        let mover = &self.movers[id.0];
        let rect = mover.rect(&mover.at);
        let (half_sin, half_cos) = libm::sincos(0.5 * mover.at.heading_rad);
        Placement {
            centre_m: [rect.x_m, rect.y_m, 0.5 * mover.extent.height_m],
            rotation: [0.0, 0.0, half_sin, half_cos],
        }
    }

    fn gap_m(&self, a: BodyId, b: BodyId) -> f64 {
        let (mover_a, mover_b) = (&self.movers[a.0], &self.movers[b.0]);
        let (rect_a, rect_b) = (mover_a.rect(&mover_a.at), mover_b.rect(&mover_b.at));
        mover_a.shape(&rect_a).gap_m(&mover_b.shape(&rect_b))
    }

    fn sound(&self) -> bool {
        let bounded = |value: f64| value.abs() <= BOUND_M;
        let fine = |mover: &Mover| {
            let Anchor {
                x_m,
                y_m,
                heading_rad,
                speed_mps,
                walk_mps,
                ..
            } = mover.at;
            [x_m, y_m, heading_rad, speed_mps, walk_mps.0, walk_mps.1]
                .into_iter()
                .all(bounded)
        };
        !self.faulty && self.movers.iter().all(fine)
    }

    fn fork(&self) -> Box<dyn Plant> {
        Box::new(self.clone())
    }
}

impl Mover {
    fn shape<'a>(&'a self, rect: &'a Rect) -> Shape<'a> {
        Shape {
            rect,
            extent: &self.extent,
        }
    }

    fn rect(&self, at: &Anchor) -> Rect {
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

    fn path(&self, dt_s: f64) -> Path {
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
        }
    }

    fn follow(&mut self, path: &Path, elapsed_s: f64) {
        let (before_mps, ..) = path.start.motion(&self.engine);
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
    fn motion(&self, engine: &Engine) -> (f64, f64, f64) {
        match engine {
            Engine::Wheels { .. } => (self.speed_mps, 0.0, self.speed_mps * self.curvature_per_m),
            Engine::Legs { .. } => {
                let (vx, vy) = self.walk_mps;
                (
                    vx * self.cos + vy * self.sin,
                    vy * self.cos - vx * self.sin,
                    0.0,
                )
            }
        }
    }
}

impl Path {
    fn at(&self, after_s: f64) -> Anchor {
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
        }
    }
}

/// First touch of two moving bodies within `horizon_s`, strictly before its end.
///
/// Conservative advancement: at each instant the best separating axis says how
/// long the two cannot touch, whatever they do within their bounds.
fn meet(
    (a, b): (&Mover, &Mover),
    (path_a, path_b): (&Path, &Path),
    horizon_s: f64,
) -> Option<Contact> {
    let (mut rect_a, mut rect_b) = (a.rect(&path_a.start), b.rect(&path_b.start));
    let reach_m = (path_a.speed_bound_mps + path_b.speed_bound_mps) * horizon_s;
    if far_apart(&a.shape(&rect_a), &b.shape(&rect_b), reach_m) {
        return None;
    }
    let bound_mps2 = path_a.accel_bound_mps2 + path_b.accel_bound_mps2;
    let mut after_s = 0.0;
    for evaluation in 0..MAX_EVALUATIONS {
        let (shape_a, shape_b) = (a.shape(&rect_a), b.shape(&rect_b));
        let gap_m = shape_a.separation(&shape_b).gap_m;
        if gap_m <= TOLERANCE_M {
            let (point_m, closing_speed_mps) = shape_a.meeting(&shape_b);
            // Bodies that touch from the start may part; bodies that overlap may not.
            let parting = evaluation == 0 && -TOUCH_M <= gap_m && closing_speed_mps <= 0.0;
            let pair = (BodyId(0), BodyId(0));
            return (!parting).then_some(Contact {
                pair,
                after_s,
                closing_speed_mps,
                point_m,
            });
        }
        let spin_mps = rect_a.yaw_rate_rad_per_s.abs() * a.extent.radius_m
            + rect_b.yaw_rate_rad_per_s.abs() * b.extent.radius_m;
        let safe = |axis: Separation| {
            let Separation { gap_m, nx, ny } = axis;
            let (vx, vy) = (rect_a.vx_mps - rect_b.vx_mps, rect_a.vy_mps - rect_b.vy_mps);
            safe_s(
                gap_m - 0.5 * TOLERANCE_M,
                vx * nx + vy * ny + spin_mps,
                bound_mps2,
            )
        };
        after_s += shape_a
            .separations(&shape_b)
            .into_iter()
            .map(safe)
            .fold(0.0, f64::max);
        if horizon_s <= after_s {
            return None;
        }
        rect_a = a.rect(&path_a.at(after_s));
        rect_b = b.rect(&path_b.at(after_s));
    }
    let (point_m, closing_speed_mps) = a.shape(&rect_a).meeting(&b.shape(&rect_b));
    Some(Contact {
        pair: (BodyId(0), BodyId(0)),
        after_s,
        closing_speed_mps,
        point_m,
    })
}

/// Time in which a gap cannot close, given closing speed and bounded acceleration.
fn safe_s(gap_m: f64, closing_mps: f64, bound_mps2: f64) -> f64 {
    if gap_m <= 0.0 {
        return 0.0;
    }
    let root = (closing_mps * closing_mps + 2.0 * bound_mps2 * gap_m).sqrt();
    if 0.0 <= closing_mps {
        let sum = closing_mps + root;
        return if sum == 0.0 {
            f64::INFINITY
        } else {
            2.0 * gap_m / sum
        };
    }
    if bound_mps2 == 0.0 {
        f64::INFINITY
    } else {
        (root - closing_mps) / bound_mps2
    }
}
