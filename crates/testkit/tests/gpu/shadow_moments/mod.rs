//! Shadow maps of moments, made from depths that the tests choose.

mod lookup;
mod making;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::wgpu::{self, CompareFunction, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Binding, DepthAttachment, Dispatch, Draw, Gpu, Life, Recorder, RenderPipeline, RenderPipelineOptions,
    Targets, Texture, TextureOptions,
};
use chiaro_techniques::frame::{FrameData, ShadowViewData};
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::shadow::moments::{MomentKey, MomentOutputs, MomentRoom, Moments};
use chiaro_techniques::shadow::{Filter, Lookup, Representation, ShadowSettings};
use chiaro_techniques::{Pass, shaders};
use chiaro_testkit::Bench;
use glam::Vec2;

use crate::culling::Random;

const ALL: [Representation; 5] = [
    Representation::Variance,
    Representation::Exponential,
    Representation::Evsm2,
    Representation::Evsm4,
    Representation::Moments,
];

/// No bleed reduction: the bounds themselves.
fn settings(representation: Representation, filter: Filter) -> ShadowSettings {
    ShadowSettings { representation, filter, bleed_reduction: 0.0, ..ShadowSettings::default() }
}

/// A place in a map, as `moment_lookup.cs.wesl` takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Point {
    uv: Vec2,
    linear: f32,
    view: u32,
    footprint_x: Vec2,
    footprint_y: Vec2,
    slope: Vec2,
    reserved: Vec2,
}

impl Point {
    fn new(uv: Vec2, linear: f32) -> Self {
        Self { uv, linear, ..Self::zeroed() }
    }
}

/// Layers of reversed depth.
struct Depths {
    side: u32,
    layers: Vec<Vec<f32>>,
}

impl Depths {
    /// Of linear depths 0..1 by layer, column and row, in parallel views.
    fn new(side: u32, layers: u32, linear: impl Fn(u32, u32, u32) -> f32) -> Self {
        let texels = move |layer| (0..side * side).map(|i| 1.0 - linear(layer, i % side, i / side)).collect();
        Self { side, layers: (0..layers).map(texels).collect() }
    }

    fn random(side: u32, layers: u32) -> Self {
        let mut random = Random::new(11);
        let mut texels = || (0..side * side).map(|_| random.within(0.0, 1.0)).collect();
        Self { side, layers: (0..layers).map(|_| texels()).collect() }
    }

    /// As R32Float, or through a render pass as Depth32Float.
    fn upload(&self, gpu: &Gpu, as_depth: bool) -> Texture {
        let (side, count) = (self.side, self.layers.len() as u32);
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let options = TextureOptions::new(side, side, TextureFormat::R32Float, usage).array(count);
        let floats = Texture::new(gpu, "floats", Life::Kept, options);
        gpu.queue.write_texture(
            floats.raw().as_image_copy(),
            bytemuck::cast_slice(&self.layers.concat()),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * side),
                rows_per_image: Some(side),
            },
            wgpu::Extent3d { width: side, height: side, depth_or_array_layers: count },
        );
        if !as_depth {
            return floats;
        }
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT;
        let options = TextureOptions::new(side, side, TextureFormat::Depth32Float, usage).array(count);
        let depth = Texture::new(gpu, "depth", Life::Kept, options);
        let shader = ("tests/depth_copy.vs.wesl", include_str!("../wesl/depth_copy.vs.wesl"));
        let library = shaders::library().with(&[shader]);
        let options = RenderPipelineOptions {
            depth: Some((TextureFormat::Depth32Float, CompareFunction::Always)),
            ..Default::default()
        };
        let entry = Permutation::plain(shader.0);
        let pipeline = RenderPipeline::new(gpu, &library, &entry, &[], &options).unwrap();
        let mut recorder = Recorder::new(gpu, false);
        let mut frame = recorder.begin();
        for layer in 0..count {
            let index =
                chiaro_gpu::Buffer::with_data(gpu, "layer", &[[layer, 0, 0, 0]], wgpu::BufferUsages::UNIFORM);
            let attachment = DepthAttachment { texture: &depth, layer, clear: Some(0.0) };
            frame.render("depth", Targets { color: &[], depth: Some(attachment) }, |pass| {
                let binds = [("layer", (&index).into()), ("source", (&floats).into())];
                pass.draw(&pipeline, &[], &binds, Draw::FullScreen);
            });
        }
        frame.submit();
        depth
    }
}

