//! Remeshes a file: `cargo run --release -p topipe-remeshing --example remesh -- IN.stl OUT.stl [EDGE_LENGTH]`
use std::error::Error;
use topipe_mesh::DVec3;
use topipe_mesh::import::{ImportOptions, read};
use topipe_progress::Progress;
use topipe_remeshing::{Parameters, Tessellation, remesh};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let input = arguments.next().ok_or("IN.stl")?;
    let part = read(&input, &std::fs::read(&input)?, &ImportOptions::default())?;
    println!("{input}: {:?}", Tessellation::measure(&part.mesh));
    let Some(output) = arguments.next() else { return Ok(()) };
    let mut parameters = Parameters::default();
    if let Some(length) = arguments.next() {
        parameters.edge_length = length.parse()?;
    }
    let start = std::time::Instant::now();
    let new = remesh(&part, &parameters, &Progress::silent())?;
    let time = start.elapsed();
    println!(
        "{} -> {} triangles in {time:.2?}, {:?}",
        part.mesh.face_count(),
        new.mesh.face_count(),
        Tessellation::measure(&new.mesh)
    );
    let least = |f| {
        let [a, b, c] = new.mesh.corners(f);
        let angle = |p: DVec3, q: DVec3, r: DVec3| (q - p).angle_between(r - p);
        angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b)).to_degrees()
    };
    let (count, angles) = (new.mesh.face_count() as f64, new.mesh.faces().map(least));
    let (sum, smallest) = angles.fold((0.0, 180.0f64), |(sum, low), a| (sum + a, low.min(a)));
    println!("least angles: mean {:.2}, smallest {smallest:.2} degrees", sum / count);
    println!("volume {} -> {}", part.mesh.volume(), new.mesh.volume());
    let mut file = std::fs::File::create(output)?;
    topipe_mesh::write::stl(&new.mesh, &mut file)?;
    Ok(())
}
