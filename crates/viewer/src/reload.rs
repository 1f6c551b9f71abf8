//! Shaders from disk, read again whenever they change.

#[cfg(not(target_arch = "wasm32"))]
pub use watched::ShaderFiles;

#[cfg(target_arch = "wasm32")]
pub use none::ShaderFiles;

#[cfg(not(target_arch = "wasm32"))]
mod watched {
    use std::path::{Path, PathBuf};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use chiaro::Library;
    use chiaro::techniques::shaders;
    use notify::{RecommendedWatcher, RecursiveMode, Watcher};

    /// A folder of WESL files that is being watched.
    #[derive(Debug)]
    pub struct ShaderFiles {
        folder: PathBuf,
        changed: Arc<AtomicBool>,
        // Watches as long as it lives.
        _watcher: RecommendedWatcher,
    }

    impl ShaderFiles {
        /// Watches `folder`; `wake` is called from another thread when something changes.
        ///
        /// # Errors
        /// When the folder cannot be watched.
        pub fn watch(folder: &Path, wake: impl Fn() + Send + 'static) -> Result<Self, String> {
            let changed = Arc::new(AtomicBool::new(false));
            let seen = changed.clone();
            let heard = move |event: Result<notify::Event, notify::Error>| {
                let is_shader = |event: notify::Event| {
                    // Reading counts as access.
                    !event.kind.is_access()
                        && event.paths.iter().any(|p| p.extension().is_some_and(|e| e == "wesl"))
                };
                if event.is_ok_and(is_shader) {
                    seen.store(true, Ordering::Relaxed);
                    wake();
                }
            };
            let fail = |e: notify::Error| format!("{}: {e}", folder.display());
            let mut watcher = notify::recommended_watcher(heard).map_err(fail)?;
            watcher.watch(folder, RecursiveMode::Recursive).map_err(fail)?;
            Ok(Self { folder: folder.to_owned(), changed, _watcher: watcher })
        }

        /// The shaders, when they have changed since the last call.
        pub fn poll(&mut self) -> Option<Library> {
            self.changed.swap(false, Ordering::Relaxed).then(|| self.read())
        }

        /// The built-in modules, each replaced by its file where there is one.
        fn read(&self) -> Library {
            let text = |path: &str| std::fs::read_to_string(self.folder.join(path)).ok();
            shaders::library().replaced(text)
        }
    }
}

#[cfg(target_arch = "wasm32")]
mod none {
    use std::path::Path;

    use chiaro::Library;

    /// A page has no files.
    #[derive(Debug)]
    pub struct ShaderFiles;

    impl ShaderFiles {
        /// There is nothing to watch.
        ///
        /// # Errors
        /// Always.
        pub fn watch(_folder: &Path, _wake: impl Fn() + 'static) -> Result<Self, String> {
            Err("shaders cannot be watched in a browser".into())
        }

        /// Nothing changes.
        pub fn poll(&mut self) -> Option<Library> {
            None
        }
    }
}
