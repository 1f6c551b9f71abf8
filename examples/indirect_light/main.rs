//! Indirect light of chiaro in a program that draws depth, normals and albedo, and lights them itself.
//!
//! `cargo run --release -p chiaro-examples --bin indirect_light -- room.png`

mod host;

use chiaro::alone::IndirectLight;
use chiaro::scene::{Light, LightKind, Material, Mesh, Node, Primitive, Scene};
use chiaro::techniques::indirect::IndirectSettings;
use chiaro::wgpu::CommandEncoderDescriptor;
use chiaro::{Gpu, GpuOptions, Readback, Texture};
use glam::{Affine3A, Quat, Vec3};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "room.png".into());
    // A program with a device of its own takes `Gpu::adopt` instead.
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    Ok(chiaro_image::write_png(&path, &picture(&gpu, [960, 720], IndirectSettings::default())?)?)
}

/// What the lamp shines at, and what stands in its light's way: the program's boxes.
fn scene(boxes: &[host::Block]) -> Scene {
    let mut scene = Scene::default();
    for (number, block) in boxes.iter().enumerate() {
        let (positions, normals): (Vec<_>, Vec<_>) = block.corners().map(|[p, n]| (p, n)).unzip();
        let indices = (0..positions.len() as u32).collect();
        let primitive = Primitive { positions, normals, indices, material: number, ..Primitive::default() };
        let base_color = block.albedo.extend(1.0);
        scene.materials.push(Material { base_color, specular: 0.0, ..Material::default() });
        scene.meshes.push(Mesh { primitives: vec![primitive], ..Mesh::default() });
        scene.nodes.push(Node { mesh: Some(number), ..Node::default() });
    }
    scene
}

fn picture(gpu: &Gpu, size: [u32; 2], settings: IndirectSettings) -> Result<chiaro_image::Picture> {
    let boxes = host::boxes();
    let mut indirect = IndirectLight::new(gpu, settings, &scene(&boxes))?;
    let program = host::Program::new(&gpu.device, &boxes, size);
    let kind = LightKind::Spot { inner_rad: host::LAMP.inner_rad, outer_rad: host::LAMP.outer_rad };
    let (name, intensity) = ("lamp".into(), host::LAMP.candela);
    let lamp = Light { name, kind, color: Vec3::ONE, intensity, range_m: None };
    let turn = Quat::from_rotation_arc(Vec3::NEG_Z, host::LAMP.direction.normalize());
    let lamps = [(lamp, Affine3A::from_rotation_translation(turn, host::LAMP.place))];

    // Each frame: the program's surfaces, chiaro's light on them, the program's shading with it.
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
    program.draw(&mut encoder);
    let light = indirect.record(&mut encoder, &lamps, &program.drawn())?;
    program.shade(&gpu.device, &mut encoder, light);
    gpu.queue.submit([encoder.finish()]);

    let color = Texture::of_host("color", &program.color, program.color.texture().format());
    let pixels = Readback::start(gpu, &color)?.wait(gpu)?;
    let rgb = pixels.bytes.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
    Ok(chiaro_image::Picture::from_bytes(size[0], size[1], rgb)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_red_wall_in_the_lamp_s_light_reddens_what_the_lamp_does_not_see() {
        let gpu = pollster::block_on(Gpu::new(GpuOptions::default())).unwrap();
        let settings =
            IndirectSettings { vpls: 128, points: 16_384, points_per_vpl: 1024, ..Default::default() };
        let picture = picture(&gpu, [128, 96], settings).unwrap();
        // A white box' side that faces the wall.
        let [red, green, blue] = [0, 1, 2].map(|channel| picture.bytes()[3 * (60 * 128 + 50) + channel]);
        assert!(red > 120 && red > green + 40 && green > blue, "{red} {green} {blue}");
        gpu.check().unwrap();
    }
}
