//! `topipe inspect`.

use crate::args::InspectArguments;
use crate::artifacts::{Beams, Mesh, QuadLayout, Report, Skeleton, SplineSurface, Stiffness, Tiling};
use crate::display;
use crate::failure::Failure;
use std::fmt::Write;
use std::path::Path;
use topipe_engine::{ArtifactKind, ExitCode, codec};
use topipe_mesh::{Connectivity, Design, Part, RegionShape};
use topipe_smoothing::features::edge_chains;

pub(crate) fn run(arguments: &InspectArguments) -> Result<ExitCode, Failure> {
    let (path, bytes) = super::target::read(&arguments.target)?;
    let text = match codec::open(&bytes) {
        Ok((header, _)) => artifact(&header, &bytes)?,
        Err(codec::DecodeError::NotAnArtifact) => mesh_file(&path, &bytes)?,
        Err(error) => return Err(Failure::new(ExitCode::Storage, format!("{}: {error}", path.display()))),
    };
    super::print(&text)
}

fn artifact(header: &codec::Header, bytes: &[u8]) -> Result<String, Failure> {
    fn decode<K: ArtifactKind>(bytes: &[u8]) -> Result<K::Value, Failure> {
        codec::decode(bytes, K::NAME, K::VERSION)
            .map_err(|error| Failure::new(ExitCode::Storage, error.to_string()))
    }
    let mut text = format!(
        "{} (version {}), {}\nartifact {}\n",
        header.kind,
        header.version,
        display::size(bytes.len() as u64),
        header.identity()
    );
    match header.kind.as_str() {
        Mesh::NAME => text += &describe_part(&decode::<Mesh>(bytes)?),
        Tiling::NAME => {
            let tiling = decode::<Tiling>(bytes)?;
            let _ = writeln!(text, "{} tiles", tiling.tile_count());
            text += &describe_part(&tiling.part);
        }
        QuadLayout::NAME => {
            let layout = decode::<QuadLayout>(bytes)?;
            let _ = writeln!(
                text,
                "{} quads, {} sides, {} corners",
                layout.quads.len(),
                layout.edges.len(),
                layout.vertices.len()
            );
            text += &describe_part(&layout.part);
        }
        SplineSurface::NAME => {
            let surface = decode::<SplineSurface>(bytes)?;
            let _ = writeln!(
                text,
                "{} patches, {} edge curves, {} vertices",
                surface.patches.len(),
                surface.edges.len(),
                surface.vertices.len()
            );
        }
        Skeleton::NAME => {
            let skeleton = decode::<Skeleton>(bytes)?;
            let _ = writeln!(text, "{} points, {} edges", skeleton.points.len(), skeleton.edges.len());
        }
        Beams::NAME => {
            let structure = decode::<Beams>(bytes)?;
            let _ = writeln!(text, "{} beams, {} nodes", structure.beams.len(), structure.nodes.len());
            structure.remarks.iter().for_each(|remark| {
                let _ = writeln!(text, "{remark}");
            });
        }
        Stiffness::NAME => text += &topipe_validation::stiffness_summary(&decode::<Stiffness>(bytes)?),
        Report::NAME => text += &decode::<Report>(bytes)?.summary(),
        _ => {}
    }
    Ok(text)
}

fn mesh_file(path: &Path, bytes: &[u8]) -> Result<String, Failure> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        let shown = path.display();
        let message =
            format!("{shown} is a pipeline; name a stage of it: `topipe inspect STAGE --pipeline {shown}`");
        return Err(Failure::new(ExitCode::Usage, message));
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let part = topipe_mesh::import::read(&name, bytes, &Default::default())
        .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))?;
    Ok(format!("{}, {}\n{}", part.import.format, display::size(bytes.len() as u64), describe_part(&part)))
}

fn describe_part(part: &Part) -> String {
    let mesh = &part.mesh;
    let mut text = format!("{} triangles, {} vertices\n", mesh.face_count(), mesh.vertex_count());
    let mut edges = String::new();
    match Connectivity::build(mesh) {
        Ok(connectivity) => {
            edges = describe_edges(part, &connectivity);
            let genus = connectivity.genus(mesh).map_or("unknown".to_owned(), |genus| genus.to_string());
            let _ = writeln!(text, "{} component(s), genus {genus}", connectivity.components().1);
        }
        Err(error) => {
            let _ = writeln!(text, "not an oriented manifold: {error}");
        }
    }
    let (low, high) = mesh.bounds();
    let _ = writeln!(text, "from {low} to {high} mm");
    let _ = writeln!(text, "volume {:.6} mm^3, area {:.6} mm^2", mesh.volume(), mesh.area());
    let fixed = part.design.iter().filter(|&&design| design == Design::NonDesign).count();
    let frozen = part.frozen.iter().filter(|&&frozen| frozen).count();
    let _ = writeln!(
        text,
        "{fixed} non-design faces, {frozen} frozen vertices, {} regions, {} feature edges",
        part.regions.len(),
        part.feature_edges.len()
    );
    text += &describe_regions(part);
    text += &edges;
    for repair in &part.import.repairs {
        let _ = writeln!(text, "repaired: {} ({})", repair.what, repair.count);
    }
    text
}

/// The chains of sharp edges and of edges named by the user, longest first.
fn describe_edges(part: &Part, connectivity: &Connectivity) -> String {
    let mut text = String::new();
    for (id, chain) in edge_chains(part, connectivity).iter().enumerate() {
        let (edges, angle) = (chain.edges(), chain.angle);
        // Outward, so that the box that is written from it holds the chain.
        let (min, max) = ((1e3 * chain.min).floor() / 1e3, (1e3 * chain.max).ceil() / 1e3);
        let _ = writeln!(
            text,
            "edge {id}: {}, {edges} edge(s), {:.2} mm, dihedral angle at most {angle:.2} degrees, from {min:.3} to {max:.3} mm",
            chain.kind_name(),
            chain.length
        );
    }
    text
}

/// The features, one line each, with what `features` in a pipeline needs to name them.
fn describe_regions(part: &Part) -> String {
    let mut text = String::new();
    for (id, region) in part.regions.iter().enumerate() {
        let shape = match region.shape {
            RegionShape::Plane { point, normal } => {
                format!("plane, normal {normal:.4} at {:.4} mm", normal.dot(point))
            }
            RegionShape::Cylinder { point, axis, radius, hole } => format!(
                "{} of {:.4} mm, axis {axis:.4} through {point:.3}",
                if hole { "hole" } else { "boss" },
                2.0 * radius
            ),
        };
        let _ = writeln!(
            text,
            "region {id}: {shape}, {:.2} mm^2, within {:.1e} mm",
            region.area, region.residual
        );
    }
    text
}
