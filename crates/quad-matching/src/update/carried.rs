//! An earlier layout on the part as it is now, and what of it does not fit any more.

use super::Earlier;
use super::restated::{Restated, restate};
use crate::cost::within_gates;
use crate::{Lengths, QuadLayout, QuadMatchingError};
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{
    Connectivity, Correspondence, FaceId, FeatureEdge, HalfEdgeId, Lineage, Part, RegionId, VertexId,
    counterparts,
};
use topipe_progress::Progress;
use topipe_tiling::SizingField;

/// Of the area it had: tiles that are smaller or larger now are laid out anew.
const AREA: [f64; 2] = [0.6, 1.6];

/// A layout whose vertices have moved with the mesh.
pub(super) struct Carried {
    /// The earlier layout; its part has the shapes, labels and features of the part as it is now, and provenance with respect to it.
    pub(super) layout: QuadLayout,
    /// How its mesh lies on that of the part.
    pub(super) lineage: Lineage,
    /// Per face: the region it has to belong to now, if any.
    pub(super) region: Vec<RegionId>,
    /// Per face: the distance wanted between the middles of tiles, mm.
    pub(super) size: Vec<f64>,
    /// Per face: nothing can stay as it is there.
    pub(super) touched: Vec<bool>,
    /// Per quad: its shape has changed too much.
    pub(super) misshapen: Vec<bool>,
    /// Quads that are not in the layout, because triangles they lay on are gone.
    pub(super) lost: usize,
}

/// Carries a layout over. The inner error says why that is not possible.
pub(super) fn carry(
    part: &Part,
    earlier: Earlier<'_>,
    parameters: &topipe_tiling::Parameters,
    progress: &Progress,
) -> Result<Result<Carried, String>, QuadMatchingError> {
    let before = earlier.layout;
    if before.quad_of_face.len() != before.part.mesh.face_count()
        || before.part.region_of_face.len() != before.part.mesh.face_count()
        || before.part.frozen.len() != before.part.mesh.vertex_count()
    {
        return Ok(Err("the arrays of the earlier layout do not fit together".into()));
    }
    let other = "the earlier layout was made of another mesh than the one that is said to be its own";
    let Some(lineage) = lineage(earlier) else { return Ok(Err(other.into())) };
    let same = Correspondence::new(&earlier.part.mesh, &part.mesh)?;
    let [faces, new] = [part.mesh.face_count(), same.new_faces().count()];
    if new == faces {
        return Ok(Err(format!(
            "none of its {faces} triangles is one of the {} that the earlier mesh had: it was moved as a whole, or another mesh was made of the part",
            earlier.part.mesh.face_count()
        )));
    }
    let restated = (!same.is_identity()).then(|| restate(earlier, &lineage, &same, &part.mesh));
    let (earlier, lineage, lost) = match &restated {
        None => (earlier, lineage, 0),
        Some(Restated { part: before, layout, lost }) => {
            let Some(lineage) = Lineage::new(&layout.part, &part.mesh) else { return Ok(Err(other.into())) };
            progress.remark(&format!(
                "{} of {faces} triangles were in the earlier mesh, which had {}",
                faces - new,
                earlier.part.mesh.face_count()
            ));
            (Earlier { part: before, tiling: None, layout }, lineage, *lost)
        }
    };
    let before = earlier.layout;
    let SizingField { region_of_face: taken, size } = SizingField::of(part, parameters)?;
    let parents = lineage.faces();
    let region: Vec<RegionId> = parents.iter().map(|f| taken[f.index()]).collect();
    let size = parents.iter().map(|f| size[f.index()]).collect();
    let mut layout = before.clone();
    let own = &mut layout.part;
    own.mesh.positions =
        lineage.moved(&own.mesh.positions, &earlier.part.mesh.positions, &part.mesh.positions);
    own.provenance = lineage.provenance(&part.mesh);
    own.design = parents.iter().map(|f| part.design[f.index()]).collect();
    let taken_regions: BTreeSet<RegionId> = taken.iter().copied().filter(|r| r.is_some()).collect();
    own.region_of_face = parents
        .iter()
        .zip(&region)
        .map(|(f, &region)| match part.region_of_face[f.index()] {
            _ if region.is_some() => region,
            // Handed back to the free surface.
            own if taken_regions.contains(&own) => RegionId::NONE,
            own => own,
        })
        .collect();
    for (frozen, provenance) in own.frozen.iter_mut().zip(&own.provenance) {
        if let topipe_mesh::Provenance::Vertex(v) = provenance {
            *frozen = part.frozen[v.index()];
        }
    }
    own.regions.clone_from(&part.regions);
    own.import.clone_from(&part.import);
    own.smoothing.clone_from(&part.smoothing);
    own.feature_edges = features(&own.mesh, parents, part)?;
    layout.lengths = Lengths::of(&own.mesh).after(before.lengths);

    let was: Vec<RegionId> = (0..region.len())
        .map(|f| match before.quad_of_face[f] {
            QuadLayout::NO_QUAD => before.part.region_of_face[f],
            _ => RegionId::NONE,
        })
        .collect();
    let now = counterparts(&was, &region);
    let changed = changed_features(earlier.part, part);
    let touched = (0..region.len())
        .map(|f| {
            let expected = if was[f].is_some() { now.get(&was[f]).copied() } else { Some(RegionId::NONE) };
            !same.face_was(parents[f]).is_some()
                || expected != Some(region[f])
                || (!region[f].is_some() && changed.contains(&parents[f]))
        })
        .collect();
    let misshapen = misshapen(before, &layout);
    Ok(Ok(Carried { layout, lineage, region, size, touched, misshapen, lost }))
}

