//! A cobra that dances out of its basket: bent by a skin, its hood spread by a morph target.

mod room;

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec3, Vec4, vec2, vec3};

use super::{
    curve::{frames_from, tube},
    grid::Grid,
    shape::{Frame, ball},
    stage::{Stage, plain, spot},
    texture::{Noise, Surface, hash},
};
use crate::{
    Animation, Channel, Id, Interpolation, Keys, Material, MorphTarget, Node, Primitive, Scene, Skin,
    Transform,
};

/// The dance's length, seconds; every movement's period divides it.
const DANCE_S: f32 = 8.0;
/// Keys of every channel.
const KEYS: usize = 96;
/// Joints in the raised part.
const JOINTS: usize = 11;
/// Length of the raised part from the nose, metres.
const RAISED_M: f32 = 1.02;
/// Vertices around the body, the seam twice, and along it.
const BODY: [usize; 2] = [65, 481];

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("dancer");
    room::place(&mut stage);
    room::basket(&mut stage);
    cobra(&mut stage);

    // Low from the right, so that the shadow dances on the wall as large as life.
    let neck = vec3(0.0, 0.82, 0.0);
    stage.light(
        "lamp",
        spot(13.0, 24.0),
        vec3(1.0, 0.74, 0.44),
        2_600.0,
        vec3(1.75, 1.55, 2.1),
        neck - Vec3::Y * 0.1,
    );
    stage.light("moon", spot(20.0, 45.0), vec3(0.45, 0.62, 1.0), 260.0, vec3(-2.0, 2.4, 0.7), neck);
    stage.camera("dancer", vec3(0.50, 0.98, 2.05), vec3(-0.16, 0.62, 0.0), 38.0);
    stage.camera("hood", vec3(-0.42, 1.12, 1.02), vec3(-0.02, 0.90, 0.0), 38.0);
    stage.camera("carpet", vec3(1.1, 1.75, 2.1), vec3(-0.12, 0.35, 0.0), 40.0);
    stage.scene
}

