//! Knots along the sides of patches, where these do not follow the normals closely enough.
//!
//! A patch meets the normals along its side exactly at the breaks of its knots; between them the angle to them falls
//! with the fourth power of the length of a span, near corners whose mixed derivatives do not agree with the square.
//! Either way it falls, and where it matters only along a small part of an edge. So spans are divided where the angle
//! is above its limit, on both sides of the edge, until it is nowhere, or spans have become too short to matter, or a patch
//! too large.
//!
//! The inside of a patch has nothing to gain from such knots: it is fitted once, to few of them, they are inserted into
//! it, and only the two rows of control points at the side are set anew.

use crate::breaks::Breaks;
use crate::fans::EdgeRole;
use crate::network::{Curve, Network};
use crate::patch_fit::{Net, side_rows};
use crate::patches::{Fitted, side_of};
use crate::ribbon::ribbons;
use crate::setting::Setting;
use crate::{Patch, SurfacePoint};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::{DVec3, RegionShape};
use topipe_progress::Progress;
use topipe_quad_matching::{QuadLayout, Side};

/// Shortest span that is divided, as a share of its edge. With 1/4096 one corner of the bell-crank
/// was left with 0.4 degrees.
const SHORTEST: f64 = 1.0 / 32768.0;
/// Where in each span normals are compared, as shares of it: both kinds of error are near their largest at one of these.
const PLACES: [f64; 5] = [0.08, 0.3, 0.5, 0.7, 0.92];
/// Share of the limit from which on a span is divided: between the places the angle may be larger. With 0.8 one place in a
/// hundred was above 0.05 to 0.06 degrees on the nine reference parts, at a limit of 0.1.
const MARGIN: f64 = 0.65;
/// Above this multiple of the limit a span is quartered at once.
const QUARTER: f64 = 16.0;
/// Most cells of a patch, counted as if no two of its sides had a break in common: where angles never fall, or a limit of
/// zero asks for it, knots end here. It is four times what a patch of 32 spans on each side has, and 1.6 MB of control points.
const MOST_CELLS: usize = 16_384;

/// Patches as they were fitted, and the curves between them.
#[derive(Clone, Copy)]
pub(crate) struct Coarse<'a> {
    pub(crate) setting: &'a Setting<'a>,
    pub(crate) network: &'a Network,
    pub(crate) fitted: &'a [Arc<Fitted>],
}

impl Coarse<'_> {
    /// Which patches are those of another fit, between the same curves and shapes.
    fn same_patches(&self, other: &Coarse<'_>) -> Vec<bool> {
        let is_same_edge = |e: usize| {
            other.network.curves.get(e) == Some(&self.network.curves[e])
                && other.setting.roles[e] == self.setting.roles[e]
                && other.setting.tangent_to[e] == self.setting.tangent_to[e]
        };
        let edges: Vec<bool> = (0..self.setting.roles.len()).into_par_iter().map(is_same_edge).collect();
        let is_same = |(quad, sides): (usize, &[Side; 4])| {
            other.fitted.get(quad).is_some_and(|fitted| Arc::ptr_eq(fitted, &self.fitted[quad]))
                && other.setting.layout.quads[quad] == *sides
                && sides.iter().all(|side| edges[side.edge as usize])
        };
        self.setting.layout.quads.iter().enumerate().map(is_same).collect()
    }

    /// The breaks of an edge before any knots are inserted.
    fn breaks(&self, e: usize) -> Breaks {
        let spans = |&(q, side): &(u32, u8)| self.fitted[q as usize].spans(side as usize);
        let beside = self.setting.beside[e].iter().map(spans);
        Breaks::uniform(beside.min().unwrap_or(1).max(self.network.curves[e].spans()))
    }
}

/// Patches with knots, and where they are.
pub(crate) struct Knots {
    pub(crate) nets: Vec<Arc<Net>>,
    /// Of each edge.
    breaks: Vec<Breaks>,
    /// The largest angle along each edge, degrees.
    angles: Vec<f64>,
}

