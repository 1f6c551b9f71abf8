//! Settings of indirect light.

use crate::{choice, settings};

choice! {
    /// Where indirect light comes from.
    pub enum Technique {
        /// What is right on every adapter and in every scene: ism.
        Auto = "auto",
        /// A far environment as bright as the scene's lights would make a grey room of its size, brighter on the side
        /// that they shine at.
        Ambient = "ambient",
        /// Virtual point lights where lamps shine (Keller 1997; Dachsbacher & Stamminger 2005, reflective shadow maps), which
        /// shine through everything.
        Rsm = "rsm",
        /// The same with shadows from coarse maps of points (Ritschel et al. 2008, imperfect shadow maps).
        Ism = "ism",
        /// The same with shadows by rays, exact and dearer: what imperfect shadow maps are measured by.
        Traced = "traced",
        /// None: the light of lamps alone. Environment, sky and what glows are seen, straight and in what mirrors, but light
        /// nothing.
        None = "none",
    }
}

impl Technique {
    /// Whether the environment, the sky and glowing meshes are sources of light beside lamps.
    pub fn lights_by_all(self) -> bool {
        self != Self::None
    }

    /// With nothing left open.
    #[must_use]
    pub fn resolved(self) -> Self {
        if self == Self::Auto { Self::Ism } else { self }
    }

    /// Whether virtual point lights are made.
    pub fn makes_vpls(self) -> bool {
        matches!(self.resolved(), Self::Rsm | Self::Ism | Self::Traced)
    }

    /// Whether they have imperfect shadow maps.
    pub fn makes_ism(self) -> bool {
        self.resolved() == Self::Ism
    }
}

choice! {
    /// Where virtual lights are put.
    pub enum VplSampling {
        /// More where light brings the picture more, and of those what brings it nothing only by chance (Georgiev & Slusallek
        /// 2010): fewer than asked for where much is far away.
        View = "view",
        /// By flux alone: each carries as much as the others.
        Importance = "importance",
        /// Evenly over each light's map.
        Halton = "halton",
    }
}

choice! {
    /// Texels a side of an imperfect shadow map.
    pub enum IsmResolution {
        /// 64 KiB each.
        Side128 = "128",
        /// 4 KiB each.
        Side32 = "32",
        /// 16 KiB each.
        Side64 = "64",
        /// 256 KiB each.
        Side256 = "256",
    }
}

impl IsmResolution {
    /// How many.
    pub fn texels(self) -> u32 {
        match self {
            Self::Side32 => 32,
            Self::Side64 => 64,
            Self::Side128 => 128,
            Self::Side256 => 256,
        }
    }
}

choice! {
    /// What smooths interleaved light.
    pub enum IrradianceFilter {
        /// A mean over neighbours by how near they are to the pixel's plane and how alike their normals are.
        Edges = "edges",
        /// A mean over neighbours up to where depth or normals jump (Segovia et al. 2006, a discontinuity buffer found by
        /// Roberts' cross).
        Discontinuity = "discontinuity",
        /// Nothing: each pixel shows its own share of the virtual lights.
        None = "none",
    }
}

impl IndirectSettings {
    /// Bounces at most.
    pub const MOST_BOUNCES: u32 = 8;

    /// Bounces that are made: imperfect shadow maps alone know what virtual lights shine at.
    pub fn made_bounces(&self) -> u32 {
        if self.technique.makes_ism() { self.bounces.clamp(1, Self::MOST_BOUNCES) } else { 1 }
    }

    /// Virtual lights of the first bounce that shine: clusters of those that are placed, or these.
    pub fn lights(&self) -> u32 {
        if self.makes_clusters() { self.clusters } else { self.vpls }
    }

    /// Whether virtual lights are gathered in clusters, which are fewer.
    pub fn makes_clusters(&self) -> bool {
        self.technique.makes_vpls() && (1..self.vpls).contains(&self.clusters)
    }

    /// Texels a side of an imperfect shadow map: of clusters twice as many.
    pub fn ism_texels(&self) -> u32 {
        let side = self.ism_resolution.texels();
        if self.makes_clusters() { (2 * side).min(IsmResolution::Side256.texels()) } else { side }
    }

    /// Whether there are virtual lights on what shines itself.
    pub fn shines(&self) -> bool {
        self.technique.makes_vpls() && self.sources > 0
    }

