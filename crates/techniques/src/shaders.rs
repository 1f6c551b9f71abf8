//! Every shader of this crate, and every permutation of every entry file.

use chiaro_gpu::shader::{Library, Permutation};

macro_rules! shader {
    ($path:literal) => {
        ($path, include_str!($path))
    };
}

/// Whether shadow maps hold depth as plain numbers, as compute writes them, instead of a depth format.
const FLOAT_MAPS: &str = "float_maps";

/// What shadows are looked up in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadowSource {
    /// Maps of a depth format.
    DepthMaps,
    /// Maps of plain numbers, as compute writes them.
    FloatMaps,
    /// The scene's triangles, by rays.
    Rays,
}

impl ShadowSource {
    /// All.
    const ALL: [Self; 3] = [Self::DepthMaps, Self::FloatMaps, Self::Rays];

    /// With the flags of what imports `direct/lighting.wesl`.
    fn flags(self, entry: Permutation) -> Permutation {
        entry.flag(FLOAT_MAPS, self == Self::FloatMaps).flag("traced", self == Self::Rays)
    }
}

/// All WESL modules by path.
pub const MODULES: &[(&str, &str)] = &[
    shader!("caustics/lookup.wesl"),
    shader!("caustics/photon_trace/gather.cs.wesl"),
    shader!("caustics/photon_trace/photons.wesl"),
    shader!("caustics/photon_trace/place.wesl"),
    shader!("caustics/photon_trace/places.cs.wesl"),
    shader!("caustics/photon_trace/spread.cs.wesl"),
    shader!("caustics/photon_trace/sums.wesl"),
    shader!("caustics/photon_trace/trace.cs.wesl"),
    shader!("direct/forward.vs.wesl"),
    shader!("direct/lighting.wesl"),
    shader!("direct/shade.cs.wesl"),
    shader!("environment/background.vs.wesl"),
    shader!("environment/cube.wesl"),
    shader!("environment/halve.cs.wesl"),
    shader!("environment/lookup.wesl"),
    shader!("environment/prefilter.cs.wesl"),
    shader!("environment/project.cs.wesl"),
    shader!("frame/frame.wesl"),
    shader!("indirect/accumulate/accumulate.cs.wesl"),
    shader!("indirect/bounces/bounce.wesl"),
    shader!("indirect/bounces/place.cs.wesl"),
    shader!("indirect/bounces/spread.cs.wesl"),
    shader!("indirect/clusters/assign.cs.wesl"),
    shader!("indirect/clusters/cluster.wesl"),
    shader!("indirect/clusters/finish.cs.wesl"),
    shader!("indirect/clusters/start.cs.wesl"),
    shader!("indirect/clusters/update.cs.wesl"),
    shader!("indirect/foreign/radiance.cs.wesl"),
    shader!("indirect/foreign/surface.cs.wesl"),
    shader!("indirect/compensate/nearby.cs.wesl"),
    shader!("indirect/compensate/radiosity.cs.wesl"),
    shader!("indirect/gather/discontinuity.cs.wesl"),
    shader!("indirect/gather/edges.cs.wesl"),
    shader!("indirect/gather/gather.cs.wesl"),
    shader!("indirect/gather/gaussian.cs.wesl"),
    shader!("indirect/gather/lookup.wesl"),
    shader!("indirect/gather/place.wesl"),
    shader!("indirect/ism/atlas.wesl"),
    shader!("indirect/ism/counted.wesl"),
    shader!("indirect/ism/far.wesl"),
    shader!("indirect/ism/lookup.wesl"),
    shader!("indirect/ism/paraboloid.wesl"),
    shader!("indirect/ism/picture.cs.wesl"),
    shader!("indirect/ism/pull.cs.wesl"),
    shader!("indirect/ism/push.cs.wesl"),
    shader!("indirect/ism/pyramid.wesl"),
    shader!("indirect/ism/splat.cs.wesl"),
    shader!("indirect/pictures/marks.wesl"),
    shader!("indirect/pictures/points.cs.wesl"),
    shader!("indirect/pictures/resolve.cs.wesl"),
    shader!("indirect/pictures/rsm.cs.wesl"),
    shader!("indirect/pictures/tone.wesl"),
    shader!("indirect/pictures/vpls.cs.wesl"),
    shader!("indirect/points/point.wesl"),
    shader!("indirect/points/update.cs.wesl"),
    shader!("indirect/rsm/light.cs.wesl"),
    shader!("indirect/rsm/rsm.wesl"),
    shader!("indirect/rsm/scattered.wesl"),
    shader!("indirect/sources/place.cs.wesl"),
    shader!("indirect/sources/sources.wesl"),
    shader!("indirect/vpl.wesl"),
    shader!("indirect/vpls/choose.cs.wesl"),
    shader!("indirect/vpls/maps.wesl"),
    shader!("indirect/vpls/pilots.wesl"),
    shader!("indirect/vpls/place.cs.wesl"),
    shader!("indirect/vpls/sampling.wesl"),
    shader!("indirect/vpls/scan.cs.wesl"),
    shader!("indirect/vpls/tiles.cs.wesl"),
    shader!("indirect/vpls/weigh.cs.wesl"),
    shader!("light/froxels.wesl"),
    shader!("light/grid.cs.wesl"),
    shader!("light/incoming.wesl"),
    shader!("paths/aim.wesl"),
    shader!("paths/bsdf.wesl"),
    shader!("paths/medium.wesl"),
    shader!("paths/roulette.wesl"),
    shader!("paths/sampler.wesl"),
    shader!("paths/sight.wesl"),
    shader!("paths/vertex.wesl"),
    shader!("post/accumulate.cs.wesl"),
    shader!("post/antialias.cs.wesl"),
    shader!("post/aov.cs.wesl"),
    shader!("post/bins.wesl"),
    shader!("post/debug_view.cs.wesl"),
    shader!("post/exposure.cs.wesl"),
    shader!("post/histogram.cs.wesl"),
    shader!("post/present.vs.wesl"),
    shader!("post/tone_map.cs.wesl"),
    shader!("rays/corners.cs.wesl"),
    shader!("rays/refit.cs.wesl"),
    shader!("rays/traverse.wesl"),
    shader!("reference/camera.wesl"),
    shader!("reference/first_hit.cs.wesl"),
    shader!("reference/path/emitters.wesl"),
    shader!("reference/path/noise.cs.wesl"),
    shader!("reference/path/trace.cs.wesl"),
    shader!("reference/photon/emit.wesl"),
    shader!("reference/photon/map.wesl"),
    shader!("reference/photon/trace.cs.wesl"),
    shader!("scene/geometry.wesl"),
    shader!("scene/material.wesl"),
    shader!("scene/motion/deform.cs.wesl"),
    shader!("scene/motion/instances.cs.wesl"),
    shader!("scene/scene.wesl"),
    shader!("scene/surface.wesl"),
    shader!("scene/texture.wesl"),
    shader!("shadow/alone.vs.wesl"),
    shader!("shadow/compare.wesl"),
    shader!("shadow/depth.vs.wesl"),
    shader!("shadow/depth_bounds.cs.wesl"),
    shader!("shadow/fit.cs.wesl"),
    shader!("shadow/inspect.wesl"),
    shader!("shadow/lookup.wesl"),
    shader!("shadow/maps.wesl"),
    shader!("shadow/moments/blur.wesl"),
    shader!("shadow/moments/bounds.wesl"),
    shader!("shadow/moments/columns.cs.wesl"),
    shader!("shadow/moments/convert.cs.wesl"),
    shader!("shadow/moments/halve.cs.wesl"),
    shader!("shadow/moments/lookup.wesl"),
    shader!("shadow/moments/represent.wesl"),
    shader!("shadow/moments/rows.cs.wesl"),
    shader!("shadow/moments/texel.wesl"),
    shader!("shadow/moments/warp.wesl"),
    shader!("shadow/options.wesl"),
    shader!("shadow/paraboloid.vs.wesl"),
    shader!("shadow/projection.wesl"),
    shader!("shadow/receiver.wesl"),
    shader!("shadow/tint.vs.wesl"),
    shader!("shadow/traced.wesl"),
    shader!("shared/albedo_table.cs.wesl"),
    shader!("shared/brdf.wesl"),
    shader!("shared/brdf_sample.wesl"),
    shader!("shared/color.wesl"),
    shader!("shared/depth.wesl"),
    shader!("shared/disc.wesl"),
    shader!("shared/footprint.wesl"),
    shader!("shared/full_screen.wesl"),
    shader!("shared/hash.wesl"),
    shader!("shared/oct.wesl"),
    shader!("shared/pair.wesl"),
    shader!("specular/copy.cs.wesl"),
    shader!("specular/follow.vs.wesl"),
    shader!("specular/followed.wesl"),
    shader!("transparency/behind.cs.wesl"),
    shader!("transparency/shade.cs.wesl"),
    shader!("view/barycentrics.wesl"),
    shader!("view/cull.wesl"),
    shader!("view/cull_count.cs.wesl"),
    shader!("view/cull_expand.cs.wesl"),
    shader!("view/cull_scan.cs.wesl"),
    shader!("view/motion_vectors.cs.wesl"),
    shader!("view/raster/cutout.wesl"),
    shader!("view/raster/draw.wesl"),
    shader!("view/raster/outline.wesl"),
    shader!("view/raster/raster.wesl"),
    shader!("view/raster/resolve.cs.wesl"),
    shader!("view/raster/tile.wesl"),
    shader!("view/raster/tiles.cs.wesl"),
    shader!("view/raster/triangles.cs.wesl"),
    shader!("view/resolve.cs.wesl"),
    shader!("view/through.wesl"),
    shader!("view/view.wesl"),
    shader!("view/visibility.vs.wesl"),
];

