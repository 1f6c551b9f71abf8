//! Panels of walls with openings: pierced, moulded, closed bodies.

use glam::{Vec2, Vec2Swizzles};

use super::{
    arch::Opening,
    shape::{CREASE_DEG, Joins, polygon, skin},
    solid::{Solid, Triangle},
};
use crate::Id;

/// A wall panel in its own space: x along the wall, its inner face at z = 0 looking to +z.
#[derive(Clone, Copy)]
pub struct Panel {
    /// It reaches from −this to this.
    pub half_width: f32,
    /// Lower edge.
    pub bottom: f32,
    /// Upper edge.
    pub top: f32,
    /// It reaches to z = −this.
    pub thickness: f32,
}

/// One line of an opening's jamb and head: how far back from the opening, how deep, and the sill's height there.
#[derive(Clone, Copy)]
pub struct Reveal {
    /// Distance outwards from the opening's outline, metres.
    pub back: f32,
    /// Depth behind the inner face, metres.
    pub depth: f32,
    /// Height of the sill at this depth.
    pub sill: f32,
}

/// A panel pierced by an opening whose reveal follows `profile` from the inner to the outer face. With `to_floor`
/// the opening has no sill but ends at the panel's lower edge. Materials: the wall's and the reveal's.
pub fn pierced(
    panel: Panel,
    opening: Opening,
    profile: &[Reveal],
    to_floor: bool,
    [wall, trim]: [Id; 2],
) -> Solid {
    let at = |outline: Vec<Vec2>, depth: f32| outline.iter().map(|p| p.extend(-depth)).collect::<Vec<_>>();
    let edge = opening.panel_edge(panel.half_width, panel.bottom, panel.top);
    let mut rings = vec![at(edge.clone(), 0.0)];
    rings.extend(profile.iter().map(|r| at(opening.widened(r.back, r.sill).outline(), r.depth)));
    rings.push(at(edge, panel.thickness));
    let outer = profile.len();
    let joins = Joins { ring: !to_floor, path: true };
    let mut out = skin(&rings, joins, |strip| if strip == 0 || strip >= outer { wall } else { trim });
    if to_floor {
        let end = |i: usize| rings.iter().map(|r| r[i]).collect::<Vec<_>>();
        let mut last = end(rings[0].len() - 1);
        last.reverse();
        out.append(polygon(&end(0), trim));
        out.append(polygon(&last, trim));
    }
    finish(out, wall)
}

/// Hard and soft edges, outward faces, and courses of the `wall` material that run on over whole walls.
pub fn finish(solid: Solid, wall: Id) -> Solid {
    let mut out = solid.smooth(CREASE_DEG).outward();
    let (wall, rest): (Vec<_>, Vec<_>) = out.triangles.into_iter().partition(|t| t.material == wall);
    out = Solid { triangles: wall }.planar_uv();
    // Along mouldings beds follow the arch: v must run along the outline, which is what rings follow.
    let along = rest.into_iter().map(|t| Triangle { uv: t.uv.map(Vec2Swizzles::yx), ..t }).collect();
    out.append(Solid { triangles: along });
    out
}
