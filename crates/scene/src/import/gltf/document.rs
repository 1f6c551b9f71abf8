//! From bytes to a document whose indices all point somewhere.

use std::path::Path;

use ::gltf::json::mesh::Semantic;
use ::gltf::json::validation::{Checked, Error, Validate};
use ::gltf::json::{Root, Value, deserialize};
use ::gltf::{Document, Glb};
use glam::DVec3;

use super::super::warnings::Warnings;
use super::far;
use crate::SceneError;

/// Extensions that this importer honours.
const SUPPORTED: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_lights_punctual",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];

/// What to do about an extension that a file cannot do without.
fn advice(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "export the file again with meshopt or without mesh compression",
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "export the file again with PNG or JPEG textures"
        }
        "KHR_materials_pbrSpecularGlossiness" => "export the file again with metallic-roughness materials",
        _ => "export the file again without this extension",
    }
}

/// What is in a file.
pub(super) struct Parsed {
    pub(super) document: Document,
    /// The GLB's binary chunk.
    pub(super) blob: Option<Vec<u8>>,
    /// See [`far::remainders`].
    pub(super) remainders: Vec<DVec3>,
}

/// Parses `.gltf` or `.glb` bytes.
pub(super) fn parse(path: &Path, mut bytes: Vec<u8>, warnings: &mut Warnings) -> Result<Parsed, SceneError> {
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
    let mut root = match deserialize::from_slice::<Root>(json) {
        Ok(root) => root,
        // What the file is about need not have the shape of glTF 2.0.
        Err(error) => deserialize::from_slice::<Value>(json)
            .ok()
            .map(|value| repaired(path, value, warnings))
            .transpose()?
            .flatten()
            .ok_or_else(|| invalid("JSON", error.to_string()))?,
    };

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
    // Checked above; the crate's own list lacks some extensions that are read here.
    root.extensions_used.append(&mut root.extensions_required);
    // The crate asserts on these two and on the targets' nodes.
    for (a, animation) in root.animations.iter_mut().enumerate() {
        let nodes = root.nodes.len();
        if let Some(channel) = animation.channels.iter().position(|c| c.target.node.value() >= nodes) {
            let place = format!("animations[{a}].channels[{channel}].target.node");
            return Err(invalid(&place, "there is no node of this index".to_owned()));
        }
        let count = animation.channels.len();
        animation.channels.retain(|channel| matches!(channel.target.path, Checked::Valid(_)));
        if animation.channels.len() < count {
            warnings.add(format!("animations[{a}] moves something else than nodes, which was left out"));
        }
    }
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
    let mut problem = None;
    root.validate(&root, ::gltf::json::Path::new, &mut |place, error| {
        let place = place();
        // An accessor without data is full of zeros, whatever the crate thinks.
        let is_empty = error == Error::Missing && place.as_str().ends_with("].bufferView");
        if problem.is_none() && !is_empty {
            problem = Some(invalid(place.as_str(), error.to_string()));
        }
    });
    if let Some(problem) = problem {
        return Err(problem);
    }
    let remainders = far::remainders(&root, json);
    Ok(Parsed { document: Document::from_json_without_validation(root), blob, remainders })
}

/// A document that the crate does not parse: of another version, with exotic extensions, which are refused by name, with
/// scenes without nodes, or with channels that move something else than nodes (KHR_animation_pointer), which are left
/// out.
fn repaired(path: &Path, mut value: Value, warnings: &mut Warnings) -> Result<Option<Root>, SceneError> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    if let Some(version) = value.pointer("/asset/version").and_then(text) {
        check_version(path, &version)?;
    }
    let required = value.get("extensionsRequired").and_then(Value::as_array).map(Vec::as_slice);
    let required: Vec<String> = required.unwrap_or_default().iter().filter_map(text).collect();
    check_required(path, &required)?;
    let scenes = value.get_mut("scenes").and_then(Value::as_array_mut);
    for scene in scenes.into_iter().flatten().filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    let animations = value.get_mut("animations").and_then(Value::as_array_mut);
    for (a, animation) in animations.into_iter().flatten().enumerate() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let count = channels.len();
        channels.retain(|channel| channel.pointer("/target/node").is_some());
        if channels.len() < count {
            warnings.add(format!("animations[{a}] moves something else than nodes, which was left out"));
        }
    }
    Ok(deserialize::from_value(value).ok())
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
