//! Material libraries: finding and parsing them.
//!
//! A line that cannot be read is left out with a warning and loses nothing else. Keywords count in any case.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::super::files::Files;
use super::super::source;
use super::super::warnings::Warnings;
use super::map;

/// Keywords whose value is a file name with options, and their one spelling here.
const MAPS: &[(&str, &str)] = &[
    ("map_kd", "map_Kd"),
    ("map_ks", "map_Ks"),
    ("map_ke", "map_Ke"),
    ("map_d", "map_d"),
    ("map_bump", "bump"),
    ("bump", "bump"),
    ("norm", "norm"),
];

/// One `newmtl`, as written.
#[derive(Debug, Default)]
pub(super) struct Source {
    pub(super) name: String,
    /// What its textures are relative to.
    pub(super) directory: PathBuf,
    pub(super) diffuse: Option<[f32; 3]>,
    pub(super) specular: Option<[f32; 3]>,
    pub(super) emissive: Option<[f32; 3]>,
    /// `Tf`, what passes through.
    pub(super) filter: Option<[f32; 3]>,
    /// `Ns`
    pub(super) exponent: Option<f32>,
    /// `Ni`
    pub(super) ior: Option<f32>,
    /// `d`, or 1 − `Tr`.
    pub(super) dissolve: Option<f32>,
    pub(super) illum: Option<u8>,
    maps: HashMap<&'static str, String>,
}

impl Source {
    /// What follows the keyword `map_Kd`, `map_Ks`, `map_Ke`, `map_d`, `bump` or `norm`.
    pub(super) fn map(&self, keyword: &str) -> Option<&str> {
        self.maps.get(keyword).map(String::as_str)
    }
}

/// All material libraries of one OBJ file, by the materials' names. Of several with one name the last counts.
pub(super) type Library = HashMap<String, Source>;

/// Loads every library that the OBJ file at `path` names; what is missing or malformed becomes a warning.
pub(super) fn load(files: &dyn Files, path: &Path, named: &[String], warnings: &mut Warnings) -> Library {
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut library = Library::new();
    let found: Vec<PathBuf> =
        named.iter().flat_map(|names| find(files, directory, names, warnings)).collect();
    for file in found {
        match source::read_file(files, &file) {
            Ok(bytes) => parse(&mut library, &file, &String::from_utf8_lossy(&bytes), warnings),
            Err(error) => warnings.add(error.to_string()),
        }
    }
    library
}

/// The files that an `mtllib` line names: the line is one name with spaces, or several, whose spaces a backslash
/// escapes.
fn find(files: &dyn Files, directory: &Path, names: &str, warnings: &mut Warnings) -> Vec<PathBuf> {
    if let Some(file) = map::find_file(files, directory, names) {
        return vec![file];
    }
    let mut found = Vec::new();
    for name in names.replace("\\ ", "\0").split_whitespace() {
        let name = name.replace('\0', " ");
        match map::find_file(files, directory, &name) {
            Some(file) => found.push(file),
            None => warnings.add(format!("the material library `{name}` was not found")),
        }
    }
    found
}

/// Adds the materials of an MTL file.
fn parse(library: &mut Library, file: &Path, text: &str, warnings: &mut Warnings) {
    let directory = file.parent().unwrap_or(Path::new(""));
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let mut material: Option<Source> = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let (keyword, rest) = (keyword.to_ascii_lowercase(), rest.trim());
        let is_new = keyword == "newmtl";
        if is_new {
            library.extend(material.take().map(|done| (done.name.clone(), done)));
            material = (!rest.is_empty()).then(|| Source {
                name: rest.to_owned(),
                directory: directory.to_owned(),
                ..Source::default()
            });
        }
        let understood = match &mut material {
            None => !is_new,
            Some(_) if is_new => true,
            Some(material) => property(material, &keyword, rest),
        };
        if !understood {
            warnings.add(format!("{name}: line {} was left out: `{line}`", number + 1));
        }
    }
    library.extend(material.map(|done| (done.name.clone(), done)));
}

/// Sets what a line says; `false` where the keyword is known and the rest is not. Unknown keywords say nothing.
fn property(material: &mut Source, keyword: &str, rest: &str) -> bool {
    fn set<T>(slot: &mut Option<T>, value: Option<T>) -> bool {
        let understood = value.is_some();
        *slot = value.or(slot.take());
        understood
    }
    match keyword {
        "kd" => set(&mut material.diffuse, color(rest)),
        "ks" => set(&mut material.specular, color(rest)),
        "ke" => set(&mut material.emissive, color(rest)),
        "tf" => set(&mut material.filter, color(rest)),
        "ns" => set(&mut material.exponent, number_in(rest)),
        "ni" => set(&mut material.ior, number_in(rest)),
        "d" => set(&mut material.dissolve, number_in(rest)),
        // `d` counts where both are there.
        "tr" => {
            let dissolve = number_in(rest).map(|transparency| 1.0 - transparency);
            dissolve.is_some_and(|dissolve| {
                material.dissolve.get_or_insert(dissolve);
                true
            })
        }
        "illum" => set(&mut material.illum, rest.parse().ok()),
        _ => match MAPS.iter().find(|(known, _)| *known == keyword) {
            Some(_) if rest.is_empty() => false,
            Some((_, spelling)) => {
                material.maps.insert(spelling, rest.to_owned());
                true
            }
            None => true,
        },
    }
}

/// Three numbers, or one for all three. Spectral and XYZ colours are not supported.
fn color(text: &str) -> Option<[f32; 3]> {
    let numbers: Vec<f32> = text
        .split_whitespace()
        .map_while(|token| token.parse().ok())
        .filter(|x: &f32| x.is_finite())
        .collect();
    match numbers[..] {
        [grey] => Some([grey; 3]),
        [r, g, b, ..] => Some([r, g, b]),
        _ => None,
    }
}

/// The line's number; options such as `-halo` may stand before it.
fn number_in(text: &str) -> Option<f32> {
    text.split_whitespace().find_map(|token| token.parse().ok()).filter(|x: &f32| x.is_finite())
}
