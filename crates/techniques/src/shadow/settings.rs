//! Settings of shadow maps, and which of them go together.

use crate::view::Raster;
use crate::{choice, settings};

choice! {
    /// Which shadow maps suns have.
    pub enum Layout {
        /// Several maps per sun, each for a slice of what the camera sees (Zhang et al. 2006, parallel-split shadow maps).
        Cascaded = "cascaded",
        /// One map per sun around all that the camera sees.
        Single = "single",
        /// Rays instead of maps, to every light (`shadow.rays`): exact, and dearer.
        Traced = "traced",
        /// No shadows, of any light.
        None = "none",
    }
}

choice! {
    /// Which shadow maps point lights have.
    pub enum PointLayout {
        /// Six perspective maps.
        Cube = "cube",
        /// Two maps of a hemisphere each (Brabec et al. 2002): a third of the memory, coarser.
        Paraboloid = "paraboloid",
    }
}

choice! {
    /// What the maps hold.
    pub enum Representation {
        /// Depth, compared texel by texel.
        Depth = "depth",
        /// Mean and variance of depth (Donnelly & Lauritzen 2006), which can be blurred. Light bleeds where shadows overlap.
        Variance = "variance",
        /// An exponential of depth (Annen et al. 2008): one channel. Light leaks close behind casters.
        Exponential = "exponential",
        /// Variance of warped depth (Lauritzen & McCool 2008): less bleeding than variance.
        Evsm2 = "evsm2",
        /// The same with a second, negative warp: less still.
        Evsm4 = "evsm4",
        /// Four moments of depth (Peters & Klein 2015, Hamburger).
        Moments = "moments",
    }
}

impl Representation {
    /// Numbers per texel beside the depth.
    pub fn channels(self) -> u32 {
        match self {
            Self::Depth => 0,
            Self::Exponential => 1,
            Self::Variance | Self::Evsm2 => 2,
            Self::Evsm4 | Self::Moments => 4,
        }
    }
}

choice! {
    /// How a map is filtered.
    pub enum Filter {
        /// Percentage-closer filtering (Reeves, Salesin & Cook 1987) of depth comparisons.
        Pcf = "pcf",
        /// One unfiltered test.
        None = "none",
        /// Percentage-closer soft shadows (Fernando 2005): as soft as the light is large and the caster far.
        Pcss = "pcss",
        /// The map is blurred in two passes.
        Gaussian = "gaussian",
        /// The map has mipmaps and is sampled anisotropically: distant shadows do not sparkle.
        Mip = "mip",
        /// Both: blurred, then mipmapped.
        GaussianMip = "gaussian-mip",
    }
}

impl Filter {
    /// Whether the map is blurred.
    pub fn blurs(self) -> bool {
        matches!(self, Self::Gaussian | Self::GaussianMip)
    }

    /// Whether the map has mipmaps.
    pub fn mips(self) -> bool {
        matches!(self, Self::Mip | Self::GaussianMip)
    }
}

choice! {
    /// Texels across the percentage-closer kernel.
    pub enum PcfKernel {
        /// Bilinear 2×2: 1 tap.
        Two = "2",
        /// 3×3: 4 taps.
        Three = "3",
        /// 4×4: 4 taps.
        Four = "4",
        /// 5×5: 9 taps.
        Five = "5",
        /// 7×7: 16 taps.
        Seven = "7",
        /// Sixteen taps on a disc of `shadow.filter_radius`, turned at every pixel.
        Disc = "disc",
    }
}

impl PcfKernel {
    /// Texels across; 0 for a disc.
    pub fn texels(self) -> u32 {
        match self {
            Self::Two => 2,
            Self::Three => 3,
            Self::Four => 4,
            Self::Five => 5,
            Self::Seven => 7,
            Self::Disc => 0,
        }
    }
}

