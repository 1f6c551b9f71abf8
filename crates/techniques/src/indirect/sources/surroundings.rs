//! Directions that surroundings shine from, chosen on the CPU once for a scene.

use std::f64::consts::PI;

use chiaro_scene as cs;
use glam::{DVec3, Vec3};

use crate::indirect::points::sequence::Sequence;
use crate::scene::words::normal_word;

/// Directions of a pool.
const DIRECTIONS: u32 = 4096;
/// Cells of a map across at most, and half as many down.
const COLUMNS: u32 = 1024;

/// A direction to shaders: octahedral; radiance over the chance of the direction per steradian, as bits of floats.
type Direction = [u32; 4];

/// Directions of a map by its luminance, each for the mean of a cell of it; without a map evenly over all. Of any 2ᵏ in a row,
/// wherever they begin, each lies in another of 2ᵏ strips.
pub(super) fn directions(map: Option<&cs::Environment>) -> Vec<Direction> {
    let table = map.map_or_else(Table::uniform, Table::new);
    let sequence = Sequence::new(0);
    (0..DIRECTIONS)
        .map(|index| {
            let (direction, weight) = table.at(sequence.point(index));
            let [red, green, blue] = weight.to_array().map(f32::to_bits);
            [normal_word(direction), red, green, blue]
        })
        .collect()
}

/// Cells of a map, row after row.
struct Table {
    columns: usize,
    rows: usize,
    /// Mean radiance.
    radiance: Vec<Vec3>,
    /// Luminance × solid angle of all cells up to and with each.
    ends: Vec<f64>,
}

impl Table {
    fn uniform() -> Self {
        Self::of(1, 1, vec![Vec3::ONE])
    }

    fn new(map: &cs::Environment) -> Self {
        let columns = map.width.clamp(1, COLUMNS) as usize;
        let rows = map.height.clamp(1, COLUMNS / 2) as usize;
        let cell_of = |i: usize, of: usize, source: u32| i * of / source as usize;
        let mut sums = vec![(Vec3::ZERO, 0.0f32); columns * rows];
        for (row, line) in map.radiance.chunks(map.width.max(1) as usize).enumerate() {
            for (column, radiance) in line.iter().enumerate() {
                let cell = cell_of(row, rows, map.height) * columns + cell_of(column, columns, map.width);
                sums[cell] = (sums[cell].0 + *radiance, sums[cell].1 + 1.0);
            }
        }
        Self::of(columns, rows, sums.into_iter().map(|(sum, count)| sum / count.max(1.0)).collect())
    }

    fn of(columns: usize, rows: usize, radiance: Vec<Vec3>) -> Self {
        let mut sum = 0.0;
        let ends = radiance
            .iter()
            .enumerate()
            .map(|(cell, radiance)| {
                let [red, green, blue] = radiance.as_dvec3().to_array();
                let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
                sum += luminance.max(0.0) * solid_angle(cell / columns, rows, columns);
                sum
            })
            .collect();
        Self { columns, rows, radiance, ends }
    }

    /// The direction of a place in the unit square, and the radiance there over its chance per steradian.
    fn at(&self, [u, v]: [f64; 2]) -> (Vec3, Vec3) {
        let all = self.ends.last().copied().unwrap_or_default();
        if all <= 0.0 {
            return (Vec3::Y, Vec3::ZERO);
        }
        let place = u * all;
        let cell = self.ends.partition_point(|end| *end <= place).min(self.ends.len() - 1);
        let before = cell.checked_sub(1).map_or(0.0, |before| self.ends[before]);
        let share = self.ends[cell] - before;
        let (row, column) = (cell / self.columns, cell % self.columns);
        let phi =
            (column as f64 + ((place - before) / share).clamp(0.0, 1.0)) / self.columns as f64 * 2.0 * PI;
        // Even over the cell's solid angle.
        let [top, bottom] = [row, row + 1].map(|row| edge(row, self.rows));
        let y = top + v * (bottom - top);
        let radius = (1.0 - y * y).max(0.0).sqrt();
        let direction = DVec3::new(radius * phi.sin(), y, -radius * phi.cos());
        let weight = all * solid_angle(row, self.rows, self.columns) / share;
        (direction.as_vec3().normalize_or(Vec3::Y), self.radiance[cell] * weight as f32)
    }
}

/// Height of a row's upper edge on the unit sphere.
fn edge(row: usize, rows: usize) -> f64 {
    (row as f64 / rows as f64 * PI).cos()
}

fn solid_angle(row: usize, rows: usize, columns: usize) -> f64 {
    2.0 * PI / columns as f64 * (edge(row, rows) - edge(row + 1, rows))
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::indirect::Vpl;

    fn unpacked([normal, weight @ ..]: Direction) -> (Vec3, Vec3) {
        let direction = Vpl { normal, ..bytemuck::Zeroable::zeroed() }.normal_ws();
        (direction, Vec3::from(weight.map(f32::from_bits)))
    }

    /// Irradiance of a plane under the directions.
    fn irradiance(directions: &[Direction], normal: Vec3) -> Vec3 {
        let each = directions.iter().map(|&direction| {
            let (towards, weight) = unpacked(direction);
            weight * towards.dot(normal).max(0.0)
        });
        each.sum::<Vec3>() / directions.len() as f32
    }

    #[test]
    fn a_uniform_sky_gives_pi_from_everywhere_and_any_run_of_it_nearly_as_much() {
        let all = directions(None);
        for normal in [Vec3::X, Vec3::Y, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)] {
            let lux = irradiance(&all, normal).x;
            assert!((lux / std::f32::consts::PI - 1.0).abs() < 0.01, "{normal}: {lux}");
            let run = irradiance(&all[512..768], normal).x;
            assert!((run / std::f32::consts::PI - 1.0).abs() < 0.05, "{normal}: {run}");
        }
    }

    #[test]
    fn a_bright_pixel_gives_what_its_solid_angle_says() {
        let (width, height) = (64, 32);
        let mut radiance = vec![Vec3::ZERO; width * height];
        let (x, y) = (20, 10);
        radiance[y * width + x] = Vec3::new(1000.0, 500.0, 250.0);
        let map =
            cs::Environment { name: String::new(), width: width as u32, height: height as u32, radiance };
        let all = directions(Some(&map));
        let angle = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(64.0, 32.0)
            * Vec2::new(std::f32::consts::TAU, std::f32::consts::PI);
        let towards = Vec3::new(angle.y.sin() * angle.x.sin(), angle.y.cos(), -angle.y.sin() * angle.x.cos());
        let expected = Vec3::new(1000.0, 500.0, 250.0) * solid_angle(y, height, width) as f32;
        let lux = irradiance(&all, towards);
        assert!((lux / expected - 1.0).abs().max_element() < 0.01, "{lux} instead of {expected}");
    }

    #[test]
    fn a_black_map_gives_nothing() {
        let map = cs::Environment { name: String::new(), width: 4, height: 2, radiance: vec![Vec3::ZERO; 8] };
        assert_eq!(irradiance(&directions(Some(&map)), Vec3::Y), Vec3::ZERO);
    }
}
