//! Small glTF documents, put together for a test.

use std::path::Path;

use super::gltf::glb;
use super::gltf_bytes;
use crate::invariants::assert_sound;
use crate::{Scene, SceneError};

pub(super) const I8: u32 = 5120;
pub(super) const U8: u32 = 5121;
pub(super) const I16: u32 = 5122;
pub(super) const U16: u32 = 5123;
pub(super) const F32: u32 = 5126;

/// A GLB in the making: each stream becomes a buffer view and an accessor of the same index.
#[derive(Clone, Default)]
pub(super) struct Document {
    /// More buffers, with a comma before each.
    pub(super) fallback: String,
    binary: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

/// The bytes of numbers.
pub(super) fn bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

impl Document {
    /// Three positions of a triangle in the plane z = 0: accessor 0 of most documents.
    pub(super) fn triangle() -> Self {
        let mut document = Self::default();
        document.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        document
    }

    /// A buffer view with these members beside its place; returns its index.
    pub(super) fn view(&mut self, content: &[u8], members: &str) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let (offset, length) = (self.binary.len(), content.len());
        self.binary.extend(content);
        self.views
            .push(format!(r#"{{"buffer": 0, "byteOffset": {offset}, "byteLength": {length}{members}}}"#));
        self.views.len() - 1
    }

    /// A buffer view of this JSON; returns its index.
    pub(super) fn raw_view(&mut self, json: &str) -> usize {
        self.views.push(json.to_owned());
        self.views.len() - 1
    }

    /// The members that say where a view lies.
    pub(super) fn place(&self, view: usize) -> String {
        self.views[view].trim_matches(['{', '}']).to_owned()
    }

    /// An accessor of these members; returns its index.
    pub(super) fn accessor(&mut self, members: &str) -> usize {
        self.accessors.push(format!(r#"{{{members}, "min": [-9, -9, -9], "max": [9, 9, 9]}}"#));
        self.accessors.len() - 1
    }

    /// A stream of `count` elements; `members` may say more about the accessor, such as `, "normalized": true`.
    pub(super) fn stream(
        &mut self,
        component: u32,
        kind: &str,
        count: usize,
        content: &[u8],
        members: &str,
    ) -> usize {
        // Vertex attributes begin at multiples of four.
        let stride = content.len() / count;
        let stride = if stride >= 4 && stride.is_multiple_of(4) && stride < 64 {
            format!(r#", "byteStride": {stride}"#)
        } else {
            String::new()
        };
        let view = self.view(content, &stride);
        self.accessor(&format!(
            r#""bufferView": {view}, "componentType": {component}, "count": {count}, "type": "{kind}"{members}"#
        ))
    }

    pub(super) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let each = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.stream(F32, kind, values.len() / each, &bytes(values), "")
    }

    /// The GLB with these members beside the streams.
    pub(super) fn glb(&self, members: &str) -> Vec<u8> {
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": {}}}{}], "bufferViews": [{}],
            "accessors": [{}], {members}}}"#,
            self.binary.len(),
            self.fallback,
            self.views.join(", "),
            self.accessors.join(", ")
        );
        glb(&json, &self.binary)
    }

    pub(super) fn parse(&self, members: &str) -> Result<Scene, SceneError> {
        gltf_bytes(Path::new("test.glb"), self.glb(members))
    }

    /// The scene, which must be sound.
    pub(super) fn load(&self, members: &str) -> Scene {
        let scene = self.parse(members).unwrap();
        assert_sound(&scene);
        scene
    }

    /// The error's text.
    pub(super) fn refused(&self, members: &str) -> String {
        self.parse(members).unwrap_err().to_string()
    }
}

/// Members of a document whose only mesh has one primitive of these attributes and members, drawn at one node.
pub(super) fn one_mesh(attributes: &str, primitive: &str, members: &str) -> String {
    format!(
        r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes":
        {{"POSITION": 0{attributes}}}{primitive}}}]}}]{members}"#
    )
}
