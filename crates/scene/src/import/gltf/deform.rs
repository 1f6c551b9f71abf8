//! What bends a mesh: joints with weights, and morph targets.

use ::gltf::Semantic;
use glam::{Vec3, Vec4};

use super::super::limits::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::accessor::Format;
use super::primitive::Meshes;
use crate::{Mesh, MorphTarget, Primitive, SceneError};

/// Most joints that bend a vertex.
const JOINTS: usize = 4;

impl<'a> Meshes<'_, 'a> {
    /// JOINTS_n and WEIGHTS_n. Of more than four joints the strongest stay.
    pub(super) fn joints(
        &self,
        source: &::gltf::Primitive<'a>,
        primitive: &mut Primitive,
        place: &str,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let count = primitive.positions.len();
        let mut strongest: Vec<[(u16, f32); JOINTS]> = Vec::new();
        for set in 0.. {
            let Some(accessor) = source.get(&Semantic::Joints(set)) else { break };
            let joints_place = format!("{place}.attributes.JOINTS_{set}");
            if source.get(&Semantic::Weights(set)).is_none() {
                warnings.add(format!("{joints_place} was left out: there is no WEIGHTS_{set}"));
                break;
            }
            self.same_count(&accessor, count, &joints_place)?;
            let joints = self.accessors.joints(&accessor, &joints_place)?;
            let weights: Vec<[f32; JOINTS]> =
                self.stream(source, &Semantic::Weights(set), Format::UNSIGNED, count, place)?;
            let pairs = joints
                .into_iter()
                .zip(weights)
                .map(|(joints, weights)| std::array::from_fn(|k| (joints[k], weights[k].max(0.0))));
            if set == 0 {
                strongest = pairs.collect();
                continue;
            }
            let mut dropped = false;
            for (kept, more) in strongest.iter_mut().zip(pairs) {
                dropped |= keep_strongest(kept, more);
            }
            if dropped {
                warnings.add(format!(
                    "{place}: vertices are bent by more than four joints; the strongest were kept"
                ));
            }
        }
        for influences in strongest {
            let sum: f64 = influences.iter().map(|(_, weight)| f64::from(*weight)).sum();
            // What weighs nothing may name any joint.
            let joint = |(joint, weight): (u16, f32)| if weight > 0.0 { joint } else { 0 };
            if sum > 0.0 {
                primitive.joints.push(influences.map(joint));
                let weights = influences.map(|(_, weight)| (f64::from(weight) / sum) as f32);
                primitive.joint_weights.push(Vec4::from(weights));
            } else {
                primitive.joints.push([influences[0].0, 0, 0, 0]);
                primitive.joint_weights.push(Vec4::X);
            }
        }
        Ok(())
    }

    /// Morph targets. Differences of normals and tangents are of use only beside those that they were made for.
    pub(super) fn morph_targets(
        &mut self,
        source: &::gltf::Primitive<'a>,
        primitive: &mut Primitive,
        place: &str,
    ) -> Result<(), SceneError> {
        let count = primitive.positions.len();
        let quantized = self.quantized();
        let positions = if quantized { Format::QUANTIZED } else { Format::FLOAT };
        let directions = if quantized { Format::SIGNED } else { Format::FLOAT };
        for (index, target) in source.morph_targets().enumerate() {
            let mut stream = |accessor: Option<::gltf::Accessor<'a>>, name: &str, format| {
                let Some(accessor) = accessor else { return Ok(Vec::new()) };
                let place = format!("{place}.targets[{index}].{name}");
                self.same_count(&accessor, count, &place)?;
                self.budget
                    .spend(|l| &mut l.morph_vertices, count, "vertices of morph targets")
                    .map_err(|problem| self.file.invalid(&*place, problem))?;
                let values = self.accessors.vectors::<3>(&accessor, format, &place)?;
                if let Some(at) = values.iter().position(|d| d.iter().any(|x| x.abs() > MAX_COORDINATE)) {
                    let problem = format!("element {at} is larger than {MAX_COORDINATE:e}");
                    return Err(self.file.invalid(place, problem));
                }
                let differs = values.iter().any(|d| *d != [0.0; 3]);
                Ok(if differs { values.into_iter().map(Vec3::from).collect() } else { Vec::new() })
            };
            let has = |stream: bool, accessor| if stream { accessor } else { None };
            primitive.morph_targets.push(MorphTarget {
                positions: stream(target.positions(), "POSITION", positions)?,
                normals: stream(has(!primitive.normals.is_empty(), target.normals()), "NORMAL", directions)?,
                tangents: stream(
                    has(!primitive.tangents.is_empty(), target.tangents()),
                    "TANGENT",
                    directions,
                )?,
            });
        }
        Ok(())
    }

    /// Gives every primitive as many targets as the one with the most.
    pub(super) fn align_targets(
        &mut self,
        mesh: &mut Mesh,
        place: &str,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let counts = mesh.primitives.iter().map(|p| p.morph_targets.len());
        let most = counts.clone().max().unwrap_or(0);
        if counts.min().is_some_and(|least| least < most) {
            warnings.add(format!("{place}: its primitives have different numbers of morph targets"));
        }
        self.budget
            .spend(|l| &mut l.morph_vertices, most * mesh.primitives.len(), "vertices of morph targets")
            .map_err(|problem| self.file.invalid(place, problem))?;
        for primitive in &mut mesh.primitives {
            primitive.morph_targets.resize(most, MorphTarget::default());
        }
        Ok(())
    }
}

/// Keeps the four largest weights of eight, in order; says whether another was above zero.
fn keep_strongest(kept: &mut [(u16, f32); JOINTS], more: [(u16, f32); JOINTS]) -> bool {
    let mut all = [(0, 0.0); 2 * JOINTS];
    all[..JOINTS].copy_from_slice(kept);
    all[JOINTS..].copy_from_slice(&more);
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    kept.copy_from_slice(&all[..JOINTS]);
    all[JOINTS].1 > 0.0
}
