//! The shadow thesis' shading: what its shadows darken, and by how much.

use chiaro::{Settings, View};
use chiaro_testkit::{Stage, Studio, device};
use glam::Vec3;

const SIZE: [u32; 2] = [96, 72];

/// A box above a floor with a shining skin, under one sun.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let skin = stage.material(chiaro::scene::Material {
        base_color: glam::Vec4::new(0.6, 0.4, 0.2, 1.0),
        roughness: 0.15,
        ..chiaro::scene::Material::default()
    });
    stage.cuboid(Vec3::new(0.0, -0.5, 0.0), Vec3::new(4.0, 0.5, 4.0), skin);
    stage.cuboid(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.8, 0.4, 0.8), skin);
    stage.sun(50_000.0, Vec3::new(0.5, -1.0, -0.3));
    stage
}

fn view() -> View {
    View::look_at(Vec3::new(1.0, 5.0, 5.0), Vec3::new(0.3, 0.0, -0.3), 0.9, 0.05)
}

fn thesis(changes: &[(&str, &str)]) -> Settings {
    let mut settings = Settings::default();
    settings.apply_preset("thesis-shadows", None).unwrap();
    // Texels of a decimetre: wide penumbrae.
    settings.set("shadow.resolution", "128").unwrap();
    for (key, value) in changes {
        settings.set(key, value).unwrap();
    }
    settings
}

#[test]
fn variance_is_rescaled_and_exponential_clamped_to_0_3_of_the_whole_colour() {
    let stage = stage();
    let gpu = device();
    let mut studio = Studio::new(&gpu, thesis(&[("shadow.layout", "none")]));
    let scene = studio.load(&stage.scene);
    let mut picture = |changes: &[(&str, &str)]| {
        studio.set(thesis(changes));
        studio.radiance(&scene, &view(), SIZE, 1)
    };
    let bright = picture(&[("shadow.layout", "none")]);
    let lamps = picture(&[("shadow.layout", "none"), ("camera.show", "direct"), ("environment.sky", "none")]);
    let by: [(&str, fn(f32) -> f32); 2] =
        [("variance", |visible| 0.3 + 0.7 * visible), ("exponential", |visible| visible.max(0.3))];
    for (representation, factor) in by {
        let plain = [
            ("shadow.representation", representation),
            ("shadow.darkens", "direct"),
            ("shadow.floor", "0"),
            ("shadow.bleed_reduction", if representation == "variance" { "0.2" } else { "0" }),
        ];
        let dark = picture(&plain[..1]);
        let direct = picture(&plain);
        let (mut least, mut partly) = (1.0f32, 0);
        for (i, dark) in dark.pixels().iter().enumerate() {
            let [bright, lamps, direct] = [&bright, &lamps, &direct].map(|image| image.pixels()[i][1]);
            // Of the sky's own light and of what bounces.
            let ambient = bright - lamps;
            // Before the sky there is no surface, and what faces away from the sun has little other light.
            if bright <= 1.5 * ambient {
                continue;
            }
            let visible = ((direct - ambient) / (bright - ambient)).clamp(0.0, 1.0);
            partly += usize::from((0.05..0.95).contains(&visible));
            let found = dark[1] / bright;
            // Half floats hold 1 in 2000, three of them in the visibility.
            assert!(
                (found - factor(visible)).abs() < 5e-3,
                "{representation}: {found} of the colour at a visibility of {visible}"
            );
            least = least.min(found);
        }
        assert!(partly > 20, "{representation}: only {partly} pixels in penumbra");
        assert!((least - 0.3).abs() < 5e-3, "{representation}: {least}");
    }
}
