//! Settings of surfaces and anti-aliasing.

use crate::{choice, settings};

choice! {
    /// Which reflection model lights surfaces.
    pub enum Lighting {
        /// Materials as they are written: GGX for metallic-roughness, Phong for OBJ's.
        Pbr = "pbr",
        /// Everything as Lambert plus a normalised Phong lobe of equal width.
        Phong = "phong",
        /// Everything as Lambert with its base colour.
        Lambert = "lambert",
    }
}

choice! {
    /// Samples per pixel.
    pub enum Msaa {
        /// No multisampling.
        One = "1",
        /// Where the adapter has it.
        Two = "2",
        /// On every adapter.
        Four = "4",
        /// Where the adapter has it.
        Eight = "8",
    }
}

choice! {
    /// What rasters triangles.
    pub enum Raster {
        /// Compute on the data-centre GPUs that have little raster hardware, the hardware on all others.
        Auto = "auto",
        /// The hardware.
        Hardware = "hardware",
        /// Compute.
        Compute = "compute",
    }
}

impl Msaa {
    /// How many.
    pub fn samples(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
            Self::Eight => 8,
        }
    }
}

settings! {
    /// Surfaces.
    pub struct SurfaceSettings: "surface" {
        /// Reflection model of all surfaces: pbr keeps materials as written, phong and lambert replace them.
        lighting: Lighting = Lighting::Pbr, "", (), Uniform;
        /// Samples per pixel. More smooths edges and costs memory and bandwidth; every adapter has 1 and 4.
        msaa: Msaa = Msaa::Four, "samples", (), Permutation,
            only "pipeline=forward";
        /// See-through surfaces one behind the other that a pixel can show; the nearest count. More shows deeper stacks
        /// of glass, and each costs 8 bytes a pixel and about six passes.
        layers: u32 = 4, "layers", 1..=8, Resources;
        /// Whether normal maps bend shading normals.
        normal_maps: bool = true, "", (), Uniform;
        /// Texels averaged along the longer side of a slanted footprint. More keeps slanted textures sharp and
        /// costs texture bandwidth.
        anisotropy: u32 = 16, "samples", 1..=16, Uniform;
        /// What rasters the camera's view of opaque surfaces, where there is a visibility buffer: the hardware, or compute on
        /// GPUs that have little raster hardware. Layers of see-through surfaces and the forward pipeline's shading take
        /// the hardware all the same.
        raster: Raster = Raster::Auto, "", (), Permutation;
    }
}
