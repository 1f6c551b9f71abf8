//! Checking an OBJ file's text and rewriting it so that `tobj` reads it safely and fully.
//!
//! Left as they are, relative indices out of range overflow in `tobj`, faces that leave out texture coordinates or
//! normals where others have them shift the streams against each other, concave polygons are fanned, lines continued
//! by a backslash are cut, and no error says which line it is about. The rewritten text has all vertex data first,
//! then triangles with absolute, complete indices; what a corner leaves out refers to a last entry that is NaN.

use std::fmt::Write;
use std::path::Path;

use glam::DVec3;

use super::super::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::{invalid, polygon};
use crate::SceneError;

/// An OBJ file that is safe to parse.
pub(super) struct Checked {
    /// OBJ text with neither `mtllib` nor anything that is not drawn.
    pub(super) text: String,
    /// What each `mtllib` names: one file or several, names with spaces included.
    pub(super) libraries: Vec<String>,
    /// The names that `usemtl` uses, each once.
    pub(super) materials: Vec<String>,
}

/// A corner's indices, counted from 0, and where the file gives none, none.
type Corner = [Option<usize>; 3];

const ELEMENTS: [&str; 3] = ["v", "vt", "vn"];

enum Statement {
    Group(String),
    Material(String),
    /// The first of its corners, and its line.
    Face {
        first: usize,
        line: usize,
    },
}

#[derive(Default)]
struct Reader {
    /// Rewritten `v`, `vt` and `vn` lines.
    data: String,
    positions: Vec<DVec3>,
    colors: Vec<Option<[f32; 3]>>,
    /// How many `v`, `vt`, `vn` there are.
    counts: [usize; 3],
    statements: Vec<Statement>,
    corners: Vec<Corner>,
    libraries: Vec<String>,
    materials: Vec<String>,
    skipped_elements: bool,
    /// Whether a face refers to texture coordinates or normals of which the file has none at all.
    dangling: bool,
}

/// Checks a whole OBJ file.
pub(super) fn check(path: &Path, text: &str, warnings: &mut Warnings) -> Result<Checked, SceneError> {
    let mut reader = Reader::default();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let mut line = line.to_owned();
        while line.trim_end().ends_with('\\') {
            line.truncate(line.trim_end().len() - 1);
            let Some((_, next)) = lines.next() else { break };
            line.push_str(next);
        }
        reader.line(line.trim(), number + 1).map_err(|problem| invalid(path, number + 1, problem))?;
    }
    if reader.skipped_elements {
        warnings.add("points, lines and faces of fewer than three corners were left out");
    }
    let text = reader.rewrite().map_err(|(line, problem)| invalid(path, line, problem))?;
    if reader.dangling {
        warnings.add("faces refer to texture coordinates or normals, but the file has none of them");
    }
    Ok(Checked { text, libraries: reader.libraries, materials: reader.materials })
}

