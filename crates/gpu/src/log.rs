//! What a frame leaves behind: every texture and buffer that its passes touched, by `technique/name`.
//!
//! The log holds weak handles: looking at a resource is possible as long as its owner keeps it, and a texture that is
//! dropped goes back to its pool at once.

use std::fmt;
use std::sync::Weak;

use crate::resource::{Binding, BufferInner, TextureInner};
use crate::{Buffer, Texture};

/// How values become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Nits, exposed like the picture.
    Exposed,
    /// Linear colours, 0..1.
    Color,
    /// −1..1 around grey, such as normals.
    Signed,
    /// A distance: white is near, half as bright at 1.
    Distance,
    /// Reversed depth of a camera: white is near.
    Depth,
    /// A colour for each whole number, black for 0.
    Number,
    /// Depth of shadow views, one a layer: white is near the light.
    ShadowDepth,
    /// 0..1 from black over blue, red and yellow to white.
    Heat,
    /// Any number around grey: x / (1 + |x|).
    Range,
}

/// What values are multiplied by before they are mapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// This.
    By(f32),
    /// This over the scene's size in metres.
    OfScene(f32),
    /// What makes nits of stored radiance.
    Nits,
}

/// How to look at a resource, declared beside where it is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewHint {
    /// What its values and colours mean.
    pub about: &'static str,
    /// How values become colours.
    pub mapping: Mapping,
    /// What they are multiplied by before.
    pub scale: Scale,
}

impl ViewHint {
    /// Values as they are.
    pub const fn new(about: &'static str, mapping: Mapping) -> Self {
        Self::scaled(about, mapping, Scale::By(1.0))
    }

    /// The same with a scale.
    pub const fn scaled(about: &'static str, mapping: Mapping, scale: Scale) -> Self {
        Self { about, mapping, scale }
    }
}

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

/// A texture or a buffer.
#[derive(Clone, Debug)]
pub enum Handle {
    /// A texture.
    Texture(Texture),
    /// A buffer.
    Buffer(Buffer),
}

impl Handle {
    pub(crate) fn of(binding: Binding<'_>) -> Option<Self> {
        match binding {
            Binding::Texture(texture) | Binding::Mip(texture, _) => Some(Self::Texture(texture.clone())),
            Binding::Buffer(buffer) | Binding::BufferRange(buffer, ..) => Some(Self::Buffer(buffer.clone())),
            Binding::Sampler(_) => None,
        }
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

/// A handle that keeps nothing alive.
#[derive(Clone, Debug)]
pub(crate) enum WeakHandle {
    Texture(Weak<TextureInner>),
    Buffer(Weak<BufferInner>),
}

impl WeakHandle {
    fn upgrade(&self) -> Option<Handle> {
        Some(match self {
            Self::Texture(texture) => Handle::Texture(Texture::from_inner(texture.upgrade()?)),
            Self::Buffer(buffer) => Handle::Buffer(Buffer::from_inner(buffer.upgrade()?)),
        })
    }

    /// The technique that writes it, once one did.
    fn home(&self) -> Option<&'static str> {
        match self {
            Self::Texture(texture) => texture.upgrade()?.home.get().copied(),
            Self::Buffer(buffer) => buffer.upgrade()?.home.get().copied(),
        }
    }

    fn set_home(&self, technique: &'static str) {
        // The first to write it stays its home.
        match self {
            Self::Texture(texture) => _ = texture.upgrade().map(|inner| inner.home.set(technique)),
            Self::Buffer(buffer) => _ = buffer.upgrade().map(|inner| inner.home.set(technique)),
        }
    }
}

/// What a pass binds, as the log keeps it.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    pub(crate) id: u64,
    pub(crate) name: &'static str,
    pub(crate) life: crate::Life,
    pub(crate) handle: WeakHandle,
}

impl Bound {
    pub(crate) fn of(binding: Binding<'_>) -> Option<Self> {
        match binding {
            Binding::Texture(texture) | Binding::Mip(texture, _) => Some(Self::texture(texture)),
            Binding::Buffer(buffer) | Binding::BufferRange(buffer, ..) => Some(Self {
                id: buffer.id(),
                name: buffer.name(),
                life: buffer.life(),
                handle: WeakHandle::Buffer(buffer.weak()),
            }),
            Binding::Sampler(_) => None,
        }
    }

    pub(crate) fn texture(texture: &Texture) -> Self {
        let handle = WeakHandle::Texture(texture.weak());
        Self { id: texture.id(), name: texture.name(), life: texture.life(), handle }
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
