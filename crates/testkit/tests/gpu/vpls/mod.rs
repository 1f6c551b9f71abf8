//! Reflective shadow maps, and the virtual lights that are placed in them, against formulas and twins on the CPU.

mod choosing;
mod edges;
mod flux;
mod functions;
mod places;
mod resting;

use bytemuck::{Pod, Zeroable};
use chiaro::{LoadedScene, Settings, StillOptions};
use chiaro_techniques::indirect::Vpl;
use chiaro_techniques::indirect::rsm::RsmViewData;
use chiaro_testkit::{Studio, camera_above, direct};

const TILE_TEXELS: usize = 64;

/// Twin of `VplSampling` in `sampling.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Sampling {
    tiles: u32,
    views: u32,
    candidates: u32,
    vpls: u32,
    round: u32,
    first_block: u32,
    mode: u32,
    by_view: u32,
    turn: [f32; 2],
    fresh: f32,
    stride: u32,
    keeps_all: u32,
    seed: u32,
    drift: u32,
    reserved: u32,
}

/// Settings with virtual lights that shine through everything, and some changed.
fn settings(changes: &[(&str, &str)]) -> Settings {
    let few = [
        ("indirect.technique", "rsm"),
        ("indirect.vpls", "256"),
        ("indirect.rsm_resolution", "128"),
        ("shadow.resolution", "512"),
    ];
    direct(&[&few, changes].concat())
}

/// What a frame leaves behind.
struct Placed {
    views: Vec<RsmViewData>,
    rsm: Vec<u32>,
    candidates: Vec<Vpl>,
    vpls: Vec<Vpl>,
}

impl Placed {
    fn new(studio: &mut Studio, scene: &LoadedScene) -> Self {
        let names = ["rsm_views", "rsm", "vpl_candidates", "vpls", "vpl_count"];
        let left = names.map(|name| format!("indirect/{name}")).to_vec();
        let options = StillOptions { size: [16, 16], samples: 1, left, ..StillOptions::default() };
        let still = studio.renderer().still(scene, &camera_above(2.0), &options).unwrap();
        let gpu = studio.renderer().gpu().clone();
        let bytes = still.left.into_iter().map(|left| match left.content {
            chiaro::Left::Buffer(buffer) => buffer.wait(&gpu).unwrap(),
            _ => panic!("{} is no buffer", left.name),
        });
        let Ok([views, rsm, candidates, vpls, count]) = <[Vec<u8>; 5]>::try_from(bytes.collect::<Vec<_>>())
        else {
            panic!("not all came back")
        };
        let count: Vec<u32> = bytemuck::pod_collect_to_vec(&count);
        let mut vpls: Vec<Vpl> = bytemuck::pod_collect_to_vec(&vpls);
        assert!(count[0] as usize <= vpls.len());
        vpls.truncate(count[0] as usize);
        Self {
            views: bytemuck::pod_collect_to_vec(&views),
            rsm: bytemuck::pod_collect_to_vec(&rsm),
            candidates: bytemuck::pod_collect_to_vec(&candidates),
            vpls,
        }
    }

    fn tiles(&self) -> usize {
        self.views[0].tiles as usize
    }

    /// The flux of every texel of the maps, lumens.
    fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.rsm[self.tiles()..].chunks_exact(4).map(|texel| f64::from(f32::from_bits(texel[3])))
    }

    /// Of all maps, lumens.
    fn total(&self) -> f64 {
        self.weights().sum()
    }
}

fn luminance(vpl: &Vpl) -> f64 {
    let [r, g, b] = vpl.flux.map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
