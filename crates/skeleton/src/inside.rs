//! Is a point inside the material?

use glam::{DMat3, DVec2, DVec3};
use topipe_mesh::TriangleMesh;

/// Counts crossings of a ray, with the triangles sorted into the cells of a plane across the rays.
///
/// All rays run the same way, in a direction chosen so that no mesh of engineering parts is aligned with it: then a
/// ray does not run along a face or through an edge but by rare chance, and equal points give equal answers.
#[derive(Debug, Clone)]
pub(crate) struct Inside {
    /// Positions in a frame whose z runs along the rays.
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    frame: DMat3,
    low: DVec2,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Start of each cell in `members`.
    start: Vec<u32>,
    members: Vec<u32>,
}

impl Inside {
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        let z = DVec3::new(0.541_872_3, 0.321_987_1, 0.776_310_9).normalize();
        let x = z.any_orthonormal_vector();
        let frame = DMat3::from_cols(x, z.cross(x), z).transpose();
        let points: Vec<_> = mesh.positions.iter().map(|&p| frame * p).collect();
        let triangles: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| v.0)).collect();
        let mut low = DVec2::splat(f64::INFINITY);
        let mut high = DVec2::splat(f64::NEG_INFINITY);
        for p in &points {
            low = low.min(p.truncate());
            high = high.max(p.truncate());
        }
        // About one triangle per cell and layer, and never more cells than four per triangle.
        let extent = (high - low).max(DVec2::splat(f64::MIN_POSITIVE));
        let cell =
            ((extent.x * extent.y) / triangles.len().max(1) as f64).sqrt().max(extent.max_element() / 4096.0);
        let columns = (extent.x / cell) as usize + 1;
        let rows = (extent.y / cell) as usize + 1;
        let mut grid = Self {
            points,
            triangles,
            frame,
            low,
            cell,
            columns,
            rows,
            start: vec![0; columns * rows + 1],
            members: Vec::new(),
        };
        let mut total = 0;
        for t in 0..grid.triangles.len() {
            grid.for_cells(t, |start, cell| start[cell + 1] += 1);
        }
        for k in 0..columns * rows {
            total += grid.start[k + 1];
            grid.start[k + 1] = total;
        }
        let mut fill = grid.start.clone();
        let mut members = vec![0; total as usize];
        for t in 0..grid.triangles.len() {
            let (c, r) = grid.cells(t);
            for row in r.0..=r.1 {
                for column in c.0..=c.1 {
                    let k = row * columns + column;
                    members[fill[k] as usize] = t as u32;
                    fill[k] += 1;
                }
            }
        }
        grid.members = members;
        grid
    }

    fn for_cells(&mut self, triangle: usize, mut visit: impl FnMut(&mut [u32], usize)) {
        let (c, r) = self.cells(triangle);
        for row in r.0..=r.1 {
            for column in c.0..=c.1 {
                visit(&mut self.start, row * self.columns + column);
            }
        }
    }

    fn cells(&self, triangle: usize) -> ((usize, usize), (usize, usize)) {
        let [a, b, c] = self.triangles[triangle].map(|v| self.points[v as usize].truncate());
        let (low, high) = (a.min(b).min(c) - self.low, a.max(b).max(c) - self.low);
        let index = |x: f64, count: usize| ((x / self.cell) as usize).min(count - 1);
        (
            (index(low.x, self.columns), index(high.x, self.columns)),
            (index(low.y, self.rows), index(high.y, self.rows)),
        )
    }

    /// The heights at which the line through `p` crosses the surface, relative to `p`, ascending.
    fn crossings(&self, p: DVec3) -> Vec<f64> {
        let q = self.frame * p;
        let at = q.truncate() - self.low;
        if !(at.x >= 0.0 && at.y >= 0.0) {
            return Vec::new();
        }
        let (column, row) = ((at.x / self.cell) as usize, (at.y / self.cell) as usize);
        if column >= self.columns || row >= self.rows {
            return Vec::new();
        }
        let k = row * self.columns + column;
        let mut heights = Vec::new();
        for &t in &self.members[self.start[k] as usize..self.start[k + 1] as usize] {
            let [a, b, c] = self.triangles[t as usize].map(|v| self.points[v as usize] - q);
            let cross = |u: DVec3, v: DVec3| u.x * v.y - u.y * v.x;
            let (wa, wb, wc) = (cross(b, c), cross(c, a), cross(a, b));
            let all = (wa > 0.0 && wb > 0.0 && wc > 0.0) || (wa < 0.0 && wb < 0.0 && wc < 0.0);
            if all {
                heights.push((wa * a.z + wb * b.z + wc * c.z) / (wa + wb + wc));
            }
        }
        heights.sort_by(f64::total_cmp);
        heights
    }

    /// True inside the material of a closed mesh.
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        self.crossings(p).iter().filter(|&&h| h > 0.0).count() % 2 == 1
    }

    /// The middle of the material nearest to `p` on the line through it along the rays; `None` where it meets none.
    pub(crate) fn nearest_middle(&self, p: DVec3) -> Option<DVec3> {
        let along = self.frame.transpose().z_axis;
        self.crossings(p)
            .chunks_exact(2)
            .map(|pair| (pair[0] + pair[1]) / 2.0)
            .min_by(|a, b| a.abs().total_cmp(&b.abs()))
            .map(|h| p + h * along)
    }
}
