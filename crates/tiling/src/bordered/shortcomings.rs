//! What a tessellation lacks that the user should know of: features that are none any more, and a mesh with less detail than tiles.

use crate::Parameters;
use crate::tiling::Tiling;
use topipe_mesh::{DVec3, Part, RegionId, RegionShape};
use topipe_progress::Progress;

/// Fewer triangles of the mesh than this to a tile of free surface are too few: a tile becomes about four patches, which then follow
/// single triangles and the edges between them. The nine parts have 9 to 19; a lattice of struts that are four triangles around has 2.9,
/// gets 1,350 control points to a patch, and ends at nine times its tolerance.
const FEWEST: usize = 4;

/// Features that are named one by one.
const NAMED: usize = 3;

/// Warns of what the tessellation of `part` lacks.
pub(super) fn warn(part: &Part, parameters: &Parameters, tiling: &Tiling, progress: &Progress) {
    if parameters.follow_features
        && let Some(text) = lost_features(part, parameters, tiling)
    {
        progress.warn(&text);
    }
    if let Some(text) = too_coarse(part, tiling) {
        progress.warn(&text);
    }
}

/// Faces of known shape, found or asked for, of which nothing is left.
fn lost_features(part: &Part, parameters: &Parameters, tiling: &Tiling) -> Option<String> {
    let mut seen = vec![None::<DVec3>; part.regions.len()];
    for (f, region) in part.mesh.faces().zip(&part.region_of_face) {
        if let Some(place) = seen.get_mut(region.index()) {
            place.get_or_insert_with(|| part.mesh.corners(f).iter().sum::<DVec3>() / 3.0);
        }
    }
    let lost: Vec<String> = (part.regions.iter().zip(&seen).enumerate())
        .filter(|(r, (_, place))| {
            place.is_some() && tiling.regions.binary_search(&RegionId(*r as u32)).is_err()
        })
        .map(|(_, (region, place))| {
            let shape = match region.shape {
                RegionShape::Plane { .. } => "a plane".to_owned(),
                RegionShape::Cylinder { radius, hole, .. } => {
                    format!("a {} of {:.3} mm", if hole { "hole" } else { "boss" }, 2.0 * radius)
                }
            };
            format!("{shape} of {:.3} mm2 at {:.3}", region.area, place.unwrap_or_default())
        })
        .collect();
    if lost.is_empty() {
        return None;
    }
    let more = match lost.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    Some(format!(
        "too small or too ragged for a face of its own, and part of the free surface now: {}{more}; a lower `least_region` than {} keeps \
         smaller ones",
        lost[..lost.len().min(NAMED)].join(", "),
        parameters.least_region
    ))
}

/// A mesh with fewer than [`FEWEST`] triangles of free surface to a tile.
fn too_coarse(part: &Part, tiling: &Tiling) -> Option<String> {
    let is_free = |r: &&RegionId| tiling.regions.binary_search(r).is_err();
    let free = part.region_of_face.iter().filter(is_free).count();
    let tiles = tiling.tile_count();
    if free >= FEWEST * tiles {
        return None;
    }
    let mesh = &part.mesh;
    // V - E + F = 2 - 2g, with three half-edges to a face and two to an edge.
    let euler = mesh.vertex_count() as i64 - mesh.face_count() as i64 / 2;
    let genus = (2 - euler) / 2;
    let holes = match genus {
        1.. => format!(" and its {genus} through holes"),
        _ => String::new(),
    };
    Some(format!(
        "the mesh is too coarse for its shape{holes}: {free} triangles of free surface make {tiles} tiles, {:.1} each; the fit will follow \
         single triangles, takes long and may end beyond its tolerance; use a finer mesh (struts of at least eight triangles around), \
         or larger tiles (`tile_size`)",
        free as f64 / tiles as f64
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use topipe_mesh::{Region, TriangleMesh};
    use topipe_progress::Recorder;

    /// The warnings of a tessellation with the default parameters, changed by `change`.
    fn warnings(part: &Part, change: impl FnOnce(&mut Parameters)) -> Vec<String> {
        let mut parameters = Parameters::default();
        change(&mut parameters);
        let said = Arc::new(Recorder::default());
        crate::tile(part, &parameters, &Progress::new(said.clone())).unwrap();
        said.warnings()
    }

    /// A closed surface of cubes: those of a 3 x 3 x `length` grid, without the middle column where `hollow`.
    fn cubes(length: i32, hollow: bool) -> Part {
        let is_in = |p: [i32; 3]| {
            let inside = (0..3).all(|k| (0..[3, 3, length][k]).contains(&p[k]));
            inside && !(hollow && p[0] == 1 && p[1] == 1)
        };
        let mut index = std::collections::BTreeMap::new();
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for (x, y, z) in (0..3).flat_map(|x| (0..3).flat_map(move |y| (0..length).map(move |z| (x, y, z)))) {
            for (axis, outward) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
                let mut beyond = [x, y, z];
                beyond[axis] += 2 * outward - 1;
                if !is_in([x, y, z]) || is_in(beyond) {
                    continue;
                }
                let mut corner = |u: i32, v: i32| {
                    let mut p = [x, y, z];
                    p[axis] += outward;
                    p[(axis + 1) % 3] += u;
                    p[(axis + 2) % 3] += v;
                    *index.entry(p).or_insert_with(|| {
                        points.push(p.map(f64::from));
                        points.len() as u32 - 1
                    })
                };
                let mut q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                if outward == 0 {
                    q.reverse();
                }
                triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
            }
        }
        Part::new(TriangleMesh::from_arrays(points, triangles))
    }

    #[test]
    fn a_mesh_with_fewer_triangles_than_tiles_need_is_called_too_coarse() {
        let small = |p: &mut Parameters| p.tile_size = 0.4;
        let said = warnings(&cubes(3, true), small);
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("too coarse for its shape and its 1 through holes"), "{said:?}");
        // Without a hole nothing is said of holes, and with large tiles nothing at all.
        let said = warnings(&cubes(3, false), small);
        assert!(said[0].contains("too coarse for its shape: 108 triangles"), "{said:?}");
        assert_eq!(warnings(&cubes(12, false), |p| p.tile_size = 3.0), [""; 0]);
    }

    #[test]
    fn a_known_face_that_is_no_face_of_its_own_is_named_with_its_place() {
        let mut part = cubes(12, false);
        part.regions.push(Region {
            shape: RegionShape::Plane { point: DVec3::ZERO, normal: DVec3::NEG_Z },
            area: 9.0,
            residual: 0.0,
        });
        let bottom: Vec<bool> =
            part.mesh.faces().map(|f| part.mesh.corners(f).into_iter().all(|p| p.z == 0.0)).collect();
        for (region, bottom) in part.region_of_face.iter_mut().zip(bottom) {
            *region = if bottom { RegionId(0) } else { RegionId::NONE };
        }
        let said = warnings(&part, |p| (p.tile_size, p.least_region) = (3.0, 10.0));
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("a plane of 9.000 mm2 at"), "{said:?}");
        assert!(said[0].ends_with("a lower `least_region` than 10 keeps smaller ones"), "{said:?}");
        assert_eq!(warnings(&part, |p| (p.tile_size, p.least_region) = (3.0, 0.5)), [""; 0]);
    }
}
