//! Names of what is imported, in linked text.

use wesl::{Mangler, ModulePath};

/// Names an imported item `item_of_module`: readable in messages, and unique because a path has one spelling.
pub(super) struct PathMangler;

impl Mangler for PathMangler {
    fn mangle(&self, path: &ModulePath, item: &str) -> String {
        format!("{item}_of_{}", path.components.join("_"))
    }
}

/// The item's own name, without the module.
pub(super) fn unmangled(name: &str) -> &str {
    name.split_once("_of_").map_or(name, |(item, _)| item)
}
