//! The walls of a bay.

use glam::{Affine3A, Vec2, Vec3, vec2, vec3};

use super::super::{
    arch::{Opening, PointedArch},
    shape::{arc, prism},
    solid::Solid,
    wall::{Panel, Reveal, pierced},
};
use super::{
    materials::Palette,
    plan::{
        AISLE_WALL, AISLE_WALL_TOP, ARCADE_SPRINGING, BAY, CLERESTORY, FOOTING, NAVE_WALL, NAVE_WALL_TOP,
    },
    tracery,
};

/// The clerestory's windows.
pub const CLERESTORY_WINDOW: Opening =
    Opening { arch: PointedArch::new(1.5, 1.5), springing: 12.2, sill: 10.7, segments: 7 };
/// The aisles' windows.
pub const AISLE_WINDOW: Opening =
    Opening { arch: PointedArch::new(0.95, 1.5), springing: 5.3, sill: 2.7, segments: 6 };

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
    to_south(pierced(panel, opening, &archivolt(thickness), true, m.wall_and_trim()), NAVE_WALL[0])
}

/// The upper wall with its window: splayed inside, steeply sloping sill, tracery near the outer face.
pub fn clerestory(m: &Palette) -> Solid {
    let thickness = NAVE_WALL[1] - NAVE_WALL[0];
    let panel = Panel { half_width: BAY / 2.0, bottom: CLERESTORY, top: NAVE_WALL_TOP, thickness };
    let opening = CLERESTORY_WINDOW;
    let mut solid =
        pierced(panel, opening, &splay(0.34, 0.8, opening.sill, thickness), false, m.wall_and_trim());
    solid.append(tracery::two_lights(opening, 0.72, m));
    to_south(solid, NAVE_WALL[0])
}

/// The aisle's outer wall with its window, a bench along its foot and a string course under the sill.
pub fn aisle(m: &Palette) -> Solid {
    let thickness = AISLE_WALL[1] - AISLE_WALL[0];
    let panel = Panel { half_width: BAY / 2.0, bottom: FOOTING, top: AISLE_WALL_TOP, thickness };
    let opening = AISLE_WINDOW;
    let mut solid =
        pierced(panel, opening, &splay(0.34, 0.5, opening.sill, thickness), false, m.wall_and_trim());
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
