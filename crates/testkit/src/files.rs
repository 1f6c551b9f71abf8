//! Where the repository's own files and the shared assets lie.

use std::io::Write;
use std::path::{Path, PathBuf};

use chiaro_image::Image;

/// The repository's root.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap_or(Path::new("."))
}

/// The folder of models and references: `CHIARO_ASSETS`, or `shared` beside the repository. Where it is absent, says
/// so, and the test that asked has nothing to check.
pub fn assets() -> Option<PathBuf> {
    let folder = std::env::var_os("CHIARO_ASSETS").map_or_else(|| root().join("../shared"), PathBuf::from);
    if folder.join("references").is_dir() {
        return Some(folder);
    }
    skipped("the shared references are absent; set CHIARO_ASSETS to the folder that holds `references`");
    None
}

/// Says on standard error that the running test is skipped, and in the file that `CHIARO_SKIPPED` names, if it does.
pub fn skipped(reason: &str) {
    let thread = std::thread::current();
    let line = format!("SKIPPED: {}: {reason}\n", thread.name().unwrap_or("a test"));
    // Not `eprintln`, which the test harness would swallow.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os("CHIARO_SKIPPED") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(line.as_bytes()));
    }
}

/// A path-traced reference, such as `cornell_spot.direct`.
///
/// # Panics
/// When the folder is there but the file is not.
pub fn reference(assets: &Path, name: &str) -> Image {
    let path = assets.join("references").join(format!("{name}.exr"));
    match chiaro_image::read(&path) {
        Ok(image) => image,
        Err(error) => panic!("{error}"),
    }
}
