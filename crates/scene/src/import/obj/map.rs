//! `map_…` lines: options, comments, and the file that they name.

use std::path::{Path, PathBuf};

use glam::{Affine2, Vec2};

use super::super::files::Files;
use super::super::{source, text};

/// A texture as a material names it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// As written.
    pub(super) file: String,
    /// `-s`
    pub(super) scale: Vec2,
    /// `-o`
    pub(super) offset: Vec2,
    /// `-clamp on`
    pub(super) clamp: bool,
    /// `-bm`
    pub(super) bump: f32,
}

impl Map {
    /// Parses what follows the keyword. Options may stand before and after the name, which may contain spaces; those
    /// without a meaning here are skipped.
    pub(super) fn parse(text: &str) -> Self {
        let mut map =
            Self { file: String::new(), scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false, bump: 1.0 };
        let tokens: Vec<&str> = text.split_whitespace().collect();
        let mut name: Vec<&str> = Vec::new();
        let mut at = 0;
        while let Some(&token) = tokens.get(at) {
            at += 1;
            match token {
                "-s" | "-o" | "-t" => {
                    let is_number = |t: &&&str| t.parse::<f32>().is_ok_and(f32::is_finite);
                    let count = tokens[at..].iter().take(3).take_while(is_number).count();
                    let number = |i: usize, default| {
                        if i < count { tokens[at + i].parse().unwrap_or(default) } else { default }
                    };
                    match token {
                        "-s" => map.scale = Vec2::new(number(0, 1.0), number(1, 1.0)),
                        "-o" => map.offset = Vec2::new(number(0, 0.0), number(1, 0.0)),
                        _ => {}
                    }
                    at += count;
                }
                "-bm" => {
                    let value = tokens.get(at).and_then(|t| t.parse().ok()).filter(|x: &f32| x.is_finite());
                    map.bump = value.unwrap_or(1.0);
                    at += 1;
                }
                "-clamp" => {
                    map.clamp = tokens.get(at) == Some(&"on");
                    at += 1;
                }
                "-blendu" | "-blendv" | "-boost" | "-cc" | "-colorspace" | "-imfchan" | "-texres"
                | "-type" => {
                    at += 1;
                }
                "-mm" => at += 2,
                _ => name.push(token),
            }
        }
        name.join(" ").trim_matches('"').clone_into(&mut map.file);
        map
    }

    /// The options as a transform of coordinates whose v points down.
    pub(super) fn uv_transform(&self) -> Affine2 {
        // With v = 1 − v', v ↦ s·v + o becomes v' ↦ s·v' + 1 − s − o.
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        Affine2::from_scale_angle_translation(self.scale, 0.0, offset)
    }
}

/// Comments of a line that are tried.
const MAX_COMMENTS: usize = 8;

/// What a line may mean: with all that may be a comment in it, or up to one; the longest first.
fn readings(text: &str) -> Vec<Map> {
    let comments: Vec<usize> = text::comments(text).take(MAX_COMMENTS).collect();
    let ends = std::iter::once(text.len()).chain(comments.into_iter().rev());
    ends.map(|end| Map::parse(&text[..end])).collect()
}

/// The map that a line means, and its file in one of the `directories`: of the line's readings the longest that names a
/// file, as names may hold what looks like a comment. The error is the name that was not found.
pub(super) fn find(files: &dyn Files, directories: [&Path; 2], text: &str) -> Result<(Map, PathBuf), String> {
    let readings = readings(text);
    let in_any =
        |map: &Map, find: Find| directories.iter().find_map(|directory| find(files, directory, &map.file));
    let as_named = readings.iter().find_map(|map| Some((map, in_any(map, source::find_as_named)?)));
    // Where only a foreign path's last part helps, the shortest: a comment may hold a path, too.
    let found = as_named
        .or_else(|| readings.iter().rev().find_map(|map| Some((map, in_any(map, source::find_file)?))));
    let found = found.map(|(map, file)| (map.clone(), file));
    found.ok_or_else(|| readings.last().map_or(String::new(), |map| map.file.clone()))
}

/// A way to find a file below a directory.
type Find = fn(&dyn Files, &Path, &str) -> Option<PathBuf>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Memory;

    #[test]
    fn options_may_stand_before_and_after_a_name_with_spaces() {
        let map = Map::parse("-s 2 3 1 -imfchan r my texture 01.png -bm 1.5 -clamp on");
        assert_eq!(map.file, "my texture 01.png");
        assert_eq!((map.scale, map.offset), (Vec2::new(2.0, 3.0), Vec2::ZERO));
        assert_eq!((map.clamp, map.bump), (true, 1.5));
    }

    #[test]
    fn what_looks_like_a_comment_may_be_part_of_the_name() {
        let mut files = Memory::default();
        for name in ["a.png", "b #2.png", "c.png", "other.png"] {
            files.insert(name, *b"");
        }
        let found = |text: &str| find(&files, [Path::new(""); 2], text);
        let (map, file) = found("-s 2 2 a.png # -s 3 3 other.png").unwrap();
        assert_eq!((map.scale, file), (Vec2::splat(2.0), PathBuf::from("a.png")));
        assert_eq!(found("b #2.png # the second").unwrap().1, Path::new("b #2.png"));
        assert_eq!(found(r"C:\maps\c.png # was D:\other.png").unwrap().1, Path::new("c.png"));
        assert_eq!(found("d.png # gone").unwrap_err(), "d.png");
        assert!(found("# nothing").is_err());
    }

    #[test]
    fn options_with_one_number_keep_the_other_default() {
        let map = Map::parse("-o 0.1 -s 2 diffuse.jpg");
        assert_eq!((map.offset, map.scale), (Vec2::new(0.1, 0.0), Vec2::new(2.0, 1.0)));
    }

    #[test]
    fn the_transform_acts_on_coordinates_that_point_up() {
        let map = Map::parse("-s 2 3 -o 0.25 0.5 a.png");
        let up = Vec2::new(0.2, 0.3);
        let expected = up * Vec2::new(2.0, 3.0) + Vec2::new(0.25, 0.5);
        let got = map.uv_transform().transform_point2(Vec2::new(up.x, 1.0 - up.y));
        assert!(Vec2::new(got.x, 1.0 - got.y).abs_diff_eq(expected, 1e-6));
    }
}
