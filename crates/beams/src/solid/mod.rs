//! The structure as closed solids: true cylinders (or prisms of the profiles) between convex joints.
//!
//! No surfaces are intersected. Each beam ends in planes across it, at collars of the joints (`joint` says how far from
//! the node); a joint is the convex hull of its collars and a ball, so all its faces are triangles, and everything fits
//! exactly. A free end, or an end at an interface, is cut off flat at its node: what is not the optimizer's is not
//! modelled. Beams too short to have a joint at both ends become part of one joint.
//!
//! Guarantees: each body is closed, each edge has two faces, one each way; the diameters of round beams are exact.
//! Not guaranteed: that beams without a common node do not run through each other ([`crate::Clearance`] names them), and
//! that the bodies have as many holes as the structure when beams around a hole are taken into one joint (a remark says
//! when that has happened).

mod brep;
mod hull;
mod joint;
mod strut;
mod triangulate;

pub use brep::{Body, Brep, Curve, Edge, Face, Surface};
pub use triangulate::triangulate;

use crate::{BeamError, Structure};
use glam::DVec3;
use joint::{Arm, Joint, Obstacle};
use std::collections::BTreeMap;
use strut::{Outline, Strut};

/// A solid and what had to be done to get it.
#[derive(Debug, Clone)]
pub struct Solid {
    /// Its boundary.
    pub brep: Brep,
    /// What a user should know.
    pub remarks: Vec<String>,
}

/// Share of a beam that the joints at its ends may take together.
const MOST: f64 = 0.9;

/// Builds the solids of a structure, one for each connected part.
pub fn solid(structure: &Structure) -> Result<Solid, BeamError> {
    let (positions, struts) = strut::struts(structure);
    let mut groups = Groups::new(positions.len());
    let mut merged = 0;
    // Beams that leave no room between their joints go, the worst first, until all others do.
    let joints = loop {
        match build(&groups, &positions, &struts) {
            Ok(joints) => break joints,
            Err(Failure { short: Some(s), .. }) => {
                groups.join(struts[s].ends);
                merged += 1;
            }
            Err(Failure { at, .. }) => return Err(BeamError::Solid { at: at.to_array() }),
        }
    };
    let inner = |s: &Strut| groups.of(s.ends[0]) == groups.of(s.ends[1]);
    if struts.iter().all(inner) {
        let at = positions.first().copied().unwrap_or(DVec3::ZERO);
        return Err(BeamError::Solid { at: at.to_array() });
    }
    let mut remarks = Vec::new();
    if merged > 0 {
        let count = struts.iter().filter(|s| inner(s)).count();
        remarks.push(format!("solid: {count} short beams became part of the joints at their ends"));
        // A joint has no hole: beams within one that close a loop lose it.
        let lost = count - merged;
        if lost > 0 {
            remarks.push(format!("solid: {lost} loops are filled by a joint"));
        }
    }
    let used =
        |n: usize| struts.iter().any(|s| !inner(s) && s.ends.iter().any(|&e| groups.of(e) == groups.of(n)));
    let lone = (0..positions.len()).filter(|&n| groups.of(n) == n && !used(n));
    let lone = lone.filter(|&n| struts.iter().any(|s| groups.of(s.ends[0]) == n)).count();
    if lone > 0 {
        remarks.push(format!("solid: {lone} parts of short beams only are left out"));
    }
    let brep = assemble(&joints, &positions, &struts, &groups);
    if brep.bodies.len() > 1 {
        remarks.push(format!("solid: {} separate bodies", brep.bodies.len()));
    }
    Ok(Solid { brep, remarks })
}

/// Which nodes share a joint.
struct Groups {
    root: Vec<usize>,
}

impl Groups {
    fn new(n: usize) -> Self {
        Self { root: (0..n).collect() }
    }

    fn of(&self, node: usize) -> usize {
        self.root[node]
    }

    fn join(&mut self, [a, b]: [usize; 2]) {
        let (keep, drop) = (self.of(a).min(self.of(b)), self.of(a).max(self.of(b)));
        self.root.iter_mut().filter(|r| **r == drop).for_each(|r| *r = keep);
    }
}

struct Failure {
    /// The strut that is in the way.
    short: Option<usize>,
    at: DVec3,
}

