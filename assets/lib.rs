//! Bodies that brakecheck ships, as texts.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck). This crate makes no semver promise.

/// A file in `vehicles/` per name in the list.
macro_rules! shipped {
    ($($name:literal),*) => {
        /// Built-in bodies: their names and texts, in order.
        pub const VEHICLES: &[(&str, &str)] = &[$(
            ($name, include_str!(concat!("vehicles/", $name, ".ron")))
        ),*];
    };
}

shipped![
    "sedan",
    "compact",
    "van",
    "truck",
    "semitrailer",
    "motorcycle",
    "bicyclist",
    "pedestrian",
    "adult",
    "bmw_320i",
    "lorry_40t"
];
