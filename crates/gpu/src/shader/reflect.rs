//! What a linked shader binds, read from naga.

use std::collections::{BTreeMap, HashSet};

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::mangle::unmangled;
use crate::GpuError;

/// A validated shader.
#[derive(Debug)]
pub struct Linked {
    /// The entry file with its flags.
    pub label: String,
    /// The whole text.
    pub wgsl: String,
    /// naga's view of it.
    pub module: naga::Module,
    info: naga::valid::ModuleInfo,
}

/// One binding of a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reflected {
    /// The WESL global's name.
    pub name: String,
    /// Group.
    pub group: u32,
    /// Binding within the group.
    pub binding: u32,
    /// Stages that use it.
    pub visibility: wgpu::ShaderStages,
    /// Type as a layout states it.
    pub ty: wgpu::BindingType,
    /// Whether the shader may write to it.
    pub written: bool,
}

impl Linked {
    /// `place` finds where in the modules a line of the linked text comes from.
    pub(super) fn validate(
        label: String,
        wgsl: String,
        place: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, GpuError> {
        let fail = |message: String| GpuError::Shader { name: label.clone(), message };
        let fail_at = |message: String, at: Option<naga::SourceLocation>| {
            let line = at.and_then(|at| wgsl.lines().nth(at.line_number.saturating_sub(1) as usize));
            let place = line.and_then(&place).map_or_else(String::new, |place| format!("{place}: "));
            fail(format!("{place}{message}"))
        };
        let module = naga::front::wgsl::parse_str(&wgsl)
            .map_err(|e| fail_at(e.emit_to_string(&wgsl), e.location(&wgsl)))?;
        // Linking keeps every entry point of every module that it loads.
        let mut stages: Vec<_> = module.entry_points.iter().map(|entry| entry.stage as u32).collect();
        stages.sort_unstable();
        if stages.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(fail("two entry points of one stage: an entry file must not be imported".into()));
        }
        // Packing half floats is WebGPU's core; some OpenGL versions lack it.
        let capabilities =
            Capabilities::default() | Capabilities::PRIMITIVE_INDEX | Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|e| {
            // Of the function, the statement and the expression, the expression.
            let spans = e.spans().filter_map(|(span, _)| Some((span.to_range()?.len(), span)));
            let narrowest = spans.min_by_key(|(length, _)| *length);
            fail_at(e.emit_to_string(&wgsl), narrowest.map(|(_, span)| span.location(&wgsl)))
        })?;
        Ok(Self { label, wgsl, module, info })
    }

    /// All bindings of all entry points, by group and binding.
    ///
    /// # Errors
    /// When a binding has a kind that chiaro does not use.
    pub fn bindings(&self) -> Result<Vec<Reflected>, GpuError> {
        let gathered = self.only_gathered();
        let mut found = Vec::new();
        for (handle, global) in self.module.global_variables.iter() {
            let Some(at) = global.binding else { continue };
            let name = unmangled(global.name.as_deref().unwrap_or_default()).to_owned();
            let mut visibility = wgpu::ShaderStages::empty();
            let mut filtered = false;
            let mut gathers = false;
            for (index, entry) in self.module.entry_points.iter().enumerate() {
                let info = self.info.get_entry_point(index);
                if !info[handle].is_empty() {
                    visibility |= stage(entry.stage);
                }
                // A texture sampled through a comparison sampler is a depth texture, whose layout says no filter.
                filtered |= info.sampling_set.iter().any(|key| key.image == handle);
                let unfiltered = |image| self.is_depth(image) || gathered.contains(&image);
                gathers |= info.sampling_set.iter().any(|key| key.sampler == handle && unfiltered(key.image));
            }
            if visibility.is_empty() {
                // An import may declare more than the entry points use.
                continue;
            }
            let plain_sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
            let ty = self.binding_type(global, filtered && !gathered.contains(&handle));
            // Depth cannot be filtered without a comparison, and 32-bit floats only with an optional feature.
            let ty = match ty {
                Some(ty) if ty == plain_sampler && gathers => {
                    Some(wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering))
                }
                ty => ty,
            };
            let ty = ty.ok_or_else(|| GpuError::Shader {
                name: self.label.clone(),
                message: format!("binding {name} has a type that no bind group layout is known for"),
            })?;
            let written = matches!(
                ty,
                wgpu::BindingType::Buffer { ty: wgpu::BufferBindingType::Storage { read_only: false }, .. }
                    | wgpu::BindingType::StorageTexture { .. }
            );
            found.push(Reflected { name, group: at.group, binding: at.binding, visibility, ty, written });
        }
        found.sort_by_key(|b| (b.group, b.binding));
        Ok(found)
    }

    /// Members of the structs that buffers hold, as (struct, member), and whether some function uses them by name or
    /// makes such a struct.
    pub fn members(&self) -> BTreeMap<(String, String), bool> {
        let types = &self.module.types;
        let members = |ty: naga::Handle<naga::Type>| match &types[ty].inner {
            naga::TypeInner::Struct { members, .. } => members.as_slice(),
            _ => &[],
        };
        let named = |ty: naga::Handle<naga::Type>, index: usize| {
            let name = |name: &Option<String>| unmangled(name.as_deref().unwrap_or_default()).to_owned();
            Some((name(&types[ty].name), name(&members(ty).get(index)?.name)))
        };
        let mut found = BTreeMap::new();
        let buffers = self.module.global_variables.iter().filter(|(_, global)| global.binding.is_some());
        let mut held: Vec<_> = buffers.map(|(_, global)| global.ty).collect();
        while let Some(ty) = held.pop() {
            if let naga::TypeInner::Array { base, .. } = types[ty].inner {
                held.push(base);
            }
            held.extend(members(ty).iter().map(|member| member.ty));
            found.extend((0..members(ty).len()).filter_map(|index| Some((named(ty, index)?, false))));
        }
        let functions = self.module.functions.iter().map(|(handle, function)| (function, &self.info[handle]));
        let entries = self.module.entry_points.iter().enumerate();
        let entries = entries.map(|(index, entry)| (&entry.function, self.info.get_entry_point(index)));
        for (function, info) in functions.chain(entries) {
            for (_, expression) in function.expressions.iter() {
                let (base, index) = match *expression {
                    naga::Expression::AccessIndex { base, index } => (base, index),
                    naga::Expression::Compose { ty, .. } => {
                        let made = (0..members(ty).len()).filter_map(|index| named(ty, index));
                        made.for_each(|name| {
                            found.entry(name).and_modify(|used| *used = true);
                        });
                        continue;
                    }
                    _ => continue,
                };
                let ty = match info[base].ty {
                    naga::proc::TypeResolution::Handle(ty) => ty,
                    naga::proc::TypeResolution::Value(naga::TypeInner::Pointer { base, .. }) => base,
                    naga::proc::TypeResolution::Value(_) => continue,
                };
                let ty = if let naga::TypeInner::Pointer { base, .. } = types[ty].inner { base } else { ty };
                if let Some(used) = named(ty, index as usize).and_then(|name| found.get_mut(&name)) {
                    *used = true;
                }
            }
        }
        found
    }

    /// The entry points by stage.
    pub(crate) fn entry_points(&self) -> Vec<(naga::ShaderStage, String)> {
        self.module.entry_points.iter().map(|entry| (entry.stage, entry.name.clone())).collect()
    }

    /// The pipeline-overridable constants: their names, and the linked ones, which imports change.
    pub(crate) fn constants(&self) -> Vec<(String, String)> {
        let names = self.module.overrides.iter().filter_map(|(_, constant)| constant.name.clone());
        names.map(|linked| (unmangled(&linked).to_owned(), linked)).collect()
    }

    /// Bytes of a workgroup's own memory.
    pub fn workgroup_bytes(&self) -> u32 {
        let globals = self.module.global_variables.iter().map(|(_, global)| global);
        let shared = globals.filter(|global| global.space == naga::AddressSpace::WorkGroup);
        shared.map(|global| self.module.types[global.ty].inner.size(self.module.to_ctx())).sum()
    }

    /// Workgroup size of the compute entry point.
    pub fn workgroup_size(&self) -> [u32; 3] {
        let compute = self.module.entry_points.iter().find(|e| e.stage == naga::ShaderStage::Compute);
        compute.map_or([1; 3], |e| e.workgroup_size)
    }

    fn is_depth(&self, image: naga::Handle<naga::GlobalVariable>) -> bool {
        let ty = &self.module.types[self.module.global_variables[image].ty].inner;
        matches!(ty, naga::TypeInner::Image { class: naga::ImageClass::Depth { .. }, .. })
    }

    /// Textures whose texels are fetched by fours and never filtered.
    fn only_gathered(&self) -> HashSet<naga::Handle<naga::GlobalVariable>> {
        let (mut gathered, mut sampled) = (HashSet::new(), HashSet::new());
        let entries = self.module.entry_points.iter().map(|e| &e.function);
        for function in self.module.functions.iter().map(|(_, f)| f).chain(entries) {
            for (_, expression) in function.expressions.iter() {
                if let naga::Expression::ImageSample { image, gather, .. } = expression
                    && let naga::Expression::GlobalVariable(texture) = function.expressions[*image]
                {
                    if gather.is_some() { &mut gathered } else { &mut sampled }.insert(texture);
                }
            }
        }
        &gathered - &sampled
    }

    fn binding_type(&self, global: &naga::GlobalVariable, filtered: bool) -> Option<wgpu::BindingType> {
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        match global.space {
            naga::AddressSpace::Uniform => return Some(buffer(wgpu::BufferBindingType::Uniform)),
            naga::AddressSpace::Storage { access } => {
                let read_only = !access.contains(naga::StorageAccess::STORE);
                return Some(buffer(wgpu::BufferBindingType::Storage { read_only }));
            }
            naga::AddressSpace::Handle => {}
            _ => return None,
        }
        match self.module.types[global.ty].inner {
            naga::TypeInner::Sampler { comparison } => Some(wgpu::BindingType::Sampler(if comparison {
                wgpu::SamplerBindingType::Comparison
            } else {
                wgpu::SamplerBindingType::Filtering
            })),
            naga::TypeInner::Image { dim, arrayed, class } => {
                let view_dimension = view_dimension(dim, arrayed)?;
                Some(match class {
                    naga::ImageClass::Sampled { kind, multi } => wgpu::BindingType::Texture {
                        sample_type: match kind {
                            naga::ScalarKind::Float => {
                                wgpu::TextureSampleType::Float { filterable: filtered && !multi }
                            }
                            naga::ScalarKind::Uint => wgpu::TextureSampleType::Uint,
                            naga::ScalarKind::Sint => wgpu::TextureSampleType::Sint,
                            _ => return None,
                        },
                        view_dimension,
                        multisampled: multi,
                    },
                    naga::ImageClass::Depth { multi } => wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Depth,
                        view_dimension,
                        multisampled: multi,
                    },
                    naga::ImageClass::Storage { format, access } => wgpu::BindingType::StorageTexture {
                        access: if access.contains(naga::StorageAccess::LOAD) {
                            if access.contains(naga::StorageAccess::STORE) {
                                wgpu::StorageTextureAccess::ReadWrite
                            } else {
                                wgpu::StorageTextureAccess::ReadOnly
                            }
                        } else {
                            wgpu::StorageTextureAccess::WriteOnly
                        },
                        format: storage_format(format)?,
                        view_dimension,
                    },
                    naga::ImageClass::External => return None,
                })
            }
            _ => None,
        }
    }
}

