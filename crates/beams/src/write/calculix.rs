//! A frame model for CalculiX: quadratic beam elements (B32R), a section for each beam, node sets.
//!
//! What CalculiX asks for: B31 refuses round sections; CIRC and PIPE take diameters of the ellipse and outer radius and
//! wall; the direction given with a section is its first axis and may not lie along the beam. Rigid links are beams of
//! the thickness of their neighbours and ten thousand times the stiffness, as a rigid body cannot share nodes with the
//! knots that CalculiX makes where beams meet. Torsion and shear follow from the shapes: elliptic for mean sections, the
//! enclosing rectangle of equal area and moments for I profiles, which CalculiX does not know.

use crate::{Beam, NodeKind, Sections, Shape, Structure};
use glam::DVec3;
use std::io::{self, Write};

/// Stiffness of links over that of the beams.
const RIGID: f64 = 1e4;

/// Writes the deck. Without supports and loads the step is there, but commented out, with what to add.
pub fn calculix(structure: &Structure, name: &str, out: &mut impl Write) -> io::Result<()> {
    let parameters = &structure.parameters;
    writeln!(out, "** {}: beam structure, mm, N, MPa", name.replace(['\n', '\r'], " "))?;
    writeln!(out, "*NODE, NSET=NALL")?;
    let place =
        |out: &mut dyn Write, id: usize, p: DVec3| writeln!(out, "{id}, {:?}, {:?}, {:?}", p.x, p.y, p.z);
    for (n, node) in structure.nodes.iter().enumerate() {
        place(out, n + 1, node.position)?;
    }
    let mut next = structure.nodes.len() + 1;
    let mut elements: Vec<(String, Vec<[usize; 3]>)> = Vec::new();
    let rigid = structure.links.iter().map(|l| (*l, None));
    let all = structure.beams.iter().map(|b| (b.ends, Some(b))).chain(rigid);
    for (k, (ends, beam)) in all.enumerate() {
        // A link has one element.
        let count = if beam.is_some() { parameters.elements as usize } else { 1 };
        let points = match beam {
            Some(beam) => structure.line(beam, 2 * count),
            None => {
                let [a, b] = ends.map(|n| structure.position(n));
                vec![a, a.midpoint(b), b]
            }
        };
        let mut ids = vec![ends[0] as usize + 1];
        for p in &points[1..points.len() - 1] {
            place(out, next, *p)?;
            ids.push(next);
            next += 1;
        }
        ids.push(ends[1] as usize + 1);
        let set =
            if beam.is_some() { format!("BEAM{k}") } else { format!("LINK{}", k - structure.beams.len()) };
        elements.push((set, (0..count).map(|e| [ids[2 * e], ids[2 * e + 1], ids[2 * e + 2]]).collect()));
    }
    let mut element = 1;
    for (set, list) in &elements {
        writeln!(out, "*ELEMENT, TYPE=B32R, ELSET={set}")?;
        for [a, b, c] in list {
            writeln!(out, "{element}, {a}, {b}, {c}")?;
            element += 1;
        }
    }
    writeln!(out, "*MATERIAL, NAME=SOLID\n*ELASTIC\n{:?}, {:?}", parameters.young, parameters.poisson)?;
    if !structure.links.is_empty() {
        writeln!(
            out,
            "*MATERIAL, NAME=RIGID\n*ELASTIC\n{:?}, {:?}",
            RIGID * parameters.young,
            parameters.poisson
        )?;
    }
    for (k, beam) in structure.beams.iter().enumerate() {
        section(structure, beam, k, out)?;
    }
    for (k, ends) in structure.links.iter().enumerate() {
        let beside = structure.beams.iter().filter(|b| b.ends.iter().any(|n| ends.contains(n)));
        let radius = beside.map(|b| b.section.radius()).fold(0.0, f64::max);
        let direction = structure.position(ends[1]) - structure.position(ends[0]);
        let across = direction.try_normalize().map_or(DVec3::X, |d| d.any_orthonormal_vector());
        writeln!(
            out,
            "*BEAM SECTION, ELSET=LINK{k}, MATERIAL=RIGID, SECTION=CIRC\n{:?}, {:?}\n{}",
            2.0 * radius,
            2.0 * radius,
            vector(across)
        )?;
    }
    let mut set = |name: &str, nodes: &mut dyn Iterator<Item = u32>| -> io::Result<()> {
        let ids: Vec<String> = nodes.map(|n| (n + 1).to_string()).collect();
        if ids.is_empty() {
            return Ok(());
        }
        writeln!(out, "*NSET, NSET={name}")?;
        ids.chunks(8).try_for_each(|line| writeln!(out, "{}", line.join(", ")))
    };
    for (name, kind) in [
        ("JUNCTIONS", NodeKind::Junction),
        ("INTERFACES", NodeKind::Interface),
        ("ENDS", NodeKind::End),
        ("NONDESIGN", NodeKind::NonDesign),
    ] {
        let nodes = structure.nodes.iter().enumerate().filter(|(_, n)| n.kind == kind);
        set(name, &mut nodes.map(|(n, _)| n as u32))?;
    }
    set("SUPPORTS", &mut structure.supports.iter().copied())?;
    set("LOADS", &mut structure.loads.iter().map(|l| l.0))?;
    if structure.supports.is_empty() || structure.loads.is_empty() {
        return writeln!(
            out,
            "** Give supports and loads in the pipeline, or complete this step:\n**STEP\n**STATIC\n**BOUNDARY\n**SUPPORTS, 1, 6\n**CLOAD\n**(node), (direction 1 to 3), (force in N)\n**NODE PRINT, NSET=NALL\n**U\n**END STEP"
        );
    }
    writeln!(out, "*BOUNDARY\nSUPPORTS, 1, 6\n*STEP\n*STATIC\n*CLOAD")?;
    for (node, force) in &structure.loads {
        for (k, f) in force.to_array().into_iter().enumerate().filter(|(_, f)| *f != 0.0) {
            writeln!(out, "{}, {}, {f:?}", node + 1, k + 1)?;
        }
    }
    writeln!(
        out,
        "*NODE PRINT, NSET=LOADS\nU\n*NODE PRINT, NSET=SUPPORTS\nRF\n*NODE FILE, OUTPUT=3D\nU\n*EL FILE\nS\n*END STEP"
    )
}