/// The modules as a library to link from.
pub fn library() -> Library {
    Library::new(MODULES)
}

/// Every permutation that a pass can ask for. A test links and validates all of them without a GPU, and checks that
/// every entry file stands here.
pub fn permutations() -> Vec<Permutation> {
    let plain_entries = [
        "caustics/photon_trace/gather.cs.wesl",
        "caustics/photon_trace/places.cs.wesl",
        "caustics/photon_trace/spread.cs.wesl",
        "caustics/photon_trace/trace.cs.wesl",
        "indirect/accumulate/accumulate.cs.wesl",
        "indirect/bounces/place.cs.wesl",
        "indirect/bounces/spread.cs.wesl",
        "indirect/clusters/assign.cs.wesl",
        "indirect/clusters/finish.cs.wesl",
        "indirect/clusters/start.cs.wesl",
        "indirect/foreign/radiance.cs.wesl",
        "indirect/foreign/surface.cs.wesl",
        "indirect/compensate/nearby.cs.wesl",
        "indirect/gather/discontinuity.cs.wesl",
        "indirect/gather/gaussian.cs.wesl",
        "indirect/ism/picture.cs.wesl",
        "indirect/ism/pull.cs.wesl",
        "indirect/ism/push.cs.wesl",
        "indirect/pictures/points.cs.wesl",
        "indirect/pictures/resolve.cs.wesl",
        "indirect/pictures/rsm.cs.wesl",
        "indirect/pictures/vpls.cs.wesl",
        "indirect/sources/place.cs.wesl",
        "indirect/vpls/choose.cs.wesl",
        "indirect/vpls/place.cs.wesl",
        "indirect/vpls/scan.cs.wesl",
        "indirect/vpls/tiles.cs.wesl",
        "indirect/vpls/weigh.cs.wesl",
        "light/grid.cs.wesl",
        "environment/halve.cs.wesl",
        "environment/prefilter.cs.wesl",
        "environment/project.cs.wesl",
        "indirect/points/update.cs.wesl",
        "scene/motion/deform.cs.wesl",
        "scene/motion/instances.cs.wesl",
        "post/antialias.cs.wesl",
        "post/exposure.cs.wesl",
        "post/histogram.cs.wesl",
        "post/present.vs.wesl",
        "post/tone_map.cs.wesl",
        "rays/corners.cs.wesl",
        "rays/refit.cs.wesl",
        "reference/path/noise.cs.wesl",
        "shadow/depth_bounds.cs.wesl",
        "shadow/fit.cs.wesl",
        "shadow/tint.vs.wesl",
        "shared/albedo_table.cs.wesl",
        "specular/copy.cs.wesl",
        "view/cull_count.cs.wesl",
        "view/cull_expand.cs.wesl",
        "view/cull_scan.cs.wesl",
    ];
    let mut all: Vec<_> = plain_entries.into_iter().map(plain).collect();
    all.extend([Viewed::Multisampled, Viewed::Words].map(|what| debug_view(what, false)));
    all.extend([background(), photon_trace(), first_hit()]);
    for a in [false, true] {
        all.extend([Viewed::Float, Viewed::Integer].map(|what| debug_view(what, a)));
        all.push(resolve(a, false));
        all.push(resolve(a, true));
        all.push(behind(a));
        all.push(specular_follow(a));
        all.push(motion_vectors(a));
        all.push(accumulate(a));
        all.extend([ism_splat(a, false), ism_splat(a, true), edges(a), cluster_update(a)]);
        all.push(path_trace(a));
        all.push(shadow_depth(a));
        all.extend([shadow_paraboloid(a, false), shadow_paraboloid(a, true)]);
        all.push(raster_resolve(a));
        for b in [false, true] {
            all.extend([raster_triangles(a, b), raster_tiles(a, b)]);
            all.extend([Layer::None, Layer::First, Layer::Next].map(|layer| visibility(a, b, layer)));
        }
    }
    for source in ShadowSource::ALL {
        all.extend([aov(source), shadow_alone(source), rsm_light(source), radiosity(source)]);
        for a in [false, true] {
            all.extend([shade_layer(a, source), shade(a, source)]);
            all.extend([forward(a, false, source), forward(a, true, source)]);
        }
    }
    for sight in [(false, false), (true, false), (false, true)] {
        all.extend([gather(sight, false, false), gather(sight, true, false), gather(sight, false, true)]);
    }
    for channels in [1, 2, 4] {
        all.extend([moments_columns(channels), moments_halve(channels)]);
        for float_maps in [false, true] {
            all.extend([moments_convert(channels, float_maps), moments_rows(channels, float_maps)]);
        }
    }
    all
}

