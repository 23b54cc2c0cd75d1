//! The frame model of a beam structure, held and loaded where the solid is.
//!
//! Supports and loads act on surfaces of the solid, and the frame has none. Each connected patch of a supported or loaded
//! surface is passed to one node: that of the non-design part it belongs to (the nearest one), or, in a structure without
//! non-design parts, the nearest node. Forces keep their moment about that node, so that the frame is loaded by the same wrench.

use topipe_beams::{Beam, MeanSection, NodeKind, Profile, Shape, Structure};
use topipe_fem::frame::{Element, Frame, Joint, NodalLoad, Section};
use topipe_fem::{Attachment, SurfacePoint};
use topipe_mesh::DVec3;

/// A frame, and which beam each of its elements is a piece of.
pub(crate) struct FrameModel {
    pub(crate) frame: Frame,
    pub(crate) beam_of_element: Vec<usize>,
}

/// Where the nodes of a structure are held and loaded, whatever the sections.
pub(crate) struct Placement {
    clamped: Vec<u32>,
    held: Vec<(u32, [bool; 3])>,
    loads: Vec<NodalLoad>,
    /// By link, how deep beneath its foot the part is held, mm.
    depths: Vec<Option<f64>>,
}

impl Placement {
    /// `gap` (mm) is the distance between points of one patch at the most.
    pub(crate) fn new(structure: &Structure, attachment: &Attachment, gap: f64) -> Self {
        let mut placement =
            Self { clamped: Vec::new(), held: Vec::new(), loads: Vec::new(), depths: Vec::new() };
        let mut depths = vec![f64::INFINITY; structure.links.len()];
        for (points, directions) in &attachment.supports {
            for patch in patches(points, gap) {
                let node = node_for(structure, points, &patch);
                if *directions != [true; 3] {
                    placement.held.push((node, *directions));
                    continue;
                }
                placement.clamped.push(node);
                for (link, depth) in
                    structure.links.iter().zip(&mut depths).filter(|(l, _)| l.contains(&node))
                {
                    let foot = structure.position(if link[0] == node { link[1] } else { link[0] });
                    let nearest = patch.iter().map(|&k| points[k].point.distance(foot));
                    *depth = nearest.fold(*depth, f64::min);
                }
            }
        }
        placement.depths = depths.into_iter().map(|d| d.is_finite().then_some(d)).collect();
        for (points, forces, case) in &attachment.loads {
            for patch in patches(points, gap) {
                let node = node_for(structure, points, &patch);
                let at = structure.position(node);
                let mut load = NodalLoad { node, force: DVec3::ZERO, moment: DVec3::ZERO, case: *case };
                for k in patch {
                    load.force += forces[k];
                    load.moment += (points[k].point - at).cross(forces[k]);
                }
                placement.loads.push(load);
            }
        }
        placement
    }
}

/// The frame model. `profiles` takes the standard profiles instead of the mean sections.
pub(crate) fn model(
    structure: &Structure,
    placement: &Placement,
    material: [f64; 2],
    profiles: bool,
) -> FrameModel {
    let [young, poisson] = material;
    let mut frame = Frame {
        young,
        poisson,
        nodes: structure.nodes.iter().map(|n| n.position).collect(),
        clamped: placement.clamped.clone(),
        held: placement.held.clone(),
        loads: placement.loads.clone(),
        ..Frame::default()
    };
    // An interface stands on its non-design part, which gives way beneath it.
    for (&[a, b], &depth) in structure.links.iter().zip(&placement.depths) {
        let is_part = |v: u32| structure.nodes[v as usize].kind == NodeKind::NonDesign;
        let (foot, part) = if is_part(a) { (b, a) } else { (a, b) };
        let beams = structure.beams.iter().filter(|beam| beam.ends.contains(&foot));
        let largest = beams.max_by(|x, y| x.section.area.total_cmp(&y.section.area));
        match largest.filter(|_| is_part(part)) {
            Some(beam) => {
                let [p, q] = beam.ends.map(|v| structure.position(v));
                let area = end_area(beam, foot, profiles);
                let copy = frame.nodes.len() as u32;
                frame.nodes.push(structure.position(foot));
                frame.links.push([part, copy]);
                let along = (q - p).normalize_or(DVec3::X);
                frame.joints.push(Joint::foot([copy, foot], along, area, depth, young, poisson));
            }
            None => frame.links.push([a, b]),
        }
    }
    let mut beam_of_element = Vec::new();
    for (number, beam) in structure.beams.iter().enumerate() {
        if is_swallowed(structure, number) {
            frame.links.push(beam.ends);
            continue;
        }
        let fine = structure.line(beam, 256);
        let at = |t: f64| {
            let k = ((t * 256.0) as usize).min(255);
            fine[k].lerp(fine[k + 1], t * 256.0 - k as f64)
        };
        let mut previous = beam.ends[0];
        for (end, section, axis) in steps(structure, beam, profiles, poisson) {
            let next = if end >= 1.0 {
                beam.ends[1]
            } else {
                frame.nodes.push(at(end));
                (frame.nodes.len() - 1) as u32
            };
            // A piece of no length joins its nodes.
            if frame.nodes[previous as usize].distance(frame.nodes[next as usize])
                > 1e-9 * beam.section.radius()
            {
                frame.elements.push(Element { nodes: [previous, next], section, axis });
                beam_of_element.push(number);
            } else {
                frame.links.push([previous, next]);
            }
            previous = next;
        }
    }
    FrameModel { frame, beam_of_element }
}

