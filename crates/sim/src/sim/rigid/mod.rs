//! The 3D plant: ray-cast cars on rapier3d, contacts by parry3d.
//!
//! Every vehicle is one rigid body on four wheels. A wheel is a ray with a
//! spring, a damper and a friction circle. The body pitches, rolls and slips,
//! but cannot roll over. Walkers and cyclists do not justify a rigid body and move
//! as on the kinematic plant.
//!
//! Architecture Invariant: rapier's pipeline makes every step of every vehicle. Up to
//! the first contact it lets bodies collide with the ground only. [`Rigid::advance`] ends
//! at that contact, found by parry between the shapes of the bodies, and leaves every
//! body at its pose of that instant. After [`Rigid::collide`] all bodies collide.

mod bicycle;
mod car;
mod chassis_motion;
mod collisions;
mod foot;
mod kinematic_playback;
mod lag;
mod loose;
mod motor;
mod shape;
mod surface;
#[cfg(test)]
mod surface_tests;
mod touch;
mod tyre_forces;
mod world;

use std::sync::Arc;

pub use self::surface::GroundSurface;

use self::bicycle::Bicycle;
use self::car::Car;
use self::collisions::Collisions;
use self::foot::Foot;
use self::kinematic_playback::PlaybackBody;
use self::loose::LooseBody;
use self::motor::{Motor, Stance};
use self::shape::CollisionShape;
use self::touch::{SweptBody, touch};
use self::world::RapierWorld;
use super::planar::{ContactGeometry, Extent, Rect};
use super::{
    Body, BodyCommand, BodyId, BodyKind, BodyState, Collision, Contact, Ground, Placement, Plant,
    PlantKind, Pose, Push,
};

/// Distance from the origin beyond which the plant is unsound.
const BOUND_M: f64 = 1e6;
/// Speed bound. rapier caps speeds at 400 m/s, far above road traffic.
const BOUND_MPS: f64 = 200.0;

/// Steps of rapier per substep once bodies collide.
const FINER_STEPS: u32 = 4;

/// Rigid plant.
#[derive(Clone)]
pub struct Rigid {
    ground: Ground,
    world: RapierWorld,
    movers: Vec<RigidMover>,
    sweeps: Vec<SweptBody>,
    faulty: bool,
    passing: bool,
    /// Record of the collisions, once bodies collide.
    collisions: Option<Collisions>,
}

#[derive(Clone)]
struct RigidMover {
    motor: Box<dyn Motor>,
    body: Arc<Body>,
    accel_mps2: f64,
    /// Speed at the beginning of the current `advance`.
    before_mps: f64,
}

/// Earliest contact within one step.
struct FirstTouch {
    pair: (BodyId, BodyId),
    /// Share of the step before the contact.
    share: f64,
    contact_geometry: ContactGeometry,
}

impl RigidMover {
    /// Returns the footprint, and on a surface the pose in space.
    fn stance(&self, world: &RapierWorld) -> Stance {
        let rect = self.motor.rect(world);
        let has_surface = world.has_surface();
        let pose = has_surface.then(|| self.motor.pose(world, &rect));
        Stance { rect, pose }
    }
}

impl Rigid {
    /// Creates an empty plant.
    pub fn new(ground: Ground) -> Rigid {
        Rigid {
            ground,
            world: RapierWorld::new(ground.friction),
            movers: Vec::new(),
            sweeps: Vec::new(),
            faulty: false,
            passing: false,
            collisions: None,
        }
    }

    /// Creates a plant with the bodies of another one, in their order and motion.
    pub fn taking_over<'a>(
        ground: Ground,
        surface: Option<&GroundSurface>,
        bodies: impl IntoIterator<Item = (&'a Body, BodyState)>,
    ) -> Rigid {
        let mut plant = Rigid::new(ground);
        plant.lay(surface);
        for (body, state) in bodies {
            let mut rect = rect_at(body, state.pose, state.speed_mps);
            // From the front bumper to the middle, which swings less in a turn.
            let rate = state.yaw_rate_rad_per_s;
            let left_mps = state.lateral_mps - rate * body.half_length_m();
            rect.vx_mps -= left_mps * rect.sin;
            rect.vy_mps += left_mps * rect.cos;
            rect.yaw_rate_rad_per_s = rate;
            plant.add(body, &rect);
        }
        plant
    }

    /// Puts a body on the ground, in motion.
    fn add(&mut self, body: &Body, rect: &Rect) -> BodyId {
        let shape = CollisionShape::of(body);
        let mover = RigidMover {
            motor: motor(&mut self.world, body, &shape, self.ground, rect),
            body: Arc::new(body.clone()),
            accel_mps2: 0.0,
            before_mps: rect.along_mps(),
        };
        self.sweeps.push(SweptBody::resting(
            mover.stance(&self.world),
            Extent::of(body),
            shape,
        ));
        self.movers.push(mover);
        BodyId(self.movers.len() - 1)
    }

