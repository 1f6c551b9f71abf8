//! Cascaded shadow maps of chiaro in a program with vertex buffers, pipelines, WGSL and a camera of its own.
//!
//! `cargo run --release -p chiaro-examples --bin cascaded_shadows -- posts.png`

mod posts;

use chiaro::scene::{Light, LightKind};
use chiaro::wgpu::CommandEncoderDescriptor;
use chiaro::{Gpu, GpuOptions, Readback, Texture, View, alone::Shadows, techniques::shadow::ShadowSettings};
use glam::{Affine3A, Quat, Vec2, Vec3};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "posts.png".into());
    // A program with a device of its own takes `Gpu::adopt` instead.
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    Ok(chiaro_image::write_png(&path, &picture(&gpu, [960, 540])?)?)
}

fn picture(gpu: &Gpu, size: [u32; 2]) -> Result<chiaro_image::Picture> {
    // The shadows of a sun, looked up by the program's own shader.
    let mut shadows = Shadows::new(gpu, ShadowSettings::default())?;
    let program = posts::Program::new(&gpu.device, &shadows.wgsl(1), shadows.layout(), size);

    // Each frame: maps are fitted to the lights and the camera, drawn, and looked up.
    let (name, kind) = ("sun".into(), LightKind::Directional);
    let sun = Light { name, kind, color: Vec3::ONE, intensity: 1.0, range_m: None };
    let towards = Quat::from_rotation_arc(Vec3::NEG_Z, posts::SUN.normalize());
    let view = View::look_at(Vec3::new(0.0, 6.0, 30.0), Vec3::new(0.0, 0.0, 12.0), 0.9, 0.1);
    shadows.fit(&[(sun, Affine3A::from_quat(towards))], (&view, size), posts::BOUNDS_WS)?;
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
    for map in shadows.maps() {
        program.draw_depth(&gpu.device, &mut encoder, map.clip_from_world, map.depth);
    }
    let clip_from_world = view.clip_from_ws(size, Vec2::ZERO);
    program.draw(&gpu.device, &mut encoder, clip_from_world, shadows.bind_group());
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
    fn posts_cast_shadows_on_a_lit_floor() {
        let gpu = pollster::block_on(Gpu::new(GpuOptions::default())).unwrap();
        let picture = picture(&gpu, [192, 108]).unwrap();
        let floor = (0..192).map(|x| picture.bytes()[3 * (88 * 192 + x)]);
        let lit = floor.clone().filter(|&level| level > 150).count();
        let dark = floor.filter(|&level| level < 110).count();
        assert!(lit > 60 && dark > 8, "{lit} pixels of the floor are lit, {dark} in shadow");
        gpu.check().unwrap();
    }
}
