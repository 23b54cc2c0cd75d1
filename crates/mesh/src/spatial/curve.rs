//! Points in an order in which neighbours are near each other.

use glam::DVec3;
use rayon::prelude::*;

/// The indices of points along a Morton curve, so that what is done for one after the other stays in one place for long. All
/// coordinates must be finite; points in one cell of two million to the longest side stay in order.
pub fn along_curve(points: &[DVec3]) -> Vec<u32> {
    let (low, high) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let scale = 2_097_151.0 / (high - low).max_element().max(f64::MIN_POSITIVE);
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(v, p)| {
            let q = (*p - low) * scale;
            (spread(q.x as u64) | spread(q.y as u64) << 1 | spread(q.z as u64) << 2, v as u32)
        })
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|k| k.1).collect()
}

/// Puts two zeros before each of the lowest 21 bits.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_three() {
        for k in 0..21 {
            assert_eq!(spread(1 << k), 1 << (3 * k));
        }
    }

    #[test]
    fn each_point_comes_once_and_octants_one_after_the_other() {
        let points: Vec<DVec3> = (0..512u32)
            .map(|k| {
                let k = k * 317 % 512;
                DVec3::new(f64::from(k % 8), f64::from(k / 8 % 8), f64::from(k / 64))
            })
            .collect();
        let order = along_curve(&points);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..512));
        let octant = |&k: &u32| points[k as usize].to_array().map(|x| x >= 4.0);
        assert_eq!(order.chunk_by(|a, b| octant(a) == octant(b)).count(), 8);
        assert!(along_curve(&[]).is_empty());
    }
}
