//! Typed arrays out of buffers, checked.
//!
//! `gltf::accessor::Iter` multiplies and adds what the file says without checking and asserts on the rest, so that
//! every accessor passes [`Accessors::check`] first.

use std::cell::Cell;

use ::gltf::Accessor;
use ::gltf::accessor::{DataType, Dimensions, Item, Iter};
use ::gltf::buffer::View;

use super::super::MAX_VERTICES;
use super::File;
use crate::SceneError;

/// Most elements read in all: accessors are read once for each primitive that uses them, and a small file can name a
/// big one often.
const MAX_ELEMENTS: usize = 1 << 31;

/// Reads accessors within a budget for the whole file.
pub(super) struct Accessors<'a> {
    file: File<'a>,
    buffers: &'a [Vec<u8>],
    elements_left: Cell<usize>,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(file: File<'a>, buffers: &'a [Vec<u8>]) -> Self {
        Self { file, buffers, elements_left: Cell::new(MAX_ELEMENTS) }
    }

    /// Vectors of N floats; bytes and shorts are read as normalised numbers. `allowed` are the component types that
    /// the specification permits there.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &Accessor<'a>,
        allowed: &[DataType],
        place: &str,
    ) -> Result<Vec<[f32; N]>, SceneError>
    where
        [f32; N]: Item,
        [u8; N]: Item,
        [u16; N]: Item,
    {
        let dimensions = [Dimensions::Scalar, Dimensions::Vec2, Dimensions::Vec3, Dimensions::Vec4][N - 1];
        self.check(accessor, dimensions, allowed, place)?;
        let vectors: Vec<[f32; N]> = match accessor.data_type() {
            DataType::F32 => self.read::<[f32; N]>(accessor, place)?.collect(),
            DataType::U8 => {
                self.read::<[u8; N]>(accessor, place)?.map(|v| v.map(|x| f32::from(x) / 255.0)).collect()
            }
            DataType::U16 => {
                self.read::<[u16; N]>(accessor, place)?.map(|v| v.map(|x| f32::from(x) / 65_535.0)).collect()
            }
            other => return Err(self.file.invalid(place, format!("{other:?} is not permitted here"))),
        };
        if let Some(element) = vectors.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
            return Err(self.file.invalid(place, format!("element {element} is not finite")));
        }
        Ok(vectors)
    }

    /// Vertex indices.
    pub(super) fn indices(&self, accessor: &Accessor<'a>, place: &str) -> Result<Vec<u32>, SceneError> {
        let allowed = [DataType::U8, DataType::U16, DataType::U32];
        self.check(accessor, Dimensions::Scalar, &allowed, place)?;
        Ok(match accessor.data_type() {
            DataType::U8 => self.read::<u8>(accessor, place)?.map(u32::from).collect(),
            DataType::U16 => self.read::<u16>(accessor, place)?.map(u32::from).collect(),
            _ => self.read::<u32>(accessor, place)?.collect(),
        })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, view: &View<'a>) -> Result<&'a [u8], SceneError> {
        slice(view, self.buffers).ok_or_else(|| {
            let problem = format!("it reaches past the end of buffers[{}]", view.buffer().index());
            self.file.invalid(format!("bufferViews[{}]", view.index()), problem)
        })
    }

    fn read<T: Item>(&self, accessor: &Accessor<'a>, place: &str) -> Result<Iter<'a, T>, SceneError> {
        let buffers = self.buffers;
        Iter::new(accessor.clone(), |buffer| buffers.get(buffer.index()).map(Vec::as_slice))
            .ok_or_else(|| self.file.invalid(place, "the accessor has no data"))
    }

    /// Everything that [`Iter`] takes for granted.
    fn check(
        &self,
        accessor: &Accessor<'a>,
        dimensions: Dimensions,
        allowed: &[DataType],
        place: &str,
    ) -> Result<(), SceneError> {
        let invalid = |problem: String| {
            self.file.invalid(format!("accessors[{}], used as {place}", accessor.index()), problem)
        };
        if accessor.dimensions() != dimensions {
            let (is, should) = (accessor.dimensions(), dimensions);
            return Err(invalid(format!("its type is {is:?}; it must be {should:?}")));
        }
        if !allowed.contains(&accessor.data_type()) {
            let (is, should) = (accessor.data_type(), allowed);
            return Err(invalid(format!("its component type is {is:?}; permitted here are {should:?}")));
        }
        let count = accessor.count();
        if count == 0 {
            return Err(invalid("it has no elements".to_owned()));
        }
        let left = self.elements_left.get().checked_sub(count);
        self.elements_left.set(left.ok_or_else(|| {
            invalid(format!(
                "with its {count} elements the file's primitives read more than {MAX_ELEMENTS} in all"
            ))
        })?);
        if let Some(view) = accessor.view() {
            self.check_range(&view, accessor.offset(), count, accessor.size()).map_err(invalid)?;
        } else if count > MAX_VERTICES {
            return Err(invalid(format!("it asks for {count} elements without data")));
        }
        let Some(sparse) = accessor.sparse() else { return Ok(()) };
        if sparse.count() == 0 || sparse.count() > count {
            return Err(invalid(format!("sparse.count must be 1 to {count}, not {}", sparse.count())));
        }
        let (indices, values) = (sparse.indices(), sparse.values());
        self.check_range(&indices.view(), indices.offset(), sparse.count(), indices.index_type().size())
            .and_then(|()| self.check_range(&values.view(), values.offset(), sparse.count(), accessor.size()))
            .map_err(|problem| invalid(format!("sparse: {problem}")))
    }

    /// Whether `count` elements of `size` bytes from `offset` on lie within `view`; the error says why not.
    fn check_range(&self, view: &View<'a>, offset: usize, count: usize, size: usize) -> Result<(), String> {
        let bytes = self.view(view).map_err(|e| e.to_string())?;
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!("its elements of {size} bytes overlap at a stride of {stride}"));
        }
        // `count` is at least 1 here.
        let end = stride.checked_mul(count - 1).and_then(|n| n.checked_add(offset)?.checked_add(size));
        if end.is_none_or(|end| end > bytes.len()) {
            return Err(format!(
                "{count} elements of {size} bytes from byte {offset} on do not fit into the {} bytes of \
                 bufferViews[{}]",
                bytes.len(),
                view.index()
            ));
        }
        Ok(())
    }
}

/// The bytes of `view`, if they are all there.
pub(super) fn slice<'a>(view: &View<'_>, buffers: &'a [Vec<u8>]) -> Option<&'a [u8]> {
    let end = view.offset().checked_add(view.length())?;
    buffers.get(view.buffer().index())?.get(view.offset()..end)
}
