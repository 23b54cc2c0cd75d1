//! What an earlier smoothing of nearly the same part has made stays as it is.
//!
//! Smoothing is not local: the volume is restored by moving all free vertices, `alpha` is one number for the whole mesh. After an
//! edit of one corner every vertex moves a little, and nothing that was made of the mesh can be kept. Here the part is
//! smoothed as ever, and then each vertex that the edit has not touched and that has moved by next to nothing is put back to where
//! the earlier smoothing had left it; so are the shapes of regions, and which edges are features. What is global is taken from the
//! earlier smoothing or taken out: `alpha`, the number of iterations, the shift by which the volume is restored.

mod regions;
mod volume;

use crate::locality::Order;
use crate::smooth::smooth;
use crate::{Parameters, SmoothingError};
use regions::{keep_edges, measure_regions, settle_regions};
use topipe_mesh::{Correspondence, DVec3, FaceId, Part, RegionId, RegionShape, meet};
use topipe_progress::Progress;
use volume::{restore_volume, shift};

/// Over the mean edge length: what has moved by less before smoothing was not edited. File formats with decimal numbers round
/// coordinates by less than that.
const UNTOUCHED: f64 = 1e-4;
/// Over the mean edge length: what has moved by less after smoothing is put back. Of the nine examples with a bump of 0.4 edges on 8
/// edges of the surface 0.6 to 7.7 % of the vertices move by more, all but 16 at most of them within 12 edges of it.
const NEXT_TO_NOTHING: f64 = 0.01;
/// Over the mean edge length: what is nearer to a shape lies on it: far above rounding, far below
/// [`NEXT_TO_NOTHING`].
const ON: f64 = 1e-5;
/// Of the volume: what it is off by more is warned of.
const VOLUME: f64 = 1e-3;

/// A smoothing of the past.
#[derive(Debug, Clone, Copy)]
pub struct Earlier<'a> {
    /// What was smoothed.
    pub original: &'a Part,
    /// What it became.
    pub smoothed: &'a Part,
}

/// Smooths `part`, of which `earlier` is a version from before an edit, so that what the edit has not touched becomes what it became
/// then, bit for bit, where it would differ by at most 0.01 mean edge lengths from that and a shift that all of the free surface makes.
///
/// Vertices of triangles that the earlier version does not have, see [`Correspondence`], count as touched. Where it has none of them
/// nothing is kept, and a warning says so.
///
/// Guarantees: see [`smooth`], but the volume is only kept where an offset by up to a quarter of an edge of what was not put back gives it back
/// (a warning says so from a thousandth of it on), and triangles are not kept from passing through each other where vertices were put
/// back or offset.
///
/// # Errors
/// Those of [`smooth`].
pub fn smooth_after(
    part: &Part,
    earlier: Earlier<'_>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Part, SmoothingError> {
    let Earlier { original, smoothed: before } = earlier;
    let same = Correspondence::new(&original.mesh, &part.mesh);
    let of_one_mesh = original.mesh.triangles == before.mesh.triangles;
    let Some(same) = same.ok().filter(|_| of_one_mesh && part.mesh.positions.iter().all(|p| p.is_finite()))
    else {
        let smoothed = smooth(part, parameters, progress)?;
        progress.warn("nothing is kept of the earlier smoothing: it is not one of the mesh that is said to be its input");
        return Ok(smoothed);
    };
    let new: Vec<FaceId> = same.new_faces().collect();
    let faces = part.mesh.face_count();
    if new.len() == faces {
        let smoothed = smooth(part, parameters, progress)?;
        progress.warn(&format!(
            "nothing is kept of the earlier smoothing: none of the {faces} triangles is one of the {} of the earlier mesh",
            original.mesh.face_count()
        ));
        return Ok(smoothed);
    }
    if same.is_identity() {
        let smoothed = smooth_alike(part, before, parameters, progress)?;
        return Ok(keep(part, smoothed, earlier, &new, parameters, progress));
    }
    progress.remark(&format!(
        "{} of {faces} triangles were in the earlier mesh, which had {}",
        faces - new.len(),
        original.mesh.face_count()
    ));
    let (order, mesh) = Order::following(&same, &part.mesh);
    let smoothed = order.restore(part, smooth_alike(&order.apply(part, mesh), before, parameters, progress)?);
    let [original, before] = [original, before].map(|earlier| same.restated(earlier, &part.mesh));
    Ok(keep(part, smoothed, Earlier { original: &original, smoothed: &before }, &new, parameters, progress))
}

