//! The skeleton: how well it is centred, and whether its loops are those of the part.

mod bounding_sphere;
mod centeredness;
mod section;

pub use bounding_sphere::bounding_sphere;
pub use centeredness::{BranchPoint, off_center};

use crate::{SkeletonFigures, ValidationError, topology};
use std::collections::BTreeMap;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, Part};
use topipe_progress::Progress;
use topipe_skeleton::{PointKind, Skeleton};

pub(crate) fn figures(
    skeleton: &Skeleton,
    part: &Part,
    index: &SurfaceIndex,
    progress: &Progress,
) -> Result<SkeletonFigures, ValidationError> {
    let count = skeleton.points.len();
    let refuse = |problem: String| Err(ValidationError::artifact("skeleton", problem));
    if skeleton.kinds.len() != count {
        return refuse(format!("it has {count} points and {} kinds", skeleton.kinds.len()));
    }
    if let Some(p) = skeleton.points.iter().position(|p| !p.is_finite()) {
        return refuse(format!("point {p} is not finite"));
    }
    let mut neighbors = vec![Vec::new(); count];
    let mut edges = skeleton.edges.clone();
    edges.iter_mut().for_each(|edge| edge.sort_unstable());
    edges.sort_unstable();
    edges.dedup();
    for &[a, b] in &edges {
        if a.max(b) as usize >= count || a == b {
            return refuse(format!("edge {a}-{b} does not join two of its {count} points"));
        }
        neighbors[a as usize].push(b as usize);
        neighbors[b as usize].push(a as usize);
    }

    let samples: Vec<BranchPoint> =
        branch_points(skeleton, &neighbors).into_iter().map(|(_, sample)| sample).collect();
    let radius = bounding_sphere(&part.mesh.positions).1;
    let clip = largest_interface_radius(part);
    progress.check()?;
    let off = off_center(&part.mesh, index, &samples, clip);
    progress.check()?;
    let mean = |weight: fn(&BranchPoint) -> f64| {
        let total: f64 = samples.iter().map(weight).sum();
        let sum: f64 = samples.iter().zip(&off).map(|(s, off)| weight(s) * off).sum();
        (total > 0.0 && radius > 0.0).then(|| sum / total / radius)
    };
    let components = components(&neighbors);
    let degree = |wanted: fn(usize) -> bool| neighbors.iter().filter(|n| wanted(n.len())).count();
    let outside =
        |p: &usize| skeleton.kinds[*p] != PointKind::NonDesign && !index.contains(skeleton.points[*p]);
    Ok(SkeletonFigures {
        compactness: samples.len(),
        e_center: mean(|_| 1.0),
        e_center_by_length: mean(|s| s.length),
        out_of_object: (0..count).filter(outside).count(),
        junctions: degree(|d| d > 2),
        branches: branches(&neighbors),
        cycles: edges.len() as i64 - count as i64 + components as i64,
        genus: topology::count(&part.mesh).genus,
        non_design_holes: skeleton.non_design_holes,
        components,
        free_ends: degree(|d| d == 1),
        length_mm: edges
            .iter()
            .map(|&[a, b]| skeleton.points[a as usize].distance(skeleton.points[b as usize]))
            .sum(),
        beam_share: beam_share(skeleton, &edges),
    })
}

/// How much of the skeleton outside of non-design parts lies on branches.
fn beam_share(skeleton: &Skeleton, edges: &[[u32; 2]]) -> Option<f64> {
    let (mut beams, mut whole) = (0.0, 0.0);
    for ends in edges {
        let kinds = ends.map(|end| skeleton.kinds[end as usize]);
        if !kinds.contains(&PointKind::NonDesign) {
            let [a, b] = ends.map(|end| skeleton.points[end as usize]);
            let on_branch = kinds.iter().filter(|kind| **kind == PointKind::Branch).count();
            beams += on_branch as f64 / 2.0 * a.distance(b);
            whole += a.distance(b);
        }
    }
    (whole > 0.0).then(|| beams / whole)
}

/// How far each point of a branch is from the middle of its section, mm, in the order of the points: what E_center is the
/// mean of, before it is divided by the radius of the bounding sphere. `index` is that of the part's mesh. Nothing for a
/// skeleton with indices out of range.
pub fn off_center_of_points(skeleton: &Skeleton, part: &Part, index: &SurfaceIndex) -> Vec<(usize, f64)> {
    let count = skeleton.points.len();
    let fits = |edge: &[u32; 2]| edge[0] != edge[1] && edge.iter().all(|&p| (p as usize) < count);
    if skeleton.kinds.len() != count || !skeleton.edges.iter().all(fits) {
        return Vec::new();
    }
    let mut neighbors = vec![Vec::new(); count];
    for &[a, b] in &skeleton.edges {
        neighbors[a as usize].push(b as usize);
        neighbors[b as usize].push(a as usize);
    }
    let (points, samples): (Vec<usize>, Vec<BranchPoint>) =
        branch_points(skeleton, &neighbors).into_iter().unzip();
    let off = off_center(&part.mesh, index, &samples, largest_interface_radius(part));
    points.into_iter().zip(off).collect()
}

