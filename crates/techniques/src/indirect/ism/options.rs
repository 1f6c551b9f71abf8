//! What imperfect shadow maps are made with.

/// Texels a side of an imperfect shadow map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IsmResolution {
    /// 4 KiB each.
    Side32,
    /// 16 KiB each.
    Side64,
    /// 64 KiB each.
    #[default]
    Side128,
    /// 256 KiB each.
    Side256,
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

/// How imperfect shadow maps are drawn and filled.
#[derive(Clone, Debug, PartialEq)]
pub struct IsmOptions {
    /// Texels a side of each virtual light's shadow map. More keeps smaller gaps and thinner blockers apart where there are
    /// points enough, and takes 4 bytes a texel (a third more with pull-push) and as much bandwidth; points are read once for
    /// every 64² texels.
    pub ism_resolution: IsmResolution,
    /// Points of the scene that are drawn into each shadow map, 1 to 8,192. More make smaller discs, so that blockers keep
    /// their shape, and cost 16 bytes to read and a disc to draw each; with few, maps are blobs.
    pub points_per_vpl: u32,
    /// Coarser levels from which holes between points are filled; 0 fills none, and more than the map has count as all. Each
    /// doubles the holes that are closed, and what is filled beyond a blocker's edge with them. The first costs most of the
    /// time that all do.
    pub levels: u32,
    /// How far behind the nearest of four texels another may be to count for the coarser level, relative to the nearest;
    /// doubles from level to level. More blends what is in front with what is behind, less leaves slanted surfaces with what is
    /// nearest.
    pub pull_threshold: f32,
    /// How far behind all of the coarser level around it a texel must be to be taken for a hole in what is in front, relative
    /// to that level; doubles from level to level, and 0 fills only texels without points. Less closes more such holes, and
    /// more of the gaps that there are.
    pub push_threshold: f32,
}

impl Default for IsmOptions {
    fn default() -> Self {
        Self {
            ism_resolution: IsmResolution::default(),
            points_per_vpl: 8000,
            levels: 2,
            pull_threshold: 0.1,
            push_threshold: 0.2,
        }
    }
}
