//! A linked shader on the device.

use super::reflect::{Linked, Reflected};
use crate::Gpu;
use crate::error::{GpuError, caught};

/// A linked shader on the device.
#[derive(Debug)]
pub(crate) struct Shader {
    pub(crate) label: String,
    pub(crate) bindings: Vec<Reflected>,
    pub(crate) workgroup: [u32; 3],
    entry_points: Vec<(naga::ShaderStage, String)>,
    // Pipeline-overridable constants: their names and what linking made of them.
    constants: Vec<(String, String)>,
    pub(crate) module: wgpu::ShaderModule,
}

impl Shader {
    /// Reads what it binds, and gives it to the device.
    pub(crate) fn new(gpu: &Gpu, linked: &Linked) -> Result<Self, GpuError> {
        let module = caught(&gpu.device, || {
            let descriptor = wgpu::ShaderModuleDescriptor {
                label: Some(&linked.label),
                source: wgpu::ShaderSource::Wgsl(linked.wgsl.as_str().into()),
            };
            let mut checks = wgpu::ShaderRuntimeChecks::checked();
            checks.force_loop_bounding = false;
            // SAFETY: all bounds are checked as ever, but for one thing: that loops end, which they do. Shaders are this
            // workspace's own, and every loop counts to a number or goes down a tree or a stack of finite depth.
            #[allow(unsafe_code)]
            unsafe {
                gpu.device.create_shader_module_trusted(descriptor, checks)
            }
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

    pub(crate) fn entry_point(&self, stage: naga::ShaderStage) -> Option<&str> {
        self.entry_points.iter().find(|(of, _)| *of == stage).map(|(_, name)| name.as_str())
    }

    /// Values of constants under their linked names.
    pub(crate) fn constants(&self, constants: &[(&str, f64)]) -> Result<Vec<(&str, f64)>, GpuError> {
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
