//! Pipelines that know their bindings by name.

use std::sync::Arc;

use crate::resource::next_id;
use crate::shader::{Library, Linked, Permutation, Reflected};
use crate::{Gpu, GpuError, GroupLayout};

/// A linked shader on the device.
#[derive(Debug)]
pub(crate) struct Shader {
    label: String,
    bindings: Vec<Reflected>,
    workgroup: [u32; 3],
    entry_points: Vec<(naga::ShaderStage, String)>,
    // Pipeline-overridable constants: their names and what linking made of them.
    constants: Vec<(String, String)>,
    module: wgpu::ShaderModule,
}

impl Shader {
    /// Reads what it binds, and gives it to the device.
    pub(crate) fn new(gpu: &Gpu, linked: &Linked) -> Result<Self, GpuError> {
        let module = caught(gpu, || {
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(&linked.label),
                source: wgpu::ShaderSource::Wgsl(linked.wgsl.as_str().into()),
            })
        })?;
        Ok(Self {
            label: linked.label.clone(),
            bindings: linked.bindings()?,
            workgroup: linked.workgroup_size(),
            entry_points: linked.entry_points(),
            constants: linked.constants(),
            module,
        })
    }

    fn entry_point(&self, stage: naga::ShaderStage) -> Option<&str> {
        self.entry_points.iter().find(|(of, _)| *of == stage).map(|(_, name)| name.as_str())
    }

    /// Values of constants under their linked names.
    fn constants(&self, constants: &[(&str, f64)]) -> Result<Vec<(&str, f64)>, GpuError> {
        let find = |&(name, value): &(&str, f64)| {
            let known = self.constants.iter().find(|(own, _)| own == name);
            let (_, linked) = known.ok_or_else(|| GpuError::Shader {
                name: self.label.clone(),
                message: format!("there is no pipeline-overridable constant {name}"),
            })?;
            Ok((linked.as_str(), value))
        };
        constants.iter().map(find).collect()
    }
}

/// What `make` makes, or the validation error that it caused: error scopes belong to a thread, and pipelines are made on
/// many, where the caller's scope does not reach.
fn caught<T>(gpu: &Gpu, make: impl FnOnce() -> T) -> Result<T, GpuError> {
    // A browser tells errors later than anyone here could wait for.
    if cfg!(target_arch = "wasm32") {
        return Ok(make());
    }
    let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let made = make();
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    match std::pin::pin!(scope.pop()).poll(&mut context) {
        std::task::Poll::Ready(Some(error)) => Err(GpuError::Device(error.to_string())),
        _ => Ok(made),
    }
}

/// A pipeline's bindings: which shared groups it uses, and what fills its own groups 2 (inputs) and 3 (outputs).
#[derive(Debug)]
pub(crate) struct Interface {
    pub(crate) label: String,
    pub(crate) shared: Vec<u32>,
    pub(crate) own: [Vec<Reflected>; 2],
    pub(crate) layouts: [Option<(u64, wgpu::BindGroupLayout)>; 2],
    pub(crate) workgroup: [u32; 3],
}

/// First group that belongs to the pass itself.
pub(crate) const FIRST_OWN_GROUP: u32 = 2;

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

impl GroupLayout {
    /// Holds a shader's use of a shared binding against the declaration.
    ///
    /// # Errors
    /// A sentence that says what differs.
    pub fn check(&self, used: &Reflected) -> Result<(), String> {
        let declared = self.entries.get(used.binding as usize);
        let Some((name, entry)) = declared else {
            return Err(format!(
                "{} is binding {} of group {}, which ends before",
                used.name, used.binding, self.index
            ));
        };
        let same_type = match (entry.ty, used.ty) {
            // A texture that a shader only loads from may be declared filterable.
            (
                wgpu::BindingType::Texture { view_dimension: a, multisampled: ma, sample_type: sa },
                wgpu::BindingType::Texture { view_dimension: b, multisampled: mb, sample_type: sb },
            ) => {
                let float = |s| matches!(s, wgpu::TextureSampleType::Float { .. });
                a == b
                    && ma == mb
                    && (sa == sb || (float(sa) && sb == wgpu::TextureSampleType::Float { filterable: false }))
            }
            (a, b) => a == b,
        };
        if *name != used.name || !same_type || !entry.visibility.contains(used.visibility) {
            return Err(format!(
                "group {} binding {} is declared {name}: {:?} for {:?}, but the shader has {}: {:?} for {:?}",
                self.index, used.binding, entry.ty, entry.visibility, used.name, used.ty, used.visibility
            ));
        }
        Ok(())
    }
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
        let raw = caught(gpu, || {
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
        let raw = caught(gpu, || gpu.device.create_render_pipeline(&descriptor))?;
        Ok(Self { raw, interface: Arc::new(interface) })
    }
}
