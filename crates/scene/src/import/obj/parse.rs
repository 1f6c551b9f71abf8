//! Parsing OBJ text.
//!
//! What is not drawn (points, lines, curves, surfaces) is skipped. Every index of a parsed file is in range.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use glam::{DVec3, Vec2, Vec3};

use super::super::limits::MAX_COORDINATE;
use super::super::text;
use super::super::warnings::Warnings;
use crate::SceneError;

/// Stands for an index that a corner leaves out.
pub(super) const NONE: u32 = u32::MAX;

/// Indices from 0 of a corner's position, texture coordinates and normal; [`NONE`] for the last two where left out.
pub(super) type Corner = [u32; 3];

const ELEMENTS: [&str; 3] = ["v", "vt", "vn"];

/// A polygon of at least three corners.
#[derive(Clone, Debug)]
pub(super) struct Face {
    /// Which of [`Parsed::corners`].
    pub(super) corners: Range<usize>,
    /// Counted from 1.
    line: usize,
    /// Which of [`Parsed::groups`].
    pub(super) group: usize,
    /// Which of [`Parsed::materials`].
    pub(super) material: Option<usize>,
    /// The `s` statement before it: `None` = there was none, 0 = off.
    pub(super) smoothing: Option<u32>,
}

/// What an OBJ file says.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// Metres.
    pub(super) positions: Vec<DVec3>,
    /// Of each position, where the file has any: sRGB.
    pub(super) colors: Vec<Option<Vec3>>,
    /// Origin at the bottom left.
    pub(super) uvs: Vec<Vec2>,
    /// Of any length; NaN where the file's has no direction.
    pub(super) normals: Vec<Vec3>,
    pub(super) corners: Vec<Corner>,
    pub(super) faces: Vec<Face>,
    /// Names of objects and groups, one for each run of faces.
    pub(super) groups: Vec<String>,
    /// The names that `usemtl` uses, each once.
    pub(super) materials: Vec<String>,
    /// What each `mtllib` names: one file or several, names with spaces included.
    pub(super) libraries: Vec<String>,
    group: usize,
    material: Option<usize>,
    smoothing: Option<u32>,
    /// Points, lines and faces that are not drawn.
    pub(super) skipped: usize,
    material_ids: HashMap<String, usize>,
}

