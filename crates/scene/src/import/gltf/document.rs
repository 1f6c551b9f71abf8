//! From bytes to a document whose indices all point somewhere.

use std::path::Path;

use ::gltf::json::mesh::Semantic;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Root, Value, deserialize};
use ::gltf::{Document, Glb};

use super::super::source::Resource;
use super::super::warnings::Warnings;
use crate::SceneError;

/// Extensions that this importer honours.
const SUPPORTED: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_texture_transform",
];

/// What to do about an extension that a file cannot do without.
fn advice(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export the file again without mesh compression"
        }
        "KHR_mesh_quantization" => "export the file again without quantization, with float vertex attributes",
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "export the file again with PNG or JPEG textures"
        }
        "EXT_mesh_gpu_instancing" => "export the file again with one node per instance",
        "KHR_materials_pbrSpecularGlossiness" => "export the file again with metallic-roughness materials",
        _ => "export the file again without this extension",
    }
}

/// Parses `.gltf` or `.glb` bytes; returns the document and the GLB's binary chunk.
pub(super) fn parse(
    path: &Path,
    mut bytes: Vec<u8>,
    warnings: &mut Warnings,
) -> Result<(Document, Option<Vec<u8>>), SceneError> {
    let invalid = |place: &str, problem: String| SceneError::Invalid {
        path: path.to_owned(),
        place: place.to_owned(),
        problem,
    };
    let mut blob = None;
    if bytes.starts_with(b"glTF") {
        check_glb_header(path, &bytes)?;
        let glb = Glb::from_slice(&bytes).map_err(|e| invalid("GLB container", e.to_string()))?;
        blob = glb.bin.map(std::borrow::Cow::into_owned);
        bytes = glb.json.into_owned();
    }
    let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut root: Root = deserialize::from_slice(json).map_err(|error| {
        // A file of another version or with exotic extensions need not have the shape of glTF 2.0: say that first.
        let refused = deserialize::from_slice::<Value>(json).ok().and_then(|value| {
            let text = |value: &Value| value.as_str().map(str::to_owned);
            let version = value.pointer("/asset/version").and_then(text);
            let required = value.get("extensionsRequired").and_then(Value::as_array).map(Vec::as_slice);
            let required: Vec<String> = required.unwrap_or_default().iter().filter_map(text).collect();
            version.and_then(|v| check_version(path, &v).err()).or(check_required(path, &required).err())
        });
        refused.unwrap_or_else(|| invalid("JSON", error.to_string()))
    })?;

    check_version(path, &root.asset.version)?;
    if let Some(minimum) = root.asset.min_version.as_deref().filter(|version| *version != "2.0") {
        return Err(unsupported_version(path, minimum));
    }
    check_required(path, &root.extensions_required)?;
    for extension in &root.extensions_used {
        if !SUPPORTED.contains(&extension.as_str()) {
            warnings.add(format!("the extension {extension} is not supported and was ignored"));
        }
    }
    // Checked above; the crate's own list lacks some extensions that it parses.
    root.extensions_required.clear();
    // The crate's validation looks this one accessor up without asking whether it exists.
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if positions.is_some_and(|index| index.value() >= root.accessors.len()) {
                let place = format!("meshes[{m}].primitives[{p}].attributes.POSITION");
                return Err(invalid(&place, "there is no accessor of this index".to_owned()));
            }
        }
    }
    let document = Document::from_json(root).map_err(|error| match error {
        ::gltf::Error::Validation(errors) => match errors.first() {
            Some((place, problem)) => invalid(place.as_str(), problem.to_string()),
            None => invalid("JSON", "validation failed".to_owned()),
        },
        other => invalid("JSON", other.to_string()),
    })?;
    Ok((document, blob))
}

/// The crate subtracts the header's size from the length that the header states, whatever that is.
fn check_glb_header(path: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    let invalid = |problem: String| SceneError::Invalid {
        path: path.to_owned(),
        place: "GLB header".to_owned(),
        problem,
    };
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(invalid("the file ends within the header's 12 bytes".to_owned()));
    };
    check_version(path, &version.to_string())?;
    if (length as usize) < 12 || length as usize > bytes.len() {
        return Err(invalid(format!("it states {length} bytes; the file has {}", bytes.len())));
    }
    Ok(())
}

/// Every 2.x file may be read as 2.0 unless it states a minimum.
fn check_version(path: &Path, version: &str) -> Result<(), SceneError> {
    if version.split('.').next() == Some("2") { Ok(()) } else { Err(unsupported_version(path, version)) }
}

fn unsupported_version(path: &Path, version: &str) -> SceneError {
    SceneError::Unsupported {
        path: path.to_owned(),
        feature: format!("glTF version `{version}`"),
        advice: "export the file again as glTF 2.0".to_owned(),
    }
}

fn check_required(path: &Path, required: &[String]) -> Result<(), SceneError> {
    match required.iter().find(|extension| !SUPPORTED.contains(&extension.as_str())) {
        None => Ok(()),
        Some(extension) => Err(SceneError::Unsupported {
            path: path.to_owned(),
            feature: format!("the extension {extension}, which the file requires,"),
            advice: advice(extension).to_owned(),
        }),
    }
}

/// The content of every buffer, each at least as long as the document states.
pub(super) fn buffers(
    path: &Path,
    document: &Document,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<Vec<u8>>, SceneError> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let place = format!("buffers[{}]", buffer.index());
        let invalid =
            |problem: String| SceneError::Invalid { path: path.to_owned(), place: place.clone(), problem };
        let bytes = match buffer.source() {
            ::gltf::buffer::Source::Uri(uri) => Resource::resolve(path, uri, &place)?.into_bytes()?,
            ::gltf::buffer::Source::Bin => {
                let blob = blob.take().filter(|_| buffer.index() == 0);
                blob.ok_or_else(|| invalid("it has no URI, and the file no binary chunk for it".to_owned()))?
            }
        };
        if bytes.len() < buffer.length() {
            return Err(invalid(format!("it states {} bytes but has {}", buffer.length(), bytes.len())));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}
