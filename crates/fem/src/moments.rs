//! Where in a cell its material is.
//!
//! A cell that is filled in part is not one of softer material: what it holds out against bending depends on where the
//! material is. Its stiffness is the integral over the material alone, which for trilinear displacements takes the integrals
//! of the monomials `x^a y^b z^c` with exponents up to 2. They are taken along the same lines as the fractions.

use crate::Grid;
use crate::voxelize::{crossings, lines, triangles_by_slab};
use glam::DVec3;
use rayon::prelude::*;
use topipe_mesh::TriangleMesh;

/// Integrals of one cell: of `x^a y^b z^c` at number `a + 3 b + 9 c`. A cell reaches from -1 to 1 and has the volume 1.
pub type Moments = [f32; 27];

/// Share of the cell's material that is taken as spread evenly over all of it. A sliver along an edge of a cell holds out
/// against hardly anything, and its nodes would be as good as loose.
const SPREAD: f64 = 0.01;

/// The cells of a grid that are filled in part, and their moments.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cuts {
    /// Numbers of the cells, sorted.
    pub cells: Vec<u32>,
    /// The moments of each.
    pub moments: Vec<Moments>,
}

/// One factor of the moments of a full cell: of 1, x and x^2.
const FULL: [f64; 3] = [1.0, 0.0, 1.0 / 3.0];

impl Cuts {
    /// The cells of a grid that a closed mesh fills in part, by their fractions.
    pub fn new(mesh: &TriangleMesh, grid: &Grid, fraction: &[f32]) -> Self {
        let cells: Vec<u32> = (0..fraction.len() as u32)
            .filter(|&c| fraction[c as usize] > 0.0 && fraction[c as usize] < 1.0)
            .collect();
        if cells.is_empty() {
            return Self::default();
        }
        let mut slots = vec![u32::MAX; fraction.len()];
        cells.iter().enumerate().for_each(|(slot, &cell)| slots[cell as usize] = slot as u32);
        let scaled: Vec<DVec3> = mesh.positions.iter().map(|&p| grid.coordinates(p)).collect();
        let mut sums = vec![[0.0f64; 27]; cells.len()];
        for axis in 0..3 {
            let [across, slab] = [[1, 2], [0, 2], [0, 1]][axis];
            let lists = triangles_by_slab(mesh, &scaled, slab, grid.cells[slab]);
            let of_slab = |at: usize| {
                let corners =
                    lists[at].iter().map(|&f| mesh.triangles[f as usize].map(|v| scaled[v.index()]));
                let mut found: Vec<(u32, f64, f64)> = Vec::new();
                for corners in corners {
                    crossings(corners, [axis, across, slab], at, grid.cells[across], |line, along, sign| {
                        found.push((line as u32, along, sign));
                    });
                }
                found.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
                let mut parts: Vec<(u32, [f64; 27])> = Vec::new();
                for line in found.chunk_by(|a, b| a.0 == b.0) {
                    let number = line[0].0 as usize;
                    let place = |cell: usize| {
                        let mut place = [0; 3];
                        (place[axis], place[across], place[slab]) = (cell, number / lines().len(), at);
                        grid.index(place)
                    };
                    let [u, v] = lines()[number % lines().len()].map(|x| 2.0 * x - 1.0);
                    along_line(line, grid.cells[axis], |cell, low, high| {
                        let slot = slots[place(cell)];
                        if slot != u32::MAX {
                            parts.push((slot, piece([axis, across, slab], [low, high], [u, v])));
                        }
                    });
                }
                parts
            };
            // Sums in the order of the slabs, whatever the threads.
            let slabs: Vec<usize> = (0..grid.cells[slab]).collect();
            for some in slabs.chunks(16) {
                let parts: Vec<_> = some.par_iter().map(|&at| of_slab(at)).collect();
                for (slot, part) in parts.into_iter().flatten() {
                    let sum = &mut sums[slot as usize];
                    (0..27).for_each(|k| sum[k] += part[k]);
                }
            }
        }
        let share = 1.0 / (3 * lines().len()) as f64;
        let moments = sums.iter().map(|sum| stored(&sum.map(|x| share * x)));
        Self { moments: moments.collect(), cells }
    }
}

