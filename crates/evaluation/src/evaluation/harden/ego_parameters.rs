//! Parameters of an ego: of a stock controller, or declared by a program.

use std::collections::BTreeMap;

use serde::Serialize;

use super::super::changed_ego::{NOT_OF_THE_LAW, with_values};
use super::error::HardenError;
use crate::ego::{Actuated, Process};
use crate::evaluation::Sweep;
use crate::experiment::{EgoError, EgoUnderTest};
use crate::world::Scenario;

/// Digits of a value after those of its range.
const DIGITS: i32 = 3;

/// Parameter of an ego, with the range in which it may change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EgoParameter {
    /// Name, without `ego.`.
    pub name: String,
    /// Least value, in the parameter's own unit.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
    /// Value of the ego as it is.
    pub own: f64,
    /// Number of values in the first sweep over it.
    #[serde(skip)]
    pub steps: usize,
}

impl EgoParameter {
    /// Returns the value at a point of the range, in −1 to 1, with few digits.
    pub(super) fn at(&self, x: f64) -> f64 {
        let range = self.hi - self.lo;
        // Digits follow the width of the range, so that small quantities keep theirs.
        let digits = DIGITS - libm::floor(libm::log10(range)) as i32;
        let scale = libm::pow(10.0, f64::from(digits));
        // The search works in −1 to 1, where all parameters have one scale.
        let value = self.lo + 0.5 * (x + 1.0) * range;
        // Rounding must not leave the range.
        ((value * scale).round() / scale).clamp(self.lo, self.hi)
    }

    /// Returns the point of a value, in −1 to 1.
    pub(super) fn x_of(&self, value: f64) -> f64 {
        2.0 * (value - self.lo) / (self.hi - self.lo) - 1.0
    }

    /// Returns the change of the parameter as a share of its range.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.own).abs() / (self.hi - self.lo)
    }
}

/// An ego and the parameters that may change.
#[derive(Clone, Debug)]
pub struct EgoParameters {
    base: EgoUnderTest,
    /// Parameters in the order of the controller or of the hello.
    pub list: Vec<EgoParameter>,
}

impl EgoParameters {
    /// Returns the parameters of an ego.
    ///
    /// `ranges` selects them. Without any, a program has those that it declares, and a stock
    /// ego those of the world's `train_against`, or all between half and twice their value.
    ///
    /// # Errors
    /// The ego has no such parameter, or none at all, or its program does not start.
    pub fn of(base: &EgoUnderTest, ranges: &[Sweep]) -> Result<EgoParameters, HardenError> {
        let scenario = base.scenario();
        let all = match scenario.program() {
            Some(program) => declared(program)?,
            None => stock(scenario),
        };
        if all.is_empty() {
            return Err(HardenError::NoParameters {
                ego: base.name().to_owned(),
                is_program: scenario.program().is_some(),
            });
        }
        let list = match ranges {
            [] => usual(base, all),
            some => some
                .iter()
                .map(|range| selected(base.name(), &all, range))
                .collect::<Result<_, _>>()?,
        };
        let base = base.clone();
        Ok(EgoParameters { base, list })
    }

    /// Returns the ego as it is.
    pub fn base(&self) -> &EgoUnderTest {
        &self.base
    }

    /// Returns the values of the ego as it is.
    pub(super) fn own(&self) -> Vec<f64> {
        self.list.iter().map(|one| one.own).collect()
    }

    /// Returns the ego with values in the order of the list.
    ///
    /// # Errors
    /// The values do not fit the world.
    pub fn ego(&self, name: &str, values: &[f64]) -> Result<EgoUnderTest, EgoError> {
        let pairs = self.list.iter().zip(values);
        let set: Vec<(&str, f64)> = pairs
            // A file then names what has changed, and nothing else.
            .filter(|(one, value)| one.own != **value)
            .map(|(one, value)| (one.name.as_str(), *value))
            .collect();
        with_values(&self.base, name, &set)
    }
}

fn declared(program: &Process) -> Result<Vec<EgoParameter>, HardenError> {
    let declared = program.declared().map_err(HardenError::Program)?;
    let set: &BTreeMap<String, f64> = &program.parameters;
    let parameters = declared.into_iter().map(|one| EgoParameter {
        // The world may set another value than the program's default.
        own: set.get(&one.name).copied().unwrap_or(one.default),
        name: one.name,
        lo: one.lo,
        hi: one.hi,
        steps: Sweep::STEPS,
    });
    Ok(parameters.collect())
}

/// Returns the parameters of a stock controller, between half and twice their value.
fn stock(scenario: &Scenario) -> Vec<EgoParameter> {
    let controller = scenario.controller();
    let all = controller.iter().flat_map(Actuated::parameters);
    let parameters = all.map(|one| EgoParameter {
        name: one.name.to_owned(),
        // Half of a value may be below the least that the controller accepts.
        lo: (0.5 * one.value).max(one.at_least),
        hi: 2.0 * one.value,
        own: one.value,
        steps: Sweep::STEPS,
    });
    parameters.collect()
}

