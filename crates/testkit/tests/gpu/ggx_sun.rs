//! The path tracer's picture of a sun on rough surfaces against the formulas of the BRDF, evaluated here once more.

use std::f64::consts::{PI, TAU};

use chiaro::scene::{Material, Projection};
use chiaro::{ReferenceOptions, View};
use chiaro_testkit::Stage;
use glam::{DVec3, Vec2, Vec3};

use crate::truth::{mean, trace_views};

/// GGX of one width; all directions are unit, away from the surface, whose normal is +Z.
struct Ggx {
    alpha: f64,
}

/// Reflectance of a facet, by Schlick.
#[derive(Clone, Copy)]
struct Schlick {
    f0: f64,
    f90: f64,
}

const WHITE: Schlick = Schlick { f0: 1.0, f90: 1.0 };

impl Schlick {
    fn at(self, cosine: f64) -> f64 {
        self.f0 + (self.f90 - self.f0) * (1.0 - cosine).powi(5)
    }

    /// Over cosine-weighted directions.
    fn mean(self) -> f64 {
        self.f0 + (self.f90 - self.f0) / 21.0
    }
}

impl Ggx {
    fn distribution(&self, cosine: f64) -> f64 {
        let tangent2 = 1.0 / (cosine * cosine) - 1.0;
        let a2 = self.alpha * self.alpha;
        a2 / (PI * cosine.powi(4) * (a2 + tangent2).powi(2))
    }

    fn lambda(&self, cosine: f64) -> f64 {
        let tangent2 = 1.0 / (cosine * cosine) - 1.0;
        0.5 * ((1.0 + self.alpha * self.alpha * tangent2).sqrt() - 1.0)
    }

