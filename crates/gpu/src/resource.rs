//! Textures and buffers with an identity.
//!
//! wgpu's own handles have no comparable identity across clones that a cache could use cheaply, so each handle here
//! carries a number. A bind group is then known by its layout and the numbers in it, made once and found again.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use crate::Gpu;
use crate::hint::ViewHint;

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

pub(crate) fn next_id() -> u64 {
    NEXT_ID.fetch_add(1, Ordering::Relaxed)
}

/// How long a resource's content lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// Until the frame ends: reading it before this frame wrote it is a bug.
    Frame,
    /// From frame to frame: uploaded data, history, caches.
    Kept,
}

/// What a texture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureOptions {
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// Array layers; `None` makes a plain 2D texture, `Some(1)` an array of one.
    pub layers: Option<u32>,
    /// Whether the layers are the six faces of a cube: +X, −X, +Y, −Y, +Z, −Z.
    pub cube: bool,
    /// Mip levels.
    pub mips: u32,
    /// Samples per texel.
    pub samples: u32,
    /// Texel format.
    pub format: wgpu::TextureFormat,
    /// wgpu's usages.
    pub usage: wgpu::TextureUsages,
}

impl TextureOptions {
    /// A plain texture of one mip and one sample.
    pub fn new(width: u32, height: u32, format: wgpu::TextureFormat, usage: wgpu::TextureUsages) -> Self {
        Self { width, height, layers: None, cube: false, mips: 1, samples: 1, format, usage }
    }

    /// The same as an array of `layers`.
    #[must_use]
    pub fn array(self, layers: u32) -> Self {
        Self { layers: Some(layers), ..self }
    }

    /// A cube of square faces.
    #[must_use]
    pub fn cube(side: u32, mips: u32, format: wgpu::TextureFormat, usage: wgpu::TextureUsages) -> Self {
        Self { layers: Some(6), cube: true, mips, ..Self::new(side, side, format, usage) }
    }
}

#[derive(Debug)]
pub(crate) struct TextureInner {
    id: u64,
    alive: Arc<()>,
    name: &'static str,
    life: Life,
    options: TextureOptions,
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    layer_views: Vec<wgpu::TextureView>,
    mip_views: Vec<wgpu::TextureView>,
    hint: OnceLock<ViewHint>,
    pub(crate) home: OnceLock<&'static str>,
    pool: Option<Arc<Mutex<PoolShelf>>>,
}

/// A texture and its views.
#[derive(Clone, Debug)]
pub struct Texture(Arc<TextureInner>);

impl Texture {
    /// Makes a texture.
    pub fn new(gpu: &Gpu, name: &'static str, life: Life, options: TextureOptions) -> Self {
        Self::with(name, life, options, create(gpu, name, &options), None)
    }

