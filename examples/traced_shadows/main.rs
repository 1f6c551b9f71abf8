//! Shadows by rays in a program that renders its own depth and normals, and lights them in a pass of its own.
//!
//! `cargo run --release -p chiaro-examples --bin traced_shadows -- sculpture.png`

mod host;

use chiaro::alone::TracedShadows;
use chiaro::scene::{Light, LightKind, Material, Mesh, Node, Primitive, Scene};
use chiaro::techniques::shadow::ShadowSettings;
use chiaro::wgpu::CommandEncoderDescriptor;
use chiaro::{Gpu, GpuOptions, Readback, Texture, View};
use glam::{Affine3A, Quat, Vec2, Vec3};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "sculpture.png".into());
    // A program with a device of its own takes `Gpu::adopt` instead.
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    Ok(chiaro_image::write_png(&path, &picture(&gpu, [960, 540], 16)?)?)
}

/// What casts shadows: the program's triangles.
fn casters(corners: &[[Vec3; 2]]) -> Scene {
    let primitive = Primitive {
        positions: corners.iter().map(|corner| corner[0]).collect(),
        normals: corners.iter().map(|corner| corner[1]).collect(),
        indices: (0..corners.len() as u32).collect(),
        ..Primitive::default()
    };
    Scene {
        materials: vec![Material::default()],
        meshes: vec![Mesh { primitives: vec![primitive], ..Mesh::default() }],
        nodes: vec![Node { mesh: Some(0), ..Node::default() }],
        ..Scene::default()
    }
}

fn picture(gpu: &Gpu, size: [u32; 2], rays: u32) -> Result<chiaro_image::Picture> {
    let corners = host::corners();
    let settings = ShadowSettings { rays, light_size: 0.08, ..ShadowSettings::default() };
    let mut shadows = TracedShadows::new(gpu, settings, &casters(&corners))?;
    let program = host::Program::new(&gpu.device, (&shadows.wgsl(1), shadows.layout()), &corners, size);

    // Each frame: lights and the camera, then the program's passes.
    let (name, kind) = ("sun".into(), LightKind::Directional);
    let sun = Light { name, kind, color: Vec3::ONE, intensity: 1.0, range_m: None };
    let towards = Affine3A::from_quat(Quat::from_rotation_arc(Vec3::NEG_Z, host::SUN.normalize()));
    let view = View::look_at(Vec3::new(5.0, 4.0, 9.0), Vec3::new(0.0, 1.0, 0.0), 0.7, 0.1);
    shadows.set(&[(sun, towards)], (&view, size))?;
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
    program.draw(&gpu.device, &mut encoder, view.clip_from_ws(size, Vec2::ZERO), shadows.bind_group());
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
    fn columns_shadow_the_floor_that_the_program_drew() {
        let gpu = pollster::block_on(Gpu::new(GpuOptions::default())).unwrap();
        let picture = picture(&gpu, [192, 108], 1).unwrap();
        let levels = picture.bytes().chunks_exact(3).map(|texel| texel[0]);
        let lit = levels.clone().filter(|&level| level > 170).count();
        let dark = levels.filter(|&level| (80..120).contains(&level)).count();
        assert!(lit > 3000 && dark > 800, "{lit} pixels are lit, {dark} in shadow");
        gpu.check().unwrap();
    }
}
