//! Meshes with known answers.

use crate::Noise;
use std::collections::HashMap;
use topipe_mesh::{DVec3, TriangleMesh};

/// A sphere of radius 10 about `center`: an octahedron refined `levels` times.
pub(crate) fn sphere(levels: usize, center: DVec3) -> TriangleMesh {
    let mut points = vec![DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for t in triangles {
            let m = [0, 1, 2].map(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push((points[a as usize] + points[b as usize]).normalize());
                    points.len() as u32 - 1
                })
            });
            finer.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        triangles = finer;
    }
    TriangleMesh::from_arrays(points.iter().map(|p| (center + 10.0 * *p).to_array()).collect(), triangles)
}

/// Two caps of a sphere of radius 10 that meet along a circle in the plane z = 0, where their normals differ by
/// 60 degrees: free surface with a sharp edge of `4 * 2^levels` edges, which are chords of a radius of `10 sin(60)`.
pub(crate) fn lens(levels: usize) -> TriangleMesh {
    let mut mesh = sphere(levels, DVec3::ZERO);
    let rim = 60f64.to_radians();
    for p in &mut mesh.positions {
        let (across, up) = (p.x.hypot(p.y), p.z.abs());
        let from_pole = rim * across.atan2(up) / std::f64::consts::FRAC_PI_2;
        let (radius, height) = (10.0 * from_pole.sin(), 10.0 * (from_pole.cos() - rim.cos()));
        let scale = if across > 0.0 { radius / across } else { 0.0 };
        // Exactly in the plane, whatever the rounding of the angle.
        let z = if p.z == 0.0 { 0.0 } else { height.copysign(p.z) };
        *p = DVec3::new(scale * p.x, scale * p.y, z);
    }
    mesh
}

/// A tube of this `radius` around a closed curve over [0, 1], `around` facets about it and `along` along it. Its frame is made from
/// `side`, which must not be parallel to the curve anywhere.
pub(crate) fn tube(
    curve: impl Fn(f64) -> DVec3,
    side: impl Fn(f64) -> DVec3,
    radius: f64,
    [along, around]: [u32; 2],
) -> TriangleMesh {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..along {
        let t = f64::from(i) / f64::from(along);
        let tangent = (curve(t + 1e-5) - curve(t - 1e-5)).normalize();
        let u = side(t).cross(tangent).normalize();
        let v = tangent.cross(u);
        for j in 0..around {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(j) / f64::from(around)).sin_cos();
            points.push((curve(t) + radius * (cos * u + sin * v)).to_array());
            let at = |i: u32, j: u32| i % along * around + j % around;
            let q = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        }
    }
    TriangleMesh::from_arrays(points, triangles)
}

/// A round rod of radius 5 and length 20 along z, 48 facets about it, with edges of about 0.65.
pub(crate) fn rod() -> TriangleMesh {
    const AROUND: u32 = 48;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    // Rings up the middle of one end, up the wall, and into the middle of the other end.
    let ends = (1..8).map(|k| f64::from(k) * 5.0 / 8.0);
    let wall = (0..=30).map(|k| (5.0, f64::from(k) * 20.0 / 30.0));
    let rings: Vec<(f64, f64)> =
        ends.clone().map(|r| (r, 0.0)).chain(wall).chain(ends.rev().map(|r| (r, 20.0))).collect();
    for &(radius, z) in &rings {
        for j in 0..AROUND {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(j) / f64::from(AROUND)).sin_cos();
            points.push([radius * cos, radius * sin, z]);
        }
    }
    let at = |i: u32, j: u32| i * AROUND + j % AROUND;
    let last = rings.len() as u32 - 1;
    let poles = [points.len() as u32, points.len() as u32 + 1];
    points.extend([[0.0, 0.0, 0.0], [0.0, 0.0, 20.0]]);
    for j in 0..AROUND {
        triangles.extend([[poles[0], at(0, j + 1), at(0, j)], [poles[1], at(last, j), at(last, j + 1)]]);
        for i in 0..last {
            let q = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        }
    }
    TriangleMesh::from_arrays(points, triangles)
}

/// Moves each vertex by up to `size` along each axis.
pub(crate) fn shake(mesh: &mut TriangleMesh, size: f64, seed: u64) {
    let mut noise = Noise(seed);
    for p in &mut mesh.positions {
        *p += size * DVec3::new(noise.next(), noise.next(), noise.next());
    }
}

/// The surface of the unit voxels whose centres satisfy `inside`, two triangles per voxel face.
pub(crate) fn voxels(size: i32, inside: impl Fn(DVec3) -> bool) -> TriangleMesh {
    let filled = |c: [i32; 3]| inside(DVec3::new(c[0].into(), c[1].into(), c[2].into()) + 0.5);
    let mut vertices = HashMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for x in -size..size {
        for y in -size..size {
            for z in -size..size {
                if !filled([x, y, z]) {
                    continue;
                }
                for axis in 0..3 {
                    for side in 0..2 {
                        let mut beyond = [x, y, z];
                        beyond[axis] += 2 * side - 1;
                        if filled(beyond) {
                            continue;
                        }
                        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                            let mut c = [x, y, z];
                            c[axis] += side;
                            c[(axis + 1) % 3] += u;
                            c[(axis + 2) % 3] += v;
                            *vertices.entry(c).or_insert_with(|| {
                                positions.push(c.map(f64::from));
                                positions.len() as u32 - 1
                            })
                        });
                        let [a, b, c, d] = corners;
                        if side == 1 {
                            triangles.extend([[a, b, c], [a, c, d]]);
                        } else {
                            triangles.extend([[a, c, b], [a, d, c]]);
                        }
                    }
                }
            }
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}
