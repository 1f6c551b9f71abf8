//! A test's own compute shader, linked with the techniques' library.

use std::marker::PhantomData;

use bytemuck::Pod;
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{
    Binding, Buffer, BufferReadback, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Recorder,
};
use chiaro_techniques::frame::{FrameData, FrameGroup};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::shared::albedo_table::AlbedoTable;
use chiaro_techniques::{Kit, Pass, shaders};

/// The shared bind groups, and shaders run over them.
#[derive(Debug)]
pub struct Bench {
    gpu: Gpu,
    /// What passes are compiled with.
    pub kit: Kit,
    /// Group 0, with the BRDF's table filled in.
    pub frame: FrameGroup,
}

fn need<T>(result: Result<T, GpuError>) -> T {
    match result {
        Ok(value) => value,
        Err(error) => panic!("{error}"),
    }
}

impl Bench {
    /// Makes the groups.
    ///
    /// # Panics
    /// When the table's shader does not compile.
    pub fn new(gpu: &Gpu) -> Self {
        let kit = Kit::new(gpu, shaders::library());
        let table = need(AlbedoTable::compile(&kit, &())).texture;
        let frame = FrameGroup::new(gpu, &kit.frame_layout, &table);
        Self { gpu: gpu.clone(), kit, frame }
    }

    /// Fills the frame's uniform for the shaders that follow.
    pub fn set_frame(&self, data: &FrameData) {
        self.gpu.queue.write_buffer(self.frame.frame.raw(), 0, bytemuck::bytes_of(data));
    }

    /// A buffer for a shader's inputs, as storage or as uniform.
    pub fn buffer<T: Pod>(&self, name: &'static str, data: &[T]) -> Buffer {
        Buffer::with_data(&self.gpu, name, data, BufferUsages::STORAGE | BufferUsages::UNIFORM)
    }

    /// Runs one shader: `shader` is its path (`tests/….cs.wesl`) and text, `inputs` fill its group 2, and its group 3
    /// holds `var<storage, read_write> output` of `count` elements, which come back.
    ///
    /// # Panics
    /// When the shader does not compile, or the device fails.
    pub fn run<T: Pod>(
        &self,
        shader: (&'static str, &'static str),
        constants: &[(&str, f64)],
        scene: Option<&SceneGpu>,
        inputs: &[(&'static str, Binding<'_>)],
        work: (Dispatch<'_>, usize),
    ) -> Vec<T> {
        let mut recorder = Recorder::new(&self.gpu, false);
        let mut frame = recorder.begin();
        let output = self.record(&mut frame, shader, constants, scene, inputs, work);
        frame.submit();
        self.read(&output)
    }

    /// The same as a part of a frame, for inputs that last no longer than it; [`Bench::read`] after it was submitted.
    ///
    /// # Panics
    /// When the shader does not compile.
    pub fn record<T: Pod>(
        &self,
        frame: &mut Frame<'_>,
        shader: (&'static str, &'static str),
        constants: &[(&str, f64)],
        scene: Option<&SceneGpu>,
        inputs: &[(&'static str, Binding<'_>)],
        (dispatch, count): (Dispatch<'_>, usize),
    ) -> Output<T> {
        let library = self.kit.library.clone().with(&[shader]);
        let layouts = [&self.kit.frame_layout, &self.kit.scene_layout];
        // Of what reads shadow maps.
        let entry = Permutation::plain(shader.0).flag("float_maps", false).flag("traced", false);
        let pipeline = need(ComputePipeline::new(&self.gpu, &library, &entry, &layouts, constants));
        let bytes = count * size_of::<T>();
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let buffer = Buffer::new(&self.gpu, "output", Life::Kept, bytes as u64, usage);
        let mut groups: Vec<&Group> = vec![self.frame.group()];
        groups.extend(scene.map(SceneGpu::group));
        let mut binds = inputs.to_vec();
        binds.push(("output", (&buffer).into()));
        frame.compute("test", &pipeline, &groups, &binds, dispatch);
        Output { buffer, bytes, elements: PhantomData }
    }

    /// What a shader wrote in a frame that was submitted.
    ///
    /// # Panics
    /// When the device fails.
    pub fn read<T: Pod>(&self, output: &Output<T>) -> Vec<T> {
        let bytes = need(BufferReadback::start(&self.gpu, &output.buffer).wait(&self.gpu));
        bytemuck::pod_collect_to_vec(&bytes[..output.bytes])
    }
}

/// What a shader of [`Bench::record`] writes.
#[derive(Debug)]
pub struct Output<T> {
    buffer: Buffer,
    bytes: usize,
    elements: PhantomData<T>,
}
