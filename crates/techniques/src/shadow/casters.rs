//! What of a scene can shadow anything: maps of suns need reach no farther than casters do, along the light.
//!
//! Ground casts no shadow on what is seen however large it is: a flat or a convex thing cannot shadow itself, and one
//! that lies beyond everything else, as the light travels, has nothing to shadow. Left out of what maps are fitted to, it
//! is still drawn in them, so that what is sunk into it stays dark. All is told from what does not change with the
//! camera, so that maps rest when it moves.
//!
//! What lies so far away that it is smaller in the sky than a sun has a part of its own: its shadow does not get here, and
//! maps are fitted to the part that the camera is in or nearest to, as if there were no other.

use chiaro_scene as cs;
use glam::{Affine3A, Vec3};

use crate::scene::motion::{bounds_over_time, union};
use crate::view::project::corners;

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
/// What lies farther away than so many times the larger one's size has a part of its own. A sun of half a degree is hidden by
/// nothing that is farther than a hundred times its size.
const APART: f32 = 100.0;
/// Parts at most; where there were more, all is one.
const MAX_PARTS: usize = 16;

/// What casts shadows in a scene, and what may not.
#[derive(Clone, Debug, Default)]
pub struct Casters {
    // At rest and as animations have it.
    known: Vec<Part>,
    // With all that somebody has moved, where that is now.
    parts: Vec<Part>,
    // Where each of that has been lately.
    held: Vec<Bounds>,
}

/// What lies together.
#[derive(Clone, Debug, Default)]
struct Part {
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
        let mut things = Vec::new();
        for (index, node) in scene.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh.filter(|_| !moving[index] && !scene.deforms(node)) else { continue };
            let world = &pose.world_from_node[index];
            let primitives = scene.meshes[mesh].primitives.iter();
            things.extend(primitives.filter_map(|p| Some((bounds_of(p, world)?, Some((p, world))))));
        }
        things.extend(bounds_over_time(scene).map(|bounds| (bounds, None)));
        let known: Vec<_> = apart(&things).into_iter().map(|part| Part::of(&things, &part)).collect();
        Self { parts: known.clone(), known, held: Vec::new() }
    }

    /// Takes the boxes around what poses move, as they are now, always in the same order. They are held where they have been
    /// while that is near the rest of the scene, so that maps come to rest.
    pub fn hold(&mut self, moved: &[Bounds]) {
        let around = self.known.iter().map(|part| part.all).reduce(union);
        let reach = around.map(|(lo, hi)| (lo - size((lo, hi)), hi + size((lo, hi))));
        self.held.truncate(moved.len());
        for (index, &now) in moved.iter().enumerate() {
            let Some(held) = self.held.get_mut(index) else {
                self.held.push(now);
                continue;
            };
            let both = union(*held, now);
            *held = if reach.is_some_and(|reach| union(both, reach) == reach) { both } else { now };
        }
        self.parts.clone_from(&self.known);
        for &bounds in &self.held {
            let near = |part: &&mut Part| !are_apart(part.all, bounds);
            match self.parts.iter_mut().find(near) {
                Some(part) => {
                    part.all = union(part.all, bounds);
                    part.add(bounds);
                }
                None => self.parts.push(Part { all: bounds, rest: Some(bounds), grounds: Vec::new() }),
            }
        }
        // What was moved may have bridged a gap.
        let joined = joined(self.parts.iter().map(|part| part.all).collect());
        if joined.len() < self.parts.len() {
            let parts = joined.iter().map(|of| of.iter().map(|&part| self.parts[part].clone()));
            self.parts = parts.filter_map(|parts| parts.reduce(Part::join)).collect();
        }
    }

    /// Corners of a box around what lies together nearest to a place; `None` where the whole scene does.
    pub fn around(&self, place: Vec3) -> Option<Bounds> {
        self.nearest(place).filter(|_| self.parts.len() > 1).map(|part| part.all)
    }

    /// From a place to the nearest point of each large flat or rounded thing around which there is nothing of it.
    pub fn towards_grounds(&self, place: Vec3) -> impl Iterator<Item = Vec3> + '_ {
        let grounds = self.parts.iter().flat_map(|part| &part.grounds);
        grounds.map(move |ground| place.clamp(ground.bounds.0, ground.bounds.1) - place)
    }

    /// A box around what casts a sun's shadows about a camera, where that is a small part of a scene of these bounds.
    pub fn casting(&self, direction: Vec3, eye: Vec3, scene: Bounds) -> Option<Bounds> {
        self.shadowed(direction, eye, scene).map(|shadowed| shadowed.casting)
    }

    fn nearest(&self, place: Vec3) -> Option<&Part> {
        let away = |part: &&Part| place.distance(place.clamp(part.all.0, part.all.1));
        self.parts.iter().min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    /// Where a sun that shines along `direction` casts shadows about a camera, in a scene of these bounds; `None` where that
    /// is about everywhere.
    pub(super) fn shadowed(&self, direction: Vec3, eye: Vec3, scene: Bounds) -> Option<Shadowed> {
        let part = self.nearest(eye)?;
        match self.around(eye) {
            Some(own) => part.shadowed(direction, own).or(Some(Shadowed { casting: own, region: own })),
            None => part.shadowed(direction, scene),
        }
    }
}

