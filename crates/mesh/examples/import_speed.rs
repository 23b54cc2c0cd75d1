//! How long import and spatial queries take on a torus of one million triangles, and how the spatial index compares
//! with parry3d. `cargo run --release -p topipe-mesh --example import_speed [TRIANGLES]`

use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape::TriMesh;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, TriangleMesh, write};

fn torus(rings: u32, sides: u32) -> TriangleMesh {
    use std::f64::consts::TAU;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..rings {
        for k in 0..sides {
            let (u, v) = (f64::from(i) / f64::from(rings) * TAU, f64::from(k) / f64::from(sides) * TAU);
            let r = 30.0 + 10.0 * v.cos() + 0.3 * (7.0 * u).sin();
            positions.push([r * u.cos(), r * u.sin(), 10.0 * v.sin()]);
            let at = |i: u32, k: u32| (i % rings) * sides + k % sides;
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    println!("{what}: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    result
}

fn main() {
    let triangles: u32 = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(1_000_000);
    let sides = ((f64::from(triangles) / 6.0).sqrt()) as u32;
    let mesh = torus(3 * sides, sides);
    println!("{} triangles", mesh.face_count());
    type Writer = fn(&TriangleMesh, &mut Vec<u8>) -> std::io::Result<()>;
    let writers: [(&str, Writer); 4] =
        [("stl", write::stl), ("off", write::off), ("obj", write::obj), ("ply", write::ply)];
    for (ending, writer) in writers {
        let mut bytes = Vec::new();
        timed(&format!("write {ending}"), || writer(&mesh, &mut bytes)).expect("a vector takes all bytes");
        let name = format!("torus.{ending}");
        let part = timed(&format!("read {ending}"), || read(&name, &bytes, &ImportOptions::default()));
        assert_eq!(part.expect("a torus is closed").mesh.face_count(), mesh.face_count());
    }

    let index = timed("index: build", || SurfaceIndex::build(&mesh));
    let parry = timed("parry: build", || {
        let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let indices = mesh.triangles.iter().map(|t| t.map(|v| v.0)).collect();
        TriMesh::new(vertices, indices).expect("a mesh with faces")
    });
    // Points near the surface, as in a deviation, and far from it; the R3 sequence spreads the latter.
    let near: Vec<DVec3> =
        (0..20_000).map(|k| mesh.positions[k * 23 % mesh.vertex_count()] * 1.001).collect();
    let far: Vec<DVec3> = (0..2_000)
        .map(|k| {
            let x = DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5) * f64::from(k);
            (x.fract() - 0.5) * DVec3::new(100.0, 100.0, 40.0)
        })
        .collect();
    for (what, points) in [("near", &near), ("far", &far)] {
        let ours: f64 = timed(&format!("index: {} nearest, {what}", points.len()), || {
            points.iter().filter_map(|&p| index.nearest(p)).map(|n| n.distance).sum()
        });
        let theirs: f64 = timed(&format!("parry: {} nearest, {what}", points.len()), || {
            points
                .iter()
                .map(|p| {
                    let q = Vector::new(p.x, p.y, p.z);
                    let found = parry.project_local_point(q, false).point;
                    DVec3::new(found.x, found.y, found.z).distance(*p)
                })
                .sum()
        });
        assert!((ours - theirs).abs() < 1e-6 * ours, "{ours} {theirs}");
    }
    let hits = timed("index: 20000 rays", || {
        near.iter().filter(|&&p| index.ray(p * 2.0, -p, f64::INFINITY).is_some()).count()
    });
    let theirs = timed("parry: 20000 rays", || {
        near.iter()
            .filter(|p| {
                let ray =
                    Ray::new(Vector::new(p.x * 2.0, p.y * 2.0, p.z * 2.0), Vector::new(-p.x, -p.y, -p.z));
                parry.cast_local_ray(&ray, f64::INFINITY, false).is_some()
            })
            .count()
    });
    println!("hits: index {hits}, parry {theirs} of {}", near.len());
    let inside =
        timed("index: 2000 inside or outside", || far.iter().filter(|&&p| index.contains(p)).count());
    println!("{inside} of them inside");
}
