//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views that are decoded when the file is read.
//!
//! The `meshopt` crate decodes; it takes for granted that counts and strides are those of the extension, which
//! [`Stream::size`] checks.

use ::gltf::json::Value;

/// Names of the extension; the later one adds a second vertex format and the colour filter, which both may use here.
pub(super) const EXTENSIONS: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// No stream is denser: vertex data has at least two bits for each byte column of a block of up to 256 vertices.
const MAX_EXPANSION: usize = 1024;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// A compressed view.
pub(super) struct Stream {
    /// Which buffer, and where in it.
    pub(super) buffer: usize,
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    stride: usize,
    count: usize,
    mode: Mode,
    filter: Filter,
}

impl Stream {
    /// The extension's content; the error says what is wrong with it.
    pub(super) fn from_json(json: &Value) -> Result<Self, String> {
        let number = |name: &str, default: Option<usize>| match json.get(name) {
            None => default.ok_or_else(|| format!("`{name}` is missing")),
            Some(value) => value
                .as_u64()
                .and_then(|n| usize::try_from(n).ok())
                .ok_or_else(|| format!("`{name}` must be a whole number")),
        };
        Ok(Self {
            buffer: number("buffer", None)?,
            byte_offset: number("byteOffset", Some(0))?,
            byte_length: number("byteLength", None)?,
            stride: number("byteStride", None)?,
            count: number("count", None)?,
            mode: match json.get("mode").and_then(Value::as_str) {
                Some("ATTRIBUTES") => Mode::Attributes,
                Some("TRIANGLES") => Mode::Triangles,
                Some("INDICES") => Mode::Indices,
                _ => return Err("`mode` must be ATTRIBUTES, TRIANGLES or INDICES".to_owned()),
            },
            filter: match json.get("filter").map(|filter| filter.as_str()) {
                None | Some(Some("NONE")) => Filter::None,
                Some(Some("OCTAHEDRAL")) => Filter::Octahedral,
                Some(Some("QUATERNION")) => Filter::Quaternion,
                Some(Some("EXPONENTIAL")) => Filter::Exponential,
                Some(Some("COLOR")) => Filter::Color,
                _ => return Err("`filter` is not one of the extension's".to_owned()),
            },
        })
    }

    /// How many bytes it decodes to. The error says what the extension does not permit.
    pub(super) fn size(&self) -> Result<usize, String> {
        let Self { stride, count, .. } = *self;
        let legal = match self.mode {
            Mode::Attributes => stride % 4 == 0 && (4..=256).contains(&stride),
            Mode::Triangles => (stride == 2 || stride == 4) && count.is_multiple_of(3),
            Mode::Indices => stride == 2 || stride == 4,
        };
        if !legal || count == 0 {
            return Err(format!("{count} elements of {stride} bytes are not permitted in its mode"));
        }
        let legal = match self.filter {
            Filter::None => true,
            Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
            Filter::Exponential => stride % 4 == 0,
        };
        if !legal || (self.filter != Filter::None && self.mode != Mode::Attributes) {
            return Err(format!("its filter is not permitted for elements of {stride} bytes in its mode"));
        }
        let size = stride.checked_mul(count);
        size.filter(|size| *size / MAX_EXPANSION <= self.byte_length).ok_or_else(|| {
            format!("{} bytes cannot decode to {count} elements of {stride} bytes", self.byte_length)
        })
    }

    /// The decoded bytes; [`Self::size`] has been asked before.
    pub(super) fn decode(&self, encoded: &[u8]) -> Result<Vec<u8>, String> {
        let decoded = match (self.mode, self.stride) {
            (Mode::Attributes, stride) => attributes(encoded, self.count, stride),
            (Mode::Triangles, 2) => bytes(meshopt::decode_index_buffer::<u16>(encoded, self.count)),
            (Mode::Triangles, _) => bytes(meshopt::decode_index_buffer::<u32>(encoded, self.count)),
            (Mode::Indices, 2) => bytes(meshopt::decode_index_sequence::<u16>(encoded, self.count)),
            (Mode::Indices, _) => bytes(meshopt::decode_index_sequence::<u32>(encoded, self.count)),
        };
        let decoded = decoded.map_err(|error| format!("the compressed data is malformed: {error}"))?;
        Ok(match (self.filter, self.stride) {
            (Filter::None, _) => decoded,
            (Filter::Octahedral, 4) => filtered::<[i8; 4]>(&decoded, meshopt::decode_filter_oct),
            (Filter::Octahedral, _) => filtered::<[i16; 4]>(&decoded, meshopt::decode_filter_oct),
            (Filter::Quaternion, _) => filtered::<[i16; 4]>(&decoded, meshopt::decode_filter_quat),
            (Filter::Exponential, _) => filtered::<[u32; 1]>(&decoded, meshopt::decode_filter_exp),
            (Filter::Color, 4) => filtered::<[u8; 4]>(&decoded, meshopt::decode_filter_color),
            (Filter::Color, _) => filtered::<[u16; 4]>(&decoded, meshopt::decode_filter_color),
        })
    }
}

fn bytes<T: bytemuck::NoUninit>(decoded: meshopt::Result<Vec<T>>) -> meshopt::Result<Vec<u8>> {
    decoded.map(|elements| bytemuck::cast_slice(&elements).to_vec())
}

fn filtered<T: bytemuck::Pod>(decoded: &[u8], filter: fn(&mut [T])) -> Vec<u8> {
    let mut elements: Vec<T> = bytemuck::pod_collect_to_vec(decoded);
    filter(&mut elements);
    bytemuck::cast_slice(&elements).to_vec()
}

/// Elements of any stride: the crate takes it from a type.
fn attributes(encoded: &[u8], count: usize, stride: usize) -> meshopt::Result<Vec<u8>> {
    /// As large as the sum of its parts; arrays have a default up to 32 elements only.
    #[derive(Clone, Copy, Default)]
    #[repr(C)]
    struct Wide<const N: usize>
    where
        [u32; N]: Default,
    {
        first: [u32; 32],
        rest: [u32; N],
    }
    macro_rules! dispatch {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words => bytes(meshopt::decode_vertex_buffer::<[u32; $words]>(encoded, count)),)*
                $(n if n == 32 + $words => meshopt::decode_vertex_buffer::<Wide<$words>>(encoded, count).map(
                    |elements| {
                        let words = elements.iter().flat_map(|e| e.first.iter().chain(&e.rest));
                        words.flat_map(|word| word.to_ne_bytes()).collect()
                    }),)*
                _ => Ok(Vec::new()),
            }
        };
    }
    dispatch!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32)
}