/// Points on branches with a neighbour on either side: their tangents are the chords between the neighbours.
fn branch_points(skeleton: &Skeleton, neighbors: &[Vec<usize>]) -> Vec<(usize, BranchPoint)> {
    let points = &skeleton.points;
    let mut samples = Vec::new();
    for (p, kind) in skeleton.kinds.iter().enumerate() {
        if let (PointKind::Branch, &[a, b]) = (kind, &neighbors[p][..])
            && let Some(tangent) = (points[b] - points[a]).try_normalize()
        {
            let length = (points[a].distance(points[p]) + points[p].distance(points[b])) / 2.0;
            samples.push((p, BranchPoint { position: points[p], tangent, length }));
        }
    }
    samples
}

fn components(neighbors: &[Vec<usize>]) -> usize {
    let mut seen = vec![false; neighbors.len()];
    let mut count = 0;
    for start in 0..neighbors.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        count += 1;
        let mut stack = vec![start];
        while let Some(p) = stack.pop() {
            for &q in &neighbors[p] {
                if !std::mem::replace(&mut seen[q], true) {
                    stack.push(q);
                }
            }
        }
    }
    count
}

/// Chains of edges between points that are not of degree two, and closed chains.
fn branches(neighbors: &[Vec<usize>]) -> usize {
    let ends: usize = neighbors.iter().map(Vec::len).filter(|&d| d != 2).sum();
    // What is reached from points of other degrees lies on open chains; the rest are closed ones.
    let mut closed = neighbors.to_vec();
    let mut stack: Vec<usize> = (0..closed.len()).filter(|&p| closed[p].len() != 2).collect();
    let mut seen = vec![false; closed.len()];
    while let Some(p) = stack.pop() {
        if !std::mem::replace(&mut seen[p], true) {
            stack.extend(&neighbors[p]);
        }
    }
    for p in 0..closed.len() {
        if seen[p] {
            closed[p].clear();
        }
    }
    ends / 2 + components(&closed) - seen.iter().filter(|&&s| s).count()
}

/// The largest distance of a point of a border between design and non-design from the mean of that border's points.
fn largest_interface_radius(part: &Part) -> Option<f64> {
    let is_non_design = |design: &topipe_mesh::Design| *design == topipe_mesh::Design::NonDesign;
    // Only edges between vertices that both have at their faces lie on such a border.
    let mut met = vec![[false; 2]; part.mesh.vertex_count()];
    for (triangle, design) in part.mesh.triangles.iter().zip(&part.design) {
        triangle.iter().for_each(|v| met[v.index()][usize::from(is_non_design(design))] = true);
    }
    let mut sides: BTreeMap<(u32, u32), Vec<bool>> = BTreeMap::new();
    for (triangle, design) in part.mesh.triangles.iter().zip(&part.design) {
        for k in 0..3 {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            if ends.iter().all(|v| met[v.index()] == [true; 2]) {
                let [a, b] = ends.map(|v| v.0);
                sides.entry((a.min(b), a.max(b))).or_default().push(is_non_design(design));
            }
        }
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ((a, b), labels) in sides {
        if labels.iter().any(|l| *l != labels[0]) {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
    }
    let mut largest = None;
    while let Some((&start, _)) = next.first_key_value() {
        let (mut border, mut stack): (Vec<DVec3>, _) = (Vec::new(), vec![start]);
        while let Some(v) = stack.pop() {
            if let Some(ahead) = next.remove(&v) {
                border.push(part.mesh.position(topipe_mesh::VertexId(v)));
                stack.extend(ahead);
            }
        }
        let mean = border.iter().sum::<DVec3>() / border.len() as f64;
        let radius = border.iter().map(|p| p.distance(mean)).fold(0.0, f64::max);
        largest = Some(radius.max(largest.unwrap_or(0.0)));
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(points: usize, edges: &[[usize; 2]]) -> Vec<Vec<usize>> {
        let mut neighbors = vec![Vec::new(); points];
        for &[a, b] in edges {
            neighbors[a].push(b);
            neighbors[b].push(a);
        }
        neighbors
    }

    #[test]
    fn branches_and_components_of_small_graphs() {
        let chain = graph(4, &[[0, 1], [1, 2], [2, 3]]);
        assert_eq!((branches(&chain), components(&chain)), (1, 1));
        let star = graph(7, &[[0, 1], [1, 2], [0, 3], [3, 4], [0, 5], [5, 6]]);
        assert_eq!((branches(&star), components(&star)), (3, 1));
        let ring_and_point = graph(4, &[[0, 1], [1, 2], [2, 0]]);
        assert_eq!((branches(&ring_and_point), components(&ring_and_point)), (1, 2));
        let two_rings_and_a_bar = graph(8, &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [6, 7]]);
        assert_eq!((branches(&two_rings_and_a_bar), components(&two_rings_and_a_bar)), (3, 3));
        assert_eq!((branches(&[]), components(&[])), (0, 0));
    }
}
