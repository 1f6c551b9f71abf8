//! Rust structs that reach the GPU against their WESL twins.

use std::collections::BTreeMap;
use std::mem::offset_of;

use chiaro_gpu::shader::{Linked, check_layout};

use crate::caustics::photon_trace::CausticPass;
use crate::environment::Lobe;
use crate::frame::{FrameData, LightData, ShadowParameters, ShadowViewData};
use crate::indirect::Vpl;
use crate::indirect::accumulate::AccumulateData;
use crate::indirect::bounces::BounceData;
use crate::indirect::clusters::{Centre, ClusteringData};
use crate::indirect::compensate::CompensateData;
use crate::indirect::foreign::ForeignData;
use crate::indirect::gather::GatherData;
use crate::indirect::ism::IsmData;
use crate::indirect::pictures::PictureData;
use crate::indirect::points::PointFacts;
use crate::indirect::rsm::RsmViewData;
use crate::indirect::sources::SourceData;
use crate::indirect::vpls::SamplingData;
use crate::post::{AntialiasData, DebugInput};
use crate::rays::refit::{NodeBox, RefitJob};
use crate::reference::first_hit::FirstHitPass;
use crate::reference::path::PathPass;
use crate::reference::path::noise::NoiseInput;
use crate::reference::photon::PhotonPass;
use crate::scene::clusters::ClusterData;
use crate::scene::material::MaterialData;
use crate::scene::motion::{DeformJob, InstanceMove};
use crate::scene::{InstanceData, ItemData};
use crate::shaders;
use crate::shadow::SunFit;
use crate::shadow::moments::Blur;
use crate::view::culling::CullClasses;
use crate::view::raster::RasterData;
use crate::view::{MomentsData, ViewData};

macro_rules! same {
    ($linked:expr, $rust:ty, $wesl:literal, $($field:ident),+ $(,)?) => {
        check_layout($linked, $wesl, &[$((stringify!($field), offset_of!($rust, $field))),+], size_of::<$rust>())
            .unwrap();
    };
}

fn linked(entry: &'static str) -> Linked {
    let permutation = shaders::permutations().into_iter().find(|p| p.entry == entry).unwrap();
    shaders::library().link(&permutation).unwrap()
}

