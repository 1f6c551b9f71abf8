//! Pixels and buffers back on the CPU.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::{Buffer, Gpu, GpuError, Texture};

/// Bytes of a texture's first mip and layer, rows packed without padding.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Texel format of `bytes`.
    pub format: wgpu::TextureFormat,
    /// `width · height` texels.
    pub bytes: Vec<u8>,
}

impl Pixels {
    /// Texels as `f32` channels, for 32-bit float formats.
    pub fn floats(&self) -> Vec<f32> {
        bytemuck::pod_collect_to_vec(&self.bytes)
    }

    /// Adds the channels of another texture of the same size, both of the same 32-bit float format.
    pub fn add_floats(&mut self, other: &Self) {
        let sums = self.floats().into_iter().zip(other.floats()).flat_map(|(a, b)| (a + b).to_ne_bytes());
        self.bytes = sums.collect();
    }
}

/// One channel of [`Pixels`].
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Numbers.
    Float(Vec<f32>),
    /// Whole numbers, exactly; signed ones as their bits.
    Whole(Vec<u32>),
}

impl Pixels {
    /// Texels by channel, red first, whatever the format; of packed and compressed formats the words they are made of.
    pub fn channels(&self) -> Vec<Samples> {
        let aspect = self.format.has_depth_aspect().then_some(wgpu::TextureAspect::DepthOnly);
        let texel = self.format.block_copy_size(aspect).unwrap_or(4) as usize;
        let count = usize::from(self.format.components_with_aspect(aspect.unwrap_or_default()));
        let kind = self.format.sample_type(aspect, None);
        let whole = matches!(kind, Some(wgpu::TextureSampleType::Uint | wgpu::TextureSampleType::Sint));
        let name = format!("{:?}", self.format);
        let packed = !texel.is_multiple_of(count) || name.contains("10") || name.contains("9e5");
        let bits = if packed { 32 } else { 8 * texel / count };
        let (count, texel) = if packed { (texel.div_ceil(4), texel) } else { (count, texel) };
        let size = bits / 8;
        let sample = |texel: &[u8], channel: usize| {
            let mut word = [0; 4];
            let from = &texel[(channel * size).min(texel.len())..((channel + 1) * size).min(texel.len())];
            word[..from.len()].copy_from_slice(from);
            u32::from_le_bytes(word)
        };
        let all = |channel| self.bytes.chunks_exact(texel).map(move |texel| sample(texel, channel));
        let float = |word: u32| match bits {
            8 if name.contains("Snorm") => (f32::from(word as u8 as i8) / 127.0).max(-1.0),
            8 => word as f32 / 255.0,
            16 if name.contains("Float") => half::f16::from_bits(word as u16).to_f32(),
            16 if name.contains("Snorm") => (f32::from(word as u16 as i16) / 32767.0).max(-1.0),
            16 => word as f32 / 65535.0,
            _ => f32::from_bits(word),
        };
        (0..count)
            .map(|channel| {
                if whole || packed {
                    Samples::Whole(all(channel).collect())
                } else {
                    Samples::Float(all(channel).map(float).collect())
                }
            })
            .collect()
    }
}

/// A copy of a texture on its way to the CPU. Ask [`Readback::poll`] later, or [`Readback::wait`] where blocking is
/// allowed.
#[derive(Debug)]
pub struct Readback {
    staging: Staging,
    width: u32,
    height: u32,
    row: u32,
    format: wgpu::TextureFormat,
}

impl Readback {
    /// Records and submits the copy of a texture's first mip and layer.
    ///
    /// # Errors
    /// When the staging buffer would be larger than the device allows.
    pub fn start(gpu: &Gpu, texture: &Texture) -> Result<Self, GpuError> {
        Self::start_layer(gpu, texture, 0)
    }

    /// The same of one of an array's layers.
    ///
    /// # Errors
    /// As [`Readback::start`].
    pub fn start_layer(gpu: &Gpu, texture: &Texture, layer: u32) -> Result<Self, GpuError> {
        let options = texture.options();
        let aspect = if options.format.has_depth_aspect() {
            wgpu::TextureAspect::DepthOnly
        } else {
            wgpu::TextureAspect::All
        };
        let texel = options.format.block_copy_size(Some(aspect)).unwrap_or(4);
        let row = (options.width * texel).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let size = u64::from(row) * u64::from(options.height);
        if size > gpu.limits.max_buffer_size {
            return Err(GpuError::TooLarge {
                what: format!("reading back {}×{} pixels", options.width, options.height),
                needed: size,
                limit: gpu.limits.max_buffer_size,
                unit: "bytes",
                advice: "render a smaller image",
            });
        }
        let staging = Staging::new(gpu, size);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture: texture.raw(),
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                aspect,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &staging.buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: Some(options.height),
                },
            },
            wgpu::Extent3d { width: options.width, height: options.height, depth_or_array_layers: 1 },
        );
        staging.fetch(gpu, encoder);
        Ok(Self { staging, width: options.width, height: options.height, row, format: options.format })
    }

    /// The pixels if they have arrived. Never blocks.
    ///
    /// # Errors
    /// When the device was lost meanwhile.
    pub fn poll(&self, gpu: &Gpu) -> Result<Option<Pixels>, GpuError> {
        Ok(self.staging.poll(gpu)?.map(|bytes| self.packed(&bytes)))
    }

    /// Blocks until the pixels are here. For command lines and tests only.
    ///
    /// # Errors
    /// When the device was lost, or reported an error.
    pub fn wait(self, gpu: &Gpu) -> Result<Pixels, GpuError> {
        Ok(self.packed(&self.staging.wait(gpu)?))
    }

    /// Drops the padding that copies need at the end of rows.
    fn packed(&self, padded: &[u8]) -> Pixels {
        let used = (padded.len() / self.height.max(1) as usize).min(self.row as usize);
        let aspect = self.format.has_depth_aspect().then_some(wgpu::TextureAspect::DepthOnly);
        let row = (self.width * self.format.block_copy_size(aspect).unwrap_or(4)) as usize;
        let bytes = padded.chunks_exact(used).flat_map(|padded| &padded[..row]).copied().collect();
        Pixels { width: self.width, height: self.height, format: self.format, bytes }
    }
}

