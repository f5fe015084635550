//! Named numeric parameters of controllers, for `reuse` and families of egos.

/// A numeric parameter with its current value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Field name in the world file.
    pub name: &'static str,
    /// Meaning and unit.
    pub about: &'static str,
    /// Current value.
    pub value: f64,
    /// Least valid value (inclusive).
    pub at_least: f64,
}

/// Error: a change names a parameter that the controller does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this controller has no parameter `{name}`")]
pub struct UnknownParameter {
    /// Requested name.
    pub name: String,
    /// Known names.
    pub known: Vec<&'static str>,
}

/// Declares a controller's parameter struct together with its table.
///
/// If every field is written as `name = value`, a file may omit any of them and
/// the lag, which is 0 by default.
macro_rules! parameters {
    (
        // Without defaults: a file must give every field.
        $(#[$meta:meta])*
        pub struct $name:ident {
            $( $(#[doc = $about:literal])+ $field:ident, at_least $least:expr; )*
        }
    ) => {
        $crate::ego::parameters::parameters! {
            @define [deny_unknown_fields] []
            $(#[$meta])*
            pub struct $name {
                $( $(#[doc = $about])+ $field, at_least $least; )*
            }
        }
    };
    (
        // With defaults: a file may omit fields, and the lag is then 0.
        $(#[$meta:meta])*
        pub struct $name:ident {
            $( $(#[doc = $about:literal])+ $field:ident = $default:expr, at_least $least:expr; )*
        }
    ) => {
        $crate::ego::parameters::parameters! {
            @define [deny_unknown_fields, default] [
                impl Default for $name {
                    fn default() -> $name {
                        let controller = Law::default();
                        Actuated { controller, lag_s: 0.0 }.into()
                    }
                }
            ]
            $(#[$meta])*
            pub struct $name {
                $( $(#[doc = $about])+ $field, at_least $least; )*
            }
        }

        impl Default for $name {
            fn default() -> $name {
                $name { $( $field: $default, )* }
            }
        }
    };
    (
        // The definition that both forms share.
        @define [$($form:tt)*] [$($beside:item)*]
        $(#[$meta:meta])*
        pub struct $name:ident {
            $( $(#[doc = $about:literal])+ $field:ident, at_least $least:expr; )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $( $(#[doc = $about])+ pub $field: f64, )*
        }

        // A block of its own, because the form in files has the name of the type.
        const _: () = {
            use $crate::ego::Actuated;
            type Law = self::$name;

            $(#[$meta])*
            #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
            #[serde($($form)*)]
            struct $name {
                $( $(#[doc = $about])+ $field: f64, )*
                /// Time constant of the actuator behind the command, s. 0 is none.
                lag_s: f64,
            }

            impl From<$name> for Actuated<Law> {
                fn from($name { $( $field, )* lag_s }: $name) -> Actuated<Law> {
                    Actuated { controller: Law { $( $field ),* }, lag_s }
                }
            }

            impl From<Actuated<Law>> for $name {
                fn from(Actuated { controller: law, lag_s }: Actuated<Law>) -> $name {
                    $name { $( $field: law.$field, )* lag_s }
                }
            }

            $($beside)*

            $crate::ego::actuator::written_as!(Law, $name);
        };

        impl $name {
            /// Names of its numeric parameters.
            pub const PARAMETERS: &[&str] = &[$( stringify!($field) ),*];

            /// Returns its numeric parameters with their current values.
            pub fn parameters(&self) -> Vec<$crate::ego::Parameter> {
                vec![$( $crate::ego::Parameter {
                    name: stringify!($field),
                    about: concat!($($about),+).trim_ascii(),
                    value: self.$field,
                    at_least: $least,
                } ),*]
            }

            /// Sets a parameter by name.
            ///
            /// # Errors
            /// No field has the name.
            pub fn set(
                &mut self,
                name: &str,
                value: f64,
            ) -> Result<(), $crate::ego::UnknownParameter> {
                match name {
                    $( stringify!($field) => self.$field = value, )*
                    _ => return Err($crate::ego::UnknownParameter {
                        name: name.to_owned(),
                        known: Self::PARAMETERS.to_vec(),
                    }),
                }
                Ok(())
            }
        }
    };
}

pub(crate) use parameters;