fn stage(stage: naga::ShaderStage) -> wgpu::ShaderStages {
    match stage {
        naga::ShaderStage::Vertex => wgpu::ShaderStages::VERTEX,
        naga::ShaderStage::Fragment => wgpu::ShaderStages::FRAGMENT,
        _ => wgpu::ShaderStages::COMPUTE,
    }
}

fn view_dimension(dim: naga::ImageDimension, arrayed: bool) -> Option<wgpu::TextureViewDimension> {
    Some(match (dim, arrayed) {
        (naga::ImageDimension::D2, false) => wgpu::TextureViewDimension::D2,
        (naga::ImageDimension::D2, true) => wgpu::TextureViewDimension::D2Array,
        (naga::ImageDimension::Cube, false) => wgpu::TextureViewDimension::Cube,
        (naga::ImageDimension::Cube, true) => wgpu::TextureViewDimension::CubeArray,
        (naga::ImageDimension::D3, false) => wgpu::TextureViewDimension::D3,
        _ => return None,
    })
}

/// The storage formats that WebGPU guarantees for writing.
fn storage_format(format: naga::StorageFormat) -> Option<wgpu::TextureFormat> {
    use naga::StorageFormat as N;
    use wgpu::TextureFormat as W;
    Some(match format {
        N::Rgba8Unorm => W::Rgba8Unorm,
        N::Rgba8Snorm => W::Rgba8Snorm,
        N::Rgba8Uint => W::Rgba8Uint,
        N::Rgba8Sint => W::Rgba8Sint,
        N::Rgba16Uint => W::Rgba16Uint,
        N::Rgba16Sint => W::Rgba16Sint,
        N::Rgba16Float => W::Rgba16Float,
        N::R32Uint => W::R32Uint,
        N::R32Sint => W::R32Sint,
        N::R32Float => W::R32Float,
        N::Rg32Uint => W::Rg32Uint,
        N::Rg32Sint => W::Rg32Sint,
        N::Rg32Float => W::Rg32Float,
        N::Rgba32Uint => W::Rgba32Uint,
        N::Rgba32Sint => W::Rgba32Sint,
        N::Rgba32Float => W::Rgba32Float,
        _ => return None,
    })
}
