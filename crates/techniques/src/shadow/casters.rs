//! What of a scene can shadow anything: maps of suns need reach no farther than casters do, along the light.
//!
//! Ground casts no shadow on what is seen however large it is: a flat or a convex thing cannot shadow itself, and one
//! that lies beyond everything else, as the light travels, has nothing to shadow. Left out of what maps are fitted to, it
//! is still drawn in them, so that what is sunk into it stays dark. All is told from what does not change with the
//! camera, so that maps rest when it moves.

use chiaro_scene as cs;
use glam::{Affine3A, Vec3};

use super::project::corners;
use crate::scene::motion::{bounds_over_time, union};

/// A box: smallest and largest corner, world space, metres.
type Bounds = (Vec3, Vec3);

/// Maps are fitted to casters where these take no more than this share of the scene's diagonal.
const SMALL: f32 = 0.125;
/// Grounds looked at; a scene has one or two.
const MAX_GROUNDS: usize = 16;
/// Planes of a convex thing looked at.
const MAX_PLANES: usize = 64;
/// Rounding of coordinates, as a share of a thing's diagonal.
const ROUNDING: f32 = 1e-6;

/// What casts shadows in a scene, and what may not.
#[derive(Clone, Debug, Default)]
pub struct Casters {
    all: Bounds,
    // What casts whatever the light.
    rest: Option<Bounds>,
    grounds: Vec<Ground>,
}

/// Something that does not shadow itself.
#[derive(Clone, Debug)]
struct Ground {
    bounds: Bounds,
    // Outward normals, and how far the thing reaches along each.
    planes: Vec<(Vec3, f32)>,
    flat: bool,
}

/// Where a sun's shadows are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shadowed {
    /// Around what casts.
    pub casting: Bounds,
    /// Around that and all that it may shadow.
    pub region: Bounds,
}

impl Casters {
    /// Looks at a scene at rest, and at what moves in it at any time. Nodes that have `strayed` are left to
    /// [`Casters::hold`].
    pub fn new(scene: &cs::Scene, pose: &cs::Pose, strayed: &[cs::Id]) -> Self {
        let mut moving = scene.moving_nodes();
        for &node in strayed {
            moving[node] = true;
        }
        let mut casters = Self { rest: bounds_over_time(scene), ..Self::default() };
        let mut flat = Vec::new();
        for (index, node) in scene.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh.filter(|_| !moving[index] && !scene.deforms(node)) else { continue };
            for primitive in &scene.meshes[mesh].primitives {
                let Some(bounds) = bounds_of(primitive, &pose.world_from_node[index]) else { continue };
                match Ground::of(primitive, &pose.world_from_node[index], bounds) {
                    Some(ground) => flat.push(ground),
                    None => casters.add(bounds),
                }
            }
        }
        flat.sort_by(|a, b| diagonal(b.bounds).total_cmp(&diagonal(a.bounds)));
        for ground in flat {
            // Ground is often made of tiles.
            if let Some(whole) = casters.grounds.iter_mut().find(|whole| whole.continues(&ground)) {
                whole.bounds = union(whole.bounds, ground.bounds);
            } else if casters.grounds.len() < MAX_GROUNDS {
                casters.grounds.push(ground);
            } else {
                casters.add(ground.bounds);
            }
        }
        let grounds = casters.grounds.iter().map(|ground| ground.bounds);
        casters.all = grounds.chain(casters.rest).reduce(union).unwrap_or_default();
        casters
    }

    /// Takes the boxes around what somebody has moved, wherever it has been.
    pub fn hold(&mut self, strayed: &[Bounds]) {
        for &bounds in strayed {
            // Nothing at all has a box of no size.
            self.all =
                if self.rest.is_none() && self.grounds.is_empty() { bounds } else { union(self.all, bounds) };
            self.add(bounds);
        }
    }

    fn add(&mut self, bounds: Bounds) {
        self.rest = Some(self.rest.map_or(bounds, |rest| union(rest, bounds)));
    }

    /// Where a sun that shines along `direction` casts shadows in a scene of these bounds; `None` where that is about
    /// everywhere.
    pub(super) fn shadowed(&self, direction: Vec3, scene: Bounds) -> Option<Shadowed> {
        if scene.0.cmplt(self.all.0).any() || scene.1.cmpgt(self.all.1).any() {
            // Something has left the places that are known.
            return None;
        }
        let casts = |&(index, ground): &(usize, &Ground)| {
            let mut others = (0..).zip(&self.grounds).filter(|&(other, _)| other != index);
            !others.all(|(_, other)| ground.lies_beyond(other, direction))
        };
        let casting = (0..).zip(&self.grounds).filter(casts).map(|(_, ground)| ground.bounds);
        let casting = casting.chain(self.rest).reduce(union)?;
        if diagonal(casting) > SMALL * diagonal(scene) {
            return None;
        }
        // As far as shadows go before they leave the scene.
        let along = |axis: usize| {
            let d = direction[axis];
            let way = if d > 0.0 { scene.1[axis] - casting.0[axis] } else { casting.1[axis] - scene.0[axis] };
            if d.abs() > 1e-6 { way / d.abs() } else { f32::MAX }
        };
        let way = direction * along(0).min(along(1)).min(along(2)).max(0.0);
        let swept = union(casting, (casting.0 + way, casting.1 + way));
        Some(Shadowed { casting, region: (swept.0.max(scene.0), swept.1.min(scene.1)) })
    }
}

