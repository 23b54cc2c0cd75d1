//! Straight axes with shared nodes: all nodes at once, by total least squares.
//!
//! The squared distances of all points from the axes of their beams, each axis running through its two nodes, are made
//! least. With the directions and the places of the points along them held, that is a linear problem in the nodes;
//! it is solved and they are found anew, ten times.

use glam::{DMat3, DVec3};

/// Rounds of solving: the directions of the frame of seven beams stand still to 1e-9 of its size after four.
const ROUNDS: usize = 10;

/// Beyond this a node is as good as fixed.
const FIRMEST: f64 = 1e6;

/// A node and how firmly it stays where it is, in points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Held {
    pub(crate) position: DVec3,
    pub(crate) hold: f64,
    /// How far it may go at the most: the radius of its thickest beam.
    pub(crate) reach: f64,
}

/// Its nodes, and the points its axis should pass through.
#[derive(Debug, Clone)]
pub(crate) struct Line {
    pub(crate) ends: [usize; 2],
    pub(crate) points: Vec<DVec3>,
}

/// The best positions of the nodes that are no farther than their reach from where they were. Axes that are nearly parallel meet
/// anywhere along themselves, also outside of the part; the material of a joint is where the skeleton has it. Nodes that went
/// too far are held ten times as firmly until none does.
pub(crate) fn nodes_within_reach(mut held: Vec<Held>, lines: &[Line]) -> Vec<DVec3> {
    loop {
        let found = nodes(&held, lines);
        let mut firmer = false;
        for (node, at) in held.iter_mut().zip(&found) {
            if at.distance(node.position) > node.reach && node.hold < FIRMEST {
                node.hold *= 10.0;
                firmer = true;
            }
        }
        if !firmer {
            return found;
        }
    }
}

/// The best positions of the nodes.
fn nodes(held: &[Held], lines: &[Line]) -> Vec<DVec3> {
    let mut nodes: Vec<DVec3> = held.iter().map(|h| h.position).collect();
    for _ in 0..ROUNDS {
        // Per point: the projection across the axis and the place along it.
        let terms: Vec<(usize, usize, DMat3, f64, DVec3)> = (lines.iter())
            .flat_map(|line| {
                let [a, b] = line.ends;
                let along = nodes[b] - nodes[a];
                let direction = along.normalize_or_zero();
                let outer = DMat3::from_cols(
                    direction * direction.x,
                    direction * direction.y,
                    direction * direction.z,
                );
                let (start, length) = (nodes[a], along.length_squared().max(f64::MIN_POSITIVE));
                line.points.iter().map(move |&p| {
                    let t = ((p - start).dot(along) / length).clamp(0.0, 1.0);
                    (a, b, DMat3::IDENTITY - outer, t, p)
                })
            })
            .collect();
        let apply = |x: &[DVec3]| {
            let mut y: Vec<DVec3> = x.iter().zip(held).map(|(x, h)| h.hold * *x).collect();
            for &(a, b, across, t, _) in &terms {
                let r = across * ((1.0 - t) * x[a] + t * x[b]);
                y[a] += (1.0 - t) * r;
                y[b] += t * r;
            }
            y
        };
        // In steps from where the nodes are, so that the size of coordinates costs no digits.
        let mut right: Vec<DVec3> = nodes.iter().zip(held).map(|(x, h)| h.hold * (h.position - *x)).collect();
        for &(a, b, across, t, p) in &terms {
            let r = across * (p - (1.0 - t) * nodes[a] - t * nodes[b]);
            right[a] += (1.0 - t) * r;
            right[b] += t * r;
        }
        let step = conjugate_gradients(apply, right);
        nodes.iter_mut().zip(step).for_each(|(x, s)| *x += s);
    }
    nodes
}

fn conjugate_gradients(apply: impl Fn(&[DVec3]) -> Vec<DVec3>, right: Vec<DVec3>) -> Vec<DVec3> {
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let mut x = vec![DVec3::ZERO; right.len()];
    let mut residual = right;
    let mut direction = residual.clone();
    let mut size = dot(&residual, &residual);
    let enough = 1e-24 * size;
    for _ in 0..6 * x.len() + 20 {
        if size <= enough {
            break;
        }
        let image = apply(&direction);
        let curvature = dot(&direction, &image);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let step = size / curvature;
        for k in 0..x.len() {
            x[k] += step * direction[k];
            residual[k] -= step * image[k];
        }
        let next = dot(&residual, &residual);
        let ratio = next / size;
        size = next;
        for k in 0..x.len() {
            direction[k] = residual[k] + ratio * direction[k];
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_noisy_axes_find_their_common_node() {
        let truth = [
            DVec3::ZERO,
            DVec3::new(30.0, 1.0, 2.0),
            DVec3::new(-10.0, 25.0, 4.0),
            DVec3::new(3.0, -8.0, 28.0),
        ];
        let mut seed = 7u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((seed >> 33) as f64 / (1u64 << 31) as f64 - 0.5) * 0.02
        };
        let lines: Vec<_> = (1..4)
            .map(|k| Line {
                ends: [0, k],
                points: (3..18)
                    .map(|i| truth[k] * f64::from(i) / 20.0 + DVec3::new(noise(), noise(), noise()))
                    .collect(),
            })
            .collect();
        let held: Vec<_> = truth
            .iter()
            .enumerate()
            .map(|(k, &p)| Held {
                position: p + if k == 0 { DVec3::new(1.0, -0.7, 0.4) } else { DVec3::ZERO },
                hold: 1e-3,
                reach: f64::INFINITY,
            })
            .collect();
        let found = nodes(&held, &lines);
        assert!(found[0].length() < 0.02, "{}", found[0]);
        // Ends keep their distance and turn with the axis.
        for k in 1..4 {
            assert!(found[k].distance(truth[k]) < 0.05);
        }
    }

    /// Two axes at an angle of 2 degrees: a little noise moves their meeting point by far more than they are thick.
    #[test]
    fn a_joint_of_nearly_parallel_axes_stays_where_the_material_is() {
        let line = |side: f64, ends| Line {
            ends,
            points: (1..20)
                .map(|k| DVec3::new(f64::from(k), side * (0.2 + 0.018 * f64::from(k)), 0.0))
                .collect(),
        };
        let held = |x, y, hold| Held { position: DVec3::new(x, y, 0.0), hold, reach: 1.5 };
        let start = vec![held(0.0, 0.0, 1e-3), held(20.0, 0.56, 1e-3), held(20.0, -0.56, 1e-3)];
        let lines = [line(1.0, [0, 1]), line(-1.0, [0, 2])];
        assert!(nodes(&start, &lines)[0].x < -5.0);
        let found = nodes_within_reach(start, &lines);
        assert!(found[0].length() <= 1.5, "{}", found[0]);
        // The rest of the axes is hardly moved by that.
        assert!(found[1].distance(DVec3::new(20.0, 0.56, 0.0)) < 0.15, "{}", found[1]);
    }
}
