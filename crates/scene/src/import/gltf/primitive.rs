//! Meshes: whatever a primitive is drawn as becomes a triangle list with the streams its material needs.

use ::gltf::Semantic;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::Mode;
use glam::{Vec2, Vec3, Vec4};

use super::super::warnings::Warnings;
use super::super::{Budget, MAX_COORDINATE};
use super::File;
use super::accessor::Accessors;
use super::material::Materials;
use crate::{Mesh, Primitive, SceneError, mesh};

const FLOAT: &[DataType] = &[DataType::F32];
const FLOAT_OR_NORMALIZED: &[DataType] = &[DataType::F32, DataType::U8, DataType::U16];

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
        primitive.normals = self.stream(source, &Semantic::Normals, FLOAT, count, place)?;
        primitive.normals.iter_mut().for_each(|n: &mut Vec3| *n = n.clamp(-Vec3::ONE, Vec3::ONE));
        for set in 0..2 {
            let semantic = Semantic::TexCoords(set);
            primitive.uvs[set as usize] =
                self.stream(source, &semantic, FLOAT_OR_NORMALIZED, count, place)?;
        }
        primitive.colors = self.colors(source, count, place)?;
        // Tangents are of use only beside the normals that they were made for.
        if !primitive.normals.is_empty() && self.materials.get(material).normal_texture.is_some() {
            primitive.tangents = self.stream(source, &Semantic::Tangents, FLOAT, count, place)?;
        }
        mesh::drop_unused_vertices(&mut primitive);
        self.budget
            .spend(primitive.positions.len(), primitive.indices.len())
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
                let set = texture.uv_set;
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

    fn positions(&self, source: &::gltf::Primitive<'a>, place: &str) -> Result<Vec<Vec3>, SceneError> {
        let place = format!("{place}.attributes.POSITION");
        let Some(accessor) = source.get(&Semantic::Positions) else {
            return Err(self.file.invalid(place, "it is missing"));
        };
        let positions = self.accessors.vectors::<3>(&accessor, FLOAT, &place)?;
        if let Some(element) = positions.iter().position(|p| p.iter().any(|x| x.abs() > MAX_COORDINATE)) {
            let problem = format!("element {element} is farther than {MAX_COORDINATE:e} m from the origin");
            return Err(self.file.invalid(place, problem));
        }
        Ok(positions.into_iter().map(Vec3::from).collect())
    }

    /// An optional attribute, empty where the file has none.
    fn stream<T: From<[f32; N]>, const N: usize>(
        &self,
        source: &::gltf::Primitive<'a>,
        semantic: &Semantic,
        allowed: &[DataType],
        count: usize,
        place: &str,
    ) -> Result<Vec<T>, SceneError>
    where
        [f32; N]: ::gltf::accessor::Item,
        [u8; N]: ::gltf::accessor::Item,
        [u16; N]: ::gltf::accessor::Item,
    {
        let Some(accessor) = source.get(semantic) else { return Ok(Vec::new()) };
        let place = format!("{place}.attributes.{}", semantic.to_string());
        let values = self.accessors.vectors::<N>(&accessor, allowed, &place)?;
        if values.len() != count {
            let problem = format!("it has {} elements; POSITION has {count}", values.len());
            return Err(self.file.invalid(place, problem));
        }
        Ok(values.into_iter().map(T::from).collect())
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
            let rgb: Vec<Vec3> = self.stream(source, &semantic, FLOAT_OR_NORMALIZED, count, place)?;
            rgb.into_iter().map(|rgb| rgb.extend(1.0)).collect()
        } else {
            self.stream(source, &semantic, FLOAT_OR_NORMALIZED, count, place)?
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
