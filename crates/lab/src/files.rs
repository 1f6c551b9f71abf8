//! Files that measurements are written to, and bars that show how far they are.

use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::Error;

/// A progress bar on standard error: hidden by itself where there is no terminal, and for work that is done before anyone
/// could read it.
pub fn bar(steps: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// Makes a folder.
///
/// # Errors
/// When it cannot be made.
pub fn create_folder(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(Error::file("cannot create the folder", folder))
}

/// Makes the folder of a file that is to be written.
///
/// # Errors
/// When it cannot be made.
pub fn create_parent(path: &Path) -> Result<(), Error> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.map_or(Ok(()), create_folder)
}

/// Writes a file of text; missing folders are made.
///
/// # Errors
/// When it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    create_parent(path)?;
    std::fs::write(path, text).map_err(Error::file("cannot write", path))
}

/// Writes a file of JSON; missing folders are made.
///
/// # Errors
/// When it cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    write_text(path, &(serde_json::to_string_pretty(value)? + "\n"))
}