/// The body's middle line from the nose to the tail, in small steps.
fn spine() -> Vec<Vec3> {
    let mut marks: Vec<Vec3> = [
        (0.0, 1.085, 0.105),
        (0.0, 1.098, 0.055),
        (0.0, 1.085, 0.0),
        (0.0, 1.02, -0.045),
        (0.0, 0.92, -0.06),
        (0.0, 0.80, -0.045),
        (0.0, 0.66, -0.005),
        (0.0, 0.52, 0.03),
        (0.0, 0.40, 0.03),
        (0.025, 0.305, 0.017),
        (0.053, 0.262, -0.016),
        (0.041, 0.230, -0.080),
        (-0.033, 0.203, -0.115),
    ]
    .map(|(x, y, z)| vec3(x, y, z))
    .to_vec();
    // Three turns on the basket's floor, against the clock as seen from above.
    marks.extend((0..22).map(|k| {
        let angle = 1.75 + std::f32::consts::FRAC_PI_4 * (k + 1) as f32;
        let (r, y) = (0.135 + 0.008 * (k as f32 * 1.3).sin(), 0.178 - 0.0055 * k as f32);
        vec3(r * angle.cos(), y, -r * angle.sin())
    }));
    let at = |i: i32| marks[i.clamp(0, marks.len() as i32 - 1) as usize];
    let steps = 24;
    let mut out = Vec::new();
    for i in 0..marks.len() as i32 - 1 {
        for k in 0..steps {
            // Catmull and Rom 1974.
            let t = k as f32 / steps as f32;
            let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            let (t2, t3) = (t * t, t * t * t);
            out.push(
                0.5 * (2.0 * b
                    + (c - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * t2
                    + (3.0 * b - a - 3.0 * c + d) * t3),
            );
        }
    }
    out.push(at(i32::MAX));
    out
}

/// Points at even distances along a line, as many as rows of the body, and the line's length.
fn evenly(line: &[Vec3]) -> (Vec<Vec3>, f32) {
    let mut way = vec![0.0];
    for pair in line.windows(2) {
        way.push(way[way.len() - 1] + pair[0].distance(pair[1]));
    }
    let length = way[way.len() - 1];
    let point = |row: usize| {
        let d = length * row as f32 / (BODY[1] - 1) as f32;
        let i = way.partition_point(|&w| w <= d).clamp(1, line.len() - 1);
        line[i - 1].lerp(line[i], (d - way[i - 1]) / (way[i] - way[i - 1]).max(1e-9))
    };
    ((0..BODY[1]).map(point).collect(), length)
}

/// Value of a smooth line through (place, value) marks.
fn along(marks: &[(f32, f32)], x: f32) -> f32 {
    let i = marks.partition_point(|m| m.0 <= x).clamp(1, marks.len() - 1);
    let ((x0, y0), (x1, y1)) = (marks[i - 1], marks[i]);
    let t = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
    y0 + (y1 - y0) * t * t * (3.0 - 2.0 * t)
}

/// A point of the skin: `d` metres from the nose, at `angle` around; `hood` and `breath` are morph weights.
fn skin_point(frame: &Frame, d: f32, length_m: f32, angle: f32, hood: f32, breath: f32) -> Vec3 {
    let width = along(
        &[
            (0.0, 0.010),
            (0.030, 0.026),
            (0.062, 0.034),
            (0.115, 0.021),
            (0.16, 0.030),
            (0.25, 0.036),
            (0.36, 0.030),
            (0.6, 0.031),
            (1.0, 0.036),
            (2.0, 0.036),
            (length_m, 0.010),
        ],
        d,
    );
    let height = along(
        &[
            (0.0, 0.008),
            (0.030, 0.018),
            (0.062, 0.0225),
            (0.115, 0.019),
            (0.25, 0.021),
            (0.40, 0.028),
            (0.6, 0.031),
            (1.0, 0.036),
            (2.0, 0.036),
            (length_m, 0.010),
        ],
        d,
    );
    // Rounded ends.
    let end = |x: f32, over: f32| (1.0 - (1.0 - (x / over).clamp(0.0, 1.0)).powi(2)).sqrt().max(0.15);
    let round = end(d, 0.018) * end(length_m - d, 0.03);
    let bump = |middle: f32, wide: f32| (-((d - middle) / wide).powi(2)).exp();
    let (spread, swell) = (hood * bump(0.235, 0.078), breath * bump(0.62, 0.13));
    let (c, s) = (angle.cos(), angle.sin());
    let w = (width + 0.080 * spread + 0.007 * swell) * round;
    let h = (height - 0.008 * spread + 0.007 * swell) * round;
    // The spread hood is cupped forward and thin at its rim.
    let cupped = 0.024 * spread * (c * c - 0.3);
    frame.origin + frame.x * (w * c) + frame.y * (h * s * (1.0 - 0.45 * spread * c * c) + cupped)
}

fn cobra(stage: &mut Stage) {
    let (points, length_m) = evenly(&spine());
    let frames = frames_from(&points, false, Vec3::X);
    let hide = hide(stage);
    let row_m = length_m / (BODY[1] - 1) as f32;
    let grid = Grid { columns: BODY[0], rows: BODY[1], closes: [true, false] };
    let shape = |hood: f32, breath: f32| {
        grid.primitive(hide, true, |column, row| {
            let (around, d) = (column as f32 / (BODY[0] - 1) as f32, row as f32 * row_m);
            let p = skin_point(&frames[row], d, length_m, around * TAU, hood, breath);
            (p, vec2(around, d / 0.22))
        })
    };
    let mut body = shape(0.0, 0.0);
    let target = |other: Primitive| MorphTarget {
        positions: other.positions.iter().zip(&body.positions).map(|(a, b)| *a - *b).collect(),
        normals: other.normals.iter().zip(&body.normals).map(|(a, b)| *a - *b).collect(),
        tangents: other.tangents.iter().zip(&body.tangents).map(|(a, b)| (*a - *b).truncate()).collect(),
    };
    let targets = vec![target(shape(1.0, 0.0)), target(shape(0.0, 1.0))];
    body.morph_targets = targets;
    close_ends(&mut body);

    // Joints from the basket's rim up to the head; each takes over from the one below.
    let spacing = RAISED_M / (JOINTS - 1) as f32;
    let height_on_joints =
        |row: usize| ((RAISED_M - row as f32 * row_m) / spacing).clamp(0.0, JOINTS as f32 - 1.0);
    for i in 0..body.positions.len() {
        let at = height_on_joints(i / BODY[0]);
        let below = (at as usize).min(JOINTS - 2);
        let share = at - below as f32;
        body.joints.push([below as u16, below as u16 + 1, 0, 0]);
        body.joint_weights.push(Vec4::new(1.0 - share, share, 0.0, 0.0));
    }
    let place = |joint: usize| {
        points[(((RAISED_M - joint as f32 * spacing) / row_m).round() as usize).min(BODY[1] - 1)]
    };
    let first = stage.scene.nodes.len();
    for joint in 0..JOINTS {
        let below = if joint == 0 { Vec3::ZERO } else { place(joint - 1) };
        stage.scene.nodes.push(Node {
            name: format!("joint {joint}"),
            parent: joint.checked_sub(1).map(|below| first + below),
            parent_from_node: Transform::Trs {
                translation: place(joint) - below,
                rotation: Quat::IDENTITY,
                scale: Vec3::ONE,
            },
            ..Node::default()
        });
    }
    stage.scene.skins.push(Skin {
        name: "spine".to_owned(),
        joints: (first..first + JOINTS).collect(),
        joint_from_object: (0..JOINTS).map(|joint| Affine3A::from_translation(-place(joint))).collect(),
    });
    let mesh = stage.add("cobra", vec![body]);
    stage.scene.meshes[mesh].morph_weights = vec![0.6, 0.0];
    stage.place(mesh, Vec3::ZERO, false);
    let node = stage.scene.nodes.len() - 1;
    stage.scene.nodes[node].skin = Some(stage.scene.skins.len() - 1);

    let head = first + JOINTS - 1;
    let tongue = face(stage, head, place(JOINTS - 1));
    stage.scene.animations.push(dance(first, node, tongue));
}

/// Flat caps over the first and the last ring.
fn close_ends(body: &mut Primitive) {
    let ring = (BODY[0] - 1) as u32;
    let last = ((BODY[1] - 1) * BODY[0]) as u32;
    for i in 1..ring - 1 {
        body.indices.extend([0, i + 1, i]);
        body.indices.extend([last, last + i, last + i + 1]);
    }
}

/// Eyes and a tongue at the head joint; returns the tongue's node.
fn face(stage: &mut Stage, head: Id, head_at: Vec3) -> Id {
    let black = stage.material(plain("eye", vec3(0.012, 0.008, 0.006), 0.08));
    let red = stage.material(plain("tongue", vec3(0.30, 0.03, 0.035), 0.45));
    let eye = stage.mesh("eye", ball(0.0052, 3, black));
    for side in [-1.0, 1.0] {
        let node = stage.place_turned(eye, vec3(side * 0.0255, 1.104, 0.068) - head_at, 0.0, 1.0);
        stage.scene.nodes[node].parent = Some(head);
    }
    let mut fork = tube(&[Vec3::ZERO, vec3(0.0, -0.003, 0.032)], |_| 0.0016, 8, red);
    for side in [-1.0, 1.0] {
        let line =
            [vec3(0.0, -0.003, 0.030), vec3(side * 0.004, -0.006, 0.046), vec3(side * 0.010, -0.005, 0.060)];
        fork.append(tube(&line, |i| 0.0014 - 0.0004 * i as f32, 8, red));
    }
    let mesh = stage.mesh("tongue", fork);
    let node = stage.place_turned(mesh, vec3(0.0, 1.077, 0.094) - head_at, 0.0, 1.0);
    stage.scene.nodes[node].parent = Some(head);
    node
}

/// Sways in a wave that runs up the neck; the head stays level, the hood spreads and folds, the tongue flicks.
fn dance(first: Id, body: Id, tongue: Id) -> Animation {
    let times: Vec<f32> = (0..=KEYS).map(|k| DANCE_S * k as f32 / KEYS as f32).collect();
    let turn = |t: f32, per_dance: f32, phase: f32| (TAU * (per_dance * t / DANCE_S - phase)).sin();
    let mut channels = Vec::new();
    let linear = |node: Id, keys: Keys| Channel {
        node,
        times_s: times.clone(),
        interpolation: Interpolation::Linear,
        keys,
    };
    let bend = |joint: usize, t: f32| {
        let j = joint as f32 / (JOINTS - 1) as f32;
        // Zero at the rim, so that the basket holds the body.
        let reach = (j * 2.2).min(1.0);
        let side = reach * (0.115 * turn(t, 2.0, 0.42 * j) + 0.04 * turn(t, 5.0, 0.7 * j));
        let nod = reach * (0.055 * turn(t, 4.0, 0.35 * j + 0.1) - 0.01);
        let twist = reach * 0.05 * turn(t, 1.0, 0.2 * j);
        vec3(nod, twist, side)
    };
    for joint in 1..JOINTS {
        let pose = |&t: &f32| {
            let mut angles = bend(joint, t);
            if joint == JOINTS - 1 {
                // What the neck turned is taken back by most.
                let below: Vec3 = (1..JOINTS - 1).map(|j| bend(j, t)).sum();
                angles = below * vec3(-0.9, -0.5, -0.85);
            }
            Quat::from_rotation_z(angles.z)
                * Quat::from_rotation_y(angles.y)
                * Quat::from_rotation_x(angles.x)
        };
        channels.push(linear(first + joint, Keys::Rotation(times.iter().map(pose).collect())));
    }
    let hood = |t: f32| 0.68 + 0.32 * turn(t, 2.0, 0.15);
    let weights = times.iter().flat_map(|&t| [hood(t), 0.5 + 0.5 * turn(t, 3.0, 0.0)]).collect();
    channels.push(linear(body, Keys::MorphWeights(weights)));
    let flick = |&t: &f32| {
        let out = turn(t, 3.0, 0.1).max(0.0).powi(3) * (0.75 + 0.25 * turn(t, 24.0, 0.0));
        vec3(1.0, 1.0, 0.05 + 0.95 * out)
    };
    channels.push(linear(tongue, Keys::Scale(times.iter().map(flick).collect())));
    Animation { name: "dance".to_owned(), channels }
}

/// Olive scales, a pale belly with bars; u runs once around, v repeats.
fn hide(stage: &mut Stage) -> Id {
    const ACROSS: f32 = 44.0;
    const DOWN: f32 = 36.0;
    let clouds = Noise::new(1024, glam::IVec2::splat(6), 4, 5);
    let paint = Surface::paint(1024, |uv| {
        // The belly looks along the frames' y, a quarter turn from u = 0.
        let from_belly = ((uv.x - 0.25).abs()).min(1.0 - (uv.x - 0.25).abs()) * 2.0;
        let belly = 1.0 - ((from_belly - 0.24) / 0.05).clamp(0.0, 1.0);
        // Scales in diamonds; on the belly one broad plate a row.
        let (a, b) = (uv.x * ACROSS, uv.y * DOWN);
        let (p, q) = (f32::midpoint(a, b), f32::midpoint(a, -b));
        let cell = vec2(p - p.floor(), q - q.floor()) - 0.5;
        let dome = (1.0 - 2.1 * cell.length_squared() - 0.9 * (cell.x * cell.y).abs()).max(0.0);
        let plate_at = (uv.y * DOWN / 2.0).fract();
        let plate = (plate_at * (1.0 - plate_at) * 4.0).powf(0.35);
        let tone = 1.0
            + 0.35 * (hash((p.floor() as i32).rem_euclid(40), (q.floor() as i32).rem_euclid(40), 9) - 0.5);
        let cloud = clouds.at(uv);
        let back =
            vec3(0.155, 0.120, 0.045).lerp(vec3(0.055, 0.040, 0.018), (0.5 + 2.2 * cloud).clamp(0.0, 1.0));
        let back = back * tone * (0.45 + 0.75 * dome);
        let bar = if (uv.y * 3.0).fract() < 0.28 { 0.35 } else { 1.0 };
        let pale = vec3(0.60, 0.47, 0.24) * bar * (0.55 + 0.45 * plate);
        (back.lerp(pale, belly), 0.0011 * (dome * (1.0 - belly) + 0.6 * plate * belly))
    });
    let color = stage.image(paint.base_color("cobra colour"), 1.0);
    let normal = stage.image(paint.normal("cobra normals", 0.22), 1.0);
    stage.material(Material {
        base_color_texture: Some(color),
        normal_texture: Some(normal),
        ..plain("cobra", Vec3::ONE, 0.32)
    })
}
