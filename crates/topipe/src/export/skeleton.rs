//! Skeletons as JSON, VTP and DXF.

use crate::artifacts::Skeleton;
use topipe_engine::Exporter;
use topipe_skeleton::write;

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_SKELETON");
    vec![
        Exporter::new::<Skeleton>("json", version, |skeleton, _, file| {
            Ok(writeln!(file, "{:#}", skeleton.to_json())?)
        }),
        Exporter::new::<Skeleton>("vtp", version, |skeleton, _, mut file| {
            Ok(write::vtp(skeleton, &mut file)?)
        }),
        Exporter::new::<Skeleton>("dxf", version, |skeleton, _, mut file| {
            Ok(write::dxf(skeleton, &mut file)?)
        }),
    ]
}
