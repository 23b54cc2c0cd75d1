//! How much of each cell a closed mesh fills.
//!
//! Lines along each axis pass through the cells, 18 per cell; the length inside the mesh is exact on each line, from signed
//! crossings, and the mean over lines and axes is the fraction. As all three axes are treated alike, the fractions of a mesh
//! turned by 90 degrees are those of the mesh, up to rounding.

use crate::Grid;
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, orient2d};
use topipe_mesh::{FaceId, TriangleMesh};

/// Where the lines pass through a cell: two patterns of nine, one the mirror image of the other, in each of which all nine
/// have different places along both axes. So a plane wall across the lines of another axis is met to a ninth of a cell, and
/// not, as by three rows of three, to a third; it is placed to 0.04 cells at the worst.
pub(crate) fn lines() -> [[f64; 2]; 18] {
    std::array::from_fn(|k| {
        let (i, j) = (k / 3 % 3, k % 3);
        let at = [(3 * i + j) as f64 + 0.5, (3 * j + i) as f64 + 0.5].map(|x| x / 9.0);
        if k < 9 { at } else { [1.0 - at[0], at[1]] }
    })
}

/// The fraction of each cell of the grid that lies inside of a closed mesh whose faces look outwards. What is outside of the
/// grid is ignored. Where shells overlap the fraction is 1.
pub fn fractions(mesh: &TriangleMesh, grid: &Grid) -> Vec<f32> {
    let scaled: Vec<DVec3> = mesh.positions.iter().map(|&p| grid.coordinates(p)).collect();
    let mut sums = vec![0.0f32; grid.count()];
    let [nx, ny, nz] = grid.cells;
    for axis in 0..3 {
        // Slabs are planes of cells: z for lines along x and y, y for lines along z.
        let [across, slab] = [[1, 2], [0, 2], [0, 1]][axis];
        let lists = triangles_by_slab(mesh, &scaled, slab, grid.cells[slab]);
        let fill = |at: usize| {
            let (length, width) = (grid.cells[axis], grid.cells[across]);
            let mut covered = vec![0.0f64; length * width];
            let mut step = vec![0.0f64; length * width];
            for &face in &lists[at] {
                let corners = mesh.triangles[face as usize].map(|v| scaled[v.index()]);
                crossings(corners, [axis, across, slab], at, width, |line, along, sign| {
                    let line = line / lines().len();
                    let along = along.clamp(0.0, length as f64);
                    let cell = (along as usize).min(length - 1);
                    covered[line * length + cell] += sign * ((cell + 1) as f64 - along);
                    if cell + 1 < length {
                        step[line * length + cell + 1] += sign;
                    }
                });
            }
            for (covered, step) in covered.chunks_mut(length).zip(step.chunks(length)) {
                let mut inside = 0.0;
                for (c, s) in covered.iter_mut().zip(step) {
                    inside += s;
                    *c += inside;
                }
            }
            covered
        };
        let share = 1.0 / (3 * lines().len()) as f64;
        if slab == 2 {
            sums.par_chunks_mut(nx * ny).enumerate().for_each(|(z, plane)| {
                let covered = fill(z);
                for y in 0..ny {
                    for x in 0..nx {
                        let at = if axis == 0 { y * nx + x } else { x * ny + y };
                        plane[y * nx + x] += (share * covered[at]) as f32;
                    }
                }
            });
        } else {
            let planes: Vec<Vec<f64>> = (0..ny).into_par_iter().map(fill).collect();
            sums.par_chunks_mut(nx * ny).enumerate().for_each(|(z, plane)| {
                for y in 0..ny {
                    for x in 0..nx {
                        plane[y * nx + x] += (share * planes[y][x * nz + z]) as f32;
                    }
                }
            });
        }
    }
    // Rounding leaves full and empty cells a few units in the last place off.
    sums.par_iter_mut().for_each(|f| {
        *f = if *f < 1e-5 {
            0.0
        } else if *f > 1.0 - 1e-5 {
            1.0
        } else {
            *f
        };
    });
    sums
}

/// The faces that reach into each plane of cells, in their order.
pub(crate) fn triangles_by_slab(
    mesh: &TriangleMesh,
    scaled: &[DVec3],
    axis: usize,
    slabs: usize,
) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); slabs];
    for face in mesh.faces() {
        let FaceId(number) = face;
        let at = mesh.triangles[face.index()].map(|v| scaled[v.index()][axis]);
        let low = at.iter().copied().fold(f64::INFINITY, f64::min).floor().max(0.0);
        let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor();
        if high >= 0.0 && low < slabs as f64 {
            lists[low as usize..=(high as usize).min(slabs - 1)]
                .iter_mut()
                .for_each(|list| list.push(number));
        }
    }
    lists
}

