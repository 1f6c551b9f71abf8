//! Textures made by code: tileable, seeded, the same on every machine.
//!
//! A [`Surface`] is painted as colour and height at once, so that the normal map belongs to the picture. All cores paint,
//! each pixel by itself, so that their number does not show.

use glam::{IVec2, Vec2, Vec3, ivec2, vec2, vec3};
use rayon::prelude::*;

use crate::ImageData;

/// A tileable square of colour and relief.
pub struct Surface {
    size: u32,
    /// Linear Rec. 709.
    color: Vec<Vec3>,
    /// Metres.
    height: Vec<f32>,
}

impl Surface {
    /// Asks `paint` for linear colour and height in metres at (u, v) in 0..1, v downwards.
    pub fn paint(size: u32, paint: impl Fn(Vec2) -> (Vec3, f32) + Sync) -> Self {
        Self::painted(size, &paint)
    }

    // One function for all painters: what rayon makes of each takes seconds to compile.
    fn painted(size: u32, paint: &(dyn Fn(Vec2) -> (Vec3, f32) + Sync)) -> Self {
        let at = |i: u32| paint((vec2((i % size) as f32, (i / size) as f32) + 0.5) / size as f32);
        let (color, height) = (0..size * size).into_par_iter().map(at).unzip();
        Self { size, color, height }
    }

    /// The colour as an sRGB image.
    pub fn base_color(&self, name: &str) -> ImageData {
        self.picture(name, &|_| 255)
    }

    /// The same cut out: where `height` was to be, `paint` told how much of the pixel is there, 0..1.
    pub fn cutout(&self, name: &str) -> ImageData {
        self.picture(name, &|height| (height.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
    }

    fn picture(&self, name: &str, alpha: &(dyn Fn(f32) -> u8 + Sync)) -> ImageData {
        // Encoding by table: the power function a million times over would be most of the painting's cost.
        let table: Vec<u8> = (0..4096).map(|i| encode_srgb(i as f32 / 4095.0)).collect();
        let byte = |x: f32| table[(x.clamp(0.0, 1.0) * 4095.0 + 0.5) as usize];
        let pixel = |(c, &height): (&Vec3, &f32)| [byte(c.x), byte(c.y), byte(c.z), alpha(height)];
        self.image(name, self.color.par_iter().zip(&self.height).map(pixel))
    }

    /// The relief as a tangent-space normal map, y up in the picture, of a square `side_m` wide.
    pub fn normal(&self, name: &str, side_m: f32) -> ImageData {
        let n = self.size;
        let at = |x: u32, y: u32| self.height[((y % n) * n + x % n) as usize];
        let per_m = n as f32 / side_m;
        let pixel = |i: u32| {
            let (x, y) = (i % n, i / n);
            let along = (at(x + 1, y) - at(x + n - 1, y)) * 0.5 * per_m;
            let down = (at(x, y + 1) - at(x, y + n - 1)) * 0.5 * per_m;
            let unit = vec3(-along, down, 1.0).normalize();
            let byte = |c: f32| ((c * 0.5 + 0.5) * 255.0 + 0.5) as u8;
            [byte(unit.x), byte(unit.y), byte(unit.z), 255]
        };
        self.image(name, (0..n * n).into_par_iter().map(pixel))
    }

    fn image(&self, name: &str, pixels: impl IndexedParallelIterator<Item = [u8; 4]>) -> ImageData {
        let pixels: Vec<[u8; 4]> = pixels.collect();
        let rgba = pixels.into_flattened();
        ImageData { name: name.to_owned(), width: self.size, height: self.size, rgba }
    }
}

fn encode_srgb(linear: f32) -> u8 {
    let s = if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (s * 255.0 + 0.5) as u8
}

/// A pseudo-random number in 0..1 for a lattice point.
pub fn hash(x: i32, y: i32, seed: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b9) ^ (x as u32).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 15)).wrapping_add((y as u32).wrapping_mul(0xc2b2_ae35));
    h = (h ^ (h >> 13)).wrapping_mul(0x27d4_eb2f);
    h = (h ^ (h >> 16)).wrapping_mul(0x1656_67b1);
    (h ^ (h >> 15)) as f32 / u32::MAX as f32
}

/// Fractal value noise over a square of pixels, tileable, about −0.5..0.5.
///
/// Lattice values are interpolated along columns once per row and then only along the row: painting would
/// otherwise spend most of its time on hashes.
pub struct Noise {
    size: u32,
    values: Vec<f32>,
}

impl Noise {
    /// `cells` lattice cells over the square at first, then `octaves` − 1 times twice as fine and half as strong.
    pub fn new(size: u32, cells: IVec2, octaves: u32, seed: u32) -> Self {
        let mut values = vec![0.0; (size * size) as usize];
        let sum = 1.0 - 0.5f32.powi(octaves as i32);
        let octave = |octave: u32| {
            let strength = 0.5f32.powi(octave as i32 + 1) / sum;
            Octave::new(size, cells * (1 << octave), seed + octave, strength)
        };
        let octaves: Vec<_> = (0..octaves).map(octave).collect();
        values.par_chunks_exact_mut(size as usize).enumerate().for_each(|(y, row)| {
            for octave in &octaves {
                octave.add_to(row, y as u32);
            }
        });
        Self { size, values }
    }

