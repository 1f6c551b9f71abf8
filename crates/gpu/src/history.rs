//! What lasts from frame to frame.

/// Something that a frame left behind, and what it holds for: a size, settings, a scene, a camera that did not jump. Asked
/// for anything else it is not there.
#[derive(Clone, Debug)]
pub struct History<K, T> {
    kept: Option<(K, T)>,
}

impl<K, T> Default for History<K, T> {
    fn default() -> Self {
        Self { kept: None }
    }
}

impl<K: PartialEq, T> History<K, T> {
    /// What was kept, if it was for the same.
    pub fn get(&self, key: &K) -> Option<&T> {
        self.kept.as_ref().filter(|(kept, _)| kept == key).map(|(_, value)| value)
    }

    /// Keeps something for the next frame in the place of what there was.
    pub fn keep(&mut self, key: K, value: T) {
        self.kept = Some((key, value));
    }

    /// Forgets everything.
    pub fn cut(&mut self) {
        self.kept = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_kept_for_one_thing_is_not_there_for_another() {
        let mut history = History::default();
        assert_eq!(history.get(&1), None);
        history.keep(1, "a");
        assert_eq!((history.get(&1), history.get(&2)), (Some(&"a"), None));
        history.keep(2, "b");
        assert_eq!((history.get(&1), history.get(&2)), (None, Some(&"b")));
        history.cut();
        assert_eq!(history.get(&2), None);
    }
}