    /// Whether virtual lights on what shines itself make others where they shine: imperfect shadow maps alone tell where.
    pub fn scatters(&self) -> bool {
        self.technique.makes_ism() && self.shines()
    }

    /// Whether frames of a moving picture average indirect light over time.
    pub fn accumulates(&self) -> bool {
        self.history > 0 && self.technique.makes_vpls()
    }

    /// Whether what bounding nearness takes is given back.
    pub fn compensates(&self) -> bool {
        self.compensate && self.clamp > 0.0 && self.technique.makes_vpls()
    }
}

settings! {
    /// Indirect light.
    pub struct IndirectSettings: "indirect" {
        /// Where indirect light comes from. With none environment, sky and glowing meshes light nothing either: they are seen
        /// as background and glow, and a stand-in for reflections shows the environment, or the sky's share that the eye
        /// sees, in metals and gloss.
        technique: Technique = Technique::Auto, "", (), Permutation;
        /// Virtual lights. More make light smoother and its shadows finer, and cost memory and time in proportion.
        vpls: u32 = 1024, "", 1..=65_535, Resources,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Clusters of virtual lights that shine in their place, where they are fewer; 0 makes none. Shadow maps and gathering then cost
        /// as for so many, and `indirect.vpls` may be several times as many at little cost; their maps have twice as many texels a
        /// side, up to 256. Fewer blur light and its shadows.
        clusters: u32 = 0, "", 0..=65_535, Resources,
            only "indirect.technique=auto|rsm|ism|traced";
        /// How much lights' places count for which cluster they are in, of the radius that a cluster has on average. More makes
        /// clusters rounder.
        cluster_position as "cluster.position": f32 = 1.0, "", 0.0..=64.0, Uniform,
            only "indirect.technique=auto|rsm|ism|traced and indirect.clusters!=0";
        /// How much their normals count. More keeps what looks elsewhere in other clusters.
        cluster_normal as "cluster.normal": f32 = 2.0, "", 0.0..=64.0, Uniform,
            only "indirect.technique=auto|rsm|ism|traced and indirect.clusters!=0";
        /// Bounces of light. The second has a quarter of the virtual lights, each further one half as many, and each draws shadow
        /// maps of its own: with two lights cost a quarter more, with many half as much again.
        bounces: u32 = 1, "", 1..=8, Permutation,
            only "indirect.technique=auto|ism";
        /// Virtual lights on what shines itself: glowing meshes, environment and sky, whose light is then shadowed; with ism there
        /// are a quarter of indirect.vpls more where they shine. More make such shadows finer and smoother. With 0 the
        /// surroundings' light is not shadowed, and glowing meshes light nothing.
        sources: u32 = 128, "", 0..=4096, Permutation,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Where virtual lights are put.
        sampling: VplSampling = VplSampling::View, "", (), Uniform,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Candidates for each virtual light that may be kept. More leave out less of those that are asked for, and find
        /// little better ones.
        candidates: u32 = 1, "", 1..=16, Resources,
            only "indirect.technique=auto|rsm|ism|traced and indirect.sampling=view";
        /// Texels a side of a light's reflective shadow map; those of a point light's six faces have half as many. More place
        /// virtual lights finer, and cost 16 bytes a texel.
        rsm_resolution: u32 = 512, "texels", 64..=2048, Resources,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Reflective shadow maps drawn a frame at most, when lights or things move; the others wait for their turn. More
        /// follow motion sooner.
        rsm_maps: u32 = 12, "", 1..=63, Uniform,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Whether reflective shadow maps are kept while nothing changes in them. Off measures what drawing them takes.
        rsm_cache: bool = true, "", (), Uniform,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Points of the scene that imperfect shadow maps draw from, each a block of its own as long as they last. More make
        /// errors of different virtual lights more independent, and cost 28 bytes each.
        points: u32 = 1_048_576, "", 1024..=8_388_608, Resources,
            only "indirect.technique=auto|ism";
        /// Points of the scene that are drawn into each shadow map. More make smaller discs, so that blockers keep
        /// their shape, and cost 16 bytes to read and a disc to draw each; with few, maps are blobs.
        points_per_vpl: u32 = 8000, "", 1..=8192, Uniform,
            only "indirect.technique=auto|ism";
        /// Radius that a point is drawn with, of the disc that it stands for. Less leaves more holes to pull-push, and is
        /// faster by its square.
        splat: f32 = 0.8, "radii", 0.0..=2.0, Uniform,
            only "indirect.technique=auto|ism";
        /// Texels a side of each virtual light's shadow map. More keeps smaller gaps and thinner blockers apart where there are
        /// points enough, and takes 4 bytes a texel (a third more with pull-push) and as much bandwidth; points are read once for
        /// every 64² texels.
        ism_resolution: IsmResolution = IsmResolution::Side128, "texels", (), Resources,
            only "indirect.technique=auto|ism";
        /// Whether shadows are blended from four texels.
        ism_closer: bool = false, "", (), Permutation,
            only "indirect.technique=auto|ism";
        /// Coarser levels from which holes between points are filled; 0 fills none, and more than the map has count as all. Each
        /// doubles the holes that are closed, and what is filled beyond a blocker's edge with them. The first costs most of the
        /// time that all do.
        levels as "pull_push.levels": u32 = 2, "levels", 0..=8, Resources,
            only "indirect.technique=auto|ism";
        /// How far behind the nearest of four texels another may be to count for the coarser level, relative to the nearest;
        /// doubles from level to level. More blends what is in front with what is behind, less leaves slanted surfaces with what is
        /// nearest.
        pull_threshold as "pull_push.pull_threshold": f32 = 0.1, "", 0.0..=10.0, Uniform,
            only "indirect.technique=auto|ism and indirect.pull_push.levels!=0";
        /// How far behind all of the coarser level around it a texel must be to be taken for a hole in what is in front, relative
        /// to that level; doubles from level to level, and 0 fills only texels without points. Less closes more such holes, and
        /// more of the gaps that there are.
        push_threshold as "pull_push.push_threshold": f32 = 0.2, "", 0.0..=10.0, Uniform,
            only "indirect.technique=auto|ism and indirect.pull_push.levels!=0";
        /// Side of the squares of pixels among which virtual lights are dealt out: of 4 each pixel is lit by a 16th of them. More
        /// is faster, and is blurred more.
        interleave: u32 = 4, "pixels", 1..=8, Permutation,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Radius at which a virtual light's nearness is bounded, in radii of the disc that it stands for. 0 bounds nothing:
        /// corners get bright spots. More darkens corners.
        clamp: f32 = 1.0, "radii", 0.0..=16.0, Uniform,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Whether what bounding nearness takes is given back by what the picture shows around each pixel (Novák et al. 2011):
        /// corners get their light without bright spots. What is out of the picture gives nothing back.
        compensate: bool = false, "", (), Permutation,
            only "indirect.technique=auto|rsm|ism|traced and indirect.clamp!=0";
        /// Whether frames leave `indirect/clamp_loss`, the share of light that bounding nearness takes.
        clamp_loss: bool = false, "", (), Permutation,
            only "indirect.technique=auto|rsm|ism|traced";
        /// Frames before that a moving picture's indirect light is averaged with at most, where they saw the same place. More are
        /// calmer, fewer follow changes of less than a quarter sooner; where lamps and things move fewer count by themselves. 0 shows
        /// each frame as it is. Stills average samples instead.
        history: u32 = 32, "frames", 0..=64, Permutation,
            only "indirect.technique=auto|rsm|ism|traced";
        /// What smooths interleaved light.
        filter: IrradianceFilter = IrradianceFilter::Edges, "", (), Permutation,
            only "indirect.technique=auto|rsm|ism|traced and indirect.interleave!=1";
        /// Width of the mean: neighbours that take part, across and down.
        filter_width: u32 = 5, "pixels", 3..=9, Uniform,
            only "indirect.filter=discontinuity";
        /// How far depth may jump from pixel to pixel within a surface, relative to it.
        discontinuity_depth as "discontinuity.depth": f32 = 0.02, "", 0.0..=1.0, Uniform,
            only "indirect.filter=discontinuity";
        /// How far the cosine between neighbouring normals may fall within a surface.
        discontinuity_normal as "discontinuity.normal": f32 = 0.2, "", 0.0..=2.0, Uniform,
            only "indirect.filter=discontinuity";
    }
}
