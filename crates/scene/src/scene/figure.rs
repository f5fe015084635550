//! Shapes in which viewers draw bodies, derived from their sizes.

use super::{AgentDescription, Role};
use crate::sim::Body;

/// Maximum length and width of a body that is drawn as a person.
const PERSON_M: f64 = 1.2;

/// Shape in which a body is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyFigure {
    /// A pedestrian.
    Person,
    /// A bicycle or a motorcycle, with its rider.
    TwoWheeler,
    /// A passenger car.
    Car,
    /// A delivery van.
    Van,
    /// A lorry: a cab and a box.
    Truck,
}

impl AgentDescription {
    /// Returns the description of an agent with a body.
    pub fn of(name: &str, role: Role, body: &Body) -> AgentDescription {
        AgentDescription {
            name: name.to_owned(),
            role,
            body: body.name.clone(),
            size_m: [body.length_m, body.width_m, body.height_m],
            shape: body.shape.clone(),
            colour: body.color_rgb,
            on_foot: body.is_on_foot(),
        }
    }

    /// Returns the shape of this body by its size, which covers custom bodies too.
    ///
    /// A walking body that is as large as a car is a moving target dummy. It is
    /// drawn by its size and not as a stretched person.
    pub fn figure(&self) -> BodyFigure {
        let [length_m, width_m, height_m] = self.size_m;
        if self.on_foot && length_m <= PERSON_M && width_m <= PERSON_M {
            BodyFigure::Person
        // Two-wheelers are narrow, cars low and vans short, each unlike the kinds
        // below.
        } else if width_m < 1.2 {
            BodyFigure::TwoWheeler
        } else if height_m < 1.9 {
            BodyFigure::Car
        } else if length_m < 7.0 {
            BodyFigure::Van
        } else {
            BodyFigure::Truck
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Role;
    use crate::sim::BodyShape;

    #[test]
    fn a_body_is_drawn_as_what_it_is_as_large_as() {
        let cases = [
            ((true, [0.5, 0.6, 1.75]), BodyFigure::Person),
            ((true, [4.5, 1.8, 1.5]), BodyFigure::Car),
            ((true, [1.8, 0.6, 1.8]), BodyFigure::TwoWheeler),
            ((false, [0.5, 0.5, 1.0]), BodyFigure::TwoWheeler),
            ((false, [12.0, 2.5, 3.6]), BodyFigure::Truck),
        ];
        for ((on_foot, size_m), figure) in cases {
            let agent = AgentDescription {
                name: "ado".to_owned(),
                role: Role::Ado,
                body: "own".to_owned(),
                size_m,
                shape: BodyShape::Box,
                colour: [128; 3],
                on_foot,
            };
            assert_eq!(agent.figure(), figure, "{size_m:?}");
        }
    }
}