impl Ground {
    fn of(primitive: &cs::Primitive, world: &Affine3A, bounds: Bounds) -> Option<Self> {
        let rounding = ROUNDING * (diagonal(bounds) + bounds.0.abs().max(bounds.1.abs()).max_element());
        let point = |index: u32| world.transform_point3(primitive.positions[index as usize]);
        let mut planes: Vec<(Vec3, f32)> = Vec::new();
        for t in primitive.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(point);
            // In f64: a product of three small lengths leaves the range of f32.
            let (u, v) = ((b - a).as_dvec3(), (c - a).as_dvec3());
            let Some(normal) = u.cross(v).try_normalize() else { continue };
            let normal = normal.as_vec3();
            let at = normal.dot(a);
            let known = |&(n, d): &(Vec3, f32)| (n - normal).length() < 1e-4 && (d - at).abs() <= rounding;
            if !planes.iter().any(known) {
                planes.push((normal, at));
            }
            if planes.len() > MAX_PLANES {
                return None;
            }
        }
        let reach = |normal: Vec3| {
            let heights = primitive.indices.iter().map(|&i| normal.dot(point(i)));
            heights.fold((f32::MAX, f32::MIN), |(lo, hi), h| (lo.min(h), hi.max(h)))
        };
        let &(first, _) = planes.first()?;
        let (lo, hi) = reach(first);
        if hi - lo <= rounding {
            return Some(Self { bounds, planes: vec![(first, hi), (-first, -lo)], flat: true });
        }
        let convex = planes.iter().all(|&(normal, at)| reach(normal).1 <= at + rounding);
        (convex && is_closed(primitive)).then_some(Self { bounds, planes, flat: false })
    }

    /// Whether another flat thing lies in the same plane.
    fn continues(&self, other: &Self) -> bool {
        let slack = ROUNDING * diagonal(union(self.bounds, other.bounds));
        let ((a, at), (b, there)) = (self.planes[0], other.planes[0]);
        self.flat
            && other.flat
            && a.dot(b).abs() > 1.0 - 1e-6
            && (at - there * a.dot(b).signum()).abs() <= slack
    }

    /// Whether light that travels along `direction` cannot pass through this first and meet `other` then: a plane keeps
    /// them apart that light passes from the other's side.
    fn lies_beyond(&self, other: &Self, direction: Vec3) -> bool {
        let slack = ROUNDING * diagonal(union(self.bounds, other.bounds));
        self.planes.iter().filter(|(normal, _)| normal.dot(direction) <= 0.0).any(|&(normal, reach)| {
            corners(other.bounds).iter().all(|&corner| normal.dot(corner) >= reach - slack)
        })
    }
}

/// Whether every edge has a triangle on either side, so that nobody sees the inside.
fn is_closed(primitive: &cs::Primitive) -> bool {
    let bits = |index: u32| primitive.positions[index as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut open = std::collections::HashSet::new();
    for t in primitive.indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (bits(a), bits(b));
            if a != b && !open.remove(&(b, a)) {
                open.insert((a, b));
            }
        }
    }
    open.is_empty()
}

fn bounds_of(primitive: &cs::Primitive, world: &Affine3A) -> Option<Bounds> {
    primitive.positions.iter().map(|&p| world.transform_point3(p)).map(|p| (p, p)).reduce(union)
}

fn diagonal((lo, hi): Bounds) -> f32 {
    (hi - lo).length()
}
