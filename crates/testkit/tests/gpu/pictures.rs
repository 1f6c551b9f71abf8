//! Pictures of what indirect light is made from, in a scene where it is known what they show.

use bytemuck::pod_collect_to_vec;
use chiaro::scene::{LightKind, Material};
use chiaro::{Left, Renderer, Samples, Settings, StillOptions};
use chiaro_techniques::indirect::Vpl;
use chiaro_testkit::{Stage, camera_above, device, place_below};
use glam::Vec3;

const SIDE: u32 = 96;
const HALF_M: f32 = 4.0;
const ALBEDO: Vec3 = Vec3::new(0.6, 0.3, 0.1);
const NAMES: [&str; 5] = ["point_picture", "vpl_picture", "rsm_picture", "vpls", "vpl_count"];

fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// What 5 or 6 bits of the root leave of a number: of marks half a step, of points, which are rounded by chance, a whole one.
fn is_stored(found: Vec3, expected: Vec3, steps: f32) -> bool {
    let apart = (found.max(Vec3::ZERO).map(f32::sqrt) - expected.map(f32::sqrt)).abs();
    apart.max_element() < steps / 31.0 + 1e-3
}

/// Words of a buffer, or texels.
enum Read {
    Words(Vec<u8>),
    Texels(Vec<Vec3>),
}

/// A coloured floor, over it a black table of 2 × 2 m in the air, and a sun that shines under it.
fn taken() -> [Read; 5] {
    let gpu = device();
    let mut settings = Settings::default();
    for (key, value) in [
        ("environment.sky", "none"),
        ("indirect.technique", "ism"),
        ("indirect.sampling", "importance"),
        ("indirect.vpls", "64"),
        ("indirect.points", "65536"),
        ("indirect.ism_resolution", "32"),
        ("indirect.rsm_resolution", "64"),
        ("shadow.cascades", "1"),
    ] {
        settings.set(key, value).unwrap();
    }
    let mut stage = Stage::new();
    let floor = stage.material(Material {
        base_color: ALBEDO.extend(1.0),
        specular: 0.0,
        double_sided: true,
        ..Material::default()
    });
    let black = stage.lambert(0.0);
    stage.quad(Vec3::ZERO, Vec3::X * HALF_M, Vec3::NEG_Z * HALF_M, floor);
    stage.quad(Vec3::Y, Vec3::X, Vec3::NEG_Z, black);
    stage.light(LightKind::Directional, 1000.0, None, Vec3::ZERO, Vec3::new(1.0, -1.0, 0.0));
    let (mut renderer, loaded) = Renderer::with_scene(&gpu, settings, &stage.scene).unwrap();
    let left = NAMES.map(|name| format!("indirect/{name}")).to_vec();
    let options = StillOptions { size: [SIDE; 2], samples: 1, left, ..StillOptions::default() };
    let still = renderer.still(&loaded, &camera_above(HALF_M), &options).unwrap();
    let read = |content| match content {
        Left::Buffer(buffer) => Read::Words(buffer.wait(&gpu).unwrap()),
        Left::Sum(texels) | Left::Plain(texels) => {
            let channels = texels.wait(&gpu).unwrap().channels();
            let [Samples::Float(r), Samples::Float(g), Samples::Float(b), ..] = &channels[..] else {
                panic!("pictures are numbers")
            };
            let texels = r.iter().zip(g).zip(b).map(|((r, g), b)| Vec3::new(*r, *g, *b));
            Read::Texels(texels.collect())
        }
        Left::Layers(_) => panic!("no picture has layers"),
    };
    let all: Vec<_> = still.left.into_iter().map(|left| read(left.content)).collect();
    all.try_into().unwrap_or_else(|_| panic!("not all came back"))
}

/// Pixels and where on the floor they lie.
fn pixels(texels: &[Vec3]) -> impl Iterator<Item = (Vec3, Vec3)> + '_ {
    let place = |i: usize| place_below([i as u32 % SIDE, i as u32 / SIDE], SIDE, HALF_M);
    texels.iter().enumerate().map(move |(i, texel)| (place(i), *texel))
}

/// Of how far a place is from the table's edge, metres, negative below it.
fn beside_table(place: Vec3) -> f32 {
    place.x.abs().max(place.z.abs()) - 1.0
}

fn is_grey(color: Vec3) -> bool {
    color.max_element() - color.min_element() < 1e-3
}

#[test]
fn pictures_show_points_lights_and_maps_where_they_are() {
    let [
        Read::Texels(points),
        Read::Texels(lights),
        Read::Texels(maps),
        Read::Words(vpls),
        Read::Words(count),
    ] = taken()
    else {
        panic!("pictures are textures, and lights are a buffer")
    };

    // Seven points a pixel: the floor's albedo beside the table, black on it, nothing of the floor below.
    let (mut marked, mut all) = (0, 0);
    for (place, color) in pixels(&points) {
        let from_edge = beside_table(place);
        if from_edge > 0.1 {
            all += 1;
            marked += i32::from(is_stored(color, ALBEDO, 1.0));
            assert!(is_grey(color) || is_stored(color, ALBEDO, 1.0), "{color} at {place}");
        } else if from_edge < -0.1 {
            all += 1;
            marked += i32::from(color == Vec3::ZERO);
            assert!(is_grey(color), "{color} of the floor at {place}, below the table");
        }
    }
    assert!(marked * 100 > all * 98, "{marked} of {all} pixels have points");

    // All lights carry as much as each other: half as bright as white.
    let mean = ALBEDO / luminance(ALBEDO);
    let count = pod_collect_to_vec::<u8, u32>(&count)[0] as usize;
    let vpls = &pod_collect_to_vec::<u8, Vpl>(&vpls)[..count];
    let places: Vec<_> = vpls.iter().map(|vpl| Vec3::from(vpl.position_ws)).collect();
    let hidden = places.iter().filter(|place| beside_table(**place) < -0.2).count();
    assert!(count > 32 && hidden > 0, "{hidden} of {count} lights lie under the table");
    let pixel_m = 2.0 * HALF_M / SIDE as f32;
    let (mut discs, radius_px) = (0, 3.0);
    for (place, color) in pixels(&lights) {
        let from_edge = beside_table(place);
        let apart = |light: &Vec3| light.with_y(0.0).distance(place) / pixel_m;
        let nearest =
            places.iter().filter(|light| beside_table(**light) > 0.0).map(apart).fold(f32::MAX, f32::min);
        let near = places.iter().filter(|light| apart(light) < radius_px).count();
        if from_edge < -0.1 {
            assert!(is_grey(color), "{color} at {place}, below the table");
        } else if from_edge > 0.5 && near == 1 && nearest < radius_px - 1.1 {
            discs += 1;
            assert!(is_stored(color, 0.5 * mean, 0.5), "{color} is not {} at {place}", 0.5 * mean);
        } else if near == 0 {
            assert!(is_grey(color) && color.x > 0.0, "{color} at {place}, where no light is");
        }
    }
    assert!(discs > 100, "{discs} pixels of discs");

    // Texels that are lit carry the same; the others count for the mean.
    assert_eq!(maps.len(), 64 * 64);
    let lit = maps.iter().filter(|color| color.max_element() > 0.0).count();
    assert!((1000..4000).contains(&lit), "{lit} texels are lit");
    let expected = mean / (1.0 + lit as f32 / maps.len() as f32);
    let right = maps.iter().filter(|color| (**color / expected - 1.0).abs().max_element() < 0.03).count();
    assert!(right * 100 > lit * 95, "{right} of {lit} texels are {expected}");
}
