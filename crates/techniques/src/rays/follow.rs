//! The passes that let trees of bending meshes follow their vertices: node by node from the leaves up, on the GPU.

use chiaro_gpu::{ComputePipeline, Dispatch, Frame, GpuError};

use super::trace::TraceScene;
use crate::scene::SceneGpu;
use crate::{Kit, Pass, shaders};

/// The passes that let trees follow.
#[derive(Debug)]
pub struct Refit {
    corners: ComputePipeline,
    level: ComputePipeline,
}

impl Pass for Refit {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &[], &[]);
        Ok(Self { corners: make("rays/corners.cs.wesl")?, level: make("rays/refit.cs.wesl")? })
    }
}

impl Refit {
    /// Refits the trees of bending meshes to where motion has put their vertices earlier in the frame, if
    /// [`TraceScene::update`] or an upload asked for it.
    pub fn record(&self, frame: &mut Frame<'_>, scene: &SceneGpu, traced: &TraceScene) {
        let Some(bending) = traced.due() else { return };
        let binds = [
            ("triangles", (&bending.triangles).into()),
            ("geometry", (&scene.buffers.geometry).into()),
            ("clusters", (&scene.buffers.clusters).into()),
            ("tracer", (&traced.words).into()),
        ];
        let threads = Dispatch::Threads([bending.triangle_count, 1, 1]);
        frame.compute("rays/corners", &self.corners, &[], &binds, threads);
        for (jobs, count) in &bending.levels {
            let binds = [
                ("jobs", jobs.into()),
                ("tracer", (&traced.words).into()),
                ("boxes", (&bending.boxes).into()),
            ];
            frame.compute("rays/refit", &self.level, &[], &binds, Dispatch::Threads([*count, 1, 1]));
        }
    }
}
