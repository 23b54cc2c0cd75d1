//! Fits a case of `fixtures/` and prints how patches meet, worst places first.
//!
//!     cargo run --release -p topipe-spline-fit --example continuity -- bracket [SPANS] [REFINEMENTS] [BEND] [LAMBDA]
//!
//! BEND is that of the tiling.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::{Listener, Progress, Units};
use topipe_spline_fit::{Parameters, Patch, fit};

struct Print;

impl Listener for Print {
    fn step(&self, _: u64, _: u64, _: &str) {}
    fn remark(&self, text: &str) {
        println!("  {text}");
    }
    fn interrupted(&self) -> bool {
        false
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or("bracket".into());
    let number = |text: Option<String>, default: u32| text.map_or(Ok(default), |t| t.parse());
    let share = |text: Option<String>, default: f64| text.map_or(Ok(default), |t| t.parse());
    let spans = number(arguments.next(), Parameters::default().spans)?;
    let refinements = number(arguments.next(), Parameters::default().refinements)?;
    let bend = share(arguments.next(), topipe_tiling::Parameters::default().bend)?;
    let lambda = share(arguments.next(), Parameters::default().lambda)?;
    let parameters = Parameters { spans, refinements, lambda, ..Default::default() };
    let silent = Progress::silent();
    let path = format!("fixtures/{name}/{name}.stl");
    let bytes = std::fs::read(&path)?;
    let labels_path = format!("fixtures/{name}/{name}.labels.csv");
    let labels = std::fs::read(&labels_path).ok();
    let source =
        Source { labels: labels.as_ref().map(|l| (&*labels_path, &l[..])), ..Source::new(&path, &bytes) };
    let part = read_source(&source, &ImportOptions::default(), &silent)?;
    let part = topipe_smoothing::smooth(&part, &Default::default(), &silent)?;
    let tile_parameters = topipe_tiling::Parameters { bend, ..Default::default() };
    let tiling = topipe_tiling::tile(&part, &tile_parameters, &silent)?;
    let start = Instant::now();
    let layout = topipe_quad_matching::match_quads(&tiling, &Default::default(), &silent)?;
    let corners: Vec<f64> = layout.corner_angles().iter().flatten().map(|a| a.to_degrees()).collect();
    let outside = |low: f64, high: f64| corners.iter().filter(|a| **a < low || **a > high).count();
    println!(
        "quads {:.2} s, {} corners: {} outside 45 to 135 degrees, {} outside 15 to 165",
        start.elapsed().as_secs_f64(),
        corners.len(),
        outside(45.0, 135.0),
        outside(15.0, 165.0)
    );
    for (q, angles) in layout.corner_angles().iter().enumerate() {
        for (k, angle) in angles.iter().enumerate().filter(|(_, a)| !(15.0..165.0).contains(&a.to_degrees()))
        {
            let sides = layout.quads[q];
            let kind = |k: usize| layout.edges[sides[k % 4].edge as usize].feature;
            let at = layout.part.mesh.position(layout.vertices[layout.start(sides[k]) as usize]);
            println!(
                "  quad {q} corner {k} at {at:.2}: {:.0} degrees between {:?} and {:?}, {} quads there",
                angle.to_degrees(),
                kind(k + 3),
                kind(k),
                layout.quads.iter().flatten().filter(|s| layout.start(**s) == layout.start(sides[k])).count()
            );
        }
    }
    let start = Instant::now();
    let surface = fit(&layout, &parameters, &Units::none(), &Progress::new(Arc::new(Print)))?;
    println!(
        "{name}: {} patches, {} faces, fit {:.2} s",
        surface.patches.len(),
        surface.faces.len(),
        start.elapsed().as_secs_f64()
    );
    let mut uses = vec![Vec::new(); surface.edges.len()];
    for (p, patch) in surface.patches.iter().enumerate() {
        patch.sides.iter().enumerate().for_each(|(k, s)| uses[s.edge as usize].push((p, k, s.reversed)));
    }
    // A border without a feature is tangent to its plane or cylinder.
    let mut shapes = vec![None; surface.edges.len()];
    for face in &surface.faces {
        face.loops.iter().flatten().for_each(|s| shapes[s.edge as usize] = Some(face.shape));
    }
    let angles = layout.corner_angles();
    let mut jumps = Vec::new();
    for (e, uses) in uses.iter().enumerate() {
        let (a, b) = match (surface.edges[e].feature, &uses[..], shapes[e]) {
            (None, [a, b], _) => (a, Some(b)),
            (None, [a], Some(_)) => (a, None),
            _ => continue,
        };
        let mut worst = (0.0f64, 0.0);
        // Between any two knots of the two patches.
        let mut knots = vec![0.0, 1.0];
        for &(p, side, reversed) in [Some(a), b].into_iter().flatten() {
            let patch: &Patch = &surface.patches[p];
            let basis = if side % 2 == 0 { &patch.basis_u } else { &patch.basis_v };
            let against = reversed != (side >= 2);
            knots.extend(basis.breaks().iter().map(|t| if against { 1.0 - t } else { *t }));
        }
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        let places =
            knots.windows(2).flat_map(|w| (0..6).map(move |k| w[0] + f64::from(k) / 6.0 * (w[1] - w[0])));
        for t in places.chain([1.0]) {
            let normal = |&(p, side, reversed): &(usize, usize, bool)| {
                let (u, v) = Patch::side_parameters(side, if reversed { 1.0 - t } else { t });
                surface.patches[p].evaluate(u, v).normal()
            };
            let on_shape = || {
                shapes[e].map_or(topipe_mesh::DVec3::ZERO, |shape| shape.normal(surface.edges[e].position(t)))
            };
            let (n, m) = (normal(a), b.map_or_else(on_shape, normal));
            let angle = n.cross(m).length().atan2(n.dot(m)).to_degrees();
            if angle > worst.0 {
                worst = (angle, t);
            }
        }
        jumps.push((worst.0, worst.1, e, *a, b.copied()));
    }
    jumps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mesh = surface.tessellate(2e-3 * layout.part.mesh.diagonal());
    let crossings = topipe_mesh::spatial::crossings(&mesh);
    println!("triangulated, it passes through itself in {} places", crossings.len());
    for crossing in &crossings {
        println!("  crossing at {:.1} {:.1} {:.1}", crossing.point.x, crossing.point.y, crossing.point.z);
    }
    let above = |limit: f64| jumps.iter().filter(|j| j.0 > limit).count();
    println!(
        "{} smooth edges; above 0.1 degrees: {}, 1: {}, 10: {}, 90: {}; median {:.4}",
        jumps.len(),
        above(0.1),
        above(1.0),
        above(10.0),
        above(90.0),
        jumps[jumps.len() / 2].0
    );
    let place = |low: f64, high: f64| {
        jumps.iter().filter(|j| j.0 > 0.1 && (low..high).contains(&j.1.min(1.0 - j.1))).count()
    };
    println!(
        "above 0.1 at a corner: {}, within the first span of eight: {}, elsewhere: {}",
        place(0.0, 1e-9),
        place(1e-9, 0.125),
        place(0.125, 1.0)
    );
    for &(jump, t, e, a, b) in jumps.iter().filter(|j| j.0 > 0.1).take(40) {
        let curve = &surface.edges[e];
        let chord = curve.control[0].distance(curve.control[curve.control.len() - 1]);
        println!(
            "  {jump:8.3} at {t:.2} of {} {e}, length {chord:.2}, {:?}",
            if b.is_none() { "border" } else { "edge" },
            curve.position(t)
        );
        let speeds: Vec<String> = (0..=16)
            .map(|k| {
                let t = f64::from(k) / 16.0;
                let step = 1e-4;
                let d = curve.position((t + step).min(1.0)) - curve.position((t - step).max(0.0));
                let way = (curve.control[curve.control.len() - 1] - curve.control[0]) / chord;
                format!("{:.1}/{:.1}", d.dot(way) / (2.0 * step) / chord, d.length() / (2.0 * step) / chord)
            })
            .collect();
        println!("      speed towards the end / speed: {}", speeds.join(" "));
        for (p, side, reversed) in [Some(a), b].into_iter().flatten() {
            let line: Vec<String> = (0..=8)
                .map(|k| {
                    let t = f64::from(k) / 8.0;
                    let (u, v) = Patch::side_parameters(side, if reversed { 1.0 - t } else { t });
                    let s = surface.patches[p].evaluate(u, v);
                    let (along, across) = match side {
                        0 => (s.du, s.dv),
                        1 => (s.dv, -s.du),
                        2 => (-s.du, -s.dv),
                        _ => (-s.dv, s.du),
                    };
                    format!("{:.0}", along.angle_between(across).to_degrees())
                })
                .collect();
            println!("      angle between along and across: {}", line.join(" "));
            let faces = layout.quad_of_face.iter().filter(|&&q| q == p as u32).count();
            println!(
                "      patch {p} side {side}: {faces} faces, angles {:?}, patches beside its sides {:?}",
                angles[p].map(|a| a.to_degrees().round()),
                surface.patches[p].sides.map(|s| uses[s.edge as usize].len())
            );
        }
    }
    folded(&layout, &surface);
    far(&layout, &surface);
    Ok(())
}

/// Patches whose faces are far from them, and how they look.
fn far(layout: &topipe_quad_matching::QuadLayout, surface: &topipe_spline_fit::SplineSurface) {
    let mesh = &layout.part.mesh;
    let mut faces = vec![Vec::new(); layout.quads.len()];
    for (f, &q) in layout.quad_of_face.iter().enumerate() {
        if (q as usize) < faces.len() {
            faces[q as usize].push(topipe_mesh::FaceId::new(f));
        }
    }
    let mut borders: Vec<(f64, usize, topipe_mesh::DVec3)> = Vec::new();
    for (e, edge) in layout.edges.iter().enumerate().filter(|(e, _)| *e < surface.edges.len()) {
        let curve = &surface.edges[e];
        if uses_of(layout, e) == 2 {
            continue;
        }
        let points: Vec<topipe_mesh::DVec3> =
            (0..=200).map(|k| curve.position(f64::from(k) / 200.0)).collect();
        let worst = edge
            .path
            .iter()
            .map(|&v| {
                let p = mesh.position(v);
                (points.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min), e, p)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        borders.extend(worst);
    }
    borders.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (d, e, at) in borders.iter().take(12) {
        println!(
            "  border {:.2e} edge {e} {:?} feature {:?} vertices {}",
            d / mesh.diagonal(),
            at,
            surface.edges[*e].feature,
            layout.edges[*e].path.len()
        );
    }
    let n = 64;
    let mut list: Vec<(f64, usize, topipe_mesh::DVec3, (f64, f64))> = Vec::new();
    for (p, patch) in surface.patches.iter().enumerate() {
        let grid: Vec<((f64, f64), topipe_mesh::DVec3)> = (0..=n)
            .flat_map(|i| (0..=n).map(move |j| (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n))))
            .map(|(u, v)| ((u, v), patch.evaluate(u, v).position))
            .collect();
        let worst = faces[p]
            .iter()
            .map(|&f| {
                let corners = mesh.triangles[f.index()].map(|v| mesh.position(v));
                let at = (corners[0] + corners[1] + corners[2]) / 3.0;
                let near = grid.iter().min_by(|a, b| a.1.distance(at).total_cmp(&b.1.distance(at))).unwrap();
                (near.1.distance(at), p, at, near.0)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        list.extend(worst);
    }
    list.sort_by(|a, b| b.0.total_cmp(&a.0));
    let diagonal = mesh.diagonal();
    let above = |limit: f64| list.iter().filter(|l| l.0 > limit * diagonal).count();
    println!(
        "patches with faces farther than 1e-3 of the diagonal: {}, 2e-3: {}, 4e-3: {}",
        above(1e-3),
        above(2e-3),
        above(4e-3)
    );
    for &(d, p, at, (u, v)) in list.iter().take(24) {
        let area: topipe_mesh::DVec3 = faces[p].iter().map(|&f| mesh.area_vector(f)).sum();
        let mean = area.normalize_or_zero();
        let cone = faces[p]
            .iter()
            .map(|&f| mesh.normal(f).dot(mean).clamp(-1.0, 1.0).acos().to_degrees())
            .fold(0.0, f64::max);
        let sides = surface.patches[p].sides.map(|s| {
            let edge = &surface.edges[s.edge as usize];
            let c = &edge.control;
            let kind = edge.feature.map_or("", |_| "f");
            format!("{:.1}{kind}", c[0].distance(c[c.len() - 1]))
        });
        let angles = layout.corner_angles()[p].map(|a| a.to_degrees().round());
        println!(
            "  {:.2e} patch {p} at ({u:.2} {v:.2}) {:?}: {} faces, cone {cone:.0}, sides {sides:?}, corners {angles:?}, knots {} x {}",
            d / diagonal,
            at.round(),
            faces[p].len(),
            surface.patches[p].basis_u.len() / 2 - 1,
            surface.patches[p].basis_v.len() / 2 - 1
        );
    }
}

/// Patches whose normal turns against their mean somewhere, by what is odd about them.
fn folded(layout: &topipe_quad_matching::QuadLayout, surface: &topipe_spline_fit::SplineSurface) {
    let mesh = &layout.part.mesh;
    let mut faces = vec![Vec::new(); layout.quads.len()];
    for (f, &q) in layout.quad_of_face.iter().enumerate() {
        if (q as usize) < faces.len() {
            faces[q as usize].push(topipe_mesh::FaceId::new(f));
        }
    }
    let mut count = 0;
    let mut tallies = [0; 4];
    for (p, patch) in surface.patches.iter().enumerate() {
        let n = 24;
        let grid = || {
            (0..=n).flat_map(|i| {
                (0..=n).map(move |j| (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n)))
            })
        };
        let area: topipe_mesh::DVec3 = faces[p].iter().map(|&f| mesh.area_vector(f)).sum();
        let mean = area.normalize_or_zero();
        let bad: Vec<(f64, f64)> =
            grid().filter(|&(u, v)| patch.evaluate(u, v).normal().dot(mean) < 0.0).collect();
        let cone = faces[p]
            .iter()
            .map(|&f| mesh.normal(f).dot(mean).clamp(-1.0, 1.0).acos().to_degrees())
            .fold(0.0, f64::max);
        if bad.len() <= 2 {
            continue;
        }
        count += 1;
        let at = |u: f64, v: f64| patch.evaluate(u, v);
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(u, v)| {
            let s = at(u, v);
            let (a, b) = match (u > 0.5, v > 0.5) {
                (false, false) => (s.du, s.dv),
                (true, false) => (s.dv, -s.du),
                (true, true) => (-s.du, -s.dv),
                _ => (-s.dv, s.du),
            };
            let angle = a.angle_between(b).to_degrees();
            if a.cross(b).dot(mean) < 0.0 { -angle } else { angle }
        });
        let border = bad.iter().filter(|(u, v)| u.min(1.0 - u).min(v.min(1.0 - v)) < 0.05).count();
        let ragged = corners.iter().any(|a| *a < 5.0);
        tallies[0] += usize::from(ragged);
        tallies[1] += usize::from(cone > 80.0);
        tallies[2] += usize::from(faces[p].len() < 8);
        tallies[3] += usize::from(border == bad.len());
        if count % 10 == 1 {
            let layout_angles = layout.corner_angles()[p].map(|a| a.to_degrees().round());
            println!(
                "patch {p}: {} faces, cone {cone:.0}, {} of {} points folded ({border} at the border), corners {:?} (layout {layout_angles:?}), sides {:?}, at {:?}",
                faces[p].len(),
                bad.len(),
                (n + 1) * (n + 1),
                corners.map(|a| a.round()),
                [0usize, 1, 2, 3].map(|k| {
                    let c = &surface.edges[patch.sides[k].edge as usize].control;
                    (10.0 * c[0].distance(c[c.len() - 1])).round() / 10.0
                }),
                at(0.5, 0.5).position.round()
            );
        }
    }
    println!(
        "{count} folded patches: {} with a turned corner, {} with a wide cone, {} of few faces, {} along the border only",
        tallies[0], tallies[1], tallies[2], tallies[3]
    );
}

fn uses_of(layout: &topipe_quad_matching::QuadLayout, e: usize) -> usize {
    layout.quads.iter().flatten().filter(|s| s.edge as usize == e).count()
}
