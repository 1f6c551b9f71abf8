//! Changes to glTF documents that keep them documents: bytes changed at random rarely get past the JSON parser.

use serde_json::{Map, Number, Value};

/// Members that the importer reads, so that a change can add one.
const MEMBERS: &[&str] = &[
    "EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "JOINTS_0", "JOINTS_1", "KHR_texture_transform", "NORMAL",
    "POSITION", "ROTATION", "SCALE", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "TRANSLATION", "WEIGHTS_0",
    "WEIGHTS_1", "attributes", "bufferView", "byteLength", "byteOffset", "byteStride", "camera", "channels", "children",
    "componentType", "count", "extensions", "extensionsUsed", "extensionsRequired", "indices", "input",
    "interpolation", "inverseBindMatrices", "joints", "material", "matrix", "mesh", "mode", "node", "nodes",
    "normalTexture", "normalized", "output", "path", "rotation", "sampler", "scale", "scene", "skin", "skeleton",
    "sparse", "target", "targets", "texCoord", "translation", "type", "values", "weights",
];

/// Words that the importer knows.
const WORDS: &[&str] = &[
    "SCALAR", "VEC2", "VEC3", "VEC4", "MAT4", "STEP", "LINEAR", "CUBICSPLINE", "translation", "rotation", "scale",
    "weights", "pointer", "ATTRIBUTES", "TRIANGLES", "INDICES", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR",
    "NONE", "OPAQUE", "MASK", "BLEND", "perspective", "orthographic", "KHR_mesh_quantization",
    "KHR_texture_transform", "EXT_mesh_gpu_instancing", "EXT_meshopt_compression",
];

/// Numbers at which something changes.
const NUMBERS: &[f64] = &[
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 16.0, 255.0, 256.0, 5120.0, 5121.0, 5122.0, 5123.0, 5125.0, 5126.0,
    65535.0, 65536.0, 4294967295.0, 1e12, 1e38, 1e-38, 1e300, -1.0, -0.5, 0.5, 1e-7,
];

/// A small generator; libFuzzer gives the seed.
pub struct Random(u64);

impl Random {
    /// Starts from `seed`.
    pub fn new(seed: u32) -> Self {
        Self(u64::from(seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// A number below `end`, which is above 0.
    pub fn below(&mut self, end: usize) -> usize {
        // Xorshift (Marsaglia 2003).
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }

    fn pick<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }
}

/// A GLB or glTF file's JSON and its binary chunk.
pub fn split(data: &[u8]) -> Option<(Value, Vec<u8>)> {
    if !data.starts_with(b"glTF") {
        return Some((serde_json::from_slice(data).ok()?, Vec::new()));
    }
    let word = |at: usize| Some(u32::from_le_bytes(data.get(at..at + 4)?.try_into().ok()?) as usize);
    let json_end = 20usize.checked_add(word(12)?)?;
    let json = serde_json::from_slice(data.get(20..json_end)?).ok()?;
    let binary = word(json_end).and_then(|length| data.get(json_end + 8..json_end + 8 + length));
    Some((json, binary.unwrap_or_default().to_vec()))
}

/// A GLB of JSON and a binary chunk.
pub fn join(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap_or_default();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = Vec::from(*b"glTF\x02\0\0\0\0\0\0\0");
    for (kind, content) in [(b"JSON", &text[..]), (b"BIN\0", binary)] {
        glb.extend((content.len().next_multiple_of(4) as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(content);
        glb.resize(glb.len().next_multiple_of(4), 0);
    }
    let length = glb.len() as u32;
    glb[8..12].copy_from_slice(&length.to_le_bytes());
    glb
}

/// Changes one to four places of a document.
pub fn change(json: &mut Value, random: &mut Random) {
    for _ in 0..=random.below(4) {
        let donor = at(json, random.below(count(json))).cloned().unwrap_or_default();
        let chosen = random.below(count(json));
        if let Some(value) = at_mut(json, &mut { chosen }) {
            change_value(value, donor, random);
        }
    }
}

fn change_value(value: &mut Value, donor: Value, random: &mut Random) {
    match (value, random.below(8)) {
        (value, 0) => *value = donor,
        (Value::Number(number), how) => {
            let old = number.as_f64().unwrap_or(0.0);
            let new = match how {
                1 => old + 1.0,
                2 => old - 1.0,
                3 => old * 2.0,
                4 => -old,
                5 => random.below(12) as f64,
                _ => *random.pick(NUMBERS),
            };
            // As written in files: whole numbers without a point.
            *number = if new.fract() == 0.0 && new.abs() < 1e15 {
                Number::from(new as i64)
            } else {
                Number::from_f64(new).unwrap_or_else(|| Number::from(0))
            };
        }
        (Value::String(text), _) => *text = (*random.pick(WORDS)).to_owned(),
        (Value::Array(items), how) if !items.is_empty() => {
            let (a, b) = (random.below(items.len()), random.below(items.len()));
            match how {
                1 | 2 => drop(items.remove(a)),
                3 => items.swap(a, b),
                4 => items.push(donor),
                _ => items.insert(a, items[b].clone()),
            }
        }
        (Value::Object(members), how) => change_members(members, donor, how, random),
        (Value::Bool(truth), _) => *truth = !*truth,
        (value, _) => *value = donor,
    }
}

fn change_members(members: &mut Map<String, Value>, donor: Value, how: usize, random: &mut Random) {
    let known: Vec<String> = members.keys().cloned().collect();
    if how < 4 && !known.is_empty() {
        let removed = members.remove(random.pick(&known));
        if let (1, Some(removed)) = (how, removed) {
            members.insert((*random.pick(MEMBERS)).to_owned(), removed);
        }
    } else {
        let value = if how < 6 { Value::from(random.below(12)) } else { donor };
        members.insert((*random.pick(MEMBERS)).to_owned(), value);
    }
}

fn children(value: &Value) -> Box<dyn Iterator<Item = &Value> + '_> {
    match value {
        Value::Array(items) => Box::new(items.iter()),
        Value::Object(members) => Box::new(members.values()),
        _ => Box::new(std::iter::empty()),
    }
}

/// How many values a document holds, itself included.
fn count(value: &Value) -> usize {
    1 + children(value).map(count).sum::<usize>()
}

/// The value of this number in the order in which they are written.
fn at(value: &Value, mut index: usize) -> Option<&Value> {
    if index == 0 {
        return Some(value);
    }
    index -= 1;
    for child in children(value) {
        let size = count(child);
        if index < size {
            return at(child, index);
        }
        index -= size;
    }
    None
}

fn at_mut<'a>(value: &'a mut Value, index: &mut usize) -> Option<&'a mut Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    let children: Box<dyn Iterator<Item = &mut Value>> = match value {
        Value::Array(items) => Box::new(items.iter_mut()),
        Value::Object(members) => Box::new(members.values_mut()),
        _ => return None,
    };
    for child in children {
        let size = count(child);
        if *index < size {
            return at_mut(child, index);
        }
        *index -= size;
    }
    None
}
