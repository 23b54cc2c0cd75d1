//! Cylinders that are tangent to planes beside them: fillets.
//!
//! Both shapes are fitted to vertices of their own, so that they miss each other by what those deviate, and then have no curve in
//! common, or one that is far away: at a miss of 1e-4 of the radius both cross at an angle of 0.8 degrees. Where the mesh can not tell
//! the difference, the cylinder is moved until it is tangent, and their common curve is a line.

use topipe_mesh::{DVec3, RegionShape};

/// A cylinder that misses being tangent to a plane by at most so many times what the vertices of both are off their shapes is taken for
/// tangent: the line they meet in is at the end of the arc, where its fit is the least sure.
const MISSES: f64 = 4.0;

/// Planes whose rows differ by less than this say the same.
const INDEPENDENT: f64 = 1e-3;

/// A plane beside a cylinder.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneBeside {
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    /// How far vertices of the plane and of the cylinder may be off, mm.
    pub(super) unseen: f64,
}

/// The cylinder as near to `shape` as it can be while it is tangent to all of those `planes` that it all but is tangent to; `None` when
/// there are none, or not all of it is a cylinder's. `extent` is how far the surface reaches from the cylinder's point, mm.
///
/// With more planes than a cylinder can be tangent to, those of least miss count.
pub(super) fn tangent(shape: &RegionShape, planes: &[PlaneBeside], extent: f64) -> Option<RegionShape> {
    let RegionShape::Cylinder { point, axis, radius, hole } = *shape else { return None };
    let miss = |plane: &PlaneBeside| {
        let height = plane.normal.dot(point - plane.point);
        (height.abs() - radius).abs()
    };
    let mut near: Vec<&PlaneBeside> = planes
        .iter()
        .filter(|plane| {
            let most = MISSES * plane.unseen;
            axis.dot(plane.normal).abs() * extent <= most && miss(plane) <= most
        })
        .collect();
    near.sort_by(|a, b| miss(a).total_cmp(&miss(b)));
    // Changes of the point (three) and of the radius that make it tangent: rows of a system whose least solution is wanted, made
    // orthonormal one after the other.
    let mut rows: Vec<([f64; 4], f64)> = Vec::new();
    let mut normals: Vec<DVec3> = Vec::new();
    for plane in near {
        let height = plane.normal.dot(point - plane.point);
        let side = height.signum();
        let n = plane.normal;
        let (mut row, mut right) = ([n.x, n.y, n.z, -side], side * radius - height);
        for (other, value) in &rows {
            let along: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
            (0..4).for_each(|k| row[k] -= along * other[k]);
            right -= along * value;
        }
        let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length < INDEPENDENT || rows.len() == 3 {
            continue;
        }
        rows.push((row.map(|x| x / length), right / length));
        if normals.iter().all(|m| m.cross(n).length() > INDEPENDENT) {
            normals.push(n);
        }
    }
    let turned = match normals[..] {
        [] => return None,
        [n] => axis.reject_from_normalized(n),
        [n, m, ..] => {
            let cross = n.cross(m);
            if cross.dot(axis) < 0.0 { -cross } else { cross }
        }
    };
    let mut change = [0.0; 4];
    for (row, value) in &rows {
        (0..4).for_each(|k| change[k] += value * row[k]);
    }
    let radius = radius + change[3];
    let axis = turned.try_normalize()?;
    (radius > 0.0).then_some(RegionShape::Cylinder {
        point: point + DVec3::new(change[0], change[1], change[2]),
        axis,
        radius,
        hole,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(point: DVec3, normal: DVec3) -> PlaneBeside {
        PlaneBeside { point, normal: normal.normalize(), unseen: 1e-3 }
    }

    fn misses(shape: &RegionShape, planes: &[PlaneBeside]) -> Vec<f64> {
        let RegionShape::Cylinder { point, axis, radius, .. } = *shape else { return vec![f64::NAN] };
        planes
            .iter()
            .map(|p| {
                (p.normal.dot(point - p.point).abs() - radius).abs().max(axis.dot(p.normal).abs() * 10.0)
            })
            .collect()
    }

    fn fillet(off: f64) -> RegionShape {
        RegionShape::Cylinder {
            point: DVec3::new(5.0 + off, 5.0 - 0.7 * off, 3.0),
            axis: DVec3::new(0.3 * off / 10.0, 0.2 * off / 10.0, 1.0).normalize(),
            radius: 5.0 + 0.4 * off,
            hole: true,
        }
    }

    #[test]
    fn a_fillet_between_two_planes_touches_both() {
        let planes = [plane(DVec3::ZERO, DVec3::X), plane(DVec3::new(7.0, 0.0, 1.0), DVec3::Y)];
        let found = tangent(&fillet(5e-4), &planes, 20.0).unwrap();
        assert!(misses(&found, &planes).iter().all(|m| *m < 1e-12), "{:?}", misses(&found, &planes));
    }

    #[test]
    fn the_round_end_of_a_slot_gets_its_width() {
        let planes = [plane(DVec3::ZERO, DVec3::X), plane(DVec3::new(10.0, 0.0, 0.0), -DVec3::X)];
        let found = tangent(&fillet(5e-4), &planes, 20.0).unwrap();
        assert!(misses(&found, &planes).iter().all(|m| *m < 1e-12));
        assert!(matches!(found, RegionShape::Cylinder { radius, .. } if (radius - 5.0).abs() < 1e-12));
    }

    #[test]
    fn what_is_seen_to_cross_is_left() {
        let planes = [plane(DVec3::ZERO, DVec3::X)];
        assert!(tangent(&fillet(0.1), &planes, 20.0).is_none());
        assert!(tangent(&fillet(0.0), &[plane(DVec3::ZERO, DVec3::Z)], 20.0).is_none());
    }
}