/// Moments of a cell whose material is where these points are, coordinates from -1 to 1; each stands for the same volume, a share
/// `volume` of the cell.
pub fn moments_of_points(points: impl IntoIterator<Item = DVec3>, volume: f64) -> Moments {
    let mut sum = [0.0; 27];
    for p in points {
        let powers = p.to_array().map(|x| [1.0, x, x * x]);
        for (k, sum) in sum.iter_mut().enumerate() {
            *sum += volume * powers[0][k % 3] * powers[1][k / 3 % 3] * powers[2][k / 9];
        }
    }
    stored(&sum)
}

/// With a little of the material spread over the cell.
fn stored(sum: &[f64; 27]) -> Moments {
    std::array::from_fn(|k| {
        let full = FULL[k % 3] * FULL[k / 3 % 3] * FULL[k / 9];
        ((1.0 - SPREAD) * sum[k] + SPREAD * sum[0] * full) as f32
    })
}

/// Calls `found(cell, from, to)` for each piece of a line inside of the mesh, `from` and `to` between 0 and 1 in the cell.
fn along_line(crossings: &[(u32, f64, f64)], length: usize, mut found: impl FnMut(usize, f64, f64)) {
    let (mut depth, mut entered) = (0.0, 0.0);
    for &(_, along, sign) in crossings {
        let at = along.clamp(0.0, length as f64);
        if depth > 0.0 {
            let mut from: f64 = entered;
            while from < at {
                let cell = (from as usize).min(length - 1);
                let to = at.min((cell + 1) as f64);
                found(cell, from - cell as f64, to - cell as f64);
                if to >= length as f64 {
                    break;
                }
                from = to;
            }
        }
        entered = at;
        depth += sign;
    }
}

/// Moments of a piece of a line along the first axis at `(u, v)` on the other two.
fn piece([axis, across, slab]: [usize; 3], ends: [f64; 2], [u, v]: [f64; 2]) -> [f64; 27] {
    let [a, b] = ends.map(|x| 2.0 * x - 1.0);
    let along = [0.5 * (b - a), 0.25 * (b * b - a * a), (b * b * b - a * a * a) / 6.0];
    let (beside, above) = ([1.0, u, u * u], [1.0, v, v * v]);
    let step = [1, 3, 9];
    let mut moments = [0.0; 27];
    for (i, x) in along.into_iter().enumerate() {
        for (j, y) in beside.into_iter().enumerate() {
            for (k, z) in above.into_iter().enumerate() {
                moments[step[axis] * i + step[across] * j + step[slab] * k] = x * y * z;
            }
        }
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fractions;

    /// A cell cut by a plane across x: the integrals are those of the cuboid in it.
    #[test]
    fn moments_are_integrals_over_the_material() {
        let mesh = TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(1.4, 2.0, 2.0));
        let grid = Grid { origin: DVec3::ZERO, size: 1.0, cells: [2, 2, 2] };
        let fraction = fractions(&mesh, &grid);
        let cuts = Cuts::new(&mesh, &grid, &fraction);
        assert_eq!(cuts.cells, [1, 3, 5, 7]);
        let x = [0.4, 0.5 * 0.5 * (0.04 - 1.0), (1.0 - 0.008) / 6.0];
        for moments in &cuts.moments {
            for k in 0..27 {
                let [i, j, l] = [k % 3, k / 3 % 3, k / 9];
                let exact = x[i] * FULL[j] * FULL[l];
                assert!((f64::from(moments[k]) - exact).abs() < 0.045, "{k} {} {exact}", moments[k]);
            }
        }
    }
}
