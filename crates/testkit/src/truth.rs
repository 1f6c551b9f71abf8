//! Traced pictures of scenes in nits.

use chiaro::scene::Scene;
use chiaro::techniques::shaders;
use chiaro::{Gpu, Kit, LoadedScene, Recorder, Reference, ReferenceOptions, Settings, View};
use chiaro_image::Image;

use crate::studio::{image, need};

/// A scene at time 0 and its tracers, compiled once for all pictures from the same options.
#[derive(Debug)]
pub struct Truth {
    /// What the next [`Truth::look`] goes by.
    pub settings: Settings,
    gpu: Gpu,
    size: [u32; 2],
    loaded: LoadedScene,
    reference: Reference,
    recorder: Recorder,
}

impl Truth {
    /// Builds the trees and compiles the tracers.
    ///
    /// # Panics
    /// When the scene does not fit the adapter, or a shader does not compile.
    pub fn new(
        gpu: &Gpu,
        settings: Settings,
        scene: &Scene,
        (view, size): (&View, [u32; 2]),
        options: ReferenceOptions,
    ) -> Self {
        let kit = Kit::new(gpu, shaders::library());
        let loaded = need(LoadedScene::upload(&kit, scene));
        let reference = need(Reference::new(&kit, (scene, &loaded), &settings, (view, size), options));
        let recorder = Recorder::new(gpu, false);
        Self { settings, gpu: gpu.clone(), size, loaded, reference, recorder }
    }

    /// Begins the picture again, from elsewhere.
    ///
    /// # Panics
    /// When the device fails.
    pub fn look(&mut self, view: &View) {
        need(self.reference.restart(&self.loaded, &self.settings, (view, self.size)));
    }

    /// The mean of all samples so far, with more added: `groups` are those of each dispatch.
    ///
    /// # Panics
    /// When the device fails.
    pub fn add(&mut self, groups: &[u32]) -> Image {
        for &count in groups {
            let mut frame = self.recorder.begin();
            self.reference.add(&mut frame, &self.loaded, count);
            frame.submit();
        }
        let sum = need(self.reference.sum());
        image(&need(sum.wait(&self.gpu)), self.reference.samples())
    }

    /// A sum by its name, with what its first float has lost: four numbers a pixel.
    ///
    /// # Panics
    /// When there is none of that name, or the device fails.
    pub fn total(&self, name: &str) -> Vec<f64> {
        let mut total = Vec::new();
        for (found, layer) in need(self.reference.read_layers()) {
            let floats = need(layer.wait(&self.gpu)).floats();
            if found == name {
                total = floats.into_iter().map(f64::from).collect();
            } else if found.strip_suffix(".low") == Some(name) {
                total.iter_mut().zip(floats).for_each(|(total, low)| *total += f64::from(low));
            }
        }
        assert!(!total.is_empty(), "no sum {name}");
        total
    }

    /// Samples of every pixel.
    pub fn samples(&self) -> u32 {
        self.reference.samples()
    }
}
