//! No files of `crates/` import each other in a circle, in Rust or in WESL, and no rooms of techniques.
//!
//! A file imports the one that defines what it names, through whatever hands the name on: neither `mod` nor a re-export
//! is an import, unless the file names what it hands on. Packages need no test: cargo allows no circle of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::str::FromStr as _;

use proc_macro2::{Delimiter, Ident, TokenStream, TokenTree};

/// Rooms of techniques by floor: see `docs/architecture.md`.
const FLOORS: [&[&str]; 7] = [
    &["frame"],
    &["shared", "scene"],
    &["view", "light", "rays"],
    &["paths"],
    &["environment", "shadow", "indirect", "caustics", "specular"],
    &["direct", "transparency", "reference"],
    &["post"],
];

/// Segments of a path, such as `super`, `log`, `Handle`; a module's begin with its package and language.
type Segments = Vec<String>;

/// Which file imports which, and the names for which it does.
type Imports = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

/// A file's module, or one inside it; a folder's, which may have no file.
#[derive(Default)]
struct Module {
    file: String,
    defined: BTreeSet<String>,
    uses: Vec<Use>,
    /// Every path and word of the code.
    named: BTreeSet<Segments>,
}

/// A name and what it stands for; a glob's is `*`.
struct Use {
    name: String,
    path: Segments,
    /// To other modules: `pub use`.
    handed_on: bool,
}

/// Who asks for a name of a module.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    /// Its own code.
    Within,
    /// A path, which names nothing that is not there.
    ByPath,
    /// A module that has a glob of this one.
    ByGlob,
}

#[derive(Default)]
struct Modules(BTreeMap<Segments, Module>);