/// What kind of buffer is shown as a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Viewed {
    /// A texture of numbers, depth among them.
    Float,
    /// A texture of whole numbers.
    Integer,
    /// A texture of several samples.
    Multisampled,
    /// A buffer.
    Words,
}

/// A buffer as a picture; `array`: whether the texture is one.
pub fn debug_view(what: Viewed, array: bool) -> Permutation {
    let kinds =
        [("integer", Viewed::Integer), ("multisampled", Viewed::Multisampled), ("words", Viewed::Words)];
    let entry = Permutation::plain("post/debug_view.cs.wesl").flag("array", array);
    kinds.into_iter().fold(entry, |entry, (flag, kind)| entry.flag(flag, what == kind))
}

/// An entry file without flags.
pub fn plain(entry: &'static str) -> Permutation {
    Permutation::plain(entry)
}

/// Surface buffer from visibility; with `emissive`, radiance of glowing surfaces too, with `through`, what passes.
pub fn resolve(emissive: bool, through: bool) -> Permutation {
    Permutation::plain("view/resolve.cs.wesl").flag("emissive", emissive).flag("through", through)
}

/// How far surfaces have moved; with `layered`, see-through ones too.
pub fn motion_vectors(layered: bool) -> Permutation {
    Permutation::plain("view/motion_vectors.cs.wesl").flag("layered", layered)
}

