//! Anything that has a surface as glTF, 3MF and VTK, and meshes as decks with element sets.

use crate::artifacts::{Beams, Mesh, QuadLayout, SplineSurface, Tiling};
use std::io::Write;
use topipe_engine::{ExportError, Exporter};
use topipe_exchange::{Model, Numbers, Set, glb, inp, legacy_vtk, three_mf, vtp};
use topipe_mesh::{DVec3, Design, Part, RegionId, RegionShape, TriangleMesh};
use topipe_render::palette;

/// Largest distance of the triangles of a surface from it over its diagonal, as in the STL of a surface.
const CHORD: f64 = 5e-4;
/// Chords of the arcs of beams turn by at most so many radians.
const TURN: f64 = std::f64::consts::TAU / 48.0;

type WriteModel = fn(&Model<'_>, &mut dyn Write) -> std::io::Result<()>;

const FORMATS: [(&str, WriteModel); 4] = [
    ("glb", |model, mut file| glb(model, &mut file)),
    ("3mf", |model, mut file| three_mf(model, &mut file)),
    ("vtp", |model, mut file| vtp(model, &mut file)),
    ("vtk", |model, mut file| legacy_vtk(model, &mut file)),
];

pub(super) fn exporters() -> Vec<Exporter> {
    // The surface is cut into triangles, and the beams are built, by crates of their own.
    let own = env!("TOPIPE_WRITER_EXCHANGE");
    let with = |other: &str| format!("{own}-{other}");
    let mut exporters = vec![Exporter::new::<Mesh>("inp", own, |part, name, mut file| {
        with_part(part, name, |model| inp(model, &mut file))
    })];
    for (ending, write) in FORMATS {
        exporters.push(Exporter::new::<Mesh>(ending, own, move |part, name, file| {
            with_part(part, name, |model| write(model, file))
        }));
        exporters.push(Exporter::new::<Tiling>(ending, own, move |tiling, name, file| {
            let ids: Vec<u32> = tiling.tile_of_face.iter().map(|tile| tile.0).collect();
            with_ids(&tiling.part.mesh, &ids, "tile", name, |model| write(model, file))
        }));
        exporters.push(Exporter::new::<QuadLayout>(ending, own, move |layout, name, file| {
            with_ids(&layout.part.mesh, &layout.quad_of_face, "quad", name, |model| write(model, file))
        }));
        exporters.push(surface(ending, with(env!("TOPIPE_WRITER_SPLINE_FIT")), write));
        exporters.push(Exporter::new::<Beams>(
            ending,
            with(env!("TOPIPE_WRITER_BEAMS")),
            move |structure, name, file| {
                let solid = topipe_beams::solid::solid(structure)
                    .map_err(|error| ExportError::Refused(error.to_string()))?;
                let mesh = topipe_beams::solid::triangulate(&solid.brep, TURN);
                Ok(write(&Model::new(name, &mesh), file)?)
            },
        ));
    }
    exporters
}

fn surface(ending: &'static str, version: String, write: WriteModel) -> Exporter {
    Exporter::new::<SplineSurface>(ending, version, move |surface, name, file| {
        let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let (mesh, face_of_triangle) = surface.tessellate_with(CHORD * (high - low).length(), f64::INFINITY);
        let patches = surface.patches.len() as u32;
        // 0 free-form, 1 plane, 2 hole, 3 boss, as for the regions of meshes.
        let kind = |face: u32| match face.checked_sub(patches).and_then(|f| surface.faces.get(f as usize)) {
            Some(face) => kind_of(&face.shape),
            None => 0,
        };
        let kinds: Vec<i32> = face_of_triangle.iter().map(|&face| kind(face)).collect();
        let model = Model {
            face_data: vec![
                ("face".into(), Numbers::Whole(face_of_triangle.iter().map(|&face| face as i32).collect())),
                ("kind".into(), Numbers::Whole(kinds.clone())),
            ],
            face_colors: kinds.iter().map(|&kind| COLORS[kind as usize]).collect(),
            ..Model::new(name, &mesh)
        };
        Ok(write(&model, file)?)
    })
}

/// Free-form, plane, hole, boss.
const COLORS: [[u8; 3]; 4] = [[176, 190, 204], [222, 213, 193], [214, 122, 60], [120, 168, 128]];

fn kind_of(shape: &RegionShape) -> i32 {
    match shape {
        RegionShape::Plane { .. } => 1,
        RegionShape::Cylinder { hole: true, .. } => 2,
        RegionShape::Cylinder { .. } => 3,
    }
}

fn with_ids(
    mesh: &TriangleMesh,
    ids: &[u32],
    what: &str,
    name: &str,
    write: impl FnOnce(&Model<'_>) -> std::io::Result<()>,
) -> Result<(), ExportError> {
    // None, the largest u32, becomes -1.
    let numbers = ids.iter().map(|&id| id as i32).collect();
    let model = Model {
        face_data: vec![(what.into(), Numbers::Whole(numbers))],
        face_colors: palette::categorical_faces(mesh, ids).into_iter().map(|color| color.0).collect(),
        ..Model::new(name, mesh)
    };
    Ok(write(&model)?)
}

/// A part with its regions, labels and frozen vertices, as numbers and as sets.
fn with_part(
    part: &Part,
    name: &str,
    write: impl FnOnce(&Model<'_>) -> std::io::Result<()>,
) -> Result<(), ExportError> {
    let faces = part.mesh.face_count();
    let region = |id: RegionId| if id == RegionId::NONE { -1 } else { id.0 as i32 };
    let kind = |id: RegionId| part.regions.get(id.0 as usize).map_or(0, |region| kind_of(&region.shape));
    let fixed: Vec<bool> = part.design.iter().map(|design| *design == Design::NonDesign).collect();
    let kinds: Vec<i32> = part.region_of_face.iter().map(|&id| kind(id)).collect();
    let mut face_sets = Vec::new();
    let of_faces =
        |wanted: &dyn Fn(usize) -> bool| (0..faces as u32).filter(|&f| wanted(f as usize)).collect();
    if fixed.contains(&true) {
        face_sets.push(Set { name: "DESIGN".into(), members: of_faces(&|f| !fixed[f]) });
        face_sets.push(Set { name: "NON_DESIGN".into(), members: of_faces(&|f| fixed[f]) });
    }
    for (id, shape) in part.regions.iter().map(|region| &region.shape).enumerate() {
        let what = ["FREE", "PLANE", "HOLE", "BOSS"][kind_of(shape) as usize];
        let members = of_faces(&|f| part.region_of_face[f].0 as usize == id);
        face_sets.push(Set { name: format!("{what}_{id}"), members });
    }
    let frozen = (0..part.frozen.len() as u32).filter(|&v| part.frozen[v as usize]).collect();
    let model = Model {
        vertex_data: vec![
            ("frozen".into(), Numbers::Whole(part.frozen.iter().map(|&frozen| i32::from(frozen)).collect())),
            ("mean_curvature_per_mm".into(), Numbers::Real(part.mesh.mean_curvature())),
        ],
        face_data: vec![
            ("region".into(), Numbers::Whole(part.region_of_face.iter().map(|&id| region(id)).collect())),
            ("kind".into(), Numbers::Whole(kinds.clone())),
            ("non_design".into(), Numbers::Whole(fixed.iter().map(|&fixed| i32::from(fixed)).collect())),
        ],
        face_colors: kinds.iter().map(|&kind| COLORS[kind as usize]).collect(),
        face_sets,
        vertex_sets: vec![Set { name: "FROZEN".into(), members: frozen }],
        ..Model::new(name, &part.mesh)
    };
    Ok(write(&model)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_engine::ArtifactKind;

    #[test]
    fn every_surface_has_every_format() {
        let exporters = exporters();
        for kind in [Mesh::NAME, Tiling::NAME, QuadLayout::NAME, SplineSurface::NAME, Beams::NAME] {
            for (ending, _) in FORMATS {
                assert!(
                    exporters.iter().any(|e| e.artifact.name == kind && e.ending == ending),
                    "{kind} {ending}"
                );
            }
        }
    }
}
