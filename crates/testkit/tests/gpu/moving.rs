//! Pictures that move: motion vectors against both poses' projections, anti-aliasing over time, and when a frame does not go
//! on from the one before.

use chiaro::scene::{AlphaMode, Material, Scene};
use chiaro::{Aov, LoadedScene, StillOptions, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, device, direct, nmae};
use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::motion::moving;

const SIZE: [u32; 2] = [80, 60];

fn view(eye: Vec3) -> View {
    View::look_at(eye, Vec3::new(0.1, 1.6, 0.0), 0.9, 0.01)
}

/// Frames of a moving picture, a still each.
pub(crate) fn frames<'a>(
    studio: &mut Studio,
    (scene, loaded): (&Scene, &mut LoadedScene),
    seen: impl IntoIterator<Item = (f64, &'a View, [u32; 2])>,
    aovs: &[Aov],
) -> Vec<(Image, Vec<Image>)> {
    let frame = |(time_s, view, size): (f64, &View, [u32; 2])| {
        loaded.set_pose(scene, &scene.pose(time_s)).unwrap();
        let options = StillOptions { size, samples: 1, aovs: aovs.to_vec(), moving: true, left: Vec::new() };
        let still = studio.renderer().still(loaded, view, &options).unwrap();
        let gpu = studio.renderer().gpu().clone();
        let image = |sum: &chiaro::Pixels| {
            let texels = sum.floats().as_chunks::<4>().0.iter().map(|t| [t[0], t[1], t[2]]).collect();
            Image::from_pixels(sum.width, sum.height, texels).unwrap()
        };
        let picture = image(&still.radiance.wait(&gpu).unwrap());
        (picture, still.aovs.into_iter().map(|(_, sum)| image(&sum.wait(&gpu).unwrap())).collect())
    };
    seen.into_iter().map(frame).collect()
}

/// All triangles of a scene at a moment.
fn triangles(scene: &Scene, time_s: f64) -> Vec<[Vec3; 3]> {
    let pose = scene.pose(time_s);
    let drawn = scene.nodes.iter().enumerate().filter_map(|(node, n)| Some((node, n.mesh?)));
    let mut all = Vec::new();
    for (node, mesh) in drawn {
        for primitive in &scene.meshes[mesh].primitives {
            let at: Vec<_> = scene.posed_vertices(&pose, node, primitive).map(|(p, _)| p).collect();
            all.extend(primitive.indices.chunks(3).map(|t| [0, 1, 2].map(|i| at[t[i] as usize])));
        }
    }
    all
}

/// The nearest triangle along a ray, where in it, and how far away.
fn nearest(triangles: &[[Vec3; 3]], origin: Vec3, direction: Vec3) -> Option<(usize, Vec3, f32)> {
    let meet = |(index, &[a, b, c]): (usize, &[Vec3; 3])| {
        let (e, f) = (b - a, c - a);
        let p = direction.cross(f);
        let determinant = e.dot(p);
        let from = origin - a;
        let u = from.dot(p) / determinant;
        let q = from.cross(e);
        let v = direction.dot(q) / determinant;
        let t = f.dot(q) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-3).then_some((index, Vec3::new(1.0 - u - v, u, v), t))
    };
    triangles.iter().enumerate().filter_map(meet).min_by(|a, b| a.2.total_cmp(&b.2))
}

fn pixel(view: &View, point: Vec4) -> Vec2 {
    let clip = view.clip_from_ws(SIZE, Vec2::ZERO) * point;
    let ndc = Vec2::new(clip.x, clip.y) / clip.w;
    (ndc * Vec2::new(0.5, -0.5) + 0.5) * Vec2::new(SIZE[0] as f32, SIZE[1] as f32)
}

