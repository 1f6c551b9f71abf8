//! What closes the nave: floor, end walls, roofs, buttresses. Bodies overlap, so that no light slips between them.

use glam::{Vec2, Vec3, vec2, vec3};

use super::super::{
    arch::{Opening, PointedArch},
    shape::{Joins, bevelled, circle, cuboid, prism, skin},
    solid::Solid,
    stage::Stage,
    wall::{Panel, Reveal, finish, pierced},
};
use super::{
    materials::Palette,
    plan::{
        AISLE_AXIS, AISLE_WALL, AISLE_WALL_TOP, BAY, BAYS, END_WALL, FOOTING, HALF_LENGTH, NAVE_WALL,
        NAVE_WALL_TOP, on_both_sides,
    },
    tracery,
    walls::splay,
};

/// Where the end walls' lower panels end and the rose's panel begins.
const ROSE_PANEL: f32 = 8.2;
/// Centre and radius of the rose.
const ROSE: (f32, f32) = (11.65, 2.85);

/// The windows at the aisles' ends.
pub const AISLE_END_WINDOW: Opening =
    Opening { arch: PointedArch::new(0.6, 1.7), springing: 5.0, sill: 2.9, segments: 7 };
/// The window over the door.
pub const WEST_WINDOW: Opening =
    Opening { arch: PointedArch::new(1.7, 1.5), springing: 11.4, sill: 9.7, segments: 10 };

/// Places everything.
pub fn place(stage: &mut Stage, m: &Palette) {
    floor(stage, m);
    let east = vec3(0.0, 0.0, -HALF_LENGTH);
    let west = vec3(0.0, 0.0, HALF_LENGTH);

    let rose = stage.mesh("rose window", rose_wall(m));
    let lancet = stage.mesh("east lancet", lancet(m));
    let corner = stage.mesh("end wall piers", end_piers(m));
    let aisle_end = stage.mesh("aisle end", aisle_end(m));
    let front = stage.mesh("west front", west_front(m));
    stage.place(rose, east, false);
    for i in -1..=1 {
        stage.place(lancet, east + vec3(2.7 * i as f32, 0.0, 0.0), false);
    }
    stage.place(front, west, true);
    for (end, turned) in [(east, false), (west, true)] {
        stage.place(corner, end, turned);
        stage.place(aisle_end, end + vec3(AISLE_AXIS, 0.0, 0.0), turned);
        stage.place(aisle_end, end - vec3(AISLE_AXIS, 0.0, 0.0), turned);
    }
    roofs(stage, m);
    buttresses(stage, m);
    string_courses(stage, m);
}

fn floor(stage: &mut Stage, m: &Palette) {
    let z = HALF_LENGTH + END_WALL;
    let strip = |from: f32, to: f32, material| cuboid(vec3(from, -0.5, -z), vec3(to, 0.0, z), material);
    let (tiles, kerb, outer) = (3.7, 5.3, AISLE_WALL[1] - 0.1);
    stage.body("nave floor", strip(-tiles, tiles, m.tiles));
    let mut rest = Solid::default();
    for (from, to, material) in [(tiles, kerb, m.trim), (kerb, outer, m.flags)] {
        rest.append(strip(from, to, material));
        rest.append(strip(-to, -from, material));
    }
    stage.body("aisle floors", rest);
}

