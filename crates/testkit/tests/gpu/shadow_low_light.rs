//! Low light: from a tenth of a degree to the zenith a surface in the open has all its light, under every layout,
//! representation and kernel, and what stands on it still casts its shadow.

use std::f32::consts::PI;

use chiaro::scene::{LightKind, Mesh, Primitive};
use chiaro::{Aov, LoadedScene, Pipeline, Settings, View};
use chiaro_testkit::{Exact, Hit, Stage, Studio, device, direct};
use glam::{Affine3A, Quat, Vec3};

const SIZE: [u32; 2] = [128, 96];

/// Filters, each with what its maps hold.
const FILTERS: [&[(&str, &str)]; 7] = [
    &[("shadow.filter", "none")],
    &[("shadow.pcf_kernel", "7")],
    &[("shadow.pcf_kernel", "disc")],
    &[("shadow.filter", "pcss")],
    &[("shadow.bias.receiver_plane", "false")],
    &[("shadow.representation", "exponential"), ("shadow.filter", "gaussian")],
    &[("shadow.representation", "evsm4"), ("shadow.filter", "gaussian")],
];

/// The default filter in every layout and by either raster.
const LAYOUTS: [&[(&str, &str)]; 4] = [
    &[],
    &[("shadow.layout", "single"), ("shadow.point_layout", "paraboloid")],
    &[("shadow.fit", "depth")],
    &[("shadow.raster", "compute")],
];

fn changed(changes: &[&[(&str, &str)]]) -> Settings {
    let mut all = vec![("shadow.resolution", "512")];
    all.extend(changes.iter().copied().flatten());
    direct(&all)
}

/// No axis of the world or of a light is one of a test's.
fn askew() -> Quat {
    Quat::from_euler(glam::EulerRot::YXZ, 0.7, 0.31, -0.23)
}

/// Sines of the angles in degrees that the sun makes with the strips of [`fan`].
const ELEVATIONS_DEG: [f32; 9] = [0.1, 0.3, 0.7, 1.0, 1.5, 3.0, 10.0, 45.0, 90.0];

/// Strips side by side along one sun, each turned to it by another angle; none of them shadows another.
fn fan() -> (Stage, View) {
    let turn = askew();
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    for (i, elevation) in ELEVATIONS_DEG.into_iter().enumerate() {
        let (sine, cosine) = elevation.to_radians().sin_cos();
        let along = Vec3::new(cosine, -sine, 0.0);
        let center = Vec3::Z * (i as f32 - 4.0);
        stage.quad(turn * center, turn * (along * 3.0), turn * Vec3::NEG_Z * 0.5, material);
    }
    stage.sun(PI, turn * Vec3::NEG_X);
    let view = View::look_at(turn * Vec3::new(6.0, 7.0, 0.0), Vec3::ZERO, 0.9, 0.05);
    (stage, view)
}

/// Whether all pixels within `reach` show what the pixel does, by `same`.
fn inside<T>(of: &[T], i: usize, reach: i32, same: impl Fn(&T, &T) -> bool) -> bool {
    let [width, height] = SIZE.map(|side| side as i32);
    let (x, y) = (i as i32 % width, i as i32 / width);
    (-reach..=reach).all(|dy| {
        (-reach..=reach).all(|dx| {
            let (x, y) = ((x + dx).clamp(0, width - 1), (y + dy).clamp(0, height - 1));
            same(&of[i], &of[(y * width + x) as usize])
        })
    })
}

/// Pixels of the middle of pieces, with where they are.
fn middles(pixels: &[Option<Hit>]) -> Vec<(usize, Hit)> {
    let same = |a: &Option<Hit>, b: &Option<Hit>| match (a, b) {
        (Some(a), Some(b)) => a.normal.dot(b.normal) > 1.0 - 1e-7,
        _ => false,
    };
    let whole = |&(i, _): &(usize, Hit)| inside(pixels, i, 2, same);
    pixels.iter().enumerate().filter_map(|(i, hit)| Some((i, (*hit)?))).filter(whole).collect()
}

/// A floor next to a lamp whose light arrives at 0.3° at its far end.
fn lamp(kind: LightKind, height: f32) -> (Stage, View) {
    let turn = askew();
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    stage.quad(Vec3::ZERO, turn * Vec3::X * 3.0, turn * Vec3::NEG_Z * 3.0, material);
    let place = turn * Vec3::new(-2.5, height, 0.3);
    stage.light(kind, 1.0, None, place, turn * Vec3::new(1.0, -height / 4.0, -0.1));
    (stage, View::look_at(turn * Vec3::new(0.0, 5.0, 3.0), Vec3::ZERO, 0.9, 0.05))
}

