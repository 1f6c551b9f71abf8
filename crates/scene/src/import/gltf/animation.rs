//! Animations: keyframes of nodes' poses and morph weights.

use ::gltf::animation::{Interpolation as GltfInterpolation, Property};
use glam::{Quat, Vec4};

use super::super::limits::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::accessor::Format;
use super::node::Nodes;
use super::primitive::Meshes;
use crate::{Animation, Channel, Id, Interpolation, Keys, Scene, SceneError, Transform};

/// The latest key, in seconds: thirty years. Later ones have no place between two frames as `f32`.
const MAX_TIME_S: f32 = 1e9;

/// Converts the animations of the scene's nodes; channels of other scenes' nodes are left out.
pub(super) fn convert(
    meshes: &mut Meshes<'_, '_>,
    nodes: &Nodes,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    for source in meshes.file.document.animations() {
        let mut animation =
            Animation { name: source.name().unwrap_or_default().to_owned(), channels: Vec::new() };
        for channel in source.channels() {
            let place = format!("animations[{}].channels[{}]", source.index(), channel.index());
            let target = channel.target();
            let Some(node) = nodes.ids[target.node().index()] else { continue };
            let property = target.property();
            let instances = nodes.instances.get(&target.node().index());
            let moved: &[Id] = match instances {
                // The weights are those of the mesh, and that is drawn by the instances.
                Some(instances) if property == Property::MorphTargetWeights => instances,
                _ => &[node],
            };
            let Some(channel) =
                keys(meshes, &channel.sampler(), property, moved[0], scene, &place, warnings)?
            else {
                continue;
            };
            for &node in moved {
                let values = channel.times_s.len() * 4 + count(&channel.keys);
                meshes
                    .budget
                    .spend(|l| &mut l.keys, values, "values of animation keys")
                    .map_err(|problem| meshes.file.invalid(&*place, problem))?;
                animation.channels.push(Channel { node, ..channel.clone() });
            }
        }
        if !animation.channels.is_empty() {
            scene.animations.push(animation);
        }
    }
    Ok(())
}

fn count(keys: &Keys) -> usize {
    match keys {
        Keys::MorphWeights(weights) => weights.len(),
        Keys::Translation(keys) | Keys::Scale(keys) => keys.len(),
        Keys::Rotation(keys) => keys.len(),
    }
}

/// What a sampler does to a property of node `node`; `None` where that is nothing.
fn keys<'a>(
    meshes: &mut Meshes<'_, 'a>,
    sampler: &::gltf::animation::Sampler<'a>,
    property: Property,
    node: Id,
    scene: &mut Scene,
    place: &str,
    warnings: &mut Warnings,
) -> Result<Option<Channel>, SceneError> {
    let targets = scene.nodes[node].mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets());
    let each = if property == Property::MorphTargetWeights { targets } else { 1 };
    if each == 0 {
        warnings.add(format!("{place} was left out: its node has no morph targets"));
        return Ok(None);
    }
    if property != Property::MorphTargetWeights && !take_apart(&mut scene.nodes[node].parent_from_node) {
        warnings
            .add(format!("{place} was left out: its node's matrix is no translation, rotation and scale"));
        return Ok(None);
    }
    let interpolation = match sampler.interpolation() {
        GltfInterpolation::Step => Interpolation::Step,
        GltfInterpolation::Linear => Interpolation::Linear,
        GltfInterpolation::CubicSpline => Interpolation::Cubic,
    };
    let times_s = times(meshes, &sampler.input(), place, warnings)?;
    let per_key = if interpolation == Interpolation::Cubic { 3 } else { 1 };
    let (output, place) = (sampler.output(), format!("{place}.sampler.output"));
    let expected = times_s.len().saturating_mul(per_key).saturating_mul(each);
    if output.count() != expected {
        let problem = format!("it has {} elements; its keys need {expected}", output.count());
        return Err(meshes.file.invalid(place, problem));
    }
    let keys = match property {
        Property::Translation => Keys::Translation(values::<_, 3>(meshes, &output, Format::FLOAT, &place)?),
        Property::Scale => Keys::Scale(values::<_, 3>(meshes, &output, Format::FLOAT, &place)?),
        Property::Rotation => {
            let keys: Vec<Vec4> = values::<_, 4>(meshes, &output, Format::NORMALIZED, &place)?;
            let mut keys: Vec<Quat> = keys.into_iter().map(Quat::from_vec4).collect();
            // Of a spline's three values the middle one is a rotation.
            for key in keys.iter_mut().skip(per_key / 2).step_by(per_key) {
                if key.length() < 1e-6 {
                    warnings.add(format!("{place}: a rotation without a direction was taken for none"));
                    *key = Quat::IDENTITY;
                }
                *key = key.normalize();
            }
            Keys::Rotation(keys)
        }
        Property::MorphTargetWeights => {
            let weights: Vec<[f32; 1]> = values::<_, 1>(meshes, &output, Format::NORMALIZED, &place)?;
            Keys::MorphWeights(weights.into_iter().map(|[weight]| weight).collect())
        }
    };
    Ok(Some(Channel { node, times_s, interpolation, keys }))
}

/// Makes a matrix translation, rotation and scale, of which one can be animated; says whether that was possible.
fn take_apart(transform: &mut Transform) -> bool {
    let Transform::Matrix(matrix) = *transform else { return true };
    let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
    let sound = scale.is_finite() && rotation.is_finite() && rotation.length() > 1e-6;
    if sound {
        *transform = Transform::Trs { translation, rotation: rotation.normalize(), scale };
    }
    sound
}

/// Times of keys, strictly ascending: a key at the time of the one before comes the shortest moment later, so that a
/// jump stays one. Times that go back are refused.
fn times<'a>(
    meshes: &Meshes<'_, 'a>,
    input: &::gltf::Accessor<'a>,
    place: &str,
    warnings: &mut Warnings,
) -> Result<Vec<f32>, SceneError> {
    let place = format!("{place}.sampler.input");
    let read = meshes.accessors.vectors::<1>(input, Format::FLOAT, &place)?;
    let mut times_s: Vec<f32> = Vec::with_capacity(read.len());
    let mut before = 0.0;
    for (i, [time_s]) in read.into_iter().enumerate() {
        if time_s < before {
            let problem = format!("key {i} at {time_s} s follows {before} s; times must ascend from 0");
            return Err(meshes.file.invalid(place, problem));
        }
        if time_s > MAX_TIME_S {
            return Err(meshes.file.invalid(place, format!("key {i} is later than {MAX_TIME_S:e} s")));
        }
        before = time_s;
        let last = times_s.last().copied();
        let shared = last.filter(|&last| time_s <= last);
        if shared.is_some() {
            warnings.add(format!("{place}: keys at the same time were moved apart"));
        }
        times_s.push(shared.map_or(time_s, f32::next_up));
    }
    Ok(times_s)
}

/// Values of keys, within reach.
fn values<'a, T: From<[f32; N]>, const N: usize>(
    meshes: &Meshes<'_, 'a>,
    output: &::gltf::Accessor<'a>,
    format: Format,
    place: &str,
) -> Result<Vec<T>, SceneError> {
    let values = meshes.accessors.vectors::<N>(output, format, place)?;
    if let Some(at) = values.iter().position(|v| v.iter().any(|x| x.abs() > MAX_COORDINATE)) {
        return Err(meshes.file.invalid(place, format!("element {at} exceeds {MAX_COORDINATE:e}")));
    }
    Ok(values.into_iter().map(T::from).collect())
}
