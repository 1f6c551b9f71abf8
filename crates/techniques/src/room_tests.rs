//! Rooms stand above what they import: no two import each other, in Rust or in WESL.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// See `docs/architecture.md`.
const FLOORS: [&[&str]; 6] = [
    &["frame"],
    &["shared", "scene"],
    &["view", "light", "rays"],
    &["environment", "shadow", "indirect", "caustics"],
    &["direct", "transparency", "reference"],
    &["post"],
];

fn files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, into);
        } else {
            into.push(path);
        }
    }
}

/// What comes first in each path after `root`, with nested braces: `crate::{a::B, c}` names `a` and `c`.
fn named<'a>(text: &'a str, root: &str) -> Vec<&'a str> {
    let word = |text: &'a str| text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("");
    let mut names = Vec::new();
    for (at, _) in text.match_indices(root) {
        let rest = &text[at + root.len()..];
        let Some(list) = rest.strip_prefix('{') else {
            names.push(word(rest));
            continue;
        };
        let mut depth = 0;
        let mut starts = vec![0];
        for (i, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => starts.push(i + 1),
                _ => {}
            }
        }
        let listed = starts.into_iter().map(|start| word(list[start..].trim_start()));
        names.extend(listed.filter(|name| !name.is_empty()));
    }
    names
}

/// Which rooms each room imports, and where.
fn imports() -> BTreeMap<(String, String), PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    files(&source, &mut all);
    let mut imports = BTreeMap::new();
    for path in all {
        let inner = path.strip_prefix(&source).unwrap();
        let mut parts = inner.components();
        let room = parts.next().unwrap().as_os_str().to_str().unwrap().to_owned();
        if parts.next().is_none() || inner.ends_with("tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        // Pages may point anywhere.
        let code: Vec<_> = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect();
        let text = code.join("\n");
        let root = if path.extension().is_some_and(|e| e == "wesl") { "import package::" } else { "crate::" };
        for name in named(&text, root) {
            if name != room && source.join(name).is_dir() {
                imports.insert((room.clone(), name.to_owned()), path.clone());
            }
        }
    }
    imports
}

#[test]
fn every_room_imports_only_rooms_below_or_beside_it_and_never_in_a_circle() {
    let floor = |room: &str| {
        let found = FLOORS.iter().position(|floor| floor.contains(&room));
        found.unwrap_or_else(|| panic!("the room {room} stands on no floor: docs/architecture.md"))
    };
    let imports = imports();
    assert!(imports.len() > 20, "imports are not found any more");
    for ((room, imported), path) in &imports {
        assert!(floor(imported) <= floor(room), "{room} imports {imported} in {}", path.display());
    }
    // Beside each other, rooms that are imported have no way back.
    let next = |room: &str| -> Vec<&str> {
        imports.keys().filter(|(from, _)| from == room).map(|(_, to)| to.as_str()).collect()
    };
    for room in FLOORS.into_iter().flatten() {
        let (mut seen, mut open) = (Vec::new(), next(room));
        while let Some(reached) = open.pop() {
            assert_ne!(reached, *room, "{room} is imported by what it imports");
            if !seen.contains(&reached) {
                seen.push(reached);
                open.extend(next(reached));
            }
        }
    }
}

#[test]
fn imports_are_read_in_every_form() {
    assert_eq!(named("use crate::a::{B, c};\ncrate::d()", "crate::"), ["a", "d"]);
    assert_eq!(named("use crate::{\n    a::{B, C},\n    d, e::F,\n};", "crate::"), ["a", "d", "e"]);
}
