//! Beam structures from curve skeletons: what the thesis on skeletonization of beam-like topology optimization results
//! calls reconstruction (section 5.2.3).
//!
//! 1. Each branch of the skeleton becomes one beam, or several where it is not straight ([`Parameters::max_bow`]).
//! 2. Straight axes run through shared nodes, which are moved together so that the points of all branches are nearest
//!    to their axes (total least squares); or each axis is a cubic B-spline.
//! 3. The sections along a beam are averaged over its length: area, second moments, principal axes, torsion constant.
//! 4. The nearest standard profile is chosen by the weighted logarithmic error of these.
//! 5. Beams that come too near to others, and beams that leave the part, are named.
//!
//! [`mod@write`] has the files: JSON, CSV, DXF, a CalculiX deck and a STEP solid ([`solid`]).
//!
//! Guarantees: a structure or a named error, never a panic; equal input gives equal bytes. Nodes of non-design parts stay
//! where they are. As many independent loops as the skeleton has.
//!
//! Non-guarantees: a straight beam is not promised to stay inside the part ([`Beam::protrusion`] says by how much it
//! leaves); a mean section says little of a beam whose sections vary ([`MeanSection::variation`] says how much).

mod branches;
mod clearance;
mod error;
mod fit;
mod parameters;
mod profile;
pub mod solid;
mod spline;
mod structure;
mod table;
pub mod write;

pub use error::BeamError;
pub use parameters::{AxisForm, Load, Parameters, Sections, Support};
pub use profile::{Choice, Profile, Properties, Shape};
pub use structure::{Axis, Beam, Clearance, MeanSection, Node, NodeKind, Station, Structure};
pub use table::standard as standard_profiles;

use glam::DVec3;
use topipe_mesh::TriangleMesh;
use topipe_progress::Progress;
use topipe_skeleton::{PointKind, Section, Skeleton};