fn build(groups: &Groups, positions: &[DVec3], struts: &[Strut]) -> Result<BTreeMap<usize, Joint>, Failure> {
    let mut arms: BTreeMap<usize, Vec<Arm>> = BTreeMap::new();
    for (s, strut) in struts.iter().enumerate() {
        if groups.of(strut.ends[0]) != groups.of(strut.ends[1]) {
            for end in 0..2 {
                let arm = joint::arm(struts, s, end, positions);
                arms.entry(groups.of(strut.ends[end])).or_default().push(arm);
            }
        }
    }
    let mut thickness = vec![0.0f64; positions.len()];
    for strut in struts {
        strut.ends.iter().for_each(|&n| thickness[n] = thickness[n].max(strut.reach()));
    }
    let length = |s: usize| positions[struts[s].ends[0]].distance(positions[struts[s].ends[1]]);
    let mut joints: BTreeMap<usize, Joint> = BTreeMap::new();
    let mut short: Option<(f64, usize)> = None;
    let mut note = |s: usize| {
        // Of all that are in the way the shortest for its width first.
        let slender = length(s) / struts[s].reach().max(f64::MIN_POSITIVE);
        if short.is_none_or(|(least, _)| slender < least) {
            short = Some((slender, s));
        }
    };
    for (&group, arms) in &arms {
        let nodes: Vec<usize> = (0..positions.len()).filter(|&n| groups.of(n) == group).collect();
        if nodes.len() == 1 && arms.len() == 1 {
            continue; // cut off flat
        }
        match Joint::build(nodes, positions, &thickness, arms.clone(), |arm| MOST * length(arm.strut)) {
            Ok(joint) => {
                joints.insert(group, joint);
            }
            Err(Obstacle::TooShort(k)) => note(arms[k].strut),
            Err(Obstacle::Hull) => {
                let shortest =
                    arms.iter().min_by(|a, b| length(a.strut).total_cmp(&length(b.strut))).map(|a| a.strut);
                shortest.into_iter().for_each(&mut note);
            }
        }
    }
    // Both ends together.
    let mut taken = vec![0.0; struts.len()];
    for arm in joints.values().flat_map(|j| &j.arms) {
        taken[arm.strut] += arm.reach;
    }
    (0..struts.len()).filter(|&s| taken[s] > MOST * length(s)).for_each(&mut note);
    match short {
        None => Ok(joints),
        Some((_, s)) => Err(Failure { short: Some(s), at: positions[struts[s].ends[0]] }),
    }
}

fn assemble(joints: &BTreeMap<usize, Joint>, positions: &[DVec3], struts: &[Strut], groups: &Groups) -> Brep {
    let mut brep = Brep::default();
    // Faces by the joint group they hang together with; bodies are formed at the end.
    let mut body = Groups::new(positions.len());
    let mut faces: Vec<(usize, u32)> = Vec::new();
    let mut voids: Vec<(usize, Vec<u32>)> = Vec::new();
    // Where each strut ends: the distance from its node and the collar there.
    let mut ends: Vec<[(f64, Option<Vec<u32>>); 2]> =
        struts.iter().map(|_| [(0.0, None), (0.0, None)]).collect();
    for (&group, joint) in joints {
        joint.nodes.iter().for_each(|&n| body.join([group, n]));
        let ids: BTreeMap<usize, u32> = {
            let mut used: Vec<usize> = joint.triangles.iter().flatten().copied().collect();
            used.sort_unstable();
            used.dedup();
            used.into_iter().map(|p| (p, brep.vertex(joint.points[p]))).collect()
        };
        for t in &joint.triangles {
            let [a, b, c] = t.map(|k| joint.points[k]);
            let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
            let sides = brep.polygon(&t.map(|k| ids[&k]));
            faces.push((group, brep.face(Surface::Plane { origin: a, normal }, vec![sides])));
        }
        for (k, arm) in joint.arms.iter().enumerate() {
            let collar = (0..Joint::CORNERS).map(|c| ids[&(k * Joint::CORNERS + c)]).collect();
            ends[arm.strut][arm.end] = (arm.reach, Some(collar));
        }
    }
    for (strut, ends) in struts.iter().zip(&ends) {
        let [a, b] = strut.ends;
        if groups.of(a) == groups.of(b) {
            continue;
        }
        let along = (positions[b] - positions[a]).normalize_or(DVec3::X);
        let planes = [positions[a] + ends[0].0 * along, positions[b] - ends[1].0 * along];
        let collars = [ends[0].1.as_deref(), ends[1].1.as_deref()];
        let group = groups.of(a);
        body.join([a, b]);
        let made = bar(&mut brep, strut, &strut.outline, planes, collars, false);
        faces.extend(made.into_iter().map(|f| (group, f)));
        if let Some(bore) = &strut.bore {
            // The bore stops a wall before a flat end, and at the collar of a joint.
            let inset = |k: usize| if collars[k].is_some() { 0.0 } else { strut.wall };
            let planes = [
                planes[0] + (inset(0) + 0.01 * strut.wall) * along,
                planes[1] - (inset(1) + 0.01 * strut.wall) * along,
            ];
            if (planes[1] - planes[0]).dot(along) > strut.wall {
                voids.push((group, bar(&mut brep, strut, bore, planes, [None, None], true)));
            }
        }
    }
    let mut bodies: BTreeMap<usize, Body> = BTreeMap::new();
    for (group, face) in faces {
        bodies.entry(body.of(group)).or_default().outer.push(face);
    }
    for (group, shell) in voids {
        bodies.entry(body.of(group)).or_default().voids.push(shell);
    }
    brep.bodies = bodies.into_values().collect();
    brep
}

