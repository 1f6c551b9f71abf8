//! Surfaces over a rectangular grid, straight to indexed triangles: for terrains, water, tubes and sculptures that
//! are too fine for a [`super::solid::Solid`].

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::{Id, Primitive};

/// How many vertices a surface has along its two parameters, and whether it closes.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Vertices along the first parameter, the seam counted twice.
    pub columns: usize,
    /// Vertices along the second.
    pub rows: usize,
    /// Whether the last column, the last row, is the first one again; there only texture coordinates differ.
    pub closes: [bool; 2],
}

impl Grid {
    /// The surface through `at(column, row)`, positions in metres and texture coordinates. It looks to the side of
    /// ∂p/∂column × ∂p/∂row. Normals are the mean of the faces around, weighted by area.
    ///
    /// With `tangents`, texture coordinates must grow along columns and rows.
    pub fn primitive(
        self,
        material: Id,
        tangents: bool,
        at: impl Fn(usize, usize) -> (Vec3, Vec2) + Sync,
    ) -> Primitive {
        self.through(material, tangents, &at)
    }

    // One function for all surfaces: what rayon makes of each takes seconds to compile.
    fn through(
        self,
        material: Id,
        tangents: bool,
        at: &(dyn Fn(usize, usize) -> (Vec3, Vec2) + Sync),
    ) -> Primitive {
        let Self { columns, rows, closes } = self;
        let wrapped = |i: usize, count: usize, closes: bool| if closes { i % (count - 1) } else { i };
        let own = |i: usize| {
            wrapped(i / columns, rows, closes[1]) * columns + wrapped(i % columns, columns, closes[0])
        };
        let points = (0..columns * rows).into_par_iter().map(|i| at(i % columns, i / columns));
        let (mut positions, uvs): (Vec<Vec3>, Vec<Vec2>) = points.unzip();
        for i in 0..positions.len() {
            // A seam is the same point to the last bit: copied, not computed again.
            positions[i] = positions[own(i)];
        }
        let mut indices = Vec::with_capacity(6 * (columns - 1) * (rows - 1));
        let mut sums = vec![Vec3::ZERO; columns * rows];
        for (row, column) in (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| (row, column))) {
            let (a, b) = (row * columns + column, row * columns + column + 1);
            let (c, d) = (b + columns, a + columns);
            for triangle in [[a, b, c], [a, c, d]] {
                let [p, q, r] = triangle.map(|i| positions[i]);
                let normal = (q - p).cross(r - p);
                for i in triangle {
                    let (column, row) =
                        (wrapped(i % columns, columns, closes[0]), wrapped(i / columns, rows, closes[1]));
                    sums[row * columns + column] += normal;
                }
                indices.extend(triangle.map(|i| i as u32));
            }
        }
        let normal = |i: usize| sums[own(i)].normalize_or(Vec3::Y);
        let normals: Vec<Vec3> = (0..sums.len()).into_par_iter().map(normal).collect();
        let mut out = Primitive {
            positions,
            normals,
            uvs: [uvs, Vec::new()],
            indices,
            material,
            ..Primitive::default()
        };
        if tangents {
            let along = |i: usize| {
                let column = i % columns;
                let (before, after) = if closes[0] && (column == 0 || column == columns - 1) {
                    (i - column + columns - 2, i - column + 1)
                } else {
                    (i - usize::from(column > 0), i + usize::from(column + 1 < columns))
                };
                let n = out.normals[i];
                let step = out.positions[after] - out.positions[before];
                let once = (step - n * n.dot(step)).normalize_or(n.any_orthonormal_vector());
                // Normal maps measure v upwards and so does w; texture coordinates measure it downwards.
                (once - n * n.dot(once)).normalize().extend(-1.0)
            };
            out.tangents = (0..out.positions.len()).into_par_iter().map(along).collect();
        }
        out
    }
}
