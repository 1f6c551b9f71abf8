//! Single quantities of a frame (AOVs).

use chiaro_gpu::{Bind, Buffer, ComputePipeline, Frame, GpuError, Group, Mapping, Scale, Texture, ViewHint};

use super::{Accumulator, Sum, over, uniform};
use crate::direct::{Permutations, lighting_binds, surface_binds};
use crate::scene::SceneGpu;
use crate::settings::Condition;
use crate::shadow::ShadowOutputs;
use crate::view::{MOTION, SurfaceBuffer};
use crate::{Kit, shaders};

/// A quantity shown by itself, in the order of `aov.cs.wesl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// The part of the light that glows, is background, or reaches its first surface straight, nits; see [`Parts`](super::Parts).
    Direct,
    /// Base colour, linear.
    Albedo,
    /// World-space shading normal, −1..1.
    Normal,
    /// Metres along the camera's axis.
    Depth,
    /// Share of all lamps' light that arrives, 0..1.
    Shadow,
    /// The part of the light that was scattered before it reached the surface, nits.
    Indirect,
    /// Roughness, metalness, specular.
    Roughness,
    /// World-space normal of the triangle, −1..1.
    GeometricNormal,
    /// Which of a sun's cascades (of a point's faces) a pixel's shadow comes from: a colour each. Of the first light with a
    /// shadow that reaches the pixel, as the three that follow.
    ShadowCascade,
    /// The shadow map's texels as a checkerboard on the surface.
    ShadowTexels,
    /// How far the shadow's filter reaches, metres; pcss: how wide the penumbra is estimated.
    ShadowPenumbra,
    /// How far the receiver is moved against acne, metres.
    ShadowBias,
    /// How many spots and points may reach the pixel: those of its froxel.
    Lights,
    /// How far what the pixel shows has moved since the frame before: pixels right, pixels down, metres away from the camera's
    /// plane. Of see-through surfaces the nearest. Taken once a still, in the pixel's middle; of a frame that is averaged over
    /// time, where that was taken.
    Motion,
    /// The part of the light that came through mirrors and smooth glass alone before a surface scatters it, nits.
    Caustics,
}

impl Aov {
    /// All, with the names `--aov` takes.
    pub const ALL: [(Self, &'static str); 15] = [
        (Self::Direct, "direct"),
        (Self::Albedo, "albedo"),
        (Self::Normal, "normal"),
        (Self::Depth, "depth"),
        (Self::Shadow, "shadow"),
        (Self::Indirect, "indirect"),
        (Self::Roughness, "roughness"),
        (Self::GeometricNormal, "geometric_normal"),
        (Self::ShadowCascade, "shadow_cascade"),
        (Self::ShadowTexels, "shadow_texels"),
        (Self::ShadowPenumbra, "shadow_penumbra"),
        (Self::ShadowBias, "shadow_bias"),
        (Self::Lights, "lights"),
        (Self::Motion, "motion"),
        (Self::Caustics, "caustics"),
    ];

    /// By name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(_, n)| *n == name).map(|(aov, _)| aov)
    }