/// Inserts knots until no angle along an edge that is no feature is above `limit` degrees, as far as that is possible. Beside patches
/// that are the same as `before` they begin with those that were inserted there, so that most of these patches are taken over.
pub(crate) fn insert_knots(
    coarse: Coarse<'_>,
    before: Option<(Coarse<'_>, &Knots)>,
    limit: f64,
    progress: &Progress,
) -> Knots {
    let Coarse { setting, network: Network { curves, .. }, fitted } = coarse;
    let layout = setting.layout;
    let same = match before {
        Some((before, _)) => coarse.same_patches(&before),
        None => vec![false; fitted.len()],
    };
    let known = |e: usize| {
        let (_, knots) = before?;
        setting.beside[e].iter().any(|&(q, _)| same[q as usize]).then(|| &knots.breaks[e])
    };
    let fewest: Vec<Breaks> = (0..layout.edges.len()).map(|e| coarse.breaks(e)).collect();
    let begin = |(e, fewest): (usize, &Breaks)| known(e).map_or_else(|| fewest.clone(), |b| b.union(fewest));
    let mut breaks: Vec<Breaks> = fewest.iter().enumerate().map(begin).collect();
    let kept = |q: usize| {
        let (_, knots) = before.filter(|_| same[q])?;
        let is_known = |side: &Side| knots.breaks[side.edge as usize] == breaks[side.edge as usize];
        layout.quads[q].iter().all(is_known).then(|| Arc::clone(&knots.nets[q]))
    };
    let kept: Vec<Option<Arc<Net>>> = (0..fitted.len()).map(kept).collect();
    let is_kept: Vec<bool> = kept.iter().map(Option::is_some).collect();
    // Also without knots that were inserted: sides were fitted with fewer spans than their curves where these have many.
    let nets = fitted.par_iter().zip(kept).enumerate().map(|(q, (fitted, kept))| {
        let is_fitted = |k: usize| breaks[layout.quads[q][k].edge as usize].are_among(fitted.spans(k));
        kept.unwrap_or_else(|| match (0..4).all(is_fitted) {
            true => Arc::clone(&fitted.net),
            false => Arc::new(with_knots(setting, curves, fitted, q, &breaks)),
        })
    });
    let mut nets: Vec<Arc<Net>> = nets.collect();
    let mut dirty: Vec<bool> =
        setting.beside.iter().map(|beside| !beside.iter().all(|&(q, _)| is_kept[q as usize])).collect();
    let known_angle = |e: usize| before.filter(|_| !dirty[e]).map_or(0.0, |(_, knots)| knots.angles[e]);
    let mut angles: Vec<f64> = (0..layout.edges.len()).map(known_angle).collect();
    loop {
        let divisions: Vec<Option<(Vec<usize>, f64)>> = (0..layout.edges.len())
            .into_par_iter()
            .map(|e| dirty[e].then(|| divide(setting, &nets, &breaks[e], e, limit)))
            .collect();
        let mut changed = vec![false; nets.len()];
        dirty.fill(false);
        for (e, division) in divisions.into_iter().enumerate() {
            let Some((pieces, angle)) = division else { continue };
            angles[e] = angle;
            let more = pieces.iter().sum::<usize>() - pieces.len();
            let fits = |&(q, side): &(u32, u8)| {
                let spans = |k: usize| breaks[layout.quads[q as usize][k % 4].edge as usize].spans();
                let k = side as usize;
                (spans(k) + more + spans(k + 2)) * (spans(k + 1) + spans(k + 3)) <= MOST_CELLS
            };
            if more > 0 && setting.beside[e].iter().all(fits) {
                breaks[e] = breaks[e].divided(|k| pieces[k]);
                setting.beside[e].iter().for_each(|&(q, _)| changed[q as usize] = true);
            }
        }
        if !changed.contains(&true) {
            break;
        }
        nets.par_iter_mut().enumerate().filter(|(q, _)| changed[*q]).for_each(|(q, net)| {
            *net = Arc::new(with_knots(setting, curves, &fitted[q], q, &breaks));
        });
        for (q, _) in changed.iter().enumerate().filter(|(_, changed)| **changed) {
            layout.quads[q].iter().for_each(|side| dirty[side.edge as usize] = true);
        }
    }
    let inserted: usize = breaks.iter().zip(&fewest).map(|(all, fewest)| all.spans() - fewest.spans()).sum();
    let largest = angles.iter().fold(0.0f64, |a, &b| a.max(b));
    progress.remark(&format!(
        "normals: {inserted} knots inserted along edges; {} edges above {limit} degrees, the largest {largest:.3}",
        angles.iter().filter(|&&a| a > limit).count()
    ));
    Knots { nets, breaks, angles }
}

/// The fitted patch with knots at the breaks of its edges.
fn with_knots(
    setting: &Setting<'_>,
    curves: &[Curve],
    fitted: &Fitted,
    quad: usize,
    breaks: &[Breaks],
) -> Net {
    let sides = setting.layout.quads[quad];
    // In the direction of the patch along side k.
    let along = |k: usize| {
        let own = &breaks[sides[k].edge as usize];
        if sides[k].reversed { own.reversed() } else { own.clone() }
    };
    let fitted_u = Breaks::uniform(fitted.spans(0));
    let fitted_v = Breaks::uniform(fitted.spans(1));
    let u = fitted_u.union(&along(0)).union(&along(2).reversed());
    let v = fitted_v.union(&along(1)).union(&along(3).reversed());
    let around = [u.clone(), v.clone(), u.reversed(), v.reversed()];
    let given = [0, 1, 2, 3].map(|k| side_of(setting, quad, k, curves, &around[k]));
    let ribbons = ribbons(&given);

    let width = fitted.net.basis_u.len();
    let rows: Vec<Vec<DVec3>> =
        fitted.net.control.chunks_exact(width).map(|row| fitted_u.refine(row, &u)).collect();
    let (basis_u, basis_v) = (u.basis(), v.basis());
    let (nu, nv) = (basis_u.len(), basis_v.len());
    let mut control = vec![DVec3::ZERO; nu * nv];
    for i in 0..nu {
        let column: Vec<DVec3> = rows.iter().map(|row| row[i]).collect();
        for (j, point) in fitted_v.refine(&column, &v).into_iter().enumerate() {
            control[j * nu + i] = point;
        }
    }
    for k in 0..4 {
        let mut curve = given[k].control.to_vec();
        if given[k].reversed {
            curve.reverse();
        }
        let row = Breaks::uniform(curve.len() / 2 - 1).refine(&curve, &around[k]);
        side_rows(k, nu, nv).into_iter().zip(row).for_each(|((at, _), point)| control[at] = point);
    }
    for (k, ribbon) in ribbons.iter().enumerate() {
        let Some(ribbon) = ribbon else { continue };
        let places = side_rows(k, nu, nv);
        // The first and the last lie on the sides before and after, which are given.
        for (&(on, beside), step) in places.iter().zip(ribbon).take(places.len() - 1).skip(1) {
            control[beside] = control[on] + *step;
        }
    }
    Net { basis_u, basis_v, control }
}

/// Into how many pieces each span of edge `e` is to be divided, and the largest angle along it, degrees.
fn divide(
    setting: &Setting<'_>,
    nets: &[Arc<Net>],
    breaks: &Breaks,
    e: usize,
    limit: f64,
) -> (Vec<usize>, f64) {
    let mut pieces = vec![1; breaks.spans()];
    let other = match (&setting.beside[e][..], setting.roles[e], &setting.tangent_to[e]) {
        (&[_, b], EdgeRole::Smooth, _) => Other::Patch(b),
        (&[_], _, Some(shape)) => Other::Shape(shape),
        _ => return (pieces, 0.0),
    };
    let one = setting.beside[e][0];
    let mut largest = 0.0f64;
    for (k, w) in breaks.as_slice().windows(2).enumerate() {
        let angle = PLACES
            .iter()
            .map(|x| angle(setting.layout, nets, e, one, &other, w[0] + x * (w[1] - w[0])))
            .fold(0.0, f64::max);
        largest = largest.max(angle);
        if angle > MARGIN * limit && w[1] - w[0] > SHORTEST {
            pieces[k] = if angle > QUARTER * limit && w[1] - w[0] > 2.0 * SHORTEST { 4 } else { 2 };
        }
    }
    (pieces, largest)
}

/// What a patch meets.
enum Other<'a> {
    Patch((u32, u8)),
    Shape(&'a RegionShape),
}

/// The angle between the normals on both sides of edge `e` at its parameter `t`, degrees.
fn angle(layout: &QuadLayout, nets: &[Arc<Net>], e: usize, one: (u32, u8), other: &Other<'_>, t: f64) -> f64 {
    let at = |(quad, side): (u32, u8)| -> SurfacePoint {
        let reversed = layout.quads[quad as usize][side as usize].reversed;
        debug_assert_eq!(layout.quads[quad as usize][side as usize].edge as usize, e);
        let (u, v) = Patch::side_parameters(side as usize, if reversed { 1.0 - t } else { t });
        let net = &nets[quad as usize];
        crate::surface::evaluate(&net.basis_u, &net.basis_v, &net.control, u, v)
    };
    let here = at(one);
    let beyond = match other {
        Other::Patch(other) => at(*other).normal(),
        Other::Shape(shape) => shape.normal(here.position),
    };
    let here = here.normal();
    here.cross(beyond).length().atan2(here.dot(beyond)).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::setting::tests::layout;
    use crate::tangent_fit::{Fit, Given};
    use topipe_progress::Units;
    use topipe_quad_matching::{Division, divide as divide_layout};

    /// What a division leaves as it was keeps its knots, and where knots are the same as they would be found anew so are the patches.
    #[test]
    fn knots_are_carried_to_a_division() {
        let (layout, _) = layout("y-form");
        let parameters = Parameters::default();
        let limit = parameters.max_normal_jump;
        let (units, progress) = (Units::none(), Progress::silent());
        let given = Given { parameters: &parameters, units: &units, progress: &progress };
        let fit = Fit::new(&layout, given).unwrap();
        for quad in [7, layout.quads.len() / 2] {
            let wanted = [layout.corners(quad).to_vec()];
            let Division { layout: finer, .. } = divide_layout(&layout, &wanted, &progress).unwrap().unwrap();
            let divided = Fit::divided(&finer, &fit, given).unwrap();
            let kept = (0..finer.quads.len()).filter(|&q| divided.has_same_patch(&fit, q)).count();
            assert!(10 * kept > 9 * layout.quads.len(), "{kept} of {}", layout.quads.len());
            let (carried, coarse) = (divided.knots(), divided.coarse());
            let fresh = insert_knots(coarse, None, limit, &progress);
            let mut differ = 0;
            for e in 0..finer.edges.len() {
                let (pieces, angle) = divide(coarse.setting, &carried.nets, &carried.breaks[e], e, limit);
                assert_eq!(angle, carried.angles[e], "edge {e}");
                assert!(
                    angle <= limit && fresh.angles[e] <= limit && pieces.iter().all(|&n| n == 1),
                    "edge {e}"
                );
                differ += usize::from(carried.breaks[e] != fresh.breaks[e]);
            }
            // Beside a patch that is kept there may be knots that the other side no longer needs.
            assert!(differ < 20, "{differ} edges");
            for (q, sides) in finer.quads.iter().enumerate() {
                let is_same =
                    |side: &Side| carried.breaks[side.edge as usize] == fresh.breaks[side.edge as usize];
                if sides.iter().all(is_same) {
                    assert_eq!(carried.nets[q].control, fresh.nets[q].control, "patch {q}");
                }
            }
        }
    }
}
