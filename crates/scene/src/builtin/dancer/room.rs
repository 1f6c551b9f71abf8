//! Where the cobra dances: a basket on a carpet, a floor, a wall, a few things.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Quat, Vec2, Vec3, vec2, vec3};

use super::super::{
    shape::{bevelled, circle, cuboid, lathe, lathe_ring},
    solid::Solid,
    stage::{Stage, metal, plain},
    texture::{Masonry, Noise, Surface, dressed_stone, hash, wood},
};
use crate::Material;

/// A round basket of willow, open at the top, and its lid beside it.
pub fn basket(stage: &mut Stage) {
    let weave = Noise::new(512, glam::ivec2(64, 64), 2, 3);
    let paint = Surface::paint(512, |uv| {
        // Rods over and under stakes, every other row shifted.
        let (rows, stakes) = (8.0, 4.0);
        let row = (uv.y * rows) as i32;
        let shift = if row % 2 == 0 { 0.0 } else { 0.5 };
        let wave = ((uv.x * stakes + shift) * TAU).cos();
        let y = (uv.y * rows).fract() - 0.5;
        let rod = (1.0 - 4.0 * y * y).max(0.0).sqrt();
        let tone = 0.75
            + 0.35 * wave
            + 0.25 * (hash(row, (uv.x * stakes + shift) as i32 % 4, 5) - 0.5)
            + 0.4 * weave.at(uv);
        (vec3(0.36, 0.215, 0.095) * tone * (0.35 + 0.65 * rod), 0.0045 * rod + 0.0035 * wave)
    });
    // A whole number of repeats around the widest ring.
    let side_m = TAU * 0.255 / 18.0;
    let [base_color_texture, normal_texture] = stage.surface("willow", &paint, side_m);
    let willow =
        stage.material(Material { base_color_texture, normal_texture, ..plain("willow", Vec3::ONE, 0.65) });
    let rim = stage.material(plain("willow rim", vec3(0.26, 0.145, 0.06), 0.6));
    let profile = [
        (0.205, 0.0),
        (0.222, 0.02),
        (0.245, 0.09),
        (0.255, 0.16),
        (0.247, 0.23),
        (0.218, 0.285),
        (0.196, 0.30),
        (0.182, 0.298),
        (0.205, 0.278),
        (0.232, 0.225),
        (0.239, 0.16),
        (0.230, 0.09),
        (0.206, 0.03),
        (0.19, 0.022),
    ];
    let floor = CARPET_M;
    stage.body("basket", lathe(&profile.map(|(r, y)| vec2(r, y)), 72, willow).moved(Vec3::Y * floor));
    let hoop = |radius: f32, y: f32, thick: f32| {
        let profile: Vec<Vec2> = circle(10, thick).iter().map(|p| vec2(radius + p.x, y + p.y)).collect();
        lathe_ring(&profile, 72, rim)
    };
    let mut hoops = hoop(0.190, 0.302, 0.011);
    hoops.append(hoop(0.212, 0.008, 0.010));
    stage.body("basket hoops", hoops.moved(Vec3::Y * floor));
    // The lid leans against the basket.
    let lid = [
        (0.20, 0.0),
        (0.205, 0.012),
        (0.17, 0.045),
        (0.09, 0.075),
        (0.02, 0.085),
        (0.02, 0.10),
        (0.012, 0.11),
    ];
    let solid = lathe(&lid.map(|(r, y)| vec2(r, y)), 64, willow);
    let leaning = Affine3A::from_rotation_translation(
        Quat::from_rotation_y(-0.9) * Quat::from_rotation_z(-1.12),
        vec3(0.405, floor + 0.187, 0.20),
    );
    stage.body("lid", solid.transformed(leaning));
}

/// Thickness of the carpet, metres.
const CARPET_M: f32 = 0.012;

