//! Colours for tiles, and for numbers.

use crate::Color;
use std::collections::BTreeSet;
use topipe_mesh::TriangleMesh;

/// Twelve light colours of similar weight: twelve hues, alternating in lightness, so that they differ in print too.
fn tile_colors() -> [Color; 12] {
    std::array::from_fn(|k| {
        // Five steps of 30 degrees at a time visit all twelve hues and keep consecutive colours far apart.
        let hue = (k * 150 % 360) as f64 + 15.0;
        Color::from_oklch([0.85, 0.77, 0.90][k % 3], [0.08, 0.10, 0.06][k % 3], hue)
    })
}

/// One colour per id, such that ids that touch across an edge of `mesh` differ wherever twelve colours suffice.
///
/// `id_of_face` holds one id per face; the result has one more entry than the largest of them. `u32::MAX` stands
/// for "none". Greedy: each id takes the colour, of those not seen at its neighbours, that was used least so far.
pub fn categorical(mesh: &TriangleMesh, id_of_face: &[u32]) -> Vec<Color> {
    let colors = tile_colors();
    let count = id_of_face.iter().filter(|&&id| id != u32::MAX).max().map_or(0, |&id| id as usize + 1);
    // Sides by their lower vertex: few for each, which are sorted in no time.
    let vertices = mesh.triangles.iter().flatten().map(|v| v.index() + 1).max().unwrap_or(0);
    let mut first = vec![0usize; vertices + 1];
    let sides = || {
        mesh.triangles.iter().zip(id_of_face).flat_map(|(triangle, &id)| {
            (0..3).map(move |k| {
                let (a, b) = (triangle[k].0, triangle[(k + 1) % 3].0);
                (a.min(b) as usize, (a.max(b), id))
            })
        })
    };
    sides().for_each(|(low, _)| first[low + 1] += 1);
    (1..first.len()).for_each(|v| first[v] += first[v - 1]);
    let mut at_vertex = vec![(0, 0); first[vertices]];
    let mut next = first.clone();
    for (low, side) in sides() {
        at_vertex[next[low]] = side;
        next[low] += 1;
    }
    let mut neighbors = vec![BTreeSet::new(); count];
    for ends in first.windows(2) {
        let around = &mut at_vertex[ends[0]..ends[1]];
        around.sort_unstable();
        for pair in around.windows(2) {
            let (a, b) = (pair[0].1, pair[1].1);
            if pair[0].0 == pair[1].0 && a != b && a != u32::MAX && b != u32::MAX {
                neighbors[a as usize].insert(b as usize);
                neighbors[b as usize].insert(a as usize);
            }
        }
    }
    let mut chosen = vec![usize::MAX; count];
    let mut used = [0usize; 12];
    for id in 0..count {
        let taken: BTreeSet<usize> = neighbors[id].iter().map(|&n| chosen[n]).collect();
        let free = (0..colors.len()).filter(|c| !taken.contains(c)).min_by_key(|&c| used[c]);
        let color = free.unwrap_or(id % colors.len());
        chosen[id] = color;
        used[color] += 1;
    }
    chosen.into_iter().map(|c| colors[c]).collect()
}

/// The colours of the faces of `mesh` by [`categorical`]; faces without an id are grey.
pub fn categorical_faces(mesh: &TriangleMesh, id_of_face: &[u32]) -> Vec<Color> {
    let colors = categorical(mesh, id_of_face);
    id_of_face.iter().map(|&id| colors.get(id as usize).copied().unwrap_or(Color([190, 190, 190]))).collect()
}

/// A colour for a number from 0 to 1: from dark violet over blue and green to light yellow, with a lightness that
/// rises evenly, so that the order is seen without a legend and in black and white. Not a number: grey.
pub fn sequential(t: f64) -> Color {
    if t.is_nan() {
        return Color([160, 160, 160]);
    }
    let t = t.clamp(0.0, 1.0);
    // The hue turns faster at the light end, where the eye sees the steps between green and yellow less.
    let hue = 305.0 - 195.0 * (0.75 * t + 0.25 * t * t);
    let chroma = 0.10 + 0.16 * t * (1.0 - t) + 0.06 * t;
    Color::from_oklch(0.38 + 0.55 * t, chroma, hue)
}

