//! What shines, as something to choose from: alias tables (Walker 1977, Vose 1991) by emitted flux.
//!
//! Half of the choices go by flux alone, the other half treats every light, all glowing triangles together, and the
//! environment alike, so that a lamp indoors is not forgotten over the sun. Only the noise depends on this.

use std::f32::consts::PI;

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, GpuError};
use chiaro_scene as cs;
use glam::Vec3;

use super::lamps::Lamps;
use crate::frame::LightData;
use crate::light::light_data;
use crate::paths::{EVERYWHERE, cone_height};
use crate::rays::{TriangleRef, Word, placed_triangles};
use crate::scene::Cut;

/// Kinds, in the top bits of an emitter's third word.
const TRIANGLE: u32 = 1 << 30;
const ENVIRONMENT: u32 = 2 << 30;
/// Columns of the environment's table at most.
const COLUMNS: u32 = 1024;

/// Words before the tables: where they are.
const HEADER: usize = 2;

/// What shines in a scene, looked at by any thread.
#[derive(Clone, Debug)]
pub struct EmitterData {
    gathered: Gathered,
    sky: Vec3,
    lamps: Lamps,
}

/// [`EmitterData`] on the GPU.
#[derive(Clone, Debug)]
pub struct Emitters {
    /// What `emitters.wesl` calls `emitters`.
    pub words: Buffer,
    /// Of paths that leave emitters evenly over all their directions, the share that may meet the scene.
    pub aimed: f32,
    count: usize,
    data: EmitterData,
}

impl EmitterData {
    /// Looks at a scene as it stands in a pose, under a black sky.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        Self { gathered: gathered(scene, pose), sky: Vec3::ZERO, lamps: Lamps::new(scene, pose) }
    }

    /// The same under a uniform sky, nits; it does not shine where the scene has an environment map.
    #[must_use]
    pub fn under(self, sky: Vec3) -> Self {
        Self { sky, ..self }
    }

    /// Uploads.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the adapter cannot bind so much.
    pub fn upload(self, gpu: &Gpu) -> Result<Emitters, GpuError> {
        let (words, aimed) = self.gathered.words(self.sky);
        let needed = size_of_val(words.as_slice()) as u64;
        let limit = gpu.limits.max_storage_buffer_binding_size;
        if needed > limit {
            return Err(GpuError::TooLarge {
                what: "the table of all that glows".into(),
                needed,
                limit,
                unit: "bytes",
                advice: "let fewer triangles glow",
            });
        }
        let count = words.len();
        let words = Buffer::with_data(gpu, "emitters", &words, BufferUsages::STORAGE);
        Ok(Emitters { words, aimed, count, data: self })
    }
}

impl Emitters {
    /// Takes a new pose of the scene that this was built from, for the commands submitted next. `false` when only building
    /// anew will do: a glowing triangle has stopped or begun to be finite.
    #[must_use]
    pub fn update(&mut self, gpu: &Gpu, scene: &cs::Scene, pose: &cs::Pose) -> bool {
        if self.data.lamps.changed(pose) {
            self.data.gathered = gathered(scene, pose);
            let (words, aimed) = self.data.gathered.words(self.data.sky);
            if words.len() != self.count {
                return false;
            }
            gpu.queue.write_buffer(self.words.raw(), 0, bytemuck::cast_slice(&words));
            self.aimed = aimed;
        }
        true
    }

    /// Takes another uniform sky, nits, for the commands submitted next.
    ///
    /// # Errors
    /// As [`EmitterData::upload`].
    pub fn set_sky(&mut self, gpu: &Gpu, sky: Vec3) -> Result<(), GpuError> {
        if self.data.sky != sky {
            *self = self.data.clone().under(sky).upload(gpu)?;
        }
        Ok(())
    }
}

/// All that shines, as it stands in a pose.
fn gathered(scene: &cs::Scene, pose: &cs::Pose) -> Gathered {
    let mut gathered = Gathered::new(scene, pose);
    if gathered.materials.iter().any(|glow| *glow > 0.0) {
        let cut = Cut::new(scene, pose);
        for drawn in &cut.drawn {
            for triangle in placed_triangles(scene, &cut, drawn) {
                gathered.add_triangle(&triangle);
            }
        }
    }
    gathered
}

/// What shines of the scene itself.
#[derive(Clone, Debug)]
struct Gathered {
    /// What a material emits, by the largest channel of its factor and the largest alpha that it may have.
    materials: Vec<f32>,
    /// Flux, and the share of it that may meet the scene.
    lights: Vec<(f32, f32)>,
    triangles: Vec<(f32, Word)>,
    /// Its map, and the mean radiance.
    environment: Option<(Table, f32)>,
    /// Area that parallel light falls through on its way to the scene, m².
    disc: f32,
}

/// The environment's cells: share of each, and density per steradian.
#[derive(Clone, Debug)]
struct Table {
    columns: u32,
    rows: u32,
    shares: Vec<f32>,
    densities: Vec<f32>,
}

