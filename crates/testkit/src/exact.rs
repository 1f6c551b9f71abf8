//! Exact shadows: rays against every triangle of a scene, on the CPU.
//!
//! The twin that shadow maps are measured against. Triangles lie in a binary BVH (obvhs); masked ones count as whole.

use chiaro::View;
use chiaro::scene::{Pose, Scene};
use chiaro_techniques::frame::LightData;
use chiaro_techniques::light::light_data;
use glam::{Vec2, Vec3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// World position.
    pub position: Vec3,
    /// Of the triangle, towards where the ray came from.
    pub normal: Vec3,
}

/// A scene to shoot rays at.
#[derive(Clone)]
pub struct Exact {
    triangles: Vec<Triangle>,
    bvh: Bvh2,
    lights: Vec<LightData>,
    // What rays are moved off surfaces by, metres.
    offset: f32,
}

impl std::fmt::Debug for Exact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exact").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl Exact {
    /// Builds the tree of the scene as it stands at time 0.
    pub fn new(scene: &Scene) -> Self {
        Self::at(scene, &scene.pose(0.0))
    }

    /// Builds the tree of the scene as it stands in a pose.
    pub fn at(scene: &Scene, pose: &Pose) -> Self {
        let mut triangles = Vec::new();
        for (node, mesh) in scene.nodes.iter().enumerate().filter_map(|(i, node)| Some((i, node.mesh?))) {
            for primitive in &scene.meshes[mesh].primitives {
                let at: Vec<_> = scene.posed_vertices(pose, node, primitive).map(|(p, _)| p).collect();
                let (corners, _) = primitive.indices.as_chunks::<3>();
                triangles.extend(corners.iter().map(|corner| {
                    let [v0, v1, v2] = corner.map(|vertex| at[vertex as usize].into());
                    Triangle { v0, v1, v2 }
                }));
            }
        }
        let (lo, hi) = scene.bounds_at(pose).unwrap_or_default();
        let mut took = std::time::Duration::ZERO;
        let bvh = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut took);
        Self { bvh, triangles, lights: light_data(scene, pose).0, offset: 1e-5 * (hi - lo).length() }
    }

    fn triangle(&self, primitive: usize) -> &Triangle {
        &self.triangles[self.bvh.primitive_indices[primitive] as usize]
    }

    /// The nearest triangle that a ray meets.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new_inf(origin.into(), direction.into());
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(ray, &mut hit, |ray, primitive| self.triangle(primitive).intersect(ray));
        if hit.t == f32::INFINITY {
            return None;
        }
        let t = self.triangle(hit.primitive_id as usize);
        let normal = Vec3::from((t.v1 - t.v0).cross(t.v2 - t.v0)).normalize();
        let position = origin + direction * hit.t;
        Some(Hit { position, normal: if normal.dot(direction) > 0.0 { -normal } else { normal } })
    }

    /// Whether nothing stands between a surface and what lies `distance` away.
    pub fn free(&self, from: Hit, direction: Vec3, distance: f32) -> bool {
        let origin = from.position + from.normal * self.offset;
        let ray = Ray::new(origin.into(), direction.into(), 0.0, distance - self.offset);
        self.bvh.ray_traverse_miss(ray, |ray, primitive| self.triangle(primitive).intersect(ray))
    }

    /// Irradiance in lux that all lights give a surface, with shadows and without. Suns are `light_size` radians across,
    /// other lights that many metres: `rays` are shot over a light's disc.
    pub fn irradiance(&self, hit: Hit, light_size: f32, rays: u32) -> [f32; 2] {
        let mut sums = [0.0; 2];
        for light in &self.lights {
            let to_light = Vec3::from(light.position_ws) - hit.position;
            let sun = light.kind == LightData::DIRECTIONAL;
            let (direction, distance) = if sun {
                (-Vec3::from(light.direction_ws), f32::MAX)
            } else {
                (to_light.normalize(), to_light.length())
            };
            let mut share = if sun { 1.0 } else { distance.powi(-2) };
            if light.kind == LightData::SPOT {
                let cosine = -direction.dot(light.direction_ws.into());
                share *= (cosine * light.cone_scale + light.cone_offset).clamp(0.0, 1.0).powi(2);
            }
            let lit = light.intensity[0] * share * hit.normal.dot(direction).max(0.0);
            if lit <= 0.0 {
                continue;
            }
            let (side, up) = direction.any_orthonormal_pair();
            let reach = 0.5 * light_size * if sun { 1.0 } else { distance.recip() };
            let seen = (0..rays).filter(|&i| {
                let p = vogel(i, rays) * reach;
                self.free(hit, (direction + side * p.x + up * p.y).normalize(), distance)
            });
            sums[0] += lit * seen.count() as f32 / rays as f32;
            sums[1] += lit;
        }
        sums
    }

    /// What each pixel's middle shows, row by row from the top.
    pub fn pixels(&self, view: &View, [width, height]: [u32; 2]) -> Vec<Option<Hit>> {
        let clip = view.relative_from_clip([width, height], Vec2::ZERO);
        let eye = view.eye_ws();
        let of = |x: u32, y: u32| {
            let at = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(width as f32, height as f32);
            let ndc = at * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
            let through = clip.project_point3(ndc.extend(0.5));
            if view.is_orthographic() {
                let forward = view.forward_ws();
                return self.nearest(eye + through - forward * forward.dot(through), forward);
            }
            self.nearest(eye, through.normalize())
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| of(x, y)).collect()
    }
}

/// Point `i` of `n` on the unit disc, evenly dense; the only one is the middle.
fn vogel(i: u32, n: u32) -> Vec2 {
    if n == 1 {
        return Vec2::ZERO;
    }
    Vec2::from_angle(i as f32 * 2.399_963) * ((i as f32 + 0.5) / n as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stage;

    #[test]
    fn a_quad_hides_a_sun_from_what_lies_under_it() {
        let mut stage = Stage::new();
        let material = stage.lambert(1.0);
        stage.quad(Vec3::ZERO, Vec3::X * 3.0, Vec3::NEG_Z * 3.0, material);
        stage.quad(Vec3::Y, Vec3::X * 0.5, Vec3::NEG_Z * 0.5, material);
        stage.sun(2.0, Vec3::new(1.0, -1.0, 0.0));
        let exact = Exact::new(&stage.scene);
        for (x, lit) in [(0.4, true), (0.6, false), (1.4, false), (1.6, true)] {
            let hit = exact.nearest(Vec3::new(x, 0.5, 0.1), Vec3::NEG_Y).unwrap();
            assert!(hit.normal == Vec3::Y && hit.position.y.abs() < 1e-6);
            let [shadowed, all] = exact.irradiance(hit, 0.0, 1);
            assert!((all - 2f32.sqrt()).abs() < 1e-5);
            assert_eq!(shadowed > 0.0, lit, "at {x}");
        }
        // A sun of 0.4 rad over an edge 1.41 m away: half of it is seen on the edge's shadow.
        let edge = exact.nearest(Vec3::new(0.5, 0.5, 0.1), Vec3::NEG_Y).unwrap();
        let [shadowed, all] = exact.irradiance(edge, 0.4, 256);
        assert!((shadowed / all - 0.5).abs() < 0.02, "{}", shadowed / all);
    }
}
