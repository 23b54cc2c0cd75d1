//! The surface at the macro-vertices: where they are, the tangent plane of each sector, and the directions of the
//! edges in it.

use crate::corners::{FAR, LEAVES};
use crate::crease_curves::{PASSES, direction};
use crate::fans::{EdgeRole, Sector, Sectors, Spoke};
use crate::local_surface::{Known, LocalSurface, local_surface};
use crate::samples::PatchSamples;
use crate::tangents::{spread_around, spread_between};
use crate::{EdgeCurve, SplineFitError};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::{DVec3, RegionShape};
use topipe_quad_matching::QuadLayout;

/// What is known at the corner of a sector.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub(crate) surface: LocalSurface,
    /// Unit directions of the sector's spokes, out of the vertex, in the tangent plane.
    pub(crate) directions: Vec<DVec3>,
}

/// The frame of a sector and what it depends on, which is the same in many a refinement.
#[derive(Debug, Clone, Default)]
pub(crate) struct KnownFrame {
    /// Radii of the local fits along its spokes, mm, and the common tangent of the creases through its vertex.
    from: (Vec<f64>, Option<DVec3>),
    frame: Option<Frame>,
}

/// The frames of all vertices.
pub(crate) struct Frames {
    /// Positions of the macro-vertices.
    pub(crate) positions: Vec<DVec3>,
    /// One per sector.
    pub(crate) frames: Vec<Frame>,
}

/// What the frames are computed from.
pub(crate) struct Given<'a> {
    pub(crate) layout: &'a QuadLayout,
    pub(crate) roles: &'a [EdgeRole],
    pub(crate) sectors: &'a Sectors,
    pub(crate) samples: &'a [Arc<PatchSamples>],
    /// Curves beside region faces, and the vertices on them.
    pub(crate) curves: &'a [Option<EdgeCurve>],
    pub(crate) vertices: &'a [Option<DVec3>],
    /// The shapes that patches meet smoothly along their borders.
    pub(crate) tangent_to: &'a [Option<RegionShape>],
    /// Radius of the local fits, one per edge.
    pub(crate) reach: &'a [f64],
}

impl<'a> Given<'a> {
    /// Points of the given quads' faces, by quad with the ball around them.
    pub(crate) fn of_quads(&self, quads: &[(u32, u8)]) -> Vec<&'a PatchSamples> {
        quads.iter().map(|&(q, _)| &*self.samples[q as usize]).collect()
    }

    /// The mesh points along a spoke, from its vertex on.
    pub(crate) fn path(&self, spoke: Spoke) -> Vec<DVec3> {
        let mesh = &self.layout.part.mesh;
        let mut points: Vec<DVec3> =
            self.layout.edges[spoke.edge as usize].path.iter().map(|&v| mesh.position(v)).collect();
        if spoke.reversed {
            points.reverse();
        }
        points
    }

    fn is_free(&self, spoke: Spoke) -> bool {
        self.roles[spoke.edge as usize] == EdgeRole::Smooth
    }

    /// The direction of a crease or border as it leaves its vertex.
    pub(crate) fn fixed_direction(&self, spoke: Spoke, tangents: &[Option<DVec3>]) -> Option<DVec3> {
        if let Some(curve) = &self.curves[spoke.edge as usize] {
            let n = curve.control.len();
            let (a, b) = if spoke.reversed { (n - 1, n - 2) } else { (0, 1) };
            return (curve.control[b] - curve.control[a]).try_normalize();
        }
        let path = self.path(spoke);
        let own = direction(&path, self.reach[spoke.edge as usize]);
        // A curve that passes through the vertex has one tangent there.
        match tangents[self.layout.start_of(spoke) as usize] {
            Some(tangent) if own.dot(tangent).abs() > PASSES => Some(tangent * own.dot(tangent).signum()),
            _ => own.try_normalize(),
        }
    }
}

trait SpokeStart {
    fn start_of(&self, spoke: Spoke) -> u32;
}