/// Whether all of a beam lies in the material of a longer one that it is joined to: both of its ends are nearer to that one's axis
/// than it is thick. It is a part of the joint then and has no length that could give way.
fn is_swallowed(structure: &Structure, number: usize) -> bool {
    let beam = &structure.beams[number];
    let length = structure.length(beam);
    structure.beams.iter().enumerate().any(|(k, other)| {
        k != number
            && other.ends.iter().any(|v| beam.ends.contains(v))
            && structure.length(other) > length
            && beam.ends.iter().all(|&v| {
                let line = structure.line(other, 32);
                let p = structure.position(v);
                let near = line.windows(2).map(|w| {
                    let along = w[1] - w[0];
                    let t = (p - w[0]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
                    p.distance(w[0] + t.clamp(0.0, 1.0) * along)
                });
                near.fold(f64::INFINITY, f64::min) < other.section.radius()
            })
    })
}

fn node_for(structure: &Structure, points: &[SurfacePoint], patch: &[usize]) -> u32 {
    let area: f64 = patch.iter().map(|&k| points[k].area).sum();
    let middle = patch.iter().map(|&k| points[k].point * points[k].area).sum::<DVec3>() / area;
    let nearest = |kind: Option<NodeKind>| {
        let nodes =
            structure.nodes.iter().enumerate().filter(|(_, n)| kind.is_none_or(|kind| n.kind == kind));
        nodes
            .map(|(v, n)| (n.position.distance_squared(middle), v as u32))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, v)| v)
    };
    nearest(Some(NodeKind::NonDesign)).or_else(|| nearest(None)).unwrap_or(0)
}

