//! The report for people.

use crate::{DeviationFigures, Report};
use std::fmt::Write;
use topipe_progress::number;
use topipe_stiffness::Stiffness;

fn genus(genus: Option<i64>) -> String {
    genus.map_or_else(|| "unknown (open)".to_owned(), |g| g.to_string())
}

fn deviation(deviation: &DeviationFigures) -> String {
    let [x, y, z] = deviation.max_at.map(number);
    format!(
        "mean {} mm ({} of the diagonal), rms {} mm, max {} mm ({}) at ({x}, {y}, {z})",
        number(deviation.mean_mm),
        number(deviation.mean_rel),
        number(deviation.rms_mm),
        number(deviation.max_mm),
        number(deviation.max_rel),
    )
}

/// A comparison of stiffness for the terminal: one line per model.
pub fn stiffness_summary(stiffness: &Stiffness) -> String {
    let mut text = format!(
        "stiffness  {} load case{} on cells of {} mm\n",
        stiffness.load_cases,
        if stiffness.load_cases == 1 { "" } else { "s" },
        number(stiffness.cell)
    );
    for (name, f) in stiffness.models() {
        let equal = f
            .equal_volume_change
            .map_or_else(String::new, |change| format!(", {:+.2} % at equal volume", 100.0 * change));
        let smoothed = f.compliance_change_from_smoothed.map_or_else(String::new, |change| {
            format!(", {:+.2} % against the smoothed part", 100.0 * change)
        });
        text += &format!(
            "           {name}: compliance {} N mm ({:+.2} %{equal}{smoothed}), volume {} mm3, von Mises up to {} MPa, moves by {} mm\n",
            number(f.compliance),
            100.0 * f.compliance_change,
            number(f.volume),
            number(f.max_von_mises),
            number(f.max_displacement)
        );
    }
    text
}