impl SpokeStart for QuadLayout {
    fn start_of(&self, spoke: Spoke) -> u32 {
        self.edges[spoke.edge as usize].ends[spoke.reversed as usize]
    }
}

/// The common tangents of the crease curves that pass through each vertex: where two of them meet in nearly opposite
/// directions.
pub(crate) fn crease_tangents(given: &Given<'_>) -> Vec<Option<DVec3>> {
    let mut leaving: Vec<Vec<DVec3>> = vec![Vec::new(); given.layout.vertices.len()];
    let mut on_border = vec![false; given.layout.vertices.len()];
    for (e, edge) in given.layout.edges.iter().enumerate() {
        match given.roles[e] {
            EdgeRole::Crease => {
                for reversed in [false, true] {
                    let spoke = Spoke { edge: e as u32, reversed };
                    let own = direction(&given.path(spoke), given.reach[e]);
                    leaving[edge.ends[reversed as usize] as usize].push(own);
                }
            }
            EdgeRole::Smooth => {}
            EdgeRole::Border | EdgeRole::Inner => {
                edge.ends.iter().for_each(|&v| on_border[v as usize] = true)
            }
        }
    }
    leaving
        .into_iter()
        .zip(on_border)
        .map(|(directions, on_border)| match directions[..] {
            [a, b] if !on_border && a.dot(b) < -PASSES => (a - b).try_normalize(),
            _ => None,
        })
        .collect()
}

/// Two directions at a corner give its normal where the angle between them is at least this: sine of 20 degrees.
const CORNER: f64 = 0.342;

impl Frames {
    /// Frames that are `known` from another call for the same setting are not computed again.
    pub(crate) fn new(
        given: &Given<'_>,
        tangents: &[Option<DVec3>],
        known: &mut Vec<KnownFrame>,
    ) -> Result<Self, SplineFitError> {
        let layout = given.layout;
        let mesh = &layout.part.mesh;
        let sectors = &given.sectors.list;
        // A vertex inside the free surface may move; any other has its place.
        let mut positions: Vec<Option<DVec3>> = given.vertices.to_vec();
        for (v, position) in positions.iter_mut().enumerate() {
            if position.is_none() && layout.part.frozen[layout.vertices[v].index()] {
                *position = Some(mesh.position(layout.vertices[v]));
            }
        }
        for sector in sectors.iter().filter(|s| !s.closed || s.spokes.iter().any(|s| !given.is_free(*s))) {
            let v = sector.vertex as usize;
            positions[v].get_or_insert(mesh.position(layout.vertices[v]));
        }
        known.resize_with(sectors.len(), KnownFrame::default);
        let frames: Vec<Frame> = sectors
            .par_iter()
            .zip(known)
            .map(|(sector, known)| {
                let v = sector.vertex as usize;
                let at = positions[v].unwrap_or(mesh.position(layout.vertices[v]));
                let reach: Vec<f64> = sector.spokes.iter().map(|s| given.reach[s.edge as usize]).collect();
                let from = (reach, tangents[v]);
                if known.frame.is_none() || known.from != from {
                    let frame = frame(given, sector, at, positions[v].is_some(), tangents);
                    *known = KnownFrame { from, frame };
                }
                let singular =
                    SplineFitError::Singular { what: "vertex", index: v, x: at.x, y: at.y, z: at.z };
                known.frame.clone().ok_or(singular)
            })
            .collect::<Result<_, _>>()?;
        for (sector, frame) in sectors.iter().zip(&frames) {
            positions[sector.vertex as usize].get_or_insert(frame.surface.position);
        }
        // Vertices that no quad touches have their place from the borders.
        let positions = positions
            .into_iter()
            .enumerate()
            .map(|(v, p)| p.unwrap_or(mesh.position(layout.vertices[v])))
            .collect();
        Ok(Self { positions, frames })
    }
}