/// The wall with the rose, its inner face at z = 0.
fn rose_wall(m: &Palette) -> Solid {
    let centre = vec2(0.0, ROSE.0);
    let (half, bottom, top) = (NAVE_WALL[0], ROSE_PANEL, NAVE_WALL_TOP);
    let sides = 48;
    // The hole starts at the panel's lower right corner, so that quarters of both meet.
    let start = Vec2::from_angle(-std::f32::consts::FRAC_PI_4);
    let hole = |radius: f32, depth: f32| {
        circle(sides, radius).iter().map(|p| (centre + start.rotate(*p)).extend(-depth)).collect::<Vec<_>>()
    };
    let corners = [vec2(half, bottom), vec2(half, top), vec2(-half, top), vec2(-half, bottom)];
    let edge = |depth: f32| {
        let quarter = sides / 4;
        let point = |i: usize| {
            corners[i / quarter].lerp(corners[(i / quarter + 1) % 4], (i % quarter) as f32 / quarter as f32)
        };
        (0..sides).map(|i| point(i).extend(-depth)).collect::<Vec<Vec3>>()
    };
    let profile = [
        (0.30, 0.0),
        (0.30, -0.06),
        (0.20, -0.06),
        (0.16, 0.02),
        (0.08, 0.40),
        (0.08, 0.46),
        (0.0, 0.5),
        (0.0, 1.1),
        (0.1, END_WALL),
    ];
    let mut rings = vec![edge(0.0)];
    rings.extend(profile.iter().map(|(back, depth)| hole(ROSE.1 + back, *depth)));
    rings.push(edge(END_WALL));
    let outer = profile.len();
    let wall = skin(&rings, Joins { ring: true, path: true }, |strip| {
        if strip == 0 || strip >= outer { m.wall } else { m.trim }
    });
    let mut out = finish(wall, m.wall);
    out.append(tracery::rose(centre, ROSE.1, 0.72, m));
    let disc: Vec<Vec2> = circle(48, ROSE.1 + 0.08).iter().map(|p| *p + centre).collect();
    out.append(tracery::pane(&disc, 0.74, m.rose_glass));
    out
}

/// One of the three windows under the rose.
fn lancet(m: &Palette) -> Solid {
    let panel = Panel { half_width: 1.35, bottom: FOOTING, top: ROSE_PANEL, thickness: END_WALL };
    let opening = Opening { arch: PointedArch::new(0.62, 1.7), springing: 6.0, sill: 3.2, segments: 8 };
    let mut out =
        pierced(panel, opening, &splay(0.30, 0.3, opening.sill, END_WALL), false, m.wall_and_trim());
    out.append(tracery::saddle_bars(opening, 0.74, m));
    out.append(tracery::pane(&tracery::lancet_outline(opening), 0.76, m.lancet_glass));
    out
}

/// Where end walls and side walls meet, from the footing to the roof.
fn end_piers(m: &Palette) -> Solid {
    let mut out = Solid::default();
    for side in [-1.0, 1.0] {
        for ([from, to], top) in [(NAVE_WALL, NAVE_WALL_TOP), (AISLE_WALL, AISLE_WALL_TOP)] {
            let (a, b) = (side * from, side * to);
            out.append(cuboid(vec3(a.min(b), FOOTING, -END_WALL), vec3(a.max(b), top, 0.0), m.wall));
        }
    }
    out
}

/// An aisle's end wall with a lancet, about its own middle.
fn aisle_end(m: &Palette) -> Solid {
    let half_width = (AISLE_WALL[0] - NAVE_WALL[1]) / 2.0;
    let panel = Panel { half_width, bottom: FOOTING, top: AISLE_WALL_TOP, thickness: END_WALL };
    let opening = AISLE_END_WINDOW;
    pierced(panel, opening, &splay(0.30, 0.3, opening.sill, END_WALL), false, m.wall_and_trim())
}

/// Door and window in the west.
fn west_front(m: &Palette) -> Solid {
    let lower = Panel { half_width: NAVE_WALL[0], bottom: FOOTING, top: ROSE_PANEL, thickness: END_WALL };
    let door = Opening { arch: PointedArch::new(1.5, 1.6), springing: 3.2, sill: 0.0, segments: 9 };
    // The threshold lies under the floor; its slope keeps every face of it from vanishing.
    let line = |back: f32, depth: f32| Reveal { back, depth, sill: -0.02 - 0.2 * back };
    let steps = [
        line(0.55, 0.0),
        line(0.55, -0.06),
        line(0.44, -0.06),
        line(0.38, 0.0),
        line(0.22, 0.06),
        line(0.22, 0.22),
        line(0.08, 0.26),
        line(0.0, 0.42),
        line(0.0, END_WALL),
    ];
    let mut out = pierced(lower, door, &steps, false, m.wall_and_trim());
    let leaf = door.widened(0.1, -0.1).outline();
    out.append(prism(&leaf, -0.80, -0.70, m.oak));
    for i in -2..=2 {
        let x = 0.6 * i as f32;
        let top = door.springing + door.arch.height(x) - 0.02;
        out.append(cuboid(vec3(x - 0.04, 0.0, -0.72), vec3(x + 0.04, top, -0.66), m.oak));
    }
    let upper = Panel { bottom: ROSE_PANEL, top: NAVE_WALL_TOP, ..lower };
    let window = WEST_WINDOW;
    out.append(pierced(upper, window, &splay(0.34, 0.3, window.sill, END_WALL), false, m.wall_and_trim()));
    out.append(tracery::two_lights(window, 0.8, m));
    out
}

