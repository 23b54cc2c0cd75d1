//! The source's fit: patches that meet without gaps, but not with common tangents.
//!
//! Source, section 2.3, after Mosbach et al. 2022: first the control points at the corners, then those along the
//! edges, then those inside. Each is found from a small least-squares problem over the patches around it, whose
//! other unknowns are solved for and thrown away; what an earlier step found is fixed in the later ones. All
//! problems of a step are independent of each other.
//!
//! Vertices the mesh holds frozen stay where they are, and edges on a feature are fitted to the feature alone: that
//! is what keeps rims round and flat faces flat.

use crate::cholesky::Symmetric;
use crate::energy::{Energy, Gram, energy};
use crate::samples::{PatchSamples, arc_length};
use crate::unknowns::Unknowns;
use crate::{Basis, CurveShape, EdgeCurve, Parameters, Patch, PatchSide, SplineFitError, SplineSurface};
use rayon::prelude::*;
use std::collections::BTreeMap;
use topipe_mesh::DVec3;
use topipe_progress::Progress;
use topipe_quad_matching::QuadLayout;

/// Fits a surface whose patches meet without gaps, but not with common tangents.
pub(crate) fn fit(
    layout: &QuadLayout,
    mut samples: Vec<PatchSamples>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<SplineSurface, SplineFitError> {
    let basis = parameters.basis()?;
    let rounds = u64::from(parameters.foot_point_rounds) + 1;
    let mut surface = solve(layout, &basis, &samples, parameters, progress)?;
    progress.step(1, rounds, "rounds");
    for round in 1..rounds {
        samples.par_iter_mut().zip(&surface.patches).for_each(|(samples, patch)| {
            crate::foot_points::correct(samples, |u, v| patch.evaluate(u, v));
        });
        surface = solve(layout, &basis, &samples, parameters, progress)?;
        progress.step(round + 1, rounds, "rounds");
    }
    let connectivity = crate::borders::connectivity(layout)?;
    crate::adapt::adapt(&mut surface, crate::borders::borders(layout, &connectivity)?)
        .ok_or_else(|| SplineFitError::Layout("knots of edges do not fit".into()))?;
    Ok(surface)
}

/// A least-squares problem over a few patches: the unknowns among their control points that are not known yet.
fn solve_group(
    patches: &[usize],
    unknowns: &Unknowns<'_>,
    energies: &[Energy],
    known: &[Option<DVec3>],
) -> Option<BTreeMap<usize, DVec3>> {
    let numbers: Vec<Vec<usize>> = patches.iter().map(|&q| unknowns.of_patch(q)).collect();
    let mut place: BTreeMap<usize, usize> = BTreeMap::new();
    for &number in numbers.iter().flatten() {
        if known[number].is_none() {
            place.insert(number, 0);
        }
    }
    for (k, slot) in place.values_mut().enumerate() {
        *slot = k;
    }
    let mut matrix = Symmetric::zero(place.len());
    let mut right = vec![DVec3::ZERO; place.len()];
    let total: f64 = patches.iter().map(|&q| energies[q].area).sum();
    for (&quad, numbers) in patches.iter().zip(&numbers) {
        let e = &energies[quad];
        let weight = e.area / total;
        // Unknowns of this patch, resolved once.
        let slots: Vec<Option<usize>> = numbers.iter().map(|number| place.get(number).copied()).collect();
        for a in 0..numbers.len() {
            let Some(row) = slots[a] else { continue };
            right[row] += weight * e.right[a];
            for b in 0..numbers.len() {
                let value = weight * e.matrix.get(a, b);
                match (slots[b], known[numbers[b]]) {
                    // Each pair comes twice; its lower half is enough.
                    (Some(column), _) if column <= row => matrix.add(row, column, value),
                    (Some(_), _) => {}
                    (None, Some(point)) => right[row] -= value * point,
                    (None, None) => return None,
                }
            }
        }
    }
    matrix.solve(&mut right)?;
    Some(place.into_iter().map(|(number, k)| (number, right[k])).collect())
}

fn solve(
    layout: &QuadLayout,
    basis: &Basis,
    samples: &[PatchSamples],
    parameters: &Parameters,
    progress: &Progress,
) -> Result<SplineSurface, SplineFitError> {
    let n = basis.len();
    let gram = Gram::new(basis);
    let unknowns = Unknowns::new(layout, n);
    let energies: Vec<Energy> =
        samples.par_iter().map(|s| energy(basis, &gram, s, parameters.lambda)).collect();
    progress.check()?;
    let mesh = &layout.part.mesh;
    let mut known: Vec<Option<DVec3>> = vec![None; unknowns.count()];
    let singular =
        |what, index: usize, at: DVec3| SplineFitError::Singular { what, index, x: at.x, y: at.y, z: at.z };

    // Corners.
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); layout.vertices.len()];
    for quad in 0..layout.quads.len() {
        for corner in layout.corners(quad) {
            if around[corner as usize].last() != Some(&quad) {
                around[corner as usize].push(quad);
            }
        }
    }
    let mut on_feature = vec![false; layout.vertices.len()];
    for edge in layout.edges.iter().filter(|e| e.feature.is_some()) {
        edge.ends.iter().for_each(|&v| on_feature[v as usize] = true);
    }
    let corners: Vec<DVec3> = (0..layout.vertices.len())
        .into_par_iter()
        .map(|v| {
            let vertex = layout.vertices[v];
            let position = mesh.position(vertex);
            if layout.part.frozen[vertex.index()] || on_feature[v] || around[v].is_empty() {
                return Ok(position);
            }
            solve_group(&around[v], &unknowns, &energies, &known)
                .and_then(|found| found.get(&v).copied())
                .ok_or_else(|| singular("vertex", v, position))
        })
        .collect::<Result<_, SplineFitError>>()?;
    for (v, corner) in corners.into_iter().enumerate() {
        known[v] = Some(corner);
    }
    progress.check()?;

    // Edges.
    let mut beside: Vec<Vec<usize>> = vec![Vec::new(); layout.edges.len()];
    for (quad, sides) in layout.quads.iter().enumerate() {
        for side in sides {
            if beside[side.edge as usize].last() != Some(&quad) {
                beside[side.edge as usize].push(quad);
            }
        }
    }
    let curves: Vec<Vec<DVec3>> = (0..layout.edges.len())
        .into_par_iter()
        .map(|e| {
            let edge = &layout.edges[e];
            if edge.feature.is_some() {
                let points: Vec<DVec3> = edge.path.iter().map(|&v| mesh.position(v)).collect();
                let ends = edge.ends.map(|v| known[v as usize].unwrap_or(points[0]));
                // A feature is free of noise: bend as little against it as keeps the equations regular.
                let lambda = 1.0 - (1.0 - parameters.lambda) * 1e-4;
                return fit_curve(basis, &gram, &points, ends, lambda)
                    .ok_or_else(|| singular("edge", e, points[0]));
            }
            if beside[e].is_empty() {
                // Between two region faces.
                let ends = edge.ends.map(|v| known[v as usize].unwrap_or_default());
                return Ok((1..n - 1).map(|m| ends[0].lerp(ends[1], m as f64 / (n - 1) as f64)).collect());
            }
            let found = solve_group(&beside[e], &unknowns, &energies, &known);
            (1..n - 1)
                .map(|m| found.as_ref().and_then(|found| found.get(&unknowns.edge(e, m)).copied()))
                .collect::<Option<Vec<DVec3>>>()
                .ok_or_else(|| singular("edge", e, mesh.position(edge.path[0])))
        })
        .collect::<Result<_, SplineFitError>>()?;
    for (e, curve) in curves.into_iter().enumerate() {
        for (m, point) in curve.into_iter().enumerate() {
            known[unknowns.edge(e, m + 1)] = Some(point);
        }
    }
    progress.check()?;

    // Insides.
    let inner: Vec<BTreeMap<usize, DVec3>> = (0..layout.quads.len())
        .into_par_iter()
        .map(|quad| {
            solve_group(&[quad], &unknowns, &energies, &known).ok_or_else(|| {
                singular("patch", quad, mesh.position(layout.vertices[layout.corners(quad)[0] as usize]))
            })
        })
        .collect::<Result<_, SplineFitError>>()?;
    for (number, point) in inner.into_iter().flatten() {
        known[number] = Some(point);
    }

    let control: Vec<DVec3> = known.into_iter().map(|point| point.unwrap_or(DVec3::NAN)).collect();
    Ok(SplineSurface {
        vertices: control[..layout.vertices.len()].to_vec(),
        edges: layout
            .edges
            .iter()
            .enumerate()
            .map(|(e, edge)| EdgeCurve {
                ends: edge.ends,
                basis: basis.clone(),
                control: (0..n).map(|m| control[unknowns.edge(e, m)]).collect(),
                feature: edge.feature,
                shape: CurveShape::Spline,
            })
            .collect(),
        patches: (0..layout.quads.len())
            .map(|quad| Patch {
                sides: layout.quads[quad].map(|s| PatchSide { edge: s.edge, reversed: s.reversed }),
                basis_u: basis.clone(),
                basis_v: basis.clone(),
                control: unknowns.of_patch(quad).into_iter().map(|number| control[number]).collect(),
            })
            .collect(),
        faces: Vec::new(),
        tolerance: None,
        tolerance_mm: None,
    })
}

