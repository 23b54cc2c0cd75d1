//! One point inside each non-design part, joined to its interfaces, so that loops through the part close.

use crate::inside::Inside;
use crate::interface::Sets;
use crate::skeleton::{PointKind, Section, Skeleton};
use glam::DVec3;
use topipe_mesh::{Connectivity, Design, Part, TriangleMesh, VertexId};

/// Adds a point for every non-design set that has interfaces. `interface_points` holds the point of each interface.
pub(crate) fn join(
    skeleton: &mut Skeleton,
    part: &Part,
    connectivity: &Connectivity,
    sets: &Sets,
    inside: &Inside,
    interface_points: &[u32],
) {
    let holes = handles(part, connectivity, sets);
    skeleton.non_design_holes =
        sets.with_label(Design::NonDesign).map(|set| holes[set as usize] as usize).sum();
    for set in sets.with_label(Design::NonDesign) {
        let own: Vec<_> =
            (0..sets.interfaces.len()).filter(|&i| sets.interfaces[i].non_design == set).collect();
        let Some(&first) = own.first() else { continue };
        let (point, within) = middle(part, sets, set, &own, inside);
        let id = skeleton.add_point(point, PointKind::NonDesign, Section::None);
        for &i in &own {
            skeleton.add_edge(id, interface_points[i]);
        }
        if !within {
            let at = sets.interfaces[first].node_mean;
            skeleton.remarks.push(format!(
                "the non-design point near ({:.3}, {:.3}, {:.3}) lies outside the material: the labelled faces enclose none",
                at.x, at.y, at.z
            ));
        }
        if holes[set as usize] > 0 {
            skeleton.remarks.push(format!(
                "the non-design part at ({:.3}, {:.3}, {:.3}) has {}: the genus exceeds the cycles by as many",
                point.x,
                point.y,
                point.z,
                match holes[set as usize] {
                    1 => "a hole of its own".to_owned(),
                    holes => format!("{holes} holes of its own"),
                }
            ));
        }
    }
}

/// The genus of each set once its borders are closed.
fn handles(part: &Part, connectivity: &Connectivity, sets: &Sets) -> Vec<i64> {
    // Per set: vertices - edges + faces, with a vertex counted once per fan of the set's faces around it.
    let mut euler = vec![0i64; sets.label.len()];
    let mut borders = vec![0i64; sets.label.len()];
    for face in part.mesh.faces() {
        euler[sets.of_face[face.index()] as usize] += 1;
    }
    for h in connectivity.edges() {
        let (a, b) = (sets.of_face[h.face().index()], sets.of_face[connectivity.twin(h).face().index()]);
        euler[a as usize] -= 1;
        if a != b {
            euler[b as usize] -= 1;
        }
    }
    for v in part.mesh.vertices() {
        let around: Vec<_> = connectivity.outgoing(v).map(|h| sets.of_face[h.face().index()]).collect();
        let changes: Vec<_> =
            (0..around.len()).filter(|&k| around[k] != around[(k + 1) % around.len()]).collect();
        if changes.is_empty()
            && let Some(&set) = around.first()
        {
            euler[set as usize] += 1;
        }
        for k in changes {
            euler[around[k] as usize] += 1;
        }
    }
    // A loop is traced on the design side; where the non-design side touches itself in a vertex it has more loops
    // than that, which does not occur in what the tracing calls one interface.
    for interface in &sets.interfaces {
        borders[interface.non_design as usize] += 1;
        borders[sets.of_face[interface.half_edges[0].face().index()] as usize] += 1;
    }
    (0..euler.len()).map(|s| ((2 - euler[s] - borders[s]) / 2).max(0)).collect()
}

/// A point inside the part, and whether it is inside.
fn middle(part: &Part, sets: &Sets, set: u32, own: &[usize], inside: &Inside) -> (DVec3, bool) {
    let mesh = &part.mesh;
    let faces = sets.faces(set);
    // The part as a closed mesh: its faces and a fan over each interface.
    let mut closed = TriangleMesh { positions: mesh.positions.clone(), triangles: Vec::new() };
    closed.triangles.extend(faces.iter().map(|f| mesh.triangles[f.index()]));
    for &i in own {
        let interface = &sets.interfaces[i];
        let apex = VertexId::new(closed.positions.len());
        closed.positions.push(interface.node_mean);
        let n = interface.vertices.len();
        closed
            .triangles
            .extend((0..n).map(|k| [interface.vertices[k], interface.vertices[(k + 1) % n], apex]));
    }
    let about = sets.interfaces[own[0]].node_mean;
    let (mut volume, mut moment, mut area, mut surface) = (0.0, DVec3::ZERO, 0.0, DVec3::ZERO);
    for f in closed.faces() {
        let [a, b, c] = closed.corners(f).map(|p| p - about);
        let v = a.dot(b.cross(c)) / 6.0;
        volume += v;
        moment += v * (a + b + c) / 4.0;
        let t = (b - a).cross(c - a).length() / 2.0;
        area += t;
        surface += t * (a + b + c) / 3.0;
    }
    let center = about + if area > 0.0 { surface / area } else { DVec3::ZERO };
    let own_inside = Inside::new(&closed);
    let within = |p: DVec3| own_inside.contains(p) && inside.contains(p);
    let interface_mean = own.iter().map(|&i| sets.interfaces[i].node_mean).sum::<DVec3>() / own.len() as f64;
    let mut candidates = Vec::new();
    if volume > 1e-9 * area.powf(1.5) {
        candidates.push(about + moment / volume);
    }
    candidates.extend([center, interface_mean]);
    let tries = candidates.len();
    for k in 0..tries {
        candidates.extend(own_inside.nearest_middle(candidates[k]));
    }
    // A ring has its centroid in the hole: try below faces spread evenly over it.
    let stride = (faces.len() / 64).max(1);
    for f in faces.iter().step_by(stride) {
        let depth = mesh.area_vector(*f).length().sqrt();
        candidates.extend([0.5, 0.05].map(|d| mesh.centroid(*f) - d * depth * mesh.normal(*f)));
    }
    match candidates.iter().find(|&&p| within(p)) {
        Some(&p) => (p, true),
        // Labels on a surface without a body behind them: any point of the material will do, then any at all.
        None => match candidates.iter().find(|&&p| inside.contains(p)) {
            Some(&p) => (p, true),
            None => (center, false),
        },
    }
}
