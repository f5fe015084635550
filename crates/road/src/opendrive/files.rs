//! Source of the texts of files.

use std::io;
use std::path::Path;

/// Function that returns the text of a file.
pub type Files<'a> = &'a dyn Fn(&Path) -> io::Result<String>;
