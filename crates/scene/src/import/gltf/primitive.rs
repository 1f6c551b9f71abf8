//! Meshes: whatever a primitive is drawn as becomes a triangle list with the streams its material needs.

use ::gltf::Semantic;
use ::gltf::accessor::Dimensions;
use ::gltf::mesh::Mode;
use glam::{Vec2, Vec3, Vec4};

use super::super::limits::{Budget, MAX_COORDINATE};
use super::super::warnings::Warnings;
use super::accessor::{Accessors, Format};
use super::file::File;
use super::material::Materials;
use crate::{Mesh, Primitive, SceneError, mesh};

/// Converts meshes within a budget for the whole file.
pub(super) struct Meshes<'r, 'a> {
    pub(super) file: File<'a>,
    pub(super) accessors: Accessors<'a>,
    pub(super) materials: &'r mut Materials<'a>,
    pub(super) budget: Budget,
}

impl<'a> Meshes<'_, 'a> {
    /// Converts a mesh; primitives without triangles are left out.
    pub(super) fn convert(
        &mut self,
        source: &::gltf::Mesh<'a>,
        warnings: &mut Warnings,
    ) -> Result<Mesh, SceneError> {
        let mut mesh = Mesh { name: source.name().unwrap_or_default().to_owned(), ..Mesh::default() };
        for primitive in source.primitives() {
            let place = format!("meshes[{}].primitives[{}]", source.index(), primitive.index());
            mesh.primitives.extend(self.primitive(&primitive, &place, warnings)?);
        }
        let place = format!("meshes[{}]", source.index());
        self.align_targets(&mut mesh, &place, warnings)?;
        let weights = source.weights().unwrap_or_default();
        mesh.morph_weights =
            morph_weights(self.file, weights, mesh.morph_targets(), &format!("{place}.weights"), warnings)?;
        Ok(mesh)
    }

    fn primitive(
        &mut self,
        source: &::gltf::Primitive<'a>,
        place: &str,
        warnings: &mut Warnings,
    ) -> Result<Option<Primitive>, SceneError> {
        if matches!(source.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            warnings.add(format!("{place} was left out: points and lines are not drawn"));
            return Ok(None);
        }
        let positions = self.positions(source, place)?;
        let indices = self.triangles(source, positions.len(), place, warnings)?;
        if indices.is_empty() {
            warnings.add(format!("{place} was left out: it has no triangle"));
            return Ok(None);
        }
        let material = self.materials.id(&source.material(), warnings)?;
        let count = positions.len();
        let mut primitive = Primitive { positions, indices, material, ..Primitive::default() };
        let quantized = self.quantized();
        let directions = if quantized { Format::SIGNED } else { Format::FLOAT };
        primitive.normals = self.stream(source, &Semantic::Normals, directions, count, place)?;
        primitive.normals.iter_mut().for_each(|n: &mut Vec3| *n = n.clamp(-Vec3::ONE, Vec3::ONE));
        let coordinates = if quantized { Format::QUANTIZED } else { Format::UNSIGNED };
        for (uvs, set) in primitive.uvs.iter_mut().zip(self.materials.uv_sets(material)) {
            *uvs = self.stream(source, &Semantic::TexCoords(set), coordinates, count, place)?;
        }
        primitive.colors = self.colors(source, count, place)?;
        // Tangents are of use only beside the normals that they were made for.
        if !primitive.normals.is_empty() && self.materials.get(material).normal_texture.is_some() {
            primitive.tangents = self.stream(source, &Semantic::Tangents, directions, count, place)?;
        }
        self.joints(source, &mut primitive, place, warnings)?;
        self.morph_targets(source, &mut primitive, place)?;
        mesh::drop_unused_vertices(&mut primitive);
        self.budget
            .spend_primitive(primitive.positions.len(), primitive.indices.len())
            .map_err(|problem| self.file.invalid(place, problem))?;
        self.complete(&mut primitive, place, warnings);
        Ok(Some(primitive))
    }

    /// Fills in what the file leaves out and the renderer needs.
    fn complete(&self, primitive: &mut Primitive, place: &str, warnings: &mut Warnings) {
        let material = self.materials.get(primitive.material);
        if primitive.normals.is_empty() {
            mesh::flat(primitive);
        } else if mesh::repair(primitive) > 0 {
            warnings.add(format!("{place}: normals without a direction were replaced by the triangles'"));
        }
        for texture in material.texture_refs() {
            let uvs = &mut primitive.uvs[texture.uv_set];
            if uvs.is_empty() {
                uvs.resize(primitive.positions.len(), Vec2::ZERO);
                let set = self.materials.uv_sets(primitive.material)[texture.uv_set];
                warnings.add(format!(
                    "{place} has no TEXCOORD_{set}, which its material uses; zeros were filled in"
                ));
            }
        }
        match &material.normal_texture {
            Some(texture) if primitive.tangents.is_empty() => mesh::generate_tangents(primitive, texture),
            _ => mesh::repair_tangents(primitive),
        }
    }

    /// Whether vertices may be integers (KHR_mesh_quantization).
    pub(super) fn quantized(&self) -> bool {
        self.file.uses("KHR_mesh_quantization")
    }

    fn positions(&self, source: &::gltf::Primitive<'a>, place: &str) -> Result<Vec<Vec3>, SceneError> {
        let place = format!("{place}.attributes.POSITION");
        let Some(accessor) = source.get(&Semantic::Positions) else {
            return Err(self.file.invalid(place, "it is missing"));
        };
        let format = if self.quantized() { Format::QUANTIZED } else { Format::FLOAT };
        let positions = self.accessors.vectors::<3>(&accessor, format, &place)?;
        if let Some(element) = positions.iter().position(|p| p.iter().any(|x| x.abs() > MAX_COORDINATE)) {
            let problem = format!("element {element} is farther than {MAX_COORDINATE:e} m from the origin");
            return Err(self.file.invalid(place, problem));
        }
        Ok(positions.into_iter().map(Vec3::from).collect())
    }

    /// An optional attribute, empty where the file has none.
    pub(super) fn stream<T: From<[f32; N]>, const N: usize>(
        &self,
        source: &::gltf::Primitive<'a>,
        semantic: &Semantic,
        format: Format,
        count: usize,
        place: &str,
    ) -> Result<Vec<T>, SceneError> {
        let Some(accessor) = source.get(semantic) else { return Ok(Vec::new()) };
        let place = format!("{place}.attributes.{}", semantic.to_string());
        self.same_count(&accessor, count, &place)?;
        let values = self.accessors.vectors::<N>(&accessor, format, &place)?;
        Ok(values.into_iter().map(T::from).collect())
    }

    /// Refuses a stream that is not as long as the positions.
    pub(super) fn same_count(
        &self,
        accessor: &::gltf::Accessor<'a>,
        count: usize,
        place: &str,
    ) -> Result<(), SceneError> {
        if accessor.count() == count {
            return Ok(());
        }
        Err(self.file.invalid(place, format!("it has {} elements; POSITION has {count}", accessor.count())))
    }

    fn colors(
        &self,
        source: &::gltf::Primitive<'a>,
        count: usize,
        place: &str,
    ) -> Result<Vec<Vec4>, SceneError> {
        let semantic = Semantic::Colors(0);
        let is_rgb = source.get(&semantic).is_some_and(|accessor| accessor.dimensions() == Dimensions::Vec3);
        let colors: Vec<Vec4> = if is_rgb {
            let rgb: Vec<Vec3> = self.stream(source, &semantic, Format::UNSIGNED, count, place)?;
            rgb.into_iter().map(|rgb| rgb.extend(1.0)).collect()
        } else {
            self.stream(source, &semantic, Format::UNSIGNED, count, place)?
        };
        Ok(colors.into_iter().map(|c| c.clamp(Vec4::ZERO, Vec4::ONE)).collect())
    }

    /// Indices of a triangle list, all below `count`.
    fn triangles(
        &self,
        source: &::gltf::Primitive<'a>,
        count: usize,
        place: &str,
        warnings: &mut Warnings,
    ) -> Result<Vec<u32>, SceneError> {
        let place = format!("{place}.indices");
        let order = match source.indices() {
            Some(accessor) => self.accessors.indices(&accessor, &place)?,
            None => (0..count as u32).collect(),
        };
        if let Some((at, index)) = order.iter().enumerate().find(|(_, index)| **index as usize >= count) {
            let problem = format!("element {at} is {index}, but there are {count} vertices");
            return Err(self.file.invalid(place, problem));
        }
        Ok(match source.mode() {
            // Every other triangle of a strip is turned so that all face the same way.
            Mode::TriangleStrip => {
                let turned = |(i, t): (usize, &[u32])| {
                    if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] }
                };
                order.windows(3).enumerate().flat_map(turned).collect()
            }
            Mode::TriangleFan => {
                let rim = order.get(1..).unwrap_or_default();
                rim.windows(2).flat_map(|edge| [edge[0], edge[1], order[0]]).collect()
            }
            _ => {
                if order.len() % 3 != 0 {
                    warnings.add(format!("{place}: the last {} made no triangle", order.len() % 3));
                }
                let whole = order.len() - order.len() % 3;
                let mut order = order;
                order.truncate(whole);
                order
            }
        })
    }
}

/// Weights of `targets` morph targets: those that the file leaves out are 0.
pub(super) fn morph_weights(
    file: File<'_>,
    weights: &[f32],
    targets: usize,
    place: &str,
    warnings: &mut Warnings,
) -> Result<Vec<f32>, SceneError> {
    if !weights.iter().all(|weight| weight.abs() <= MAX_COORDINATE) {
        return Err(file.invalid(place, format!("a weight exceeds {MAX_COORDINATE:e}")));
    }
    if !weights.is_empty() && weights.len() != targets {
        warnings.add(format!("{place} has {} weights for {targets} morph targets", weights.len()));
    }
    let mut weights = weights.to_vec();
    weights.resize(targets, 0.0);
    Ok(weights)
}