    fn step(&mut self, dt_s: f64) {
        // All motors act before rapier steps, so the order of bodies does not matter.
        for (mover, sweep) in self.movers.iter_mut().zip(&self.sweeps) {
            mover.motor.act(&mut self.world, &sweep.after, dt_s);
        }
        self.world.step(dt_s);
        for (mover, sweep) in self.movers.iter_mut().zip(&mut self.sweeps) {
            mover.motor.settle(&mut self.world, dt_s);
            sweep.move_on(mover.stance(&self.world));
        }
    }

    /// Runs one step in which bodies collide.
    fn step_colliding(&mut self, dt_s: f64) {
        let Some(collisions) = &mut self.collisions else {
            return;
        };
        for (mover, sweep) in self.movers.iter_mut().zip(&self.sweeps) {
            mover.motor.act(&mut self.world, &sweep.after, dt_s);
        }
        let before = collisions.velocities(&self.world);
        self.world.step(dt_s);
        for body in collisions.record(&self.world, &before, dt_s) {
            self.movers[body].motor.release(&mut self.world);
        }
        for (mover, sweep) in self.movers.iter().zip(&mut self.sweeps) {
            sweep.move_on(mover.stance(&self.world));
        }
    }

    fn first_touch(&self) -> Option<FirstTouch> {
        if self.passing {
            return None;
        }
        let mut first: Option<FirstTouch> = None;
        for (b, sweep_b) in self.sweeps.iter().enumerate() {
            for (a, sweep_a) in self.sweeps.iter().enumerate().take(b) {
                let Some((share, contact_geometry)) = touch(sweep_a, sweep_b) else {
                    continue;
                };
                // Strictly less, so that of equal shares the pair with the
                // lowest numbers wins.
                if first.as_ref().is_none_or(|best| share < best.share) {
                    let pair = (BodyId(a), BodyId(b));
                    first = Some(FirstTouch {
                        pair,
                        share,
                        contact_geometry,
                    });
                }
            }
        }
        first
    }

    /// Moves all bodies back to a share of the last step.
    fn rewind(&mut self, share: f64) {
        for (mover, sweep) in self.movers.iter_mut().zip(&mut self.sweeps) {
            mover.motor.rewind(&mut self.world, share);
            // At rest at the contact, so that the next `advance` starts from there.
            sweep.rest(mover.stance(&self.world));
        }
    }
}

impl Plant for Rigid {
    fn kind(&self) -> PlantKind {
        PlantKind::Rigid
    }

    fn clear(&mut self, ground: Ground) {
        self.ground = ground;
        self.world = RapierWorld::new(ground.friction);
        self.movers.clear();
        self.sweeps.clear();
        // `passing` survives, as `Plant::pass_through` documents.
        self.faulty = false;
        self.collisions = None;
    }

    fn lay(&mut self, surface: Option<&GroundSurface>) {
        self.world.lay(surface.cloned());
    }

    fn set_ground(&mut self, ground: Ground) {
        self.ground = ground;
        self.world.set_friction(ground.friction);
        for mover in &mut self.movers {
            mover.motor.set_ground(ground);
        }
    }

    fn pass_through(&mut self) {
        self.passing = true;
    }

    fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) -> BodyId {
        self.add(body, &rect_at(body, pose, speed_mps))
    }

    fn collide(&mut self, touching: (BodyId, BodyId)) -> bool {
        // Bodies that pass through each other have no contact to resolve.
        if self.passing {
            return false;
        }
        self.world.solid();
        let at = &self.sweeps[touching.0.0].after;
        // Near the contact, because f32 positions are finest near their
        // origin.
        let origin_m = self.world.origin_near(at.x_m, at.y_m);
        let mut ids = Vec::with_capacity(self.movers.len());
        for (mover, sweep) in self.movers.iter_mut().zip(&self.sweeps) {
            // Vehicles are in rapier already, and other bodies enter here.
            ids.push(match mover.motor.join(&mut self.world, origin_m) {
                Some(id) => id,
                None => {
                    let (shape, rect) = (&sweep.shape, &sweep.after);
                    let loose = LooseBody::new(&mut self.world, &mover.body, shape, rect, origin_m);
                    let id = loose.id();
                    mover.motor = Box::new(loose);
                    id
                }
            });
        }
        // These two have collided already, before the first step of rapier.
        for body in [touching.0, touching.1] {
            self.movers[body.0].motor.release(&mut self.world);
        }
        self.collisions = Some(Collisions::new(ids));
        true
    }

    fn collisions(&mut self) -> Vec<Collision> {
        self.collisions
            .as_mut()
            .map_or(Vec::new(), Collisions::take)
    }

    fn command(&mut self, id: BodyId, command: BodyCommand) {
        let Some(command) = super::finite(command) else {
            self.faulty = true;
            return;
        };
        let motor = &mut self.movers[id.0].motor;
        let carries = matches!(
            command,
            BodyCommand::Carry { .. } | BodyCommand::Jump { .. }
        );
        if carries && !motor.is_carried() {
            // From now on rapier holds nothing of this body.
            motor.leave(&mut self.world);
            let sweep = &self.sweeps[id.0];
            *motor = Box::new(PlaybackBody::new(sweep.after, sweep.extent));
        }
        self.faulty |= !motor.command(command);
        if let BodyCommand::Jump { .. } = command {
            let stance = self.movers[id.0].stance(&self.world);
            // At rest there, so that the way there is not swept.
            self.sweeps[id.0].rest(stance);
        }
    }

    fn push(&mut self, id: BodyId, push: Push) {
        self.faulty |= !push.is_finite();
        self.movers[id.0].motor.set_push(push);
    }

    fn advance(&mut self, dt_s: f64, substeps: u32) -> Option<Contact> {
        for (mover, sweep) in self.movers.iter_mut().zip(&mut self.sweeps) {
            mover.before_mps = sweep.after.along_mps();
            mover.motor.begin(dt_s);
        }
        let is_colliding = self.collisions.is_some();
        let finer = if is_colliding { FINER_STEPS } else { 1 };
        // 0 substeps of a caller would divide by 0.
        let steps = substeps.max(1) * finer;
        let step_s = dt_s / f64::from(steps);
        let mut contact = None;
        let mut elapsed_s = dt_s;
        for index in 0..steps {
            if is_colliding {
                self.step_colliding(step_s);
                continue;
            }
            // A step of 0 s is not simulated, but a contact is still reported.
            if step_s > 0.0 {
                self.step(step_s);
            }
            let Some(FirstTouch {
                pair,
                share,
                contact_geometry,
            }) = self.first_touch()
            else {
                continue;
            };
            self.rewind(share);
            elapsed_s = step_s * (f64::from(index) + share);
            contact = Some(contact_geometry.contact(pair, elapsed_s));
            break;
        }
        // A contact reported again after 0 s keeps the acceleration and
        // divides by nothing.
        if elapsed_s > 0.0 {
            for (mover, sweep) in self.movers.iter_mut().zip(&self.sweeps) {
                mover.accel_mps2 = (sweep.after.along_mps() - mover.before_mps) / elapsed_s;
            }
        }
        contact
    }

    fn state(&self, id: BodyId) -> BodyState {
        let after = &self.sweeps[id.0].after;
        let Rect {
            x_m,
            y_m,
            cos,
            sin,
            vx_mps,
            vy_mps,
            yaw_rate_rad_per_s,
        } = *after;
        let ahead_m = self.sweeps[id.0].extent.half_length_m;
        BodyState {
            pose: Pose {
                x_m: x_m + ahead_m * cos,
                y_m: y_m + ahead_m * sin,
                heading_rad: libm::atan2(sin, cos),
            },
            speed_mps: after.along_mps(),
            // At the front, which swings out of the path of the middle in a turn.
            lateral_mps: vy_mps * cos - vx_mps * sin + yaw_rate_rad_per_s * ahead_m,
            yaw_rate_rad_per_s,
            accel_mps2: self.movers[id.0].accel_mps2,
        }
    }

    fn placement(&self, id: BodyId) -> Placement {
        let mover = &self.movers[id.0];
        mover.motor.placement(&self.world, mover.body.height_m)
    }

    fn gap_m(&self, a: BodyId, b: BodyId) -> f64 {
        self.sweeps[a.0].gap_m(&self.sweeps[b.0])
    }

    fn rapier_steps(&self) -> u64 {
        self.world.steps()
    }

    fn sound(&self) -> bool {
        // NaN compares false, so it is unsound.
        let fine = |sweep: &SweptBody| {
            let Rect {
                x_m,
                y_m,
                vx_mps,
                vy_mps,
                yaw_rate_rad_per_s,
                ..
            } = sweep.after;
            [x_m, y_m].into_iter().all(|value| value.abs() <= BOUND_M)
                && [vx_mps, vy_mps]
                    .into_iter()
                    .all(|value| value.abs() <= BOUND_MPS)
                && yaw_rate_rad_per_s.is_finite()
        };
        !self.faulty && self.sweeps.iter().all(fine)
    }

    fn fork(&self) -> Box<dyn Plant> {
        Box::new(self.clone())
    }
}

/// Returns the footprint of a body whose front bumper has a pose, moving along it.
fn rect_at(body: &Body, pose: Pose, speed_mps: f64) -> Rect {
    let (sin, cos) = libm::sincos(pose.heading_rad);
    let back_m = body.half_length_m();
    Rect {
        x_m: pose.x_m - back_m * cos,
        y_m: pose.y_m - back_m * sin,
        cos,
        sin,
        vx_mps: speed_mps * cos,
        vy_mps: speed_mps * sin,
        yaw_rate_rad_per_s: 0.0,
    }
}

/// Puts a body into the world with its motion model.
fn motor(
    world: &mut RapierWorld,
    body: &Body,
    shape: &CollisionShape,
    ground: Ground,
    rect: &Rect,
) -> Box<dyn Motor> {
    match &body.kind {
        BodyKind::Vehicle(vehicle) => Box::new(Car::new(world, body, shape, vehicle, ground, rect)),
        BodyKind::Cyclist(cyclist) => Box::new(Bicycle::new(body, cyclist, ground, rect)),
        BodyKind::Walker(walker) => Box::new(Foot::new(walker, rect)),
    }
}
