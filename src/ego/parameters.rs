//! Named numeric parameters of controllers: what `reuse` changes and what
//! families of egos range over.

/// One numeric parameter and its present value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Field name in the world file.
    pub name: &'static str,
    /// What it means.
    pub about: &'static str,
    /// Its value.
    pub value: f64,
    /// Least value that makes sense (inclusive).
    pub at_least: f64,
}

/// A change named a parameter that the controller does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this controller has no parameter `{name}`")]
pub struct UnknownParameter {
    /// The name asked for.
    pub name: String,
    /// The names there are.
    pub known: Vec<&'static str>,
}

/// Declares a controller's parameter struct together with its table.
///
/// Where every field is written as `name = value` a file may leave any of them
/// out, and the lag, which then is 0.
macro_rules! parameters {
    (
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

        // A block of its own: the form in files has the name of the type.
        const _: () = {
            use $crate::ego::Actuated;
            type Law = self::$name;

            #[derive(serde::Serialize, serde::Deserialize)]
            #[serde($($form)*)]
            struct $name {
                $( $field: f64, )*
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
            /// The names of its numeric parameters.
            pub const PARAMETERS: &[&str] = &[$( stringify!($field) ),*];

            /// Its numeric parameters with their present values.
            pub fn parameters(&self) -> Vec<$crate::ego::Parameter> {
                vec![$( $crate::ego::Parameter {
                    name: stringify!($field),
                    about: concat!($($about),+).trim_ascii(),
                    value: self.$field,
                    at_least: $least,
                } ),*]
            }

            /// Sets one parameter by name.
            ///
            /// # Errors
            /// The name is none of the fields.
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
