//! Skeletons as JSON.

use crate::artifacts::Skeleton;
use topipe_engine::Exporter;

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<Skeleton>("json", env!("TOPIPE_WRITER_SKELETON"), |skeleton, _, file| {
        Ok(writeln!(file, "{:#}", skeleton.to_json())?)
    })]
}
