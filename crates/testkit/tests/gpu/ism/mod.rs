//! Imperfect shadow maps against twins on the CPU and against what is known of discs, rooms and walls.

mod bounces;
mod filling;
mod seeing;
mod splats;

use chiaro_techniques::indirect::{SETS, SOURCES};
use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::{Buffer, BufferReadback, Dispatch, Frame, Gpu, Readback, Recorder};
use chiaro_techniques::Pass;
use chiaro_techniques::indirect::ism::{Ism, IsmAtlas, IsmInputs, IsmPlan, IsmRoom};
use chiaro_techniques::indirect::{IndirectSettings, IsmResolution, Vpl};
use chiaro_testkit::Bench;
use glam::{Mat3, Vec2, Vec3};

pub(crate) const EMPTY: u32 = u32::MAX;
const NO_INDEX: u32 = 0x1fff;
/// Relative size of a step of depth.
const STEP: f32 = 1.0 / 2048.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) position: Vec3,
    pub(crate) normal: Vec3,
    /// Of its area, in powers of four.
    pub(crate) exponent: u32,
}

impl Point {
    fn words(&self) -> [u32; 4] {
        let n = self.normal;
        let mut e = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
        if n.z < 0.0 {
            e = Vec2::new((1.0 - e.y.abs()).copysign(e.x), (1.0 - e.x.abs()).copysign(e.y));
        }
        let snorm = |x: f32| u32::from((x * 127.0).round() as i8 as u8);
        let [x, y, z] = self.position.to_array().map(f32::to_bits);
        let bits = self.exponent;
        let [x, y, z] = [x & !1 | bits & 1, y & !1 | bits >> 1 & 1, z & !3 | bits >> 2];
        // Maps do not read albedos: another one for each wall of a room, in all channels.
        let wall =
            n.abs().max_position() as u32 * 2 + u32::from(n.max_element() > n.abs().max_element() - 1e-6);
        let albedo = (15 + 2 * wall) << 16 | (30 + 4 * wall) << 21 | (15 + 2 * wall) << 27;
        [x, y, z, snorm(e.x) | snorm(e.y) << 8 | albedo]
    }
}

/// A VPL's frame as `tangent_frame` makes it: columns.
fn frame(n: Vec3) -> Mat3 {
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    Mat3::from_cols(
        Vec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        Vec3::new(b, s + n.y * n.y * a, -n.y),
        n,
    )
}

pub(crate) fn settings(ism_resolution: IsmResolution, levels: u32) -> IndirectSettings {
    // Discs as large as they are.
    IndirectSettings { ism_resolution, levels, splat: 1.0, ..IndirectSettings::default() }
}

fn vpl(position: Vec3, normal: Vec3, subset: u32) -> Vpl {
    Vpl::new(position, normal, Vec3::ONE, subset)
}

/// A direction as the VPL at the origin that looks along z sees a place of its tile, in texels.
fn direction(resolution: u32, at: Vec2) -> Vec3 {
    let p = at / (0.5 * resolution as f32) - 1.0;
    let s = p.length_squared();
    (2.0 * p).extend(1.0 - s) / (1.0 + s)
}

fn depth_of(word: u32) -> Option<f32> {
    (word != EMPTY).then(|| f32::from_bits((word >> 13) << 12 | 0x800).min(1.0))
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Place {
    position_ws: Vec3,
    vpl: u32,
    normal_ws: Vec3,
    reserved: u32,
}

impl Place {
    /// A place, its normal, and the VPL that it is asked of.
    fn new(position_ws: Vec3, normal_ws: Vec3, vpl: u32) -> Self {
        Self { position_ws, vpl, normal_ws, reserved: 0 }
    }
}

/// The words that tell how many VPLs there are, all of one set.
fn counted(vpls: u32, set: u32) -> [[u32; 4]; SETS as usize] {
    let mut words = [[0; 4]; SETS as usize];
    words[set as usize] = [vpls, 1, 0, 1];
    words
}

/// VPLs and points, and the maps that were made of them.
pub(crate) struct Rig<'a> {
    gpu: &'a Gpu,
    pub(crate) bench: Bench,
    ism: Ism,
    settings: IndirectSettings,
    points: Buffer,
    pool: u32,
    pub(crate) vpls: Buffer,
    pub(crate) vpl_count: Buffer,
    area_m2: f32,
    largest_m: f32,
    pub(crate) room: IsmRoom,
    // Whose maps they are.
    drawn: u32,
}

