//! Numbered images in a folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use crate::values::extension;

/// A folder's EXR files by their numbers.
#[derive(Debug)]
pub struct Numbered {
    pub folder: PathBuf,
    pub files: BTreeMap<u64, PathBuf>,
}

impl Numbered {
    /// Those of `a.0007.exr`, `a_7.exr`, `0007.exr`. What lies beside such a file as `a.0007.depth.exr` does, or
    /// `a.0007.shadow.shadow_maps.0.exr`, is a part of its picture.
    pub fn find(folder: &Path) -> anyhow::Result<Self> {
        let shown = folder.display();
        if folder.is_file() {
            bail!("{shown} is a file; --sequence compares folders of numbered EXR images");
        }
        let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read the folder {shown}"))?;
        let mut pictures = Vec::new();
        for entry in entries {
            let path = entry.with_context(|| format!("cannot read the folder {shown}"))?.path();
            if let Some(number) = number(&path).filter(|_| path.is_file()) {
                pictures.push((path, number));
            }
        }
        pictures.sort_unstable();
        let stems: Vec<_> =
            pictures.iter().filter_map(|(path, _)| stem(path)).map(|s| format!("{s}.")).collect();
        let beside = |path: &Path| stems.iter().any(|other| stem(path).is_some_and(|s| s.starts_with(other)));
        let mut files = BTreeMap::new();
        for (path, number) in pictures.iter().filter(|(path, _)| !beside(path)) {
            if let Some(other) = files.insert(*number, path.clone()) {
                let (other, path) = (other.display(), path.display());
                bail!("{other} and {path} are both frame {number}; leave one of them in the folder");
            }
        }
        if files.is_empty() {
            bail!("{shown} holds no numbered EXR images such as a.0007.exr");
        }
        Ok(Self { folder: folder.to_owned(), files })
    }

    /// The file of a number that there is.
    pub fn file(&self, number: u64) -> anyhow::Result<&Path> {
        let file = self.files.get(&number);
        Ok(file.with_context(|| format!("{} holds no frame {number}", self.folder.display()))?)
    }

    /// Numbers that the other folder lacks.
    pub fn without<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = u64> + 'a {
        self.files.keys().copied().filter(|number| !other.files.contains_key(number))
    }
}

fn stem(path: &Path) -> Option<&str> {
    path.file_stem()?.to_str()
}

/// The number at the end of an EXR's name, by itself or after a dot, dash or underscore.
fn number(path: &Path) -> Option<u64> {
    let stem = stem(path).filter(|_| extension(path) == "exr")?;
    let name = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    // A dash after another mark is a sign: frames before 0 are no frames of an animation.
    let is_signed = name == "-" || [".-", "--", "_-"].iter().any(|sign| name.ends_with(sign));
    let apart = name.is_empty() || name.ends_with(['.', '-', '_']) && !is_signed;
    stem[name.len()..].parse().ok().filter(|_| apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_apart_at_the_end_of_names() {
        for (name, expected) in [
            ("a.0007.exr", Some(7)),
            ("frames/a.b_12.EXR", Some(12)),
            ("0003.exr", Some(3)),
            ("a.0007.motion.exr", None),
            ("a.0007.png", None),
            ("a7.exr", None),
            ("a.exr", None),
            (".exr", None),
            ("a-012.exr", Some(12)),
            ("a.-001.exr", None),
            ("-001.exr", None),
            ("a.99999999999999999999999.exr", None),
            ("a.٣.exr", None),
        ] {
            assert_eq!(number(Path::new(name)), expected, "{name}");
        }
    }
}