/// A bare scene: what is seen in the middle of its pieces, and the radiance there.
struct Bare {
    name: &'static str,
    scene: LoadedScene,
    view: View,
    open: Vec<(usize, f32)>,
}

impl Bare {
    fn new(studio: &mut Studio, name: &'static str, (stage, view): (Stage, View)) -> Self {
        let exact = Exact::new(&stage.scene);
        let of = |(i, hit): (usize, Hit)| (i, exact.irradiance(hit, 0.0, 1)[1] / PI);
        // Beside the lamp radiance leaves the range of 16-bit floats; on a cone's rim it is next to nothing.
        let open = middles(&exact.pixels(&view, SIZE)).into_iter().map(of);
        let open = open.filter(|(_, right)| (1e-5..30.0).contains(right));
        let open: Vec<_> = open.collect();
        assert!(open.len() > 1500, "{name}: {}", open.len());
        Self { name, scene: studio.load(&stage.scene), view, open }
    }

    /// Says what is wrong where pixels lack light. Shading normals of 16 bit tell 0.1° from 0.102°.
    fn lacks(&self, studio: &mut Studio) -> Option<String> {
        let found = studio.radiance(&self.scene, &self.view, SIZE, 1);
        let shares: Vec<f32> = self.open.iter().map(|&(i, right)| found.pixels()[i][0] / right).collect();
        let mean = shares.iter().sum::<f32>() / shares.len() as f32;
        let least = shares.iter().copied().fold(f32::MAX, f32::min);
        ((mean - 1.0).abs() > 0.02 || least < 0.95)
            .then(|| format!("{}: mean {mean:.3}, least {least:.3}", self.name))
    }
}

