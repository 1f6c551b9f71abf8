//! Writing files whole or not at all.

use std::fs;
use std::path::Path;

use crate::ImageError;

/// Writes `bytes` to `path`, making missing folders. Whoever reads the file meanwhile, and whatever ends this program,
/// the file is the old or the new one, never a part.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| replace(path, bytes))
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // A link stays, what it points to is replaced; what is no file (a pipe) can only be written to.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&target).is_ok_and(|known| !known.is_file()) {
        return fs::write(&target, bytes);
    }
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = target.with_file_name(name);
    let written = fs::write(&part, bytes).and_then(|()| fs::rename(&part, &target));
    if written.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_file(&part);
    }
    written
}