/// A colour for a number from -1 to 1: blue below zero, light grey at zero, orange above, both ends equally dark. Blue
/// and orange are told apart by people who see red and green alike. Not a number: grey.
pub fn diverging(t: f64) -> Color {
    if t.is_nan() {
        return Color([160, 160, 160]);
    }
    let t = t.clamp(-1.0, 1.0);
    let hue = if t < 0.0 { 255.0 } else { 55.0 };
    let strength = t.abs();
    Color::from_oklch(0.95 - 0.45 * strength, 0.15 * strength.powf(0.8), hue)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_that_touch_differ() {
        // A strip of quads of two triangles each, every quad a tile of its own.
        let n = 40u32;
        let positions = (0..=n).flat_map(|i| [[f64::from(i), 0.0, 0.0], [f64::from(i), 1.0, 0.0]]).collect();
        let triangles =
            (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]).collect();
        let mesh = TriangleMesh::from_arrays(positions, triangles);
        let ids: Vec<u32> = (0..n).flat_map(|i| [i, i]).collect();
        let colors = categorical(&mesh, &ids);
        assert_eq!(colors.len(), n as usize);
        assert!(colors.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(colors.iter().map(|c| c.0).collect::<BTreeSet<_>>().len() == 12, "all colours are used");
    }

    #[test]
    fn sequential_rises_in_lightness() {
        let luminance = |t: f64| {
            let [r, g, b] = sequential(t).to_linear();
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for k in 0..32 {
            assert!(luminance(f64::from(k) / 32.0) < luminance(f64::from(k + 1) / 32.0), "at {k}");
        }
        assert_eq!(sequential(-1.0), sequential(0.0));
        assert_eq!(sequential(2.0), sequential(1.0));
    }

    /// Lightness and two opponent colours (CIELAB, D65) of a colour as people without one kind of cone see it.
    fn seen(color: Color, eye: [[f64; 3]; 3]) -> [f64; 3] {
        let apply =
            |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
        let linear = apply(eye, color.to_linear().map(f64::from)).map(|c| c.clamp(0.0, 1.0));
        let to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let xyz = apply(to_xyz, linear);
        let f = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let [x, y, z] = [f(xyz[0] / 0.9505), f(xyz[1]), f(xyz[2] / 1.089)];
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Machado, Oliveira, Fernandes 2009, full severity, in linear light.
    const EYES: [(&str, [[f64; 3]; 3]); 4] = [
        ("normal", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("protanopia", [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]]),
        ("deuteranopia", [[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]]),
        ("tritanopia", [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]]),
    ];

    #[test]
    fn numbers_are_read_without_one_kind_of_cone() {
        let distance =
            |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        for (eye, matrix) in EYES {
            let lightness: Vec<f64> =
                (0..=20).map(|k| seen(sequential(f64::from(k) / 20.0), matrix)[0]).collect();
            assert!(lightness.windows(2).all(|w| w[1] > w[0] + 0.5), "{eye}: {lightness:?}");
            assert!(lightness[20] - lightness[0] > 45.0, "{eye}: {lightness:?}");
            for k in 4..=20 {
                let t = f64::from(k) / 20.0;
                let apart = distance(seen(diverging(t), matrix), seen(diverging(-t), matrix));
                // Some 2.3 are just noticed.
                assert!(apart > 12.0, "{eye}: signs of {t} are {apart} apart");
            }
        }
    }

    #[test]
    fn diverging_is_lightest_at_zero_and_even_to_both_sides() {
        let luminance = |t: f64| {
            let [r, g, b] = diverging(t).to_linear();
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for k in 0..16 {
            let (near, far) = (f64::from(k) / 16.0, f64::from(k + 1) / 16.0);
            assert!(luminance(near) > luminance(far) && luminance(-near) > luminance(-far), "at {near}");
        }
        assert!((luminance(1.0) - luminance(-1.0)).abs() < 0.1);
        assert_eq!(diverging(f64::NAN), Color([160, 160, 160]));
    }
}
