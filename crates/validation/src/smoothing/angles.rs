//! Dihedral angles of the smoothed part beside those of the original, folds, crossings, and the kink at the border of
//! what was frozen.

use crate::{DihedralFigures, KinkFigures, ShapeFigures};
use topipe_mesh::spatial::crossings;
use topipe_mesh::{Connectivity, DVec3, FaceId, Part, TriangleMesh};

/// A face is folded when its normal is further than this from the mean of its neighbours': cosine of 120 degrees.
const FOLDED: f64 = -0.5;

pub(super) fn figures(original: &Part, part: &Part) -> Option<ShapeFigures> {
    let connectivity = Connectivity::build(&part.mesh).ok()?;
    let same_triangles = original.mesh.triangles == part.mesh.triangles;
    let before = same_triangles.then(|| dihedral(&original.mesh, part, &connectivity));
    let kink_before = same_triangles.then(|| kink(part, &original.mesh, &connectivity)).flatten();
    Some(ShapeFigures {
        before,
        after: dihedral(&part.mesh, part, &connectivity),
        kink_before,
        kink_after: kink(part, &part.mesh, &connectivity),
        self_intersections: crossings(&part.mesh).len(),
    })
}

/// The angle between the normals across each edge, degrees.
fn angles<'a>(
    normals: &'a [DVec3],
    connectivity: &'a Connectivity,
) -> impl Iterator<Item = (FaceId, FaceId, f64)> + 'a {
    connectivity.edges().filter_map(move |h| {
        let twin = connectivity.twin(h);
        twin.is_some().then(|| {
            let (f, g) = (h.face(), twin.face());
            (f, g, normals[f.index()].angle_between(normals[g.index()]).to_degrees())
        })
    })
}

/// `part` says which vertices of `mesh` are held.
fn dihedral(mesh: &TriangleMesh, part: &Part, connectivity: &Connectivity) -> DihedralFigures {
    let normals: Vec<DVec3> = mesh.faces().map(|f| mesh.normal(f)).collect();
    let mut figures = DihedralFigures {
        max_deg: 0.0,
        histogram: [0; 18],
        folded_faces: 0,
        folded_held: 0,
        folded_sliding: 0,
    };
    let still = |f: FaceId| mesh.triangles[f.index()].iter().all(|v| part.frozen[v.index()]);
    // What is on a region and not held slides on it.
    let mut bound = part.frozen.clone();
    for (t, region) in mesh.triangles.iter().zip(&part.region_of_face) {
        if region.is_some() {
            t.iter().for_each(|v| bound[v.index()] = true);
        }
    }
    let is_bound = |f: FaceId| mesh.triangles[f.index()].iter().all(|v| bound[v.index()]);
    for (_, _, angle) in angles(&normals, connectivity).filter(|a| a.2.is_finite()) {
        figures.max_deg = figures.max_deg.max(angle);
        figures.histogram[((angle / 10.0) as usize).min(17)] += 1;
    }
    for f in mesh.faces() {
        let neighbors = || (0..3).map(|k| connectivity.neighbor(f, k)).filter(|g| g.is_some());
        let around: DVec3 = neighbors().map(|g| normals[g.index()]).sum();
        if normals[f.index()].dot(around.normalize_or_zero()) < FOLDED {
            figures.folded_faces += 1;
            if still(f) && neighbors().all(still) {
                figures.folded_held += 1;
            } else if is_bound(f) && neighbors().all(is_bound) {
                figures.folded_sliding += 1;
            }
        }
    }
    figures
}

/// Over the edges between a face of which no vertex moves and one that moves.
fn kink(part: &Part, mesh: &TriangleMesh, connectivity: &Connectivity) -> Option<KinkFigures> {
    let normals: Vec<DVec3> = mesh.faces().map(|f| mesh.normal(f)).collect();
    let still = |f: FaceId| mesh.triangles[f.index()].iter().all(|v| part.frozen[v.index()]);
    let mut kinks: Vec<f64> = angles(&normals, connectivity)
        .filter(|&(f, g, angle)| angle.is_finite() && still(f) != still(g))
        .map(|(.., angle)| angle)
        .collect();
    kinks.sort_by(f64::total_cmp);
    let at = |share: f64| kinks[((kinks.len() - 1) as f64 * share) as usize];
    (!kinks.is_empty()).then(|| KinkFigures {
        edges: kinks.len(),
        median_deg: at(0.5),
        p90_deg: at(0.9),
        max_deg: at(1.0),
    })
}