/// Floor, wall, carpet, a clay jar, a flute.
pub fn place(stage: &mut Stage) {
    let paving = Masonry {
        side_m: 2.4,
        courses: 4,
        stones: 3,
        joint_m: 0.008,
        stone: vec3(0.36, 0.31, 0.25),
        mortar: vec3(0.16, 0.14, 0.12),
        variation: 0.12,
        seed: 61,
    };
    let [base_color_texture, normal_texture] = stage.surface("flags", &paving.paint(1024), 2.4);
    let flags =
        stage.material(Material { base_color_texture, normal_texture, ..plain("flags", Vec3::ONE, 0.6) });
    let [base_color_texture, normal_texture] =
        stage.surface("clay plaster", &dressed_stone(1024, 1, 2.5, vec3(0.56, 0.40, 0.27), 63), 2.5);
    let plaster = stage.material(Material {
        base_color_texture,
        normal_texture,
        ..plain("clay plaster", Vec3::ONE, 0.92)
    });
    stage.body("floor", cuboid(vec3(-7.0, -0.2, -1.5), vec3(7.0, 0.0, 4.0), flags));
    stage.body("wall", cuboid(vec3(-7.0, 0.0, -1.5), vec3(7.0, 3.2, -1.2), plaster));
    stage.body("plinth course", bevelled(vec3(-7.0, 0.0, -1.22), vec3(7.0, 0.22, -1.17), 0.01, flags));

    let weave = Noise::new(1024, glam::IVec2::splat(200), 2, 65);
    let paint = Surface::paint(1024, |uv| (carpet(uv) * (0.85 + 0.5 * weave.at(uv)), 0.0016 * weave.at(uv)));
    let [color, normal] = [paint.base_color("carpet colour"), paint.normal("carpet normals", 1.5)];
    let fit = |texture| {
        let scale = glam::Affine2::from_scale(1.0 / vec2(1.9, 1.3));
        crate::TextureRef { uv_transform: glam::Affine2::from_translation(vec2(0.5, 0.5)) * scale, ..texture }
    };
    let (color, normal) = (stage.image(color, 1.0), stage.image(normal, 1.0));
    let wool = stage.material(Material {
        base_color_texture: Some(fit(color)),
        normal_texture: Some(fit(normal)),
        ..plain("carpet", Vec3::ONE, 0.95)
    });
    stage.body("carpet", bevelled(vec3(-0.949, -0.01, -0.649), vec3(0.949, CARPET_M, 0.649), 0.004, wool));

    let clay = stage.material(plain("fired clay", vec3(0.42, 0.17, 0.085), 0.7));
    let jar = [
        (0.09, 0.0),
        (0.10, 0.01),
        (0.155, 0.14),
        (0.165, 0.22),
        (0.135, 0.33),
        (0.065, 0.40),
        (0.058, 0.44),
        (0.082, 0.475),
        (0.078, 0.482),
        (0.05, 0.44),
        (0.05, 0.40),
    ];
    let jar = lathe(&jar.map(|(r, y)| vec2(r, y)), 64, clay);
    stage.body("jar", jar.moved(vec3(-0.98, 0.0, -0.75)));
    let brass = stage.material(metal("brass", vec3(0.91, 0.70, 0.34), 0.25));
    let [base_color_texture, normal_texture] =
        stage.surface("rosewood", &wood(512, vec3(0.16, 0.06, 0.03), 67), 0.25);
    let rosewood =
        stage.material(Material { base_color_texture, normal_texture, ..plain("rosewood", Vec3::ONE, 0.35) });
    let mut flute: Solid =
        lathe(&[vec2(0.011, 0.0), vec2(0.012, 0.30), vec2(0.016, 0.40), vec2(0.026, 0.44)], 32, rosewood);
    for y in [0.02, 0.30, 0.375] {
        flute.append(lathe(
            &[vec2(0.0125, y), vec2(0.0155, y + 0.004), vec2(0.0155, y + 0.012), vec2(0.0125, y + 0.016)],
            32,
            brass,
        ));
    }
    let lying = Affine3A::from_rotation_translation(
        Quat::from_rotation_y(0.5) * Quat::from_rotation_z(FRAC_PI_2 - 0.024),
        vec3(-0.12, CARPET_M + 0.0165, 0.46),
    );
    stage.body("flute", flute.transformed(lying));
}

/// A rug's pattern: borders, a field with lozenges, a medallion.
fn carpet(uv: Vec2) -> Vec3 {
    let (red, navy, cream, gold) =
        (vec3(0.30, 0.028, 0.025), vec3(0.020, 0.030, 0.085), vec3(0.60, 0.52, 0.38), vec3(0.50, 0.28, 0.07));
    // Knots: 190 across.
    let p = ((uv * vec2(190.0, 130.0)).floor() + 0.5) / vec2(190.0, 130.0);
    let q = (p - 0.5).abs() * vec2(1.9, 1.3);
    let edge = (0.95 - q.x).min(0.65 - q.y);
    let zig = |x: f32| (x.fract() - 0.5).abs();
    let run = if 0.95 - q.x < 0.65 - q.y { q.y } else { q.x };
    match edge {
        e if e < 0.02 => cream,
        e if e < 0.05 => navy,
        e if e < 0.16 => {
            let flower = (e - 0.105).abs() * 9.0 + zig(run / 0.13) * 1.6;
            if flower < 0.35 {
                cream
            } else if flower < 0.55 {
                gold
            } else {
                red
            }
        }
        e if e < 0.185 => {
            if zig(run / 0.04) < 0.25 {
                cream
            } else {
                navy
            }
        }
        e if e < 0.20 => gold,
        _ => {
            let medallion = q.x / 0.52 + q.y / 0.36 + 0.05 * (q.x * 55.0).cos().signum();
            let star = zig(q.x / 0.15 + 0.5) + zig(q.y / 0.15 + 0.5);
            match medallion {
                m if m < 0.22 => gold,
                m if m < 0.30 => cream,
                m if m < 0.72 => {
                    if star < 0.25 {
                        cream
                    } else {
                        navy
                    }
                }
                m if m < 0.80 => gold,
                m if m < 0.88 => cream,
                _ if star < 0.16 => gold,
                _ if star < 0.28 => navy,
                _ => red,
            }
        }
    }
}