impl Gathered {
    fn new(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let (lo, hi) = scene.bounds_at(pose).unwrap_or_default();
        let disc = PI * (0.5 * (hi - lo).length()).powi(2);
        let flux = |light: &LightData| {
            let peak = Vec3::from(light.intensity).max_element();
            match light.kind {
                LightData::DIRECTIONAL => peak * disc,
                _ => peak * 2.0 * PI * (1.0 - light.cone_rad.cos()),
            }
        };
        Self {
            materials: scene
                .materials
                .iter()
                .map(|m| m.emissive.max_element().max(0.0) * coverage(m))
                .collect(),
            lights: light_data(scene, pose).0.iter().map(|l| (flux(l), aimed(l, (lo, hi)))).collect(),
            triangles: Vec::new(),
            environment: scene.environment.as_ref().map(table),
            disc: disc.max(f32::MIN_POSITIVE),
        }
    }

    /// Takes a triangle if it glows; one without area too, for it may have some in another pose.
    fn add_triangle(&mut self, triangle: &TriangleRef) {
        let [a, b, c] = triangle.corners;
        let glow = self.materials[triangle.material as usize];
        let flux = PI * 0.5 * (b - a).cross(c - a).length() * glow;
        if glow > 0.0 {
            self.triangles.push((if flux.is_finite() { flux } else { 0.0 }, triangle.word));
        }
    }

    /// The tables, after a header that says where they are, and how much of all that shines may meet the scene. Without a map
    /// the sky is the environment, its table a single cell.
    fn words(&self, sky: Vec3) -> (Vec<Word>, f32) {
        let uniform = (Table::uniform(), sky.max_element());
        let (map, mean) = self.environment.as_ref().unwrap_or(&uniform);
        let mut words = vec![[0; 4]; HEADER];
        let all_triangles: f64 = self.triangles.iter().map(|(flux, _)| f64::from(*flux)).sum();
        let environment = f64::from(4.0 * PI * *mean * self.disc);
        let total =
            self.lights.iter().map(|(flux, _)| f64::from(*flux)).sum::<f64>() + all_triangles + environment;
        let groups = self.lights.iter().filter(|(flux, _)| *flux > 0.0).count()
            + usize::from(all_triangles > 0.0)
            + usize::from(environment > 0.0);
        // A group's share by its flux.
        let share = |flux: f64| {
            if flux > 0.0 && total.is_finite() { 0.5 * flux / total + 0.5 / groups as f64 } else { 0.0 }
        };
        let per_flux = if all_triangles > 0.0 { share(all_triangles) / all_triangles } else { 0.0 };
        let mut shares = Vec::new();
        let mut emitters = Vec::new();
        let mut missing = 0.0;
        for (index, (flux, aimed)) in (0u32..).zip(&self.lights) {
            let share = share(f64::from(*flux));
            missing += share * (1.0 - f64::from(*aimed));
            shares.push(share);
            emitters.push((index, [0; 4]));
        }
        for (flux, word) in &self.triangles {
            shares.push(per_flux * f64::from(*flux));
            emitters.push((TRIANGLE, *word));
        }
        if environment > 0.0 {
            shares.push(share(environment));
            emitters.push((ENVIRONMENT, [0; 4]));
        }
        words[0][0] = words.len() as u32;
        words[0][1] = emitters.len() as u32;
        let table = alias(&shares);
        for (((threshold, other), (kind, word)), share) in table.into_iter().zip(emitters).zip(&shares) {
            words.extend([[threshold.to_bits(), other, kind, (*share as f32).to_bits()], word]);
        }
        words[0][2] = words.len() as u32;
        words.extend(
            self.materials.chunks(4).map(|four| {
                std::array::from_fn::<u32, 4, _>(|i| four.get(i).copied().unwrap_or(0.0).to_bits())
            }),
        );
        if environment > 0.0 {
            words[1] = [words.len() as u32, map.columns, map.rows, (share(environment) as f32).to_bits()];
            let shares: Vec<_> = map.shares.iter().map(|&s| f64::from(s)).collect();
            for ((threshold, other), density) in alias(&shares).into_iter().zip(&map.densities) {
                words.push([threshold.to_bits(), other, density.to_bits(), 0]);
            }
        }
        // Density over area of a triangle, by what its material emits.
        words[0][3] = ((f64::from(PI) * per_flux) as f32).to_bits();
        let all: f64 = shares.iter().sum();
        (words, (1.0 - missing / all.max(f64::MIN_POSITIVE)) as f32)
    }
}

/// The share of a light's directions that are towards a box.
fn aimed(light: &LightData, bounds: (Vec3, Vec3)) -> f32 {
    let own = match light.kind {
        LightData::DIRECTIONAL => return 1.0,
        LightData::SPOT => 1.0 - light.cone_rad.cos(),
        _ => EVERYWHERE,
    };
    let height = cone_height(light.position_ws.into(), bounds);
    if height >= EVERYWHERE { 1.0 } else { (height / own).min(1.0) }
}

