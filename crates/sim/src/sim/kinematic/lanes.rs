//! Many runs of the same vehicles side by side, as a structure of arrays.
//!
//! Each quantity of a vehicle is a column with an entry per run. A run is loaded from
//! its columns, moved for some samples, and stored again. The motion is that of
//! [`Kinematic`](super::Kinematic), by the same functions, so the bits are the same.

use super::approach::meet;
use super::engine::Engine;
use super::mover::{Mover, state_of};
use super::path::Anchor;
use super::wheels::{ArcPath, Wheels};
use crate::sim::planar::{Rect, far_apart};
use crate::sim::{Body, BodyId, BodyState, Contact, Ground, Pose};

/// Vehicles of many runs on the kinematic plant, on flat ground of constant friction.
pub struct KinematicLanes {
    vehicles: Vec<LaneVehicle>,
    /// True if the loaded run got a command that is not finite.
    is_faulty: bool,
}

/// One vehicle in every run.
struct LaneVehicle {
    /// Its dimensions. The state in it is not used.
    mover: Mover,
    wheels: Wheels,
    arm_m: f64,
    front_ahead_m: f64,
    /// In the loaded run: state, acceleration and commanded acceleration and curvature.
    at: Anchor,
    accel_mps2: f64,
    command: (f64, f64),
    path: ArcPath,
    /// In every run: the columns of the state, and of the acceleration.
    columns: [Vec<f64>; COLUMNS],
}

const COLUMNS: usize = 8;

impl LaneVehicle {
    fn new(body: &Body, ground: Ground, runs: usize) -> Option<LaneVehicle> {
        let mover = Mover::spawned(body, ground, Pose::default(), 0.0);
        let Engine::Wheels(wheels) = mover.engine.clone() else {
            return None;
        };
        let (at, arm_m) = (mover.at, mover.arm_m());
        Some(LaneVehicle {
            // A placeholder, because `advance` replaces the path before
            // anything reads it.
            path: wheels.arc_under(0.0, 0.0, at, arm_m, 0.0),
            front_ahead_m: mover.front_ahead_m(),
            accel_mps2: 0.0,
            command: (0.0, 0.0),
            columns: std::array::from_fn(|_| vec![0.0; runs]),
            mover,
            wheels,
            arm_m,
            at,
        })
    }

    #[inline]
    fn load(&mut self, run: usize) {
        let [x, y, heading, cos, sin, speed, curvature, accel] = &self.columns;
        self.at = Anchor {
            x_m: x[run],
            y_m: y[run],
            heading_rad: heading[run],
            cos: cos[run],
            sin: sin[run],
            speed_mps: speed[run],
            curvature_per_m: curvature[run],
            // Vehicles have neither.
            walk_mps: (0.0, 0.0),
            yaw_rate_rad_per_s: 0.0,
        };
        self.accel_mps2 = accel[run];
    }

    #[inline]
    fn store(&mut self, run: usize) {
        let at = &self.at;
        let numbers = [
            at.x_m,
            at.y_m,
            at.heading_rad,
            at.cos,
            at.sin,
            at.speed_mps,
            at.curvature_per_m,
            self.accel_mps2,
        ];
        for (column, number) in self.columns.iter_mut().zip(numbers) {
            column[run] = number;
        }
    }

    /// Moves on as `Mover::follow` does.
    #[inline]
    fn follow(&mut self, elapsed_s: f64) {
        let before_mps = self.at.speed_mps;
        // Unwound after every sample, because the plant does it and the bits
        // must agree.
        self.at = Wheels::after(self.path.start, self.path.drive, elapsed_s).unwound();
        self.accel_mps2 = (self.at.speed_mps - before_mps) / elapsed_s;
    }
}