    fn with(
        name: &'static str,
        life: Life,
        options: TextureOptions,
        texture: wgpu::Texture,
        pool: Option<Arc<Mutex<PoolShelf>>>,
    ) -> Self {
        let flat = if options.layers.is_some() {
            wgpu::TextureViewDimension::D2Array
        } else {
            wgpu::TextureViewDimension::D2
        };
        let dimension = if options.cube { wgpu::TextureViewDimension::Cube } else { flat };
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(dimension),
            array_layer_count: options.layers.is_none().then_some(1),
            ..Default::default()
        });
        let attachable = options.usage.contains(wgpu::TextureUsages::RENDER_ATTACHMENT);
        let layers = if attachable { options.layers.unwrap_or(1) } else { 0 };
        let layer_views = (0..layers)
            .map(|layer| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    dimension: Some(wgpu::TextureViewDimension::D2),
                    base_array_layer: layer,
                    array_layer_count: Some(1),
                    mip_level_count: Some(1),
                    ..Default::default()
                })
            })
            .collect();
        let written = options.usage.contains(wgpu::TextureUsages::STORAGE_BINDING);
        // A cube's faces are looked at as layers.
        let single_mips = options.cube || written && options.mips > 1;
        let mip_views = (0..if single_mips { options.mips } else { 0 })
            .map(|mip| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    dimension: Some(flat),
                    base_mip_level: mip,
                    mip_level_count: Some(1),
                    ..Default::default()
                })
            })
            .collect();
        Self(Arc::new(TextureInner {
            id: next_id(),
            alive: Arc::default(),
            name,
            life,
            options,
            texture,
            view,
            layer_views,
            mip_views,
            hint: OnceLock::new(),
            home: OnceLock::new(),
            pool,
        }))
    }

    /// An array's first layer as a plain texture, for what reads no arrays.
    #[must_use]
    pub fn first_layer(&self, name: &'static str) -> Self {
        let options = TextureOptions { layers: None, ..*self.options() };
        Self::with(name, self.life(), options, self.raw().clone(), None)
    }

    /// A host program's texture as an attachment: one layer's first mip, through a view of the host's in this format.
    pub fn of_host(name: &'static str, view: &wgpu::TextureView, format: wgpu::TextureFormat) -> Self {
        Self::hosted((name, Life::Frame), view, format)
    }

    /// A host program's texture as shaders read it, through a view of the host's: what is in it, the host has drawn before.
    pub fn read_of_host(name: &'static str, view: &wgpu::TextureView) -> Self {
        Self::hosted((name, Life::Kept), view, view.texture().format())
    }

    fn hosted(
        (name, life): (&'static str, Life),
        view: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Self {
        let texture = view.texture();
        let options = TextureOptions::new(texture.width(), texture.height(), format, texture.usage());
        Self(Arc::new(TextureInner {
            id: next_id(),
            alive: Arc::default(),
            name,
            life,
            options,
            texture: texture.clone(),
            view: view.clone(),
            layer_views: vec![view.clone()],
            mip_views: Vec::new(),
            hint: OnceLock::new(),
            home: OnceLock::new(),
            pool: None,
        }))
    }

    /// The same texture, and how to look at it. The first hint counts.
    #[must_use]
    pub fn described(self, hint: ViewHint) -> Self {
        let _ = self.0.hint.set(hint);
        self
    }
    /// How to look at it, where that was declared.
    pub fn hint(&self) -> Option<ViewHint> {
        self.0.hint.get().copied()
    }
    /// The name that logs and debug views show.
    pub fn name(&self) -> &'static str {
        self.0.name
    }
    /// How long its content lasts.
    pub fn life(&self) -> Life {
        self.0.life
    }
    /// Size, format and usage.
    pub fn options(&self) -> &TextureOptions {
        &self.0.options
    }
    /// wgpu's texture.
    pub fn raw(&self) -> &wgpu::Texture {
        &self.0.texture
    }
    /// All layers and mips.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.0.view
    }
    /// One layer's first mip, for attachments.
    ///
    /// # Panics
    /// When the texture is no render attachment or has no such layer.
    pub fn layer_view(&self, layer: u32) -> &wgpu::TextureView {
        &self.0.layer_views[layer as usize]
    }
    /// One mip of all layers, as an array and not as a cube: what shaders write.
    ///
    /// # Panics
    /// When the texture is neither a storage texture of several mips nor a cube, or has no such mip.
    pub fn mip_view(&self, mip: u32) -> &wgpu::TextureView {
        &self.0.mip_views[mip as usize]
    }
    /// Bytes of all mips, layers and samples.
    pub fn bytes(&self) -> u64 {
        let o = &self.0.options;
        let texel = u64::from(o.format.block_copy_size(None).unwrap_or(4));
        let texels: u64 = (0..o.mips)
            .map(|mip| u64::from((o.width >> mip).max(1)) * u64::from((o.height >> mip).max(1)))
            .sum();
        texels * texel * u64::from(o.layers.unwrap_or(1)) * u64::from(o.samples)
    }
    pub(crate) fn id(&self) -> u64 {
        self.0.id
    }
    pub(crate) fn weak(&self) -> Weak<TextureInner> {
        Arc::downgrade(&self.0)
    }
    pub(crate) fn from_inner(inner: Arc<TextureInner>) -> Self {
        Self(inner)
    }
}

