//! What the program tells on standard output.

use std::{
    fmt::Display,
    io::{self, Write},
};

/// Prints a line. If nobody reads it any more, the picture is made all the same.
pub fn say(line: impl Display) {
    let _ = writeln!(io::stdout(), "{line}");
}
