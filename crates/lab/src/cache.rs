//! What was computed before, by all that it depends on.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use chiaro::scene::text_hash;
use etcetera::BaseStrategy as _;

use crate::Error;
use crate::files::create_folder;

/// Names the folder instead of the system's.
pub const VARIABLE: &str = "CHIARO_CACHE";

/// A folder of files, each of the hash of all that it depends on.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

/// A file of the cache. Other processes wait for it until this is dropped, so that nothing is computed twice.
#[derive(Debug)]
pub struct Entry {
    /// Where it is, or is to be.
    pub path: PathBuf,
    _lock: File,
}

impl Cache {
    /// The user's: `$CHIARO_CACHE`, else `chiaro` in the system's folder for caches (`$XDG_CACHE_HOME` or `~/.cache` on
    /// Linux). `None` where there is no such folder.
    pub fn of_user() -> Option<Self> {
        let named = std::env::var_os(VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let system = || Some(etcetera::choose_base_strategy().ok()?.cache_dir().join("chiaro"));
        named.or_else(system).map(Self::in_folder)
    }

    /// One in a folder, which is made when something is kept.
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file for what `key` tells apart from everything else.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn entry(&self, key: &str, extension: &str) -> Result<Entry, Error> {
        create_folder(&self.folder)?;
        let path = self.folder.join(format!("{:016x}.{extension}", text_hash(key)));
        let lock_path = path.with_extension(format!("{extension}.lock"));
        let lock = File::create(&lock_path).map_err(Error::file("cannot write", &lock_path))?;
        // Where a file system has no locks, the worst is work done twice.
        let _ = lock.lock();
        Ok(Entry { path, _lock: lock })
    }
}

impl Entry {
    /// The text that it holds, if it is of this key.
    pub fn text(&self, key: &str) -> Option<String> {
        let text = fs::read_to_string(&self.path).ok()?;
        Some(text.strip_prefix(key)?.strip_prefix('\n')?.to_owned())
    }

    /// Keeps a text.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_text(&self, key: &str, text: &str) -> Result<(), Error> {
        let beside = self.path.with_extension("new");
        fs::write(&beside, format!("{key}\n{text}")).map_err(Error::file("cannot write", &beside))?;
        fs::rename(&beside, &self.path).map_err(Error::file("cannot write", &self.path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_found_again_by_their_whole_key() {
        let cache =
            Cache::in_folder(std::env::temp_dir().join(format!("chiaro_cache_{}", std::process::id())));
        let entry = cache.entry("a key", "txt").unwrap();
        assert_eq!(entry.text("a key"), None);
        entry.keep_text("a key", "17").unwrap();
        assert_eq!(entry.text("a key").as_deref(), Some("17"));
        assert_eq!(entry.text("a ke"), None);
        drop(entry);
        assert_eq!(cache.entry("another", "txt").unwrap().text("another"), None);
        fs::remove_dir_all(cache.folder()).unwrap();
    }
}
