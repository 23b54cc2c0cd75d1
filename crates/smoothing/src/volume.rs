//! Exact restoration of the volume.
//!
//! Let each free vertex move by `tau` along its own direction. The volume is then a cubic in `tau` whose four
//! coefficients are sums over the faces; Newton's method solves `V(tau) = V0` to the last digits. The paper scales
//! about the origin instead (its equations 4 and 5), which is exact only when nothing is frozen and depends on where
//! the part lies.

use crate::kernel::{Domain, in_chunks, in_chunks_mut};
use topipe_mesh::{DVec3, TriangleMesh, VertexId};

/// Knows the volume to restore and how to do it.
pub(crate) struct VolumeKeeper {
    /// Triangles with a vertex that may move.
    moving: Vec<[VertexId; 3]>,
    /// Six times what the others add to the volume.
    still: f64,
    /// Volumes are summed about this point, so that a part far from the origin keeps its digits.
    center: DVec3,
    wanted: f64,
    directions: Vec<DVec3>,
    slides: Vec<bool>,
}

/// Coefficients of `V(tau)`, by rising power.
type Cubic = [f64; 4];

fn value(c: Cubic, tau: f64) -> f64 {
    ((c[3] * tau + c[2]) * tau + c[1]) * tau + c[0]
}

fn slope(c: Cubic, tau: f64) -> f64 {
    (3.0 * c[3] * tau + 2.0 * c[2]) * tau + c[1]
}

/// Six times the volume between triangles and `center`, in fixed order.
pub(crate) fn six_volumes(triangles: &[[VertexId; 3]], center: DVec3, positions: &[DVec3]) -> f64 {
    let chunks = in_chunks(triangles, |_, chunk| -> f64 {
        let six = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| positions[v.index()] - center);
            a.dot(b.cross(c))
        };
        chunk.iter().map(six).sum()
    });
    chunks.iter().sum()
}

impl VolumeKeeper {
    pub(crate) fn new(mesh: &TriangleMesh, domain: &Domain) -> Self {
        let (low, high) = mesh.bounds();
        let mut slides = vec![false; mesh.vertex_count()];
        for slide in &domain.slides {
            slides[slide.vertex as usize] = true;
        }
        let center = (low + high) / 2.0;
        let (moving, still): (Vec<_>, Vec<_>) =
            mesh.triangles.iter().partition(|t| t.iter().any(|v| !domain.row(v.index()).is_empty()));
        let mut keeper = Self {
            still: six_volumes(&still, center, &mesh.positions),
            moving,
            center,
            wanted: 0.0,
            directions: vec![DVec3::ZERO; mesh.vertex_count()],
            slides,
        };
        keeper.wanted = keeper.volume(&mesh.positions);
        keeper
    }

    /// Restores the volume `wanted` along these directions.
    pub(crate) fn along(mesh: &TriangleMesh, directions: Vec<DVec3>, wanted: f64) -> Self {
        let (low, high) = mesh.bounds();
        let center = (low + high) / 2.0;
        let moves = |t: &&[VertexId; 3]| t.iter().any(|v| directions[v.index()] != DVec3::ZERO);
        let (moving, still): (Vec<_>, Vec<_>) = mesh.triangles.iter().partition(moves);
        let still = six_volumes(&still, center, &mesh.positions);
        Self { moving, still, center, wanted, directions, slides: Vec::new() }
    }

    /// The volume of the mesh it was made for.
    pub(crate) fn wanted(&self) -> f64 {
        self.wanted
    }

    /// The volume inside the mesh with these positions.
    pub(crate) fn volume(&self, positions: &[DVec3]) -> f64 {
        (self.still + six_volumes(&self.moving, self.center, positions)) / 6.0
    }

    fn cubic(&self, positions: &[DVec3]) -> Cubic {
        let chunks = in_chunks(&self.moving, |_, chunk| {
            let mut sum = [0.0; 4];
            for t in chunk {
                let [a, b, c] = t.map(|v| positions[v.index()] - self.center);
                let [u, v, w] = t.map(|v| self.directions[v.index()]);
                sum[0] += a.dot(b.cross(c));
                sum[1] += u.dot(b.cross(c)) + v.dot(c.cross(a)) + w.dot(a.cross(b));
                sum[2] += a.dot(v.cross(w)) + b.dot(w.cross(u)) + c.dot(u.cross(v));
                sum[3] += u.dot(v.cross(w));
            }
            sum
        });
        let mut sum = [self.still, 0.0, 0.0, 0.0];
        for p in chunks {
            for k in 0..4 {
                sum[k] += p[k];
            }
        }
        sum.map(|s| s / 6.0)
    }

    /// Moves the free vertices along their normals to the wanted volume, and returns the volume there up to rounding, or
    /// `Err` with the present volume where an offset by up to `reach` does not do it.
    ///
    /// Sliding vertices have no direction: the plane they slide in stays where it is.
    pub(crate) fn restore(
        &mut self,
        domain: &Domain,
        positions: &mut [DVec3],
        reach: f64,
    ) -> Result<f64, f64> {
        self.aim(domain, positions);
        self.offset(positions, reach).map(|(_, volume)| volume)
    }

    /// As [`Self::restore`], then measures the volume and takes out what rounding left. Returns the measured volume.
    pub(crate) fn settle(
        &mut self,
        domain: &Domain,
        positions: &mut [DVec3],
        reach: f64,
    ) -> Result<f64, f64> {
        self.aim(domain, positions);
        let mut volume = self.volume(positions);
        for _ in 0..2 {
            if (volume - self.wanted).abs() <= 1e-14 * self.wanted.abs() {
                break;
            }
            self.offset(positions, reach)?;
            volume = self.volume(positions);
        }
        Ok(volume)
    }

    /// Sets the directions.
    fn aim(&mut self, domain: &Domain, positions: &[DVec3]) {
        let slides = &self.slides;
        domain.sweep(
            &mut self.directions,
            |_| DVec3::ZERO,
            |v, row, _| {
                if slides[v] {
                    return DVec3::ZERO;
                }
                // The row of a free vertex is its whole ring, counter-clockwise.
                let p = positions[v];
                let mut normal = DVec3::ZERO;
                let mut from = positions[row[row.len() - 1] as usize] - p;
                for &j in row {
                    let to = positions[j as usize] - p;
                    normal += from.cross(to);
                    from = to;
                }
                normal.normalize_or_zero()
            },
        );
    }

    /// One round along the directions: solves the cubic and moves. Returns how far and the volume there, or `Err` with the present
    /// volume.
    pub(crate) fn offset(&self, positions: &mut [DVec3], reach: f64) -> Result<(f64, f64), f64> {
        let cubic = self.cubic(positions);
        let mut tau = 0.0;
        for _ in 0..32 {
            let step = (self.wanted - value(cubic, tau)) / slope(cubic, tau);
            if !step.is_finite() {
                return Err(cubic[0]);
            }
            tau += step;
            if tau.abs() > reach {
                return Err(cubic[0]);
            }
            if step.abs() <= 1e-16 * reach {
                break;
            }
        }
        in_chunks_mut(positions, |base, chunk| {
            chunk.iter_mut().zip(&self.directions[base..]).for_each(|(p, d)| *p += tau * *d);
        });
        Ok((tau, value(cubic, tau)))
    }
}