    /// The name that `--aov` takes.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(aov, _)| *aov == self).map_or("", |(_, name)| name)
    }

    /// Whether it is one of the parts that the picture's light is made of.
    pub fn is_part(self) -> bool {
        matches!(self, Self::Direct | Self::Indirect | Self::Caustics)
    }

    /// Where it is not black: of rays there are no maps to be seen, and parts are those of the picture.
    pub fn only(self) -> Option<Condition> {
        Some(Condition(match self {
            Self::ShadowCascade | Self::ShadowTexels | Self::ShadowPenumbra | Self::ShadowBias => {
                "shadow.layout=single|cascaded"
            }
            Self::Direct => "camera.show=both|direct",
            Self::Indirect => "camera.show=both|indirect and indirect.technique!=none",
            Self::Caustics => "camera.show=both|caustics and caustics.technique=photon_trace",
            _ => return None,
        }))
    }

    /// How to look at it.
    pub fn hint(self) -> ViewHint {
        use Mapping::{Color, Distance, Exposed, Heat, Signed};
        use Scale::{By, OfScene};
        let (about, mapping, scale) = match self {
            Self::Direct => (
                "What glows or is background, and light that reaches its first surface straight",
                Exposed,
                By(1.0),
            ),
            Self::Indirect => ("Light that was scattered before, or what stands in for it", Exposed, By(1.0)),
            Self::Caustics => ("Light through mirrors and smooth glass alone", Exposed, By(1.0)),
            Self::Albedo => ("Base colour", Color, By(1.0)),
            Self::Normal => {
                ("Shading normal in the world: x red, y green, z blue, grey is 0", Signed, By(1.0))
            }
            Self::GeometricNormal => ("Normal of the triangle, as the normal", Signed, By(1.0)),
            Self::Depth => (
                "Distance: white is near; half as bright a tenth of the scene's size away",
                Distance,
                OfScene(10.0),
            ),
            Self::Shadow => ("Share of all lamps' light that arrives: black is shadow", Color, By(1.0)),
            Self::Roughness => ("Roughness red, metalness green, specular blue", Color, By(1.0)),
            Self::ShadowCascade => (
                "Which shadow map a pixel is looked up in: a colour each, mixed where two are",
                Color,
                By(1.0),
            ),
            Self::ShadowTexels => ("The shadow map's texels on the surface", Color, By(1.0)),
            Self::ShadowPenumbra => (
                "How far the shadow's filter reaches: white is a hundredth of the scene's size",
                Color,
                OfScene(100.0),
            ),
            Self::ShadowBias => (
                "How far receivers are moved against acne: white is a thousandth of the scene's size",
                Color,
                OfScene(1000.0),
            ),
            Self::Lights => (
                "Lights that may reach the pixel: black none, blue, red, yellow, white from 16 on",
                Heat,
                By(1.0 / 16.0),
            ),
            Self::Motion => return MOTION,
        };
        ViewHint::scaled(about, mapping, scale)
    }
}

/// Shows single quantities of the surface buffer and of lighting; parts of light are in [`Parts`](super::Parts).
#[derive(Debug)]
pub struct AovPass {
    pipeline: ComputePipeline,
    inputs: Vec<Buffer>,
    // Of what a texture holds as it is.
    copy: Accumulator,
}

impl AovPass {
    /// Compiles the pass, for so many quantities a frame.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(kit: &Kit, permutations: Permutations, count: usize) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let entry = shaders::aov(permutations.shadow.source);
        let constants = permutations.constants(gpu);
        let pipeline = ComputePipeline::new(gpu, library, &entry, &[frame_layout, scene_layout], &constants)?;
        let inputs = (0..count).map(|_| uniform::<[u32; 4]>(gpu, "aov_input")).collect();
        Ok(Self { pipeline, inputs, copy: Accumulator::raw(gpu, library)? })
    }

    /// Takes this frame's motion as it is, as often as other quantities are summed.
    pub fn record_motion(&self, frame: &mut Frame<'_>, motion: &Texture, samples: u32, sum: &mut Sum) {
        self.copy.record(frame, motion, samples as f32, sum);
    }

    /// Adds this frame's value of quantity number `index` of those the pass was made for.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (surface, shadows, light_grid): (&SurfaceBuffer, &ShadowOutputs, &Buffer),
        (index, aov): (usize, Aov),
        sum: &mut Sum,
    ) {
        let input = &self.inputs[index];
        frame.upload(input, &[[aov as u32, sum.frames, 0, 0]]);
        let mut binds: Vec<Bind<'_>> = lighting_binds(shadows, light_grid);
        binds.extend(surface_binds(surface));
        binds.push(("aov_input", input.into()));
        binds.push(("sum_before", sum.before().into()));
        binds.push(("sum", sum.after().into()));
        frame.compute("post/aov", &self.pipeline, &[frame_group, scene.group()], &binds, over(sum));
        sum.count();
    }
}
