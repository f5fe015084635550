//! brakecheck from Python: the extension module `brakecheck._brakecheck`.
//!
//! It only converts arguments and results, and calls the library. The public
//! functions, with their documentation, are in `brakecheck/*.py`.

mod ado;
mod bench;
mod cli;
mod commands;
mod controller;
mod convert;
mod ego;
mod error;
mod interrupt;
mod kept;
mod percept;
mod python_thread;
mod recording;
mod run;
mod stl;
mod vector;
mod vector_group;
mod watch;
mod world;

/// Extension of the Python package.
#[pyo3::pymodule]
mod _brakecheck {
    #[pymodule_export]
    use super::ado::RawPolicy;
    #[pymodule_export]
    use super::bench::RawBench;
    #[pymodule_export]
    use super::cli::run_program;
    #[pymodule_export]
    use super::commands::{eval_run, eval_world, report_run, search_world, train_ado};
    #[pymodule_export]
    use super::kept::{RawReplayed, export_kept, replay_kept};
    #[pymodule_export]
    use super::percept::{Command, Own, Percept, Seen, SeenLight, command_of};
    #[pymodule_export]
    use super::python_thread::{Mailbox, exit_threads};
    #[pymodule_export]
    use super::recording::{RawRecording, fit_traffic};
    #[pymodule_export]
    use super::run::RawRun;
    #[pymodule_export]
    use super::stl::{RawFormula, RawMonitor};
    #[pymodule_export]
    use super::vector::RawVector;
    #[pymodule_export]
    use super::vector_group::RawEpisode;
    #[pymodule_export]
    use super::world::RawWorld;
}
