//! Many runs of the same vehicles side by side, as a structure of arrays.
//!
//! Each quantity of a vehicle is a column with an entry per run. The motion is that
//! of [`Kinematic`](super::Kinematic), by the same functions, so the bits are the same.

use super::approach::meet;
use super::engine::Engine;
use super::mover::Mover;
use super::path::{Anchor, BodyPath};
use super::wheels::Wheels;
use crate::sim::planar::{Rect, far_apart};
use crate::sim::{Body, BodyId, BodyState, Contact, Ground, Pose};

/// Vehicles of many runs on the kinematic plant, on flat ground of constant friction.
pub(crate) struct KinematicLanes {
    vehicles: Vec<LaneVehicle>,
    /// Runs that got a command that is not finite.
    faulty: Vec<bool>,
    /// Paths of one run, kept to avoid an allocation.
    paths: Vec<BodyPath>,
}

/// One vehicle in every run.
struct LaneVehicle {
    /// Its dimensions and limits. The state in it is not used.
    mover: Mover,
    wheels: Wheels,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Vec<f64>,
    cos: Vec<f64>,
    sin: Vec<f64>,
    speed_mps: Vec<f64>,
    curvature_per_m: Vec<f64>,
    accel_mps2: Vec<f64>,
    /// Commanded acceleration.
    wanted_mps2: Vec<f64>,
    /// Commanded curvature.
    wanted_per_m: Vec<f64>,
}

impl LaneVehicle {
    #[inline]
    fn anchor(&self, run: usize) -> Anchor {
        Anchor {
            x_m: self.x_m[run],
            y_m: self.y_m[run],
            heading_rad: self.heading_rad[run],
            cos: self.cos[run],
            sin: self.sin[run],
            speed_mps: self.speed_mps[run],
            curvature_per_m: self.curvature_per_m[run],
            // Vehicles have neither.
            walk_mps: (0.0, 0.0),
            yaw_rate_rad_per_s: 0.0,
        }
    }

    #[inline]
    fn set(&mut self, run: usize, at: &Anchor) {
        self.x_m[run] = at.x_m;
        self.y_m[run] = at.y_m;
        self.heading_rad[run] = at.heading_rad;
        self.cos[run] = at.cos;
        self.sin[run] = at.sin;
        self.speed_mps[run] = at.speed_mps;
        self.curvature_per_m[run] = at.curvature_per_m;
    }

    #[inline]
    fn path(&self, run: usize, dt_s: f64) -> BodyPath {
        let command = (self.wanted_mps2[run], self.wanted_per_m[run]);
        let arm_m = self.mover.arm_m();
        self.wheels
            .path_under(command, self.anchor(run), arm_m, dt_s)
    }

    /// Moves on as `Mover::follow` does.
    #[inline]
    fn follow(&mut self, run: usize, path: &BodyPath, elapsed_s: f64) {
        let before_mps = self.speed_mps[run];
        let at = path.at(elapsed_s).unwound();
        self.set(run, &at);
        self.accel_mps2[run] = (at.speed_mps - before_mps) / elapsed_s;
    }
}