/// Equal handles are handles of one texture.
impl PartialEq for Texture {
    fn eq(&self, other: &Self) -> bool {
        self.0.id == other.0.id
    }
}

impl Drop for TextureInner {
    fn drop(&mut self) {
        if let Some(pool) = &self.pool {
            let mut shelf = pool.lock().unwrap_or_else(PoisonError::into_inner);
            shelf.free.entry(self.options).or_default().push(self.texture.clone());
        }
    }
}

fn create(gpu: &Gpu, name: &'static str, options: &TextureOptions) -> wgpu::Texture {
    gpu.created.add();
    // Every texture can be looked at and, unless it is multisampled, read back.
    let copied =
        if options.samples > 1 { wgpu::TextureUsages::empty() } else { wgpu::TextureUsages::COPY_SRC };
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d {
            width: options.width,
            height: options.height,
            depth_or_array_layers: options.layers.unwrap_or(1),
        },
        mip_level_count: options.mips,
        sample_count: options.samples,
        dimension: wgpu::TextureDimension::D2,
        format: options.format,
        usage: options.usage | wgpu::TextureUsages::TEXTURE_BINDING | copied,
        view_formats: &[],
    })
}

#[derive(Debug, Default)]
struct PoolShelf {
    free: HashMap<TextureOptions, Vec<wgpu::Texture>>,
}

/// Lends textures: a handle that is dropped gives its memory to the next one of the same kind, so that switching
/// techniques or sizes back and forth allocates once.
#[derive(Clone, Debug, Default)]
pub struct TexturePool(Arc<Mutex<PoolShelf>>);

impl TexturePool {
    /// A texture of that kind, new or used.
    pub fn lend(&self, gpu: &Gpu, name: &'static str, life: Life, options: TextureOptions) -> Texture {
        let free = {
            let mut shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            shelf.free.get_mut(&options).and_then(Vec::pop)
        };
        let texture = free.unwrap_or_else(|| create(gpu, name, &options));
        Texture::with(name, life, options, texture, Some(self.0.clone()))
    }

    /// Frees what nobody holds.
    pub fn trim(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).free.clear();
    }
}

#[derive(Debug)]
pub(crate) struct BufferInner {
    id: u64,
    alive: Arc<()>,
    name: &'static str,
    life: Life,
    hint: OnceLock<ViewHint>,
    pub(crate) home: OnceLock<&'static str>,
    buffer: wgpu::Buffer,
}

/// A buffer.
#[derive(Clone, Debug)]
pub struct Buffer(Arc<BufferInner>);

impl Buffer {
    /// Makes a buffer of `size` bytes, zeroed; an array in it is as long for shaders as what was asked for.
    pub fn new(gpu: &Gpu, name: &'static str, life: Life, size: u64, usage: wgpu::BufferUsages) -> Self {
        gpu.created.add();
        // Bindings must not be empty, and copies move words of four bytes. More would be elements that nobody wrote.
        let size = if size == 0 { 16 } else { size.next_multiple_of(4) };
        // Every buffer can be looked at.
        let usage = usage | wgpu::BufferUsages::COPY_SRC;
        let descriptor = wgpu::BufferDescriptor { label: Some(name), size, usage, mapped_at_creation: false };
        let buffer = gpu.device.create_buffer(&descriptor);
        let (hint, home) = (OnceLock::new(), OnceLock::new());
        Self(Arc::new(BufferInner { id: next_id(), alive: Arc::default(), name, life, hint, home, buffer }))
    }

