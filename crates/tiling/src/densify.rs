//! Refinement of meshes that are too coarse for the tiles they shall get.

use crate::TilingError;
use topipe_mesh::HalfEdgeId;
use topipe_mesh::refine::Refiner;
use topipe_progress::Progress;

/// Splits long edges until tiles of the given spacing have enough faces, longest edges first within each sweep.
pub(crate) fn densify(
    refiner: &mut Refiner,
    area: f64,
    spacing: f64,
    faces_per_tile: u32,
    progress: &Progress,
) -> Result<(), TilingError> {
    // A tile covers sqrt(3)/2 spacing^2; equilateral triangles of that number have this edge length. Real
    // triangles scatter about it, so only edges twice as long are split.
    let tile_area = (3f64.sqrt() / 2.0 * spacing * spacing).min(area / 4.0);
    let edge = (4.0 / 3f64.sqrt() * tile_area / f64::from(faces_per_tile)).sqrt();
    let longest = 2.0 * edge;
    loop {
        progress.check()?;
        let mesh = &refiner.part().mesh;
        let mut long: Vec<(f64, HalfEdgeId)> = (0..mesh.face_count() * 3)
            .map(HalfEdgeId::new)
            .filter(|&h| refiner.twin(h).0 > h.0)
            .map(|h| (mesh.position(refiner.origin(h)).distance(mesh.position(refiner.target(h))), h))
            .filter(|&(length, _)| length > longest)
            .collect();
        if long.is_empty() {
            return Ok(());
        }
        long.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut touched = vec![false; mesh.face_count()];
        for (_, h) in long {
            let faces = [h.face(), refiner.twin(h).face()];
            // Only edges that are still as measured: neighbours of a split wait for the next sweep.
            if faces.iter().all(|f| touched.get(f.index()) == Some(&false)) {
                faces.iter().for_each(|f| touched[f.index()] = true);
                refiner.split_edge(h, 0.5);
            }
        }
    }
}