/// The picture so far and its mips; `whole` copies it too.
pub fn behind(whole: bool) -> Permutation {
    Permutation::plain("transparency/behind.cs.wesl").flag("whole", whole)
}

/// What mirrors and smooth glass show; `layered`: see-through layers.
pub fn specular_follow(layered: bool) -> Permutation {
    Permutation::plain("specular/follow.vs.wesl").flag("layered", layered)
}

/// A layer of see-through surfaces over what is behind it.
pub fn shade_layer(emissive: bool, shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("transparency/shade.cs.wesl").flag("emissive", emissive))
}

/// Light of virtual point lights that are seen by their imperfect shadow maps, by rays, or always; with `loss`, what bounding
/// their nearness takes.
pub fn gather((ism, rays): (bool, bool), loss: bool, far: bool) -> Permutation {
    let entry = plain("indirect/gather/gather.cs.wesl").flag("ism", ism).flag("rays", rays);
    entry.flag("loss", loss).flag("far", far)
}

/// Deferred shading.
pub fn shade(emissive: bool, shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("direct/shade.cs.wesl").flag("emissive", emissive))
}

/// The surroundings behind everything.
pub fn background() -> Permutation {
    Permutation::plain("environment/background.vs.wesl")
}

/// The path tracer, with light paths' photons or without.
pub fn path_trace(photons: bool) -> Permutation {
    Permutation::plain("reference/path/trace.cs.wesl").flag("photons", photons)
}

