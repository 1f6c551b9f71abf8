//! Typed arrays out of buffers, checked.
//!
//! `gltf::accessor::Iter` multiplies and adds what the file says without checking and asserts on the rest, so that
//! accessors are read here.

use std::cell::RefCell;

use ::gltf::Accessor;
use ::gltf::accessor::sparse::IndexType;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::View;

use super::super::limits::Budget;
use super::buffers::Buffers;
use super::file::File;
use crate::SceneError;

/// Component types that are permitted somewhere, and how their integers stand for numbers.
#[derive(Clone, Copy)]
pub(super) struct Format {
    types: &'static [DataType],
    /// Normalised only where the accessor says so, else always.
    by_flag: bool,
}

impl Format {
    pub(super) const FLOAT: Self = Self { types: &[DataType::F32], by_flag: false };
    pub(super) const UNSIGNED: Self =
        Self { types: &[DataType::F32, DataType::U8, DataType::U16], by_flag: false };
    pub(super) const SIGNED: Self =
        Self { types: &[DataType::F32, DataType::I8, DataType::I16], by_flag: false };
    pub(super) const NORMALIZED: Self = Self {
        types: &[DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16],
        by_flag: false,
    };
    /// KHR_mesh_quantization's positions and texture coordinates.
    pub(super) const QUANTIZED: Self = Self { by_flag: true, ..Self::NORMALIZED };
}