    /// Makes a kept buffer holding `data`.
    pub fn with_data<T: bytemuck::NoUninit>(
        gpu: &Gpu,
        name: &'static str,
        data: &[T],
        usage: wgpu::BufferUsages,
    ) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        // An empty array still binds as one element.
        let size = bytes.len().max(size_of::<T>()) as u64;
        let buffer = Self::new(gpu, name, Life::Kept, size, usage | wgpu::BufferUsages::COPY_DST);
        if !bytes.is_empty() {
            gpu.queue.write_buffer(buffer.raw(), 0, bytes);
        }
        buffer
    }

    /// The same buffer, and how to look at it. The first hint counts.
    #[must_use]
    pub fn described(self, hint: ViewHint) -> Self {
        let _ = self.0.hint.set(hint);
        self
    }
    /// How to look at it, where that was declared.
    pub fn hint(&self) -> Option<ViewHint> {
        self.0.hint.get().copied()
    }
    /// The name that logs show.
    pub fn name(&self) -> &'static str {
        self.0.name
    }
    /// How long its content lasts.
    pub fn life(&self) -> Life {
        self.0.life
    }
    /// wgpu's buffer.
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.0.buffer
    }
    pub(crate) fn id(&self) -> u64 {
        self.0.id
    }
    pub(crate) fn weak(&self) -> Weak<BufferInner> {
        Arc::downgrade(&self.0)
    }
    pub(crate) fn from_inner(inner: Arc<BufferInner>) -> Self {
        Self(inner)
    }
}

/// A resource as a shader sees it.
#[derive(Clone, Copy, Debug)]
pub enum Binding<'a> {
    /// All of a texture.
    Texture(&'a Texture),
    /// One mip of a texture, all layers; see [`Texture::mip_view`].
    Mip(&'a Texture, u32),
    /// All of a buffer.
    Buffer(&'a Buffer),
    /// A part of a buffer: offset and size in bytes.
    BufferRange(&'a Buffer, u64, u64),
    /// A sampler.
    Sampler(&'a wgpu::Sampler),
}

impl<'a> From<&'a Texture> for Binding<'a> {
    fn from(texture: &'a Texture) -> Self {
        Self::Texture(texture)
    }
}
impl<'a> From<&'a Buffer> for Binding<'a> {
    fn from(buffer: &'a Buffer) -> Self {
        Self::Buffer(buffer)
    }
}
impl<'a> From<&'a wgpu::Sampler> for Binding<'a> {
    fn from(sampler: &'a wgpu::Sampler) -> Self {
        Self::Sampler(sampler)
    }
}

impl<'a> Binding<'a> {
    /// As wgpu binds it.
    pub fn resource(self) -> wgpu::BindingResource<'a> {
        match self {
            Self::Texture(texture) => wgpu::BindingResource::TextureView(texture.view()),
            Self::Mip(texture, mip) => wgpu::BindingResource::TextureView(texture.mip_view(mip)),
            Self::Buffer(buffer) => buffer.raw().as_entire_binding(),
            Self::BufferRange(buffer, offset, size) => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: buffer.raw(),
                offset,
                size: std::num::NonZeroU64::new(size),
            }),
            Self::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }

    /// Identity for the bind group cache; samplers of a pass never change, so they need none.
    pub(crate) fn key(self) -> [u64; 3] {
        match self {
            Self::Texture(texture) => [texture.id(), 0, 0],
            // A whole texture is another view than its first mip.
            Self::Mip(texture, mip) => [texture.id(), 1 + u64::from(mip), 0],
            Self::Buffer(buffer) => [buffer.id(), 0, 0],
            Self::BufferRange(buffer, offset, size) => [buffer.id(), offset, size],
            Self::Sampler(_) => [0; 3],
        }
    }

    /// Dies with the last handle; samplers live as long as their passes.
    pub(crate) fn alive(self) -> Option<Weak<()>> {
        match self {
            Self::Texture(texture) | Self::Mip(texture, _) => Some(Arc::downgrade(&texture.0.alive)),
            Self::Buffer(buffer) | Self::BufferRange(buffer, ..) => Some(Arc::downgrade(&buffer.0.alive)),
            Self::Sampler(_) => None,
        }
    }
}
