//! The layout of bordered tiles by midpoint subdivision.
//!
//! Each tile of n sides becomes n quads: its centre is joined to the middles of its sides. That needs no matching and no
//! even count, works with borders, and leaves corners of 360 / n degrees at centres and about 90 at middles. Vertices are relaxed
//! afterwards; quads with a corner that is too wide still are divided, see [`crate::divide()`].

use crate::cost::GATES;
use crate::divide::{Division, divide_in};
use crate::ends::turn_ends;
use crate::outlines::outlines;
use crate::refine::{Quads, Regions, refine};
use crate::relax::{Effort, Incidence, relax};
use crate::{Lengths, Parameters, QuadLayout, QuadMatchingError, RegionFace, Side};
use rustc_hash::FxHashSet;
use topipe_mesh::VertexId;
use topipe_progress::Progress;
use topipe_tiling::Tiling;

/// Rounds in which vertices beside bad corners are relaxed.
const RELAXATION_ROUNDS: u32 = 3;
/// Most rounds in which better places are searched for vertices beside corners that are outside the gates still. None of the nine
/// examples has any; of 108 tilings of them with other sizes of tiles and other bends 14 had one to five, with the search two
/// had one or two.
const SEARCH_ROUNDS: u32 = 4;

/// With `given` it makes a part of a layout, of which the rest is there already: edges with one of these vertices inside are halved there,
/// and no quad is divided further, as that would halve edges of the rest.
pub(crate) fn subdivide(
    tiling: &Tiling,
    given: Option<&FxHashSet<VertexId>>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<QuadLayout, QuadMatchingError> {
    let (mut regions, faces) = outlines(tiling)?;
    progress.check()?;
    let incidence = Incidence::new(&regions);
    for _ in 0..2 * parameters.straightening_rounds {
        relax(&mut regions, &incidence, Effort::Straighten, parameters.snap, progress)?;
        regions = regions.coarsen()?;
    }
    let Quads { mut tiled, vertices, edges, quads, quad_of_face } =
        refine(regions, given.unwrap_or(&FxHashSet::default()), parameters.snap, progress)?;
    tiled.tile_of_face = quad_of_face;
    let sides = quads.iter().map(|quad| quad.to_vec()).collect();
    let mut fine = Regions { tiled, vertices, edges, sides };
    let incidence = Incidence::new(&fine);
    for _ in 0..RELAXATION_ROUNDS {
        let changed = relax(&mut fine, &incidence, Effort::Improve, parameters.snap, progress)?;
        fine = fine.coarsen()?;
        if changed == 0 {
            break;
        }
    }
    let mut turned = turn_ends(&mut fine);
    for _ in 0..SEARCH_ROUNDS {
        let changed = relax(&mut fine, &incidence, Effort::Search, parameters.snap, progress)?;
        if changed == 0 {
            break;
        }
        turned += turn_ends(&mut fine);
    }
    if turned > 0 {
        progress.remark(&format!("ends of edges turned {turned} times beside corners outside the gates"));
    }
    let wide = if given.is_some() { Vec::new() } else { opposite_wide_corners(&fine) };
    let Regions { tiled, vertices, edges, .. } = fine;
    let quad_of_face = tiled.tile_of_face;
    let region_faces = faces.into_iter().map(halved).collect();
    let refiner = (!wide.is_empty()).then(|| tiled.refiner.clone());
    let (part, _) = tiled.refiner.finish();
    let mut layout = QuadLayout {
        lengths: Lengths::of(&part.mesh),
        part,
        vertices,
        edges,
        quads,
        quad_of_face,
        region_faces,
        tiles: tiling.tile_count() as u32,
        macro_triangles: 0,
    };
    if let Some(refiner) = refiner
        && let Some(Division { layout: finer, vertices }) = divide_in(&layout, &refiner, &wide, progress)?
    {
        let shared = vertices.iter().flatten().count();
        progress
            .remark(&format!("{shared} of {} corners wider than 165 degrees are shared by two", wide.len()));
        layout = finer;
    }
    layout.check_corners(parameters)?;
    Ok(layout)
}

/// For each corner beyond the upper gate the vertex opposite: divided around that, two quads share the corner.
fn opposite_wide_corners(regions: &Regions) -> Vec<Vec<u32>> {
    let start = |side: Side| regions.edges[side.edge as usize].ends[side.reversed as usize];
    let of_region = |(r, sides): (usize, &Vec<Side>)| {
        let is_wide = |&k: &usize| {
            let vertex = regions.vertices[start(sides[k]) as usize];
            regions.tiled.corner_angle(vertex, r as u32) > GATES[1]
        };
        let wide: Vec<usize> = (0..sides.len()).filter(is_wide).collect();
        wide.into_iter().map(|k| vec![start(sides[(k + 2) % sides.len()])]).collect::<Vec<_>>()
    };
    regions.sides.iter().enumerate().flat_map(of_region).collect()
}

/// A region face whose sides are the halves of what they were.
fn halved(face: RegionFace) -> RegionFace {
    let halves = |side: Side| {
        [false, true].map(|second| Side {
            edge: 2 * side.edge + (side.reversed != second) as u32,
            reversed: side.reversed,
        })
    };
    let loops = face.loops.into_iter().map(|sides| sides.into_iter().flat_map(halves).collect()).collect();
    RegionFace { region: face.region, loops }
}
