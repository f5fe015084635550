//! The list of stock controllers, from which names, checks and tables follow.
//!
//! Worlds name them. `check`, families and `brakecheck reference egos` use the list.

use serde::{Deserialize, Serialize};

use super::actuator::written_as;
use super::reference::DriverModel;
use super::{Actuated, Controller, Parameter, UnknownParameter};

/// A controller as named in a world file, with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerSpec(pub StockController);

/// Declares the enum of stock controllers, which forwards every call.
///
/// A line names the file, its type and the method that builds a controller.
macro_rules! egos {
    ($(
        $(#[doc = $about:literal])+
        $file:ident::$kind:ident by $make:ident;
    )*) => {
        $( pub use super::$file::$kind; )*

        /// Names of all kinds and of their parameters.
        pub const KINDS: &[(&str, &[&str])] = &[$( (stringify!($kind), $kind::PARAMETERS) ),*];

        /// A stock controller with its parameters, by its kind.
        #[derive(Clone, Debug, PartialEq)]
        pub enum StockController {
            $( $(#[doc = $about])+ $kind($kind), )*
        }

        $(
            impl From<$kind> for ControllerSpec {
                fn from(controller: $kind) -> ControllerSpec {
                    ControllerSpec(StockController::$kind(controller))
                }
            }
        )*

        /// Controller with its parameters and the lag of the car's actuator.
        #[derive(Serialize, Deserialize, schemars::JsonSchema)]
        #[serde(rename = "ControllerSpec")]
        enum ControllerFile {
            $( $(#[doc = $about])+ $kind(Actuated<$kind>), )*
        }

        impl From<ControllerFile> for Actuated<ControllerSpec> {
            fn from(file: ControllerFile) -> Actuated<ControllerSpec> {
                match file {
                    $( ControllerFile::$kind(it) => it.map(ControllerSpec::from), )*
                }
            }
        }

        impl From<Actuated<ControllerSpec>> for ControllerFile {
            fn from(Actuated { controller, lag_s }: Actuated<ControllerSpec>) -> ControllerFile {
                match controller.0 {
                    $( StockController::$kind(controller) => {
                        ControllerFile::$kind(Actuated { controller, lag_s })
                    } )*
                }
            }
        }

        impl ControllerSpec {
            /// Returns the controller itself, ready for `reset`.
            pub fn build(&self) -> Box<dyn Controller> {
                match &self.0 {
                    $( StockController::$kind(it) => Box::new(it.$make()), )*
                }
            }

            /// Returns the name of the kind, as written in the world file.
            pub fn kind(&self) -> &'static str {
                match &self.0 {
                    $( StockController::$kind(_) => stringify!($kind), )*
                }
            }

            /// Returns its numeric parameters: name, unit, meaning and value.
            pub fn parameters(&self) -> Vec<Parameter> {
                match &self.0 {
                    $( StockController::$kind(it) => it.parameters(), )*
                }
            }

            /// Sets a parameter by name.
            ///
            /// # Errors
            /// The controller has no such parameter.
            pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
                match &mut self.0 {
                    $( StockController::$kind(it) => it.set(name, value), )*
                }
            }
        }
    };
}

written_as!(ControllerSpec, ControllerFile);

impl Actuated<ControllerSpec> {
    /// Returns the controller's numeric parameters and the lag.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut parameters = self.controller.parameters();
        parameters.push(Parameter {
            name: "lag_s",
            about: "Time constant of the actuator behind the command, s; 0 is none.",
            value: self.lag_s,
            at_least: 0.0,
        });
        parameters
    }

    /// Sets a parameter or the lag by name.
    ///
    /// # Errors
    /// Neither has the name.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
        // Before the controller, whose names do not include it.
        if name == "lag_s" {
            self.lag_s = value;
            return Ok(());
        }
        let set = self.controller.set(name, value);
        set.map_err(|mut error| {
            // The lag belongs to the actuator, so the controller's names lack
            // it.
            error.known.push("lag_s");
            error
        })
    }
}

impl Actuated<ControllerSpec> {
    /// Returns a controller of a kind from all its parameters, including the lag.
    ///
    /// `None` if the kind is unknown or the parameters do not match.
    pub fn of_kind(kind: &str, values: &[(&str, f64)]) -> Option<Actuated<ControllerSpec>> {
        let named = values
            .iter()
            .map(|&(name, value)| (name.to_owned(), value.into()));
        // Parsed through serde, so a kind accepts here what it accepts in a
        // file.
        let fields = serde_json::Value::Object(named.collect());
        let file: serde_json::Map<_, _> = [(kind.to_owned(), fields)].into_iter().collect();
        serde_json::from_value(file.into()).ok()
    }
}

impl From<Process> for Actuated<ControllerSpec> {
    /// Returns a program as the ego of a car whose actuator does not lag.
    fn from(process: Process) -> Actuated<ControllerSpec> {
        Actuated {
            controller: process.into(),
            lag_s: 0.0,
        }
    }
}

impl ControllerSpec {
    /// Returns the program, if it is one.
    pub fn program(&self) -> Option<&Process> {
        match &self.0 {
            StockController::Process(process) => Some(process),
            _ => None,
        }
    }

    /// Gives or withdraws the consent to start a program, if it is one.
    pub fn allow_programs(&mut self, allowed: bool) {
        if let StockController::Process(process) = &mut self.0 {
            process.allow(allowed);
        }
    }

    /// Starts a program anew for every episode, if it is one.
    pub fn set_fresh(&mut self) {
        if let StockController::Process(process) = &mut self.0 {
            process.fresh = true;
        }
    }
}

egos! {
    /// Follows the car ahead at `standstill_headway_m + time_gap_s · v`, front to front,
    /// and commands 0 without a car ahead (Sec. V-B).
    acc::Acc by clone;
    /// The follower of `Acc` under a safety filter that brakes at the last chance, by v²/2a.
    safety_filter_acc::FilteredAcc by clone;
    /// The follower of `Acc`, braking softly when tailgated.
    courteous_acc::PoliteAcc by clone;
    /// The intelligent driver model.
    idm::Idm by clone;
    /// Gipps' model: can always stop in time.
    gipps::Gipps by clone;
    /// The full velocity difference model.
    fvdm::Fvdm by clone;
    /// Krauss' model: drives at the safe speed.
    krauss::Krauss by clone;
    /// The law of `Acc` within the limits of ISO 15622. Its emergency brake acts when
    /// avoiding contact takes `aeb_trigger_mps2`.
    iso_acc::IsoAcc by build;
    /// Cruises at its initial speed, and brakes for agents that will be in its path, from
    /// `trigger_mps2` on with exactly `max_brake_mps2`.
    aeb::Aeb by build;
    /// Brakes like `Aeb` and keeps its lane. From `evade_mps2` on it also steers around the
    /// agent, on the nearer side that is free, and brakes with at most `cruise_limit_mps2`.
    pure_pursuit::PurePursuit by build;
    /// Slows down for bends and ignores road users: at a distance d before a bend of
    /// curvature κ it drives at most √(a/κ + 2bd), with a = `side_accel_mps2` and
    /// b = `plan_brake_mps2`.
    curve_speed::CurveSpeed by build;
    /// Cruises, and brakes hard while the predicted lateral distance of an agent ahead is
    /// small (Sec. V-B).
    merge::Merge by build;
    /// Follows, and brakes for yellow if the line is within d(t) + `junction_m`, and always
    /// on red. d(t) is the distance that full braking covers until red (paper's appendix).
    traffic_light_acc::YellowLight by build;
    /// Like `YellowLight`, with the stopping distance v²/2a and the lag instead of d(t).
    traffic_light_acc::YellowLightFixed by build;
    /// Competent and careful, answers overlapping paths (UN R157).
    reference::CcDriver by controller;
    /// Competent and careful, answers agents that leave the next lane.
    reference::CcLaneDriver by controller;
    /// Like `CcLaneDriver`, and brakes until it is no faster than the agent.
    reference::CcLatchedDriver by controller;
    /// Brakes for cut-ins at the latest time of UN R157's formula.
    reference::RegDriver by controller;
    /// Responsibility-sensitive safety, answered by braking.
    reference::RssDriver by controller;
    /// The fuzzy safety model.
    reference::FsmDriver by controller;
    /// Brakes at once and fully for an unavoidable contact.
    reference::IdealDriver by controller;
    /// Keeps its speed, whatever it perceives, as assumed by test protocols.
    coast::Coast by clone;
    /// A separate program, on its stdin and stdout.
    process::Process by controller;
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::ego::example_ego;

    /// A list of one ego, with the macro of the list above.
    mod with_example {
        use super::super::{Actuated, Controller, Parameter, UnknownParameter, written_as};
        use serde::{Deserialize, Serialize};

        #[derive(Clone, Debug, PartialEq)]
        pub(super) struct ControllerSpec(StockController);

        written_as!(ControllerSpec, ControllerFile);

        egos! {
            /// Brakes, whatever it perceives.
            example_ego::Dummy by clone;
        }
    }

    #[test]
    fn a_file_and_a_line_are_all_it_takes_to_add_an_ego() {
        type Example = Actuated<with_example::ControllerSpec>;
        let text = "Dummy(brake_mps2: 1.0, lag_s: 0.4)";
        // As in world files.
        let options = ron::Options::default()
            .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
        let mut ego: Example = options.from_str(text).expect("an ego");
        assert_eq!((ego.controller.kind(), ego.lag_s), ("Dummy", 0.4));
        assert_eq!(with_example::KINDS, [("Dummy", &["brake_mps2"][..])]);
        let parameters = ego.controller.parameters();
        let names: Vec<_> = parameters.iter().map(|p| p.name).collect();
        assert_eq!((names, parameters[0].value), (vec!["brake_mps2"], 1.0));
        let command = ego
            .controller
            .build()
            .control(&crate::ego::Percept::default());
        assert_eq!(command.expect("a command").accel_mps2, -1.0);
        ego.controller
            .set("brake_mps2", 2.0)
            .expect("its parameter");
        let command = ego
            .controller
            .build()
            .control(&crate::ego::Percept::default());
        assert_eq!(command.expect("a command").accel_mps2, -2.0);
        ego.controller.set("brake", 2.0).expect_err("no parameter");
        let written = options.to_string(&ego).expect("written");
        assert_eq!(options.from_str::<Example>(&written).expect("an ego"), ego);
        let wrong = options.from_str::<Example>("Dummy(brake: 1.0, lag_s: 0.4)");
        assert!(
            wrong
                .expect_err("no field")
                .to_string()
                .contains("brake_mps2")
        );
    }
}