#[test]
fn rust_structs_equal_their_wesl_twins() {
    let photons = &linked("caustics/photon_trace/trace.cs.wesl");
    same!(
        photons,
        CausticPass,
        "CausticPass",
        target_lo,
        diagonal,
        target_hi,
        pixel_m2,
        photons,
        lanes,
        first,
        seed,
        interfaces,
        disperses,
        lamps,
        step,
        enough,
        widest,
        reserved0,
        reserved1,
    );
    let shade = &linked("direct/shade.cs.wesl");
    same!(
        shade,
        FrameData,
        "Frame",
        clip_from_ws,
        relative_from_clip,
        eye_ws,
        orthographic,
        forward_ws,
        footprint_scale,
        size_px,
        directional_lights,
        local_lights,
        grid,
        grid_slices,
        lighting_model,
        normal_maps,
        ambient,
        environment,
        sky,
        radiance_scale,
        environment_diffuse,
        anisotropy,
        environment_nits,
        environment_share,
        environment_turn,
        gathers,
        mirrors_sources,
        show_direct,
        show_indirect,
        show_caustics,
        show_unlit,
        shadow,
    );
    same!(
        shade,
        ShadowParameters,
        "ShadowParameters",
        floor,
        blend,
        filter_radius,
        light_size,
        bleed_reduction,
        positive_exponent,
        negative_exponent,
        anisotropy,
        min_variance,
        clamps,
        rays,
        reserved,
    );
    same!(
        shade,
        LightData,
        "Light",
        position_ws,
        kind,
        direction_ws,
        inverse_range_squared,
        intensity,
        first_view,
        cone_scale,
        cone_offset,
        view_count,
        cone_rad,
    );
    same!(
        shade,
        ShadowViewData,
        "ShadowView",
        clip_from_ws,
        layer,
        projection,
        texel_m,
        normal_offset,
        constant_bias,
        slope_bias,
        near_m,
        far_m,
        eye_ws,
        resolution,
        begin_m,
        end_m,
        border,
        reserved,
    );
    let resolve = &linked("view/resolve.cs.wesl");
    same!(
        resolve,
        ClusterData,
        "Cluster",
        sphere,
        cone,
        positions,
        attributes,
        triangles,
        triangle_count,
        extras,
        material,
        flags,
        vertex_count,
    );
    same!(
        resolve,
        InstanceData,
        "Instance",
        world_from_object,
        previous_world_from_object,
        max_scale,
        flags,
        reserved,
    );
    same!(resolve, ItemData, "Item", cluster, instance);
    same!(
        resolve,
        MaterialData,
        "Material",
        base_color,
        emissive,
        kind,
        metallic,
        roughness,
        specular,
        normal_scale,
        specular_color,
        occlusion_strength,
        absorption,
        transmission,
        ior,
        thickness,
        dispersion,
        alpha_cutoff,
        f0_factor,
        flags,
        base_color_texture,
        metallic_roughness_texture,
        normal_texture,
        occlusion_texture,
        emissive_texture,
        specular_texture,
        specular_color_texture,
        transmission_texture,
        thickness_texture,
    );
    same!(
        &linked("reference/path/trace.cs.wesl"),
        PathPass,
        "PathPass",
        size_px,
        before,
        sample_count,
        max_depth,
        diffuse_bounces,
        seed,
        first_row,
        rows,
        first_seen,
        seen_count,
        step,
        zero,
        reserved,
    );
    same!(
        &linked("reference/first_hit.cs.wesl"),
        FirstHitPass,
        "FirstHitPass",
        size_px,
        first_sample,
        sample_count,
        what,
        seed,
        step,
        before,
    );
    same!(
        &linked("reference/photon/trace.cs.wesl"),
        PhotonPass,
        "PhotonPass",
        scene_lo,
        lanes,
        scene_hi,
        paths,
        target_lo,
        cells,
        target_hi,
        first_path,
        size_px,
        max_depth,
        diffuse_bounces,
        seed,
        caustics_only,
        pixel_m2,
        step,
        radius_m,
        shrunk,
        footprint,
        share,
        first_lane,
        end_lane,
        aimed,
        reserved,
    );
    let points = &linked("indirect/points/update.cs.wesl");
    same!(points, PointFacts, "PointFacts", count, point_m2, reserved0, reserved1);
    let place = &linked("indirect/vpls/place.cs.wesl");
    same!(
        place,
        SamplingData,
        "VplSampling",
        tiles,
        views,
        candidates,
        vpls,
        round,
        first_block,
        mode,
        by_view,
        turn,
        fresh,
        stride,
        keeps_all,
        seed,
        drift,
        reserved,
    );
    same!(
        place,
        RsmViewData,
        "RsmView",
        relative_from_clip,
        eye_ws,
        light,
        axis_ws,
        texel,
        first_tile,
        tiles,
        side,
        is_parallel,
        first,
        count,
        finer_from,
        finer_to,
    );
    same!(
        &linked("indirect/pictures/rsm.cs.wesl"),
        PictureData,
        "PictureData",
        points,
        tiles,
        views,
        columns,
        cell,
        step,
        radius_px,
        reserved,
    );
    let cluster = &linked("indirect/clusters/assign.cs.wesl");
    same!(
        cluster,
        ClusteringData,
        "Clustering",
        clusters,
        first_block,
        is_warm,
        position,
        normal,
        reserved0,
        reserved1,
        reserved2,
    );
    same!(cluster, Centre, "Centre", position_ws, reserved0, normal_ws, reserved1);
    let splat = &linked("indirect/ism/splat.cs.wesl");
    same!(splat, Vpl, "Vpl", position_ws, normal, flux, block_radius);
    same!(
        splat,
        IsmData,
        "IsmData",
        largest_m,
        point_area_m2,
        resolution,
        points_per_vpl,
        pool,
        first,
        tiles,
        levels,
        pull_threshold,
        push_threshold,
        pyramid,
        splat,
        vpl_set,
        reserved0,
        reserved1,
        reserved2,
        half_m,
        reserved3,
        dense_at_ws,
        dense_m,
    );
    same!(
        &linked("indirect/sources/place.cs.wesl"),
        SourceData,
        "SourceData",
        count,
        glowing,
        first,
        first_block,
        round,
        places,
        directions,
        reserved2,
        glow,
        radius,
        turn,
        middle_ws,
        reserved0,
        nits,
        reserved1,
    );
    same!(
        &linked("indirect/bounces/place.cs.wesl"),
        BounceData,
        "Bounce",
        vpl_set,
        first,
        most,
        first_block,
        place,
        appends,
        turn,
        lit_by,
        shift,
        reserved0,
    );
    let refit = &linked("rays/refit.cs.wesl");
    same!(refit, RefitJob, "RefitJob", node, own, children, pad);
    same!(refit, NodeBox, "NodeBox", lo, leaf_area, hi, area);
    same!(
        &linked("reference/path/noise.cs.wesl"),
        NoiseInput,
        "NoiseInput",
        size_px,
        samples,
        step_px,
        round,
        reserved
    );
    same!(
        &linked("post/debug_view.cs.wesl"),
        DebugInput,
        "DebugInput",
        layer,
        mapping,
        scale,
        words,
        columns,
        reserved0,
        reserved1,
        reserved2,
    );
    same!(
        &linked("post/antialias.cs.wesl"),
        AntialiasData,
        "Antialias",
        size_px,
        jitter_px,
        rests,
        history_scale,
        key,
        reserved,
    );
    same!(
        &linked("indirect/accumulate/accumulate.cs.wesl"),
        AccumulateData,
        "Accumulate",
        size_px,
        frames,
        history_scale,
    );
    same!(
        &linked("view/motion_vectors.cs.wesl"),
        MomentsData,
        "Moments",
        clip_from_ws_now,
        clip_from_ws_before,
        depth_now,
        depth_before,
        pixel_m,
        continues,
        reserved0,
        reserved1,
    );
    same!(&linked("environment/prefilter.cs.wesl"), Lobe, "Lobe", roughness, samples, reserved0, reserved1);
    same!(
        &linked("view/cull_count.cs.wesl"),
        ViewData,
        "View",
        clip_from_ws,
        planes,
        hole,
        eye_ws,
        hole_half,
        near_m,
        share,
        footprint_scale,
        size_px,
        layer,
        flags,
        depth_limit,
        slot,
        reserved0,
        reserved1,
    );
    same!(
        &linked("indirect/gather/gather.cs.wesl"),
        GatherData,
        "GatherData",
        interleave,
        clamp,
        first,
        end,
        adds,
        filter_width,
        discontinuity_depth,
        discontinuity_normal,
        compensates,
        gives_back,
        sets,
        reserved0,
    );
    same!(
        &linked("indirect/compensate/nearby.cs.wesl"),
        CompensateData,
        "CompensateData",
        interleave,
        clamp,
        turn,
    );
    let foreign = &linked("indirect/foreign/surface.cs.wesl");
    same!(foreign, ForeignData, "ForeignData", far_depth, is_standard, is_biased, reserved);
    let instances = &linked("scene/motion/instances.cs.wesl");
    same!(instances, InstanceMove, "InstanceMove", world_from_object, max_scale, flags, instance, reserved);
    same!(
        &linked("scene/motion/deform.cs.wesl"),
        DeformJob,
        "DeformJob",
        cluster,
        rest,
        first_matrix,
        flags,
        morph,
        target_count,
        first_weight,
        morph_stride,
    );
    same!(
        &linked("shadow/moments/rows.cs.wesl"),
        Blur,
        "Blur",
        radius,
        prefilter,
        reserved0,
        reserved1,
        weights
    );
    same!(&linked("view/cull_scan.cs.wesl"), CullClasses, "CullClasses", first, item_count, list_stride, row);
    let raster = &linked("view/raster/resolve.cs.wesl");
    same!(
        raster,
        RasterData,
        "Raster",
        size,
        columns,
        texels,
        first,
        capacity,
        phase,
        anisotropy,
        footprint_scale,
        reserved0,
        reserved1,
        reserved2
    );
}

