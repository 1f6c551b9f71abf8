//! Settings of shadow maps.

use crate::{choice, settings};

choice! {
    /// Which shadow maps lights have.
    pub enum Layout {
        /// One map per sun and per spot light.
        Single = "single",
        /// No shadows.
        None = "none",
    }
}

choice! {
    /// How the map is compared.
    pub enum Filter {
        /// Percentage-closer filtering (Reeves, Salesin & Cook 1987) with hardware comparison.
        Pcf = "pcf",
        /// One unfiltered test.
        None = "none",
    }
}

choice! {
    /// Texels across the percentage-closer kernel.
    pub enum PcfKernel {
        /// The hardware's bilinear 2×2: 1 tap.
        Two = "2",
        /// 3×3: 4 taps.
        Three = "3",
        /// 4×4: 4 taps.
        Four = "4",
        /// 5×5: 9 taps.
        Five = "5",
        /// 7×7: 16 taps.
        Seven = "7",
    }
}

impl PcfKernel {
    /// Texels.
    pub fn texels(self) -> u32 {
        match self {
            Self::Two => 2,
            Self::Three => 3,
            Self::Four => 4,
            Self::Five => 5,
            Self::Seven => 7,
        }
    }
}

settings! {
    /// Shadows.
    pub struct ShadowSettings: "shadow" {
        /// Maps of suns and spots; none lights everything.
        layout: Layout = Layout::Single, "", (), Resources;
        /// Side of each shadow map. More sharpens shadows and costs 4 bytes a texel and raster time.
        resolution: u32 = 2048, "texels", 16..=8192, Resources;
        /// How a map is compared: none shows texels, pcf averages comparisons.
        filter: Filter = Filter::Pcf, "", (), Permutation;
        /// Texels across the percentage-closer kernel. Wider is softer and costs taps.
        pcf_kernel: PcfKernel = PcfKernel::Three, "texels", (), Permutation;
        /// All maps together take at most this much; beyond it the resolution is halved, and said.
        memory_budget: u32 = 512, "MiB", 1..=65536, Resources;
        /// Whether maps whose light, camera and casters rest are kept from frame to frame. Off renders all of them every
        /// frame, as for lights that move.
        cache: bool = true, "", (), Uniform;
        /// Whether every texel is compared with the receiver's plane at that texel: a plane then needs no other bias, at
        /// the cost of comparing in the shader. Without it the hardware compares, all texels with one depth.
        bias_receiver_plane as "bias.receiver_plane": bool = true, "", (), Permutation;
        /// Receiver offset along its normal, as a share of what the comparison needs (a quarter texel along the
        /// receiver's plane, else the filter's reach): 1 is enough.
        /// More hides acne on curved surfaces and lets thin shadows shrink.
        bias_normal_offset as "bias.normal_offset": f32 = 1.0, "of what is needed", 0.0..=8.0, Uniform;
        /// Receiver offset towards the light that grows with tan θ, as a share of what a plane needs.
        bias_slope as "bias.slope": f32 = 0.0, "of what is needed", 0.0..=8.0, Uniform;
        /// Receiver offset towards the light, in texels of the map at the receiver.
        bias_constant as "bias.constant": f32 = 0.25, "texels", 0.0..=64.0, Uniform;
        /// Whether only back faces cast: no acne on closed objects, but light leaks at their feet.
        bias_cull_front as "bias.cull_front": bool = false, "", (), Permutation;
    }
}
