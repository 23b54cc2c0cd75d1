//! A plane section of a mesh, and rays in it.

use topipe_mesh::{DVec3, TriangleMesh};

/// Rays of a full turn.
pub(super) const RAYS: usize = 36;

/// The segments in which a plane through a point cuts the triangles, in coordinates of that plane.
pub(super) struct Section {
    segments: Vec<[[f64; 2]; 2]>,
    /// The directions of the two coordinates.
    pub(super) axes: [DVec3; 2],
}

/// Nearest and farthest hit of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hits {
    pub(super) nearest: f64,
    pub(super) farthest: f64,
}

impl Section {
    /// A vertex in the plane counts as above it, so a closed mesh always has closed sections.
    pub(super) fn cut(mesh: &TriangleMesh, point: DVec3, normal: DVec3) -> Self {
        let reference = if normal.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let u = normal.cross(reference).normalize_or(DVec3::Z);
        let v = normal.cross(u);
        let height: Vec<f64> = mesh.positions.iter().map(|&p| (p - point).dot(normal)).collect();
        let mut segments = Vec::new();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| height[v.index()] >= 0.0);
            if a == b && b == c {
                continue;
            }
            let mut ends = [[0.0; 2]; 2];
            let mut count = 0;
            for k in 0..3 {
                let (p, q) = (triangle[k].min(triangle[(k + 1) % 3]), triangle[k].max(triangle[(k + 1) % 3]));
                let (hp, hq) = (height[p.index()], height[q.index()]);
                if (hp >= 0.0) != (hq >= 0.0) {
                    // From the lower to the higher index, so that both faces at an edge find the same bits.
                    let r = mesh.position(p).lerp(mesh.position(q), hp / (hp - hq)) - point;
                    ends[count] = [r.dot(u), r.dot(v)];
                    count += 1;
                }
            }
            segments.push(ends);
        }
        Self { segments, axes: [u, v] }
    }

    /// The direction of ray `k` in the plane: `k` times ten degrees.
    pub(super) fn direction(&self, k: usize) -> DVec3 {
        let (sin, cos) = (k as f64 * (360.0 / RAYS as f64)).to_radians().sin_cos();
        self.axes[0] * cos + self.axes[1] * sin
    }

    /// What the rays from the point hit; `None` for a ray that misses.
    pub(super) fn rays(&self) -> [Option<Hits>; RAYS] {
        std::array::from_fn(|k| {
            let (sin, cos) = (k as f64 * (360.0 / RAYS as f64)).to_radians().sin_cos();
            let mut hits: Option<Hits> = None;
            for [a, b] in &self.segments {
                let (ya, yb) = (cos * a[1] - sin * a[0], cos * b[1] - sin * b[0]);
                if (ya >= 0.0) == (yb >= 0.0) {
                    continue;
                }
                let (xa, xb) = (cos * a[0] + sin * a[1], cos * b[0] + sin * b[1]);
                let x = xa + (xb - xa) * (ya / (ya - yb));
                if x >= 0.0 {
                    let so_far = hits.unwrap_or(Hits { nearest: x, farthest: x });
                    hits = Some(Hits { nearest: so_far.nearest.min(x), farthest: so_far.farthest.max(x) });
                }
            }
            hits
        })
    }
}
