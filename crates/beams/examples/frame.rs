//! Beams of a skeleton: `frame SKELETON.json(artifact codec excluded) ...` is what the command does; this example takes a
//! mesh, and writes all files of its structure: `frame MESH LABELS.csv|- OUT_DIR [straight|spline] [mean|profile]`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use topipe_beams::{AxisForm, Parameters, Sections, frame, solid, write};
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, labels, folder, rest @ ..] = &arguments[..] else {
        return Err("usage: frame MESH LABELS.csv|- OUT_DIR [straight|spline] [mean|profile]".into());
    };
    let has = |word: &str| rest.iter().any(|r| r == word);
    let bytes = std::fs::read(mesh)?;
    let label_bytes = if labels == "-" { None } else { Some(std::fs::read(labels)?) };
    let source =
        Source { labels: label_bytes.as_deref().map(|b| (&labels[..], b)), ..Source::new(mesh, &bytes) };
    let part = read_source(&source, &ImportOptions::default(), &Progress::silent())?;
    let skeleton = topipe_skeleton::skeletonize(&part, &Default::default(), &Progress::silent())?;
    let parameters = Parameters {
        axis: if has("spline") { AxisForm::Spline } else { AxisForm::Straight },
        sections: if has("profile") { Sections::Profile } else { Sections::Mean },
        ..Parameters::default()
    };
    let structure = frame(&skeleton, Some(&part.mesh), &parameters, &Progress::silent())?;
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder)?;
    let file = |name: &str| File::create(folder.join(name)).map(BufWriter::new);
    write::csv(&structure, &mut file("beams.csv")?)?;
    write::dxf(&structure, &mut file("beams.dxf")?)?;
    write::calculix(&structure, "frame", &mut file("frame.inp")?)?;
    std::fs::write(folder.join("beams.json"), format!("{:#}\n", write::json(&structure)))?;
    let solid = solid::solid(&structure)?;
    for remark in structure.remarks.iter().chain(&solid.remarks) {
        println!("{remark}");
    }
    write::step(&solid.brep, "frame", write::Protocol::Ap214, &mut file("frame.step")?)?;
    topipe_mesh::write::stl(&solid::triangulate(&solid.brep, 0.2), &mut file("frame.stl")?)?;
    println!(
        "{} beams, {} nodes, {} faces",
        structure.beams.len(),
        structure.nodes.len(),
        solid.brep.faces.len()
    );
    Ok(())
}
