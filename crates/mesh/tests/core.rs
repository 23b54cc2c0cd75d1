//! Connectivity and measures on meshes whose counts, volumes and genus are known.

use proptest::prelude::*;
use std::f64::consts::{PI, TAU};
use topipe_mesh::{Connectivity, ConnectivityError, DVec3, FaceId, TriangleMesh, VertexId};

fn tetrahedron() -> TriangleMesh {
    TriangleMesh::from_arrays(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
}

/// A grid of `n` by `m` squares, wrapped around in neither, one or both directions.
fn grid(n: u32, m: u32, wrap: [bool; 2]) -> TriangleMesh {
    let (rows, columns) = (if wrap[0] { n } else { n + 1 }, if wrap[1] { m } else { m + 1 });
    let mut positions = Vec::new();
    for i in 0..rows {
        for k in 0..columns {
            let (u, v) = (f64::from(i) / f64::from(n) * TAU, f64::from(k) / f64::from(m) * TAU);
            let r = 3.0 + v.cos();
            positions.push([r * u.cos(), r * u.sin(), v.sin()]);
        }
    }
    let at = |i: u32, k: u32| (i % rows) * columns + k % columns;
    let triangles = (0..n * m)
        .flat_map(|s| {
            let (i, k) = (s / m, s % m);
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh::from_arrays(positions, triangles)
}

#[test]
fn a_tetrahedron() {
    let mesh = tetrahedron();
    let connectivity = Connectivity::build(&mesh).unwrap();
    assert_eq!(mesh.volume(), 1.0 / 6.0);
    assert!((mesh.area() - (1.5 + 3.0f64.sqrt() / 2.0)).abs() < 1e-15);
    assert_eq!((connectivity.edge_count(), connectivity.border_edge_count()), (6, 0));
    assert_eq!(connectivity.euler_characteristic(&mesh), 2);
    assert_eq!(connectivity.genus(&mesh), Some(0));
    assert_eq!(mesh.bounds(), (DVec3::ZERO, DVec3::ONE));
    assert_eq!(mesh.diagonal(), 3.0f64.sqrt());
    assert!((mesh.mean_edge_length() - (1.0 + 2.0f64.sqrt()) / 2.0).abs() < 1e-15);
    for f in mesh.faces() {
        assert!(mesh.normal(f).dot(mesh.centroid(f) - DVec3::splat(0.1)) > 0.0);
    }
}

#[test]
fn a_torus_has_genus_one_and_its_volume() {
    let mesh = grid(200, 100, [true, true]);
    let connectivity = Connectivity::build(&mesh).unwrap();
    assert_eq!(connectivity.euler_characteristic(&mesh), 0);
    assert_eq!(connectivity.genus(&mesh), Some(1));
    // 2 pi^2 R r^2 and 4 pi^2 R r, both missed by the chords to second order.
    assert!((mesh.volume() / (6.0 * PI * PI) - 1.0).abs() < 2e-3);
    assert!((mesh.area() / (12.0 * PI * PI) - 1.0).abs() < 1e-3);
    for (v, n) in mesh.vertex_normals().iter().enumerate() {
        let p = mesh.positions[v];
        let ring = DVec3::new(p.x, p.y, 0.0).normalize() * 3.0;
        assert!(n.dot(p - ring) > 0.999);
    }
}

#[test]
fn volume_does_not_lose_digits_far_from_the_origin() {
    let mut mesh = tetrahedron();
    for p in &mut mesh.positions {
        *p += DVec3::splat(1048576.0);
    }
    assert!((mesh.volume() * 6.0 - 1.0).abs() < 1e-9);
}

#[test]
fn borders_components_and_fans() {
    let mesh = grid(6, 5, [false, false]);
    let connectivity = Connectivity::build(&mesh).unwrap();
    assert_eq!(connectivity.border_edge_count(), 22);
    assert_eq!(connectivity.euler_characteristic(&mesh), 1);
    assert_eq!(connectivity.genus(&mesh), None);
    assert_eq!(mesh.vertices().filter(|&v| connectivity.is_border(v)).count(), 22);
    let (start, neighbors) = connectivity.vertex_neighbors();
    assert_eq!(neighbors.len(), 2 * connectivity.edge_count());
    for v in mesh.vertices() {
        let around = &neighbors[start[v.index()] as usize..start[v.index() + 1] as usize];
        for &w in around {
            assert!(connectivity.half_edge(v, w).or(connectivity.half_edge(w, v)).is_some());
        }
        let mut distinct = around.to_vec();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), around.len());
    }
    let mut two = mesh.clone();
    let shift = two.vertex_count() as u32;
    two.positions.extend(mesh.positions.iter().map(|p| *p + DVec3::splat(9.0)));
    two.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| VertexId(v.0 + shift))));
    let (component, count) = Connectivity::build(&two).unwrap().components();
    assert_eq!(count, 2);
    assert!(component[..60].iter().all(|&c| c == 0) && component[60..].iter().all(|&c| c == 1));
}