/// Groups of points no farther apart than about `gap`, in the order of their first points.
fn patches(points: &[SurfacePoint], gap: f64) -> Vec<Vec<usize>> {
    // Points are put into boxes of that size; boxes that touch belong together.
    let place = |p: DVec3| (p / gap).floor().to_array().map(|x| x as i64);
    let mut boxes: std::collections::BTreeMap<[i64; 3], Vec<usize>> = std::collections::BTreeMap::new();
    for (k, p) in points.iter().enumerate() {
        boxes.entry(place(p.point)).or_default().push(k);
    }
    let mut done = std::collections::BTreeSet::new();
    let mut groups = Vec::new();
    for &start in boxes.keys() {
        if !done.insert(start) {
            continue;
        }
        let mut stack = vec![start];
        let mut group = Vec::new();
        while let Some(at) = stack.pop() {
            group.extend(boxes.get(&at).into_iter().flatten().copied());
            for k in 0..27 {
                let next = [at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1];
                if boxes.contains_key(&next) && done.insert(next) {
                    stack.push(next);
                }
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups.sort_by_key(|group| group.first().copied());
    groups
}

/// Area of a beam where it meets a node.
fn end_area(beam: &Beam, node: u32, profiles: bool) -> f64 {
    let station = if beam.ends[0] == node { beam.stations.first() } else { beam.stations.last() };
    match &beam.profile {
        Some(choice) if profiles => choice.profile.properties().area,
        _ => station.map_or(beam.section.area, |s| s.section.area),
    }
}

/// The pieces of a beam: where each ends (share of the length), its section and the axis of its larger moment. With measured
/// sections a piece is what is nearer to one station than to the next. A mean over the length would be too stiff: where a
/// member is thin it gives way more than it holds out where it is thick.
fn steps(structure: &Structure, beam: &Beam, profiles: bool, poisson: f64) -> Vec<(f64, Section, DVec3)> {
    let mut ends = vec![1.0];
    if let topipe_beams::Axis::Spline(_) = beam.axis {
        let count = 8 * structure.parameters.elements.max(1);
        ends.extend((1..count).map(|k| f64::from(k) / f64::from(count)));
    }
    let profile = beam.profile.as_ref().filter(|_| profiles);
    if profile.is_none() {
        ends.extend(beam.stations.windows(2).map(|s| 0.5 * (s[0].at + s[1].at)));
    }
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|b, a| *b - *a < 1e-9);
    let mut from = 0.0;
    ends.retain(|end| *end > 1e-9);
    ends.iter()
        .map(|&end| {
            let middle = 0.5 * (from + end);
            from = end;
            let station =
                beam.stations.iter().min_by(|a, b| (a.at - middle).abs().total_cmp(&(b.at - middle).abs()));
            let measured = station.map_or(&beam.section, |s| &s.section);
            match profile {
                Some(choice) => (end, of_profile(&choice.profile, poisson), beam.section.axis),
                None => (end, measured_section(measured, poisson), measured.axis),
            }
        })
        .collect()
}

/// A measured section as the ellipse of its area and ratio of moments. Shear areas are Cowper's (1966).
fn measured_section(s: &MeanSection, nu: f64) -> Section {
    let polar = 4.0 * s.moments[0] * s.moments[1] / (s.moments[0] + s.moments[1]);
    let [high, wide] = s.diameters();
    Section {
        area: s.area,
        moments: s.moments,
        torsion: if s.torsion > 0.0 { s.torsion } else { polar },
        shear: 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu),
        fibres: [high / 2.0, wide / 2.0],
        round: true,
    }
}

fn of_profile(profile: &Profile, nu: f64) -> Section {
    let p = profile.properties();
    let d = &profile.dimensions;
    let first = d.first().copied().unwrap_or(0.0);
    let second = d.get(1).copied().unwrap_or(first);
    let (shear, fibres) = match profile.shape {
        Shape::Round => (6.0 * (1.0 + nu) / (7.0 + 6.0 * nu), [first, first]),
        Shape::Tube => (2.0 * (1.0 + nu) / (4.0 + 3.0 * nu), [first, first]),
        Shape::Square => (10.0 * (1.0 + nu) / (12.0 + 11.0 * nu), [first, first]),
        Shape::Rectangle => (10.0 * (1.0 + nu) / (12.0 + 11.0 * nu), [first, second]),
        Shape::SquareHollow => (20.0 * (1.0 + nu) / (48.0 + 39.0 * nu), [first, first]),
        Shape::RectangularHollow => (20.0 * (1.0 + nu) / (48.0 + 39.0 * nu), [first, second]),
        // The web carries the shear.
        Shape::I => (d.get(2).map_or(0.3, |web| first * web / p.area).min(0.9), [first, second]),
    };
    let round = matches!(profile.shape, Shape::Round | Shape::Tube);
    Section {
        area: p.area,
        moments: p.moments,
        torsion: p.torsion,
        shear,
        fibres: fibres.map(|f| f / 2.0),
        round,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_what_hangs_together() {
        let point =
            |x: f64, y: f64| SurfacePoint { point: DVec3::new(x, y, 0.0), normal: DVec3::Z, area: 1.0 };
        let points: Vec<SurfacePoint> =
            (0..40).map(|k| point(0.5 * (k % 20) as f64, if k < 20 { 0.0 } else { 7.0 })).collect();
        let groups = patches(&points, 1.0);
        assert_eq!(groups, vec![(0..20).collect::<Vec<_>>(), (20..40).collect()]);
    }

    #[test]
    fn a_round_profile_is_the_round_section_of_its_area() {
        let profile = Profile { name: "bar".into(), shape: Shape::Round, dimensions: vec![8.0] };
        let s = of_profile(&profile, 0.3);
        assert!((s.area - 16.0 * std::f64::consts::PI).abs() < 1e-12);
        assert_eq!(s.fibres, [4.0, 4.0]);
        assert!((s.torsion - 2.0 * s.moments[0]).abs() < 1e-9);
    }
}