/// Returns the parameters that change unless others are named.
fn usual(base: &EgoUnderTest, all: Vec<EgoParameter>) -> Vec<EgoParameter> {
    // The family of the world is of its own controller.
    let is_own = base.change().controller.is_none();
    let family = base.scenario().family().filter(|_| is_own);
    let quantities = || family.iter().flat_map(|family| &family.quantities);
    let in_family = |one: &EgoParameter| {
        let quantity = quantities().find(|it| it.varied.name() == one.name)?;
        let (lo, hi) = (quantity.lo, quantity.hi);
        // A change may have moved the ego out of the family.
        let range = EgoParameter {
            lo,
            hi,
            ..one.clone()
        };
        quantity.contains(one.own).then_some(range)
    };
    let of_the_law = |one: &&EgoParameter| !NOT_OF_THE_LAW.contains(&one.name.as_str());
    let known: Vec<EgoParameter> = all
        .iter()
        .filter(of_the_law)
        .filter_map(in_family)
        .collect();
    if !known.is_empty() {
        return known;
    }
    // A parameter of 0 has no range around it.
    let has_range = |one: &&EgoParameter| one.lo < one.hi;
    let rest = all.iter().filter(of_the_law).filter(has_range);
    rest.cloned().collect()
}

/// Returns the parameter of a sweep, with its range.
fn selected(ego: &str, all: &[EgoParameter], range: &Sweep) -> Result<EgoParameter, HardenError> {
    let known = || all.iter().map(|one| one.name.clone()).collect();
    let Some(one) = all.iter().find(|one| one.name == range.parameter) else {
        return Err(HardenError::UnknownParameter {
            ego: ego.to_owned(),
            parameter: range.parameter.clone(),
            known: known(),
        });
    };
    let [lo, hi] = range.ends();
    // The search starts at the own value, which must be a point of the range.
    if !(lo..=hi).contains(&one.own) {
        return Err(HardenError::OwnOutside {
            parameter: one.name.clone(),
            own: one.own,
            lo,
            hi,
        });
    }
    Ok(EgoParameter {
        lo,
        hi,
        steps: range.values.len(),
        ..one.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn acc() -> EgoUnderTest {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        EgoUnderTest::nominal(&world)
    }

    fn names(list: &[EgoParameter]) -> Vec<&str> {
        list.iter().map(|one| one.name.as_str()).collect()
    }

    #[test]
    fn ranges_come_from_the_command_or_the_family_or_the_values() {
        let ego = acc();
        let family = EgoParameters::of(&ego, &[]).expect("a family").list;
        let own = ["kp_per_s2", "kd_per_s", "time_gap_s", "max_brake_mps2"];
        assert_eq!(names(&family), own, "without the lag of the actuator");
        assert_eq!((family[2].lo, family[2].hi, family[2].own), (0.3, 1.0, 0.5));
        let range = Sweep::parse("ego.time_gap_s=0.2..2:5").expect("a range");
        let named = EgoParameters::of(&ego, &[range]).expect("named").list;
        assert_eq!((named[0].lo, named[0].hi, named[0].steps), (0.2, 2.0, 5));
        let idm = EgoUnderTest::find(ego.scenario(), "idm").expect("it fits");
        let doubled = EgoParameters::of(&idm[0], &[]).expect("values").list;
        // The family is of another law.
        assert_eq!(doubled.len(), 6);
        assert_eq!(
            (doubled[1].lo, doubled[1].hi, doubled[1].own),
            (0.5, 2.0, 1.0)
        );
    }

    #[test]
    fn unknown_parameters_and_ranges_without_the_ego_are_refused() {
        let refused = |range: &str| {
            let range = Sweep::parse(range).expect("a range");
            let refused = EgoParameters::of(&acc(), &[range]).expect_err("refused");
            refused.to_string()
        };
        assert!(refused("ego.gap=0..1").contains("no parameter `gap`"));
        assert!(refused("ego.time_gap_s=1..2").contains("0.5"));
    }

    #[test]
    fn values_have_few_digits_and_a_change_names_only_what_has_changed() {
        let ego = acc();
        let parameters = EgoParameters::of(&ego, &[]).expect("a family");
        let gap = &parameters.list[2];
        assert_eq!(
            (gap.at(-1.0), gap.at(1.0), gap.at(0.123_456)),
            (0.3, 1.0, 0.6932)
        );
        assert!((gap.x_of(gap.at(0.25)) - 0.25).abs() < 1e-3);
        let mut values = parameters.own();
        values[2] = 0.8;
        let changed = parameters.ego("longer", &values).expect("it fits");
        let change = &changed.change().ego.0;
        assert_eq!((change.len(), change["time_gap_s"]), (1, 0.8));
        assert!((gap.share(0.8) - 0.3 / 0.7).abs() < 1e-12);
    }

    #[test]
    fn a_declared_parameter_is_set_in_the_program_and_not_in_the_world() {
        let world = acc();
        let command = ["no-such-program".to_owned()];
        let ego = EgoUnderTest::program(world.scenario(), &command).expect("driven");
        let set = with_values(&ego, "set", &[("gap_s", 1.5)]).expect("it fits");
        let program = set.scenario().program().expect("a program");
        assert_eq!(
            program.parameters,
            BTreeMap::from([("gap_s".to_owned(), 1.5)])
        );
        assert!(
            program.is_allowed(),
            "the ego was named on the command line"
        );
        assert!(set.change().ego.0.is_empty());
        let late = with_values(&ego, "late", &[("lag_s", 0.3)]).expect("it fits");
        assert_eq!(late.change().ego.0["lag_s"], 0.3);
    }
}
