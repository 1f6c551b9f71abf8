//! A block of land: a height field on top, cut sides and a bottom below.

use glam::{Vec2, Vec3, vec2, vec3};

use super::{grid::Grid, relief::HeightMap, solid::Solid, stage::Stage};
use crate::{Id, Primitive};

/// A square piece of land about the vertical axis.
pub struct Land {
    /// Heights in units of the spacing.
    pub map: HeightMap,
    /// Metres between neighbouring points.
    pub spacing_m: f32,
}

impl Land {
    /// Width, metres.
    pub fn width_m(&self) -> f32 {
        (self.map.side() - 1) as f32 * self.spacing_m
    }

    /// Position in metres of a place on the map, at height 0.
    pub fn level(&self, p: Vec2) -> Vec3 {
        let half = self.width_m() / 2.0;
        vec3(p.x * self.spacing_m - half, 0.0, p.y * self.spacing_m - half)
    }

    /// A place on the ground, metres.
    pub fn ground(&self, p: Vec2) -> Vec3 {
        self.level(p) + Vec3::Y * self.map.at(p) * self.spacing_m
    }

    /// The ground at (x, z), metres.
    pub fn ground_at(&self, x: f32, z: f32) -> Vec3 {
        self.ground((vec2(x, z) + self.width_m() / 2.0) / self.spacing_m)
    }

    /// Adds and places the block, as deep below its lowest point as said. Its ground has texture coordinates in metres
    /// from the corner at −X −Z, and one vertex for each point of the map.
    pub fn place(&self, stage: &mut Stage, name: &str, ground: Id, earth: Id, depth_m: f32) {
        let mesh = stage.add(name, vec![self.surface(ground)]);
        let materials = &stage.scene.materials;
        let (last, top) = (self.map.side() - 1, |x, z| self.point(x, z));
        let floor = rim(last, top).iter().map(|p| p.y).fold(f32::INFINITY, f32::min) - depth_m;
        let cut = cut(last, top, floor, earth).into_mesh(name, |m| materials[m].normal_texture.is_some());
        stage.scene.meshes[mesh].primitives.extend(cut.primitives);
        stage.place(mesh, Vec3::ZERO, false);
    }

    fn surface(&self, material: Id) -> Primitive {
        let side = self.map.side();
        let half = self.width_m() / 2.0;
        // The first parameter runs along +Z and the second along +X, so that the surface looks up.
        let grid = Grid { columns: side, rows: side, closes: [false; 2] };
        let mut out = grid.primitive(material, false, |z, x| {
            let at = self.point(x, z);
            (at, vec2(at.x, at.z) + half)
        });
        // u runs along +X and v along +Z, the bitangent along −Z.
        let tangent = |n: &Vec3| (Vec3::X - *n * n.x).normalize().extend(1.0);
        out.tangents = out.normals.iter().map(tangent).collect();
        out
    }

    fn point(&self, x: usize, z: usize) -> Vec3 {
        self.level(vec2(x as f32, z as f32)) + Vec3::Y * self.map.height(x, z) * self.spacing_m
    }
}

/// The edge of a field of `last + 1` points a side, once around.
fn rim(last: usize, top: impl Fn(usize, usize) -> Vec3) -> Vec<Vec3> {
    let mut rim: Vec<Vec3> = (0..last).map(|i| top(i, 0)).collect();
    rim.extend((0..last).map(|i| top(last, i)));
    rim.extend((0..last).map(|i| top(last - i, last)));
    rim.extend((0..last).map(|i| top(0, last - i)));
    rim
}

/// Sides and bottom, at the height `floor`, of a block about the vertical axis with such a field on top.
pub fn cut(last: usize, top: impl Fn(usize, usize) -> Vec3, floor: f32, material: Id) -> Solid {
    let rim = rim(last, top);
    let down = |p: Vec3| vec3(p.x, floor, p.z);
    let mut out = Solid::default();
    for (i, &a) in rim.iter().enumerate() {
        let b = rim[(i + 1) % rim.len()];
        out.quad([a, b, down(b), down(a)], [Vec2::ZERO; 4], material);
        out.triangle([down(a), down(b), Vec3::Y * floor], [Vec2::ZERO; 3], material);
    }
    out.planar_uv()
}