impl KinematicLanes {
    /// Creates `runs` runs of these bodies, to be spawned in each.
    ///
    /// `None` if one of them is no vehicle.
    pub fn new<'a>(
        bodies: impl IntoIterator<Item = &'a Body>,
        ground: Ground,
        runs: usize,
    ) -> Option<KinematicLanes> {
        let bodies = bodies.into_iter();
        let vehicles = bodies.map(|body| LaneVehicle::new(body, ground, runs));
        Some(KinematicLanes {
            vehicles: vehicles.collect::<Option<_>>()?,
            is_faulty: false,
        })
    }

    /// Spawns a vehicle of the loaded run anew, with its front bumper at `pose`.
    pub fn spawn(
        &mut self,
        vehicle: usize,
        body: &Body,
        ground: Ground,
        pose: Pose,
        speed_mps: f64,
    ) {
        let spawned = Mover::spawned(body, ground, pose, speed_mps);
        let vehicle = &mut self.vehicles[vehicle];
        // Only the state is copied: sizes and limits are the same in every
        // run.
        (vehicle.at, vehicle.accel_mps2) = (spawned.at, spawned.accel_mps2);
    }

    /// Loads a run from its columns.
    #[inline]
    pub fn load(&mut self, run: usize) {
        self.vehicles.iter_mut().for_each(|it| it.load(run));
        // A fault belongs to one run and must not end the next.
        self.is_faulty = false;
    }

    /// Stores the loaded run in the columns of a run.
    #[inline]
    pub fn store(&mut self, run: usize) {
        self.vehicles.iter_mut().for_each(|it| it.store(run));
    }

    /// Commands a net acceleration and a curvature for the next sample.
    #[inline]
    pub fn command(&mut self, vehicle: usize, accel_mps2: f64, curvature_per_m: f64) {
        // Kept until `advance`, because a command has no result.
        self.is_faulty |= !(accel_mps2.is_finite() && curvature_per_m.is_finite());
        self.vehicles[vehicle].command = (accel_mps2, curvature_per_m);
    }

    /// Advances the loaded run by a sample, up to its first contact.
    ///
    /// `None` if its physics broke down, and the run is over.
    #[inline]
    pub fn advance(&mut self, dt_s: f64) -> Option<Option<Contact>> {
        if self.is_faulty {
            return None;
        }
        for it in &mut self.vehicles {
            let (accel_mps2, curvature_per_m) = it.command;
            it.path = it
                .wheels
                .arc_under(accel_mps2, curvature_per_m, it.at, it.arm_m, dt_s);
        }
        let contact = self.first_contact(dt_s);
        let elapsed_s = contact.map_or(dt_s, |contact| contact.after_s);
        // At 0 s a repeated contact must not change the state, nor divide by 0.
        if elapsed_s > 0.0 {
            self.vehicles.iter_mut().for_each(|it| it.follow(elapsed_s));
        }
        let is_sound = self.vehicles.iter().all(|it| it.at.is_bounded());
        is_sound.then_some(contact)
    }

    #[inline]
    fn first_contact(&self, dt_s: f64) -> Option<Contact> {
        let (mut first, mut horizon_s) = (None, dt_s);
        // The order of pairs is that of the plant, so that ties give the same
        // contact.
        for (b, vehicle_b) in self.vehicles.iter().enumerate() {
            for (a, vehicle_a) in self.vehicles[..b].iter().enumerate() {
                // Cheaper than the search for a contact, which most pairs never need.
                if are_far_apart(vehicle_a, vehicle_b, horizon_s) {
                    continue;
                }
                let (a_on, b_on) = (vehicle_a.path.path(), vehicle_b.path.path());
                let contact = meet(&vehicle_a.mover, &a_on, &vehicle_b.mover, &b_on, horizon_s);
                // Later pairs need to be searched only up to the best contact so far.
                if let Some((after_s, geometry)) = contact {
                    horizon_s = after_s;
                    first = Some(geometry.contact((BodyId(a), BodyId(b)), after_s));
                }
            }
        }
        first
    }

    /// Returns the state of a vehicle in the loaded run.
    #[inline]
    pub fn state(&self, vehicle: usize) -> BodyState {
        let it = &self.vehicles[vehicle];
        let motion = Wheels::motion(&it.at);
        state_of(&it.at, motion, it.front_ahead_m, it.accel_mps2)
    }

    /// Returns the clearance of two vehicles in the loaded run.
    pub fn gap_m(&self, [a, b]: [usize; 2]) -> f64 {
        let (a, b) = (&self.vehicles[a], &self.vehicles[b]);
        let (rect_a, rect_b) = (a.mover.rect(&a.at), b.mover.rect(&b.at));
        a.mover.shape(&rect_a).gap_m(&b.mover.shape(&rect_b))
    }

    /// Returns the memory of all runs.
    pub fn bytes(&self) -> usize {
        let columns = self
            .vehicles
            .iter()
            .flat_map(|it| &it.columns)
            .map(|column| column.capacity() * size_of::<f64>());
        self.vehicles.capacity() * size_of::<LaneVehicle>() + columns.sum::<usize>()
    }
}

/// Returns what `meet` finds out first, from the positions alone.
#[inline]
fn are_far_apart(a: &LaneVehicle, b: &LaneVehicle, horizon_s: f64) -> bool {
    // Circles need the middle alone, without heading and velocity.
    let middle = |it: &LaneVehicle| {
        let (at, back_m) = (&it.path.start, -it.mover.anchor_ahead_m);
        Rect {
            x_m: at.x_m + back_m * at.cos,
            y_m: at.y_m + back_m * at.sin,
            ..Rect::default()
        }
    };
    let (rect_a, rect_b) = (middle(a), middle(b));
    let reach_m = (a.path.speed_bound_mps + b.path.speed_bound_mps) * horizon_s;
    far_apart(&a.mover.shape(&rect_a), &b.mover.shape(&rect_b), reach_m)
}