#[test]
fn motion_vectors_are_the_difference_of_both_projections() {
    let mut scene = moving();
    // A pane before the tube, which takes what is behind it out of sight.
    let mut stage = Stage { scene };
    let base_color = Vec4::new(0.2, 0.4, 0.8, 0.3);
    let pane = stage.material(Material { base_color, alpha: AlphaMode::Blend, ..Material::default() });
    stage.quad(Vec3::new(0.4, 1.2, 1.6), Vec3::X * 0.3, Vec3::Y * 0.4, pane);
    scene = stage.scene;
    let cameras = [view(Vec3::new(1.0, 2.5, 6.0)), view(Vec3::new(1.04, 2.48, 5.98))];
    let times_s = [0.4, 0.44];
    let [before, now] = times_s.map(|time_s| triangles(&scene, time_s));
    for changes in [&[("post.antialias", "none")][..], &[("pipeline", "forward"), ("post.antialias", "none")]]
    {
        let mut studio = Studio::new(&device(), direct(changes));
        let mut loaded = studio.load(&scene);
        let seen = times_s.iter().zip(&cameras).map(|(time_s, view)| (*time_s, view, SIZE));
        let found = frames(&mut studio, (&scene, &mut loaded), seen, &[Aov::Motion]);
        assert!(found[0].1[0].pixels().iter().all(|&p| p == [0.0; 3]), "a first frame has none before it");
        let (mut worst, mut sky, mut moved) = (0.0f32, 0, 0);
        for (index, &[x, y, away]) in found[1].1[0].pixels().iter().enumerate() {
            let at = Vec2::new((index as u32 % SIZE[0]) as f32, (index as u32 / SIZE[0]) as f32) + 0.5;
            let ndc =
                at / Vec2::new(SIZE[0] as f32, SIZE[1] as f32) * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
            let ray =
                cameras[1].relative_from_clip(SIZE, Vec2::ZERO).project_point3(ndc.extend(0.5)).normalize();
            let expected = if let Some((triangle, place, distance)) = nearest(&now, cameras[1].eye_ws(), ray)
            {
                let [a, b, c] = before[triangle];
                let was = a * place.x + b * place.y + c * place.z;
                let is = cameras[1].eye_ws() + distance * ray;
                let depth = |view: &View, p: Vec3| view.forward_ws().dot(p - view.eye_ws());
                (at - pixel(&cameras[0], was.extend(1.0)))
                    .extend(depth(&cameras[1], is) - depth(&cameras[0], was))
            } else {
                sky += 1;
                (at - pixel(&cameras[0], ray.extend(0.0))).extend(0.0)
            };
            moved += u32::from(expected.truncate().length() > 1.0);
            // A silhouette may fall on either side, and a shared edge into either triangle: both are a rounding away.
            let off = (Vec3::new(x, y, away) - expected).abs().max_element();
            let edge = [Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y].iter().any(|step| {
                let ndc = (at + *step * 2e-3) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32)
                    * Vec2::new(2.0, -2.0)
                    + Vec2::new(-1.0, 1.0);
                let relative =
                    cameras[1].relative_from_clip(SIZE, Vec2::ZERO).project_point3(ndc.extend(0.5));
                let other = nearest(&now, cameras[1].eye_ws(), relative.normalize()).map(|hit| hit.0);
                other != nearest(&now, cameras[1].eye_ws(), ray).map(|hit| hit.0)
            });
            if !edge {
                worst = worst.max(off);
            }
        }
        assert!(worst < 2e-3, "{changes:?}: {worst} px");
        assert!(sky > 100 && moved > 50, "{sky} pixels of sky, {moved} that moved");
    }
}

