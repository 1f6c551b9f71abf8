//! Bind groups that many pipelines share.

use std::sync::Arc;

use crate::Gpu;
use crate::handle::{Bound, Handle};
use crate::resource::Binding;
use crate::shader::Reflected;

/// First group that belongs to the pass itself.
pub(crate) const FIRST_OWN_GROUP: u32 = 2;

/// The layout of a bind group that many pipelines share (0 the frame, 1 the scene): entries by WESL name.
#[derive(Clone, Debug)]
pub struct GroupLayout {
    pub(crate) index: u32,
    pub(crate) entries: Arc<Vec<(&'static str, wgpu::BindGroupLayoutEntry)>>,
    pub(crate) layout: wgpu::BindGroupLayout,
}

impl GroupLayout {
    /// Declares group `index`; bindings are numbered in order.
    pub fn new(
        gpu: &Gpu,
        index: u32,
        entries: &[(&'static str, wgpu::ShaderStages, wgpu::BindingType)],
    ) -> Self {
        let entries: Vec<_> = (0u32..)
            .zip(entries)
            .map(|(binding, &(name, visibility, ty))| {
                (name, wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None })
            })
            .collect();
        let plain: Vec<_> = entries.iter().map(|(_, entry)| *entry).collect();
        let layout = gpu
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &plain });
        Self { index, entries: Arc::new(entries), layout }
    }

    /// How many bindings it declares.
    pub fn binding_count(&self) -> usize {
        self.entries.len()
    }

    /// Fills the group; `bindings` in the order of the declaration.
    ///
    /// # Panics
    /// When the numbers of entries and bindings differ.
    pub fn group(&self, gpu: &Gpu, bindings: &[Binding<'_>]) -> Group {
        assert_eq!(
            bindings.len(),
            self.entries.len(),
            "group {} filled with another number of bindings",
            self.index
        );
        gpu.created.add();
        let entries: Vec<_> = (0u32..)
            .zip(bindings)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.resource() })
            .collect();
        let raw = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &entries,
        });
        let reads = self.entries.iter().zip(bindings);
        let reads = reads.filter_map(|((name, _), b)| Some((*name, Bound::of(*b)?))).collect();
        let held = bindings.iter().filter_map(|binding| Handle::of(*binding)).collect();
        Group { index: self.index, raw, reads, held }
    }

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

/// A filled shared bind group.
#[derive(Clone, Debug)]
pub struct Group {
    pub(crate) index: u32,
    pub(crate) raw: wgpu::BindGroup,
    pub(crate) reads: Vec<(&'static str, Bound)>,
    // What nobody else holds is kept by the bind group, and can be looked at as long.
    held: Vec<Handle>,
}

impl Group {
    /// The texture or buffer that a shader knows by this name.
    pub fn handle(&self, name: &str) -> Option<&Handle> {
        let place = self.reads.iter().position(|(known, _)| *known == name)?;
        self.held.get(place)
    }
}
