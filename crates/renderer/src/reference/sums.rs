//! What a reference has summed up, out to the CPU and back.

use chiaro_gpu::{Gpu, Readback, Texture, wgpu};
use chiaro_techniques::reference::first_hit::FirstHitSum;
use chiaro_techniques::reference::path::PathSum;

use super::Reference;
use crate::Error;

impl Reference {
    /// Rgba32Float: nits summed over samples, and how much of the pixel surfaces cover.
    ///
    /// # Errors
    /// When the image is larger than the device can read back.
    pub fn sum(&self) -> Result<Readback, Error> {
        let empty = self.empty();
        Ok(Readback::start(&self.kit.gpu, empty.as_ref().map_or(&self.sum, |(sum, _)| sum).sum())?)
    }

    /// Sums without samples, where those in use still hold the image before [`Reference::restart`].
    fn empty(&self) -> Option<(PathSum, Vec<FirstHitSum>)> {
        let (gpu, size_px) = (&self.kit.gpu, self.sum.size_px());
        (self.samples() == 0).then(|| {
            let observed = self.observed.iter().map(|sum| FirstHitSum::new(gpu, size_px, sum.what));
            (PathSum::new(gpu, size_px), observed.collect())
        })
    }

    /// Everything that samples are added to, by names that stay, as layers of textures: Rgba32Float, summed over samples.
    /// What a sum has lost to rounding is in a layer of its name with `.low`, where it has one. As all textures of sums, they
    /// hold nothing of the image while [`Reference::samples`] is 0.
    pub fn layers(&self) -> impl Iterator<Item = (&'static str, &Texture, u32)> {
        layers(&self.sum, &self.observed)
    }

    /// A read-back of each of [`Reference::layers`]: all that [`Reference::restore`] needs.
    ///
    /// # Errors
    /// As [`Reference::sum`].
    pub fn read_layers(&self) -> Result<Vec<(&'static str, Readback)>, Error> {
        let empty = self.empty();
        let (sum, observed) = empty.as_ref().map_or((&self.sum, &self.observed), |(sum, of)| (sum, of));
        let read = |(name, texture, layer)| Ok((name, Readback::start_layer(&self.kit.gpu, texture, layer)?));
        layers(sum, observed).map(read).collect()
    }

    /// Goes on from where a reference of the same scene, settings, view, size and options stood after so many samples:
    /// what is added then gives the image, bit for bit, that one without a break would. `layers` are its
    /// [`Reference::layers`], four floats a pixel, row after row from the top; further ones do no harm.
    ///
    /// # Errors
    /// When a layer is missing or of another size. Nothing has changed then.
    pub fn restore<L: AsRef<[f32]>>(&mut self, samples: u32, layers: &[(&str, L)]) -> Result<(), Error> {
        let fitting = self.layers().map(|(name, texture, layer)| {
            let (_, texels) = layers
                .iter()
                .find(|(found, _)| *found == name)
                .ok_or_else(|| Error::Unfinished(format!("its layer `{name}` is missing")))?;
            let texels = texels.as_ref();
            let options = texture.options();
            let needed = 4 * options.width as usize * options.height as usize;
            if texels.len() != needed {
                let found = texels.len();
                return Err(Error::Unfinished(format!(
                    "its layer `{name}` has {found} values, not {needed}"
                )));
            }
            Ok((texture, layer, texels))
        });
        for (texture, layer, texels) in fitting.collect::<Result<Vec<_>, _>>()? {
            upload(&self.kit.gpu, (texture, layer), texels);
        }
        self.sum.resume(samples);
        Ok(())
    }
}

fn layers<'a>(
    sum: &'a PathSum,
    observed: &'a [FirstHitSum],
) -> impl Iterator<Item = (&'static str, &'a Texture, u32)> {
    sum.layers().chain(observed.iter().map(|sum| (sum.what.layer(), sum.texture(), 0)))
}

/// Fills a layer of an Rgba32Float texture, whose usage holds `COPY_DST`.
fn upload(gpu: &Gpu, (texture, layer): (&Texture, u32), texels: &[f32]) {
    let (width, height) = (texture.options().width, texture.options().height);
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            ..texture.raw().as_image_copy()
        },
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}