    /// At a place in the unit square.
    pub fn at(&self, uv: Vec2) -> f32 {
        let p = (uv * self.size as f32).as_uvec2().min(glam::UVec2::splat(self.size - 1));
        self.values[(p.y * self.size + p.x) as usize]
    }
}

/// One frequency of a [`Noise`].
struct Octave {
    cells: IVec2,
    seed: u32,
    strength: f32,
    /// Lattice cell of each column, and the eased position in it.
    columns: Vec<(usize, f32)>,
}

impl Octave {
    fn new(size: u32, cells: IVec2, seed: u32, strength: f32) -> Self {
        let column = |x| Self::place(x, size, cells.x);
        let columns = (0..size).map(column).map(|(c, f)| (c as usize, f)).collect();
        Self { cells, seed, strength, columns }
    }

    /// Lattice cell and eased position in it.
    fn place(i: u32, size: u32, cells: i32) -> (i32, f32) {
        let p = (i as f32 + 0.5) / size as f32 * cells as f32;
        let f = p.fract();
        (p as i32, f * f * (3.0 - 2.0 * f))
    }

    fn add_to(&self, row: &mut [f32], y: u32) {
        let Self { cells, seed, strength, columns } = self;
        let (cy, fy) = Self::place(y, row.len() as u32, cells.y);
        let lattice = |x: i32| {
            let (a, b) = (hash(x % cells.x, cy, *seed), hash(x % cells.x, (cy + 1) % cells.y, *seed));
            (a + (b - a) * fy - 0.5) * strength
        };
        let line: Vec<f32> = (0..=cells.x).map(lattice).collect();
        for (value, (c, f)) in row.iter_mut().zip(columns) {
            *value += line[*c] + (line[*c + 1] - line[*c]) * f;
        }
    }
}

fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Coursed stone: what a wall or a paving looks like.
pub struct Masonry {
    /// Side of the square in metres.
    pub side_m: f32,
    /// Rows over the square.
    pub courses: i32,
    /// Stones in a row, on average.
    pub stones: i32,
    /// Width of the joints, metres.
    pub joint_m: f32,
    /// Linear colour of the stone.
    pub stone: Vec3,
    /// Linear colour of the joints.
    pub mortar: Vec3,
    /// How much stones differ in brightness, as a factor's half range.
    pub variation: f32,
    /// Picks the pattern.
    pub seed: u32,
}

impl Masonry {
    /// Paints it.
    pub fn paint(&self, size: u32) -> Surface {
        let wavers = Noise::new(size, IVec2::splat(24), 2, self.seed + 5);
        let clouds = Noise::new(size, IVec2::splat(6), 5, self.seed + 20);
        let grains = Noise::new(size, IVec2::splat(96), 2, self.seed + 40);
        Surface::paint(size, |uv| {
            let row = ((uv.y * self.courses as f32) as i32).min(self.courses - 1);
            let row_m = self.side_m / self.courses as f32;
            // Joints of a row: evenly spaced, shifted by the row, each moved a little.
            let shift = hash(row, 7, self.seed);
            let joint = |k: i32| {
                let moved = 0.5 * (hash(row, k.rem_euclid(self.stones) + 11, self.seed) - 0.5);
                (k as f32 + moved + shift) / self.stones as f32
            };
            // Joints move by at most a quarter, so the stone is this one or a neighbour.
            let near = (uv.x * self.stones as f32 - shift) as i32;
            let k = (near - 1..near + 2).find(|k| joint(k + 1) > uv.x).unwrap_or(near + 2);
            let stone_id = k.rem_euclid(self.stones);
            // Edges waver a little: hewn, not cut.
            let waver = 0.004 * wavers.at(uv);
            let x_m = (uv.x - joint(k)).min(joint(k + 1) - uv.x) * self.side_m;
            let in_row = uv.y * self.courses as f32 - row as f32;
            let y_m = in_row.min(1.0 - in_row) * row_m;
            let edge_m = x_m.min(y_m) + waver - self.joint_m * 0.5;
            let face = smoothstep(0.0, 0.006, edge_m);

            let tone = hash(stone_id, row + 100, self.seed) - 0.5;
            let warmth = hash(stone_id, row + 200, self.seed) - 0.5;
            let cloud = clouds.at(uv);
            let grain = grains.at(uv);
            let factor = 1.0 + 2.0 * self.variation * tone + 0.30 * cloud + 0.16 * grain;
            let tint = vec3(1.0 + 0.07 * warmth, 1.0, 1.0 - 0.14 * warmth);
            let color = self.mortar * (1.0 + 0.3 * grain + 0.2 * cloud) * (1.0 - face)
                + self.stone * tint * factor * face;

            let tilt = (hash(stone_id, row + 300, self.seed) - 0.5) * (in_row - 0.5) * row_m * 0.012;
            let rounded = 0.0035 * smoothstep(-0.002, 0.02, edge_m);
            (color, rounded + face * (tilt + 0.003 * cloud + 0.0012 * grain))
        })
    }
}

