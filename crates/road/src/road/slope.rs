//! Profile of a road: grades, the vertical curves between them, and banks.

use serde::{Deserialize, Serialize};

/// Greatest rise of a road per length.
pub const MAX_RISE: f64 = 0.3;

/// Grade of a road from a station on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// Station at which it begins.
    pub from_s_m: f64,
    /// Rise per length along the ground, positive uphill towards greater s.
    pub rise: f64,
}

/// Slope across a road at a station. Between two stations it changes evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bank {
    /// Station.
    pub s_m: f64,
    /// Rise per length to the left, positive where the left side is higher.
    pub slope: f64,
}

/// Heights of a road, for its length and its width.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RoadProfile<'a> {
    /// Grades by station. Before its station the first one holds.
    pub grades: &'a [Grade],
    /// Length of the vertical curve, a parabola, from one grade to the next.
    ///
    /// Its middle is the station of the next grade. 0 is an edge.
    pub vertical_curve_m: f64,
    /// Banks by station. Before the first and behind the last one they stay.
    pub banks: &'a [Bank],
    /// Height at station 0.
    pub z_m: f64,
}

/// Integrals of the grades from the first one on, without vertical curves.
struct GradeIntegrals {
    height_m: f64,
    /// Integral of the height.
    area_m2: f64,
}

impl RoadProfile<'_> {
    /// Returns whether the road is a plane at height 0.
    pub fn is_flat(&self) -> bool {
        self.z_m == 0.0
            && self.grades.iter().all(|grade| grade.rise == 0.0)
            && self.banks.iter().all(|bank| bank.slope == 0.0)
    }

    /// Returns the rise per length along the ground at a station.
    pub fn rise(&self, s_m: f64) -> f64 {
        if self.vertical_curve_m == 0.0 {
            return self.grade_at(s_m);
        }
        let half_m = 0.5 * self.vertical_curve_m;
        let (from, to) = (self.integrals(s_m - half_m), self.integrals(s_m + half_m));
        // The mean of the grades around the station: a parabola where one of them changes.
        (to.height_m - from.height_m) / self.vertical_curve_m
    }

    /// Returns the change of the rise per length at a station, negative on a crest.
    pub fn curvature_per_m(&self, s_m: f64) -> f64 {
        if self.vertical_curve_m == 0.0 {
            // Without vertical curves a grade changes at once and has no
            // curvature between.
            return 0.0;
        }
        let half_m = 0.5 * self.vertical_curve_m;
        (self.grade_at(s_m + half_m) - self.grade_at(s_m - half_m)) / self.vertical_curve_m
    }

    /// Returns the slope across the road at a station.
    pub fn bank(&self, s_m: f64) -> f64 {
        // Banks have few entries, so a search from the front is the fastest.
        let after = self.banks.iter().position(|bank| s_m < bank.s_m);
        match after {
            None => self.banks.last().map_or(0.0, |bank| bank.slope),
            Some(0) => self.banks[0].slope,
            Some(i) => {
                let (from, to) = (self.banks[i - 1], self.banks[i]);
                let share = (s_m - from.s_m) / (to.s_m - from.s_m);
                from.slope + share * (to.slope - from.slope)
            }
        }
    }

    /// Returns the height of the surface at a station and an offset to the left.
    pub fn height_m(&self, s_m: f64, lateral_m: f64) -> f64 {
        // Relative to station 0, at which the road has the height `z_m`.
        self.z_m + self.climb_m(s_m) - self.climb_m(0.0) + self.bank(s_m) * lateral_m
    }

    /// Returns the height above that of the first grade's station.
    fn climb_m(&self, s_m: f64) -> f64 {
        if self.vertical_curve_m == 0.0 {
            return self.integrals(s_m).height_m;
        }
        let half_m = 0.5 * self.vertical_curve_m;
        let (from, to) = (self.integrals(s_m - half_m), self.integrals(s_m + half_m));
        (to.area_m2 - from.area_m2) / self.vertical_curve_m
    }

    /// Returns the grade at a station, without vertical curves.
    fn grade_at(&self, s_m: f64) -> f64 {
        // From the last one back: of two grades at one station the later one
        // counts.
        let begun = self.grades.iter().rev().find(|it| it.from_s_m <= s_m);
        begun.or(self.grades.first()).map_or(0.0, |it| it.rise)
    }

    fn integrals(&self, s_m: f64) -> GradeIntegrals {
        let mut all = GradeIntegrals {
            height_m: 0.0,
            area_m2: 0.0,
        };
        for (i, grade) in self.grades.iter().enumerate() {
            let next_m = self
                .grades
                .get(i + 1)
                .map_or(f64::INFINITY, |it| it.from_s_m);
            // Before its station the first grade holds, with a negative way.
            let way_m = s_m.min(next_m) - grade.from_s_m;
            if way_m <= 0.0 && i > 0 {
                break;
            }
            // The area needs the height at the station of the grade, so it
            // changes first.
            all.area_m2 += all.height_m * way_m + 0.5 * grade.rise * way_m * way_m;
            all.height_m += grade.rise * way_m;
        }
        all
    }
}

/// Returns the sine and the cosine of the angle of a slope.
pub fn slope_direction(rise: f64) -> (f64, f64) {
    let length = (1.0 + rise * rise).sqrt();
    (rise / length, 1.0 / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRADES: [Grade; 3] = [
        Grade {
            from_s_m: 10.0,
            rise: 0.0,
        },
        Grade {
            from_s_m: 100.0,
            rise: 0.06,
        },
        Grade {
            from_s_m: 300.0,
            rise: -0.04,
        },
    ];

    fn profile(vertical_curve_m: f64) -> RoadProfile<'static> {
        RoadProfile {
            grades: &GRADES,
            vertical_curve_m,
            ..RoadProfile::default()
        }
    }

    #[test]
    fn heights_are_the_integral_of_the_rise() {
        for curve_m in [0.0, 40.0] {
            let road = profile(curve_m);
            let mut sum_m = road.height_m(-50.0, 0.0);
            for i in 0..60_000 {
                let s_m = -50.0 + 0.01 * f64::from(i);
                assert!(
                    (road.height_m(s_m, 0.0) - sum_m).abs() < 1e-3,
                    "{curve_m} {s_m}"
                );
                sum_m += 0.01 * road.rise(s_m + 0.005);
            }
            assert_eq!(road.height_m(0.0, 3.0), 0.0);
        }
    }

    #[test]
    fn a_vertical_curve_is_a_parabola_around_the_station_of_its_grade() {
        let road = profile(40.0);
        assert!((road.rise(280.0) - 0.06).abs() < 1e-12);
        assert!((road.rise(300.0) - 0.01).abs() < 1e-12);
        assert!((road.rise(320.0) + 0.04).abs() < 1e-12);
        // 10 % over 40 m are a radius of 400 m.
        assert!((road.curvature_per_m(300.0) + 1.0 / 400.0).abs() < 1e-12);
        assert_eq!(road.curvature_per_m(200.0), 0.0);
    }

    #[test]
    fn banks_change_evenly_between_their_stations() {
        let banks = [
            Bank {
                s_m: 0.0,
                slope: 0.0,
            },
            Bank {
                s_m: 50.0,
                slope: -0.08,
            },
        ];
        let road = RoadProfile {
            banks: &banks,
            ..RoadProfile::default()
        };
        assert!((road.height_m(25.0, 2.0) + 0.08).abs() < 1e-12);
        assert!((road.height_m(90.0, -5.0) - 0.4).abs() < 1e-12);
        assert!(!road.is_flat() && RoadProfile::default().is_flat());
    }
}