/// A parallel view of a layer.
fn view(layer: u32, side: u32) -> ShadowViewData {
    ShadowViewData { layer, near_m: 1.0, far_m: 11.0, resolution: side as f32, ..ShadowViewData::zeroed() }
}

/// Maps of moments and what looks them up.
struct Rig {
    gpu: Gpu,
    bench: Bench,
    settings: ShadowSettings,
    moments: Moments,
    room: MomentRoom,
    maps: Texture,
    outputs: Option<MomentOutputs>,
}

impl Rig {
    fn new(gpu: &Gpu, settings: ShadowSettings, depths: &Depths) -> Self {
        let views: Vec<_> = (0..depths.layers.len() as u32).map(|layer| view(layer, depths.side)).collect();
        Self::with_views(gpu, settings, depths, &views, true)
    }

    fn with_views(
        gpu: &Gpu,
        settings: ShadowSettings,
        depths: &Depths,
        views: &[ShadowViewData],
        as_depth: bool,
    ) -> Self {
        let mut bench = Bench::new(gpu);
        bench.frame.reserve(gpu, 1, None);
        gpu.queue.write_buffer(bench.frame.lighting.raw(), 0, bytemuck::cast_slice(views));
        let moments = Moments::compile(&bench.kit, &MomentKey::new(&settings, !as_depth)).unwrap();
        let room = moments.room(gpu, &settings, depths.side, views.len() as u32);
        let maps = depths.upload(gpu, as_depth);
        let mut rig = Self { gpu: gpu.clone(), bench, settings, moments, room, maps, outputs: None };
        rig.make(&(0..views.len() as u32).collect::<Vec<_>>());
        rig
    }

    /// Makes the maps of these views again.
    fn make(&mut self, views: &[u32]) {
        let shadow = self.settings.parameters();
        self.bench.set_frame(&FrameData { shadow, ..FrameData::zeroed() });
        let mut recorder = Recorder::new(&self.gpu, false);
        let mut frame = recorder.begin();
        let group = self.bench.frame.group();
        let (settings, room) = (&self.settings, &mut self.room);
        self.outputs = Some(self.moments.record(&mut frame, group, settings, &self.maps, views, room));
        frame.submit();
    }

    fn outputs(&self) -> &MomentOutputs {
        self.outputs.as_ref().unwrap()
    }

    /// All texels of a mip, layer after layer; numbers that they lack are 0.
    fn texels(&self, mip: u32) -> Vec<[f32; 4]> {
        let options = self.outputs().moments.options();
        let (side, layers) = (options.width >> mip, options.layers.unwrap());
        let shader = ("tests/moment_texels.cs.wesl", include_str!("../wesl/moment_texels.cs.wesl"));
        let level = self.bench.buffer("level", &[[mip, 0, 0, 0]]);
        let inputs = [("level", (&level).into()), ("shadow_moments", (&self.outputs().moments).into())];
        let work = (Dispatch::Threads([side, side, layers]), (side * side * layers) as usize);
        let mut texels: Vec<[f32; 4]> = self.bench.run(shader, &[], None, &inputs, work);
        let channels = self.settings.representation.channels() as usize;
        for texel in &mut texels {
            texel[channels..].fill(0.0);
        }
        texels
    }

    fn visibility(&self, points: &[Point]) -> Vec<f32> {
        self.visibility_filtered(points, self.gpu.optional.float32_filterable)
    }

    /// With the sampler's filter or the shader's own.
    fn visibility_filtered(&self, points: &[Point], filtered: bool) -> Vec<f32> {
        let shader = ("tests/moment_lookup.cs.wesl", include_str!("../wesl/moment_lookup.cs.wesl"));
        let mut constants = Lookup::new(&self.settings).constants(&self.gpu, SceneFacts::default());
        constants.retain(|(name, _)| ["REPRESENTATION", "MOMENT_MIPS"].contains(name));
        constants.push(("FILTERED", filtered.into()));
        let gather = self.gpu.device.create_sampler(&wgpu::SamplerDescriptor::default());
        let points_buffer = self.bench.buffer("points", points);
        let mut inputs: Vec<(&'static str, Binding<'_>)> = vec![
            ("points", (&points_buffer).into()),
            ("shadow_maps", (&self.maps).into()),
            ("shadow_gather", (&gather).into()),
        ];
        inputs.extend(self.outputs().binds());
        let work = (Dispatch::Threads([points.len() as u32, 1, 1]), points.len());
        self.bench.run(shader, &constants, None, &inputs, work)
    }
}
