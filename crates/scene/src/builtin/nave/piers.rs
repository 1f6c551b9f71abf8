//! Piers of the arcade, the vaulting shafts above them, the responds along the aisle wall.

use glam::{Vec2, Vec3, vec2, vec3};

use super::super::{
    shape::{CREASE_DEG, arc, lathe, loft},
    solid::Solid,
    stage::Stage,
};
use super::{
    materials::Palette,
    plan::{AISLE_WALL, ARCADE_SPRINGING, NAVE_WALL, PIER, VAULT},
};
use crate::Id;

/// Meshes that stand at every line between bays, made for the south side.
pub fn meshes(stage: &mut Stage, m: &Palette) -> [Id; 3] {
    [
        stage.mesh("pier", pier(m).moved(vec3(PIER, 0.0, 0.0))),
        stage.mesh("vaulting shaft", vaulting_shaft(m)),
        stage.mesh("respond", respond(m)),
    ]
}

/// Outline of a pier about its axis: a round core, four strong shafts and four slender ones between them.
fn pier_section() -> Vec<Vec2> {
    let quarter = |axis: f32| {
        let turn = Vec2::from_angle(axis.to_radians());
        let shafts = [(0.0, 0.42, 0.16, 86.0, 4), (45.0, 0.44, 0.095, 88.0, 4)];
        shafts.into_iter().flat_map(move |(at, distance, radius, reach, segments)| {
            let turn = turn.rotate(Vec2::from_angle(f32::to_radians(at)));
            arc(vec2(distance, 0.0), radius, -reach, reach, segments).into_iter().map(move |p| turn.rotate(p))
        })
    };
    [0.0, 90.0, 180.0, 270.0].into_iter().flat_map(quarter).collect()
}

/// Octagon of this half width, at height y, flat towards the axes.
fn octagon(half_width: f32, y: f32) -> Vec<Vec3> {
    let r = half_width / 22.5f32.to_radians().cos();
    (0..8)
        .map(|i| (Vec2::from_angle((22.5 + 45.0 * i as f32).to_radians()) * r, y))
        .map(|(p, y)| vec3(p.x, y, p.y))
        .collect()
}

fn octagons(profile: &[(f32, f32)], material: Id) -> Solid {
    loft(&profile.iter().map(|(w, y)| octagon(*w, *y)).collect::<Vec<_>>(), 30.0, material)
}

/// A pier about the origin: octagonal plinth, moulded base, clustered shaft, bell capital, octagonal abacus.
fn pier(m: &Palette) -> Solid {
    let section = pier_section();
    // Height, growth outwards, and how much of the way to a round bell.
    let rings = [
        (0.36, 0.095, 0.35),
        (0.42, 0.115, 0.35),
        (0.50, 0.025, 0.1),
        (0.56, 0.055, 0.1),
        (0.60, 0.0, 0.0),
        (4.40, 0.0, 0.0),
        (4.44, 0.04, 0.0),
        (4.49, 0.0, 0.0),
        (4.72, 0.015, 0.25),
        (4.86, 0.06, 0.6),
        (4.95, 0.13, 0.9),
    ];
    let ring = |(y, grow, round): &(f32, f32, f32)| {
        let point = |p: &Vec2| {
            let r = p.length();
            let q = *p / r * (r + (0.55 - r) * round + grow);
            vec3(q.x, *y, q.y)
        };
        section.iter().map(point).collect::<Vec<_>>()
    };
    let mut out = loft(&rings.iter().map(ring).collect::<Vec<_>>(), 45.0, m.trim);
    out.append(octagons(&[(0.76, 0.0), (0.76, 0.20), (0.72, 0.24), (0.70, 0.24), (0.70, 0.36)], m.trim));
    out.append(octagons(
        &[(0.66, 4.95), (0.66, 4.99), (0.70, 5.03), (0.70, 5.14), (0.67, ARCADE_SPRINGING)],
        m.trim,
    ));
    out
}

/// Three shafts against the wall from the arcade capital to the vault's springing.
fn vaulting_shaft(m: &Palette) -> Solid {
    let face = NAVE_WALL[0];
    let back = vec2(face + 0.12, 0.0);
    // Counter-clockwise in (x, z) with the nave at −x; behind the face the ring runs inside the wall.
    let mut section = vec![vec2(face + 0.15, -0.30), vec2(face + 0.15, 0.30)];
    section.extend(arc(vec2(face - 0.01, 0.21), 0.085, 80.0, 220.0, 3));
    section.extend(arc(vec2(face - 0.07, 0.0), 0.135, 100.0, 260.0, 4));
    section.extend(arc(vec2(face - 0.01, -0.21), 0.085, 140.0, 280.0, 3));
    let rings = [
        (ARCADE_SPRINGING, 0.07),
        (ARCADE_SPRINGING + 0.14, 0.07),
        (ARCADE_SPRINGING + 0.18, 0.03),
        (ARCADE_SPRINGING + 0.24, 0.0),
        (VAULT[0] - 0.46, 0.0),
        (VAULT[0] - 0.43, 0.03),
        (VAULT[0] - 0.38, 0.0),
        (VAULT[0] - 0.24, 0.02),
        (VAULT[0] - 0.13, 0.09),
    ];
    let ring = |(y, grow): &(f32, f32)| {
        let point = |p: &Vec2| {
            let q = *p + (*p - back).normalize() * *grow;
            vec3(q.x, *y, q.y)
        };
        section.iter().map(point).collect::<Vec<_>>()
    };
    let mut out = loft(&rings.iter().map(ring).collect::<Vec<_>>(), CREASE_DEG, m.trim);
    let abacus = |grow: f32, y: f32| {
        let (front, half) = (face - 0.30 - grow, 0.42 + grow);
        [
            (face + 0.2, -half),
            (face + 0.2, half),
            (face - 0.08, half),
            (front, half - 0.24),
            (front, 0.24 - half),
            (face - 0.08, -half),
        ]
        .map(|(x, z)| vec3(x, y, z))
        .to_vec()
    };
    let top = VAULT[0];
    let rings =
        [abacus(-0.03, top - 0.13), abacus(0.0, top - 0.10), abacus(0.0, top - 0.03), abacus(-0.02, top)];
    out.append(loft(&rings, 30.0, m.trim));
    out
}

/// A half-round shaft against the aisle wall under the aisle vault.
fn respond(m: &Palette) -> Solid {
    let top = ARCADE_SPRINGING;
    let profile = [
        (0.30, 0.0),
        (0.30, 0.30),
        (0.25, 0.40),
        (0.17, 0.46),
        (0.17, top - 0.46),
        (0.22, top - 0.20),
        (0.29, top - 0.12),
        (0.32, top - 0.10),
        (0.32, top),
    ];
    lathe(&profile.map(|(r, y)| vec2(r, y)), 10, m.trim).moved(vec3(AISLE_WALL[0], 0.0, 0.0))
}
