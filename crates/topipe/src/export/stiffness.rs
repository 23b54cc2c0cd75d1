//! Stiffness as JSON and CSV.

use crate::artifacts::Stiffness;
use topipe_engine::Exporter;

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_STIFFNESS");
    vec![
        Exporter::new::<Stiffness>("json", version, |stiffness, _, file| {
            let value = serde_json::to_value(stiffness).unwrap_or_default();
            Ok(writeln!(file, "{value:#}")?)
        }),
        Exporter::new::<Stiffness>("csv", version, |stiffness, _, file| {
            Ok(file.write_all(stiffness.to_csv().as_bytes())?)
        }),
    ]
}