choice! {
    /// What cascades are fitted to.
    pub enum Fit {
        /// Slices of the camera's view as far as the scene reaches: edges rest while the camera moves.
        Frustum = "frustum",
        /// The depths in the picture, reduced on the GPU (Lauritzen, Salvi & Lefohn 2011, sample distribution shadow maps):
        /// finer maps, which change with what is in the picture.
        Depth = "depth",
    }
}

choice! {
    /// Which cascade a point is looked up in.
    pub enum CascadeSelect {
        /// The finest whose map holds the point.
        Projection = "projection",
        /// The one of the point's distance along the view.
        Depth = "depth",
    }
}

/// Standard deviation of the Gaussian blur in texels; `None` = binomial weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma(pub Option<f32>);

impl crate::settings::Value for Sigma {
    type Range = std::ops::RangeInclusive<f32>;
    fn parse(text: &str, range: &Self::Range) -> Result<Self, String> {
        if text == "binomial" {
            return Ok(Self(None));
        }
        let value = text.parse::<f32>().ok().filter(|value| range.contains(value));
        value
            .map(|value| Self(Some(value)))
            .ok_or_else(|| format!("binomial, or a number in {}..{}", range.start(), range.end()))
    }
    fn show(&self) -> String {
        self.0.map_or_else(|| "binomial".into(), |value| value.to_string())
    }
    fn kind(range: &Self::Range) -> crate::settings::Kind {
        crate::settings::Kind::WordOrNumber("binomial", *range.start(), *range.end())
    }
}

choice! {
    /// What shadows darken.
    pub enum Darkens {
        /// A light's direct light alone, by visibility stretched to shadow.floor..1; physical where that is 0.
        Direct = "direct",
        /// The whole colour, ambient light included, by visibility stretched to shadow.floor..1.
        Color = "color",
        /// The whole colour, by visibility clamped to shadow.floor..1.
        ColorClamped = "color-clamped",
        /// As the shadow thesis: depth maps darken direct light, down to nothing; exponential ones are color-clamped,
        /// without bleed reduction; all others color.
        Thesis = "thesis",
    }
}

impl Darkens {
    /// What it comes to for a representation.
    fn resolved(self, representation: Representation) -> Self {
        match (self, representation) {
            (Self::Thesis, Representation::Depth) => Self::Direct,
            (Self::Thesis, Representation::Exponential) => Self::ColorClamped,
            (Self::Thesis, _) => Self::Color,
            (other, _) => other,
        }
    }
}

/// Most cascades.
const MAX_CASCADES: usize = 8;
/// A slice that would be empty is as long as this share of its distance.
const LEAST_SLICE: f32 = 1e-3;

/// Distances along the view at which cascades end, metres, ascending; none: by `shadow.split_lambda`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splits(pub Vec<f32>);

impl Splits {
    /// From where to where cascade `i` reaches, of a view that shows something from `begin` to `end`; `None` where no
    /// distances are given. A cascade without a distance of its own reaches to the end.
    pub fn slice(&self, i: u32, (begin, end): (f32, f32)) -> Option<(f32, f32)> {
        if self.0.is_empty() {
            return None;
        }
        let ends = |i: usize| self.0.get(i).copied().unwrap_or(end);
        let i = i as usize;
        // What is seen may begin beyond the first distances, or end before the last.
        let near = if i == 0 { begin } else { ends(i - 1).max(begin) };
        Some((near, ends(i).max(near * (1.0 + LEAST_SLICE)).max(f32::MIN_POSITIVE)))
    }

    fn fits(&self, cascades: u32) -> bool {
        let cascades = cascades as usize;
        self.0.is_empty() || (cascades - 1..=cascades).contains(&self.0.len())
    }
}

