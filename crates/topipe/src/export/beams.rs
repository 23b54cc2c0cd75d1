//! Beam structures as JSON, CSV, DXF, CalculiX deck, STEP solid and STL.

use crate::artifacts::Beams;
use topipe_beams::solid::{Solid, solid, triangulate};
use topipe_beams::write::Protocol;
use topipe_beams::{Structure, write};
use topipe_engine::{ExportError, Exporter};
use topipe_mesh::write as mesh;

/// Chords of the arcs of an STL file turn by at most so many radians: 48 around a bar.
const TURN: f64 = std::f64::consts::TAU / 48.0;

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_BEAMS");
    vec![
        Exporter::new::<Beams>("json", version, |structure, _, file| {
            Ok(writeln!(file, "{:#}", write::json(structure))?)
        }),
        Exporter::new::<Beams>("csv", version, |structure, _, mut file| {
            Ok(write::csv(structure, &mut file)?)
        }),
        Exporter::new::<Beams>("dxf", version, |structure, _, mut file| {
            Ok(write::dxf(structure, &mut file)?)
        }),
        Exporter::new::<Beams>("inp", version, |structure, name, mut file| {
            Ok(write::calculix(structure, name, &mut file)?)
        }),
        Exporter::new::<Beams>("step", version, |structure, name, mut file| {
            Ok(write::step(&build(structure)?.brep, name, Protocol::Ap214, &mut file)?)
        }),
        Exporter::new::<Beams>("stp", version, |structure, name, mut file| {
            Ok(write::step(&build(structure)?.brep, name, Protocol::Ap214, &mut file)?)
        }),
        Exporter::new::<Beams>("ap242.step", version, |structure, name, mut file| {
            Ok(write::step(&build(structure)?.brep, name, Protocol::Ap242, &mut file)?)
        }),
        Exporter::new::<Beams>("stl", version, |structure, _, mut file| {
            Ok(mesh::stl(&triangulate(&build(structure)?.brep, TURN), &mut file)?)
        }),
    ]
}

fn build(structure: &Structure) -> Result<Solid, ExportError> {
    solid(structure).map_err(|error| ExportError::Refused(error.to_string()))
}