/// Fits a curve with fixed ends to a polyline by arc length; returns its inner control points.
fn fit_curve(
    basis: &Basis,
    gram: &Gram,
    points: &[DVec3],
    ends: [DVec3; 2],
    lambda: f64,
) -> Option<Vec<DVec3>> {
    let n = basis.len();
    let along = arc_length(points);
    // As in a patch, the polyline counts by its length and not by its vertices; its pieces are sampled inside.
    let mut matrix = Symmetric::zero(n - 2);
    let mut right = vec![DVec3::ZERO; n - 2];
    let mut add = |i: usize, j: usize, value: f64| {
        let inner = |k: usize| (1..n - 1).contains(&k).then(|| k - 1);
        let end = |k: usize| if k == 0 { ends[0] } else { ends[1] };
        match (inner(i), inner(j)) {
            (Some(a), Some(b)) if b <= a => matrix.add(a, b, value),
            (Some(a), None) => right[a] -= value * end(j),
            _ => {}
        }
    };
    let mut loads: Vec<(usize, DVec3)> = Vec::new();
    for k in 0..points.len() - 1 {
        for x in [0.0, 0.25, 0.5, 0.75] {
            let t = along[k] + x * (along[k + 1] - along[k]);
            // Vertices lie on the feature, points between them on chords: they only steady long pieces.
            let share = (along[k + 1] - along[k]) * if x == 0.0 { 1.0 } else { 1e-3 };
            let point = points[k].lerp(points[k + 1], x);
            let local = basis.evaluate(t);
            for a in 0..local.count {
                let scaled = lambda * share * local.derivatives[0][a];
                loads.push((local.first + a, scaled * point));
                for b in 0..local.count {
                    add(local.first + a, local.first + b, scaled * local.derivatives[0][b]);
                }
            }
        }
    }
    for i in 0..n {
        for j in 0..n {
            add(i, j, (1.0 - lambda) * gram.bending(i, j));
        }
    }
    for (number, load) in loads {
        if (1..n - 1).contains(&number) {
            right[number - 1] += load;
        }
    }
    matrix.solve(&mut right)?;
    Some(right)
}
