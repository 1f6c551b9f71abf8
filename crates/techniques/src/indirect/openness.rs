//! How much of the sky a place sees, from coarse voxels of the scene.

use chiaro_scene::Scene;
use glam::{UVec3, Vec3};

use crate::scene::material::see_through;

/// Cells along the scene's longest side.
const CELLS: f32 = 128.0;
/// Directions over the whole sphere.
const DIRECTIONS: u32 = 512;

/// The sky as a place sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyView {
    /// Share of the upper half of all directions that leaves the scene, 0..1.
    pub share: f32,
    /// Mean of those directions over the upper half; half a unit upwards under an open sky.
    pub direction: Vec3,
}

impl SkyView {
    /// Nothing between here and the sky.
    pub const OPEN: Self = Self { share: 1.0, direction: Vec3::new(0.0, 0.5, 0.0) };
}

/// Which cells of a grid about the scene hold surfaces.
#[derive(Clone, Debug)]
pub struct Openness {
    lo: Vec3,
    cell_m: f32,
    size: UVec3,
    full: Vec<u64>,
}

impl Openness {
    /// Fills the grid with what is not see-through: windows are open. Points half a cell apart stand for a triangle:
    /// what is thinner than a cell stays closed, openings smaller than a cell close up.
    pub fn new(scene: &Scene) -> Self {
        let (lo, hi) = scene.bounds().unwrap_or((Vec3::ZERO, Vec3::ZERO));
        let cell_m = ((hi - lo).max_element() / CELLS).max(f32::MIN_POSITIVE);
        let size = ((hi - lo) / cell_m).as_uvec3() + 1;
        let mut grid =
            Self { lo, cell_m, size, full: vec![0; (size.element_product() as usize).div_ceil(64)] };
        for (node, world) in scene.nodes.iter().zip(scene.world_from_node()) {
            let primitives = node.mesh.iter().flat_map(|mesh| &scene.meshes[*mesh].primitives);
            for p in primitives.filter(|p| !see_through(&scene.materials[p.material])) {
                for t in p.indices.chunks_exact(3) {
                    let [a, b, c] =
                        [t[0], t[1], t[2]].map(|i| world.transform_point3(p.positions[i as usize]));
                    grid.fill(a, b - a, c - a);
                }
            }
        }
        grid
    }

    fn fill(&mut self, corner: Vec3, u: Vec3, v: Vec3) {
        let longest = u.length().max(v.length()).max((v - u).length());
        if !longest.is_finite() {
            return;
        }
        let steps = (longest / (0.5 * self.cell_m)).ceil().clamp(1.0, 4.0 * CELLS) as u32;
        for i in 0..=steps {
            for j in 0..=steps - i {
                let p = corner + (u * i as f32 + v * j as f32) / steps as f32;
                let index = self.index(((p - self.lo) / self.cell_m).as_uvec3().min(self.size - 1));
                self.full[index / 64] |= 1 << (index % 64);
            }
        }
    }

    fn index(&self, cell: UVec3) -> usize {
        (cell.x + self.size.x * (cell.y + self.size.y * cell.z)) as usize
    }

    /// Whether a ray meets a full cell other than the one it starts in.
    fn blocked(&self, from: Vec3, direction: Vec3) -> bool {
        // In cells, so that the grid is 0..size. The slab test clips the ray to it.
        let from = (from - self.lo) / self.cell_m;
        let (a, b) = (-from / direction, (self.size.as_vec3() - from) / direction);
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if enter >= leave {
            return false;
        }
        let mut cell = (from + direction * enter)
            .floor()
            .as_ivec3()
            .clamp(glam::IVec3::ZERO, (self.size - 1).as_ivec3());
        let start = cell;
        let step = direction.signum().as_ivec3();
        let ahead = step.max(glam::IVec3::ZERO);
        // Visits every cell on the way (Amanatides & Woo 1987).
        loop {
            let index = self.index(cell.as_uvec3());
            if (enter > 0.0 || cell != start) && self.full[index / 64] >> (index % 64) & 1 != 0 {
                return true;
            }
            let next = ((cell + ahead).as_vec3() - from) / direction;
            let axis = next.min_position();
            cell[axis] += step[axis];
            if cell[axis] < 0 || cell[axis] >= self.size[axis] as i32 {
                return false;
            }
        }
    }

    /// The sky as `eye_ws` sees it.
    pub fn sky_view(&self, eye_ws: Vec3) -> SkyView {
        let mut view = SkyView { share: 0.0, direction: Vec3::ZERO };
        for i in 0..DIRECTIONS {
            // Equal areas: golden-angle turns, uniform heights.
            let y = (i as f32 + 0.5) / DIRECTIONS as f32;
            let turn = i as f32 * 2.399_963;
            let r = (1.0 - y * y).sqrt();
            let direction = Vec3::new(r * turn.cos(), y, r * turn.sin());
            if !self.blocked(eye_ws, direction) {
                view.share += 1.0 / DIRECTIONS as f32;
                view.direction += direction / DIRECTIONS as f32;
            }
        }
        view
    }
}

#[cfg(test)]
mod tests {
    use chiaro_scene::builtin;

    use super::*;

    #[test]
    fn a_nave_sees_little_sky_and_the_air_above_it_all() {
        let openness = Openness::new(&builtin::build("nave").unwrap());
        let inside = openness.sky_view(Vec3::new(0.0, 1.7, 10.0));
        assert!(inside.share > 0.003 && inside.share < 0.15, "{inside:?}");
        let above = openness.sky_view(Vec3::new(0.0, 100.0, 10.0));
        assert!((above.share - 1.0).abs() < 1e-3 && above.direction.distance(SkyView::OPEN.direction) < 0.01);
    }

    #[test]
    fn without_geometry_all_is_sky() {
        let view = Openness::new(&Scene::default()).sky_view(Vec3::new(3.0, 0.0, 0.0));
        assert!((view.share - 1.0).abs() < 1e-3, "{view:?}");
    }
}
