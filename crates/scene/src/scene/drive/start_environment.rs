//! Worlds in the environment of a start.
//!
//! A world has the middle of every range of its environment. This file alone
//! replaces it by the values of a start.

use std::sync::Arc;

use super::environment::{EnvironmentQuantity, EnvironmentRange};
use super::layout::DriveLayout;
use super::motion::DriveScene;
use super::sensors::Sensing;
use super::spec::{Agent, DriveSpec};
use super::world::DriveWorld;
use crate::road::CourseError;
use crate::scene::Start;
use crate::sim::Gust;

impl EnvironmentQuantity {
    /// Returns the value in a spec.
    pub fn read(self, spec: &DriveSpec) -> f64 {
        match self {
            EnvironmentQuantity::Friction => spec.road.friction(),
            EnvironmentQuantity::SensorDelay => spec.sensors.delay_s,
            EnvironmentQuantity::PositionNoise => spec.sensors.position_sd_m,
            EnvironmentQuantity::SpeedNoise => spec.sensors.speed_sd_mps,
            EnvironmentQuantity::LaneWidth => spec.road.lane_width_m(),
            // Invariant: a range of a radius belongs to an arc of the road.
            EnvironmentQuantity::ArcRadius { piece } => spec.road.radius_m(piece).unwrap_or(0.0),
            EnvironmentQuantity::SensorRange => spec.sensors.range_m.unwrap_or(f64::INFINITY),
            EnvironmentQuantity::Rise { grade } => {
                spec.grades.get(grade).map_or(0.0, |grade| grade.rise)
            }
            EnvironmentQuantity::WindSpeed => spec.wind.map_or(0.0, |wind| wind.speed_mps),
            EnvironmentQuantity::GustPeak => gust_of(spec).map_or(0.0, |gust| gust.peak_mps),
            EnvironmentQuantity::GustBegin => gust_of(spec).map_or(0.0, |gust| gust.begin_s),
            EnvironmentQuantity::Visibility => {
                let weather = spec.weather.as_ref();
                weather.map_or(f64::INFINITY, |weather| weather.first_visibility_m)
            }
        }
    }

    /// Sets the value in a spec. A delay is rounded to a multiple of the sample.
    pub fn set(self, spec: &mut DriveSpec, value: f64) {
        match self {
            EnvironmentQuantity::Friction => spec.road.set_friction(value),
            EnvironmentQuantity::SensorDelay => {
                let sample_s = spec.clock.sample_s;
                spec.sensors.delay_s = (value / sample_s).round().max(0.0) * sample_s;
            }
            // Perturbed starts may leave their range, and noise is never
            // negative.
            EnvironmentQuantity::PositionNoise => spec.sensors.position_sd_m = value.max(0.0),
            EnvironmentQuantity::SpeedNoise => spec.sensors.speed_sd_mps = value.max(0.0),
            EnvironmentQuantity::LaneWidth => {
                spec.road.set_lane_width_m(value);
                let roads = spec.roads.values_mut();
                for placed in roads.filter(|placed| placed.shares_lane_width) {
                    placed.road.set_lane_width_m(value);
                }
            }
            EnvironmentQuantity::ArcRadius { piece } => spec.road.set_radius_m(piece, value),
            EnvironmentQuantity::SensorRange => spec.sensors.range_m = Some(value.max(0.0)),
            EnvironmentQuantity::Rise { grade } => {
                if let Some(grade) = spec.grades.get_mut(grade) {
                    grade.rise = value;
                }
            }
            EnvironmentQuantity::WindSpeed => {
                if let Some(wind) = &mut spec.wind {
                    wind.speed_mps = value;
                }
            }
            EnvironmentQuantity::GustPeak | EnvironmentQuantity::GustBegin => {
                let gust = spec.wind.as_mut().and_then(|wind| wind.gust.as_mut());
                match (gust, self) {
                    (Some(gust), EnvironmentQuantity::GustPeak) => gust.peak_mps = value,
                    (Some(gust), _) => gust.begin_s = value,
                    (None, _) => {}
                }
            }
            EnvironmentQuantity::Visibility => {
                if let Some(weather) = &mut spec.weather {
                    weather.first_visibility_m = value.max(0.0);
                }
            }
        }
    }
}

fn gust_of(spec: &DriveSpec) -> Option<Gust> {
    spec.wind.and_then(|wind| wind.gust)
}

impl DriveSpec {
    /// Sets the environment that a start draws.
    fn set_environment(&mut self, start: &Start) {
        // The environment has the last values of a start.
        let from = start.0.len().saturating_sub(self.environment.len());
        let drawn: Vec<_> = self
            .environment
            .iter()
            .copied()
            .zip(&start.0[from..])
            .filter(|(it, _)| it.applies)
            .collect();
        for (it, &value) in drawn {
            it.quantity.set(self, value);
        }
    }

