//! What a frame leaves behind: every texture and buffer that its passes touched, by `technique/name`.
//!
//! The log holds weak handles: looking at a resource is possible as long as its owner keeps it, and a texture that is
//! dropped goes back to its pool at once.

use std::fmt;

use crate::handle::{Bound, Handle};
use crate::hint::{Mapping, ViewHint};

/// A resource's name in a frame: `technique/name`, and `technique/name.2` for the second that has the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ResourceName {
    /// The part before the `/` of the passes that write it; of uploaded data, of the first that reads it.
    pub technique: &'static str,
    /// The name it was made with.
    pub name: &'static str,
    /// From 1 on.
    pub number: u32,
}

impl fmt::Display for ResourceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.technique, self.name)?;
        if self.number > 1 { write!(f, ".{}", self.number) } else { Ok(()) }
    }
}

/// A texture or buffer of a frame.
#[derive(Clone, Debug)]
pub struct Resource {
    /// Its name.
    pub name: ResourceName,
    /// The thing itself.
    pub handle: Handle,
}

impl Resource {
    /// How to look at it: what its maker says, else what follows from the format.
    pub fn hint(&self) -> ViewHint {
        match &self.handle {
            Handle::Buffer(buffer) => buffer
                .hint()
                .unwrap_or(ViewHint::new("Words, row after row, a colour for each value", Mapping::Number)),
            Handle::Texture(texture) => texture.hint().unwrap_or_else(|| by_format(texture.options().format)),
        }
    }
}

/// Size and format in words.
impl fmt::Display for Resource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.handle {
            Handle::Buffer(buffer) => write!(f, "{} bytes", buffer.raw().size()),
            Handle::Texture(texture) => {
                let o = texture.options();
                write!(f, "{}×{}", o.width, o.height)?;
                if let Some(layers) = o.layers {
                    write!(f, "×{layers}")?;
                }
                write!(f, " {:?}", o.format)?;
                if o.mips > 1 {
                    write!(f, ", {} mips", o.mips)?;
                }
                if o.samples > 1 { write!(f, ", {} samples", o.samples) } else { Ok(()) }
            }
        }
    }
}

fn by_format(format: wgpu::TextureFormat) -> ViewHint {
    use wgpu::TextureSampleType as T;
    if format.has_depth_aspect() {
        return ViewHint::new("Depth, reversed: white is near", Mapping::Depth);
    }
    match format.sample_type(None, None) {
        Some(T::Uint | T::Sint) => ViewHint::new("A colour for each whole number", Mapping::Number),
        _ if format.block_copy_size(None) == Some(u32::from(format.components())) => {
            ViewHint::new("Values from 0 to 1", Mapping::Color)
        }
        _ => ViewHint::new("Any numbers: grey is 0, white infinity", Mapping::Range),
    }
}

/// The resources of a frame, in the order in which passes first touched them.
#[derive(Debug, Default)]
pub(crate) struct Resources(Vec<(Bound, ResourceName)>);

impl Resources {
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Notes that a pass read or wrote it.
    pub(crate) fn touch(&mut self, pass: &'static str, bound: &Bound, writes: bool) {
        let technique = pass.split_once('/').map_or(pass, |(technique, _)| technique);
        let known = self.0.iter().position(|(other, _)| other.id == bound.id);
        if known.is_some() && !writes {
            return;
        }
        if writes {
            bound.handle.set_home(technique);
        }
        let technique = bound.handle.home().unwrap_or(technique);
        let before = &self.0[..known.unwrap_or(self.0.len())];
        let same = |(_, n): &&(Bound, ResourceName)| n.technique == technique && n.name == bound.name;
        let number = 1 + before.iter().filter(same).count() as u32;
        let name = ResourceName { technique, name: bound.name, number };
        match known {
            Some(index) if self.0[index].1.technique != technique => self.0[index].1 = name,
            Some(_) => {}
            None => self.0.push((bound.clone(), name)),
        }
    }

    /// Those that still exist.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Resource> + '_ {
        self.0
            .iter()
            .filter_map(|(bound, name)| Some(Resource { name: *name, handle: bound.handle.upgrade()? }))
    }
}
