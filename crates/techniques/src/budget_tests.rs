//! What every entry file binds, held against WebGPU's limits for a stage. `--nocapture` prints the table.

use std::fmt::Write as _;

use chiaro_gpu::shader::Reflected;
use chiaro_gpu::wgpu::{BindingType, BufferBindingType, ShaderStages};

use crate::shaders;

const STORAGE_BUFFERS: usize = 8;
const SAMPLED_TEXTURES: usize = 16;
/// What must be left for techniques to come.
const SPARE: usize = 2;

/// Entry files, or flags of any, that may leave less, and why.
const EXCEPTIONS: &[(&str, &str)] = &[
    ("caustics/photon_trace/trace.cs.wesl", "the scene, its trees, lamps, and what photons leave"),
    ("direct/forward.vs.wesl", "all light with its shadows, caustics, and textures of materials"),
    ("traced", "shading with lights by froxel, the scene and its trees"),
    ("reference/path/trace.cs.wesl", "the scene, the tree and the photon map"),
    ("reference/photon/trace.cs.wesl", "as the path tracer, and lights to start from"),
    ("transparency/shade.cs.wesl", "a layer, what is behind it, and all light with its shadows"),
    ("view/raster/tiles.cs.wesl", "the scene, the lists, tiles and depths; it shades nothing"),
    ("view/raster/triangles.cs.wesl", "as the tiles"),
];

/// Storage buffers, sampled textures, samplers, storage textures and uniform buffers.
fn counts<'a>(bindings: impl Iterator<Item = &'a Reflected>) -> [usize; 5] {
    let mut counts = [0; 5];
    for binding in bindings {
        counts[match binding.ty {
            BindingType::Buffer { ty: BufferBindingType::Storage { .. }, .. } => 0,
            BindingType::Texture { .. } => 1,
            BindingType::Sampler(_) => 2,
            BindingType::StorageTexture { .. } => 3,
            BindingType::Buffer { ty: BufferBindingType::Uniform, .. } => 4,
            _ => panic!("{} is of a kind that WebGPU has not", binding.name),
        }] += 1;
    }
    counts
}

#[test]
fn two_storage_buffers_and_two_sampled_textures_are_left_in_every_stage() {
    let library = shaders::library();
    let mut table = format!(
        "{:<58} {:<8} {:>15} {:>15} {:>15} {:>15} {:>15}\n",
        "of all groups (of groups 0 1 2 3)",
        "stage",
        "storage buffers",
        "textures",
        "samplers",
        "storage tex.",
        "uniforms"
    );
    let (mut tight, mut used) = (Vec::new(), Vec::new());
    for permutation in shaders::permutations() {
        let bindings = library.link(&permutation).unwrap().bindings().unwrap();
        let stages = [
            (ShaderStages::VERTEX, "vertex"),
            (ShaderStages::FRAGMENT, "fragment"),
            (ShaderStages::COMPUTE, "compute"),
        ];
        for (stage, name) in stages {
            let seen = || bindings.iter().filter(|binding| binding.visibility.contains(stage));
            let all = counts(seen());
            if all.iter().sum::<usize>() == 0 {
                continue;
            }
            let groups = [0, 1, 2, 3].map(|group| counts(seen().filter(|binding| binding.group == group)));
            let _ = write!(table, "{:<58} {name:<8}", permutation.label());
            for (kind, count) in all.iter().enumerate() {
                let [a, b, c, d] = groups.map(|group| group[kind]);
                let _ = write!(table, " {:>15}", format!("{count} ({a} {b} {c} {d})"));
            }
            table.push('\n');
            if all[0] + SPARE > STORAGE_BUFFERS || all[1] + SPARE > SAMPLED_TEXTURES {
                let named =
                    |name: &str| name == permutation.entry || permutation.flags.contains(&(name, true));
                match EXCEPTIONS.iter().find(|(name, _)| named(name)) {
                    Some((entry, _)) => used.push(*entry),
                    None => {
                        tight.push(format!("{} ({name}): {} and {}", permutation.label(), all[0], all[1]));
                    }
                }
            }
        }
    }
    println!("{table}");
    assert!(tight.is_empty(), "storage buffers and sampled textures:\n{}", tight.join("\n"));
    for (entry, why) in EXCEPTIONS {
        assert!(used.contains(entry), "{entry} is no exception any more: {why}");
    }
}

#[test]
fn workgroups_have_as_much_memory_as_webgpu_guarantees_but_where_the_adapter_is_asked() {
    const GUARANTEED: u32 = 16 * 1024;
    let library = shaders::library();
    for permutation in shaders::permutations() {
        let bytes = library.link(&permutation).unwrap().workgroup_bytes();
        if permutation.flags.contains(&("teams", true)) {
            assert_eq!(bytes, crate::indirect::ism::TEAMS_BYTES, "{}", permutation.label());
        } else {
            assert!(bytes <= GUARANTEED, "{}: {bytes}", permutation.label());
        }
    }
}