/// Dressed stone for piers and mouldings: `beds` joints across v over the square of `side_m` metres.
pub fn dressed_stone(size: u32, beds: i32, side_m: f32, color: Vec3, seed: u32) -> Surface {
    let clouds = Noise::new(size, IVec2::splat(4), 5, seed);
    let grains = Noise::new(size, IVec2::splat(64), 2, seed + 9);
    let layers = Noise::new(size, ivec2(2, 24), 3, seed + 17);
    Surface::paint(size, |uv| {
        let (cloud, grain, layer) = (clouds.at(uv), grains.at(uv), layers.at(uv));
        let row = uv.y * beds as f32;
        let tone = hash(row as i32, 3, seed) - 0.5;
        let edge_m = row.fract().min(1.0 - row.fract()) * side_m / beds as f32;
        let face = smoothstep(0.001, 0.006, edge_m);
        let tint = vec3(1.0 + 0.08 * layer, 1.0, 1.0 - 0.12 * layer);
        let factor = 1.0 + 0.26 * cloud + 0.14 * grain + 0.10 * layer + 0.16 * tone;
        let relief = 0.0025 * cloud + 0.0010 * grain + 0.002 * smoothstep(0.0, 0.012, edge_m);
        (color * tint * factor * (0.72 + 0.28 * face), relief)
    })
}

/// Square tiles of two stones, laid diagonally, `across` diagonals over the square of `side_m` metres.
pub fn diagonal_tiles(size: u32, across: i32, side_m: f32, stones: [Vec3; 2], seed: u32) -> Surface {
    let clouds = Noise::new(size, IVec2::splat(9), 5, seed + 3);
    let veins = Noise::new(size, IVec2::splat(5), 4, seed + 11);
    let wear = Noise::new(size, IVec2::splat(3), 4, seed + 30);
    Surface::paint(size, |uv| {
        // The lattice at 45°: x + y and x − y count the tiles, and both repeat over the square.
        let d = vec2(uv.x + uv.y, uv.x - uv.y) * across as f32;
        let cell = d.floor().as_ivec2();
        let f = d - d.floor();
        let tile_m = side_m / (across as f32 * std::f32::consts::SQRT_2);
        let edge_m = f.min(1.0 - f).min_element() * tile_m;
        // A tile is known by its centre on the torus of the square.
        let wrapped =
            ivec2((cell.x + cell.y).rem_euclid(2 * across), (cell.x - cell.y).rem_euclid(2 * across));
        let dark = (cell.x + cell.y).rem_euclid(2) == 1;
        let tone = hash(wrapped.x, wrapped.y, seed) - 0.5;
        let warmth = hash(wrapped.x, wrapped.y, seed + 1) - 0.5;
        let cloud = clouds.at(uv);
        let vein = 1.0 - veins.at(uv).abs() * 2.0;
        let worn = smoothstep(-0.15, 0.25, wear.at(uv));
        let face = smoothstep(0.0015, 0.004, edge_m);
        let stone = stones[usize::from(dark)] * vec3(1.0 + 0.06 * warmth, 1.0, 1.0 - 0.10 * warmth);
        let factor = 1.0 + 0.34 * tone + 0.5 * cloud + 0.12 * (vein.powi(8) - 0.3) - 0.10 * worn;
        let color = stone * factor * face + vec3(0.10, 0.09, 0.08) * (1.0 - face);
        let tilt = (f.x - 0.5) * (hash(wrapped.x, wrapped.y, seed + 2) - 0.5) * 0.004 * tile_m;
        (color, 0.0012 * smoothstep(0.0, 0.012, edge_m) + face * (tilt + 0.0006 * cloud))
    })
}

/// Oiled oak, grain along u.
pub fn wood(size: u32, color: Vec3, seed: u32) -> Surface {
    let bends = Noise::new(size, ivec2(2, 6), 3, seed);
    let fibres = Noise::new(size, ivec2(6, 160), 2, seed + 5);
    let clouds = Noise::new(size, IVec2::splat(3), 3, seed + 8);
    Surface::paint(size, |uv| {
        let (bend, fibre, cloud) = (bends.at(uv), fibres.at(uv), clouds.at(uv));
        let ring = ((uv.y * 14.0 + 1.6 * bend) * std::f32::consts::TAU).sin() * 0.5 + 0.5;
        let factor = 1.0 + 0.28 * (ring - 0.5) + 0.5 * fibre + 0.4 * cloud;
        (color * factor, 0.0006 * fibre + 0.0002 * ring)
    })
}