/// A copy of a buffer on its way to the CPU. The buffer needs the usage `COPY_SRC`.
#[derive(Debug)]
pub struct BufferReadback(Staging);

impl BufferReadback {
    /// Records and submits the copy of the whole buffer.
    pub fn start(gpu: &Gpu, buffer: &Buffer) -> Self {
        let readback = Self(Staging::new(gpu, buffer.raw().size()));
        readback.copy(gpu, buffer);
        readback
    }

    /// Copies a buffer of the same size anew, into the memory of a copy that has arrived.
    pub fn again(&self, gpu: &Gpu, buffer: &Buffer) {
        self.0.buffer.unmap();
        self.0.state.store(PENDING, Ordering::Release);
        self.copy(gpu, buffer);
    }

    fn copy(&self, gpu: &Gpu, buffer: &Buffer) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer.raw(), 0, &self.0.buffer, 0, buffer.raw().size());
        self.0.fetch(gpu, encoder);
    }

    /// The bytes if they have arrived. Never blocks.
    ///
    /// # Errors
    /// When the device was lost meanwhile.
    pub fn poll(&self, gpu: &Gpu) -> Result<Option<Vec<u8>>, GpuError> {
        self.0.poll(gpu)
    }

    /// Blocks until the bytes are here. For command lines and tests only.
    ///
    /// # Errors
    /// When the device was lost, or reported an error.
    pub fn wait(self, gpu: &Gpu) -> Result<Vec<u8>, GpuError> {
        self.0.wait(gpu)
    }
}

const PENDING: u8 = 0;
const READY: u8 = 1;
const FAILED: u8 = 2;
/// Times that another thread is let run to call a callback after the device is done.
const PATIENCE: u32 = 1_000_000;

/// A buffer that the CPU can map, and whether it is mapped yet.
#[derive(Debug)]
struct Staging {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
}

impl Staging {
    fn new(gpu: &Gpu, size: u64) -> Self {
        gpu.created.add();
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { buffer, state: Arc::new(AtomicU8::new(PENDING)) }
    }

    /// Submits what fills the buffer, and asks for its mapping.
    fn fetch(&self, gpu: &Gpu, encoder: wgpu::CommandEncoder) {
        gpu.queue.submit([encoder.finish()]);
        let done = self.state.clone();
        self.buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            done.store(if result.is_ok() { READY } else { FAILED }, Ordering::Release);
        });
    }

    fn poll(&self, gpu: &Gpu) -> Result<Option<Vec<u8>>, GpuError> {
        // A failed poll shows as a failed mapping or in `check`.
        let _ = gpu.device.poll(wgpu::PollType::Poll);
        self.take(gpu)
    }

    fn wait(&self, gpu: &Gpu) -> Result<Vec<u8>, GpuError> {
        gpu.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| GpuError::DeviceLost(e.to_string()))?;
        gpu.check()?;
        // Another thread that waits for the same device may have taken this one's callback and be about to call it.
        for _ in 0..PATIENCE {
            if let Some(bytes) = self.take(gpu)? {
                return Ok(bytes);
            }
            std::thread::yield_now();
        }
        Err(GpuError::DeviceLost("a read-back did not finish".into()))
    }

    fn take(&self, gpu: &Gpu) -> Result<Option<Vec<u8>>, GpuError> {
        match self.state.load(Ordering::Acquire) {
            PENDING => return Ok(None),
            READY => {}
            _ => {
                gpu.check()?;
                return Err(GpuError::DeviceLost("a read-back could not be mapped".into()));
            }
        }
        let mapped = self
            .buffer
            .get_mapped_range(..)
            .map_err(|e| GpuError::Device(format!("a read-back could not be mapped: {e:?}")))?;
        Ok(Some(mapped.to_vec()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(format: wgpu::TextureFormat, bytes: &[u8]) -> Vec<Samples> {
        Pixels { width: 1, height: 1, format, bytes: bytes.to_vec() }.channels()
    }

    #[test]
    fn texels_of_any_format_become_channels() {
        use wgpu::TextureFormat as F;
        let float = |x: f32| Samples::Float(vec![x]);
        assert_eq!(pixel(F::Rg32Uint, &[1, 2, 3, 4, 255, 255, 255, 255])[1], Samples::Whole(vec![u32::MAX]));
        assert_eq!(pixel(F::R32Uint, &[1, 0, 0, 1]), [Samples::Whole(vec![(1 << 24) + 1])]);
        assert_eq!(pixel(F::Depth32Float, &0.25f32.to_le_bytes()), [float(0.25)]);
        assert_eq!(pixel(F::Rgba16Float, &[0, 0x3c, 0, 0, 0, 0xc0, 0, 0])[..3], [1.0, 0.0, -2.0].map(float));
        assert_eq!(pixel(F::Rgba8Unorm, &[0, 255, 51, 0])[1..3], [1.0, 0.2].map(float));
        assert_eq!(pixel(F::Rg8Snorm, &[127, 129]), [1.0, -1.0].map(float));
        assert_eq!(pixel(F::Rgb10a2Unorm, &[1, 0, 0, 0]), [Samples::Whole(vec![1])]);
    }
}
