//! What can go wrong with an image.

use std::path::PathBuf;

/// Why an image could not be read, written or compared. Each message says what, where and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The operating system refused to give the file.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file that was asked for.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The operating system refused to take the file.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file that was to be written.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file's content is damaged, or of a kind that chiaro does not read.
    #[error("{}: {problem}; {advice}", path.display())]
    Invalid {
        /// The image file.
        path: PathBuf,
        /// What is wrong in it.
        problem: String,
        /// A way on.
        advice: String,
    },
    /// The pixels cannot be stored as asked.
    #[error("cannot write {}: {problem}; {advice}", path.display())]
    Unstorable {
        /// The file that was to be written.
        path: PathBuf,
        /// What does not fit, with its pixel and value.
        problem: String,
        /// A way on.
        advice: String,
    },
    /// A buffer does not hold the pixels that its width and height promise.
    #[error(
        "{what} has {found} values where {width}×{height} needs {expected}; pass one row after the other, tightly packed"
    )]
    BufferLength {
        /// What the buffer was to become.
        what: &'static str,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Values needed.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// Two images that have to match pixel by pixel do not.
    #[error(
        "sizes differ: {what} is {}×{} and the reference (B) is {}×{}; render both at the same size",
        size.0, size.1, reference.0, reference.1
    )]
    SizesDiffer {
        /// The image that does not fit: `A`, `the mask`, `minus-a`…
        what: &'static str,
        /// Its width and height in pixels.
        size: (u32, u32),
        /// The reference's width and height in pixels.
        reference: (u32, u32),
    },
    /// Two images that have to match pixel by pixel are of different places.
    #[error(
        "places differ: {what} begins at pixel ({}, {}) and the reference (B) at ({}, {}); write both with the same \
         display window",
        origin[0], origin[1], reference[0], reference[1]
    )]
    OriginsDiffer {
        /// The image that does not fit: `A`, `the mask`, `minus-a`…
        what: &'static str,
        /// Where it begins: [`Image::origin`](crate::Image::origin).
        origin: [i32; 2],
        /// Where the reference does.
        reference: [i32; 2],
    },
    /// An image that the measurement relies on holds NaN or infinity.
    #[error(
        "{what} has {count} value(s) that are not finite, the first at pixel ({}, {}); \
         the measurement would mean nothing: repair the image or mask those pixels",
        first.0, first.1
    )]
    NotFinite {
        /// Which image.
        what: &'static str,
        /// How many channel values.
        count: usize,
        /// Column and row of the first.
        first: (u32, u32),
    },
    /// Errors are relative to the reference, and there is nothing to relate them to.
    #[error("nothing to compare with: {problem}; {advice}")]
    NoReference {
        /// Why.
        problem: String,
        /// A way on.
        advice: String,
    },
}
