//! Reports as JSON.

use crate::artifacts::Report;
use topipe_engine::Exporter;

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<Report>("json", env!("TOPIPE_WRITER_VALIDATION"), |report, _, file| {
        Ok(file.write_all(report.to_json().as_bytes())?)
    })]
}