/// Light paths.
pub fn photon_trace() -> Permutation {
    Permutation::plain("reference/photon/trace.cs.wesl").flag("photons", true)
}

/// What the camera sees first.
pub fn first_hit() -> Permutation {
    plain("reference/first_hit.cs.wesl")
}

/// The sum of frames; `raw`: of any values, as they are.
pub fn accumulate(raw: bool) -> Permutation {
    Permutation::plain("post/accumulate.cs.wesl").flag("raw", raw)
}

/// One quantity of surface or light.
pub fn aov(shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("post/aov.cs.wesl"))
}

/// Imperfect shadow maps; with `teams`, large discs are drawn by several lanes.
pub fn ism_splat(teams: bool, far: bool) -> Permutation {
    Permutation::plain("indirect/ism/splat.cs.wesl").flag("teams", teams).flag("far", far)
}

/// The centres of clusters, or the lights that they are.
pub fn cluster_update(emits: bool) -> Permutation {
    Permutation::plain("indirect/clusters/update.cs.wesl").flag("emits", emits)
}

/// The mean over what is interleaved, of more than 4 × 4 pixels or of no more.
pub fn edges(wide: bool) -> Permutation {
    Permutation::plain("indirect/gather/edges.cs.wesl").flag("wide", wide)
}

/// What a light's view shows as light that goes on.
pub fn rsm_light(shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("indirect/rsm/light.cs.wesl"))
}

/// What the picture scatters on of the light of lamps.
pub fn radiosity(shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("indirect/compensate/radiosity.cs.wesl"))
}

/// Shadows for other programs.
pub fn shadow_alone(shadows: ShadowSource) -> Permutation {
    shadows.flags(Permutation::plain("shadow/alone.vs.wesl"))
}

/// A shadow view's depth.
pub fn shadow_depth(masked: bool) -> Permutation {
    Permutation::plain("shadow/depth.vs.wesl").flag("masked", masked)
}

fn channels(entry: &'static str, channels: u32) -> Permutation {
    Permutation::plain(entry).flag("two", channels == 2).flag("four", channels == 4)
}

/// Maps of 1, 2 or 4 moments from depth, texel by texel; `float_maps`: depth is R32Float.
pub fn moments_convert(count: u32, float_maps: bool) -> Permutation {
    channels("shadow/moments/convert.cs.wesl", count).flag(FLOAT_MAPS, float_maps)
}

