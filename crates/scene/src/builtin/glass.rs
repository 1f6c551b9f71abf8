//! Glass under a spot: balls on a chess board, and a knot on a paper sweep.

use glam::{Vec2, Vec3, vec2, vec3};

use super::{
    curve::frames,
    curve::torus_knot,
    grid::Grid,
    shape::{ball, bevelled, circle, lathe},
    stage::{Stage, glass, metal, plain, spot},
    tabletop::{TOP, surround, sweep_backdrop, table, wooden},
    texture::{Noise, Surface, hash},
};
use crate::{Id, Material, Primitive, Scene};

/// A square of the chess board, metres.
const SQUARE_M: f32 = 0.055;

/// Builds `ball`: a large clear ball and small ones on a chess board.
pub fn build_ball() -> Scene {
    let mut stage = Stage::new("ball");
    let oak = wooden(&mut stage, "oak", vec3(0.27, 0.165, 0.085), 0.45, 6);
    table(&mut stage, oak, vec3(0.24, 0.20, 0.17));
    let board = board(&mut stage);

    let clear = stage.material(glass("clear glass", 0.12, vec3(0.97, 0.99, 0.98), 0.2));
    let big = stage.mesh("big ball", ball(0.06, 5, clear));
    stage.place(big, vec3(0.0, board + 0.06, 0.0), false);
    let cobalt = stage.material(glass("cobalt glass", 0.05, vec3(0.10, 0.28, 0.90), 0.035));
    let amber = stage.material(glass("amber glass", 0.044, vec3(0.95, 0.48, 0.08), 0.035));
    let steel = stage.material(metal("steel", vec3(0.77, 0.76, 0.74), 0.04));
    for (name, radius, at, material) in [
        ("cobalt ball", 0.025, vec2(0.118, 0.064), cobalt),
        ("amber ball", 0.022, vec2(-0.108, 0.088), amber),
        ("steel ball", 0.020, vec2(0.062, 0.128), steel),
    ] {
        let mesh = stage.mesh(name, ball(radius, 4, material));
        stage.place(mesh, vec3(at.x, board + radius, at.y), false);
    }
    surround(&mut stage, 0.5, vec3(70.0, 52.0, 32.0));
    let from = vec3(-0.42, board + 0.78, -0.52);
    stage.light("spot", spot(11.0, 20.0), vec3(1.0, 0.90, 0.76), 1_600.0, from, vec3(0.0, board, 0.02));

    let look = vec3(0.018, board + 0.036, 0.025);
    stage.camera("ball", look + vec3(0.13, 0.225, 0.46), look, 30.0);
    stage.camera("low", vec3(-0.06, board + 0.075, 0.48), vec3(0.005, board + 0.045, 0.0), 33.0);
    stage.camera("above", look + vec3(0.05, 0.62, 0.14), look, 32.0);
    stage.scene
}

/// The chess board; returns its top's height.
fn board(stage: &mut Stage) -> f32 {
    let across = 8.0 * SQUARE_M;
    let streaks = Noise::new(1024, glam::ivec2(12, 160), 3, 91);
    let clouds = Noise::new(1024, glam::IVec2::splat(10), 4, 93);
    let squares = Surface::paint(1024, |uv| {
        let cell = (uv * 8.0).as_ivec2();
        let f = uv * 8.0 - cell.as_vec2();
        let dark = (cell.x + cell.y) % 2 == 1;
        // The grain of dark squares runs across that of light ones; each is a piece of its own.
        let turned = if dark { vec2(uv.y, uv.x) } else { uv };
        let piece = turned + vec2(hash(cell.x, cell.y, 95), hash(cell.y, cell.x, 96));
        let at = piece - piece.floor();
        let wood = if dark { vec3(0.085, 0.042, 0.022) } else { vec3(0.56, 0.40, 0.23) };
        let tone = 1.0 + 0.7 * streaks.at(at) + 0.3 * clouds.at(at) + 0.16 * (hash(cell.x, cell.y, 97) - 0.5);
        let edge_m = f.min(1.0 - f).min_element() * SQUARE_M;
        let seam = if edge_m < 0.0003 { 0.55 } else { 1.0 };
        (wood * tone * seam, 0.00012 * streaks.at(at))
    });
    let [base_color_texture, normal_texture] = stage.surface("chess board", &squares, across);
    let veneer = stage.material(Material {
        base_color_texture,
        normal_texture,
        ..plain("chess board", Vec3::ONE, 0.22)
    });
    let frame = wooden(stage, "board frame", vec3(0.10, 0.048, 0.026), 0.3, 61);
    let (half, rim) = (across / 2.0, 0.032);
    let under = vec3(half + rim, TOP, half + rim);
    let lo = vec3(-under.x, TOP, -under.z);
    stage.body("board frame", bevelled(lo, vec3(under.x, TOP + 0.016, under.z), 0.003, frame));
    let top = TOP + 0.0175;
    let lo = vec3(-half, TOP + 0.010, -half);
    stage.body("chess board", bevelled(lo, vec3(half, top, half), 0.0006, veneer));
    top
}

/// Builds `knot`: a glass trefoil knot on a slate disc before a paper sweep.
pub fn build_knot() -> Scene {
    let mut stage = Stage::new("knot");
    sweep_backdrop(&mut stage, vec3(0.78, 0.755, 0.72), 0.55);
    let glass = stage.material(glass("aquamarine glass", 0.045, vec3(0.52, 0.90, 0.86), 0.06));
    let knot = stage.add("glass knot", vec![strand(glass)]);
    stage.place_turned(knot, vec3(0.0, 0.0592 + 0.012, 0.0), 20.0, 1.0);
    let stone = stage.material(plain("limestone", vec3(0.66, 0.63, 0.58), 0.7));
    let disc = [(0.198, 0.0), (0.2, 0.002), (0.2, 0.010), (0.198, 0.012)];
    stage.body("disc", lathe(&disc.map(|(r, y)| vec2(r, y)), 128, stone));

    surround(&mut stage, 0.6, vec3(120.0, 114.0, 104.0));
    let from = vec3(-0.55, 0.95, -0.42);
    stage.light("spot", spot(12.0, 24.0), vec3(1.0, 0.93, 0.82), 1_400.0, from, vec3(0.03, 0.02, 0.02));
    let look = vec3(0.02, 0.035, 0.0);
    stage.camera("knot", look + vec3(0.16, 0.42, 0.62), look, 34.0);
    stage.camera("low", look + vec3(-0.38, 0.12, 0.50), look + vec3(0.0, 0.02, 0.0), 32.0);
    stage.camera("above", look + vec3(0.02, 0.85, 0.10), look, 30.0);
    stage.scene
}

/// The knot's strand about the vertical.
fn strand(material: Id) -> Primitive {
    let (around, along) = (49, 513);
    let at = |i: usize| torus_knot(2.0, 3.0, 0.082, 0.036, i as f32 / (along - 1) as f32);
    let rings = frames(&(0..along - 1).map(at).collect::<Vec<_>>(), true);
    let profile: Vec<Vec2> = circle(around - 1, 0.0232);
    let grid = Grid { columns: around, rows: along, closes: [true; 2] };
    grid.primitive(material, false, |column, row| {
        let (frame, p) = (&rings[row % (along - 1)], profile[column % (around - 1)]);
        (frame.origin + frame.x * p.x + frame.y * p.y, vec2(column as f32 * 0.003, row as f32 * 0.002))
    })
}