impl<'a> Rig<'a> {
    /// Makes the maps; `area_m2` is that of all points of a block.
    pub(crate) fn new(
        gpu: &'a Gpu,
        settings: IndirectSettings,
        (points, area_m2, largest_m): (&[Point], f32, f32),
        vpls: &[Vpl],
    ) -> Self {
        let plan = IsmPlan::new(gpu, &settings, vpls.len() as u32).unwrap();
        Self::with_plan(gpu, settings, (points, area_m2, largest_m), vpls, (plan, 0))
    }

    /// The same of what may be infinitely far.
    pub(crate) fn far(
        gpu: &'a Gpu,
        settings: IndirectSettings,
        scene: (&[Point], f32, f32),
        vpls: &[Vpl],
    ) -> Self {
        let plan = IsmPlan::new(gpu, &settings, vpls.len() as u32).unwrap();
        Self::with_plan(gpu, settings, scene, vpls, (plan, SOURCES))
    }

    pub(crate) fn with_plan(
        gpu: &'a Gpu,
        settings: IndirectSettings,
        (points, area_m2, largest_m): (&[Point], f32, f32),
        vpls: &[Vpl],
        (plan, drawn): (IsmPlan, u32),
    ) -> Self {
        let bench = Bench::new(gpu);
        let ism = Ism::compile(&bench.kit, &(drawn == SOURCES)).unwrap();
        let words: Vec<_> = points.iter().map(Point::words).collect();
        let mut rig = Self {
            gpu,
            points: bench.buffer("points", &words),
            pool: points.len() as u32,
            vpls: bench.buffer("vpls", vpls),
            vpl_count: bench.buffer("vpl_count", &counted(vpls.len() as u32, drawn)),
            room: ism.room(gpu, plan, true),
            bench,
            ism,
            settings,
            area_m2,
            largest_m,
            drawn,
        };
        rig.make();
        rig
    }

    fn make(&mut self) {
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        self.record(&mut frame);
        frame.submit();
    }

    /// Draws the maps as a part of a frame.
    pub(crate) fn record(&self, frame: &mut Frame<'_>) -> &[IsmAtlas] {
        self.ism.record(frame, &self.settings, &self.inputs(self.drawn), &self.room)
    }

    fn inputs(&self, set: u32) -> IsmInputs<'_> {
        IsmInputs {
            points: &self.points,
            pool: self.pool,
            vpls: &self.vpls,
            vpl_count: &self.vpl_count,
            set,
            scene_area_m2: self.area_m2,
            dense: None,
            bounds_ws: (Vec3::ZERO, Vec3::splat(self.largest_m / 3f32.sqrt())),
        }
    }

    /// The same points with other settings.
    fn set(&mut self, settings: IndirectSettings, vpls: u32) {
        let plan = IsmPlan::new(self.gpu, &settings, vpls).unwrap();
        if !self.room.serves(plan, true) {
            self.room = self.ism.room(self.gpu, plan, true);
        }
        self.settings = settings;
        self.make();
    }

    /// All tiles' words, one after the other.
    fn words(&self) -> Vec<u32> {
        let read = |buffer| BufferReadback::start(self.gpu, buffer).wait(self.gpu).unwrap();
        self.room
            .atlases()
            .iter()
            .flat_map(|atlas| bytemuck::pod_collect_to_vec(&read(&atlas.words)))
            .collect()
    }

    fn picture(&self, which: usize) -> Vec<f32> {
        let picture = &self.room.pictures().unwrap()[which];
        let texels = Readback::start(self.gpu, picture).unwrap().wait(self.gpu).unwrap().floats();
        texels
            .chunks(texels.len() / (picture.options().width * picture.options().height) as usize)
            .map(|t| t[0])
            .collect()
    }

    /// What the first atlas says of places.
    fn visibility(&self, places: &[Place], closer: bool) -> Vec<f32> {
        let shader = ("tests/ism_lookup.cs.wesl", include_str!("../wesl/ism_lookup.cs.wesl"));
        let buffer = self.bench.buffer("places", places);
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        let atlases = self.record(&mut frame);
        let [words, uniform] = atlases[0].binds();
        let binds = [words, uniform, ("places", (&buffer).into()), ("vpls", (&self.vpls).into())];
        let work = (Dispatch::Threads([places.len() as u32, 1, 1]), places.len());
        let closer = [("ISM_CLOSER", f64::from(u8::from(closer)))];
        let output = self.bench.record(&mut frame, shader, &closer, None, &binds, work);
        frame.submit();
        self.bench.read(&output)
    }
}

