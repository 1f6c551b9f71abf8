//! How much one file may expand to, and how far its numbers may go.

/// Coordinates and scales beyond this (metres) are refused: their squares would leave the range of `f32`.
pub(super) const MAX_COORDINATE: f32 = 1e12;

/// What a scene file may ask for at most. A few bytes can ask for any number of vertices (an accessor without data, a
/// mesh that a thousand nodes draw), so the sums are limited; a file that exceeds one is refused with its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Vertices of all meshes; 2²⁶ are about 5 GB.
    pub vertices: usize,
    /// Corners of all meshes' triangles.
    pub corners: usize,
    /// Vertices of all morph targets, a target without any counting as one.
    pub morph_vertices: usize,
    /// Nodes, every instance of EXT_mesh_gpu_instancing counted.
    pub nodes: usize,
    /// Vertices as drawn: those of its mesh and their morph targets, and joints, for every node.
    pub drawn_vertices: usize,
    /// Values of all animations' keys, morph weights counted one by one.
    pub keys: usize,
    /// Elements read from accessors, again for each of their uses.
    pub elements: usize,
    /// Elements read from accessors that have no data of their own.
    pub empty_elements: usize,
    /// Bytes of decompressed buffer views.
    pub decompressed: usize,
    /// Pixels of all images; 2²⁹ are 2 GiB.
    pub pixels: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            vertices: 1 << 26,
            corners: 1 << 28,
            morph_vertices: 1 << 26,
            nodes: 1 << 20,
            drawn_vertices: 1 << 31,
            keys: 1 << 25,
            elements: 1 << 30,
            empty_elements: 1 << 26,
            decompressed: 1 << 31,
            pixels: 1 << 29,
        }
    }
}

/// What of the limits is left.
#[derive(Clone, Debug)]
pub(super) struct Budget {
    limits: Limits,
    left: Limits,
}

impl Budget {
    pub(super) fn new(limits: &Limits) -> Self {
        Self { limits: limits.clone(), left: limits.clone() }
    }

    /// Takes `amount` of `what`, which `of` selects; the error says which limit that exceeds.
    pub(super) fn spend(
        &mut self,
        of: fn(&mut Limits) -> &mut usize,
        amount: usize,
        what: &str,
    ) -> Result<(), String> {
        let limit = *of(&mut self.limits);
        let left = of(&mut self.left);
        *left = left.checked_sub(amount).ok_or_else(|| format!("the file has more than {limit} {what}"))?;
        Ok(())
    }

    /// Takes one primitive's share.
    pub(super) fn spend_primitive(&mut self, vertices: usize, corners: usize) -> Result<(), String> {
        self.spend(|l| &mut l.vertices, vertices, "vertices; split the scene")?;
        self.spend(|l| &mut l.corners, corners, "triangle corners; split the scene")
    }
}