/// Calls `found(line, coordinate along, +1 entering or -1 leaving)` for each line of a slab that crosses a triangle. Lines are
/// numbered cell by cell across, in the order of [`lines`].
pub(crate) fn crossings(
    corners: [DVec3; 3],
    [axis, across, slab]: [usize; 3],
    at: usize,
    width: usize,
    mut found: impl FnMut(usize, f64, f64),
) {
    let flat = corners.map(|p| Coord { x: p[across], y: p[slab] });
    let area = orient2d(flat[0], flat[1], flat[2]);
    if area == 0.0 {
        return;
    }
    // Orientation of (axis, across, slab): lines along y see the other two in the wrong order.
    let sign = if (area > 0.0) == (axis != 1) { -1.0 } else { 1.0 };
    let low = flat.iter().map(|p| p.x).fold(f64::INFINITY, f64::min).floor().max(0.0);
    let high = flat.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max).floor().min(width as f64 - 1.0);
    if low > high {
        return;
    }
    let [bottom, top] = [f64::min, f64::max].map(|pick| flat.iter().map(|p| p.y).reduce(pick).unwrap_or(0.0));
    for cell in low as usize..=high as usize {
        for (k, [u, v]) in lines().into_iter().enumerate() {
            let p = Coord { x: cell as f64 + u, y: at as f64 + v };
            if p.y < bottom || p.y > top {
                continue;
            }
            let side = [0, 1, 2].map(|k| side(flat[k], flat[(k + 1) % 3], p));
            if side != [area > 0.0; 3] {
                continue;
            }
            let weights = [0, 1, 2].map(|k| orient2d(flat[(k + 1) % 3], flat[(k + 2) % 3], p) / area);
            let along = (0..3).map(|k| weights[k] * corners[k][axis]).sum();
            found(cell * lines().len() + k, along, sign);
        }
    }
}

/// Whether `x` lies left of the line from `p` to `q`. A point on the line is taken as moved by an infinitesimal step along
/// x and a smaller one along y, so that it lies on one side for both triangles of an edge.
fn side(p: Coord<f64>, q: Coord<f64>, x: Coord<f64>) -> bool {
    let orientation = orient2d(p, q, x);
    if orientation != 0.0 {
        orientation > 0.0
    } else if p.y != q.y {
        p.y > q.y
    } else {
        q.x > p.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cuboid_fills_what_it_fills() {
        let mesh = TriangleMesh::cuboid(DVec3::new(0.25, 1.0, 0.0), DVec3::new(3.0, 2.5, 2.0));
        let grid = Grid { origin: DVec3::ZERO, size: 0.5, cells: [7, 6, 5] };
        let f = fractions(&mesh, &grid);
        let sum: f64 = f.iter().map(|&f| f64::from(f)).sum();
        // Lines along x see half of the first cells exactly, those along y and z in ninths.
        assert!((sum * 0.125 / mesh.volume() - 1.0).abs() < 0.01);
        let first = f64::from(f[grid.index([0, 2, 1])]);
        assert!((first - 0.5).abs() < 0.04, "{first}");
        assert_eq!(f[grid.index([2, 3, 1])], 1.0);
        assert_eq!(f[grid.index([6, 3, 1])], 0.0);
        assert_eq!(f[grid.index([2, 1, 1])], 0.0);
    }

    #[test]
    fn turned_by_ninety_degrees_it_is_the_same() {
        let turn = |p: DVec3| DVec3::new(-p.y, p.x, p.z);
        let tetrahedron = TriangleMesh::from_arrays(
            vec![[0.1, 0.2, 0.3], [4.7, 0.4, 0.9], [1.1, 5.2, 0.7], [1.3, 1.9, 4.1]],
            vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        );
        let mut turned = tetrahedron.clone();
        turned.positions.iter_mut().for_each(|p| *p = turn(*p));
        let grid = Grid { origin: DVec3::ZERO, size: 1.0, cells: [6, 6, 6] };
        let other = Grid { origin: DVec3::new(-6.0, 0.0, 0.0), ..grid };
        let (a, b) = (fractions(&tetrahedron, &grid), fractions(&turned, &other));
        let mut volume = 0.0;
        for x in 0..6 {
            for y in 0..6 {
                for z in 0..6 {
                    let (p, q) = (a[grid.index([x, y, z])], b[other.index([5 - y, x, z])]);
                    assert!((p - q).abs() < 1e-6, "{p} {q}");
                    volume += f64::from(p);
                }
            }
        }
        assert!((volume / tetrahedron.volume() - 1.0).abs() < 0.01, "{volume}");
    }
}
