//! The smoothing study as tables and plots. The end of the file's name says which: `-methods.csv`, `-sensitivity.csv`,
//! `-history.csv`, `-change.svg`, `-volume.svg`.

use super::plot::{Plot, Series};
use crate::artifacts;
use topipe_engine::{ExportError, Exporter};
use topipe_smoothing::study::{MethodRow, Study};

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_SMOOTHING_STUDY");
    vec![
        Exporter::new::<artifacts::Study>("csv", version, |study, name, file| {
            let text = match last_word(name) {
                "methods" => methods(study),
                "sensitivity" => sensitivity(study),
                "history" => history(study),
                _ => return Err(unknown(name, "-methods.csv, -sensitivity.csv or -history.csv")),
            };
            Ok(file.write_all(text.as_bytes())?)
        }),
        Exporter::new::<artifacts::Study>("svg", version, |study, name, file| {
            let plot = match last_word(name) {
                "change" => plot(study, "total change, mm", |m| &m.change),
                "volume" => plot(study, "volume, mm³", |m| &m.volumes),
                _ => return Err(unknown(name, "-change.svg or -volume.svg")),
            };
            Ok(file.write_all(plot.svg().as_bytes())?)
        }),
    ]
}

fn last_word(name: &str) -> &str {
    name.rsplit('-').next().unwrap_or(name)
}

fn unknown(name: &str, known: &str) -> ExportError {
    ExportError::Refused(format!("`{name}` does not say which part of the study to write; end it in {known}"))
}

/// Tables 2 and 4: a line per method.
fn methods(study: &Study) -> String {
    let mut text =
        "method,iterations,converged,frozen_vertices,volume_mm3,volume_error,x_mm,x_error,y_mm,y_error,z_mm,\
                    z_error,total_change_mm,cumulative_change_mm"
            .to_owned();
    for hole in 0..study.holes.len() {
        text += &format!(",hole_{0}_diameter_mm,hole_{0}_error", hole + 1);
    }
    text += "\n";
    let Some(first) = study.methods.first() else { return text };
    for m in &study.methods {
        text += &format!("\"{}\",{},{},{},", m.name, m.iterations, m.converged, m.frozen);
        text += &format!("{},{}", m.volume, m.volume / first.volume - 1.0);
        for k in 0..3 {
            text += &format!(",{},{}", m.extent[k], m.extent[k] / first.extent[k] - 1.0);
        }
        let last = |v: &[f64]| v.last().copied().unwrap_or(0.0);
        text += &format!(",{},{}", last(&m.change), last(&m.cumulative));
        for (diameter, before) in m.diameters.iter().zip(&study.holes) {
            match diameter {
                Some(d) => text += &format!(",{d},{}", d / before - 1.0),
                None => text += ",not evaluable,",
            }
        }
        text += "\n";
    }
    text
}

/// Tables 1 and 3: a line per cell.
fn sensitivity(study: &Study) -> String {
    let mut text = "alpha,beta,iterations,mesh_distance_mm,total_change_mm,cumulative_change_mm\n".to_owned();
    for s in &study.sensitivity {
        text += &format!(
            "{},{},{},{},{},{}\n",
            s.alpha, s.beta, s.iterations, s.distance, s.change, s.cumulative
        );
    }
    text
}

/// Figures 7 and 10: a line per method and iteration.
fn history(study: &Study) -> String {
    let mut text =
        "method,iteration,total_change_mm,cumulative_change_mm,volume_mm3,mesh_distance_mm\n".to_owned();
    for m in &study.methods {
        for i in 0..m.change.len() {
            text += &format!(
                "\"{}\",{},{},{},{},{}\n",
                m.name,
                i + 1,
                m.change[i],
                m.cumulative[i],
                m.volumes[i],
                m.distances[i]
            );
        }
    }
    text
}

fn plot(study: &Study, label: &str, values: impl Fn(&MethodRow) -> &Vec<f64>) -> Plot {
    let series = study.methods.iter().skip(1).map(|m| Series {
        name: m.name.clone(),
        points: values(m).iter().enumerate().map(|(i, &y)| [(i + 1) as f64, y]).collect(),
    });
    Plot { x_label: "iteration".to_owned(), y_label: label.to_owned(), series: series.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study() -> Study {
        let row = |name: &str, change: Vec<f64>| MethodRow {
            name: name.to_owned(),
            iterations: change.len() as u32,
            converged: true,
            frozen: 2,
            volume: 8.0,
            extent: [2.0; 3],
            diameters: vec![Some(1.0), None],
            cumulative: change.clone(),
            volumes: change.iter().map(|_| 8.0).collect(),
            distances: change.clone(),
            change,
        };
        Study {
            methods: vec![row("original", vec![]), row("hc", vec![1.0, 1.5])],
            sensitivity: vec![],
            holes: vec![1.0, 2.0],
            published: [0; 3],
            vertices: 8,
        }
    }

    #[test]
    fn tables_have_a_line_per_method_and_per_iteration() {
        let table = methods(&study());
        let columns: Vec<usize> = table.lines().map(|l| l.split(',').count()).collect();
        assert_eq!(columns, vec![columns[0]; 3]);
        assert!(table.contains("not evaluable"));
        assert_eq!(history(&study()).lines().count(), 3);
    }

    #[test]
    fn plots_have_a_line_per_method() {
        let svg = plot(&study(), "total change", |m| &m.change).svg();
        assert_eq!(svg.matches("<polyline").count(), 1);
        assert!(svg.contains(">hc<") && svg.contains(">iteration<"));
    }
}
