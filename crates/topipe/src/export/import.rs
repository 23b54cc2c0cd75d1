//! Meshes as STL, OFF, OBJ and PLY.

use crate::artifacts::Mesh;
use topipe_engine::Exporter;
use topipe_mesh::write;

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_IMPORT");
    vec![
        Exporter::new::<Mesh>("stl", version, |part, _, mut file| Ok(write::stl(&part.mesh, &mut file)?)),
        Exporter::new::<Mesh>("off", version, |part, _, mut file| Ok(write::off(&part.mesh, &mut file)?)),
        Exporter::new::<Mesh>("obj", version, |part, _, mut file| Ok(write::obj(&part.mesh, &mut file)?)),
        Exporter::new::<Mesh>("ply", version, |part, _, mut file| Ok(write::ply(&part.mesh, &mut file)?)),
    ]
}
