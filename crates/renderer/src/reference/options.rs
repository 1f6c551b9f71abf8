//! What is traced.

/// Which paths make an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Paths from the camera: all light but that of lamps without extent over mirrors or through smooth glass.
    #[default]
    Path,
    /// Paths from the lights to surfaces that scatter and are seen directly; mirrors and smooth glass are black.
    Photon,
    /// Both, nothing twice: everything. Where nothing mirrors or refracts, the same as [`Integrator::Path`].
    Full,
}

/// What is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Which paths.
    pub integrator: Integrator,
    /// Most edges of a path: 1 shows what glows, 2 direct light, 3 one bounce; 0 = no limit.
    pub max_depth: u32,
    /// Most times that light is scattered from one surface to another; mirrors and smooth interfaces do not count.
    pub diffuse_bounces: u32,
    /// What random numbers start from.
    pub seed: u32,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { integrator: Integrator::Path, max_depth: 0, diffuse_bounces: u32::MAX, seed: 0 }
    }
}
