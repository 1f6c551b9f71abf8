//! Material libraries: finding and parsing them.
//!
//! A line that cannot be read is left out with a warning and loses nothing else. Keywords count in any case.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::super::files::Files;
use super::super::warnings::Warnings;
use super::super::{source, text};
use crate::SceneError;

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

/// All material libraries of one OBJ file. Of several materials with one name the last counts.
#[derive(Debug, Default)]
pub(super) struct Library {
    materials: Vec<Source>,
    by_name: HashMap<String, usize>,
}

impl Library {
    /// The material of that name; what may be a comment after it does not count where there is none with it.
    pub(super) fn get(&self, name: &str) -> Option<&Source> {
        let index = self.by_name.get(name).or_else(|| self.by_name.get(text::uncommented(name)))?;
        Some(&self.materials[*index])
    }

    fn add(&mut self, material: Source) {
        let index = self.materials.len();
        self.by_name.entry(text::uncommented(&material.name).to_owned()).or_insert(index);
        self.by_name.insert(material.name.clone(), index);
        self.materials.push(material);
    }
}

/// What a library that is not there leaves.
const WITHOUT: &str = "its materials are the default one";

/// Loads every library that the OBJ file at `path` names.
pub(super) fn load(
    files: &dyn Files,
    path: &Path,
    named: &[String],
    warnings: &mut Warnings,
) -> Result<Library, SceneError> {
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut library = Library::default();
    for names in named {
        for file in find(files, (path, directory), names, warnings)? {
            let bytes = match source::read_file(files, &file) {
                Ok(bytes) => bytes,
                Err(error) => {
                    warnings.stand_in(error, WITHOUT)?;
                    continue;
                }
            };
            match text::decode(&bytes) {
                Ok(text) => parse(&mut library, &file, &text, warnings),
                Err(problem) => warnings.stand_in(invalid(&file, "text", problem), WITHOUT)?,
            }
        }
    }
    Ok(library)
}

fn invalid(path: &Path, place: &str, problem: String) -> SceneError {
    SceneError::Invalid { path: path.to_owned(), place: place.to_owned(), problem }
}

/// The files that an `mtllib` line names: the line is one name with spaces, or several, whose spaces a backslash
/// escapes. A comment may follow.
fn find(
    files: &dyn Files,
    (path, directory): (&Path, &Path),
    line: &str,
    warnings: &mut Warnings,
) -> Result<Vec<PathBuf>, SceneError> {
    let names = text::uncommented(line);
    let whole = source::find_as_named(files, directory, line);
    if let Some(file) = whole.or_else(|| source::find_file(files, directory, names)) {
        return Ok(vec![file]);
    }
    let mut found = Vec::new();
    for name in names.replace("\\ ", "\0").split_whitespace() {
        let name = name.replace('\0', " ");
        if let Some(file) = source::find_file(files, directory, &name) {
            found.push(file);
        } else {
            let problem = format!("the material library `{name}` was not found");
            warnings.stand_in(invalid(path, "mtllib", problem), WITHOUT)?;
        }
    }
    Ok(found)
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
            if let Some(done) = material.take() {
                library.add(done);
            }
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
    if let Some(done) = material {
        library.add(done);
    }
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