/// Points in the directions of texels of the tile of a VPL at the origin that looks along z, a texel each, at distances.
fn pattern(resolution: u32, texels: &[(u32, u32, f32)]) -> Vec<Point> {
    let point = |&(x, y, distance): &(u32, u32, f32)| {
        let to = direction(resolution, Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        Point { position: distance * to, normal: to, exponent: 0 }
    };
    texels.iter().map(point).collect()
}

/// Area of a disc that is far smaller than a texel from a metre.
const SPECK_M2: f32 = 1e-8;

/// Σ of the solid angles of a tile's texels that hold anything.
fn solid_angle(resolution: u32, tile: &[u32]) -> f32 {
    let texel = |(i, word): (usize, &u32)| {
        let (x, y) = (i as u32 % resolution, i as u32 / resolution);
        let z = direction(resolution, Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).z;
        if *word == EMPTY || z < 0.0 { 0.0 } else { ((1.0 + z) * 2.0 / resolution as f32).powi(2) }
    };
    tile.iter().enumerate().map(texel).sum()
}

/// A room of 2 × 2 × 2 m around the origin and what stands in it, by points stratified over their area.
pub(crate) fn scatter(rectangles: &[[Vec3; 3]], points: usize, blocks: usize) -> (Vec<Point>, f32) {
    let area = |[_, a, b]: &[Vec3; 3]| 4.0 * a.cross(*b).length();
    let total: f32 = rectangles.iter().map(area).sum();
    // A Halton sequence whose first number runs along the area, each block turned.
    let radical = |mut i: usize, base: usize| {
        let (mut value, mut digit) = (0.0, 1.0 / base as f32);
        while i > 0 {
            value += digit * (i % base) as f32;
            i /= base;
            digit /= base as f32;
        }
        value
    };
    let mut all = Vec::new();
    for i in 0..points * blocks {
        let mut along = radical(i + 1, 2) * total;
        let last = rectangles.len() - 1;
        let place = rectangles[..last].iter().position(|rectangle| {
            let here = along < area(rectangle);
            along -= if here { 0.0 } else { area(rectangle) };
            here
        });
        let [centre, a, b] = rectangles[place.unwrap_or(last)];
        let (u, v) = (2.0 * radical(i + 1, 3) - 1.0, 2.0 * radical(i + 1, 5) - 1.0);
        let normal = a.cross(b).normalize();
        all.push(Point { position: centre + u * a + v * b, normal, exponent: 0 });
    }
    (all, total)
}

/// The walls of the room: centre and two half sides.
pub(crate) fn walls() -> Vec<[Vec3; 3]> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    (0..6)
        .map(|i| [axes[i % 3] * if i < 3 { 1.0 } else { -1.0 }, axes[(i + 1) % 3], axes[(i + 2) % 3]])
        .collect()
}

/// A disc's half-angle from `d` when it is turned away by an angle of that cosine.
fn half_angle_tan(area: f32, cosine: f32, d: f32) -> f32 {
    (area * cosine / PI).sqrt() / d
}
