//! The passes that carry out poses.

use std::sync::PoisonError;

use chiaro_gpu::{Binding, ComputePipeline, Dispatch, Frame, GpuError, parallel};

use super::{Carried, Done};
use crate::scene::SceneGpu;
use crate::{Kit, Pass, shaders};

/// Twin of `ROW` in `deform.cs.wesl`.
const ROW: u32 = 32_768;

/// The passes.
#[derive(Debug)]
pub struct Motion {
    instances: ComputePipeline,
    deform: ComputePipeline,
}

impl Pass for Motion {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &[], &[]);
        let (instances, deform) =
            parallel::join(|| make("scene/motion/instances.cs.wesl"), || make("scene/motion/deform.cs.wesl"));
        Ok(Self { instances: instances?, deform: deform? })
    }
}

impl Motion {
    /// Carries out the scene's pose if it is new, and in the frame after lets the previous pose catch up. However many views
    /// of the scene a frame renders, it moves once.
    pub fn record(&self, frame: &mut Frame<'_>, scene: &SceneGpu) {
        let motion = &scene.motion;
        let before = {
            let mut done = motion.done.lock().unwrap_or_else(PoisonError::into_inner);
            let rests = done.generation == motion.generation;
            if rests && (done.before == motion.generation || done.frame == frame.id()) {
                return;
            }
            let before = done.before;
            *done = Done { generation: motion.generation, before: done.generation, frame: frame.id() };
            before
        };
        // What moved now, and what moved the last time, whose place before is now where it is.
        let moved = |since: u64| since > before;
        let moves: Vec<_> = motion.carried.iter().filter(|c| moved(c.since)).map(Carried::data).collect();
        let buffers = &motion.buffers;
        if !moves.is_empty() {
            frame.upload(&buffers.moves, &moves);
            // There is room for all instances, of which as many move as the shader sees.
            let size = size_of_val(&moves[..]) as u64;
            let binds = [
                ("moves", Binding::BufferRange(&buffers.moves, 0, size)),
                ("instances", (&scene.buffers.instances).into()),
            ];
            let threads = Dispatch::Threads([moves.len() as u32, 1, 1]);
            frame.compute("motion/instances", &self.instances, &[], &binds, threads);
        }
        if motion.job_count > 0 && moved(motion.pose_since) {
            frame.upload(&buffers.pose, &motion.pose);
            let binds = [
                ("jobs", (&buffers.jobs).into()),
                ("rest", (&buffers.rest).into()),
                ("pose", (&buffers.pose).into()),
                ("geometry", (&scene.buffers.geometry).into()),
                ("clusters", (&scene.buffers.clusters).into()),
            ];
            let groups = [motion.job_count.min(ROW), motion.job_count.div_ceil(ROW), 1];
            frame.compute("motion/deform", &self.deform, &[], &binds, Dispatch::Groups(groups));
        }
    }
}
