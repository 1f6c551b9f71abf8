//! A number that says whether two scenes are the same.

use std::fmt::{Debug, Write};

use bytemuck::{NoUninit, cast_slice};

use crate::{Environment, ImageData, Mesh, MorphTarget, Primitive, Scene};

/// FNV-1a of 64 bits (Fowler, Noll & Vo), the same on every machine and in every version.
struct Fnv(u64);

impl Fnv {
    const NEW: Self = Self(0xcbf2_9ce4_8422_2325);

    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// With the length first, so that what one list loses the next cannot gain unseen.
    fn list<T: NoUninit>(&mut self, values: &[T]) {
        self.bytes(&(values.len() as u64).to_le_bytes());
        self.bytes(cast_slice(values));
    }

    /// Debug text of floats gives back the same floats.
    fn text(&mut self, value: &impl Debug) {
        // Writing to a hash does not fail.
        let _ = write!(self, "{value:?}");
    }
}

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

/// A hash of a text, the same on every machine and in every version.
pub fn text_hash(text: &str) -> u64 {
    let mut hash = Fnv::NEW;
    hash.bytes(text.as_bytes());
    hash.0
}

impl Scene {
    /// A hash of everything that decides how the scene looks: equal scenes have equal ones, and two different ones
    /// practically never. The scene's own name, its cameras and warnings do not count.
    pub fn fingerprint(&self) -> u64 {
        let mut hash = Fnv::NEW;
        let Self {
            name: _,
            origin_m: _,
            meshes,
            materials,
            textures,
            images,
            // The same scene, however it is computed with.
            origin: _,
            nodes,
            cameras: _,
            lights,
            skins,
            animations,
            environment,
            scene_names: _,
            warnings: _,
        } = self;
        hash.text(&(materials, textures, nodes, lights, skins, animations));
        for Mesh { name: _, primitives, morph_weights } in meshes {
            hash.list(morph_weights);
            hash.text(&primitives.len());
            for primitive in primitives {
                add_primitive(&mut hash, primitive);
            }
        }
        for ImageData { name: _, width, height, rgba } in images {
            hash.text(&(width, height));
            hash.list(rgba);
        }
        if let Some(Environment { name: _, width, height, radiance }) = environment {
            hash.text(&(width, height));
            hash.list(radiance);
        }
        hash.0
    }
}

fn add_primitive(hash: &mut Fnv, primitive: &Primitive) {
    let Primitive {
        positions,
        normals,
        flat,
        tangents,
        uvs: [uv0, uv1],
        colors,
        joints,
        joint_weights,
        morph_targets,
        indices,
        material,
    } = primitive;
    hash.list(positions);
    hash.list(normals);
    hash.list(tangents);
    hash.list(uv0);
    hash.list(uv1);
    hash.list(colors);
    hash.list(joints);
    hash.list(joint_weights);
    hash.list(indices);
    hash.text(&(material, morph_targets.len(), flat));
    for MorphTarget { positions, normals, tangents } in morph_targets {
        hash.list(positions);
        hash.list(normals);
        hash.list(tangents);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use crate::{Environment, Scene, load};

    fn cornell() -> Scene {
        load("builtin:cornell").unwrap()
    }

    #[test]
    fn a_scene_read_twice_has_one_fingerprint_whatever_its_name() {
        let scene = Scene { name: "another".into(), ..cornell() };
        assert_eq!(scene.fingerprint(), cornell().fingerprint());
    }

    #[test]
    fn whatever_changes_the_picture_changes_the_fingerprint() {
        let changes: [fn(&mut Scene); 6] = [
            |s| s.meshes[0].primitives[0].positions[0].x += 1e-6,
            |s| s.meshes[0].primitives[0].indices.swap(0, 1),
            |s| s.materials[0].roughness += 1e-6,
            |s| s.lights[0].intensity *= 1.000_001,
            |s| s.nodes.swap(0, 1),
            |s| {
                let radiance = vec![Vec3::ONE];
                s.environment = Some(Environment { name: String::new(), width: 1, height: 1, radiance });
            },
        ];
        let own = cornell().fingerprint();
        for (index, change) in changes.iter().enumerate() {
            let mut scene = cornell();
            change(&mut scene);
            assert_ne!(scene.fingerprint(), own, "change {index}");
        }
    }
}
