//! Where tangency is asked for and the mesh has none: corners of borders.
//!
//! Whether patches meet an edge smoothly is decided edge by edge, from the mesh along it. At a vertex on a border that
//! can contradict itself. The tangent plane there holds the border's directions before and after; where these are not
//! parallel they fix it, and where it is far from the mesh's own the surface has a corner: a crease of the mesh that
//! fades into the free surface begins there. Asking for one tangent plane would twist the patches beside it, often
//! until they fold. The edge along which the mesh folds there becomes a crease itself: at its other end, where no
//! other crease is, the patches beside it have one tangent plane again. In the same way a border is no longer tangent
//! to its shape where the mesh is not at one of its ends, or where the border on the other side of the patches leaves
//! the shape's tangent plane.

use crate::fans::{EdgeRole, Sector, Spoke};
use crate::frames::Given;
use crate::local_surface::{Known, local_surface};
use rayon::prelude::*;
use std::cell::LazyCell;
use topipe_mesh::DVec3;

/// From this angle between the tangent plane that is asked for and the mesh's own on, there is a corner: cosine of 25
/// degrees. Of the tangent planes that two borders fix in the nine example parts half are within 6 degrees of the
/// mesh's, the others between 25 and 90.
pub(crate) const FAR: f64 = 0.906;

/// A border that leaves a shape's tangent plane by more than this angle (the sine of 0.03 degrees) does not lie in it:
/// no patch between the border and the shape is tangent to the shape at its corner.
pub(crate) const LEAVES: f64 = 5e-4;

/// What is not smooth after all.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Corners {
    /// Edges between two patches that are creases, ascending.
    pub(crate) creases: Vec<usize>,
    /// Borders that are not tangent to their shapes, ascending.
    pub(crate) sharp_borders: Vec<usize>,
}

pub(crate) fn corners(given: &Given<'_>, tangents: &[Option<DVec3>]) -> Corners {
    let found: Vec<(Option<usize>, Vec<usize>)> = given
        .sectors
        .list
        .par_iter()
        .filter(|sector| !sector.closed)
        .map(|sector| corner(given, sector, tangents).unwrap_or_default())
        .collect();
    let mut corners = Corners::default();
    for (crease, borders) in found {
        corners.creases.extend(crease);
        corners.sharp_borders.extend(borders);
    }
    for list in [&mut corners.creases, &mut corners.sharp_borders] {
        list.sort_unstable();
        list.dedup();
    }
    corners
}

fn corner(
    given: &Given<'_>,
    sector: &Sector,
    tangents: &[Option<DVec3>],
) -> Option<(Option<usize>, Vec<usize>)> {
    let v = sector.vertex as usize;
    let at = given.vertices[v].unwrap_or(given.layout.part.mesh.position(given.layout.vertices[v]));
    let reach = |spokes: &[Spoke]| {
        spokes.iter().map(|s| given.reach[s.edge as usize]).sum::<f64>() / spokes.len() as f64
    };
    let normal = |quads: &[(u32, u8)], spokes: &[Spoke]| {
        local_surface(&given.of_quads(quads), at, Known::Point, reach(spokes)).normal
    };
    // Most borders run on straight, and meet no shape smoothly.
    let own = LazyCell::new(|| normal(&sector.quads, &sector.spokes));
    let ends = [sector.spokes[0], sector.spokes[sector.spokes.len() - 1]];
    let directions = ends.map(|s| given.fixed_direction(s, tangents));
    let sharp: Vec<usize> = [0, 1]
        .into_iter()
        .filter(|&k| {
            let shape = given.tangent_to[ends[k].edge as usize].as_ref();
            shape.is_some_and(|shape| {
                let normal = shape.normal(at);
                directions[1 - k].is_some_and(|d| d.dot(normal).abs() > LEAVES) || normal.dot(*own) < FAR
            })
        })
        .map(|k| ends[k].edge as usize)
        .collect();
    let [a, b] = [directions[0]?, directions[1]?];
    let across = a.cross(b);
    let twisted = across.length() > LEAVES && (across.normalize().dot(*own).abs() < FAR);
    if !twisted || sector.quads.len() < 2 {
        return Some((None, sharp));
    }
    // The edge that leaves the mesh smoothest on both sides: each side's plane through its border fits its own faces.
    let split = (1..sector.quads.len())
        .map(|k| {
            let path = given.path(sector.spokes[k]);
            let towards = crate::frames::point_at(&path, 0.3) - at;
            let left =
                a.cross(towards).normalize_or_zero().dot(normal(&sector.quads[..k], &sector.spokes[..=k]));
            let right =
                towards.cross(b).normalize_or_zero().dot(normal(&sector.quads[k..], &sector.spokes[k..]));
            (k, left.min(right))
        })
        .max_by(|x, y| x.1.total_cmp(&y.1).then(y.0.cmp(&x.0)))?
        .0;
    let edge = sector.spokes[split].edge as usize;
    let free = given.roles[edge] == EdgeRole::Smooth;
    Some((free.then_some(edge), sharp))
}