impl crate::settings::Value for Splits {
    type Range = ();
    fn parse(text: &str, (): &()) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::default());
        }
        let distance = |part: &str| part.trim().parse::<f32>().ok().filter(|m| m.is_finite() && *m > 0.0);
        let distances: Option<Vec<_>> = text.split(',').map(distance).collect();
        let right = |list: &Vec<f32>| list.len() <= MAX_CASCADES && list.is_sorted_by(|a, b| a < b);
        distances.filter(right).map(Self).ok_or_else(|| {
            format!("auto, or up to {MAX_CASCADES} distances in metres, each larger than the one before, such as 5,20,60")
        })
    }
    fn show(&self) -> String {
        if self.0.is_empty() {
            return "auto".into();
        }
        self.0.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
    }
    fn kind((): &()) -> crate::settings::Kind {
        crate::settings::Kind::WordOrList("auto", MAX_CASCADES)
    }
}

settings! {
    /// Shadows.
    pub struct ShadowSettings: "shadow" {
        /// Maps of suns: cascades, or one map; spots have one map, points what shadow.point_layout says. Or rays through the
        /// scene's triangles to every light instead of maps; or no shadows of any light at all.
        layout: Layout = Layout::Cascaded, "", (), Permutation;
        /// Maps of point lights.
        point_layout: PointLayout = PointLayout::Cube, "", (), Permutation, only "shadow.layout=single|cascaded";
        /// What maps hold: depth, or moments of depth that can be blurred and mipmapped.
        representation: Representation = Representation::Depth, "", (), Permutation, only "shadow.layout=single|cascaded";
        /// How a map is filtered. Depth takes none, pcf and pcss; all others none, gaussian, mip and gaussian-mip.
        filter: Filter = Filter::Pcf, "", (), Permutation, only "shadow.layout=single|cascaded";
        /// Side of each shadow map. More sharpens shadows and costs 4 bytes a texel (and 4 a channel of moments) and raster
        /// time.
        resolution: u32 = 2048, "texels", 16..=8192, Resources, only "shadow.layout=single|cascaded";
        /// Maps of a sun. More sharpens near shadows and costs a map each.
        cascades: u32 = 4, "maps", 1..=8, Resources, only "shadow.layout=cascaded";
        /// Where cascades part: 0 evenly along the view, 1 by equal ratios of distance (Zhang et al. 2006, eq. 5).
        split_lambda: f32 = 0.75, "", 0.0..=1.0, Uniform, only "shadow.layout=cascaded and shadow.splits=auto";
        /// Where cascades part, by hand instead of by shadow.split_lambda: distances along the view at which they end. One
        /// fewer than cascades: the last reaches as far as the scene; as many: beyond the last nothing is in shadow.
        splits: Splits = Splits(Vec::new()), "m", (), Uniform, only "shadow.layout=cascaded";
        /// What cascades are fitted to: the camera's view, or what is in the picture.
        fit: Fit = Fit::Frustum, "", (), Permutation, only "shadow.layout=single|cascaded";
        /// Share of a cascade over which it fades into the next.
        blend: f32 = 0.1, "of a cascade", 0.0..=1.0, Uniform, only "shadow.layout=cascaded and shadow.cascades!=1";
        /// Which cascade a point is looked up in.
        cascade_select: CascadeSelect = CascadeSelect::Projection, "", (), Permutation,
            only "shadow.layout=cascaded and shadow.cascades!=1";
        /// Texels across the percentage-closer kernel. Wider is softer and costs taps.
        pcf_kernel: PcfKernel = PcfKernel::Three, "texels", (), Permutation, only "shadow.filter=pcf";
        /// Reach of the Gaussian blur and of the disc kernel, and what receivers of pcss are moved for where their plane is
        /// not followed. Wider is softer.
        filter_radius: f32 = 2.0, "texels", 0.0..=32.0, Uniform,
            only "shadow.filter=gaussian|gaussian-mip or shadow.pcf_kernel=disc or \
                  shadow.filter=pcss and shadow.bias.receiver_plane=false";
        /// Weights of the blur: binomial, or a Gaussian of this standard deviation in texels.
        sigma: Sigma = Sigma(None), "texels", 0.1..=32.0, Uniform, only "shadow.filter=gaussian|gaussian-mip";
        /// How large lights are, for pcss and for several rays: across a sun in radians (ours is 0.0093), across other
        /// lights in metres.
        light_size: f32 = 0.02, "rad or m", 0.0..=10.0, Uniform,
            only "shadow.filter=pcss or shadow.layout=traced and shadow.rays!=1";
        /// Rays from a place to each light: 1 goes to its middle and finds hard shadows, more are spread over
        /// shadow.light_size. Each costs a ray a pixel and light.
        rays: u32 = 1, "rays", 1..=64, Uniform, only "shadow.layout=traced";
        /// Steepness c of the exponential map's e^(c·depth). Steeper leaks less; 32-bit floats end at 88.
        exponent: f32 = 80.0, "", 1.0..=85.0, Uniform, only "shadow.representation=exponential";
        /// Steepness of the positive warp of evsm2 and evsm4.
        evsm_positive: f32 = 40.0, "", 1.0..=42.0, Uniform, only "shadow.representation=evsm2|evsm4";
        /// Steepness of the negative warp of evsm4.
        evsm_negative: f32 = 20.0, "", 1.0..=42.0, Uniform, only "shadow.representation=evsm4";
        /// Whether the exponential map is averaged over 2×2 texels as it is made.
        prefilter: bool = false, "", (), Uniform, only "shadow.representation=exponential";
        /// Visibility of moment maps below this is dark, and the rest stretched: cuts light that bleeds through.
        bleed_reduction: f32 = 0.2, "", 0.0..=0.99, Uniform,
            only "shadow.representation=variance|evsm2|evsm4|moments or \
                  shadow.representation=exponential and shadow.darkens!=thesis";
        /// Least variance that variance maps are taken to have: a receiver closer behind its caster than its root is lit in
        /// part. More hides acne and dark seams, and lights what lies at the feet of casters.
        min_variance: f32 = 0.0, "of the depth range squared", 0.0..=0.01, Uniform,
            only "shadow.representation=variance";
        /// Most samples along a slanted pixel footprint in a mipmapped map.
        anisotropy: u32 = 8, "samples", 1..=16, Uniform, only "shadow.filter=mip|gaussian-mip";
        /// Whether glass tints the light it lets through instead of casting a full shadow: an approximation without
        /// refraction, for scenes without caustics.
        transmission_tint: bool = false, "", (), Permutation, only "shadow.layout!=none";
        /// What shadows darken, and how shadow.floor bounds it: direct light, as is physical, or the whole colour.
        darkens: Darkens = Darkens::Direct, "", (), Permutation, only "shadow.layout!=none";
        /// Light that reaches what lies in shadow, as a share: 0 is physical.
        floor: f32 = 0.0, "", 0.0..=1.0, Uniform, only "shadow.representation!=depth or shadow.darkens!=thesis";
        /// All maps together, and what they are made with, take at most this much; beyond it the resolution is halved, and said.
        memory_budget: u32 = 1024, "MiB", 1..=65536, Resources, only "shadow.layout=single|cascaded";
        /// Whether maps whose light, camera and casters rest are kept from frame to frame. Off renders all of them every
        /// frame, as for lights that move.
        cache: bool = true, "", (), Uniform, only "shadow.layout=single|cascaded";
        /// Whether every texel is compared with the receiver's plane at that texel: a plane then needs no other bias, at
        /// the cost of comparing in the shader. Without it the hardware compares, all texels with one depth.
        bias_receiver_plane as "bias.receiver_plane": bool = true, "", (), Permutation,
            only "shadow.representation=depth";
        /// Receiver offset along its normal, as a share of what the comparison needs (a quarter texel along the
        /// receiver's plane, else the filter's reach): 1 is enough.
        /// More hides acne on curved surfaces and lets thin shadows shrink.
        bias_normal_offset as "bias.normal_offset": f32 = 1.0, "of what is needed", 0.0..=8.0, Uniform,
            only "shadow.layout=single|cascaded";
        /// Receiver offset towards the light that grows with tan θ, as a share of what a plane needs.
        bias_slope as "bias.slope": f32 = 0.0, "of what is needed", 0.0..=8.0, Uniform, only "shadow.layout=single|cascaded";
        /// Receiver offset towards the light, in texels of the map at the receiver.
        bias_constant as "bias.constant": f32 = 0.25, "texels", 0.0..=64.0, Uniform, only "shadow.layout=single|cascaded";
        /// What rasters the maps: the hardware, or compute on GPUs that have little raster hardware. Paraboloids and tinted
        /// light take the hardware all the same.
        raster: Raster = Raster::Auto, "", (), Permutation,
            only "shadow.point_layout=cube and shadow.transmission_tint=false";
        /// Whether only back faces cast: no acne on closed objects, but light leaks at their feet.
        bias_cull_front as "bias.cull_front": bool = false, "", (), Permutation, only "shadow.layout=single|cascaded";
    }
}

