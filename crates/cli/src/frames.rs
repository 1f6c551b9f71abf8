//! Moments of an animation, and the numbered files that they are written to.

use std::path::{Path, PathBuf};

use crate::args::TimeArgs;
use crate::values::FrameRange;

/// A moment to show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The frame's number; none of a moment by itself.
    pub number: Option<u32>,
    pub time_s: f64,
}

impl Moment {
    /// The file that shows it.
    pub fn path(&self, output: &Path) -> PathBuf {
        self.number.map_or(output.to_owned(), |number| numbered(output, number))
    }
}

/// How many moments there are.
pub fn count(args: &TimeArgs) -> u64 {
    args.frames.map_or(1, |FrameRange { start, end }| u64::from(end - start))
}

/// All that are asked for, in their order.
pub fn moments(args: &TimeArgs) -> Box<dyn Iterator<Item = Moment>> {
    let &TimeArgs { frames, fps, time } = args;
    match frames {
        None => Box::new(std::iter::once(Moment { number: None, time_s: time })),
        Some(FrameRange { start, end }) => Box::new(
            (start..end).map(move |number| Moment { number: Some(number), time_s: f64::from(number) / fps }),
        ),
    }
}

/// `frames/a.png` → `frames/a.0007.png`
fn numbered(path: &Path, number: u32) -> PathBuf {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    path.with_extension(format!("{number:04}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_counted_by_time_and_have_files_of_their_number() {
        let args = |frames| TimeArgs { frames, fps: 25.0, time: 0.4 };
        let frames = args(Some(FrameRange { start: 5, end: 7 }));
        let found: Vec<_> = moments(&frames).collect();
        assert_eq!(found.len() as u64, count(&frames));
        assert_eq!(found[1], Moment { number: Some(6), time_s: 0.24 });
        assert_eq!(found[1].path(Path::new("a/b.c.EXR")), Path::new("a/b.c.0006.EXR"));
        let alone: Vec<_> = moments(&args(None)).collect();
        assert_eq!(alone, [Moment { number: None, time_s: 0.4 }]);
        assert_eq!(alone[0].path(Path::new("b.exr")), Path::new("b.exr"));
        // Nothing is laid out for frames before they are reached.
        let endless = args(Some(FrameRange { start: 0, end: u32::MAX }));
        assert_eq!(moments(&endless).nth(2).unwrap().number, Some(2));
    }
}