    /// Returns by how much a start moves an agent's lane to the left.
    ///
    /// The places of agents are those at the nominal lane width.
    pub(super) fn lane_shift_m(&self, agent: usize) -> f64 {
        let Agent { road, lane, .. } = self.agents[agent];
        let mut environment = self.environment.iter();
        let width = environment.find(|it| it.quantity == EnvironmentQuantity::LaneWidth);
        let shares = match road {
            0 => true,
            road => self.roads[road - 1].shares_lane_width,
        };
        match width {
            Some(it) if shares => lane as f64 * (self.road.lane_width_m() - it.nominal),
            _ => 0.0,
        }
    }

    /// Returns the specs at the ends of the ranges of the road's geometry.
    ///
    /// Agents start beside the middle of their lanes there. Without such ranges,
    /// the list is empty.
    pub fn extreme_roads(&self) -> Vec<DriveSpec> {
        let of_geometry = self.environment.iter();
        let drawn: Vec<EnvironmentRange> = of_geometry
            .copied()
            .filter(|it| it.quantity.is_of_geometry())
            .collect();
        if drawn.is_empty() {
            return Vec::new();
        }
        // Arcs bend independently of the lanes' width, so both ends of one are
        // combined with both ends of the other.
        let ends = [(false, false), (false, true), (true, false), (true, true)];
        let specs = ends.map(|(is_wide, has_greatest_radii)| {
            let mut spec = self.clone();
            for it in &drawn {
                let is_greatest = match it.quantity {
                    EnvironmentQuantity::LaneWidth => is_wide,
                    _ => has_greatest_radii,
                };
                let end = if is_greatest {
                    it.range.hi
                } else {
                    it.range.lo
                };
                it.quantity.set(&mut spec, end);
            }
            for agent in 0..spec.agents.len() {
                let by_m = spec.lane_shift_m(agent);
                spec.agents[agent].lateral_m.lo += by_m;
                spec.agents[agent].lateral_m.hi += by_m;
            }
            spec
        });
        specs.into()
    }

    /// Keeps the present values of some quantities, whatever a start draws.
    pub fn fix_environment(&mut self, fixes: impl Fn(EnvironmentRange) -> bool) {
        for it in &mut self.environment {
            // The axis stays, so that starts keep their number of values.
            it.applies &= !fixes(*it);
        }
    }
}

impl DriveLayout {
    /// Returns the layout in the environment of a start.
    ///
    /// # Errors
    /// The road cannot be laid, which happens to perturbed starts only.
    pub(super) fn at_start(
        self: &Arc<DriveLayout>,
        start: &Start,
    ) -> Result<Arc<DriveLayout>, CourseError> {
        // The road of an earlier episode may have pieces that an ado laid.
        let has_laid_pieces = self.spec.has_laid_pieces();
        if self.spec.environment.is_empty() && !has_laid_pieces {
            return Ok(Arc::clone(self));
        }
        // Signals and formulas depend on none of these quantities.
        let mut layout = DriveLayout::clone(self);
        let spec = Arc::make_mut(&mut layout.spec);
        spec.remove_laid_pieces();
        spec.set_environment(start);
        let mut environment = spec.environment.iter();
        // A network is expensive to build, so only a change of geometry builds
        // one.
        if has_laid_pieces || environment.any(|it| it.quantity.is_of_geometry()) {
            layout.network = Arc::new(spec.network()?);
        }
        Ok(Arc::new(layout))
    }
}

impl DriveScene {
    /// Begins the environment that a start draws.
    ///
    /// # Errors
    /// The road cannot be laid. The scene then keeps its present one.
    pub(super) fn set_environment(&mut self, start: &Start) -> Result<(), CourseError> {
        let layout = self.layout.at_start(start)?;
        // Without ranges every start has the same environment.
        if Arc::ptr_eq(&layout, &self.layout) {
            return Ok(());
        }
        self.state.change_roads(&layout.spec, &layout.network);
        self.sensing = Sensing::new(layout.spec.sensors, layout.spec.clock.sample_s);
        if !Arc::ptr_eq(&layout.network, &self.layout.network) {
            // An ego knows the geometry by its briefing.
            self.controller.brief(&layout.briefing());
        }
        self.layout = layout;
        Ok(())
    }
}

impl DriveWorld {
    /// Returns the same world in the environment that a start draws.
    ///
    /// Its axes are those of this world. Without ranges in the environment, it is
    /// this world. It also is if the road of a perturbed start cannot be laid,
    /// because no episode begins there.
    pub fn at_start(&self, start: &Start) -> DriveWorld {
        self.0
            .at_start(start)
            .map_or_else(|_| self.clone(), DriveWorld)
    }
}