impl ShadowSettings {
    /// Whether the maps are rastered in compute, and hold plain numbers.
    pub fn computes_maps(&self) -> bool {
        let curved = self.point_layout == PointLayout::Paraboloid;
        self.raster == Raster::Compute && !curved && !self.transmission_tint
    }

    /// What shadows darken, with the representation considered.
    pub fn darkened(&self) -> Darkens {
        self.darkens.resolved(self.representation)
    }

    /// Why these settings do not go together, if they do not.
    pub fn refused(&self) -> Option<String> {
        if matches!(self.layout, Layout::None | Layout::Traced) {
            return None;
        }
        let pair = (self.representation, self.filter);
        let (key, value) = ("shadow.filter", crate::settings::Value::show(&self.filter));
        let representation = crate::settings::Value::show(&self.representation);
        refused_pair(pair)
            .map(|reason| format!("{key} = {value} does not go with shadow.representation = {representation}: {reason}"))
            .or_else(|| {
                (self.transmission_tint && self.point_layout == PointLayout::Paraboloid).then(|| {
                    "shadow.transmission_tint does not go with shadow.point_layout = paraboloid: take cube".into()
                })
            })
            .or_else(|| {
                (self.layout == Layout::Cascaded && !self.splits.fits(self.cascades)).then(|| {
                    format!(
                        "shadow.splits has {} distances, which do not part shadow.cascades = {}: give one fewer than \
                         cascades, or as many",
                        self.splits.0.len(),
                        self.cascades
                    )
                })
            })
            .or_else(|| {
                (self.fit == Fit::Depth && self.layout == Layout::Cascaded && !self.splits.0.is_empty()).then(|| {
                    "shadow.splits does not go with shadow.fit = depth, which parts cascades by what is in the picture: \
                     take shadow.fit = frustum"
                        .into()
                })
            })
            .or_else(|| {
                (self.fit == Fit::Depth && self.layout == Layout::Single).then(|| {
                    "shadow.fit = depth does not go with shadow.layout = single: take shadow.layout = cascaded with \
                     shadow.cascades = 1"
                        .into()
                })
            })
    }
}

/// The table of representations and filters: why a pair is refused, or nothing.
fn refused_pair((representation, filter): (Representation, Filter)) -> Option<&'static str> {
    match (representation == Representation::Depth, filter) {
        (_, Filter::None)
        | (true, Filter::Pcf | Filter::Pcss)
        | (false, Filter::Gaussian | Filter::Mip | Filter::GaussianMip) => None,
        (false, Filter::Pcf) => {
            Some("comparisons are averaged for depth; maps of moments take gaussian, mip or gaussian-mip")
        }
        (false, Filter::Pcss) => {
            Some("the search for blockers needs their depths; take shadow.representation = depth")
        }
        (true, Filter::Gaussian | Filter::Mip | Filter::GaussianMip) => Some(
            "an average of depths is no depth of anything; take pcf or pcss, or a representation of moments \
             (variance, exponential, evsm2, evsm4, moments)",
        ),
    }
}
