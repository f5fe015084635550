//! Where the texts of files come from.

use std::io;
use std::path::Path;

/// Gives the text of a file.
pub type Files<'a> = &'a dyn Fn(&Path) -> io::Result<String>;
