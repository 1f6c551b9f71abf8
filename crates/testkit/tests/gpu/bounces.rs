//! Further bounces of indirect light in a closed room, of which it is known how much light there is.

use chiaro_techniques::indirect::SETS;
use std::f32::consts::{FRAC_PI_2, PI};

use chiaro::scene::{LightKind, Projection};
use chiaro::{Aov, Left, StillOptions, View};
use chiaro_techniques::indirect::Vpl;
use chiaro_testkit::{Stage, Studio, device, direct};
use glam::{Mat4, Vec2, Vec3};

const ALBEDO: f32 = 0.7;
const CANDELA: f32 = 100.0;
const VPLS: u32 = 256;
const BOUNCES: u32 = 8;

/// The floor of a cube of 2 m and nothing else, from its middle. As all walls are alike, it has their mean light.
fn floor() -> View {
    View {
        world_from_camera: Mat4::from_rotation_x(-FRAC_PI_2),
        projection: Projection::Orthographic { half_height_m: 1.0 },
        near_m: 0.01,
        far_m: 2.0,
        aspect: None,
        axis_ndc: Vec2::ZERO,
    }
}

#[test]
fn a_closed_room_has_the_light_of_all_its_bounces() {
    let gpu = device();
    let mut stage = Stage::new();
    let grey = stage.lambert(ALBEDO);
    stage.cuboid(Vec3::ZERO, Vec3::ONE, grey);
    stage.light(LightKind::Point, CANDELA, None, Vec3::ZERO, Vec3::NEG_Y);
    let settings = direct(&[
        ("indirect.technique", "ism"),
        ("indirect.vpls", &VPLS.to_string()),
        ("indirect.bounces", &BOUNCES.to_string()),
        ("indirect.clamp", "0.1"),
        ("indirect.ism_resolution", "64"),
        ("indirect.points", "65536"),
        ("indirect.points_per_vpl", "4000"),
        ("indirect.rsm_resolution", "64"),
        ("shadow.resolution", "256"),
    ]);
    let mut studio = Studio::new(&gpu, settings);
    let scene = studio.load(&stage.scene);
    let left = ["vpls", "vpl_count"].map(|name| format!("indirect/{name}")).to_vec();
    let options = StillOptions { size: [32; 2], samples: 1, left, ..StillOptions::default() };
    let still = studio.renderer().still(&scene, &floor(), &options).unwrap();
    let read = |content| match content {
        Left::Buffer(buffer) => buffer.wait(&gpu).unwrap(),
        _ => panic!("no buffer"),
    };
    let mut left = still.left.into_iter().map(|left| read(left.content));
    let vpls: Vec<Vpl> = bytemuck::pod_collect_to_vec(&left.next().unwrap());
    let counts: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&left.next().unwrap());
    assert_eq!(counts.len(), SETS as usize);
    let flux = |&[count, _, first, _]: &[u32; 4]| -> f32 {
        vpls[first as usize..][..count as usize].iter().map(|vpl| vpl.flux[1]).sum()
    };
    let fluxes: Vec<_> = counts.iter().map(flux).collect();
    let (bounces, sources) = fluxes.split_at(BOUNCES as usize);
    assert!(sources.iter().all(|&flux| flux == 0.0), "{sources:?} lm of sources that the room lacks");
    for pair in bounces.windows(2) {
        let share = pair[1] / pair[0] / ALBEDO;
        assert!((share - 1.0).abs() < 0.03, "{fluxes:?} lm");
    }
    // Of each bounce the walls get the flux of the one before, as in an integrating sphere.
    let arriving: f32 = (1..=BOUNCES as i32).map(|bounce| ALBEDO.powi(bounce)).sum();
    let expected = ALBEDO / PI * arriving * 4.0 * PI * CANDELA / 24.0;
    let light = studio.aov(&scene, &floor(), [32; 2], 4, Aov::Indirect);
    let found = (0..32 * 32).map(|i| light.pixel(i % 32, i / 32)[1]).sum::<f32>() / (32.0 * 32.0);
    assert!((found / expected - 1.0).abs() < 0.05, "{found} nits instead of {expected}");
}