fn roofs(stage: &mut Stage, m: &Palette) {
    let z = HALF_LENGTH + END_WALL + 0.15;
    let eaves = NAVE_WALL[1] + 0.35;
    let nave = [(-eaves, 16.2), (eaves, 16.2), (eaves, 16.6), (0.0, 22.2), (-eaves, 16.6)];
    stage.body("nave roof", prism(&nave.map(|(x, y)| vec2(x, y)), -z, z, m.lead));
    // Rises into the wall just under the clerestory's sills, and covers the aisle vaults.
    let inner = NAVE_WALL[0] + 0.45;
    let outer = AISLE_WALL[1] + 0.3;
    let aisle = [(inner, 8.95), (outer, 8.95), (outer, 9.25), (NAVE_WALL[1], 10.45), (inner, 10.45)];
    let mut both = prism(&aisle.map(|(x, y)| vec2(x, y)), -z, z, m.lead);
    both.append(both.clone().turned(std::f32::consts::PI));
    stage.body("aisle roofs", both);
}

fn buttresses(stage: &mut Stage, m: &Palette) {
    // Along the wall in z, stepping out in x with sloping set-offs.
    let (a, b) = (AISLE_WALL[1] - 0.2, AISLE_WALL[1]);
    let aisle =
        [(a, -0.5), (b + 1.2, -0.5), (b + 1.2, 4.2), (b + 0.8, 4.8), (b + 0.8, 7.4), (b, 8.5), (a, 8.5)];
    let w = NAVE_WALL[1];
    let nave = [(w - 0.2, 9.2), (w + 0.35, 9.2), (w + 0.35, 15.2), (w, 15.9), (w - 0.2, 15.9)];
    let mut solid = prism(&aisle.map(|(x, y)| vec2(x, y)), -0.45, 0.45, m.wall);
    solid.append(prism(&nave.map(|(x, y)| vec2(x, y)), -0.4, 0.4, m.wall));
    let mesh = stage.mesh("buttress", solid);
    for line in 0..=BAYS {
        on_both_sides(stage, mesh, -HALF_LENGTH + BAY * line as f32);
    }
    let (x, z) = (AISLE_WALL[1] + 0.05, HALF_LENGTH + END_WALL);
    let mut plinths = cuboid(vec3(x - 0.15, -0.5, -z), vec3(x + 0.15, 0.6, z), m.trim);
    plinths.append(cuboid(vec3(-x - 0.15, -0.5, -z), vec3(0.15 - x, 0.6, z), m.trim));
    stage.body("plinths", plinths);
}

/// Mouldings along the nave walls under the clerestory, and a band across the end walls.
fn string_courses(stage: &mut Stage, m: &Palette) {
    let face = NAVE_WALL[0];
    let profile = [(0.05, 8.96), (-0.04, 8.96), (-0.13, 9.06), (-0.13, 9.12), (-0.09, 9.15), (0.05, 9.22)];
    let outline = profile.map(|(x, y)| vec2(face + x, y));
    let mut both = prism(&outline, -HALF_LENGTH - 0.05, HALF_LENGTH + 0.05, m.trim);
    both.append(both.clone().turned(std::f32::consts::PI));
    let band = HALF_LENGTH + 0.1;
    both.append(bevelled(vec3(-face, 8.06, -band), vec3(face, 8.26, 0.16 - HALF_LENGTH), 0.05, m.trim));
    both.append(bevelled(vec3(-face, 2.55, -band), vec3(face, 2.70, 0.12 - HALF_LENGTH), 0.04, m.trim));
    stage.body("string courses", both);
}
