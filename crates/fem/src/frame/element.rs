//! Matrices of a beam and of a joint.

use super::{Element, Frame, Joint};
use glam::{DMat3, DVec3};

impl Frame {
    /// Columns are the axes of a beam: along it, the axis of its first moment, across both.
    pub(super) fn axes(&self, element: &Element) -> DMat3 {
        let [a, b] = element.nodes.map(|n| self.nodes[n as usize]);
        frame_along((b - a).normalize_or(DVec3::X), element.axis)
    }

    /// In the axes of the beam: displacement and turn of the first node, then of the second.
    pub(super) fn local_stiffness(&self, element: &Element) -> [[f64; 12]; 12] {
        let s = &element.section;
        let l = self.length(element);
        let (e, g) = (self.young, self.young / (2.0 * (1.0 + self.poisson)));
        let mut k = [[0.0; 12]; 12];
        let mut pair = |i: usize, value: f64| {
            k[i][i] += value;
            k[i + 6][i + 6] += value;
            k[i][i + 6] -= value;
            k[i + 6][i] -= value;
        };
        pair(0, e * s.area / l);
        pair(3, g * s.torsion / l);
        // Displacement across with the turn that goes with it; the sign is that of the turn for a positive slope.
        for (across, turn, moment, sign) in [(1, 5, s.moments[1], 1.0), (2, 4, s.moments[0], -1.0)] {
            let phi = 12.0 * e * moment / (s.shear * g * s.area * l * l);
            let c = e * moment / (l * (1.0 + phi));
            let [i, j] = [across, across + 6];
            let [p, q] = [turn, turn + 6];
            let mut set = |a: usize, b: usize, value: f64| {
                k[a][b] = value;
                k[b][a] = value;
            };
            set(i, i, 12.0 * c / (l * l));
            set(j, j, 12.0 * c / (l * l));
            set(i, j, -12.0 * c / (l * l));
            set(i, p, sign * 6.0 * c / l);
            set(i, q, sign * 6.0 * c / l);
            set(j, p, -sign * 6.0 * c / l);
            set(j, q, -sign * 6.0 * c / l);
            set(p, p, (4.0 + phi) * c);
            set(q, q, (4.0 + phi) * c);
            set(p, q, (2.0 - phi) * c);
        }
        k
    }

    /// Displacements of the ends of a beam in its axes, and the forces that belong to them.
    fn end_forces(&self, element: &Element, displacements: &[[DVec3; 2]]) -> ([f64; 12], [f64; 12]) {
        let axes = self.axes(element).transpose();
        let mut u = [0.0; 12];
        for (end, &node) in element.nodes.iter().enumerate() {
            for (part, vector) in displacements[node as usize].into_iter().enumerate() {
                let local = axes * vector;
                (0..3).for_each(|c| u[6 * end + 3 * part + c] = local[c]);
            }
        }
        let k = self.local_stiffness(element);
        (u, std::array::from_fn(|i| (0..12).map(|j| k[i][j] * u[j]).sum()))
    }

    /// Twice the strain energy of a beam.
    pub(super) fn energy(&self, element: &Element, displacements: &[[DVec3; 2]]) -> f64 {
        let (u, f) = self.end_forces(element, displacements);
        u.iter().zip(f).map(|(u, f)| u * f).sum()
    }

    /// The largest von Mises stress at the ends of a beam: normal force and bending at the outermost fibre, with torsion.
    pub(super) fn stress(&self, element: &Element, displacements: &[[DVec3; 2]]) -> f64 {
        let (_, f) = self.end_forces(element, displacements);
        let s = &element.section;
        let at = |end: usize| {
            let f = &f[6 * end..];
            let bending =
                [f[4] * s.fibres[0] / s.moments[0], f[5] * s.fibres[1] / s.moments[1]].map(f64::abs);
            let bending = if s.round { bending[0].hypot(bending[1]) } else { bending[0] + bending[1] };
            let normal = f[0].abs() / s.area + bending;
            let shear = f[3] * s.fibres[0].max(s.fibres[1]) / s.torsion;
            (normal * normal + 3.0 * shear * shear).sqrt()
        };
        at(0).max(at(1))
    }
}

/// Columns: `along`, the part of `axis` across it, and across both.
pub(super) fn frame_along(along: DVec3, axis: DVec3) -> DMat3 {
    let along = along.normalize_or(DVec3::X);
    let across = axis.reject_from_normalized(along).try_normalize();
    let across = across.unwrap_or_else(|| along.any_orthonormal_vector());
    DMat3::from_cols(along, across, along.cross(across))
}

pub(super) fn joint_stiffness(joint: &Joint) -> [[f64; 12]; 12] {
    let [along, across] = joint.displacement;
    let [about, over] = joint.turn;
    let mut k = [[0.0; 12]; 12];
    for (i, value) in [along, across, across, about, over, over].into_iter().enumerate() {
        (k[i][i], k[i + 6][i + 6]) = (value, value);
        (k[i][i + 6], k[i + 6][i]) = (-value, -value);
    }
    k
}

/// From the unknowns of the bodies to the displacements of the ends in the given axes; the ends stand on arms.
fn transformation(axes: DMat3, arms: [DVec3; 2]) -> [[f64; 12]; 12] {
    let axes = axes.transpose();
    let mut t = [[0.0; 12]; 12];
    for (end, arm) in arms.into_iter().enumerate() {
        for d in 0..3 {
            let moved = axes.col(d);
            // Turn about axis d moves the end by axis x arm.
            let turned = axes * DVec3::AXES[d].cross(arm);
            for c in 0..3 {
                t[6 * end + c][6 * end + d] = moved[c];
                t[6 * end + c][6 * end + 3 + d] = turned[c];
                t[6 * end + 3 + c][6 * end + 3 + d] = moved[c];
            }
        }
    }
    t
}

pub(super) fn global_stiffness(k: &[[f64; 12]; 12], axes: DMat3, arms: [DVec3; 2]) -> [[f64; 12]; 12] {
    let t = transformation(axes, arms);
    let mut half = [[0.0; 12]; 12];
    let mut whole = [[0.0; 12]; 12];
    for i in 0..12 {
        for j in 0..12 {
            half[i][j] = (0..12).map(|m| k[i][m] * t[m][j]).sum();
        }
    }
    for i in 0..12 {
        for j in 0..12 {
            whole[i][j] = (0..12).map(|m| t[m][i] * half[m][j]).sum();
        }
    }
    whole
}
