//! The report for people.

use crate::{DeviationFigures, Report};
use std::fmt::Write;
use topipe_stiffness::Stiffness;

fn genus(genus: Option<i64>) -> String {
    genus.map_or_else(|| "unknown (open)".to_owned(), |g| g.to_string())
}

/// A figure with four digits, without exponents where none are needed.
fn figure(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        a if (1e-3..1e4).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{x:.digits$}")
        }
        a if (1e4..1e15).contains(&a) => format!("{x:.0}"),
        _ => format!("{x:.2e}"),
    }
}

fn deviation(deviation: &DeviationFigures) -> String {
    let [x, y, z] = deviation.max_at.map(figure);
    format!(
        "mean {} mm ({} of the diagonal), rms {} mm, max {} mm ({}) at ({x}, {y}, {z})",
        figure(deviation.mean_mm),
        figure(deviation.mean_rel),
        figure(deviation.rms_mm),
        figure(deviation.max_mm),
        figure(deviation.max_rel),
    )
}

/// A comparison of stiffness for the terminal: one line per model.
pub fn stiffness_summary(stiffness: &Stiffness) -> String {
    let mut text = format!(
        "stiffness  {} load case{} on cells of {} mm\n",
        stiffness.load_cases,
        if stiffness.load_cases == 1 { "" } else { "s" },
        figure(stiffness.cell)
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
            figure(f.compliance),
            100.0 * f.compliance_change,
            figure(f.volume),
            figure(f.max_von_mises),
            figure(f.max_displacement)
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
            figure(o.volume_mm3),
            figure(o.area_mm2)
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
                figure(s.volume_error),
                s.frozen_vertices,
                s.frozen_moved
            )?;
            for hole in &s.holes {
                let [x, y, z] = hole.point.map(figure);
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
                    figure(worst)
                )?;
            }
            if !s.flat_faces.is_empty() {
                let worst = s.flat_faces.iter().map(|f| f.flatness_after_mm).fold(0.0, f64::max);
                writeln!(text, "           {} flat faces, flat to {} mm", s.flat_faces.len(), figure(worst))?;
            }
            if let Some(shape) = &s.shape {
                let before =
                    shape.before.as_ref().map_or_else(|| "?".to_owned(), |b| format!("{:.1}", b.max_deg));
                writeln!(
                    text,
                    "           largest dihedral angle {before} -> {:.1} degrees, {} folded faces, {} self-intersections",
                    shape.after.max_deg, shape.after.folded_faces, shape.self_intersections
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
                figure(l.max_corner_angle_deg),
                figure(l.min_scaled_jacobian),
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
                figure(s.volume_mm3),
                figure(s.volume_error),
                figure(s.gap_mm)
            )?;
            if s.planes + s.cylinders > 0 {
                let flatness =
                    s.flatness_mm.map_or_else(String::new, |f| format!(" flat to {} mm", figure(f)));
                writeln!(
                    text,
                    "           {} planes{flatness}, {} cylinders; volume error {} without the {} mm3 between facets and cylinders",
                    s.planes,
                    s.cylinders,
                    figure(s.volume_error_without_rounding),
                    figure(s.rounding_mm3)
                )?;
            }
            for hole in s.round_faces.iter().filter(|face| face.hole) {
                let [x, y, z] = hole.point.map(figure);
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
            if let Some(j) = &s.normal_jump_deg {
                let [x, y, z] = j.max_at.map(figure);
                writeln!(
                    text,
                    "           normal jump over {} edges: mean {}, p99 {}, max {} degrees at ({x}, {y}, {z})",
                    j.edges,
                    figure(j.mean),
                    figure(j.p99),
                    figure(j.max)
                )?;
            }
            for f in &s.features {
                let dihedral = f.min_dihedral_deg.map_or_else(|| "?".to_owned(), figure);
                writeln!(
                    text,
                    "           {} features ({}): {} mm, at least {dihedral} degrees",
                    f.edges,
                    f.kind,
                    figure(f.length_mm)
                )?;
            }
        }
        if let Some(s) = &self.skeleton {
            let e = |e: Option<f64>| e.map_or_else(|| "?".to_owned(), figure);
            writeln!(
                text,
                "skeleton   {} branch points, {} branches, {} junctions, {} mm, {} of it with sections; E_center {} ({} by length)",
                s.compactness,
                s.branches,
                s.junctions,
                figure(s.length_mm),
                e(s.beam_share),
                e(s.e_center),
                e(s.e_center_by_length)
            )?;
            writeln!(
                text,
                "           {} points outside, {} cycles for genus {}",
                s.out_of_object,
                s.cycles,
                genus(s.genus)
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

#[cfg(test)]
mod tests {
    use super::figure;

    #[test]
    fn figures_have_four_digits() {
        for (x, text) in
            [(0.0, "0"), (1.0, "1.000"), (-12.3456, "-12.35"), (123456.7, "123457"), (2.5e-9, "2.50e-9")]
        {
            assert_eq!(figure(x), text);
        }
        assert_eq!(figure(f64::NAN), "NaN");
    }
}