/// How much of a surface is there at most: textures and vertex colours only lower alpha.
fn coverage(material: &cs::Material) -> f32 {
    let alpha = material.base_color.w.clamp(0.0, 1.0);
    match material.alpha {
        cs::AlphaMode::Opaque => 1.0,
        cs::AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
        cs::AlphaMode::Blend => alpha,
    }
}

impl Table {
    /// All directions alike.
    fn uniform() -> Self {
        Self { columns: 1, rows: 1, shares: vec![1.0], densities: vec![0.25 / PI] }
    }
}

/// For each entry the share of its draws that are its own, and whose the others are (Vose 1991).
fn alias(shares: &[f64]) -> Vec<(f32, u32)> {
    let total: f64 = shares.iter().sum();
    let scale = if total > 0.0 { shares.len() as f64 / total } else { 0.0 };
    let mut left: Vec<_> = shares.iter().map(|share| share * scale).collect();
    let mut table: Vec<_> = (0..shares.len() as u32).map(|i| (1.0, i)).collect();
    let (mut small, mut large): (Vec<_>, Vec<_>) = (0..shares.len()).partition(|&i| left[i] < 1.0);
    while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
        small.pop();
        table[poor] = (left[poor] as f32, rich as u32);
        left[rich] -= 1.0 - left[poor];
        if left[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    table
}

/// The environment's cells, and its mean radiance. A cell between dark texels may still hold light that the texture's
/// filter brings, so each takes its neighbours' into account.
fn table(map: &cs::Environment) -> (Table, f32) {
    let columns = map.width.clamp(1, COLUMNS);
    let rows = map.height.clamp(1, COLUMNS / 2);
    let cell_of = |i: u32, of: u32, source: u32| (u64::from(i) * u64::from(of) / u64::from(source)) as usize;
    let mut sums = vec![(0.0f32, 0u32); (columns * rows) as usize];
    for (index, radiance) in (0u32..).zip(&map.radiance) {
        let row = cell_of(index / map.width, rows, map.height);
        let cell = &mut sums[row * columns as usize + cell_of(index % map.width, columns, map.width)];
        *cell = (cell.0 + radiance.max_element(), cell.1 + 1);
    }
    let means: Vec<_> = sums.iter().map(|&(sum, count)| sum / count.max(1) as f32).collect();
    let at = |x: u32, y: u32| means[(y * columns + x) as usize];
    let angle = |row: u32| 2.0 * PI / columns as f32 * (edge(row, rows) - edge(row + 1, rows));
    let mut shares = Vec::with_capacity(means.len());
    let mut mean = 0.0;
    for y in 0..rows {
        for x in 0..columns {
            let sides = [(x + 1) % columns, (x + columns - 1) % columns].map(|x| at(x, y));
            let ends = [y.saturating_sub(1), (y + 1).min(rows - 1)].map(|y| at(x, y));
            let around = sides.into_iter().chain(ends).fold(0.0, f32::max);
            mean += at(x, y) * angle(y) / (4.0 * PI);
            shares.push((at(x, y).max(0.1 * around)) * angle(y));
        }
    }
    // Every direction has a chance.
    let floor = 0.01 * mean;
    for (index, share) in (0u32..).zip(&mut shares) {
        *share += floor * angle(index / columns);
    }
    let total: f32 = shares.iter().map(|&s| f64::from(s)).sum::<f64>() as f32;
    let densities = (0u32..).zip(&shares).map(|(i, share)| share / total.max(1e-30) / angle(i / columns));
    let densities = densities.collect();
    (Table { columns, rows, shares, densities }, mean)
}

/// Cosine of a row's upper edge from the zenith.
fn edge(row: u32, rows: u32) -> f32 {
    (row as f32 / rows as f32 * PI).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alias_table_draws_each_entry_by_its_share() {
        let shares = [0.1, 3.0, 0.0, 1.0, 0.4, 0.4, 0.0];
        let table = alias(&shares);
        let mut drawn = [0.0; 7];
        for (entry, &(threshold, other)) in table.iter().enumerate() {
            drawn[entry] += f64::from(threshold) / 7.0;
            drawn[other as usize] += f64::from(1.0 - threshold) / 7.0;
        }
        for (share, drawn) in shares.iter().zip(drawn) {
            assert!((share / 4.9 - drawn).abs() < 1e-6, "{share} {drawn}");
        }
    }

    #[test]
    fn densities_of_an_environment_integrate_to_one() {
        let radiance = (0..64 * 32).map(|i| Vec3::splat(if i == 700 { 1000.0 } else { 1.0 })).collect();
        let map = cs::Environment { name: String::new(), width: 64, height: 32, radiance };
        let (table, _) = table(&map);
        let angle = |row: u32| 2.0 * PI / 64.0 * (edge(row, 32) - edge(row + 1, 32));
        let sum: f32 = (0u32..).zip(&table.densities).map(|(i, density)| density * angle(i / 64)).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        assert!(table.densities.iter().all(|density| *density > 0.0));
    }
}
