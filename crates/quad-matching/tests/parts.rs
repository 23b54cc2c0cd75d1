//! The tessellation on the reference parts.

use topipe_mesh::{Part, TriangleMesh};
use topipe_progress::Progress;
use topipe_quad_matching::match_quads;
use topipe_tiling::tile;

fn off(path: &str) -> Part {
    let text = std::fs::read_to_string(path).unwrap();
    let mut words = text.split_whitespace().skip(1).map(|w| w.parse::<f64>().unwrap());
    let mut next = || words.next().unwrap();
    let (n, m) = (next() as usize, next() as usize);
    next();
    let positions = (0..n).map(|_| [next(), next(), next()]).collect();
    let triangles = (0..m)
        .map(|_| {
            next();
            [next() as u32, next() as u32, next() as u32]
        })
        .collect();
    Part::new(TriangleMesh::from_arrays(positions, triangles))
}

#[test]
fn all() {
    for name in [
        "bracket",
        "beam-two-holes",
        "bridge",
        "bell-crank",
        "support",
        "cantilever",
        "cantilever-four",
        "y-form",
        "monster-lite",
        "space-frame",
    ] {
        let part = off(&format!("/work/shared/data/{name}/{name}.off"));
        let tiling = tile(&part, &Default::default(), &Progress::silent()).unwrap();
        let t = std::time::Instant::now();
        let layout = match_quads(&tiling, &Default::default(), &Progress::silent());
        let dt = t.elapsed();
        match layout {
            Ok(l) => {
                let mut v = std::collections::BTreeMap::new();
                for x in l.valences() {
                    *v.entry(x).or_insert(0) += 1;
                }
                println!(
                    "{name}: {} quads {} faces {dt:?} {v:?} {:?}",
                    l.quads.len(),
                    l.part.mesh.face_count(),
                    &topipe_quad_matching::verify(&l)
                )
            }
            Err(e) => println!("{name}: {e}"),
        }
    }
}
