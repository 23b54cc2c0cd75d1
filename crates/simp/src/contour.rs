//! The surface of a result: dual contouring (Ju and others 2002; Nielson 2004 for cells with several pieces of surface).
//!
//! What bounds the part is known exactly where it is not the density: planes and cylinders of the domain and of the non-design
//! solids. Each cell that the surface passes through gets a vertex, put by Newton's method where all faces meet that bound the
//! part in this cell. So walls of holes have the radius they were given, rims are sharp, and only the free surface is stepped
//! or interpolated.
//!
//! The corners are the middles of the cells of the optimization. Where the inside corners of a square lie across from each
//! other, one more corner is taken in, so that the surface is a manifold.

use crate::optimize::Densities;
use crate::shape::Face;
use crate::{Domain, SurfaceForm};
use std::collections::BTreeMap;
use topipe_mesh::{DMat3, DVec3, TriangleMesh, VertexId};

/// The field whose negative part is the result.
pub(crate) struct Field<'a> {
    domain: &'a Domain,
    form: SurfaceForm,
    threshold: f64,
    size: f64,
    /// Lowest corner and number of corners.
    origin: DVec3,
    corners: [usize; 3],
    /// Density of the design at the corners, carried on into what is not design.
    density: Vec<f64>,
}

/// What bounds the part at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Bound {
    Face(Face),
    Density,
}

impl<'a> Field<'a> {
    pub(crate) fn new(domain: &'a Domain, densities: &Densities, form: SurfaceForm, threshold: f64) -> Self {
        let grid = &densities.grid;
        // One corner beyond the grid on every side.
        let corners = grid.cells.map(|n| n + 2);
        let origin = grid.origin - DVec3::splat(0.5 * grid.size);
        let count = corners.iter().product();
        let mut field =
            Self { domain, form, threshold, size: grid.size, origin, corners, density: vec![0.0; count] };
        let mut known = vec![false; count];
        for k in 0..count {
            let at = field.place(k);
            let inside = (0..3).all(|d| at[d] > 0 && at[d] <= grid.cells[d]);
            let cell = inside.then(|| grid.index(at.map(|x| x.wrapping_sub(1))));
            let p = field.point(at);
            if let Some(cell) = cell.filter(|&cell| densities.fraction[cell] > 0.02)
                && domain.outside_non_design(p).0 >= 0.0
            {
                field.density[k] = f64::from(densities.density[cell]);
                known[k] = true;
            }
        }
        // Two steps outwards: as far as a cell reaches.
        for _ in 0..2 {
            let mut found = Vec::new();
            for k in (0..count).filter(|&k| !known[k]) {
                let near: Vec<f64> =
                    field.around(k).filter(|&n| known[n]).map(|n| field.density[n]).collect();
                if !near.is_empty() {
                    found.push((k, near.iter().sum::<f64>() / near.len() as f64));
                }
            }
            for (k, value) in found {
                field.density[k] = value;
                known[k] = true;
            }
        }
        field
    }

    fn place(&self, k: usize) -> [usize; 3] {
        let [nx, ny, _] = self.corners;
        [k % nx, k / nx % ny, k / nx / ny]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.corners[0] * (y + self.corners[1] * z)
    }

    fn point(&self, at: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(at.map(|x| x as f64)) * self.size
    }