impl Modules {
    /// Reads files given as (path below the repository, text).
    fn read<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut modules = Self::default();
        for (file, text) in files {
            let (package, inner) = file.strip_prefix("crates/").unwrap().split_once("/src/").unwrap();
            let (stem, language) = inner.rsplit_once('.').unwrap();
            let mut module = vec![format!("{package}.{language}")];
            module.extend(stem.replace('.', "_").split('/').map(str::to_owned));
            module.pop_if(|last| ["lib", "main", "mod"].contains(&last.as_str()));
            for length in 1..module.len() {
                modules.0.entry(module[..length].to_vec()).or_default();
            }
            let tokens = TokenStream::from_str(text).unwrap_or_else(|error| panic!("{file}: {error}"));
            modules.add(file, &module, tokens);
        }
        modules
    }

    fn add(&mut self, file: &str, module: &Segments, tokens: TokenStream) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        file.clone_into(&mut self.0.entry(module.clone()).or_default().file);
        let mut at = 0;
        while at < tokens.len() {
            let (before, here) = tokens.split_at(at);
            let own = self.0.get_mut(module).unwrap();
            at += match here {
                [TokenTree::Ident(word), TokenTree::Ident(_), ..] if word == "use" || word == "import" => {
                    let end = here.iter().position(|token| is(token, ';')).unwrap();
                    let handed_on = is_visibility(before);
                    for (name, path) in leaves(&here[1..end]) {
                        if !handed_on {
                            own.named.insert(path.clone());
                        }
                        own.uses.push(Use { name, path, handed_on });
                    }
                    end + 1
                }
                [TokenTree::Ident(word), TokenTree::Ident(name), TokenTree::Group(body), ..]
                    if word == "mod" =>
                {
                    let inside = [module.as_slice(), &[name.to_string()]].concat();
                    self.add(file, &inside, body.stream());
                    3
                }
                [TokenTree::Ident(word), TokenTree::Ident(name), ..]
                    if is_definition(word) && !is_definition(name) =>
                {
                    own.defined.insert(name.to_string());
                    2
                }
                [TokenTree::Ident(_), ..] => {
                    let (path, length) = path(here);
                    // A field or method is no path.
                    if !before.last().is_some_and(|token| is(token, '.')) {
                        own.named.insert(path);
                    }
                    length
                }
                // A lifetime is no word.
                [mark, _, ..] if is(mark, '\'') => 2,
                [TokenTree::Group(group), ..] => {
                    self.add(file, module, group.stream());
                    1
                }
                _ => 1,
            };
        }
    }

    /// The file that defines what a path stands for in a module; none where that is another package's.
    fn file(&self, module: &[String], path: &[String], asked: Asked) -> Option<&str> {
        let own = self.0.get(module)?;
        let (name, rest) = path.split_first()?;
        match name.as_str() {
            "crate" | "package" => return self.file(&module[..1], rest, Asked::ByPath),
            "self" => return self.file(module, rest, Asked::ByPath),
            "super" => return self.file(&module[..module.len() - 1], rest, Asked::ByPath),
            _ => {}
        }
        let child = [module, std::slice::from_ref(name)].concat();
        let is_module = self.0.contains_key(&child);
        let uses = || own.uses.iter().filter(|used| used.handed_on || asked != Asked::ByGlob);
        // A package by its own name is none of these.
        let is_ours = |path: &Segments| path[0] != *name || path.len() > 1 && is_module;
        match uses().find(|used| used.name == *name && is_ours(&used.path)) {
            // One name may be a module and a function that is handed on.
            Some(used) if rest.is_empty() || !is_module => {
                return self.file(module, &[&used.path, rest].concat(), Asked::Within);
            }
            _ if is_module => return self.file(&child, rest, Asked::ByPath),
            _ => {}
        }
        if own.defined.contains(name) {
            return Some(&own.file);
        }
        let globs = uses().filter(|used| used.name == "*");
        let mut others = globs.filter_map(|used| self.module(module, &used.path));
        let found = others.find_map(|other| self.file(&other, &path[..1], Asked::ByGlob));
        found.or((asked == Asked::ByPath).then_some(own.file.as_str()))
    }

    /// The module of this package that a path names.
    fn module(&self, from: &[String], path: &[String]) -> Option<Segments> {
        let mut module = from.to_vec();
        for name in path {
            match name.as_str() {
                "crate" => module.truncate(1),
                "self" => {}
                "super" => _ = module.pop(),
                _ => module.push(name.clone()),
            }
        }
        self.0.contains_key(&module).then_some(module)
    }

    fn imports(&self) -> Imports {
        let mut imports = Imports::new();
        for (place, module) in &self.0 {
            for path in &module.named {
                let file = self.file(place, path, Asked::Within);
                if let Some(file) = file.filter(|file| !file.is_empty() && *file != module.file) {
                    let names =
                        imports.entry(module.file.clone()).or_default().entry(file.to_owned()).or_default();
                    names.insert(path.join("::"));
                }
            }
        }
        imports
    }
}

fn is(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

fn is_definition(word: &Ident) -> bool {
    ["const", "enum", "fn", "static", "struct", "trait", "type", "union"].iter().any(|known| word == known)
}

/// Whether code ends in `pub` or `pub(…)`.
fn is_visibility(code: &[TokenTree]) -> bool {
    let code = match code {
        [code @ .., TokenTree::Group(group)] if group.delimiter() == Delimiter::Parenthesis => code,
        _ => code,
    };
    matches!(code, [.., TokenTree::Ident(word)] if word == "pub")
}

/// The path with which code begins, and its length in tokens.
fn path(code: &[TokenTree]) -> (Segments, usize) {
    let (mut path, mut length) = (Segments::new(), 0);
    while let Some(TokenTree::Ident(segment)) = code.get(length) {
        path.push(segment.to_string());
        length += 1;
        match &code[length..] {
            [a, b, TokenTree::Ident(_), ..] if is(a, ':') && is(b, ':') => length += 2,
            _ => break,
        }
    }
    (path, length)
}

/// Names that a tree of imports brings, and their paths; a glob's name is `*`.
fn leaves(tree: &[TokenTree]) -> Vec<(String, Segments)> {
    let (mut path, length) = path(tree);
    match &tree[length..] {
        [.., TokenTree::Group(list)] => {
            let list: Vec<_> = list.stream().into_iter().collect();
            let branches = list.split(|token| is(token, ',')).filter(|branch| !branch.is_empty());
            let leaves = branches.flat_map(leaves);
            let joined = leaves.map(|(name, inner)| {
                let name = if name == "self" { path.last().cloned().unwrap_or_default() } else { name };
                (name, [path.as_slice(), &inner].concat())
            });
            joined.collect()
        }
        [.., star] if is(star, '*') => vec![("*".into(), path)],
        rest => {
            let name = match rest {
                [_, TokenTree::Ident(name)] => name.to_string(),
                _ => path.last().cloned().unwrap_or_default(),
            };
            // `a::{self}` is `a`.
            path.pop_if(|last| last == "self");
            vec![(name, path)]
        }
    }
}

/// All that one imports, directly or not.
fn reached<'a>(imports: &'a Imports, from: &'a str) -> BTreeSet<&'a str> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(next) = open.pop() {
        let imported = imports.get(next).into_iter().flat_map(BTreeMap::keys);
        open.extend(imported.map(String::as_str).filter(|&to| reached.insert(to)));
    }
    reached
}