    /// Height-correlated (Heitz 2014, eq. 99).
    fn both_seen(&self, v: DVec3, l: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(v.z) + self.lambda(l.z))
    }

    fn single(&self, fresnel: Schlick, v: DVec3, l: DVec3) -> f64 {
        let h = (v + l).normalize();
        self.distribution(h.z) * self.both_seen(v, l) * fresnel.at(v.dot(h)) / (4.0 * v.z * l.z)
    }

    /// Directional albedo of single scattering, by quadrature over facets.
    fn albedo(&self, fresnel: Schlick, cosine: f64) -> f64 {
        const STEPS: u32 = 64;
        let v = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let step = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let reflected = (0..STEPS * STEPS).map(|i| {
            // Facets as dense as distribution · cosine, but for `dense`: closer where they are rare and light gets lost.
            let (t, phi) = (step(i % STEPS), TAU * step(i / STEPS));
            let (rare, dense) = (t * t * t, 3.0 * t * t);
            let z = 1.0 / (1.0 + self.alpha * self.alpha * (1.0 - rare) / rare).sqrt();
            let r = (1.0 - z * z).sqrt();
            let h = DVec3::new(r * phi.cos(), r * phi.sin(), z);
            let met = v.dot(h);
            let l = 2.0 * met * h - v;
            if met <= 0.0 || l.z <= 0.0 {
                return 0.0;
            }
            dense * self.both_seen(v, l) * fresnel.at(met) * met / (v.z * z)
        });
        reflected.sum::<f64>() / f64::from(STEPS * STEPS)
    }

    /// The albedo's mean over cosine-weighted directions.
    fn albedo_mean(&self, fresnel: Schlick) -> f64 {
        const STEPS: u32 = 24;
        // Even in the squared cosine.
        let cosines = (0..STEPS).map(|i| ((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt());
        cosines.map(|cosine| self.albedo(fresnel, cosine)).sum::<f64>() / f64::from(STEPS)
    }

    /// Share of what single scattering loses that comes back (Kulla & Conty 2017).
    fn multiple(&self, fresnel: Schlick) -> f64 {
        let (f, e) = (fresnel.mean(), self.albedo_mean(WHITE));
        f * f * e / (1.0 - f * (1.0 - e))
    }

    /// What the specular lobes reflect.
    fn specular(&self, fresnel: Schlick, v: DVec3, l: DVec3) -> f64 {
        let lost = |w: DVec3| 1.0 - self.albedo(WHITE, w.z);
        let wide = lost(v) * lost(l) / (PI * (1.0 - self.albedo_mean(WHITE)));
        self.single(fresnel, v, l) + self.multiple(fresnel) * wide
    }

    /// Lambert's lobe under a dielectric's specular ones.
    fn diffuse(&self, albedo: f64, coat: Schlick, v: DVec3, l: DVec3) -> f64 {
        let multiple = self.multiple(coat);
        let left = |w: DVec3| 1.0 - self.albedo(coat, w.z) - multiple * (1.0 - self.albedo(WHITE, w.z));
        let mean = 1.0 - self.albedo_mean(coat) - multiple * (1.0 - self.albedo_mean(WHITE));
        albedo * left(v) * left(l) / (PI * mean)
    }
}

fn brdf(material: &Material, v: DVec3, l: DVec3) -> f64 {
    let ggx = Ggx { alpha: f64::from(material.roughness).powi(2) };
    let color = f64::from(material.base_color.y);
    let coat = Schlick { f0: 0.04, f90: 1.0 };
    // Two materials side by side.
    let metal = ggx.specular(Schlick { f0: color, f90: 1.0 }, v, l);
    let dielectric = ggx.specular(coat, v, l) + ggx.diffuse(color, coat, v, l);
    dielectric + (metal - dielectric) * f64::from(material.metallic)
}

/// Towards a place over the floor from its own axes, in which up is +Z.
fn world(w: DVec3) -> Vec3 {
    DVec3::new(w.x, w.z, -w.y).as_vec3()
}

#[test]
fn a_rough_surface_reflects_a_sun_as_ggx_says() {
    const LUX: f32 = 1000.0;
    let size = [160, 4];
    let mut stage = Stage::new();
    let mut patches = Vec::new();
    for (roughness, metallic) in
        [(0.2, 1.0), (0.4, 1.0), (0.7, 1.0), (1.0, 1.0), (0.3, 0.0), (0.6, 0.0), (1.0, 0.0), (0.5, 0.4)]
    {
        let base_color = Vec3::splat(0.7).extend(1.0);
        let material = Material { base_color, metallic, roughness, ..Material::default() };
        let center = Vec3::X * (2.0 * patches.len() as f32 - 7.0);
        let id = stage.material(material.clone());
        stage.quad(center, Vec3::X, Vec3::NEG_Z * 2.0, id);
        patches.push((center, material));
    }
    let l = DVec3::new(0.1, 0.7, 0.7).normalize();
    stage.sun(LUX, -world(l));
    // Close to the mirror's direction, farther from it, back to the sun, from above and at a grazing angle.
    let eyes = [(-0.7, 0.7), (-0.5, 0.8), (0.6, 0.8), (-0.05, 1.0), (-0.8, 0.25)];
    let eyes = eyes.map(|(y, z)| DVec3::new(0.0, y, z).normalize());
    let views = eyes.map(|v| View {
        projection: Projection::Orthographic { half_height_m: 0.2 },
        ..View::look_at(world(v) * 20.0, Vec3::ZERO, 0.1, 0.1)
    });
    let options = ReferenceOptions { max_depth: 2, seed: 1, ..ReferenceOptions::default() };
    let images = trace_views(&stage.scene, (&views, size), options, &[1]);
    for ((v, view), image) in eyes.into_iter().zip(views).zip(images) {
        for (center, material) in &patches {
            let ndc = view.clip_from_ws(size, Vec2::ZERO).project_point3(*center);
            let middle = (ndc.x * 0.5 + 0.5) * size[0] as f32;
            let found = mean(&image, |x, _| (x as f32 + 0.5 - middle).abs() < 4.0);
            let expected = LUX * (l.z * brdf(material, v, l)) as f32;
            let Material { roughness, metallic, .. } = material;
            // The table of albedos: half a percent, and a ten-thousandth of what white paper would reflect, for light
            // scattered more than once goes by what the table leaves of one.
            let off = (found - expected).abs() - 1e-4 * LUX / std::f32::consts::PI;
            assert!(
                off < 0.005 * expected,
                "roughness {roughness} metallic {metallic} {v}: {found} is not {expected}"
            );
        }
    }
}