fn vector(v: DVec3) -> String {
    format!("{:?}, {:?}, {:?}", v.x, v.y, v.z)
}

fn section(structure: &Structure, beam: &Beam, k: usize, out: &mut impl Write) -> io::Result<()> {
    let [a, b] = beam.ends.map(|n| structure.position(n));
    let along = (b - a).try_normalize().unwrap_or_else(|| {
        // A loop: the direction where it leaves its node.
        let line = structure.line(beam, 16);
        (line[1] - line[0]).normalize_or(DVec3::X)
    });
    // The first axis is the direction in which the section is high, across the axis of its larger moment.
    let high =
        along.cross(beam.section.axis).try_normalize().unwrap_or_else(|| along.any_orthonormal_vector());
    let head = |kind: &str| format!("*BEAM SECTION, ELSET=BEAM{k}, MATERIAL=SOLID, SECTION={kind}");
    let (kind, numbers) = match (structure.parameters.sections, &beam.profile) {
        (Sections::Profile, Some(choice)) => {
            let d = &choice.profile.dimensions;
            match (choice.profile.shape, &d[..]) {
                (Shape::Round, &[d]) => ("CIRC", vec![d, d]),
                (Shape::Tube, &[d, wall]) => ("PIPE", vec![d / 2.0, wall]),
                (Shape::Square, &[a]) => ("RECT", vec![a, a]),
                (Shape::Rectangle, &[h, b]) => ("RECT", vec![h, b]),
                (Shape::SquareHollow, &[a, t]) => ("BOX", vec![a, a, t, t, t, t]),
                (Shape::RectangularHollow, &[h, b, t]) => ("BOX", vec![h, b, t, t, t, t]),
                _ => {
                    let p = choice.profile.properties();
                    let ratio = (p.moments[0] / p.moments[1]).sqrt();
                    ("RECT", vec![(p.area * ratio).sqrt(), (p.area / ratio).sqrt()])
                }
            }
        }
        _ => ("CIRC", beam.section.diameters().to_vec()),
    };
    let numbers: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    writeln!(out, "{}\n{}\n{}", head(kind), numbers.join(", "), vector(high))
}