/// How the mesh of the earlier layout lies on that of the earlier part.
fn lineage(earlier: Earlier<'_>) -> Option<Lineage> {
    let (layout, mesh) = (&earlier.layout.part, &earlier.part.mesh);
    let Some(tiling) = earlier.tiling else { return Lineage::new(layout, mesh) };
    let of_tiling = Lineage::new(&tiling.part, mesh)?;
    of_tiling.of_child(layout, &Lineage::new(layout, &tiling.part.mesh)?, mesh)
}

/// Faces of the part beside edges that are features in one of both only, or others.
fn changed_features(earlier: &Part, part: &Part) -> BTreeSet<FaceId> {
    let kinds = |part: &Part| -> BTreeSet<_> {
        part.feature_edges.iter().map(|edge| (edge.vertices, edge.kind as u8)).collect()
    };
    let edges: BTreeSet<[VertexId; 2]> =
        kinds(earlier).symmetric_difference(&kinds(part)).map(|&(vertices, _)| vertices).collect();
    let beside = |f: &FaceId| {
        let [a, b, c] = part.mesh.triangles[f.index()];
        [[a, b], [b, c], [c, a]].iter().any(|[a, b]| edges.contains(&[*a.min(b), *a.max(b)]))
    };
    part.mesh.faces().filter(beside).collect()
}

/// The pieces of the part's feature edges: edges between faces whose parents meet at one.
fn features(
    mesh: &topipe_mesh::TriangleMesh,
    parents: &[FaceId],
    part: &Part,
) -> Result<Vec<FeatureEdge>, QuadMatchingError> {
    let connectivity = Connectivity::build(mesh)?;
    let kinds: BTreeMap<[VertexId; 2], _> =
        part.feature_edges.iter().map(|edge| (edge.vertices, edge.kind)).collect();
    let mut found = Vec::new();
    for h in (0..3 * mesh.face_count()).map(HalfEdgeId::new) {
        let twin = connectivity.twin(h);
        if !twin.is_some() || twin < h {
            continue;
        }
        let [a, b] = [h, twin].map(|h| parents[h.face().index()]);
        if a == b {
            continue;
        }
        let shared: Vec<VertexId> = part.mesh.triangles[a.index()]
            .into_iter()
            .filter(|v| part.mesh.triangles[b.index()].contains(v))
            .collect();
        let [v, w] = shared[..] else { continue };
        if let Some(&kind) = kinds.get(&[v.min(w), v.max(w)]) {
            let (v, w) = (connectivity.origin(h), connectivity.origin(twin));
            found.push(FeatureEdge { vertices: [v.min(w), v.max(w)], kind });
        }
    }
    found.sort_unstable_by_key(|edge| edge.vertices);
    Ok(found)
}

/// Quads that have become much smaller or larger, or have a corner outside the gates which was inside.
fn misshapen(before: &QuadLayout, now: &QuadLayout) -> Vec<bool> {
    let areas = |layout: &QuadLayout| {
        let mut areas = vec![0.0; layout.quads.len()];
        for f in layout.part.mesh.faces() {
            if let Some(area) = areas.get_mut(layout.quad_of_face[f.index()] as usize) {
                *area += layout.part.mesh.area_vector(f).length() / 2.0;
            }
        }
        areas
    };
    let (was, is) = (areas(before), areas(now));
    let (old, new) = (before.corner_angles(), now.corner_angles());
    (0..was.len())
        .map(|quad| {
            let ratio = is[quad] / was[quad];
            let corners = old[quad].iter().zip(&new[quad]);
            !(AREA[0]..=AREA[1]).contains(&ratio)
                || corners.into_iter().any(|(&old, &new)| within_gates(old) && !within_gates(new))
        })
        .collect()
}