    fn around(&self, k: usize) -> impl Iterator<Item = usize> + '_ {
        let at = self.place(k);
        (0..6).filter_map(move |side| {
            let (d, up) = (side / 2, side % 2 == 1);
            let mut next = at;
            next[d] = if up { at[d] + 1 } else { at[d].checked_sub(1)? };
            (next[d] < self.corners[d]).then(|| self.index(next))
        })
    }

    /// Density between the corners of the cell at `cell`, linear along each axis, and its gradient.
    fn interpolated(&self, cell: [usize; 3], p: DVec3) -> (f64, DVec3) {
        let t = (p - self.point(cell)) / self.size;
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        for n in 0..8 {
            let at = std::array::from_fn(|d| cell[d] + (n >> d & 1));
            let rho = self.density[self.index(at)];
            let factor: [f64; 3] = std::array::from_fn(|d| if n >> d & 1 == 1 { t[d] } else { 1.0 - t[d] });
            value += rho * factor[0] * factor[1] * factor[2];
            for d in 0..3 {
                let sign = if n >> d & 1 == 1 { 1.0 } else { -1.0 };
                gradient[d] += sign * rho * factor[(d + 1) % 3] * factor[(d + 2) % 3] / self.size;
            }
        }
        (value, gradient)
    }

    /// Which corners lie in the part.
    fn inside(&self) -> Vec<bool> {
        let count = self.density.len();
        let mut inside: Vec<bool> = (0..count)
            .map(|k| {
                let p = self.point(self.place(k));
                self.domain.outside(p).0 < 0.0
                    && (self.density[k] >= self.threshold || self.domain.outside_non_design(p).0 < 0.0)
            })
            .collect();
        // Squares with inside corners across from each other.
        loop {
            let mut taken = Vec::new();
            for k in 0..count {
                let at = self.place(k);
                for d in 0..3 {
                    let (e, f) = ((d + 1) % 3, (d + 2) % 3);
                    if at[e] + 1 >= self.corners[e] || at[f] + 1 >= self.corners[f] {
                        continue;
                    }
                    let corner = |i: usize, j: usize| {
                        let mut p = at;
                        p[e] += i;
                        p[f] += j;
                        self.index(p)
                    };
                    let square = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let [a, b, c, d] = square.map(|k| inside[k]);
                    if a == c && b == d && a != b {
                        let outside = if a { [square[1], square[3]] } else { [square[0], square[2]] };
                        // The one nearer to being part of it.
                        let rank = |k: usize| {
                            let out = self.domain.outside(self.point(self.place(k))).0.max(0.0) / self.size;
                            (out, -self.density[k], k)
                        };
                        let (p, q) = (rank(outside[0]), rank(outside[1]));
                        let first = p.0.total_cmp(&q.0).then(p.1.total_cmp(&q.1)).then(p.2.cmp(&q.2)).is_le();
                        taken.push(if first { outside[0] } else { outside[1] });
                    }
                }
            }
            if taken.is_empty() {
                return inside;
            }
            taken.into_iter().for_each(|k| inside[k] = true);
        }
    }

    /// Where the border crosses the edge from an inside to an outside corner, and what it is there.
    fn crossing(&self, inner: usize, outer: usize) -> (DVec3, Option<Bound>) {
        let [a, b] = [inner, outer].map(|k| self.point(self.place(k)));
        let [rho_a, rho_b] = [inner, outer].map(|k| self.density[k]);
        let at = |t: f64| a.lerp(b, t);
        let void = |t: f64| {
            let rho = match self.form {
                SurfaceForm::Iso => rho_a + t * (rho_b - rho_a),
                SurfaceForm::Threshold => {
                    if t < 0.5 {
                        rho_a
                    } else {
                        rho_b
                    }
                }
            };
            rho < self.threshold
        };
        let outside = |t: f64| self.domain.outside(at(t)).0 >= 0.0;
        let free = |t: f64| self.domain.outside_non_design(at(t)).0 >= 0.0;
        let out = |t: f64| outside(t) || (free(t) && void(t));
        if out(0.0) || !out(1.0) {
            // A corner that was taken in: nothing bounds the part here.
            return (at(0.5), None);
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..45 {
            let middle = 0.5 * (low + high);
            if out(middle) { high = middle } else { low = middle }
        }
        let p = at(0.5 * (low + high));
        let bound = if outside(high) {
            Bound::Face(self.domain.outside(p).1)
        } else if !free(low) {
            Bound::Face(self.domain.outside_non_design(p).1)
        } else {
            Bound::Density
        };
        (p, Some(bound))
    }

    /// The surface, closed and oriented, and for each vertex how many faces were known to meet there.
    pub(crate) fn contour(&self) -> TriangleMesh {
        let inside = self.inside();
        let mut crossings: BTreeMap<(usize, usize), (DVec3, Option<Bound>)> = BTreeMap::new();
        let mut vertices: BTreeMap<(usize, usize, usize), VertexId> = BTreeMap::new();
        let mut mesh = TriangleMesh::default();
        let mut sharp: Vec<usize> = Vec::new();
        // Each grid edge with a crossing, in the order of its lower corner and direction.
        for k in 0..inside.len() {
            for d in 0..3 {
                let mut next = self.place(k);
                next[d] += 1;
                if next[d] >= self.corners[d] {
                    continue;
                }
                let other = self.index(next);
                if inside[k] != inside[other] {
                    let (inner, outer) = if inside[k] { (k, other) } else { (other, k) };
                    crossings.insert((k, d), self.crossing(inner, outer));
                }
            }
        }
        for cell in 0..inside.len() {
            let at = self.place(cell);
            if (0..3).any(|d| at[d] + 1 >= self.corners[d]) {
                continue;
            }
            for piece in self.pieces(at, &inside) {
                let points: Vec<_> = piece.iter().filter_map(|edge| crossings.get(edge)).collect();
                let (position, count) = self.vertex(at, &points);
                let id = VertexId::new(mesh.positions.len());
                mesh.positions.push(position);
                sharp.push(count);
                for &(corner, d) in &piece {
                    vertices.insert((cell, corner, d), id);
                }
            }
        }
        for &(k, d) in crossings.keys() {
            let at = self.place(k);
            let (e, f) = ((d + 1) % 3, (d + 2) % 3);
            let beside = |i: usize, j: usize| {
                let mut cell = at;
                cell[e] = at[e].checked_sub(i)?;
                cell[f] = at[f].checked_sub(j)?;
                vertices.get(&(self.index(cell), k, d)).copied()
            };
            let (Some(a), Some(b), Some(c), Some(d)) =
                (beside(1, 1), beside(0, 1), beside(0, 0), beside(1, 0))
            else {
                continue;
            };
            // Seen from the far end of the edge these go around counterclockwise.
            let quad = if inside[k] { [a, b, c, d] } else { [d, c, b, a] };
            let p = quad.map(|v| mesh.positions[v.index()]);
            let edge = |i: usize, j: usize| sharp[quad[i].index()].min(sharp[quad[j].index()]);
            // Along a sharp edge where there is one, else the shorter way.
            let straight = match edge(0, 2).max(1).cmp(&edge(1, 3).max(1)) {
                std::cmp::Ordering::Greater => true,
                std::cmp::Ordering::Less => false,
                std::cmp::Ordering::Equal => p[0].distance_squared(p[2]) <= p[1].distance_squared(p[3]),
            };
            let [a, b, c, d] = quad;
            let pair = if straight { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            mesh.triangles.extend(pair);
        }
        mesh
    }

    /// The pieces of surface in a cell, each as the grid edges (lower corner, direction) that it crosses.
    fn pieces(&self, at: [usize; 3], inside: &[bool]) -> Vec<Vec<(usize, usize)>> {
        let corner = |n: usize| self.index(std::array::from_fn(|d| at[d] + (n >> d & 1)));
        let signs: [bool; 8] = std::array::from_fn(|n| inside[corner(n)]);
        if signs.iter().all(|&s| s == signs[0]) {
            return Vec::new();
        }
        // Inside corners joined by edges of the cell, and outside ones, are components; a piece of surface lies between one of
        // the ones and one of the others.
        let mut component: [usize; 8] = std::array::from_fn(|n| n);
        for _ in 0..4 {
            for n in 0..8 {
                for d in 0..3 {
                    let m = n ^ (1 << d);
                    if signs[n] == signs[m] {
                        let least = component[n].min(component[m]);
                        (component[n], component[m]) = (least, least);
                    }
                }
            }
        }
        let mut pieces: BTreeMap<(usize, usize), Vec<(usize, usize)>> = BTreeMap::new();
        for n in 0..8 {
            for d in 0..3 {
                let m = n | (1 << d);
                if n != m && signs[n] != signs[m] {
                    let (inner, outer) = if signs[n] { (n, m) } else { (m, n) };
                    pieces.entry((component[inner], component[outer])).or_default().push((corner(n), d));
                }
            }
        }
        pieces.into_values().collect()
    }

    /// The vertex of a piece of surface, and how many different faces bound the part there.
    fn vertex(&self, cell: [usize; 3], crossings: &[&(DVec3, Option<Bound>)]) -> (DVec3, usize) {
        let mean = crossings.iter().map(|c| c.0).sum::<DVec3>() / crossings.len().max(1) as f64;
        let mut faces: Vec<Face> = Vec::new();
        let mut density = false;
        for (p, bound) in crossings {
            match bound {
                Some(Bound::Face(face)) => {
                    let same = |other: &Face| {
                        other.normal(*p).dot(face.normal(*p)).abs() > 1.0 - 1e-9
                            && other.distance(*p).abs() < 1e-6 * self.size
                    };
                    if !faces.iter().any(same) {
                        faces.push(*face);
                    }
                }
                Some(Bound::Density) => density = true,
                None => {}
            }
        }
        let smooth = density && self.form == SurfaceForm::Iso;
        let count = faces.len() + usize::from(density);
        let middle = self.point(cell) + DVec3::splat(0.5 * self.size);
        let near = |p: DVec3| p.is_finite() && (p - middle).abs().max_element() <= 0.8 * self.size;
        // All faces, then those of solids alone, then the first alone.
        for (faces, smooth) in
            [(&faces[..], smooth), (&faces[..], false), (&faces[..faces.len().min(1)], false)]
        {
            let p = self.meet(cell, mean, faces, smooth);
            if near(p) {
                return (p, count);
            }
        }
        (mean, count)
    }

    /// The point nearest to `start`, about, where all faces and the density surface meet.
    fn meet(&self, cell: [usize; 3], start: DVec3, faces: &[Face], smooth: bool) -> DVec3 {
        let mut p = start;
        for _ in 0..12 {
            let (mut matrix, mut right) = (DMat3::from_diagonal(DVec3::splat(1e-9)), DVec3::ZERO);
            let mut add = |normal: DVec3, distance: f64| {
                matrix += DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                right -= normal * distance;
            };
            faces.iter().for_each(|face| add(face.normal(p), face.distance(p)));
            if smooth {
                let (value, gradient) = self.interpolated(cell, p);
                let steep = gradient.length();
                if steep > 1e-6 / self.size {
                    add(-gradient / steep, (self.threshold - value) / steep);
                }
            }
            let step = matrix.inverse() * right;
            p += step;
            if step.length() <= 1e-14 * self.size {
                break;
            }
        }
        p
    }
}
