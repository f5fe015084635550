//! The stock controllers by name, as world files give them.

use serde::{Deserialize, Serialize};

use super::actuator::written_as;
use super::{
    Acc, Actuated, Aeb, Controller, FilteredAcc, Idm, Merge, Parameter, PoliteAcc, Process,
    UnknownParameter, YellowLight, YellowLightFixed,
};

/// Declares the enum of stock controllers and passes every call on.
macro_rules! stock {
    ($( $(#[doc = $about:literal])+ $kind:ident by $make:ident; )*) => {
        /// A controller as named in a world file, with its parameters.
        #[derive(Clone, Debug, PartialEq)]
        pub enum ControllerSpec {
            $( $(#[doc = $about])+ $kind($kind), )*
        }

        #[derive(Serialize, Deserialize)]
        #[serde(rename = "ControllerSpec")]
        enum InFile {
            $( $kind(Actuated<$kind>), )*
        }

        impl From<InFile> for Actuated<ControllerSpec> {
            fn from(file: InFile) -> Actuated<ControllerSpec> {
                match file {
                    $( InFile::$kind(it) => it.map(ControllerSpec::$kind), )*
                }
            }
        }

        impl From<Actuated<ControllerSpec>> for InFile {
            fn from(Actuated { controller, lag_s }: Actuated<ControllerSpec>) -> InFile {
                match controller {
                    $( ControllerSpec::$kind(controller) => {
                        InFile::$kind(Actuated { controller, lag_s })
                    } )*
                }
            }
        }

        impl ControllerSpec {
            /// The controller itself, ready for `reset`.
            pub fn build(&self) -> Box<dyn Controller> {
                match self {
                    $( ControllerSpec::$kind(it) => Box::new(it.$make()), )*
                }
            }

            /// Name of the kind, as written in the world file.
            pub fn kind(&self) -> &'static str {
                match self {
                    $( ControllerSpec::$kind(_) => stringify!($kind), )*
                }
            }

            /// Its numeric parameters: name, unit, meaning and value.
            pub fn parameters(&self) -> Vec<Parameter> {
                match self {
                    $( ControllerSpec::$kind(it) => it.parameters(), )*
                }
            }

            /// Sets one parameter by name.
            ///
            /// # Errors
            /// The name is none of this controller's parameters.
            pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
                match self {
                    $( ControllerSpec::$kind(it) => it.set(name, value), )*
                }
            }
        }
    };
}

written_as!(ControllerSpec, InFile);

impl Actuated<ControllerSpec> {
    /// The controller's numeric parameters, and the lag.
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

    /// Sets one of them by name.
    ///
    /// # Errors
    /// The name is none of them.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
        if name == "lag_s" {
            self.lag_s = value;
            return Ok(());
        }
        let set = self.controller.set(name, value);
        set.map_err(|mut error| {
            error.known.push("lag_s");
            error
        })
    }
}

impl From<Process> for Actuated<ControllerSpec> {
    /// A program as the ego of a car whose actuator does not lag.
    fn from(process: Process) -> Actuated<ControllerSpec> {
        Actuated {
            controller: ControllerSpec::Process(process),
            lag_s: 0.0,
        }
    }
}

impl ControllerSpec {
    /// The program that it is, if it is one.
    pub fn program(&self) -> Option<&Process> {
        match self {
            ControllerSpec::Process(process) => Some(process),
            _ => None,
        }
    }

    /// Gives or takes back the consent to start a program, if it is one.
    pub fn allow_programs(&mut self, allowed: bool) {
        if let ControllerSpec::Process(process) = self {
            process.allow(allowed);
        }
    }
}

stock! {
    /// Adaptive cruise control, Sec. V-B.
    Acc by clone;
    /// Adaptive cruise control under a braking safety filter.
    FilteredAcc by clone;
    /// Adaptive cruise control that brakes softly when tailgated.
    PoliteAcc by clone;
    /// The intelligent driver model.
    Idm by clone;
    /// Cruise control with automatic emergency braking.
    Aeb by build;
    /// The switching merge controller, Sec. V-C.
    Merge by build;
    /// Stops for lights by the paper's d(t), Sec. V-D.
    YellowLight by build;
    /// Stops for lights by the stopping distance.
    YellowLightFixed by build;
    /// Another program, on its stdin and stdout.
    Process by controller;
}