impl KinematicLanes {
    /// Creates `runs` runs of these bodies, to be spawned in each.
    ///
    /// `None` if one of them is no vehicle.
    pub(crate) fn new<'a>(
        bodies: impl IntoIterator<Item = &'a Body>,
        ground: Ground,
        runs: usize,
    ) -> Option<KinematicLanes> {
        let column = || vec![0.0; runs];
        let vehicles = bodies.into_iter().map(|body| {
            let mover = Mover::spawned(body, ground, Pose::default(), 0.0);
            let Engine::Wheels(wheels) = mover.engine.clone() else {
                return None;
            };
            Some(LaneVehicle {
                mover,
                wheels,
                x_m: column(),
                y_m: column(),
                heading_rad: column(),
                cos: column(),
                sin: column(),
                speed_mps: column(),
                curvature_per_m: column(),
                accel_mps2: column(),
                wanted_mps2: column(),
                wanted_per_m: column(),
            })
        });
        Some(KinematicLanes {
            vehicles: vehicles.collect::<Option<_>>()?,
            faulty: vec![false; runs],
            paths: Vec::new(),
        })
    }

    /// Spawns a body of a run anew, with its front bumper at `pose`.
    pub(crate) fn spawn(
        &mut self,
        (vehicle, body, ground): (usize, &Body, Ground),
        run: usize,
        pose: Pose,
        speed_mps: f64,
    ) {
        let columns = &mut self.vehicles[vehicle];
        let spawned = Mover::spawned(body, ground, pose, speed_mps);
        columns.set(run, &spawned.at);
        columns.accel_mps2[run] = spawned.accel_mps2;
        columns.wanted_mps2[run] = 0.0;
        columns.wanted_per_m[run] = 0.0;
        self.faulty[run] = false;
    }

    /// Commands a net acceleration and a curvature.
    #[inline]
    pub(crate) fn command(
        &mut self,
        vehicle: usize,
        run: usize,
        accel_mps2: f64,
        curvature_per_m: f64,
    ) {
        if !(accel_mps2.is_finite() && curvature_per_m.is_finite()) {
            self.faulty[run] = true;
            return;
        }
        let columns = &mut self.vehicles[vehicle];
        columns.wanted_mps2[run] = accel_mps2;
        columns.wanted_per_m[run] = curvature_per_m;
    }

    /// Advances a run by a sample, up to its first contact.
    #[inline]
    pub(crate) fn advance(&mut self, run: usize, dt_s: f64) -> Option<Contact> {
        self.paths.clear();
        let vehicles = self.vehicles.iter();
        self.paths.extend(vehicles.map(|it| it.path(run, dt_s)));
        let contact = self.first_contact(dt_s);
        let elapsed_s = contact.map_or(dt_s, |contact| contact.after_s);
        // At 0 s a repeated contact must not change the state, nor divide by 0.
        if 0.0 < elapsed_s {
            for (vehicle, path) in self.vehicles.iter_mut().zip(&self.paths) {
                vehicle.follow(run, path, elapsed_s);
            }
        }
        contact
    }

    #[inline]
    fn first_contact(&self, dt_s: f64) -> Option<Contact> {
        let (mut first, mut horizon_s) = (None, dt_s);
        for (b, vehicle_b) in self.vehicles.iter().enumerate() {
            for (a, vehicle_a) in self.vehicles.iter().enumerate().take(b) {
                let paths = (&self.paths[a], &self.paths[b]);
                let movers = (&vehicle_a.mover, &vehicle_b.mover);
                if are_far_apart(movers, paths, horizon_s) {
                    continue;
                }
                // Later pairs need to be searched only up to the best contact so far.
                if let Some((after_s, geometry)) = meet(movers, paths, horizon_s) {
                    horizon_s = after_s;
                    first = Some(geometry.contact((BodyId(a), BodyId(b)), after_s));
                }
            }
        }
        first
    }

    /// Returns the state of a vehicle.
    #[inline]
    pub(crate) fn state(&self, vehicle: usize, run: usize) -> BodyState {
        let columns = &self.vehicles[vehicle];
        columns
            .mover
            .state(&columns.anchor(run), columns.accel_mps2[run])
    }

    /// Returns the memory of all runs.
    pub(crate) fn bytes(&self) -> usize {
        // Ten columns per vehicle.
        let vehicle = size_of::<LaneVehicle>() + 10 * size_of_val(&*self.faulty) * size_of::<f64>();
        self.vehicles.len() * vehicle
            + size_of_val(&*self.faulty)
            + self.paths.capacity() * size_of::<BodyPath>()
    }

    /// Returns whether the physics of a run is within its bounds.
    #[inline]
    pub(crate) fn is_sound(&self, run: usize) -> bool {
        let mut vehicles = self.vehicles.iter();
        !self.faulty[run] && vehicles.all(|it| it.anchor(run).is_bounded())
    }
}

/// Returns what `meet` finds out first, from the positions alone.
#[inline]
fn are_far_apart(
    (a, b): (&Mover, &Mover),
    (path_a, path_b): (&BodyPath, &BodyPath),
    horizon_s: f64,
) -> bool {
    let middle = |mover: &Mover, at: &Anchor| Rect {
        x_m: at.x_m - mover.anchor_ahead_m * at.cos,
        y_m: at.y_m - mover.anchor_ahead_m * at.sin,
        ..Rect::default()
    };
    let (rect_a, rect_b) = (middle(a, &path_a.start), middle(b, &path_b.start));
    let reach_m = (path_a.speed_bound_mps + path_b.speed_bound_mps) * horizon_s;
    far_apart(&a.shape(&rect_a), &b.shape(&rect_b), reach_m)
}
