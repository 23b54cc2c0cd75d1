//! Puts the exact borders into a surface that was fitted without them.

use crate::borders::Borders;
use crate::{Basis, EdgeCurve, SplineSurface};
use topipe_mesh::DVec3;

/// The control points of the same curve over a basis with more knots.
fn refined(basis: &Basis, control: &[DVec3], finer: &Basis) -> Vec<DVec3> {
    let p = basis.degree();
    let (mut knots, mut control) = (basis.knots().to_vec(), control.to_vec());
    let mut k = 0;
    for &t in finer.knots() {
        if k < knots.len() && knots[k] == t {
            k += 1;
            continue;
        }
        // Boehm 1980.
        let span = knots.partition_point(|&x| x <= t) - 1;
        let mut next = Vec::with_capacity(control.len() + 1);
        for i in 0..=control.len() {
            next.push(if i + p <= span {
                control[i]
            } else if i > span {
                control[i - 1]
            } else {
                let a = (t - knots[i]) / (knots[i + p] - knots[i]);
                control[i - 1].lerp(control[i], a)
            });
        }
        control = next;
        knots.insert(span + 1, t);
        k += 1;
    }
    control
}

fn union(a: &Basis, b: &Basis) -> Option<Basis> {
    let p = a.degree();
    let inner = |x: &Basis| x.knots()[p + 1..x.knots().len() - p - 1].to_vec();
    let (x, y) = (inner(a), inner(b));
    let (mut i, mut j, mut all) = (0, 0, Vec::new());
    while i < x.len() || j < y.len() {
        let (s, t) = (x.get(i).copied().unwrap_or(2.0), y.get(j).copied().unwrap_or(2.0));
        all.push(s.min(t));
        i += usize::from(s <= t);
        j += usize::from(t <= s);
    }
    Basis::clamped(p, &all)
}

/// Replaces vertices and edges on borders, and the border rows of the patches.
pub(crate) fn adapt(surface: &mut SplineSurface, borders: Borders) -> Option<()> {
    for (place, exact) in surface.vertices.iter_mut().zip(&borders.vertices) {
        *place = exact.unwrap_or(*place);
    }
    for (edge, exact) in surface.edges.iter_mut().zip(borders.curves) {
        if let Some(exact) = exact {
            *edge = exact;
        }
        let last = edge.control.len() - 1;
        edge.control[0] = surface.vertices[edge.ends[0] as usize];
        edge.control[last] = surface.vertices[edge.ends[1] as usize];
    }
    for patch in &mut surface.patches {
        let curve = |k: usize| -> &EdgeCurve { &surface.edges[patch.sides[k].edge as usize] };
        let u = union(&union(&patch.basis_u, &curve(0).basis)?, &curve(2).basis)?;
        let v = union(&union(&patch.basis_v, &curve(1).basis)?, &curve(3).basis)?;
        let (n, m) = (patch.basis_u.len(), patch.basis_v.len());
        let rows: Vec<Vec<DVec3>> =
            (0..m).map(|j| refined(&patch.basis_u, &patch.control[j * n..(j + 1) * n], &u)).collect();
        let n = u.len();
        let mut control = vec![DVec3::ZERO; n * v.len()];
        for i in 0..n {
            let column: Vec<DVec3> = rows.iter().map(|row| row[i]).collect();
            for (j, p) in refined(&patch.basis_v, &column, &v).into_iter().enumerate() {
                control[i + j * n] = p;
            }
        }
        let m = v.len();
        for k in 0..4 {
            let basis = if k % 2 == 0 { &u } else { &v };
            let mut row = refined(&curve(k).basis, &curve(k).control, basis);
            if patch.sides[k].reversed != (k >= 2) {
                row.reverse();
            }
            for (at, p) in row.into_iter().enumerate() {
                let (i, j) = [(at, 0), (n - 1, at), (at, m - 1), (0, at)][k];
                control[i + j * n] = p;
            }
        }
        (patch.basis_u, patch.basis_v, patch.control) = (u, v, control);
    }
    surface.faces = borders.faces;
    crate::simplify::simplify(surface, borders.tolerance);
    Some(())
}
