//! Where the content of scene files comes from: the file system, or memory.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::{Error, ErrorKind, Result};
use std::path::{Component, Path, PathBuf};

use super::text;

/// Reads the files that a scene is made of.
pub trait Files {
    /// The whole content of the file `path`.
    ///
    /// # Errors
    /// When it is not there, cannot be read or is no regular file.
    fn read(&self, path: &Path) -> Result<Vec<u8>>;

    /// Whether `path` is a file that can be read.
    fn exists(&self, path: &Path) -> bool;

    /// The file that `base`/`relative` means: each part of `relative` in its exact case or, failing that, in any.
    fn find(&self, base: &Path, relative: &Path) -> Option<PathBuf>;
}

/// The file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Files for Disk {
    /// Devices and pipes are refused: they may never end.
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        if !std::fs::metadata(path)?.is_file() {
            return Err(Error::new(ErrorKind::InvalidInput, "not a regular file"));
        }
        std::fs::read(path)
    }

    fn exists(&self, path: &Path) -> bool {
        path.is_file()
    }

    fn find(&self, base: &Path, relative: &Path) -> Option<PathBuf> {
        let mut path = base.to_owned();
        for component in relative.components() {
            match component {
                Component::Normal(name) if !path.join(name).exists() => {
                    let folder = if path.as_os_str().is_empty() { Path::new(".") } else { &path };
                    let wanted = without_case(name);
                    let names =
                        std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.file_name()));
                    // The least, so that the choice does not depend on the file system's order.
                    path.push(names.filter(|name| without_case(name) == wanted).min()?);
                }
                other => path.push(other),
            }
        }
        path.is_file().then_some(path)
    }
}

/// A name for comparison in any case; bytes that are no UTF-8 are letters as in scene files.
fn without_case(name: &OsStr) -> String {
    text::latin1(name.as_encoded_bytes()).to_lowercase()
}

/// Files in memory, such as those dropped onto a browser's window. `a/./b/../c` and `a/c` are the same path.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    files: BTreeMap<PathBuf, Vec<u8>>,
}

impl Memory {
    /// Adds a file, or replaces the one at `path`.
    pub fn insert(&mut self, path: impl AsRef<Path>, content: impl Into<Vec<u8>>) {
        self.files.insert(normal(path.as_ref()), content.into());
    }
}

/// A path without `.` and `..`, as far as it has something to leave.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if normal.file_name().is_some() => {
                normal.pop();
            }
            other => normal.push(other),
        }
    }
    normal
}

impl Files for Memory {
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let found = self.files.get(&normal(path)).cloned();
        found.ok_or_else(|| Error::new(ErrorKind::NotFound, "there is no such file among those given"))
    }

    fn exists(&self, path: &Path) -> bool {
        self.files.contains_key(&normal(path))
    }

    fn find(&self, base: &Path, relative: &Path) -> Option<PathBuf> {
        let path = normal(&base.join(relative));
        if self.files.contains_key(&path) {
            return Some(path);
        }
        let wanted = without_case(path.as_os_str());
        self.files.keys().find(|known| without_case(known.as_os_str()) == wanted).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_in_memory_are_found_by_any_way_of_writing_their_path() {
        let mut files = Memory::default();
        files.insert("scene/./Wood.PNG", *b"wood");
        assert_eq!(files.read(Path::new("scene/textures/../Wood.PNG")).unwrap(), b"wood");
        assert!(!files.exists(Path::new("scene/wood.png")));
        let found = files.find(Path::new("scene"), Path::new("wood.png")).unwrap();
        assert_eq!(found, Path::new("scene/Wood.PNG"));
        assert_eq!(files.read(Path::new("absent")).unwrap_err().kind(), ErrorKind::NotFound);
    }
}