/// Groups of those that import each other.
fn circles(imports: &Imports) -> BTreeSet<BTreeSet<&str>> {
    let reached: BTreeMap<_, _> =
        imports.keys().map(|from| (from.as_str(), reached(imports, from))).collect();
    let is_back = |from: &str, to: &str| reached.get(to).is_some_and(|back| back.contains(from));
    let circle =
        |from: &str| reached[from].iter().copied().filter(|to| is_back(from, to)).collect::<BTreeSet<_>>();
    reached.keys().map(|from| circle(from)).filter(|circle| !circle.is_empty()).collect()
}

/// What ties each circle.
fn told(imports: &Imports) -> String {
    let mut text = String::new();
    for circle in circles(imports) {
        text += "\na circle:\n";
        for from in &circle {
            for (to, names) in imports[*from].iter().filter(|(to, _)| circle.contains(to.as_str())) {
                let names: Vec<_> = names.iter().map(String::as_str).collect();
                _ = writeln!(text, "  {from} imports {to}: {}", names.join(", "));
            }
        }
    }
    text
}

/// Every file of the packages.
fn repository() -> Imports {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Vec::new();
    let mut open: Vec<_> = std::fs::read_dir(root.join("crates"))
        .unwrap()
        .map(|entry| entry.unwrap().path().join("src"))
        .collect();
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs" || extension == "wesl") {
                let text = std::fs::read_to_string(&path).unwrap();
                files.push((path.strip_prefix(&root).unwrap().to_str().unwrap().to_owned(), text));
            }
        }
    }
    Modules::read(files.iter().map(|(file, text)| (file.as_str(), text.as_str()))).imports()
}

#[test]
fn no_files_import_each_other() {
    let imports = repository();
    assert!(imports.values().map(BTreeMap::len).sum::<usize>() > 700, "imports are not found any more");
    let told = told(&imports);
    assert!(told.is_empty(), "{told}");
}

#[test]
fn rooms_of_techniques_import_only_rooms_below_or_beside_them_and_never_in_a_circle() {
    let room = |file: &str| Some(file.strip_prefix("crates/techniques/src/")?.split_once('/')?.0.to_owned());
    let floor = |room: &str| {
        let found = FLOORS.iter().position(|floor| floor.contains(&room));
        found.unwrap_or_else(|| panic!("the room {room} stands on no floor: docs/architecture.md"))
    };
    let mut rooms = Imports::new();
    for (from, imported) in &repository() {
        for (to, names) in imported {
            let (Some(above), Some(below)) = (room(from), room(to)) else { continue };
            assert!(floor(&below) <= floor(&above), "{from} imports {to}, which stands above it: {names:?}");
            if above != below && !from.ends_with("tests.rs") {
                rooms.entry(above).or_default().entry(below).or_default().insert(format!("{from} {names:?}"));
            }
        }
    }
    let told = told(&rooms);
    assert!(told.is_empty(), "{told}");
}

