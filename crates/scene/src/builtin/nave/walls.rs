//! The walls of a bay: pierced, moulded, closed bodies.

use glam::{Affine3A, Vec2, Vec2Swizzles, Vec3, vec2, vec3};

use super::super::{
    arch::{Opening, PointedArch},
    shape::{CREASE_DEG, Joins, arc, polygon, prism, skin},
    solid::{Solid, Triangle},
};
use super::{
    AISLE_WALL, AISLE_WALL_TOP, ARCADE_SPRINGING, BAY, CLERESTORY, FOOTING, NAVE_WALL, NAVE_WALL_TOP,
    materials::Palette, tracery,
};

/// The clerestory's windows.
pub const CLERESTORY_WINDOW: Opening =
    Opening { arch: PointedArch::new(1.5, 1.5), springing: 12.2, sill: 10.7, segments: 7 };
/// The aisles' windows.
pub const AISLE_WINDOW: Opening =
    Opening { arch: PointedArch::new(0.95, 1.5), springing: 5.3, sill: 2.7, segments: 6 };

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
/// the opening has no sill but ends at the panel's lower edge.
pub fn pierced(panel: Panel, opening: Opening, profile: &[Reveal], to_floor: bool, m: &Palette) -> Solid {
    let at = |outline: Vec<Vec2>, depth: f32| outline.iter().map(|p| p.extend(-depth)).collect::<Vec<_>>();
    let edge = opening.panel_edge(panel.half_width, panel.bottom, panel.top);
    let mut rings = vec![at(edge.clone(), 0.0)];
    rings.extend(profile.iter().map(|r| at(opening.widened(r.back, r.sill).outline(), r.depth)));
    rings.push(at(edge, panel.thickness));
    let outer = profile.len();
    let joins = Joins { ring: !to_floor, path: true };
    let mut out = skin(&rings, joins, |strip| if strip == 0 || strip >= outer { m.wall } else { m.trim });
    if to_floor {
        let end = |i: usize| rings.iter().map(|r| r[i]).collect::<Vec<_>>();
        let mut last = end(rings[0].len() - 1);
        last.reverse();
        out.append(polygon(&end(0), m.trim));
        out.append(polygon(&last, m.trim));
    }
    finish(out, m)
}

/// Hard and soft edges, outward faces, and courses that run on over whole walls.
pub fn finish(solid: Solid, m: &Palette) -> Solid {
    let mut out = solid.smooth(CREASE_DEG).outward();
    let (wall, rest): (Vec<_>, Vec<_>) = out.triangles.into_iter().partition(|t| t.material == m.wall);
    out = Solid { triangles: wall }.planar_uv();
    // Along mouldings beds follow the arch: v must run along the outline, which is what rings follow.
    let along = rest.into_iter().map(|t| Triangle { uv: t.uv.map(Vec2Swizzles::yx), ..t }).collect();
    out.append(Solid { triangles: along });
    out
}

/// From a panel's space to the south side's: its inner face at `x`, looking to −x. Exact, unlike a rotation by
/// sine and cosine.
fn to_south(solid: Solid, x: f32) -> Solid {
    let turn =
        Affine3A::from_cols(Vec3::Z.into(), Vec3::Y.into(), Vec3::NEG_X.into(), vec3(x, 0.0, 0.0).into());
    solid.transformed(turn)
}

/// The arcade's archivolt from the nave to the aisle: hood mould, two rolls, soffit, chamfered back.
fn archivolt(thickness: f32) -> Vec<Reveal> {
    let mut line = vec![vec2(0.50, 0.0), vec2(0.49, -0.09), vec2(0.37, 0.0)];
    for centre in [vec2(0.27, 0.06), vec2(0.09, 0.24)] {
        line.extend(arc(centre, 0.065, -65.0, -255.0, 4));
        line.push(centre + vec2(-0.04, 0.12));
    }
    line.extend([vec2(0.0, 0.40), vec2(0.0, thickness - 0.24), vec2(0.24, thickness)]);
    line.iter().map(|p| Reveal { back: p.x, depth: p.y, sill: ARCADE_SPRINGING }).collect()
}

/// Arch and wall between two piers up to the clerestory.
pub fn arcade(m: &Palette) -> Solid {
    let thickness = NAVE_WALL[1] - NAVE_WALL[0];
    let panel = Panel { half_width: BAY / 2.0, bottom: ARCADE_SPRINGING, top: CLERESTORY, thickness };
    let opening = Opening {
        arch: PointedArch::new(2.2, 1.4),
        springing: ARCADE_SPRINGING + 0.02,
        sill: 0.0,
        segments: 7,
    };
    to_south(pierced(panel, opening, &archivolt(thickness), true, m), NAVE_WALL[0])
}

/// The upper wall with its window: splayed inside, steeply sloping sill, tracery near the outer face.
pub fn clerestory(m: &Palette) -> Solid {
    let thickness = NAVE_WALL[1] - NAVE_WALL[0];
    let panel = Panel { half_width: BAY / 2.0, bottom: CLERESTORY, top: NAVE_WALL_TOP, thickness };
    let opening = CLERESTORY_WINDOW;
    let mut solid = pierced(panel, opening, &splay(0.34, 0.8, opening.sill, thickness), false, m);
    solid.append(tracery::two_lights(opening, 0.72, m));
    to_south(solid, NAVE_WALL[0])
}

/// The aisle's outer wall with its window, a bench along its foot and a string course under the sill.
pub fn aisle(m: &Palette) -> Solid {
    let thickness = AISLE_WALL[1] - AISLE_WALL[0];
    let panel = Panel { half_width: BAY / 2.0, bottom: FOOTING, top: AISLE_WALL_TOP, thickness };
    let opening = AISLE_WINDOW;
    let mut solid = pierced(panel, opening, &splay(0.34, 0.5, opening.sill, thickness), false, m);
    solid.append(tracery::mullion(opening, 0.72, m));
    let half = BAY / 2.0;
    let bench: [(f32, f32); 6] =
        [(0.02, 0.0), (0.42, 0.0), (0.42, 0.40), (0.45, 0.42), (0.45, 0.48), (0.02, 0.48)];
    let course: [(f32, f32); 5] = [(0.02, 2.0), (0.05, 2.0), (0.11, 2.06), (0.11, 2.11), (0.02, 2.15)];
    for profile in [&bench[..], &course[..]] {
        // A prism runs along z; the wall along x. The quarter turn keeps the profile's x on the wall's normal.
        let outline: Vec<Vec2> = profile.iter().map(|(d, y)| vec2(-d, *y)).collect();
        let turn = Affine3A::from_cols(Vec3::NEG_Z.into(), Vec3::Y.into(), Vec3::X.into(), Vec3::ZERO.into());
        solid.append(prism(&outline, -half, half, m.trim).transformed(turn));
    }
    to_south(solid, AISLE_WALL[0])
}

/// A window's reveal: a roll at the inner edge, a splay of `back` metres whose sill drops by `drop`, a rebate.
pub fn splay(back: f32, drop: f32, sill: f32, thickness: f32) -> Vec<Reveal> {
    let line = |back: f32, depth: f32, lower: f32| Reveal { back, depth, sill: sill - lower };
    vec![
        line(back + 0.13, 0.0, drop + 0.10),
        line(back + 0.12, -0.045, drop + 0.10),
        line(back + 0.05, -0.045, drop + 0.04),
        line(back, 0.02, drop),
        line(0.0, 0.62, 0.0),
        line(0.0, thickness - 0.08, 0.0),
        line(0.08, thickness, 0.05),
    ]
}
