//! Height maps and lumpy things: noise in space, fractal hills, erosion by rain.

use glam::{IVec2, IVec3, Vec2, Vec3, vec2};

use super::texture::hash;

/// Value noise, about −0.5..0.5, smooth, with features a unit in size.
pub fn noise3(p: Vec3, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (Vec3::splat(3.0) - 2.0 * f);
    let cell = cell.as_ivec3();
    let at = |x: i32, y: i32, z: i32| {
        let c = cell + IVec3::new(x, y, z);
        hash(c.x, c.y, seed ^ (c.z as u32).wrapping_mul(0x9e37_79b9))
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let face = |z: i32| mix(mix(at(0, 0, z), at(1, 0, z), f.x), mix(at(0, 1, z), at(1, 1, z), f.x), f.y);
    mix(face(0), face(1), f.z) - 0.5
}

/// `octaves` of [`noise3`], each twice as fine and half as strong; about −0.5..0.5.
pub fn fractal3(p: Vec3, octaves: u32, seed: u32) -> f32 {
    (0..octaves).map(|i| noise3(p * (1u32 << i) as f32, seed + i) * 0.5f32.powi(i as i32)).sum::<f32>() * 0.6
}

/// Heights over a square grid of `side` × `side` points.
#[derive(Clone, Debug)]
pub struct HeightMap {
    side: usize,
    /// In the grid's own unit: one is the distance between neighbours.
    heights: Vec<f32>,
}

impl HeightMap {
    /// Asks for every height, in grid units.
    pub fn new(side: usize, height: impl Fn(usize, usize) -> f32) -> Self {
        let heights = (0..side * side).map(|i| height(i % side, i / side)).collect();
        Self { side, heights }
    }

    /// Points along each side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The height at a grid point.
    pub fn height(&self, column: usize, row: usize) -> f32 {
        self.heights[row * self.side + column]
    }

    /// The four grid points around `p` and their weights.
    fn around(&self, p: Vec2) -> [(usize, f32); 4] {
        let p = p.clamp(Vec2::ZERO, Vec2::splat(self.side as f32 - 1.001));
        let IVec2 { x, y } = p.as_ivec2();
        let (f, i) = (p - p.floor(), y as usize * self.side + x as usize);
        [
            (i, (1.0 - f.x) * (1.0 - f.y)),
            (i + 1, f.x * (1.0 - f.y)),
            (i + self.side, (1.0 - f.x) * f.y),
            (i + self.side + 1, f.x * f.y),
        ]
    }

    /// Height between grid points.
    pub fn at(&self, p: Vec2) -> f32 {
        self.around(p).iter().map(|(i, weight)| self.heights[*i] * weight).sum()
    }

    /// Slope along both axes.
    pub fn gradient(&self, p: Vec2) -> Vec2 {
        let step = |d: Vec2| self.at(p + d) - self.at(p - d);
        vec2(step(Vec2::X * 0.5), step(Vec2::Y * 0.5))
    }

    /// Lets drops of rain run down, which take soil from where they are fast and leave it where they are slow.
    ///
    /// Source: Beyer 2015, "Implementation of a method for hydraulic erosion", without its wide brush.
    pub fn erode(&mut self, drops: i32, seed: u32) {
        let side = self.side as f32 - 1.0;
        for drop in 0..drops {
            let mut p = vec2(hash(drop, 0, seed), hash(drop, 1, seed)) * side;
            let (mut way, mut speed, mut water, mut soil) = (Vec2::ZERO, 1.0f32, 1.0f32, 0.0f32);
            for _ in 0..48 {
                way = (way * 0.15 - self.gradient(p) * 0.85).normalize_or_zero();
                let next = p + way;
                if way == Vec2::ZERO || next.min_element() < 1.0 || next.max_element() > side - 1.0 {
                    break;
                }
                let fall = self.at(p) - self.at(next);
                let carries = fall.max(0.02) * speed * water * 3.0;
                // Positive leaves soil, negative takes it.
                let change = if fall < 0.0 {
                    soil.min(-fall)
                } else if soil > carries {
                    (soil - carries) * 0.25
                } else {
                    -((carries - soil) * 0.25).min(fall)
                };
                soil -= change;
                for (i, weight) in self.around(p) {
                    self.heights[i] += change * weight;
                }
                speed = (speed * speed + 4.0 * fall).max(0.0).sqrt();
                water *= 0.98;
                p = next;
            }
        }
    }

    /// Lets slopes steeper than `talus` slide, in so many rounds.
    ///
    /// Source: Musgrave, Kolb, Mace 1989, "The Synthesis and Rendering of Eroded Fractal Terrains", section 5.
    pub fn slump(&mut self, talus: f32, rounds: usize) {
        let side = self.side;
        let pairs = |i: usize| {
            let right = (i % side + 1 < side).then_some((i, i + 1));
            let down = (i / side + 1 < side).then_some((i, i + side));
            right.into_iter().chain(down)
        };
        for (a, b) in (0..rounds).flat_map(|_| (0..side * side).flat_map(pairs)) {
            let fall = self.heights[a] - self.heights[b];
            let slides = 0.5 * (fall.abs() - talus).max(0.0) * fall.signum();
            self.heights[a] -= slides;
            self.heights[b] += slides;
        }
    }

    /// Mixes every height with the mean of its neighbours, `strength` in 0..1 of it.
    pub fn smooth(&mut self, strength: f32) {
        let old = self.clone();
        let last = self.side - 1;
        self.shape(|x, y, height| {
            let (x0, x1, y0, y1) =
                (x.saturating_sub(1), (x + 1).min(last), y.saturating_sub(1), (y + 1).min(last));
            let mean = (old.height(x0, y) + old.height(x1, y) + old.height(x, y0) + old.height(x, y1)) / 4.0;
            height + (mean - height) * strength
        });
    }

    /// Pulls every height towards `f(column, row, height)`.
    pub fn shape(&mut self, f: impl Fn(usize, usize, f32) -> f32) {
        for (i, height) in self.heights.iter_mut().enumerate() {
            *height = f(i % self.side, i / self.side, *height);
        }
    }
}