/// Smooths with the `alpha` that the earlier smoothing has found, and with as many iterations as it would have needed: both depend on the
/// whole mesh, and vertices everywhere move with them.
fn smooth_alike(
    part: &Part,
    before: &Part,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Part, SmoothingError> {
    let record = before.smoothing.as_ref().filter(|record| record.method == parameters.method.name());
    let Some(record) = record else { return smooth(part, parameters, progress) };
    let alpha = parameters.alpha.or(record.alpha.filter(|alpha| (0.0..=1.0).contains(alpha)));
    let at_rest = record.rms_steps.iter().position(|step| *step < parameters.tolerance);
    let iterations =
        at_rest.and_then(|k| u32::try_from(k + 1).ok()).filter(|n| *n <= parameters.most_iterations());
    let tolerance = if iterations.is_some() { 0.0 } else { parameters.tolerance };
    let alike = Parameters {
        alpha,
        tolerance,
        iterations: iterations.or(parameters.iterations),
        ..parameters.clone()
    };
    let mut smoothed = smooth(part, &alike, progress)?;
    if let Some(record) = &mut smoothed.smoothing {
        record.converged |= iterations.is_some();
    }
    Ok(smoothed)
}

/// Puts back what has hardly moved. Triangles that are `new` were edited.
fn keep(
    part: &Part,
    smoothed: Part,
    earlier: Earlier<'_>,
    new: &[FaceId],
    parameters: &Parameters,
    progress: &Progress,
) -> Part {
    let before = earlier.smoothed;
    let edge = before.mesh.mean_edge_length();
    let vertices = part.mesh.vertex_count();
    let mut untouched: Vec<bool> = (0..vertices)
        .map(|v| part.mesh.positions[v].distance(earlier.original.mesh.positions[v]) <= UNTOUCHED * edge)
        .collect();
    for (f, t) in part.mesh.triangles.iter().enumerate() {
        if part.design[f] != earlier.original.design[f] {
            t.iter().for_each(|v| untouched[v.index()] = false);
        }
    }
    for t in new.iter().map(|f| part.mesh.triangles[f.index()]) {
        t.iter().for_each(|v| untouched[v.index()] = false);
    }
    let mut kept = smoothed;
    let shift = shift(&kept, before, &untouched);
    let normals = before.mesh.vertex_normals();
    let settled = settle_regions(&mut kept, before, &untouched, NEXT_TO_NOTHING * edge);
    // The shapes that each vertex lies on.
    let mut shapes: Vec<Vec<RegionId>> = vec![Vec::new(); vertices];
    for (t, &region) in kept.mesh.triangles.iter().zip(&kept.region_of_face) {
        for v in t.iter().filter(|_| region.is_some()) {
            if !shapes[v.index()].contains(&region) {
                shapes[v.index()].push(region);
            }
        }
    }
    let (mut farthest, mut same) = (0.0f64, vec![false; vertices]);
    for v in 0..vertices {
        let (new, old) = (kept.mesh.positions[v], before.mesh.positions[v]);
        let on = || shapes[v].iter().map(|r| (&kept.regions[r.index()].shape, settled[r.index()]));
        let lies_on =
            |(shape, settled): (&RegionShape, bool)| settled && shape.distance(old).abs() <= ON * edge;
        let shift = if kept.frozen[v] { DVec3::ZERO } else { normals[v] * shift };
        if untouched[v] && new.distance(old + shift) <= NEXT_TO_NOTHING * edge && on().all(lies_on) {
            farthest = farthest.max(new.distance(old));
            same[v] = true;
            kept.mesh.positions[v] = old;
            kept.frozen[v] = before.frozen[v];
        } else if !kept.frozen[v] && on().any(|(_, settled)| settled) {
            // Its shape was put back, and it follows.
            let own: Vec<&RegionShape> = on().map(|(shape, _)| shape).collect();
            kept.mesh.positions[v] = meet(&own, new);
        }
    }
    if let Some(record) = &mut kept.smoothing {
        record.kept = same.iter().filter(|same| **same).count() as u32;
    }
    keep_edges(&mut kept, before, &same);
    measure_regions(&mut kept, before, &same);
    progress.remark(&format!(
        "{} of {vertices} vertices stay where the earlier smoothing left them, at most {farthest:.1e} mm from where they would be",
        same.iter().filter(|s| **s).count(),
    ));
    let volume = part.mesh.volume();
    if parameters.keeps_volume() {
        let loose: Vec<bool> =
            (0..vertices).map(|v| !same[v] && !kept.frozen[v] && shapes[v].is_empty()).collect();
        if let Some(offset) = restore_volume(&mut kept.mesh, &loose, volume) {
            progress.remark(&format!(
                "an offset by {:.1e} edges of what does not stay gives the volume back",
                offset / edge
            ));
        }
    }
    let off = (kept.mesh.volume() - volume).abs() / volume.abs();
    if parameters.keeps_volume() && off > VOLUME {
        progress.warn(&format!(
            "the volume is off by {off:.1e} of itself, because what the edit has not touched stays where it was; without `earlier` it is kept"
        ));
    }
    kept
}
