//! The 2D plant: bicycle models in closed form, f64 throughout.
//!
//! Within one `advance` a vehicle keeps its acceleration and curvature, so its
//! rear axle runs along an arc. A walker's velocity changes evenly up to the
//! commanded velocity. Both have closed forms. A cyclist's lean is integrated in
//! steps of 10 ms at most. Substeps therefore change nothing.
//! Contacts are found by conservative advancement on the separating axes, exact
//! to 1e-9 m. Bodies on one line at constant speed need one evaluation.

mod approach;
mod bicycle;
mod engine;
mod kinematic_playback;
mod lanes;
mod legs;
mod mover;
mod path;
mod wheels;

use self::approach::meet;
use self::kinematic_playback::Passing;
pub use self::lanes::KinematicLanes;
use self::mover::Mover;
use self::path::BodyPath;
use super::body::Body;
use super::{
    BodyCommand, BodyId, BodyState, Contact, Ground, Placement, Plant, PlantKind, Pose, Push,
};

/// Kinematic plant.
#[derive(Clone, Debug)]
pub struct Kinematic {
    ground: Ground,
    movers: Vec<Mover>,
    /// Paths of the current `advance`, kept to avoid an allocation.
    paths: Vec<BodyPath>,
    faulty: bool,
    passing: bool,
}

impl Kinematic {
    /// Creates an empty plant.
    pub fn new(ground: Ground) -> Kinematic {
        Kinematic {
            ground,
            movers: Vec::new(),
            paths: Vec::new(),
            faulty: false,
            passing: false,
        }
    }

    fn first_contact(&self, dt_s: f64) -> Option<Contact> {
        if self.passing {
            return None;
        }
        let mut first: Option<Contact> = None;
        let mut horizon_s = dt_s;
        for (b, mover_b) in self.movers.iter().enumerate() {
            for (a, mover_a) in self.movers.iter().enumerate().take(b) {
                // Recorded motions may cross each other, so only their contacts with
                // other bodies count.
                if mover_a.passes_others() && mover_b.passes_others() {
                    continue;
                }
                let (path_a, path_b) = (&self.paths[a], &self.paths[b]);
                let Some((after_s, contact_geometry)) =
                    meet(mover_a, path_a, mover_b, path_b, horizon_s)
                else {
                    continue;
                };
                // Later pairs need to be searched only up to the best contact so far.
                horizon_s = after_s;
                first = Some(contact_geometry.contact((BodyId(a), BodyId(b)), after_s));
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
        // `passing` survives, as `Plant::pass_through` documents.
        self.faulty = false;
    }

    fn set_ground(&mut self, ground: Ground) {
        self.ground = ground;
        for mover in &mut self.movers {
            mover.engine.set_ground(ground);
        }
    }

    fn pass_through(&mut self) {
        self.passing = true;
    }

    fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) -> BodyId {
        self.movers
            .push(Mover::spawned(body, self.ground, pose, speed_mps));
        BodyId(self.movers.len() - 1)
    }

    fn command(&mut self, id: BodyId, command: BodyCommand) {
        let Some(command) = super::finite(command) else {
            self.faulty = true;
            return;
        };
        let mover = &mut self.movers[id.0];
        match command {
            BodyCommand::Glide { to } => mover.glide(&to, Passing::Others),
            BodyCommand::Carry { to } => mover.glide(&to, Passing::Nothing),
            // Bodies that jump in a replay pass gliding ones as these pass each other.
            BodyCommand::Jump { to } => {
                // The next path then has no length, so the jump touches
                // nothing on its way.
                mover.glide(&to, Passing::Others);
                mover.arrive();
            }
            command => self.faulty |= !mover.engine.command(command),
        }
    }

    fn push(&mut self, id: BodyId, push: Push) {
        self.faulty |= !push.is_finite();
        self.movers[id.0].engine.set_push(push);
    }

    fn advance(&mut self, dt_s: f64, _substeps: u32) -> Option<Contact> {
        self.paths.clear();
        self.paths
            .extend(self.movers.iter().map(|mover| mover.path(dt_s)));
        let contact = self.first_contact(dt_s);
        let elapsed_s = contact.map_or(dt_s, |contact| contact.after_s);
        // At 0 s a repeated contact must not change the state, nor divide by 0.
        if elapsed_s > 0.0 {
            for (mover, path) in self.movers.iter_mut().zip(&self.paths) {
                mover.follow(path, elapsed_s);
            }
        }
        contact
    }

    fn state(&self, id: BodyId) -> BodyState {
        self.movers[id.0].state()
    }

    fn placement(&self, id: BodyId) -> Placement {
        let mover = &self.movers[id.0];
        let rect = mover.rect(&mover.at);
        let centre_m = [rect.x_m, rect.y_m, 0.5 * mover.extent.height_m];
        Placement::upright(centre_m, mover.at.heading_rad)
    }

    fn gap_m(&self, a: BodyId, b: BodyId) -> f64 {
        let (mover_a, mover_b) = (&self.movers[a.0], &self.movers[b.0]);
        let (rect_a, rect_b) = (mover_a.rect(&mover_a.at), mover_b.rect(&mover_b.at));
        mover_a.shape(&rect_a).gap_m(&mover_b.shape(&rect_b))
    }

    fn sound(&self) -> bool {
        !self.faulty && self.movers.iter().all(|mover| mover.at.is_bounded())
    }

    fn fork(&self) -> Box<dyn Plant> {
        Box::new(self.clone())
    }
}