impl Report {
    /// A summary for the terminal: one paragraph per artifact, a few lines each.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = self.write_summary(&mut text);
        text
    }

    fn write_summary(&self, text: &mut String) -> std::fmt::Result {
        let o = &self.original;
        writeln!(
            text,
            "original   {} triangles, genus {}, {} component{}, volume {} mm3, area {} mm2",
            o.triangles,
            genus(o.genus),
            o.components,
            if o.components == 1 { "" } else { "s" },
            number(o.volume_mm3),
            number(o.area_mm2)
        )?;
        for repair in &o.repairs {
            writeln!(text, "           repaired: {} ({})", repair.what, repair.count)?;
        }
        if let Some(s) = &self.smoothing {
            let converged = if s.converged { "converged" } else { "not converged" };
            writeln!(
                text,
                "smoothing  {}, {} iterations ({converged}), volume error {}, {} frozen vertices ({} moved)",
                s.method,
                s.iterations,
                number(s.volume_error),
                s.frozen_vertices,
                s.frozen_moved
            )?;
            for hole in &s.holes {
                let [x, y, z] = hole.point.map(number);
                let before = hole.diameter_before_mm.map_or_else(|| "?".to_owned(), |d| format!("{d:.6}"));
                writeln!(
                    text,
                    "           hole at ({x}, {y}, {z}): diameter {before} -> {:.6} mm",
                    hole.diameter_after_mm
                )?;
            }
            if !s.cylinders.is_empty() {
                let worst = s.cylinders.iter().map(|c| c.roundness_mm).fold(0.0, f64::max);
                writeln!(
                    text,
                    "           {} bosses and arcs, round to {} mm",
                    s.cylinders.len(),
                    number(worst)
                )?;
            }
            if !s.flat_faces.is_empty() {
                let worst = s.flat_faces.iter().map(|f| f.flatness_after_mm).fold(0.0, f64::max);
                writeln!(text, "           {} flat faces, flat to {} mm", s.flat_faces.len(), number(worst))?;
            }
            if let Some(shape) = &s.shape {
                let before =
                    shape.before.as_ref().map_or_else(|| "?".to_owned(), |b| format!("{:.1}", b.max_deg));
                writeln!(
                    text,
                    "           largest dihedral angle {before} -> {:.1} degrees, {} folded faces{}, {} self-intersections",
                    shape.after.max_deg,
                    shape.after.folded_faces,
                    match (shape.after.folded_held, shape.after.folded_sliding) {
                        (0, 0) => String::new(),
                        (held, 0) => format!(" ({held} among held vertices alone)"),
                        (0, sliding) =>
                            format!(" ({sliding} among vertices that are held or slide on a face)"),
                        (held, sliding) => format!(
                            " ({held} among held vertices alone, {sliding} among such and vertices that slide on a face)"
                        ),
                    },
                    shape.self_intersections
                )?;
                if let Some(kink) = &shape.kink_after {
                    writeln!(
                        text,
                        "           kink at the border of what is frozen: median {:.1}, 90 % below {:.1}, largest {:.1} degrees",
                        kink.median_deg, kink.p90_deg, kink.max_deg
                    )?;
                }
            }
            if let Some(d) = &s.deviation {
                writeln!(text, "           from the original: {}", deviation(d))?;
            }
        }
        if let Some(l) = &self.layout {
            let valences: Vec<String> = l.valences.iter().map(|(v, n)| format!("{n} of {v}")).collect();
            writeln!(
                text,
                "layout     {} tiles, {} macro-triangles, {} quads, genus {}",
                l.tiles,
                l.macro_triangles,
                l.quads,
                genus(l.genus)
            )?;
            writeln!(
                text,
                "           largest corner {} degrees, smallest scaled Jacobian {}, valences: {}",
                number(l.max_corner_angle_deg),
                number(l.min_scaled_jacobian),
                valences.join(", ")
            )?;
        }
        if let Some(s) = &self.surface {
            writeln!(
                text,
                "surface    {} patches, {} control points, {}, genus {}, volume {} mm3 (error {}), gap {} mm",
                s.patches,
                s.control_points,
                if s.closed { "closed" } else { "NOT CLOSED" },
                genus(s.genus),
                number(s.volume_mm3),
                number(s.volume_error),
                number(s.gap_mm)
            )?;
            if s.planes + s.cylinders > 0 {
                let flatness =
                    s.flatness_mm.map_or_else(String::new, |f| format!(" flat to {} mm", number(f)));
                writeln!(
                    text,
                    "           {} planes{flatness}, {} cylinders; volume error {} without the {} mm3 between facets and cylinders",
                    s.planes,
                    s.cylinders,
                    number(s.volume_error_without_rounding),
                    number(s.rounding_mm3)
                )?;
            }
            for hole in s.round_faces.iter().filter(|face| face.hole) {
                let [x, y, z] = hole.point.map(number);
                let mesh = hole.diameter_mesh_mm.map_or_else(|| "?".to_owned(), |d| format!("{d:.6}"));
                writeln!(
                    text,
                    "           hole at ({x}, {y}, {z}): diameter {:.6} mm, {mesh} mm in the mesh",
                    hole.diameter_mm
                )?;
            }
            if let Some(d) = &s.deviation {
                writeln!(text, "           from the smoothed mesh: {}", deviation(d))?;
            }
            if let Some(d) = &s.deviation_original {
                writeln!(text, "           from the original: {}", deviation(d))?;
            }
            if let Some(c) = &s.curvature {
                writeln!(
                    text,
                    "           mean curvature: rms {}, p99 {} per mm; of the mesh: rms {}, p99 {} per mm",
                    number(c.rms_per_mm),
                    number(c.p99_per_mm),
                    number(c.mesh_rms_per_mm),
                    number(c.mesh_p99_per_mm)
                )?;
            }
            if let Some(j) = &s.normal_jump_deg {
                let [x, y, z] = j.max_at.map(number);
                writeln!(
                    text,
                    "           normal jump over {} edges: mean {}, p99 {}, max {} degrees at ({x}, {y}, {z})",
                    j.edges,
                    number(j.mean),
                    number(j.p99),
                    number(j.max)
                )?;
            }
            for f in &s.features {
                let dihedral = f.min_dihedral_deg.map_or_else(|| "?".to_owned(), number);
                writeln!(
                    text,
                    "           {} features ({}): {} mm, at least {dihedral} degrees",
                    f.edges,
                    f.kind,
                    number(f.length_mm)
                )?;
            }
        }
        if let Some(s) = &self.skeleton {
            let e = |e: Option<f64>| e.map_or_else(|| "?".to_owned(), number);
            writeln!(
                text,
                "skeleton   {} branch points, {} branches, {} junctions, {} mm, {} of it with sections; E_center {} ({} by length)",
                s.compactness,
                s.branches,
                s.junctions,
                number(s.length_mm),
                e(s.beam_share),
                e(s.e_center),
                e(s.e_center_by_length)
            )?;
            writeln!(
                text,
                "           {} points outside, {} cycles for genus {}{}",
                s.out_of_object,
                s.cycles,
                genus(s.genus),
                match s.non_design_holes {
                    0 => String::new(),
                    holes => format!(" less {holes} within non-design parts"),
                }
            )?;
        }
        if let Some(stiffness) = &self.stiffness {
            text.push_str(&stiffness_summary(stiffness));
        }
        for limit in &self.limits {
            let mark = if limit.kept { "ok" } else { "LIMIT" };
            writeln!(text, "limits     {mark}: {}", limit.describe())?;
        }
        Ok(())
    }
}
