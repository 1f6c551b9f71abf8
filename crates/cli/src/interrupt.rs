//! Ctrl-C, heard instead of dying of it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

/// Whether Ctrl-C was heard.
#[derive(Clone, Debug)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Hears Ctrl-C from now on: the first time to finish what is being done, which `message` tells, the second to leave at
    /// once.
    pub fn listen(message: String) -> anyhow::Result<Self> {
        let heard = Arc::new(AtomicBool::new(false));
        let flag = heard.clone();
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                // 128 and the signal's number, as shells have it.
                std::process::exit(130);
            }
            eprintln!("\n{message}; once more leaves at once");
        })
        .context("cannot listen for Ctrl-C")?;
        Ok(Self(heard))
    }

    pub fn heard(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
