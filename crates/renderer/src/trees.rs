//! Trees that a scene is given where settings shoot rays at it.

use chiaro_gpu::{BufferReadback, Gpu};
use chiaro_scene::{Id, Pose, Scene};
use chiaro_techniques::rays::{TraceData, TraceFacts, TraceScene, WORN};
use chiaro_techniques::scene::SceneFacts;

use crate::Error;

/// Poses between two looks at how worn trees are.
const LOOK_EVERY: u64 = 32;

/// Trees for rays through a scene: see [`crate::LoadedScene::give_trees`].
#[derive(Debug)]
pub struct Trees {
    gpu: Gpu,
    pub(crate) traced: TraceScene,
    // Of the scene that they were built for.
    shape: u64,
    // Nodes that are carried though no animation moves them.
    moved: Vec<Id>,
    worn: bool,
    // How large boxes have become, being read, and poses until they are read next.
    boxes: Option<BufferReadback>,
    until_look: u64,
}

impl Trees {
    /// Builds the trees of a scene as it stands in a pose: about 4 µs a triangle on one core; any thread may do it. What
    /// animations or `moved` move, and what is drawn several times, has a tree of its own.
    ///
    /// # Errors
    /// When the trees do not fit the adapter.
    pub fn build(gpu: &Gpu, scene: &Scene, pose: &Pose, moved: &[Id]) -> Result<Self, Error> {
        let traced = TraceData::build(scene, pose, moved).upload(gpu)?;
        let (gpu, moved) = (gpu.clone(), moved.to_vec());
        let shape = shape(scene);
        Ok(Self { gpu, traced, shape, moved, worn: false, boxes: None, until_look: LOOK_EVERY })
    }

    /// Refuses a scene that they were not built for.
    pub(crate) fn check(&self, scene: &Scene) -> Result<(), Error> {
        if self.shape == shape(scene) {
            return Ok(());
        }
        let problem = "they were built for meshes that the scene does not have".into();
        Err(Error::Foreign { what: "trees", problem })
    }

    /// Those of an uploaded scene, with what shaders that shoot rays at it have to know.
    #[must_use]
    pub fn facts(&self, scene: SceneFacts) -> SceneFacts {
        let TraceFacts { levels: tree_levels, masks: tree_masks } = self.traced.facts;
        SceneFacts { tree_levels, tree_masks, ..scene }
    }

    /// Takes a new pose. What can be moved no other way is built anew at once.
    pub(crate) fn update(&mut self, scene: &Scene, pose: &Pose) -> Result<(), Error> {
        if !self.traced.update(&self.gpu, scene, pose) {
            // The trees stay as many as pipelines were compiled for.
            *self = Self { worn: true, ..Self::build(&self.gpu, scene, pose, &self.moved)? };
        }
        self.until_look = self.until_look.saturating_sub(1);
        Ok(())
    }

    /// Whether others, built for the present pose, would be better: bending has worn these, or a node that stood still was
    /// moved. Never waits.
    pub(crate) fn due(&mut self) -> bool {
        if let Some(boxes) = &self.boxes {
            match boxes.poll(&self.gpu) {
                Ok(None) => {}
                Ok(Some(boxes)) => {
                    self.worn |= self.traced.wear(&boxes) > WORN;
                    self.boxes = None;
                }
                Err(_) => self.boxes = None,
            }
        } else if self.until_look == 0 {
            self.until_look = LOOK_EVERY;
            self.boxes = self.traced.read_boxes(&self.gpu);
        }
        self.worn
    }
}

/// A hash of what trees are built of: which node draws which triangles of which material. A word at a time, so that it takes
/// about a hundredth of the time that building does.
fn shape(scene: &Scene) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |word: u64| hash = (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    for node in &scene.nodes {
        add(node.mesh.map_or(0, |mesh| mesh as u64 + 1));
    }
    for (number, primitive) in
        (0..).zip(&scene.meshes).flat_map(|(number, mesh)| mesh.primitives.iter().map(move |p| (number, p)))
    {
        add(number);
        add(primitive.material as u64);
        add(primitive.positions.len() as u64);
        add(primitive.indices.len() as u64);
        for position in &primitive.positions {
            position.to_array().into_iter().for_each(|x| add(x.to_bits().into()));
        }
        primitive.indices.iter().for_each(|&index| add(index.into()));
    }
    hash
}