/// Turns a skeleton into a structure of beams. With the mesh of the part it also says which beams leave it.
pub fn frame(
    skeleton: &Skeleton,
    mesh: Option<&TriangleMesh>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Structure, BeamError> {
    parameters.check()?;
    check(skeleton)?;
    let mut pieces = divide(skeleton, parameters);
    if pieces.beams.iter().all(|b| b.section.count == 0) {
        return Err(BeamError::NoBeam);
    }
    lend_sections(&mut pieces.beams);
    progress.check()?;
    let Pieces { mut nodes, beams, links, remarks } = pieces;
    if parameters.axis == AxisForm::Straight {
        let lines: Vec<_> = (beams.iter())
            .map(|b| fit::Line { ends: b.ends.map(|n| n as usize), points: b.points.clone() })
            .collect();
        let reach: Vec<f64> = (0..nodes.len() as u32)
            .map(|v| {
                beams.iter().filter(|b| b.ends.contains(&v)).map(|b| b.section.radius()).fold(0.0, f64::max)
            })
            .collect();
        let held = nodes.iter().zip(&reach).map(|(n, &reach)| {
            // A joint is where its axes meet; an interface lies in the plane where the design ends and counts as
            // one more point of its beams; the rest only must not slide along its axis.
            let hold = match n.kind {
                NodeKind::NonDesign => 1e6,
                NodeKind::Interface => 1.0,
                NodeKind::Junction | NodeKind::Bend | NodeKind::End => 1e-3,
            };
            fit::Held { position: n.position, hold, reach }
        });
        let held: Vec<_> = held.collect();
        for (node, position) in nodes.iter_mut().zip(fit::nodes_within_reach(held, &lines)) {
            node.position = position;
        }
    }
    progress.check()?;
    let table = parameters.table();
    let mut structure = Structure {
        nodes,
        beams: Vec::with_capacity(beams.len()),
        links,
        clearances: Vec::new(),
        supports: Vec::new(),
        loads: Vec::new(),
        parameters: parameters.clone(),
        remarks,
    };
    for piece in beams {
        let axis = match parameters.axis {
            AxisForm::Straight => Axis::Straight,
            AxisForm::Spline => {
                let [a, b] = piece.ends.map(|n| structure.position(n));
                let points: Vec<_> = [a].into_iter().chain(piece.points.iter().copied()).chain([b]).collect();
                Axis::Spline(spline::fit(&points))
            }
        };
        let profile = profile::choose(&piece.section, &table, parameters.weights);
        let mut beam = Beam {
            ends: piece.ends,
            axis,
            section: piece.section,
            stations: piece.stations,
            profile,
            rms: 0.0,
            bow: 0.0,
            protrusion: None,
        };
        (beam.rms, beam.bow) = distances(&structure, &beam, &piece.points);
        structure.beams.push(beam);
    }
    if let Some(mesh) = mesh {
        for (beam, out) in clearance::protrusions(&structure, mesh).into_iter().enumerate() {
            structure.beams[beam].protrusion = Some(out);
        }
        progress.check()?;
    }
    structure.clearances = clearance::between(&structure, parameters.clearance);
    structure.hold(&parameters.supports, &parameters.loads)?;
    remark(&mut structure);
    structure.remarks.iter().for_each(|r| progress.remark(r));
    Ok(structure)
}

fn check(skeleton: &Skeleton) -> Result<(), BeamError> {
    let n = skeleton.points.len();
    let damaged = |what: String| Err(BeamError::Skeleton(what));
    if skeleton.kinds.len() != n || skeleton.sections.len() != n {
        return damaged(format!(
            "{n} points, {} kinds and {} sections",
            skeleton.kinds.len(),
            skeleton.sections.len()
        ));
    }
    if let Some(p) = skeleton.points.iter().position(|p| !p.is_finite()) {
        return damaged(format!("point {p} is not finite"));
    }
    match skeleton.edges.iter().find(|[a, b]| a == b || *a.max(b) as usize >= n) {
        Some([a, b]) => damaged(format!("edge {a}-{b} does not join two of its {n} points")),
        None => Ok(()),
    }
}

/// A future beam.
#[derive(Debug, Clone)]
struct Piece {
    ends: [u32; 2],
    /// The points between its nodes.
    points: Vec<DVec3>,
    section: MeanSection,
    stations: Vec<Station>,
}

struct Pieces {
    nodes: Vec<Node>,
    beams: Vec<Piece>,
    links: Vec<[u32; 2]>,
    remarks: Vec<String>,
}

fn divide(skeleton: &Skeleton, parameters: &Parameters) -> Pieces {
    let mut nodes = Vec::new();
    let mut node_of = vec![u32::MAX; skeleton.points.len()];
    let mut add_node = |nodes: &mut Vec<Node>, p: u32, kind: NodeKind| {
        let slot = &mut node_of[p as usize];
        if *slot == u32::MAX {
            *slot = nodes.len() as u32;
            nodes.push(Node { position: skeleton.points[p as usize], kind });
        }
        *slot
    };
    let kind = |p: u32| match skeleton.kinds[p as usize] {
        PointKind::Branch => NodeKind::Bend,
        PointKind::Junction => NodeKind::Junction,
        PointKind::Interface => NodeKind::Interface,
        PointKind::End => NodeKind::End,
        PointKind::NonDesign => NodeKind::NonDesign,
    };
    let branches = branches::find(skeleton);
    let mut beams: Vec<Piece> = Vec::new();
    let mut divided = 0;
    for (k, branch) in branches.iter().enumerate() {
        let chain = &branch.chain;
        let ends = |chain: &[u32]| {
            let (a, b) = (chain[0], chain[chain.len() - 1]);
            [a.min(b), a.max(b)]
        };
        let line: Vec<_> = chain.iter().map(|&p| skeleton.points[p as usize]).collect();
        let twin = branches[..k].iter().any(|other| ends(&other.chain) == ends(chain));
        let cuts = match parameters.axis {
            AxisForm::Spline => Vec::new(),
            AxisForm::Straight => {
                let least = if chain[0] == chain[chain.len() - 1] { 3 } else { 1 + usize::from(twin) };
                let radius = mean_section(skeleton, chain, DVec3::X).radius();
                let most = if radius > 0.0 { parameters.max_bow * radius } else { f64::INFINITY };
                branches::divisions(&line, most, least)
            }
        };
        divided += usize::from(!cuts.is_empty());
        let mut from = 0;
        for to in cuts.into_iter().chain([chain.len() - 1]) {
            let part = &chain[from..=to];
            let [a, b] = [chain[from], chain[to]].map(|p| add_node(&mut nodes, p, kind(p)));
            let direction = (line[to] - line[from]).normalize_or(DVec3::X);
            beams.push(Piece {
                ends: [a, b],
                points: line[from + 1..to.max(from + 1)].to_vec(),
                section: mean_section(skeleton, part, direction),
                stations: stations(skeleton, part, direction),
            });
            from = to;
        }
    }
    let mut links = Vec::new();
    for &[a, b] in &skeleton.edges {
        if [a, b].iter().any(|&p| skeleton.kinds[p as usize] == PointKind::NonDesign) {
            links.push([a, b].map(|p| add_node(&mut nodes, p, kind(p))));
        }
    }
    let mut remarks = Vec::new();
    if divided > 0 {
        remarks.push(format!("{divided} branches are not straight and were divided into several beams"));
    }
    Pieces { nodes, beams, links, remarks }
}

/// The mean over the length of a chain; the tensors of all sections are taken in the plane across `direction`.
fn mean_section(skeleton: &Skeleton, chain: &[u32], direction: DVec3) -> MeanSection {
    let point = |k: usize| skeleton.points[chain[k] as usize];
    let weighted = (0..chain.len()).map(|k| {
        let before = if k > 0 { point(k - 1).distance(point(k)) } else { 0.0 };
        let after = if k + 1 < chain.len() { point(k + 1).distance(point(k)) } else { 0.0 };
        (before + after, &skeleton.sections[chain[k] as usize])
    });
    mean_of(weighted, direction)
}

/// The weighted mean of sections.
fn mean_of<'a>(sections: impl Iterator<Item = (f64, &'a Section)>, direction: DVec3) -> MeanSection {
    let (u, v) = direction.any_orthonormal_pair();
    let (mut weight, mut area, mut square, mut torsion) = (0.0, 0.0, 0.0, 0.0);
    let (mut uu, mut vv, mut uv) = (0.0, 0.0, 0.0);
    let mut count = 0;
    for (w, section) in sections {
        let &Section::Plane { area: a, normal, moments: [large, small], axis, torsion: j } = section else {
            continue;
        };
        let other = normal.cross(axis);
        let about =
            |p: DVec3, q: DVec3| large * axis.dot(p) * axis.dot(q) + small * other.dot(p) * other.dot(q);
        weight += w;
        area += w * a;
        square += w * a * a;
        torsion += w * j;
        uu += w * about(u, u);
        vv += w * about(v, v);
        uv += w * about(u, v);
        count += 1;
    }
    if weight <= 0.0 {
        return MeanSection::default();
    }
    let [area, square, torsion, uu, vv, uv] = [area, square, torsion, uu, vv, uv].map(|x| x / weight);
    let (mean, radius) = ((uu + vv) / 2.0, ((uu - vv) / 2.0).hypot(uv));
    let (s, c) = (0.5 * (2.0 * uv).atan2(uu - vv)).sin_cos();
    MeanSection {
        area,
        moments: [mean + radius, (mean - radius).max(0.0)],
        axis: c * u + s * v,
        torsion,
        variation: (square - area * area).max(0.0).sqrt() / area,
        count,
    }
}

