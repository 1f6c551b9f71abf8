//! Material libraries: finding them, and checking their text before `tobj` parses it.
//!
//! A colour with fewer than three numbers panics in `tobj`, any other bad line loses the whole library, and keywords
//! must have the customary case. The rewritten text has canonical keywords and sound values only.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::super::files::Files;
use super::super::source;
use super::super::warnings::Warnings;
use super::guard::Checked;
use super::map;
use crate::SceneError;

/// The keyword under which the rewritten text says which directory a material's textures are relative to.
const DIRECTORY: &str = "chiaro_directory";

/// Keywords whose value is a file name with options, as `tobj` spells them.
const MAPS: &[&str] =
    &["map_Ka", "map_Kd", "map_Ks", "map_Ke", "map_Ns", "map_d", "map_bump", "bump", "norm"];

/// All material libraries of one OBJ file.
pub(super) struct Library {
    materials: Vec<tobj::Material>,
    ids: HashMap<String, usize>,
    directories: Vec<PathBuf>,
}

/// Loads every library that the OBJ file at `path` names; what is missing or malformed becomes a warning.
pub(super) fn load(files: &dyn Files, path: &Path, named: &[String], warnings: &mut Warnings) -> Library {
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut text = String::new();
    let mut directories = Vec::new();
    let found: Vec<PathBuf> =
        named.iter().flat_map(|names| find(files, directory, names, warnings)).collect();
    for file in found {
        match source::read_file(files, &file) {
            Ok(bytes) => {
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                rewrite(&mut text, &name, directories.len(), &String::from_utf8_lossy(&bytes), warnings);
                directories.push(file.parent().unwrap_or(Path::new("")).to_owned());
            }
            Err(error) => warnings.add(error.to_string()),
        }
    }
    // Cannot fail on rewritten text, but need not be relied upon.
    let parsed = tobj::load_mtl_buf(&mut text.as_bytes());
    let (materials, ids) = parsed.unwrap_or_else(|error| {
        warnings.add(format!("the material libraries were left out: {error}"));
        Default::default()
    });
    Library { materials, ids: ids.into_iter().collect(), directories }
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

/// Appends what is sound in an MTL file's `text` to `out`.
fn rewrite(out: &mut String, file: &str, directory: usize, text: &str, warnings: &mut Warnings) {
    let mut in_material = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let (keyword, rest) = (keyword.to_ascii_lowercase(), rest.trim());
        let mut malformed = || warnings.add(format!("{file}: line {} was left out: `{line}`", number + 1));
        if keyword == "newmtl" {
            in_material = !rest.is_empty();
            if in_material {
                let _ = writeln!(out, "newmtl {rest}\n{DIRECTORY} {directory}"); // Strings take everything.
            } else {
                malformed();
            }
            continue;
        }
        if !in_material {
            continue;
        }
        let canonical = MAPS.iter().find(|map| map.eq_ignore_ascii_case(&keyword));
        let written = match keyword.as_str() {
            "ka" | "kd" | "ks" | "ke" => color(rest).map(|[r, g, b]| {
                let mut letters = keyword.chars();
                let upper = letters.next().unwrap_or_default().to_ascii_uppercase();
                writeln!(out, "{upper}{} {r} {g} {b}", letters.as_str())
            }),
            "ns" => number_in(rest).map(|value| writeln!(out, "Ns {value}")),
            "ni" => number_in(rest).map(|value| writeln!(out, "Ni {value}")),
            "d" => number_in(rest).map(|value| writeln!(out, "d {value}")),
            "tr" => number_in(rest).map(|value| writeln!(out, "Tr {value}")),
            "illum" => rest.parse::<u8>().ok().map(|model| writeln!(out, "illum {model}")),
            _ => match canonical {
                Some(map) if !rest.is_empty() => Some(writeln!(out, "{map} {rest}")),
                Some(_) => None,
                None => continue,
            },
        };
        if written.is_none() {
            malformed();
        }
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

impl Library {
    pub(super) fn contains(&self, name: &str) -> bool {
        self.ids.contains_key(name)
    }

    pub(super) fn materials(&self) -> &[tobj::Material] {
        &self.materials
    }

    /// The directory of the file that a material came from.
    pub(super) fn directory(&self, material: &tobj::Material) -> &Path {
        let index = material.unknown_param.get(DIRECTORY).and_then(|index| index.parse::<usize>().ok());
        index.and_then(|index| self.directories.get(index)).map_or(Path::new(""), PathBuf::as_path)
    }

    /// Parses the checked OBJ text with these materials.
    pub(super) fn parse(&self, path: &Path, checked: &Checked) -> Result<Vec<tobj::Model>, SceneError> {
        let material_loader = |_: &Path| {
            Ok((self.materials.clone(), self.ids.iter().map(|(name, &id)| (name.clone(), id)).collect()))
        };
        let parsed =
            tobj::load_obj_buf(&mut checked.text.as_bytes(), &tobj::GPU_LOAD_OPTIONS, material_loader);
        let (models, _) = parsed.map_err(|error| SceneError::Invalid {
            path: path.to_owned(),
            place: "OBJ".to_owned(),
            problem: error.to_string(),
        })?;
        Ok(models)
    }
}
