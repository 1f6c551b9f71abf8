//! Textures and buffers alike: held, or known without being kept alive.

use std::sync::Weak;

use crate::resource::{Binding, Buffer, BufferInner, Life, Texture, TextureInner};

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

/// A handle that keeps nothing alive.
#[derive(Clone, Debug)]
pub(crate) enum WeakHandle {
    Texture(Weak<TextureInner>),
    Buffer(Weak<BufferInner>),
}

impl WeakHandle {
    pub(crate) fn upgrade(&self) -> Option<Handle> {
        Some(match self {
            Self::Texture(texture) => Handle::Texture(Texture::from_inner(texture.upgrade()?)),
            Self::Buffer(buffer) => Handle::Buffer(Buffer::from_inner(buffer.upgrade()?)),
        })
    }

    /// The technique that writes it, once one did.
    pub(crate) fn home(&self) -> Option<&'static str> {
        match self {
            Self::Texture(texture) => texture.upgrade()?.home.get().copied(),
            Self::Buffer(buffer) => buffer.upgrade()?.home.get().copied(),
        }
    }

    pub(crate) fn set_home(&self, technique: &'static str) {
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
    pub(crate) life: Life,
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