/// The sections along a chain, each with its tensor in the plane across `direction`.
fn stations(skeleton: &Skeleton, chain: &[u32], direction: DVec3) -> Vec<Station> {
    let mut along = vec![0.0];
    for pair in chain.windows(2) {
        let [p, q] = [pair[0], pair[1]].map(|p| skeleton.points[p as usize]);
        along.push(along[along.len() - 1] + p.distance(q));
    }
    let length = along[along.len() - 1];
    (0..chain.len())
        .filter(|&k| matches!(skeleton.sections[chain[k] as usize], Section::Plane { .. }))
        .map(|k| {
            let section = mean_of([(1.0, &skeleton.sections[chain[k] as usize])].into_iter(), direction);
            Station { at: if length > 0.0 { along[k] / length } else { 0.5 }, section }
        })
        .collect()
}

/// Pieces without a section take that of the largest beam beside them, again and again.
fn lend_sections(beams: &mut [Piece]) {
    loop {
        let bare: Vec<usize> = (0..beams.len()).filter(|&b| beams[b].section.area <= 0.0).collect();
        let lent: Vec<_> = (bare.iter())
            .filter_map(|&b| {
                let beside = |other: &&Piece| {
                    other.section.area > 0.0 && other.ends.iter().any(|n| beams[b].ends.contains(n))
                };
                let largest =
                    beams.iter().filter(beside).max_by(|x, y| x.section.area.total_cmp(&y.section.area))?;
                Some((b, MeanSection { count: 0, ..largest.section }))
            })
            .collect();
        if lent.is_empty() {
            // What is joined to no beam at all (another component) has the mean of everything.
            let known: Vec<_> = beams.iter().map(|b| b.section).filter(|s| s.area > 0.0).collect();
            let mut sorted = known.clone();
            sorted.sort_by(|a, b| a.area.total_cmp(&b.area));
            if let Some(middle) = sorted.get(sorted.len() / 2) {
                bare.iter().for_each(|&b| beams[b].section = MeanSection { count: 0, ..*middle });
            }
            return;
        }
        lent.into_iter().for_each(|(b, section)| beams[b].section = section);
    }
}

