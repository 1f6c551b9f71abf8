//! How many rays, paths and light paths a second the tracers do.

use std::fmt::Write as _;

use chiaro::scene::Scene;
use chiaro::{Integrator, LoadedScene, Recorder, Reference, ReferenceOptions};
use serde::Serialize;

use crate::timings::{Machine, Spread, summarise};
use crate::{Error, Session, Tracing};

/// Before measuring: shaders warm, clocks up.
const WARM_UP: u32 = 5;
/// Samples of each pixel in a frame, where there is a GPU.
const SAMPLES: u32 = 8;

/// What is traced.
struct Row {
    name: &'static str,
    unit: &'static str,
    options: ReferenceOptions,
    /// Without light, a path is nothing but its own rays.
    dark: bool,
    /// Rays of a sample, where all meet something.
    rays: f64,
}

/// What a tracer does.
#[derive(Clone, Debug, Serialize)]
pub struct Rate {
    /// What is traced.
    pub name: &'static str,
    /// Of what.
    pub unit: &'static str,
    /// GPU time of a frame.
    pub time: Spread,
    /// Of each pixel in a frame.
    pub samples: u32,
    /// Millions of `unit` a second.
    pub millions_per_s: f64,
}

fn rows() -> [Row; 5] {
    let traced =
        |integrator, max_depth| ReferenceOptions { integrator, max_depth, ..ReferenceOptions::default() };
    let row = |name, unit, options, dark, rays| Row { name, unit, options, dark, rays };
    [
        row("primary rays", "rays", traced(Integrator::Path, 1), true, 1.0),
        row("primary rays and one bounce", "rays", traced(Integrator::Path, 2), true, 2.0),
        row("paths from the camera", "paths", traced(Integrator::Path, 0), false, 1.0),
        row("paths from the lights", "light paths", traced(Integrator::Photon, 0), false, 1.0),
        row("both", "pairs", traced(Integrator::Full, 0), false, 1.0),
    ]
}

/// Without anything that shines.
fn dark(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.nodes.iter_mut().for_each(|node| node.light = None);
    scene.materials.iter_mut().for_each(|material| material.emissive *= 0.0);
    scene.environment = None;
    scene
}

/// Measures all that the tracers do, so many frames each. Empty where the adapter has no timestamps.
///
/// # Errors
/// When trees do not fit the device, or it fails.
pub fn rates(session: &Session<Tracing>, frames: u32) -> Result<Vec<Rate>, Error> {
    let mut rates = Vec::new();
    for row in rows() {
        rates.extend(measure(session, &row, frames)?);
    }
    Ok(rates)
}

/// The table for people.
pub fn table(machine: &Machine, session: &Session<Tracing>, frames: u32, rates: &[Rate]) -> String {
    let [width, height] = session.size;
    let mut text = format!(
        "Tracers on {}\n{}, {} triangles, {width}x{height}, median of {frames} frames\n\n",
        machine.adapter, session.scene_name, session.scene.gpu.triangle_count
    );
    for Rate { name, unit, time, samples, millions_per_s } in rates {
        let each = time.median_ms / f64::from(*samples);
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "  {name:<30}{millions_per_s:>10.1} million {unit}/s   {each:.3} ms a sample of each pixel"
        );
    }
    text
}

/// Nothing without timestamps.
fn measure(session: &Session<Tracing>, row: &Row, frames: u32) -> Result<Option<Rate>, Error> {
    let Session { gpu, renderer, scene, view, size, source, .. } = session;
    let without_light = row.dark.then(|| dark(source));
    let (source, loaded) = match &without_light {
        Some(source) => (source, &LoadedScene::upload(renderer.kit(), source)?),
        None => (source, scene),
    };
    let (kit, settings) = (renderer.kit(), renderer.settings());
    let mut reference = Reference::new(kit, (source, loaded), settings, (view, *size), row.options)?;
    let samples = if gpu.is_software() { 1 } else { SAMPLES };
    let mut recorder = Recorder::new(gpu, true);
    let mut timings = Vec::new();
    for index in 0..WARM_UP + frames {
        let mut frame = recorder.begin();
        reference.add(&mut frame, loaded, samples);
        frame.submit();
        recorder.wait()?;
        let taken = recorder.take_timings();
        if index >= WARM_UP {
            timings.extend(taken);
        }
    }
    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let each = if row.options.integrator == Integrator::Photon {
        f64::from(reference.light_paths())
    } else {
        pixels
    };
    Ok(summarise(&timings).map(|summary| {
        let time = summary.frame_span;
        let done = each * f64::from(samples) * row.rays;
        let millions_per_s = done / (time.median_ms * 1e-3) * 1e-6;
        Rate { name: row.name, unit: row.unit, time, samples, millions_per_s }
    }))
}
