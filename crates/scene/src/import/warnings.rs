//! Collecting what was simplified on the way in.

use crate::SceneError;

/// Most warnings kept; a broken file could cause one for every triangle.
const MAX_WARNINGS: usize = 64;

/// Warnings in the order of their first appearance, each once.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    messages: Vec<String>,
    dropped: usize,
    strict: bool,
}

impl Warnings {
    /// With `strict` nothing may stand in for anything.
    pub(super) fn new(strict: bool) -> Self {
        Self { strict, ..Self::default() }
    }

    /// Something that is missing or broken, and what stands in for it; where nothing may, the error itself.
    pub(super) fn stand_in(&mut self, error: SceneError, instead: &str) -> Result<(), SceneError> {
        if self.strict {
            return Err(error);
        }
        self.add(format!("{error}; {instead}"));
        Ok(())
    }

    pub(super) fn add(&mut self, message: impl Into<String>) {
        let message = message.into();
        if self.messages.contains(&message) {
            return;
        }
        if self.messages.len() < MAX_WARNINGS {
            tracing::warn!("{message}");
            self.messages.push(message);
        } else {
            self.dropped += 1;
        }
    }

    pub(super) fn into_messages(mut self) -> Vec<String> {
        if self.dropped > 0 {
            self.messages.push(format!("… and {} more", self.dropped));
        }
        self.messages
    }
}