impl Reader {
    fn line(&mut self, line: &str, number: usize) -> Result<(), String> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match keyword {
            "v" => self.position(rest)?,
            "vt" => {
                let values = numbers(rest)?;
                let [u, v] = [0, 1].map(|i| values.get(i).copied().unwrap_or(0.0));
                if values.is_empty() {
                    return Err("`vt` needs one to three numbers".to_owned());
                }
                self.data(format_args!("vt {u} {v}"), 1);
            }
            "vn" => {
                let values = numbers(rest)?;
                let &[x, y, z, ..] = &values[..] else { return Err("`vn` needs three numbers".to_owned()) };
                if [x, y, z] == [0.0; 3] {
                    // No direction: left to be generated.
                    self.data(format_args!("vn NaN NaN NaN"), 2);
                } else {
                    self.data(format_args!("vn {x} {y} {z}"), 2);
                }
            }
            "f" | "fo" => self.face(rest, number)?,
            "l" | "p" => self.skipped_elements = true,
            "o" | "g" => self.statements.push(Statement::Group(rest.to_owned())),
            "usemtl" => {
                if !rest.is_empty() && !self.materials.iter().any(|known| known == rest) {
                    self.materials.push(rest.to_owned());
                }
                self.statements.push(Statement::Material(rest.to_owned()));
            }
            "mtllib" if !rest.is_empty() => self.libraries.push(rest.to_owned()),
            _ => {}
        }
        Ok(())
    }

    fn data(&mut self, line: std::fmt::Arguments<'_>, element: usize) {
        let _ = writeln!(self.data, "{line}"); // Writing to a string does not fail.
        self.counts[element] += 1;
    }

    /// `v x y z [w]` or `v x y z r g b`. The weight w belongs to rational curves and is ignored.
    fn position(&mut self, rest: &str) -> Result<(), String> {
        let values = numbers(rest)?;
        let &[x, y, z, ..] = &values[..] else { return Err("`v` needs three numbers".to_owned()) };
        if [x, y, z].iter().any(|x| x.abs() > MAX_COORDINATE) {
            return Err(format!("the vertex is farther than {MAX_COORDINATE:e} m from the origin"));
        }
        self.positions.push(DVec3::new(x.into(), y.into(), z.into()));
        self.colors.push(match values[3..] {
            [r, g, b] => Some([r, g, b]),
            _ => None,
        });
        self.counts[0] += 1;
        Ok(())
    }

    fn face(&mut self, rest: &str, line: usize) -> Result<(), String> {
        let first = self.corners.len();
        for token in rest.split_whitespace().take_while(|token| !token.starts_with('#')) {
            let mut corner: Corner = [None; 3];
            for (element, index) in token.split('/').enumerate() {
                let Some(slot) = corner.get_mut(element) else {
                    return Err(format!("`{token}` has more than three indices"));
                };
                if !index.is_empty() {
                    *slot = Some(self.index(index, element)?);
                }
            }
            if corner[0].is_none() {
                return Err(format!("`{token}` has no vertex"));
            }
            self.corners.push(corner);
        }
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            self.skipped_elements = true;
        } else {
            self.statements.push(Statement::Face { first, line });
        }
        Ok(())
    }

    /// An index counted from 0. Positive ones may point ahead, and are checked at the end of the file.
    fn index(&self, text: &str, element: usize) -> Result<usize, String> {
        let (count, name) = (self.counts[element], ELEMENTS[element]);
        let index: i64 = text.parse().map_err(|_| format!("`{text}` is not an index"))?;
        let resolved = match index {
            0 => None,
            1.. => usize::try_from(index - 1).ok(),
            _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back)),
        };
        resolved.ok_or_else(|| match index {
            0 => "an index is 0; they count from 1".to_owned(),
            _ => format!("the index {index} reaches back past the {count} `{name}` so far"),
        })
    }

    /// The text for `tobj`; the error has a line and a problem.
    fn rewrite(&mut self) -> Result<String, (usize, String)> {
        let mut out = String::with_capacity(2 * self.data.len());
        let has_colors = self.colors.iter().any(Option::is_some);
        for (p, color) in self.positions.iter().zip(&self.colors) {
            let _ = write!(out, "v {} {} {}", p.x as f32, p.y as f32, p.z as f32);
            if has_colors {
                let [r, g, b] = color.unwrap_or([1.0; 3]);
                let _ = write!(out, " {r} {g} {b}");
            }
            out.push('\n');
        }
        out.push_str(&self.data);
        out.push_str("vt NaN NaN\nvn NaN NaN NaN\n");
        // The library is loaded beforehand; this has `tobj` ask for it.
        out.push_str("mtllib library\n");
        // Exporters write such indices out of habit; they say nothing.
        for element in [1, 2].into_iter().filter(|&element| self.counts[element] == 0) {
            for index in self.corners.iter_mut().map(|corner| &mut corner[element]) {
                self.dangling |= index.take().is_some();
            }
        }
        let mut ends = self.face_ends().into_iter();
        for statement in &self.statements {
            let _ = match statement {
                Statement::Group(name) => writeln!(out, "g {name}"),
                // A name that no library has stands for none.
                Statement::Material(name) if name.is_empty() => writeln!(out, "usemtl \u{1}"),
                Statement::Material(name) => writeln!(out, "usemtl {name}"),
                Statement::Face { first, line } => {
                    let end = ends.next().unwrap_or(self.corners.len());
                    self.write_face(&mut out, &self.corners[*first..end])
                        .map_err(|problem| (*line, problem))?;
                    Ok(())
                }
            };
        }
        Ok(out)
    }

    /// Where each face's corners end: where the next one's begin.
    fn face_ends(&self) -> Vec<usize> {
        let firsts = self.statements.iter().filter_map(|statement| match statement {
            Statement::Face { first, .. } => Some(*first),
            _ => None,
        });
        firsts.skip(1).chain([self.corners.len()]).collect()
    }

    fn write_face(&self, out: &mut String, corners: &[Corner]) -> Result<(), String> {
        for corner in corners {
            for (element, index) in corner.iter().enumerate() {
                let (count, name) = (self.counts[element], ELEMENTS[element]);
                if let Some(index) = index.filter(|index| *index >= count) {
                    return Err(format!("the index {} exceeds the file's {count} `{name}`", index + 1));
                }
            }
        }
        // Every corner has a vertex, in range as of above.
        let points: Vec<DVec3> = corners.iter().filter_map(|c| c[0]).map(|v| self.positions[v]).collect();
        for triangle in polygon::triangulate(&points) {
            out.push('f');
            for corner in triangle.map(|i| corners[i]) {
                // Without an index: the last entry, which is NaN.
                let [v, vt, vn] = [0, 1, 2].map(|e| corner[e].unwrap_or(self.counts[e]) + 1);
                let _ = write!(out, " {v}/{vt}/{vn}");
            }
            out.push('\n');
        }
        Ok(())
    }
}

/// The finite numbers of a line up to a comment.
fn numbers(text: &str) -> Result<Vec<f32>, String> {
    text.split_whitespace()
        .take_while(|token| !token.starts_with('#'))
        .map(|token| match token.parse::<f32>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("`{token}` is not a finite number")),
        })
        .collect()
}