#[test]
fn a_frame_after_a_jump_is_as_of_a_fresh_start() {
    let gpu = device();
    let scene = moving();
    let still = {
        let mut stage = Stage::floor(0.5);
        stage.sun(4.0, Vec3::new(0.3, -1.0, 0.2));
        stage.scene
    };
    let (here, next, there) =
        (view(Vec3::new(1.0, 2.5, 6.0)), view(Vec3::new(1.02, 2.5, 6.0)), view(Vec3::new(-5.0, 3.0, 2.0)));
    let start = [(0.1, &here, SIZE), (0.12, &next, SIZE), (0.14, &here, SIZE)];
    let jumps: [(&str, (f64, &View, [u32; 2]), bool); 4] = [
        ("camera", (0.16, &there, SIZE), true),
        ("size", (0.16, &here, [SIZE[0] + 7, SIZE[1] - 5]), true),
        // The board goes from one side to the other.
        ("pose", (0.95, &here, SIZE), true),
        ("nothing", (0.16, &next, SIZE), false),
    ];
    // Direct light, and virtual lights with their shares of maps and their mean over frames, without anti-aliasing over them.
    let bounced = [
        ("indirect.technique", "rsm"),
        ("indirect.vpls", "64"),
        ("indirect.rsm_resolution", "64"),
        ("post.antialias", "none"),
    ];
    for (changes, (name, after, jumps)) in [&[][..], &bounced].into_iter().flat_map(|c| jumps.map(|j| (c, j)))
    {
        let mut studio = Studio::new(&gpu, direct(changes));
        let mut loaded = studio.load(&scene);
        let found = frames(&mut studio, (&scene, &mut loaded), start.into_iter().chain([after]), &[]);
        let mut studio = Studio::new(&gpu, direct(changes));
        let mut loaded = studio.load(&scene);
        let fresh = frames(&mut studio, (&scene, &mut loaded), [after], &[]);
        let same = found[3].0.pixels() == fresh[0].0.pixels();
        assert!(same == jumps, "{name}, {changes:?}: nmae {}", nmae(&found[3].0, &fresh[0].0));
    }
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut loaded = studio.load(&scene);
    frames(&mut studio, (&scene, &mut loaded), start, &[]);
    let mut other = studio.load(&still);
    let found = frames(&mut studio, (&still, &mut other), [(0.0, &here, SIZE)], &[]);
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut other = studio.load(&still);
    let fresh = frames(&mut studio, (&still, &mut other), [(0.0, &here, SIZE)], &[]);
    assert!(found[0].0.pixels() == fresh[0].0.pixels(), "a new scene");
}

#[test]
fn cameras_jump_by_how_their_speed_changes() {
    let mut studio = Studio::new(&device(), direct(&[]));
    let scene = moving();
    let mut loaded = studio.load(&scene);
    let at = |x: f32| view(Vec3::new(x, 2.5, 6.0));
    let rolled = |angle: f32| {
        let straight = at(0.0);
        let world_from_camera = straight.world_from_camera * glam::Mat4::from_rotation_z(angle);
        View { world_from_camera, ..straight }
    };
    // Whether what each frame shows is known to have moved.
    for (name, views, goes_on) in [
        ("a great speed that is kept", [at(0.0), at(2.0), at(4.0), at(6.0)], [false, false, true, true]),
        ("a start from rest", [at(0.0), at(0.0), at(0.1), at(0.2)], [false, false, true, true]),
        ("there and back", [at(0.0), at(3.0), at(0.0), at(0.1)], [false, false, false, true]),
        ("a roll", [rolled(0.0), rolled(0.02), rolled(1.5), rolled(1.52)], [false, true, false, true]),
    ] {
        let seen = views.iter().map(|view| (0.1, view, SIZE));
        let found = frames(&mut studio, (&scene, &mut loaded), seen, &[Aov::Motion]);
        let moved = |frame: usize| found[frame].1[0].pixels().iter().any(|p| p[0].abs() > 0.2);
        assert_eq!([0, 1, 2, 3].map(moved), goes_on, "{name}");
        // The next begins elsewhere.
        frames(&mut studio, (&scene, &mut loaded), [(0.1, &at(-9.0), [8, 8])], &[]);
    }
}

