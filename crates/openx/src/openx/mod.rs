//! Import of OpenSCENARIO files.

pub mod import;