#[test]
fn some_shader_uses_every_member_of_every_buffer() {
    let mut used = BTreeMap::new();
    for permutation in shaders::permutations() {
        for (member, here) in shaders::library().link(&permutation).unwrap().members() {
            *used.entry(member).or_insert(false) |= here;
        }
    }
    assert!(used[&("Light".to_owned(), "kind".to_owned())]);
    // What pads a buffer's structs to their size.
    let is_room = |name: &str| ["reserved", "pad"].iter().any(|room| name.starts_with(room));
    let unused: Vec<_> = used.iter().filter(|((_, name), used)| !**used && !is_room(name)).collect();
    assert!(unused.is_empty(), "{unused:?}");
}

#[test]
fn a_struct_that_differs_is_found() {
    let shade = &linked("direct/shade.cs.wesl");
    let wrong = [("position_ws", 0), ("kind", 16)];
    let message = check_layout(shade, "Light", &wrong, 32).unwrap_err();
    assert!(message.contains("intensity"), "{message}");
    let fit = &linked("shadow/fit.cs.wesl");
    same!(
        fit,
        SunFit,
        "SunFit",
        light_from_ws,
        origins_ws,
        steps_ws,
        scene_ls,
        begin_m,
        end_m,
        lambda,
        least_near_m,
        first_view,
        count,
        near_m,
        far_m,
        own_range,
        holes,
        blend,
        reserved,
    );
}