#[test]
fn bare_planes_have_all_of_their_light_however_low_it_is_in_every_layout_and_filter() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, changed(&[]));
    let spot = LightKind::Spot { inner_rad: 0.6, outer_rad: 0.7 };
    let scenes = [
        ("fan", fan()),
        ("low lamp", lamp(LightKind::Point, 0.03)),
        ("lamp", lamp(LightKind::Point, 0.3)),
        ("spot", lamp(spot, 0.03)),
    ]
    .map(|(name, scene)| Bare::new(&mut studio, name, scene));
    let deferred = FILTERS.into_iter().chain(LAYOUTS).map(|changes| (changes, Pipeline::Deferred));
    let mut wrong = Vec::new();
    for (changes, pipeline) in deferred.chain([(LAYOUTS[0], Pipeline::Forward)]) {
        let name = format!("{changes:?}, {pipeline:?}");
        studio.set(Settings { pipeline, ..changed(&[changes]) });
        for scene in &scenes {
            wrong.extend(scene.lacks(&mut studio).map(|lack| format!("{lack} by {name}")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A grid of `side`² vertices over 8 × 8 m with a height, smoothly shaded.
fn hills(side: usize, height: impl Fn(f32, f32) -> f32, material: usize) -> Primitive {
    let at = |i: usize| i as f32 / (side - 1) as f32 * 8.0 - 4.0;
    let point = |x: f32, z: f32| Vec3::new(x, height(x, z), z);
    let mut primitive = Primitive { material, ..Primitive::default() };
    for (x, z) in (0..side * side).map(|i| (at(i % side), at(i / side))) {
        let step = 8.0 / (side - 1) as f32;
        let dx = point(x + step, z) - point(x - step, z);
        let dz = point(x, z + step) - point(x, z - step);
        primitive.positions.push(point(x, z));
        primitive.normals.push(dz.cross(dx).normalize());
    }
    for (x, z) in (0..(side - 1) * (side - 1)).map(|i| (i % (side - 1), i / (side - 1))) {
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| ((z + j) * side + x + i) as u32);
        primitive.indices.extend([a, d, c, a, c, b]);
    }
    primitive
}

/// A globe of few faces, smoothly shaded.
fn globe(center: Vec3, radius: f32, sides: usize, material: usize) -> Primitive {
    let mut primitive = Primitive { material, ..Primitive::default() };
    for (i, j) in (0..=sides).flat_map(|j| (0..=sides).map(move |i| (i, j))) {
        let (longitude, latitude) = (i as f32 / sides as f32 * 2.0 * PI, j as f32 / sides as f32 * PI);
        let normal =
            Vec3::new(longitude.cos() * latitude.sin(), latitude.cos(), -longitude.sin() * latitude.sin());
        primitive.positions.push(center + normal * radius);
        primitive.normals.push(normal);
    }
    for (i, j) in (0..sides).flat_map(|j| (0..sides).map(move |i| (i, j))) {
        let [a, b, c, d] =
            [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(x, y)| ((j + y) * (sides + 1) + i + x) as u32);
        primitive.indices.extend([a, b, c, a, c, d]);
    }
    primitive
}

/// A floor with a thin wall, a box, a kerb of 4 cm and a globe.
fn things() -> Stage {
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    stage.quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Z * 4.0, material);
    stage.cuboid(Vec3::new(-1.0, 0.3, 0.5), Vec3::new(0.01, 0.3, 0.8), material);
    stage.cuboid(Vec3::new(1.0, 0.1, 1.8), Vec3::new(0.1, 0.1, 0.1), material);
    stage.cuboid(Vec3::new(0.5, 0.02, -2.5), Vec3::new(0.1, 0.02, 0.4), material);
    let globe = globe(Vec3::new(0.6, 0.5, -1.0), 0.5, 12, material);
    stage.place(Mesh { primitives: vec![globe], ..Mesh::default() }, Affine3A::IDENTITY);
    stage
}

fn land() -> Stage {
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    let height = |x: f32, z: f32| 0.08 * (1.3 * x + 0.4).sin() * (1.1 * z).cos() + 0.01 * x * x;
    let hills = hills(33, height, material);
    stage.place(Mesh { primitives: vec![hills], ..Mesh::default() }, Affine3A::IDENTITY);
    stage
}

/// Mean error of visibility; shares of lit pixels that are darkened and of dark ones that are lit, and the mean light of lit
/// ones: three pixels inside.
#[derive(Debug)]
struct Gauge {
    error: f32,
    acne: f32,
    leak: f32,
    light: f32,
}

impl Gauge {
    fn of(found: &chiaro_image::Image, truth: &[Option<f32>]) -> Self {
        let known: Vec<(usize, f32)> =
            truth.iter().enumerate().filter_map(|(i, truth)| Some((i, (*truth)?))).collect();
        let value = |i: usize| found.pixels()[i][0];
        let all_of = |share: f32| -> Vec<f32> {
            let whole = |i: usize| inside(truth, i, 3, |a, b| b.is_none() || a == b);
            let of: Vec<_> =
                known.iter().filter(|&&(i, t)| t == share && whole(i)).map(|&(i, _)| value(i)).collect();
            assert!(of.len() > 100, "{}", of.len());
            of
        };
        let (lit, dark) = (all_of(1.0), all_of(0.0));
        let share = |of: &[f32], wrong: fn(&f32) -> bool| {
            of.iter().filter(|v| wrong(v)).count() as f32 / of.len() as f32
        };
        Self {
            error: known.iter().map(|&(i, truth)| (value(i) - truth).abs()).sum::<f32>() / known.len() as f32,
            acne: share(&lit, |&v| v < 0.95),
            leak: share(&dark, |&v| v > 0.1),
            light: lit.iter().sum::<f32>() / lit.len() as f32,
        }
    }
}

#[test]
fn a_low_sun_on_things_and_hills_is_as_rays_say() {
    let gpu = device();
    let view = View::look_at(Vec3::new(1.0, 4.0, 5.5), Vec3::ZERO, 0.9, 0.05);
    let mut studio = Studio::new(&gpu, changed(&[]));
    // A hillside in shadow lies within a texel of its crest, as the sun sees it.
    let scenes: [(fn() -> Stage, f32, [f32; 3]); 4] = [
        (things, 1.0, [0.005, 0.002, 0.005]),
        (things, 6.0, [0.002, 0.001, 0.001]),
        (land, 1.0, [0.05, 0.002, 0.15]),
        (land, 2.5, [0.04, 0.005, 0.15]),
    ];
    for (kernel, wider) in [("3", 1.0), ("7", 3.0)] {
        studio.set(changed(&[&[("shadow.pcf_kernel", kernel), ("shadow.resolution", "2048")]]));
        for (make, elevation, [error, acne, leak]) in scenes {
            let mut stage = make();
            let (sine, cosine) = elevation.to_radians().sin_cos();
            stage.sun(PI, Vec3::new(0.95 * cosine, -sine, 0.31 * cosine));
            let exact = Exact::new(&stage.scene);
            let share = |hit: Option<Hit>| {
                let [lit, all] = exact.irradiance(hit?, 0.0, 1);
                (all > 0.0).then(|| lit / all)
            };
            let truth: Vec<_> = exact.pixels(&view, SIZE).into_iter().map(share).collect();
            let scene = studio.load(&stage.scene);
            let found = studio.aov(&scene, &view, SIZE, 1, Aov::Shadow);
            let gauge = Gauge::of(&found, &truth);
            assert!(
                gauge.error < error * wider
                    && gauge.acne < acne * wider * wider
                    && gauge.leak < leak * wider.sqrt(),
                "{kernel} at {elevation}°: {gauge:?}"
            );
            assert!(gauge.light > 0.99, "{kernel} at {elevation}°: {gauge:?}");
        }
    }
}