impl Part {
    fn of(things: &[Thing<'_>], indices: &[usize]) -> Self {
        let mut part = Self::default();
        let mut flat = Vec::new();
        for &(bounds, source) in indices.iter().map(|&index| &things[index]) {
            match source.and_then(|(primitive, world)| Ground::of(primitive, world, bounds)) {
                Some(ground) => flat.push(ground),
                None => part.add(bounds),
            }
        }
        flat.sort_by(|a, b| diagonal(b.bounds).total_cmp(&diagonal(a.bounds)));
        for ground in flat {
            // Ground is often made of tiles.
            if let Some(whole) = part.grounds.iter_mut().find(|whole| whole.continues(&ground)) {
                whole.bounds = union(whole.bounds, ground.bounds);
            } else if part.grounds.len() < MAX_GROUNDS {
                part.grounds.push(ground);
            } else {
                part.add(ground.bounds);
            }
        }
        part.all = indices.iter().map(|&index| things[index].0).reduce(union).unwrap_or_default();
        part
    }

    fn join(mut self, other: Self) -> Self {
        self.all = union(self.all, other.all);
        self.grounds.extend(other.grounds);
        for ground in self.grounds.split_off(self.grounds.len().min(MAX_GROUNDS)) {
            self.add(ground.bounds);
        }
        other.rest.into_iter().for_each(|bounds| self.add(bounds));
        self
    }

    fn add(&mut self, bounds: Bounds) {
        self.rest = Some(self.rest.map_or(bounds, |rest| union(rest, bounds)));
    }

    fn shadowed(&self, direction: Vec3, scene: Bounds) -> Option<Shadowed> {
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

/// A box with the triangles in it and where they stand, where that is known.
type Thing<'a> = (Bounds, Option<(&'a cs::Primitive, &'a Affine3A)>);

/// Which things lie together.
fn apart(things: &[Thing<'_>]) -> Vec<Vec<usize>> {
    let mut order: Vec<_> = (0..things.len()).collect();
    // The largest first: what stands on ground joins it at once.
    order.sort_by(|&a, &b| size(things[b].0).total_cmp(&size(things[a].0)));
    let mut parts: Vec<(Bounds, Vec<usize>)> = Vec::new();
    for index in order {
        let bounds = things[index].0;
        if let Some((part, members)) = parts.iter_mut().find(|(part, _)| !are_apart(*part, bounds)) {
            *part = union(*part, bounds);
            members.push(index);
        } else if parts.len() < MAX_PARTS {
            parts.push((bounds, vec![index]));
        } else {
            // Strewn about: no part is more than another.
            return vec![(0..things.len()).collect()];
        }
    }
    let joined = joined(parts.iter().map(|(bounds, _)| *bounds).collect());
    joined.into_iter().map(|of| of.iter().flat_map(|&part| parts[part].1.clone()).collect()).collect()
}

/// Boxes that are not apart, together.
fn joined(boxes: Vec<Bounds>) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Bounds, Vec<usize>)> =
        boxes.into_iter().enumerate().map(|(index, bounds)| (bounds, vec![index])).collect();
    let mut at = 0;
    while at < groups.len() {
        let other = (0..at).find(|&other| !are_apart(groups[other].0, groups[at].0));
        let Some(other) = other else {
            at += 1;
            continue;
        };
        let (bounds, members) = groups.remove(at);
        groups[other].0 = union(groups[other].0, bounds);
        groups[other].1.extend(members);
        // It may be near to others now.
        at = other;
    }
    groups.into_iter().map(|(_, members)| members).collect()
}

/// Whether the gap between two boxes is many times what either measures. By coordinates, whose squares may be beyond `f32`.
fn are_apart(a: Bounds, b: Bounds) -> bool {
    let gap = (b.0 - a.1).max(a.0 - b.1).max_element();
    gap > APART * size(a).max(size(b))
}

/// The longest side.
fn size((lo, hi): Bounds) -> f32 {
    (hi - lo).max_element()
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