fn distances(structure: &Structure, beam: &Beam, points: &[DVec3]) -> (f64, f64) {
    let line = structure.line(beam, if beam.axis == Axis::Straight { 1 } else { 64 });
    let off = |p: DVec3| {
        (line.windows(2))
            .map(|w| {
                let along = w[1] - w[0];
                let t =
                    ((p - w[0]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                p.distance(w[0] + t * along)
            })
            .fold(f64::INFINITY, f64::min)
    };
    let all: Vec<f64> = points.iter().map(|&p| off(p)).collect();
    let square: f64 = all.iter().map(|d| d * d).sum();
    ((square / all.len().max(1) as f64).sqrt(), all.into_iter().fold(0.0, f64::max))
}

fn remark(structure: &mut Structure) {
    let beams = &structure.beams;
    let mut remarks = Vec::new();
    let list = |wanted: &dyn Fn(&Beam) -> bool| {
        let names: Vec<_> = (0..beams.len()).filter(|&b| wanted(&beams[b])).map(|b| b.to_string()).collect();
        (names.len(), names.join(", "))
    };
    let (count, which) = list(&|b| b.section.count == 0);
    if count > 0 {
        remarks.push(format!(
            "{count} beams are too short to have a section and take that of a neighbour: {which}"
        ));
    }
    let (count, which) = list(&|b| b.section.variation > 0.25);
    if count > 0 {
        remarks.push(format!("the area of {count} beams varies by more than a quarter along them: {which}"));
    }
    let (count, which) = list(&|b| b.protrusion.is_some_and(|p| p > b.section.radius()));
    if count > 0 {
        remarks.push(format!("{count} beams leave the part by more than their radius: {which}"));
    }
    let (count, which) = list(&|b| b.profile.as_ref().is_some_and(|p| p.error > 0.5));
    if count > 0 {
        remarks.push(format!("no profile of the table is near the sections of {count} beams: {which}"));
    }
    let near = structure.clearances.len();
    if near > 0 {
        let overlap = structure.clearances.iter().filter(|c| c.distance < 0.0).count();
        remarks.push(format!(
            "{near} pairs of beams without a common node are too near, {overlap} of them overlap"
        ));
    }
    structure.remarks.extend(remarks);
}
