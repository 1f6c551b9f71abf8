//! Pipelines that know their bindings by name.

use std::sync::Arc;

use crate::Gpu;
use crate::error::{GpuError, caught};
use crate::group::{FIRST_OWN_GROUP, GroupLayout};
use crate::resource::next_id;
use crate::shader::{Library, Permutation, Reflected, Shader};

/// A pipeline's bindings: which shared groups it uses, and what fills its own groups 2 (inputs) and 3 (outputs).
#[derive(Debug)]
pub(crate) struct Interface {
    pub(crate) label: String,
    pub(crate) shared: Vec<u32>,
    pub(crate) own: [Vec<Reflected>; 2],
    pub(crate) layouts: [Option<(u64, wgpu::BindGroupLayout)>; 2],
    pub(crate) workgroup: [u32; 3],
}

impl Interface {
    /// Reads the interface and makes the pipeline layout.
    ///
    /// # Errors
    /// When a shared group's binding differs from its declaration, or an input (group 2) is writable.
    fn new(
        gpu: &Gpu,
        shader: &Shader,
        shared: &[&GroupLayout],
    ) -> Result<(Self, wgpu::PipelineLayout), GpuError> {
        let fail = |message: String| GpuError::Shader { name: shader.label.clone(), message };
        let mut used = Vec::new();
        let mut own = [Vec::new(), Vec::new()];
        for binding in &shader.bindings {
            if binding.group >= FIRST_OWN_GROUP {
                let slot = (binding.group - FIRST_OWN_GROUP) as usize;
                let list =
                    own.get_mut(slot).ok_or_else(|| fail(format!("{} is in group > 3", binding.name)))?;
                if slot == 0 && binding.written {
                    return Err(fail(format!("{} is written, so it belongs to group 3", binding.name)));
                }
                list.push(binding.clone());
                continue;
            }
            let layout = shared.iter().find(|layout| layout.index == binding.group).ok_or_else(|| {
                fail(format!("{} is in shared group {}, which was not given", binding.name, binding.group))
            })?;
            layout.check(binding).map_err(fail)?;
            if !used.contains(&binding.group) {
                used.push(binding.group);
            }
        }
        let layouts =
            own.each_ref().map(|bindings| (!bindings.is_empty()).then(|| group_layout(gpu, bindings)));
        let mut groups: Vec<Option<&wgpu::BindGroupLayout>> = (0..FIRST_OWN_GROUP)
            .map(|index| shared.iter().find(|l| l.index == index && used.contains(&index)).map(|l| &l.layout))
            .collect();
        groups.extend(layouts.iter().map(|layout| layout.as_ref().map(|(_, layout)| layout)));
        while groups.last().is_some_and(Option::is_none) {
            groups.pop();
        }
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&shader.label),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let (label, workgroup) = (shader.label.clone(), shader.workgroup);
        Ok((Self { label, shared: used, own, layouts, workgroup }, pipeline_layout))
    }
}

fn group_layout(gpu: &Gpu, bindings: &[Reflected]) -> (u64, wgpu::BindGroupLayout) {
    let entries: Vec<_> = bindings
        .iter()
        .map(|b| wgpu::BindGroupLayoutEntry {
            binding: b.binding,
            visibility: b.visibility,
            ty: b.ty,
            count: None,
        })
        .collect();
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
    (next_id(), gpu.device.create_bind_group_layout(&descriptor))
}

/// A compute pipeline made from one `.cs.wesl` file.
#[derive(Clone, Debug)]
pub struct ComputePipeline {
    pub(crate) raw: wgpu::ComputePipeline,
    pub(crate) interface: Arc<Interface>,
}

impl ComputePipeline {
    /// Links and compiles.
    ///
    /// # Errors
    /// [`GpuError::Shader`] when the shader does not link or fit its groups.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        permutation: &Permutation,
        shared: &[&GroupLayout],
        constants: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        let shader = library.shader(gpu, permutation)?;
        let constants = &shader.constants(constants)?;
        gpu.created.add_pipeline();
        let (interface, layout) = Interface::new(gpu, &shader, shared)?;
        let raw = caught(&gpu.device, || {
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&shader.label),
                layout: Some(&layout),
                module: &shader.module,
                entry_point: shader.entry_point(naga::ShaderStage::Compute),
                compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
                cache: None,
            })
        })?;
        Ok(Self { raw, interface: Arc::new(interface) })
    }
}

/// The fixed-function state of a render pipeline.
#[derive(Clone, Debug)]
pub struct RenderPipelineOptions<'a> {
    /// Colour targets with their blending.
    pub targets: &'a [wgpu::ColorTargetState],
    /// Depth test.
    pub depth: Option<(wgpu::TextureFormat, wgpu::CompareFunction)>,
    /// Which faces are dropped.
    pub cull: Option<wgpu::Face>,
    /// Samples per pixel.
    pub samples: u32,
    /// Masked edges spread over the samples by alpha.
    pub alpha_to_coverage: bool,
    /// Depth clamped instead of clipped; needs [`crate::OptionalFeatures::depth_clip_control`].
    pub unclipped_depth: bool,
    /// Pipeline-overridable constants.
    pub constants: &'a [(&'a str, f64)],
}

impl Default for RenderPipelineOptions<'_> {
    fn default() -> Self {
        Self {
            targets: &[],
            depth: None,
            cull: None,
            samples: 1,
            alpha_to_coverage: false,
            unclipped_depth: false,
            constants: &[],
        }
    }
}

/// A render pipeline made from one file with a vertex and, optionally, a fragment entry. Vertices are pulled from
/// storage buffers, so there are no vertex buffer layouts.
#[derive(Clone, Debug)]
pub struct RenderPipeline {
    pub(crate) raw: wgpu::RenderPipeline,
    pub(crate) interface: Arc<Interface>,
}

impl RenderPipeline {
    /// Links and compiles.
    ///
    /// # Errors
    /// [`GpuError::Shader`] when the shader does not link or fit its groups.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        permutation: &Permutation,
        shared: &[&GroupLayout],
        options: &RenderPipelineOptions<'_>,
    ) -> Result<Self, GpuError> {
        let shader = library.shader(gpu, permutation)?;
        let constants = &shader.constants(options.constants)?;
        gpu.created.add_pipeline();
        let (interface, layout) = Interface::new(gpu, &shader, shared)?;
        let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
        let targets: Vec<_> = options.targets.iter().cloned().map(Some).collect();
        let fragment = shader.entry_point(naga::ShaderStage::Fragment);
        let descriptor = wgpu::RenderPipelineDescriptor {
            label: Some(&shader.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &shader.module,
                entry_point: shader.entry_point(naga::ShaderStage::Vertex),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: options.cull,
                unclipped_depth: options.unclipped_depth,
                ..Default::default()
            },
            depth_stencil: options.depth.map(|(format, compare)| wgpu::DepthStencilState {
                format,
                depth_write_enabled: Some(true),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState {
                count: options.samples,
                mask: !0,
                alpha_to_coverage_enabled: options.alpha_to_coverage,
            },
            fragment: fragment.map(|entry| wgpu::FragmentState {
                module: &shader.module,
                entry_point: Some(entry),
                compilation_options,
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        };
        let raw = caught(&gpu.device, || gpu.device.create_render_pipeline(&descriptor))?;
        Ok(Self { raw, interface: Arc::new(interface) })
    }
}