/// The same, blurred along x.
pub fn moments_rows(count: u32, float_maps: bool) -> Permutation {
    channels("shadow/moments/rows.cs.wesl", count).flag(FLOAT_MAPS, float_maps)
}

/// Maps of moments blurred along y.
pub fn moments_columns(count: u32) -> Permutation {
    channels("shadow/moments/columns.cs.wesl", count)
}

/// The next mip of maps of moments.
pub fn moments_halve(count: u32) -> Permutation {
    channels("shadow/moments/halve.cs.wesl", count)
}

/// A hemisphere's depth.
pub fn shadow_paraboloid(masked: bool, cull_front: bool) -> Permutation {
    Permutation::plain("shadow/paraboloid.vs.wesl").flag("masked", masked).flag("cull_front", cull_front)
}

/// Small triangles of views, drawn in compute; larger ones in tiles. With `numbers`, what each texel shows, too.
pub fn raster_triangles(masked: bool, numbers: bool) -> Permutation {
    raster("view/raster/triangles.cs.wesl", numbers).flag("masked", masked)
}

/// Tiles of large triangles of views.
pub fn raster_tiles(masked: bool, numbers: bool) -> Permutation {
    raster("view/raster/tiles.cs.wesl", numbers).flag("masked", masked)
}

/// What was drawn in compute as textures.
pub fn raster_resolve(numbers: bool) -> Permutation {
    raster("view/raster/resolve.cs.wesl", numbers)
}

fn raster(entry: &'static str, numbers: bool) -> Permutation {
    Permutation::plain(entry).flag("numbers", numbers)
}

/// What a visibility buffer shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Opaque surfaces.
    None,
    /// The nearest see-through surfaces.
    First,
    /// The see-through surfaces behind a layer.
    Next,
}

/// The visibility buffer.
pub fn visibility(indexed: bool, masked: bool, layer: Layer) -> Permutation {
    Permutation::plain("view/visibility.vs.wesl")
        .flag("indexed", indexed)
        .flag("masked", masked)
        .flag("layer", layer != Layer::None)
        .flag("first", layer == Layer::First)
}

/// Forward shading.
pub fn forward(masked: bool, multisampled: bool, shadows: ShadowSource) -> Permutation {
    let entry = Permutation::plain("direct/forward.vs.wesl");
    shadows.flags(entry.flag("masked", masked).flag("multisampled", multisampled))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_permutation_links_and_validates() {
        let library = library();
        let errors: Vec<_> =
            permutations().iter().filter_map(|p| library.link(p).err()).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{}", errors.join("\n"));
    }

    #[test]
    fn a_shader_is_linked_to_the_same_text_every_time() {
        // The most imports: hash sets of one process differ as those of two do.
        let all = permutations();
        let entry = all.iter().find(|p| p.entry == "direct/shade.cs.wesl").unwrap();
        let text = || library().link(entry).unwrap().wgsl;
        let first = text();
        assert!((0..4).all(|_| text() == first));
    }

    #[test]
    fn every_entry_file_has_a_permutation() {
        let listed: Vec<_> = permutations().iter().map(|p| p.entry).collect();
        let forgotten: Vec<_> = library().entries().filter(|entry| !listed.contains(entry)).collect();
        assert!(forgotten.is_empty(), "{forgotten:?}");
    }

    #[test]
    fn no_two_bindings_of_a_shader_share_a_place() {
        for permutation in permutations() {
            let bindings = library().link(&permutation).unwrap().bindings().unwrap();
            for pair in bindings.windows(2) {
                let place = |b: &chiaro_gpu::shader::Reflected| (b.group, b.binding);
                assert_ne!(place(&pair[0]), place(&pair[1]), "{}: {pair:?}", permutation.label());
            }
        }
    }

    #[test]
    fn an_unknown_flag_is_an_error() {
        assert!(library().link(&Permutation::plain("view/resolve.cs.wesl")).is_err());
    }
}