impl Parsed {
    /// Parses a whole OBJ file.
    pub(super) fn new(path: &Path, text: &str, warnings: &mut Warnings) -> Result<Self, SceneError> {
        let mut parsed = Self { groups: vec![String::new()], ..Self::default() };
        let mut lines = text.lines().enumerate();
        while let Some((number, line)) = lines.next() {
            let mut line = Cow::Borrowed(line);
            // What a comment ends with joins nothing.
            let is_joined =
                |part: &str| part.trim_end().ends_with('\\') && text::comments(part).next().is_none();
            let mut joins = is_joined(&line);
            while joins {
                let end = line.trim_end().len() - 1;
                line.to_mut().truncate(end);
                let Some((_, next)) = lines.next() else { break };
                line.to_mut().push_str(next);
                joins = is_joined(next);
            }
            parsed.line(line.trim(), number + 1).map_err(|problem| invalid(path, number + 1, problem))?;
        }
        if parsed.skipped > 0 {
            warnings.add("points, lines and faces of fewer than three corners were left out");
        }
        parsed.check_indices(path, warnings)?;
        Ok(parsed)
    }

    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    fn line(&mut self, line: &str, number: usize) -> Result<(), String> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match keyword {
            "v" => self.position(rest)?,
            "vt" => {
                let values = numbers::<f32>(rest)?;
                let &[u, ..] = &values[..] else { return Err("`vt` needs one to three numbers".to_owned()) };
                self.uvs.push(Vec2::new(u, values.get(1).copied().unwrap_or(0.0)));
            }
            "vn" => {
                let values = numbers::<f32>(rest)?;
                let &[x, y, z, ..] = &values[..] else { return Err("`vn` needs three numbers".to_owned()) };
                let normal = Vec3::new(x, y, z);
                self.normals.push(if normal == Vec3::ZERO { Vec3::NAN } else { normal });
            }
            "f" | "fo" => self.face(rest, number)?,
            "l" | "p" => self.skipped += 1,
            "o" | "g" => {
                // A group without a face between leaves nothing.
                let used = self.faces.last().is_some_and(|face| face.group == self.group);
                if used && self.groups[self.group] != rest {
                    self.groups.push(rest.to_owned());
                    self.group += 1;
                } else if !used {
                    rest.clone_into(&mut self.groups[self.group]);
                }
            }
            "s" => {
                let group = rest.split_whitespace().next().unwrap_or_default();
                self.smoothing = Some(group.parse().unwrap_or(0));
            }
            "usemtl" => {
                self.material = (!rest.is_empty()).then(|| {
                    *self.material_ids.entry(rest.to_owned()).or_insert_with(|| {
                        self.materials.push(rest.to_owned());
                        self.materials.len() - 1
                    })
                });
            }
            "mtllib" if !rest.is_empty() => self.libraries.push(rest.to_owned()),
            _ => {}
        }
        Ok(())
    }

    /// `v x y z [w]` or `v x y z r g b`. The weight w belongs to rational curves and is ignored.
    fn position(&mut self, rest: &str) -> Result<(), String> {
        let values = numbers::<f64>(rest)?;
        let &[x, y, z, ..] = &values[..] else { return Err("`v` needs three numbers".to_owned()) };
        if [x, y, z].iter().any(|x| x.abs() > f64::from(MAX_COORDINATE)) {
            return Err(format!("the vertex is farther than {MAX_COORDINATE:e} m from the origin"));
        }
        self.positions.push(DVec3::new(x, y, z));
        self.colors.push(match values[3..] {
            [r, g, b] => Some(DVec3::new(r, g, b).as_vec3()),
            _ => None,
        });
        Ok(())
    }

    fn face(&mut self, rest: &str, line: usize) -> Result<(), String> {
        let first = self.corners.len();
        for token in rest.split_whitespace().take_while(|token| !token.starts_with('#')) {
            let mut corner: Corner = [NONE; 3];
            for (element, index) in token.split('/').enumerate() {
                let Some(slot) = corner.get_mut(element) else {
                    return Err(format!("`{token}` has more than three indices"));
                };
                if !index.is_empty() {
                    *slot = self.index(index, element)?;
                }
            }
            if corner[0] == NONE {
                return Err(format!("`{token}` has no vertex"));
            }
            self.corners.push(corner);
        }
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            self.skipped += 1;
        } else {
            let Self { group, material, smoothing, .. } = *self;
            let corners = first..self.corners.len();
            self.faces.push(Face { corners, line, group, material, smoothing });
        }
        Ok(())
    }

    /// An index counted from 0. Positive ones may point ahead, and are checked at the end of the file.
    fn index(&self, text: &str, element: usize) -> Result<u32, String> {
        let (count, name) = (self.counts()[element], ELEMENTS[element]);
        let index: i64 = text.parse().map_err(|_| format!("`{text}` is not an index"))?;
        let resolved: Option<usize> = match index {
            0 => None,
            1.. => usize::try_from(index - 1).ok(),
            _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back)),
        };
        let resolved = resolved.and_then(|index| u32::try_from(index).ok()).filter(|&index| index != NONE);
        resolved.ok_or_else(|| match index {
            0 => "an index is 0; they count from 1".to_owned(),
            1.. => format!("the index {index} is too large"),
            _ => format!("the index {index} reaches back past the {count} `{name}` so far"),
        })
    }

    /// Refuses indices that point past the file's end.
    fn check_indices(&mut self, path: &Path, warnings: &mut Warnings) -> Result<(), SceneError> {
        let counts = self.counts();
        // Exporters write such indices out of habit; they say nothing.
        let mut dangling = false;
        for element in [1, 2].into_iter().filter(|&element| counts[element] == 0) {
            for index in self.corners.iter_mut().map(|corner| &mut corner[element]) {
                dangling |= std::mem::replace(index, NONE) != NONE;
            }
        }
        if dangling {
            warnings.add("faces refer to texture coordinates or normals, but the file has none of them");
        }
        for face in &self.faces {
            for (element, &index) in
                self.corners[face.corners.clone()].iter().flat_map(|c| c.iter().enumerate())
            {
                let (count, name) = (counts[element], ELEMENTS[element]);
                if index != NONE && index as usize >= count {
                    let problem =
                        format!("the index {} exceeds the file's {count} `{name}`", u64::from(index) + 1);
                    return Err(invalid(path, face.line, problem));
                }
            }
        }
        Ok(())
    }
}

/// The finite numbers of a line up to a comment.
fn numbers<T: FromStr + Copy + Into<f64>>(text: &str) -> Result<Vec<T>, String> {
    text.split_whitespace()
        .take_while(|token| !token.starts_with('#'))
        .map(|token| match token.parse::<T>() {
            Ok(number) if number.into().is_finite() => Ok(number),
            _ => Err(format!("`{token}` is not a finite number")),
        })
        .collect()
}

/// An error about a line of the OBJ file, counted from 1.
fn invalid(path: &Path, line: usize, problem: impl Into<String>) -> SceneError {
    SceneError::Invalid { path: path.to_owned(), place: format!("line {line}"), problem: problem.into() }
}