/// The faces of one bar between two planes: its side, and at each end a flat cap or the collar around it. `hole` turns
/// all faces about.
fn bar(
    brep: &mut Brep,
    strut: &Strut,
    outline: &Outline,
    [start, end]: [DVec3; 2],
    collars: [Option<&[u32]>; 2],
    hole: bool,
) -> Vec<u32> {
    let along = (end - start).normalize_or(DVec3::X);
    let up = (strut.up - strut.up.dot(along) * along).normalize_or(along.any_orthonormal_vector());
    // `side`, `up`, `along` are right-handed, so that outlines turn about `along`.
    let side = up.cross(along);
    let mut faces = Vec::new();
    let flip = |mut list: Vec<(u32, bool)>| {
        list.reverse();
        list.iter_mut().for_each(|e| e.1 = !e.1);
        list
    };
    let sense = |list: Vec<(u32, bool)>, turned: bool| if turned != hole { flip(list) } else { list };
    // The outline at either end, turning about `along`.
    let rims: [Vec<(u32, bool)>; 2] = match outline {
        Outline::Circle(radius) => {
            let corners = [start, end].map(|c| [side, -side].map(|d| brep.vertex(c + *radius * d)));
            let rims = [(start, corners[0]), (end, corners[1])].map(|(center, [p, q])| {
                vec![(brep.arc([p, q], center, along), true), (brep.arc([q, p], center, along), true)]
            });
            let lines = [0, 1].map(|k| brep.line(corners[0][k], corners[1][k]));
            for k in 0..2 {
                // Along the first rim, up the far line, back along the second rim, down the near line.
                let far = lines[1 - k];
                let near = lines[k];
                let list = vec![rims[0][k], far, (rims[1][k].0, false), (near.0, !near.1)];
                let surface = Surface::Cylinder { origin: start, axis: along, radius: *radius, hole };
                faces.push(brep.face(surface, vec![sense(list, false)]));
            }
            rims
        }
        Outline::Polygon(points) => {
            let corners: [Vec<u32>; 2] =
                [start, end].map(|c| points.iter().map(|p| brep.vertex(c + p.x * side + p.y * up)).collect());
            let n = points.len();
            for k in 0..n {
                let next = (k + 1) % n;
                let list = brep.polygon(&[corners[0][k], corners[0][next], corners[1][next], corners[1][k]]);
                let out = points[next] - points[k];
                let out = (out.y * side - out.x * up).normalize_or(side);
                let normal = if hole { -out } else { out };
                let origin = brep.vertices[corners[0][k] as usize];
                faces.push(brep.face(Surface::Plane { origin, normal }, vec![sense(list, false)]));
            }
            corners.map(|c| brep.polygon(&c))
        }
    };
    for (k, rim) in rims.into_iter().enumerate() {
        let origin = [start, end][k];
        match collars[k] {
            // Flat: looks away from the bar.
            None => {
                let normal = if (k == 0) != hole { -along } else { along };
                let list = sense(rim, k == 0);
                faces.push(brep.face(Surface::Plane { origin, normal }, vec![list]));
            }
            // The collar looks along the bar, away from the joint; the bar stands in a hole of it.
            Some(collar) => {
                let normal = if k == 0 { along } else { -along };
                // Collars turn about the direction of their arm, which is away from the joint.
                let outer = brep.polygon(collar);
                let inner = sense(rim, k == 0);
                faces.push(brep.face(Surface::Plane { origin, normal }, vec![outer, inner]));
            }
        }
    }
    faces
}
