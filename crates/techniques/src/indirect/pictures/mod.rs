//! What indirect light is made from, as pictures to look at; only where they are asked for.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | points, where there are any | points, surface buffer | `marks`: see `marks.wesl` | a lane a point |
//! | VPLs | [`Vpl`](super::Vpl)s and their number, sums of the maps, surface buffer | `marks`, once emptied | a lane a VPL |
//! | resolve, after each | `marks`, surface buffer | `point_picture`, `vpl_picture` | a lane a pixel |
//! | maps | `rsm` and its views, sums of the maps, lights | `rsm_picture` | a lane a texel |
//!
//! | output | format | what |
//! | --- | --- | --- |
//! | `point_picture` | Rgba16Float, linear, 0..1, of the picture's size | a pixel for every point that is seen, by its albedo |
//! | `vpl_picture` | the same | a disc for every VPL that is seen, by its flux |
//! | `rsm_picture` | Rgba16Float, linear, 0..1 | maps beside each other in the order of their lights, by flux per texel |
//!
//! Fluxes Φ are shown as Φ / (L(Φ) + m) by their luminance L and the mean m of all of their kind, so that what is like most
//! others is half as bright as white: of VPLs m is what all maps carry over how many VPLs there are, of texels over how many
//! texels there are, lit or not. Where nothing is marked, surfaces are grey, and the sky is black.
//!
//! # Limits
//! What lies up to 0.5 % of its distance behind a surface, or in the plane of one, counts as seen. Depth of marks has 8 bits
//! of mantissa: of two that are both seen, the farther may win. See-through surfaces hide nothing, and bear no marks. Of maps
//! whose picture would be wider than 4,096 texels every second, fourth, … texel is shown.
//!
//! # Cost
//! 16 bytes a point and 28 a pixel that is hit; 4 + 16 + 8 bytes a pixel twice; 16 + 8 bytes a texel. Room: 20 bytes a
//! pixel, 8 a texel.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Texture,
    TextureOptions, TexturePool, ViewHint,
};

use super::points::PointRoom;
use super::rsm::{RsmPlan, RsmRoom};
use super::vpls::VplRoom;
use crate::{Kit, Pass, shaders};

const POINTS: ViewHint =
    ViewHint::new("Points that imperfect shadow maps are drawn from, by their albedo", Mapping::Color);
const VPLS: ViewHint = ViewHint::new(
    "Virtual lights where they stand, by their flux: half as bright as white is the mean",
    Mapping::Color,
);
const MAPS: ViewHint = ViewHint::new(
    "Reflective shadow maps beside each other, by what flux a texel scatters on: half as bright as white is the mean",
    Mapping::Color,
);
const MARKS: ViewHint = ViewHint::new("Marks over the picture: depth and colour", Mapping::Number);

/// Twin of `ROW` in `points.cs.wesl`.
const ROW: u32 = 32_768;
/// Threads of a workgroup there.
const GROUP: u32 = 64;
/// Texels a side at most of the maps' picture.
const MOST_TEXELS: u32 = 4096;
/// A disc's radius as a share of the picture's height, and pixels at least.
const RADIUS_SHARE: f32 = 1.0 / 120.0;
const LEAST_RADIUS: f32 = 3.0;

/// What the passes know; `marks.wesl` holds its twin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct PictureData {
    pub(crate) points: u32,
    pub(crate) tiles: u32,
    pub(crate) views: u32,
    pub(crate) columns: u32,
    pub(crate) cell: u32,
    pub(crate) step: u32,
    pub(crate) radius_px: f32,
    pub(crate) reserved: u32,
}

/// Cells of maps beside each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cells {
    columns: u32,
    rows: u32,
    side: u32,
    step: u32,
}

impl Cells {
    /// As square as can be; `side`: of the largest map.
    fn new(views: u32, side: u32, most: u32) -> Self {
        let columns = (1..=views).find(|columns| columns * columns >= views).unwrap_or(1);
        let mut step = 1;
        while columns * side.div_ceil(step) > most && step < side {
            step *= 2;
        }
        Self { columns, rows: views.div_ceil(columns).max(1), side: side.div_ceil(step).max(1), step }
    }
}

/// What the pictures are drawn into.
#[derive(Debug)]
pub struct PictureRoom {
    points: Option<Texture>,
    vpls: Texture,
    maps: Texture,
    marks: Buffer,
    uniform: Buffer,
    size_px: [u32; 2],
    cells: Cells,
}

/// What they show.
#[derive(Clone, Copy, Debug)]
pub struct PictureInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// Where the camera looks: depth and surface of the surface buffer.
    pub seen: (&'a Texture, &'a Texture),
    /// Reflective shadow maps.
    pub maps: (&'a RsmPlan, &'a RsmRoom),
    /// Virtual lights that were placed in them.
    pub vpls: &'a VplRoom,
    /// The point set, where there is one.
    pub points: Option<&'a PointRoom>,
}

/// The passes.
#[derive(Debug)]
pub struct Pictures {
    points: ComputePipeline,
    vpls: ComputePipeline,
    resolve: ComputePipeline,
    maps: ComputePipeline,
}

impl Pass for Pictures {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, .. } = kit;
        let make = |entry| ComputePipeline::new(gpu, library, &shaders::plain(entry), &[frame_layout], &[]);
        Ok(Self {
            points: make("indirect/pictures/points.cs.wesl")?,
            vpls: make("indirect/pictures/vpls.cs.wesl")?,
            resolve: make("indirect/pictures/resolve.cs.wesl")?,
            maps: make("indirect/pictures/rsm.cs.wesl")?,
        })
    }
}

