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
        Ok(Self { gpu, traced, moved, worn: false, boxes: None, until_look: LOOK_EVERY })
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
