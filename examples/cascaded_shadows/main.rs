//! Cascaded shadow maps of chiaro in a program with geometry, shaders and a camera of its own.
//!
//! `cargo run --release -p chiaro-examples --bin cascaded_shadows -- posts.png`

use bytemuck::Zeroable;
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::{Attachment, Binding, Buffer, DepthAttachment, Draw, Gpu, GpuOptions, Life, Recorder};
use chiaro_gpu::{Readback, RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions};
use chiaro_gpu::{wgpu, wgpu::BufferUsages, wgpu::TextureFormat, wgpu::TextureUsages};
use chiaro_techniques::frame::{FrameData, FrameGroup, LightData};
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::shadow::{CameraView, FitInputs, Lookup, ShadowOutputs, ShadowSettings, fit};
use chiaro_techniques::{shaders, shared::albedo_table};
use glam::{Mat4, Vec3, camera};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A floor and 400 posts, made from vertex numbers in `posts.wesl`.
const VERTICES: u32 = 36 * 401;

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "posts.png".into());
    // A program with a device of its own takes `Gpu::from_device` instead.
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    chiaro_image::write_png(&path, &picture(&gpu, [960, 540])?)?;
    Ok(())
}

fn picture(gpu: &Gpu, [width, height]: [u32; 2]) -> Result<chiaro_image::Picture> {
    // The camera, in reversed depth: 1 near, 0 at infinity.
    let eye = Vec3::new(0.0, 6.0, 30.0);
    let view = camera::rh::view::look_at_mat4(eye, Vec3::new(0.0, 0.0, 12.0), Vec3::Y);
    let aspect = width as f32 / height as f32;
    let clip_from_ws = camera::rh::proj::directx::perspective_infinite_reverse(0.9, aspect, 0.1) * view;
    let camera =
        CameraView { eye_ws: eye, forward_ws: -view.row(2).truncate(), ws_from_clip: clip_from_ws.inverse() };

    // The sun's cascades.
    let settings = ShadowSettings::default();
    let direction = Vec3::new(0.6, -1.0, -0.4).normalize().to_array();
    let sun = LightData {
        kind: LightData::DIRECTIONAL,
        direction_ws: direction,
        intensity: [1.0; 3],
        ..Zeroable::zeroed()
    };
    let mut lights = [sun];
    let bounds_ws = (Vec3::new(-40.0, -0.1, -40.0), Vec3::new(40.0, 2.0, 40.0));
    let inputs = FitInputs {
        bounds_ws,
        casters: None,
        camera,
        settings: &settings,
        clamps_depth: false,
        see_through: false,
    };
    let views = fit(&mut lights, &inputs).views;
    let shadows = ShadowOutputs::new(gpu, settings.resolution, views.len() as u32);

    // Group 0 is what chiaro's shaders share; everything else is this program's.
    let layout = FrameGroup::layout(gpu);
    let group = FrameGroup::new(gpu, &layout, &albedo_table::texture(gpu));
    let library = shaders::library().with(&[
        ("posts/posts.wesl", include_str!("posts.wesl")),
        ("posts/depth.vs.wesl", include_str!("depth.vs.wesl")),
        ("posts/shade.vs.wesl", include_str!("shade.vs.wesl")),
    ]);
    let depth = Some((TextureFormat::Depth32Float, wgpu::CompareFunction::Greater));
    let pipeline = |entry, targets: &[wgpu::ColorTargetState], constants: &[(&str, f64)]| {
        let options = RenderPipelineOptions { targets, depth, constants, ..Default::default() };
        RenderPipeline::new(
            gpu,
            &library,
            &Permutation::plain(entry).flag("float_maps", false),
            &[&layout],
            &options,
        )
    };
    let cast = pipeline("posts/depth.vs.wesl", &[], &[])?;
    let lookup = Lookup::new(&settings).constants(gpu, SceneFacts::default());
    let shade = pipeline("posts/shade.vs.wesl", &[TextureFormat::Rgba8UnormSrgb.into()], &lookup)?;
    let target = |name, format, usage| {
        let usage = usage | TextureUsages::RENDER_ATTACHMENT;
        Texture::new(gpu, name, Life::Frame, TextureOptions::new(width, height, format, usage))
    };
    let color = target("color", TextureFormat::Rgba8UnormSrgb, TextureUsages::COPY_SRC);
    let nearest = target("depth", TextureFormat::Depth32Float, TextureUsages::empty());
    // One uniform per cascade: a matrix every 256 bytes.
    let matrices: Vec<[Mat4; 4]> = views.iter().map(|view| [view.clip_from_ws; 4]).collect();
    let matrices = bytemuck::cast_slice::<_, f32>(bytemuck::cast_slice::<_, [f32; 64]>(&matrices)).to_vec();
    let casters = Buffer::with_data(gpu, "caster", &matrices, BufferUsages::UNIFORM);

    let mut recorder = Recorder::new(gpu, false);
    let mut frame = recorder.begin();
    let data = FrameData {
        clip_from_ws: clip_from_ws.to_cols_array_2d(),
        eye_ws: eye.to_array(),
        size_px: [width, height],
        directional_lights: 1,
        shadow: settings.parameters(),
        ..Zeroable::zeroed()
    };
    group.upload(&mut frame, &data, &lights, &views.iter().map(|view| view.data).collect::<Vec<_>>());
    for layer in 0..views.len() as u32 {
        let map = DepthAttachment { texture: &shadows.maps, layer, clear: Some(0.0) };
        let binds = [("caster", Binding::BufferRange(&casters, 256 * u64::from(layer), 256))];
        frame.render("posts/shadow", Targets { color: &[], depth: Some(map) }, |pass| {
            pass.draw(&cast, &[group.group()], &binds, Draw::Vertices(VERTICES));
        });
    }
    let sky = wgpu::Color { r: 0.3, g: 0.5, b: 0.8, a: 1.0 };
    let attachment = Attachment { texture: &color, layer: 0, clear: Some(sky), resolve: None };
    let depth = DepthAttachment { texture: &nearest, layer: 0, clear: Some(0.0) };
    frame.render("posts/shade", Targets { color: &[attachment], depth: Some(depth) }, |pass| {
        pass.draw(&shade, &[group.group()], &shadows.binds(), Draw::Vertices(VERTICES));
    });
    frame.submit();
    let pixels = Readback::start(gpu, &color)?.wait(gpu)?;
    let rgb = pixels.bytes.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
    Ok(chiaro_image::Picture::from_bytes(width, height, rgb)?)
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
    }
}