proptest! {
    /// The half-edge relations, for tori, tubes and sheets of any size.
    #[test]
    fn half_edges_keep_their_relations(n in 3u32..9, m in 3u32..9, around in any::<bool>(), along in any::<bool>()) {
        let mesh = grid(n, m, [around, along]);
        let c = Connectivity::build(&mesh).unwrap();
        let mut edges = 0;
        for f in mesh.faces() {
            for k in 0..3 {
                let h = topipe_mesh::HalfEdgeId::of(f, k);
                prop_assert_eq!((h.face(), h.corner()), (f, k));
                prop_assert_eq!(h.next().next().next(), h);
                prop_assert_eq!(h.next().prev(), h);
                let t = c.twin(h);
                if t.is_some() {
                    prop_assert_eq!(c.twin(t), h);
                    prop_assert_eq!((mesh.origin(t), mesh.target(t)), (mesh.target(h), mesh.origin(h)));
                    prop_assert_eq!(c.neighbor(f, k), t.face());
                } else {
                    prop_assert_eq!(c.neighbor(f, k), FaceId::NONE);
                }
            }
        }
        for h in c.edges() {
            edges += 1;
            prop_assert!(!c.twin(h).is_some() || h < c.twin(h));
        }
        prop_assert_eq!(edges, c.edge_count());
        let euler = [[1, 0], [0, 0]][around as usize][along as usize];
        prop_assert_eq!(c.euler_characteristic(&mesh), euler);
        prop_assert_eq!(c.is_closed(), around && along);
        for v in mesh.vertices() {
            let faces = mesh.triangles.iter().filter(|t| t.contains(&v)).count();
            prop_assert_eq!(c.outgoing(v).count(), faces);
            prop_assert!(c.outgoing(v).all(|h| mesh.origin(h) == v));
        }
    }
}

#[test]
fn what_is_not_a_manifold_is_refused() {
    let refused = |triangles: Vec<[u32; 3]>| {
        Connectivity::build(&TriangleMesh::from_arrays(vec![[0.0; 3]; 5], triangles)).unwrap_err()
    };
    assert_eq!(
        refused(vec![[0, 1, 7]]),
        ConnectivityError::VertexOutOfRange { face: 0, vertex: 7, count: 5 }
    );
    assert_eq!(refused(vec![[0, 1, 2], [3, 1, 3]]), ConnectivityError::RepeatedVertex { face: 1, vertex: 3 });
    assert_eq!(
        refused(vec![[0, 1, 2], [0, 1, 3]]),
        ConnectivityError::NonManifoldEdge { from: 0, to: 1, first: 0, second: 1 }
    );
    assert!(matches!(
        refused(vec![[0, 1, 2], [1, 0, 3], [1, 0, 4]]),
        ConnectivityError::NonManifoldEdge { .. }
    ));
    assert_eq!(refused(vec![[0, 1, 2], [0, 3, 4]]), ConnectivityError::NonManifoldVertex { vertex: 0 });
}