#[test]
fn a_moving_picture_at_rest_becomes_as_smooth_as_a_still() {
    let mut studio = Studio::new(&device(), direct(&[]));
    let scene = moving();
    let mut loaded = studio.load(&scene);
    let eye = view(Vec3::new(1.0, 2.5, 6.0));
    let found = frames(&mut studio, (&scene, &mut loaded), [(0.3, &eye, SIZE); 64], &[]);
    let truth = studio.radiance(&loaded, &eye, SIZE, 256);
    let sixteen = nmae(&studio.radiance(&loaded, &eye, SIZE, 16), &truth);
    let [first, half, last] = [0, 31, 63].map(|frame| nmae(&found[frame].0, &truth));
    assert!(half < 1.1 * sixteen, "{half}, of sixteen samples {sixteen}");
    // Small shares of many frames are not lost.
    assert!(last < 0.9 * sixteen, "{last}, of sixteen samples {sixteen}");
    assert!(first > 3.0 * half, "{first} at first, {half} then: it had nothing to smooth");
}

#[test]
fn moving_edges_are_smoother_than_single_frames_and_leave_no_ghosts() {
    // A white board before a dark wall, seen by a camera that goes along.
    let mut stage = Stage::new();
    let (dark, white) = (stage.lambert(0.05), stage.lambert(0.9));
    stage.quad(Vec3::new(0.0, 0.0, -1.0), Vec3::X * 6.0, Vec3::Y * 4.0, dark);
    stage.quad(Vec3::ZERO, Vec3::new(0.5, 0.1, 0.0), Vec3::new(-0.1, 0.5, 0.0), white);
    stage.sun(3.0, Vec3::new(0.0, -0.2, -1.0));
    let board = stage.scene.nodes.len() - 2;
    let scene = stage.scene;
    let eye = View::look_at(Vec3::Z * 4.0, Vec3::ZERO, 0.8, 0.01);
    let shot = |antialias: &str, samples: u32| {
        let mut studio =
            Studio::new(&device(), direct(&[("post.antialias", antialias), ("shadow.layout", "none")]));
        let mut loaded = studio.load(&scene);
        let gpu = studio.renderer().gpu().clone();
        let mut last = None;
        for frame in 0..12 {
            let mut pose = scene.pose(0.0);
            let place = Affine3A::from_translation(Vec3::X * (-0.6 + 0.11 * frame as f32));
            pose.set_world(&scene, board, place);
            loaded.set_pose(&scene, &pose).unwrap();
            let options = StillOptions { size: SIZE, samples, moving: true, ..StillOptions::default() };
            let still = studio.renderer().still(&loaded, &eye, &options).unwrap();
            last = Some(still.radiance.wait(&gpu).unwrap());
        }
        let sum = last.unwrap();
        let mean = |t: &[f32; 4]| [0, 1, 2].map(|c| t[c] / samples as f32);
        Image::from_pixels(SIZE[0], SIZE[1], sum.floats().as_chunks::<4>().0.iter().map(mean).collect())
            .unwrap()
    };
    let truth = shot("none", 64);
    let (none, taa) = (shot("none", 1), shot("taa", 1));
    let (alone, smoothed) = (nmae(&none, &truth), nmae(&taa, &truth));
    assert!(smoothed < 0.8 * alone, "{smoothed}, single frames {alone}");
    // Where the board was four frames ago and is no more there is only the wall.
    let wall = truth.pixels()[(SIZE[0] * (SIZE[1] / 2)) as usize][0];
    let columns = SIZE[0] / 2 - 18..SIZE[0] / 2 - 4;
    for x in columns {
        let found = taa.pixels()[(SIZE[0] * (SIZE[1] / 2) + x) as usize][0];
        let expected = truth.pixels()[(SIZE[0] * (SIZE[1] / 2) + x) as usize][0];
        if expected < 1.05 * wall {
            assert!(
                (found - expected).abs() < 0.02 * wall.max(expected),
                "column {x}: {found}, the wall is {expected}"
            );
        }
    }
}
