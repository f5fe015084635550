//! Shapes in which viewers draw bodies, derived from their sizes.

use super::Cast;

/// Maximum length and width of a body that is drawn as a person.
const PERSON_M: f64 = 1.2;

/// Shape in which a body is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
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

impl Cast {
    /// Returns the shape of this body by its size, which covers custom bodies too.
    ///
    /// A walking body that is as large as a car is a moving target dummy. It is
    /// drawn by its size and not as a stretched person.
    pub fn figure(&self) -> Figure {
        let [length_m, width_m, height_m] = self.size_m;
        match self.on_foot && length_m <= PERSON_M && width_m <= PERSON_M {
            true => Figure::Person,
            false if width_m < 1.2 => Figure::TwoWheeler,
            false if height_m < 1.9 => Figure::Car,
            false if length_m < 7.0 => Figure::Van,
            false => Figure::Truck,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Role;

    #[test]
    fn a_body_is_drawn_as_what_it_is_as_large_as() {
        let cases = [
            ((true, [0.5, 0.6, 1.75]), Figure::Person),
            ((true, [4.5, 1.8, 1.5]), Figure::Car),
            ((true, [1.8, 0.6, 1.8]), Figure::TwoWheeler),
            ((false, [0.5, 0.5, 1.0]), Figure::TwoWheeler),
            ((false, [12.0, 2.5, 3.6]), Figure::Truck),
        ];
        for ((on_foot, size_m), figure) in cases {
            let cast = Cast {
                name: "ado".to_owned(),
                role: Role::Ado,
                body: "own".to_owned(),
                size_m,
                colour: [128; 3],
                on_foot,
            };
            assert_eq!(cast.figure(), figure, "{size_m:?}");
        }
    }
}