/// The imports of a made-up package, as `from > to`.
fn made_up(files: &[(&str, &str)]) -> (Imports, Vec<String>) {
    let files: Vec<_> = files.iter().map(|(file, text)| (format!("crates/a/src/{file}"), *text)).collect();
    let imports = Modules::read(files.iter().map(|(file, text)| (file.as_str(), *text))).imports();
    let short = |file: &String| file.strip_prefix("crates/a/src/").unwrap().to_owned();
    let pairs = imports.iter().flat_map(|(from, to)| to.keys().map(move |to| (from, to)));
    let pairs = pairs.map(|(from, to)| format!("{} > {}", short(from), short(to))).collect();
    (imports, pairs)
}

#[test]
fn a_circle_through_re_exports_and_inner_modules_is_found() {
    let (imports, pairs) = made_up(&[
        ("lib.rs", "mod low; mod one; mod two; pub use one::One; pub use two::{Two, helper as help};"),
        ("low.rs", "pub struct Low;"),
        ("one.rs", "use crate::{low::Low, help}; pub struct One(Low); fn f() { help() }"),
        ("two.rs", "pub struct Two; pub fn helper() {} mod inner { fn g(_: crate::One) {} }"),
    ]);
    assert_eq!(pairs, ["one.rs > low.rs", "one.rs > two.rs", "two.rs > one.rs"]);
    let circle = ["crates/a/src/one.rs", "crates/a/src/two.rs"];
    assert_eq!(circles(&imports), [BTreeSet::from(circle)].into());
    assert!(told(&imports).contains("crates/a/src/two.rs imports crates/a/src/one.rs: crate::One"));
}

#[test]
fn a_parent_with_code_of_its_own_and_its_child_are_a_circle_and_a_face_is_none() {
    let child = ("room/child.rs", "use super::SIDE; pub fn area() -> u32 { SIDE * SIDE }");
    let code = "mod child; pub use child::area; pub const SIDE: u32 = 2;";
    let (imports, _) = made_up(&[("room/mod.rs", code), child]);
    assert!(circles(&imports).is_empty());
    let code = code.to_owned() + " fn double() -> u32 { 2 * area() }";
    let (imports, _) = made_up(&[("room/mod.rs", &code), child]);
    assert_eq!(circles(&imports).len(), 1);
}

#[test]
fn imports_are_read_in_every_form() {
    let user = "
        //! [`crate::model::Text`] is no import, nor is \"crate::model::Text\".
        use std::fmt::{self, Write as _};
        use crate::{tool, other::*};
        pub(crate) use crate::face::Face;
        macro_rules! made { () => { $crate::by_macro::Made } }
        fn f(x: Plain) { tool::new(x.face); Wide::default() }";
    let (_, pairs) = made_up(&[
        ("lib.rs", "mod other; mod model; pub use other::*; pub use model::*;"),
        ("user.rs", user),
        ("model.rs", "use super::*; pub struct Plain(Wide);"),
        ("tool.rs", "use crate::Plain; pub fn new() {}"),
        ("other.rs", "use crate::Plain as _; pub struct Wide;"),
        ("face.rs", "pub struct Face;"),
        ("by_macro.rs", "pub struct Made;"),
        ("light/lamp.wesl", "import package::shared::{hash::noise, depth};\nfn lamp() {}"),
        ("light/lamp.cs.wesl", "import package::light::lamp::lamp;"),
        ("shared/hash.wesl", "fn noise() {}"),
        ("shared/depth.wesl", "fn linear() {}"),
    ]);
    let expected = [
        "light/lamp.cs.wesl > light/lamp.wesl",
        "light/lamp.wesl > shared/hash.wesl",
        "model.rs > other.rs",
        "other.rs > model.rs",
        "tool.rs > model.rs",
        "user.rs > by_macro.rs",
        "user.rs > other.rs",
        "user.rs > tool.rs",
    ];
    assert_eq!(pairs, expected);
}