/// Reads accessors within a budget for the whole file.
pub(super) struct Accessors<'a> {
    file: File<'a>,
    buffers: &'a Buffers,
    budget: RefCell<Budget>,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(file: File<'a>, buffers: &'a Buffers) -> Self {
        Self { file, buffers, budget: RefCell::new(Budget::new(file.limits)) }
    }

    /// Vectors of N finite floats, matrices by columns.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &Accessor<'a>,
        format: Format,
        place: &str,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        self.check(accessor, dimensions(N), format.types, place)?;
        let plain = format.by_flag && !accessor.normalized();
        // Scaled as the specification says (section 3.11): −128 and −127 are both −1.
        let of = |x: f32, largest: f32| if plain { x } else { (x / largest).max(-1.0) };
        let vectors: Vec<[f32; N]> = match accessor.data_type() {
            DataType::I8 => self.read(accessor, |b| of(i8::from_le_bytes(b).into(), 127.0), place)?,
            DataType::U8 => self.read(accessor, |b| of(u8::from_le_bytes(b).into(), 255.0), place)?,
            DataType::I16 => self.read(accessor, |b| of(i16::from_le_bytes(b).into(), 32_767.0), place)?,
            DataType::U16 => self.read(accessor, |b| of(u16::from_le_bytes(b).into(), 65_535.0), place)?,
            DataType::U32 => self.read(accessor, |b| u32::from_le_bytes(b) as f32, place)?,
            DataType::F32 => self.read(accessor, f32::from_le_bytes, place)?,
        };
        if let Some(element) = vectors.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
            return Err(self.file.invalid(place, format!("element {element} is not finite")));
        }
        Ok(vectors)
    }

    /// Vertex indices.
    pub(super) fn indices(&self, accessor: &Accessor<'a>, place: &str) -> Result<Vec<u32>, SceneError> {
        self.check(accessor, Dimensions::Scalar, &[DataType::U8, DataType::U16, DataType::U32], place)?;
        let indices = match accessor.data_type() {
            DataType::U8 => self.read(accessor, |b| u32::from(u8::from_le_bytes(b)), place)?,
            DataType::U16 => self.read(accessor, |b| u32::from(u16::from_le_bytes(b)), place)?,
            _ => self.read(accessor, u32::from_le_bytes, place)?,
        };
        Ok(indices.into_iter().map(|[index]: [u32; 1]| index).collect())
    }

    /// Indices of joints, four per vertex.
    pub(super) fn joints(&self, accessor: &Accessor<'a>, place: &str) -> Result<Vec<[u16; 4]>, SceneError> {
        self.check(accessor, Dimensions::Vec4, &[DataType::U8, DataType::U16], place)?;
        match accessor.data_type() {
            DataType::U8 => self.read(accessor, |b| u16::from(u8::from_le_bytes(b)), place),
            _ => self.read(accessor, u16::from_le_bytes, place),
        }
    }

    /// The bytes of a buffer view.
    fn view(&self, view: &View<'a>) -> Result<&'a [u8], SceneError> {
        self.buffers.view(view).ok_or_else(|| {
            let problem =
                format!("buffers[{}] does not reach that far or has no data", view.buffer().index());
            self.file.invalid(format!("bufferViews[{}]", view.index()), problem)
        })
    }

    /// The elements of an accessor that has passed [`Self::check`], of N components with SIZE bytes each.
    fn read<T: Copy + Default, const N: usize, const SIZE: usize>(
        &self,
        accessor: &Accessor<'a>,
        component: impl Fn([u8; SIZE]) -> T,
        place: &str,
    ) -> Result<Vec<[T; N]>, SceneError> {
        let element = |bytes: &[u8]| {
            let mut element = [T::default(); N];
            for (value, bytes) in element.iter_mut().zip(bytes.as_chunks().0) {
                *value = component(*bytes);
            }
            element
        };
        let mut elements: Vec<[T; N]> = match accessor.view() {
            Some(view) => strided(&view, self.view(&view)?, accessor.offset(), N * SIZE)
                .take(accessor.count())
                .map(element)
                .collect(),
            None => vec![[T::default(); N]; accessor.count()],
        };
        let Some(sparse) = accessor.sparse() else { return Ok(elements) };
        let (indices, values) = (sparse.indices(), sparse.values());
        let size = indices.index_type().size();
        let places = strided(&indices.view(), self.view(&indices.view())?, indices.offset(), size);
        let values = strided(&values.view(), self.view(&values.view())?, values.offset(), N * SIZE);
        for (at, value) in places.zip(values).take(sparse.count()) {
            let at = match (indices.index_type(), at) {
                (IndexType::U16, &[a, b]) => usize::from(u16::from_le_bytes([a, b])),
                (IndexType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as usize,
                (_, at) => at.first().map_or(0, |&byte| usize::from(byte)),
            };
            let count = elements.len();
            let target = elements.get_mut(at).ok_or_else(|| {
                let problem = format!("sparse: element {at} of {count} is to be replaced");
                self.file.invalid(format!("accessors[{}], used as {place}", accessor.index()), problem)
            })?;
            *target = element(value);
        }
        Ok(elements)
    }

    /// Everything that [`Self::read`] takes for granted.
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
        let mut budget = self.budget.borrow_mut();
        budget.spend(|l| &mut l.elements, count, "elements of accessors to read in all").map_err(invalid)?;
        if let Some(view) = accessor.view() {
            self.check_range(&view, accessor.offset(), count, accessor.size()).map_err(invalid)?;
        } else {
            budget
                .spend(|l| &mut l.empty_elements, count, "elements of accessors without data")
                .map_err(invalid)?;
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

/// The elements of `size` bytes from `offset` on, as far as the bytes go.
fn strided<'b>(
    view: &View<'_>,
    bytes: &'b [u8],
    offset: usize,
    size: usize,
) -> impl Iterator<Item = &'b [u8]> + use<'b> {
    let stride = view.stride().unwrap_or(size).max(1);
    let bytes = bytes.get(offset..).unwrap_or_default();
    bytes.chunks(stride).filter_map(move |element| element.get(..size))
}

/// The accessor type of N components.
fn dimensions(components: usize) -> Dimensions {
    match components {
        1 => Dimensions::Scalar,
        2 => Dimensions::Vec2,
        3 => Dimensions::Vec3,
        4 => Dimensions::Vec4,
        _ => Dimensions::Mat4,
    }
}