fn frame(
    given: &Given<'_>,
    sector: &Sector,
    at: DVec3,
    placed: bool,
    tangents: &[Option<DVec3>],
) -> Option<Frame> {
    let reach =
        sector.spokes.iter().map(|s| given.reach[s.edge as usize]).sum::<f64>() / sector.spokes.len() as f64;
    let fixed: Vec<Option<DVec3>> = sector
        .spokes
        .iter()
        .map(|&s| if given.is_free(s) { None } else { given.fixed_direction(s, tangents) })
        .collect();
    let creases: Vec<DVec3> = fixed.iter().copied().flatten().collect();
    let fit = |known| local_surface(&given.of_quads(&sector.quads), at, known, reach);
    let shape = sector.spokes.iter().find_map(|s| given.tangent_to[s.edge as usize].as_ref());
    let known = match creases[..] {
        // The sector continues a plane or cylinder.
        _ if shape.is_some() => Known::Normal(shape.map_or(DVec3::ZERO, |shape| shape.normal(at))),
        [] if placed => Known::Point,
        [] => Known::Nothing,
        [a] => Known::Tangent(a),
        [a, .., b] => {
            let across = a.cross(b);
            let rough = fit(Known::Point).normal;
            let normal = across.normalize_or_zero();
            // Nearly parallel directions fix the plane too: two patches between them have no other in common. Where there is
            // one, and noise turns the plane away from the mesh, the mesh's own is taken.
            let is_certain = sector.quads.len() > 1 || normal.dot(rough).abs() >= FAR;
            if across.length() > CORNER || across.length() > LEAVES && is_certain {
                Known::Normal(if normal.dot(rough) < 0.0 { -normal } else { normal })
            } else {
                // One curve that passes through, in opposite directions, or two that leave side by side.
                Known::Tangent((a + b * a.dot(b).signum()).try_normalize().unwrap_or(a))
            }
        }
    };
    let mut surface = fit(known);
    let borders: Vec<(DVec3, DVec3)> = sector
        .spokes
        .iter()
        .zip(&fixed)
        .filter_map(|(s, along)| {
            let along = (*along)?;
            let shape = given.tangent_to[s.edge as usize].as_ref()?;
            Some((along, -shape.turning(at, along)))
        })
        .collect();
    surface.bend_along(&borders);
    let (x, y) = {
        let first = fixed[0].unwrap_or_else(|| surface.normal.any_orthonormal_vector());
        let x = (first - first.dot(surface.normal) * surface.normal)
            .try_normalize()
            .unwrap_or_else(|| surface.normal.any_orthonormal_vector());
        (x, surface.normal.cross(x))
    };
    let mut angles: Vec<f64> = sector
        .spokes
        .iter()
        .zip(&fixed)
        .map(|(&spoke, fixed)| {
            let d = fixed.unwrap_or_else(|| {
                // Towards a point some way along the edge: the first mesh edge says little.
                let path = given.path(spoke);
                point_at(&path, 0.3) - at
            });
            d.dot(y).atan2(d.dot(x))
        })
        .collect();
    if !sector.closed {
        spread_between(&mut angles);
    } else if creases.is_empty() {
        spread_around(&mut angles);
    } else {
        // From the single crease around to itself.
        let start = fixed.iter().position(Option::is_some).unwrap_or(0);
        angles.rotate_left(start);
        angles.push(angles[0]);
        spread_between(&mut angles);
        angles.pop();
        angles.rotate_right(start);
    }
    let directions = angles
        .iter()
        .zip(&fixed)
        .map(|(angle, fixed)| fixed.unwrap_or(angle.cos() * x + angle.sin() * y))
        .collect();
    Some(Frame { surface, directions })
}

/// The point of a polyline at a fraction of its length.
pub(crate) fn point_at(points: &[DVec3], share: f64) -> DVec3 {
    point_along(points, &crate::samples::arc_length(points), share)
}

/// The same where the arc lengths of its points are known.
pub(crate) fn point_along(points: &[DVec3], along: &[f64], share: f64) -> DVec3 {
    let k = along.partition_point(|&s| s <= share).clamp(1, points.len() - 1);
    let step = along[k] - along[k - 1];
    let x = if step > 0.0 { (share - along[k - 1]) / step } else { 0.0 };
    points[k - 1].lerp(points[k], x.clamp(0.0, 1.0))
}