impl Pictures {
    /// Room for pictures of a size, of a plan's maps, and of points or without: what is there if it serves. Not inside a
    /// frame.
    pub fn room(
        &self,
        (gpu, pool): (&Gpu, &TexturePool),
        size_px: [u32; 2],
        plan: &RsmPlan,
        points: bool,
        room: &mut Option<PictureRoom>,
    ) {
        let side = plan.views.iter().map(|view| view.data.side).max().unwrap_or(1);
        let most = gpu.limits.max_texture_dimension_2d.min(MOST_TEXELS);
        let cells = Cells::new(plan.views.len() as u32, side, most);
        let serves = |room: &PictureRoom| {
            room.size_px == size_px && room.cells == cells && room.points.is_some() == points
        };
        chiaro_gpu::keep(room, serves, || {
            let lend = |name, [width, height]: [u32; 2], hint| {
                let usage = TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING;
                let options = TextureOptions::new(width, height, TextureFormat::Rgba16Float, usage);
                pool.lend(gpu, name, Life::Frame, options).described(hint)
            };
            let copied = BufferUsages::COPY_DST;
            let words = 4 * u64::from(size_px[0]) * u64::from(size_px[1]);
            let uniform = size_of::<PictureData>() as u64;
            PictureRoom {
                points: points.then(|| lend("point_picture", size_px, POINTS)),
                vpls: lend("vpl_picture", size_px, VPLS),
                maps: lend("rsm_picture", [cells.columns * cells.side, cells.rows * cells.side], MAPS),
                marks: Buffer::new(gpu, "marks", Life::Frame, words, BufferUsages::STORAGE | copied)
                    .described(MARKS),
                uniform: Buffer::new(gpu, "pictures", Life::Frame, uniform, BufferUsages::UNIFORM | copied),
                size_px,
                cells,
            }
        });
    }

    /// Draws all; after what they show.
    pub fn record(&self, frame: &mut Frame<'_>, inputs: &PictureInputs<'_>, room: &PictureRoom) {
        let PictureInputs { group, seen: (depth, surface), maps: (plan, maps), vpls, points } = *inputs;
        let Cells { columns, side: cell, step, .. } = room.cells;
        let data = PictureData {
            points: points.map_or(0, |points| points.count),
            tiles: plan.tiles(),
            views: plan.views.len() as u32,
            columns,
            cell,
            step,
            radius_px: (RADIUS_SHARE * room.size_px[1] as f32).max(LEAST_RADIUS),
            reserved: 0,
        };
        frame.upload(&room.uniform, &[data]);
        let picture: Bind<'_> = ("picture", (&room.uniform).into());
        let (depth, surface) = (("depth", depth.into()), ("surface", surface.into()));
        let marks: Bind<'_> = ("marks", (&room.marks).into());
        let groups = &[group];
        let resolve = |frame: &mut Frame<'_>, name, to: &Texture| {
            let binds = [depth, surface, marks, ("marked", to.into())];
            let pixels = Dispatch::Threads([room.size_px[0], room.size_px[1], 1]);
            frame.compute(name, &self.resolve, groups, &binds, pixels);
        };
        if let (Some(points), Some(to)) = (points, &room.points) {
            frame.clear(&room.marks);
            if points.count > 0 {
                let binds = [picture, depth, surface, ("points", (&points.points).into()), marks];
                let rows = points.count.div_ceil(GROUP);
                let rows = Dispatch::Groups([rows.min(ROW), rows.div_ceil(ROW), 1]);
                frame.compute("indirect/point_marks", &self.points, groups, &binds, rows);
            }
            resolve(frame, "indirect/point_picture", to);
        }
        frame.clear(&room.marks);
        let sums: Bind<'_> = ("rsm_sums", vpls.sums().into());
        // Without maps there are no sums, and no lights.
        if data.views > 0 {
            let lights = [("vpls", (&vpls.vpls).into()), ("vpl_count", (&vpls.count).into())];
            let binds = [picture, depth, surface, lights[0], lights[1], sums, marks];
            let each = Dispatch::Threads([vpls.slots().all(), 1, 1]);
            frame.compute("indirect/vpl_marks", &self.vpls, groups, &binds, each);
        }
        resolve(frame, "indirect/vpl_picture", &room.vpls);
        let binds = [
            picture,
            ("rsm", (&maps.rsm).into()),
            sums,
            ("rsm_views", (&maps.views).into()),
            ("rsm_picture", (&room.maps).into()),
        ];
        let texels = [columns * cell, room.cells.rows * cell, 1];
        frame.compute("indirect/rsm_picture", &self.maps, groups, &binds, Dispatch::Threads(texels));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_lie_in_a_square_that_fits() {
        for (views, side, most) in
            [(1, 512, 4096), (6, 256, 4096), (63, 512, 4096), (12, 4096, 4096), (0, 1, 64)]
        {
            let cells = Cells::new(views, side, most);
            assert!(cells.columns * cells.rows >= views, "{cells:?}");
            assert!(cells.columns * cells.side <= most && cells.rows <= cells.columns, "{cells:?}");
            assert!(cells.side * cells.step >= side, "{cells:?}");
        }
        assert_eq!(Cells::new(6, 256, 4096), Cells { columns: 3, rows: 2, side: 256, step: 1 });
        assert_eq!(Cells::new(63, 512, 2048).step, 2);
    }
}
