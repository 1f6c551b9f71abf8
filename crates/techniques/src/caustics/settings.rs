//! Settings of caustics.

use crate::{choice, settings};

choice! {
    /// How caustics are made.
    pub enum Technique {
        /// What is known to be right and fast on every adapter and in every scene: none, so far.
        Auto = "auto",
        /// None.
        None = "none",
        /// Photons from the lamps, by rays through mirrors and glass, any number of interfaces: exact, and what other techniques
        /// are measured by.
        PhotonTrace = "photon_trace",
    }
}

impl Technique {
    /// Whether any are made; what is left to the adapter makes none.
    pub fn makes_any(self) -> bool {
        self == Self::PhotonTrace
    }
}

choice! {
    /// What smooths caustics.
    pub enum CausticFilter {
        /// Each pixel's photons spread as far as it takes to be enough of them, over the same surface: many stay where they are.
        Adaptive = "adaptive",
        /// Nothing: photons light the pixel that they land in.
        None = "none",
    }
}

settings! {
    /// Caustics.
    pub struct CausticsSettings: "caustics" {
        /// How caustics are made.
        technique: Technique = Technique::Auto, "", (), Permutation;
        /// Photons a frame, sent towards what mirrors or refracts; more make caustics less grainy and finer, and cost in proportion.
        /// Frames of a still have other photons each.
        photons: u32 = 1 << 22, "photons", 1024..=1 << 24, Uniform, only "caustics.technique=photon_trace";
        /// Mirrors and faces of glass that light may meet on its way; what meets more is lost. Clear balls take two, a knot eight, and
        /// light that glass reflects inside itself more: fewer cost less.
        interfaces: u32 = 32, "faces", 1..=255, Uniform, only "caustics.technique=photon_trace";
        /// Whether glass that disperses splits light into three bands, each bent by its own index: colours at the rims, and three
        /// times as few photons in each.
        dispersion: bool = true, "", (), Uniform, only "caustics.technique=photon_trace";
        /// What smooths them.
        filter: CausticFilter = CausticFilter::Adaptive, "", (), Uniform, only "caustics.technique=photon_trace";
        /// Photons that are enough: of fewer, the light of a pixel is spread over its neighbours. More is smoother and less sharp. Of a
        /// still's frames each spreads as if it shared them with the others.
        filter_photons: u32 = 24, "photons", 1..=256, Uniform, only "caustics.filter=adaptive";
        /// How far it may be spread.
        filter_width: u32 = 6, "px", 1..=8, Uniform, only "caustics.filter=adaptive";
    }
}
