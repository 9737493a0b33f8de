//! Files that figures go to.

use std::{fs::File, path::Path};

/// Makes a file that is asked for: before anything is measured, so that no minutes are spent on figures that cannot
/// be written.
///
/// # Errors
/// It cannot be made: its path, and why.
pub fn create(path: Option<&Path>) -> Result<Option<File>, String> {
    let create =
        |path: &Path| File::create(path).map_err(|error| format!("{}: {error}", path.display()));
    path.map(create).transpose()
}
