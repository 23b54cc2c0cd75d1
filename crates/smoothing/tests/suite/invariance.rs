//! The result moves, turns, grows and is numbered with the part.

use crate::{Noise, read, smoothed};
use topipe_mesh::{DVec3, Part, TriangleMesh, VertexId};
use topipe_smoothing::Parameters;

#[test]
fn smoothing_commutes_with_turning_scaling_and_shifting() {
    let part = read("y-form");
    let plain = smoothed(&part, &Parameters::default());
    let mut noise = Noise(11);
    for scale in [1e-3, 1.0, 1e3] {
        let axis = DVec3::new(noise.next(), noise.next(), noise.next()).normalize();
        let turn = glam::DQuat::from_axis_angle(axis, 3.0 * noise.next());
        let shift = DVec3::new(noise.next(), noise.next(), noise.next()) * 100.0 * scale;
        let mut moved = part.clone();
        moved.mesh.positions.iter_mut().for_each(|p| *p = turn * (scale * *p) + shift);
        let result = smoothed(&moved, &Parameters::default());
        assert_eq!(result.frozen, plain.frozen);
        assert_eq!(result.feature_edges, plain.feature_edges);
        for (p, q) in plain.mesh.positions.iter().zip(&result.mesh.positions) {
            assert!((turn * (scale * *p) + shift).distance(*q) < 1e-7 * scale);
        }
    }
}

/// The part with other numbers, and the old number of each of its vertices and faces.
pub(crate) fn shuffled(part: &Part) -> (Part, Vec<usize>, Vec<usize>) {
    let mut noise = Noise(5);
    let mut shuffle = |n: usize| {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, (((noise.next() + 1.0) / 2.0 * (i + 1) as f64) as usize).min(i));
        }
        order
    };
    let vertex_at = shuffle(part.mesh.vertex_count());
    let face_at = shuffle(part.mesh.face_count());
    let mut new_vertex = vec![0; vertex_at.len()];
    for (new, &old) in vertex_at.iter().enumerate() {
        new_vertex[old] = new;
    }
    let mesh = TriangleMesh {
        positions: vertex_at.iter().map(|&v| part.mesh.positions[v]).collect(),
        triangles: face_at
            .iter()
            .map(|&f| part.mesh.triangles[f].map(|v| VertexId::new(new_vertex[v.index()])))
            .collect(),
    };
    let mut shuffled = Part::new(mesh);
    shuffled.design = face_at.iter().map(|&f| part.design[f]).collect();
    (shuffled, vertex_at, face_at)
}

#[test]
fn smoothing_does_not_depend_on_numbering() {
    let part = read("y-form");
    let plain = smoothed(&part, &Parameters::default());
    let (shuffled, vertex_at, face_at) = shuffled(&part);
    let result = smoothed(&shuffled, &Parameters::default());
    for (new, &old) in vertex_at.iter().enumerate() {
        assert_eq!(result.frozen[new], plain.frozen[old]);
        assert!(result.mesh.positions[new].distance(plain.mesh.positions[old]) < 1e-8);
    }
    for (new, &old) in face_at.iter().enumerate() {
        assert_eq!(result.region_of_face[new].is_some(), plain.region_of_face[old].is_some());
    }
}

/// Large meshes are renumbered for the iteration; nobody may notice.
#[test]
fn a_large_mesh_is_smoothed_in_its_own_numbering() {
    let mut mesh = crate::shapes::sphere(7, DVec3::new(3.0, -2.0, 1.0));
    crate::shapes::shake(&mut mesh, 0.02, 4);
    let part = Part::new(mesh);
    let parameters = Parameters {
        method: topipe_smoothing::Method::Laplacian,
        lambda: 1.0,
        iterations: Some(1),
        detect_planes: false,
        detect_holes: false,
        detect_bosses: false,
        spike_angle: 180.0,
        ..Parameters::default()
    };
    let mut results = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        results.push(pool.install(|| smoothed(&part, &parameters)));
    }
    assert!(results[0] == results[1]);
    let mut sum = vec![DVec3::ZERO; part.mesh.vertex_count()];
    let mut count = vec![0.0; part.mesh.vertex_count()];
    for t in &part.mesh.triangles {
        for k in 0..3 {
            // Each edge runs in both directions once.
            sum[t[k].index()] += part.mesh.position(t[(k + 1) % 3]);
            count[t[k].index()] += 1.0;
        }
    }
    for v in part.mesh.vertices() {
        let mean = sum[v.index()] / count[v.index()];
        assert!(results[0].mesh.position(v).distance(mean) < 1e-13);
    }
}
