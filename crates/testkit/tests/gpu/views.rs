//! Several views of scenes by one renderer.

use chiaro::techniques::post::{Accumulator, Sum};
use chiaro::{Error, Frame, LoadedScene, Readback, Recorder, Renderer, TexturePool, View, ViewState};
use chiaro_testkit::{device, direct};
use glam::{Vec2, Vec3};

use crate::motion::{moving, now_and_before};

const SIZE: [u32; 2] = [48, 32];
/// The last two frames show the same moment.
const TIMES_S: [f64; 4] = [0.0, 0.3, 0.8, 0.8];

fn cameras() -> [View; 2] {
    let target = Vec3::new(0.0, 2.0, 0.0);
    [Vec3::new(1.0, 3.0, 7.0), Vec3::new(-6.0, 2.0, 2.0)].map(|eye| View::look_at(eye, target, 0.9, 0.01))
}

/// What frames show of some views, and where everything is and was: all views in one frame.
fn frames(seen: &[View]) -> Vec<(Vec<Vec<f32>>, [Vec<u32>; 2])> {
    let gpu = device();
    let source = moving();
    let (renderer, mut loaded) =
        Renderer::with_scene(&gpu, direct(&[("shadow.resolution", "256")]), &source).unwrap();
    let mut states: Vec<_> = seen.iter().map(|_| ViewState::new(&renderer)).collect();
    let accumulator = Accumulator::new(&gpu, &renderer.kit().library).unwrap();
    let pool = TexturePool::default();
    let mut recorder = Recorder::new(&gpu, false);
    let picture = |frame: &mut Frame<'_>, state: &mut ViewState, loaded: &LoadedScene, view: &View| {
        let prepared = renderer.prepare(state, loaded, view, SIZE, (Vec2::ZERO, 1.0)).unwrap();
        let outputs = prepared.record(frame, false);
        let mut sum = Sum::new(&gpu, &pool, SIZE);
        accumulator.record(frame, &outputs.radiance, 1.0, &mut sum);
        sum
    };
    TIMES_S
        .map(|time_s| {
            loaded.set_pose(&source, &source.pose(time_s)).unwrap();
            let mut frame = recorder.begin();
            let views = seen.iter().zip(&mut states);
            let sums: Vec<_> = views.map(|(view, state)| picture(&mut frame, state, &loaded, view)).collect();
            frame.submit();
            let read = |sum: &Sum| Readback::start(&gpu, sum.texture()).unwrap().wait(&gpu).unwrap().floats();
            (sums.iter().map(read).collect(), now_and_before(&gpu, &loaded))
        })
        .to_vec()
}

#[test]
fn two_views_of_a_moving_scene_in_one_frame_are_as_each_alone() {
    let views = cameras();
    let both = frames(&views);
    let alone = [frames(&views[..1]), frames(&views[1..])];
    for (index, (pictures, places)) in both.iter().enumerate() {
        for (view, alone) in alone.iter().enumerate() {
            assert!(pictures[view].iter().sum::<f32>() > 0.0);
            assert!(pictures[view] == alone[index].0[0], "view {view} at {} s", TIMES_S[index]);
            assert!(*places == alone[index].1, "positions at {} s", TIMES_S[index]);
        }
    }
    let [now, before] = &both[2].1;
    assert!(now != before && both[3].1[0] == both[3].1[1]);
}

#[test]
fn pictures_of_no_or_too_many_pixels_are_refused() {
    let gpu = device();
    let (renderer, loaded) = Renderer::with_scene(&gpu, direct(&[]), &moving()).unwrap();
    let mut state = ViewState::new(&renderer);
    let most = gpu.limits.max_texture_dimension_2d;
    for size in [[0, 32], [32, 0], [most + 1, 32], [0, 0]] {
        let prepared = renderer.prepare(&mut state, &loaded, &cameras()[0], size, (Vec2::ZERO, 1.0));
        assert!(matches!(prepared, Err(Error::Size { .. })), "{size:?}");
    }
}
