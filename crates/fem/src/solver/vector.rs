//! Long vectors: every sum runs over fixed pieces, so that it does not depend on the number of threads.

use rayon::prelude::*;
use std::ops::{Add, AddAssign, Mul, Sub};

/// f64 outside, f32 in the preconditioner: that one is a guess anyway, and half the memory traffic.
pub(crate) trait Real:
    Copy
    + Send
    + Sync
    + Default
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + 'static
{
    fn of(value: f64) -> Self;
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
}

/// Numbers in one piece: 32 kB of f64, which the nearest cache holds.
pub(crate) const PIECE: usize = 4096;

/// Scalar product, in f64.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let piece = |(a, b): (&[f64], &[f64])| {
        let mut lanes = [0.0; 8];
        let (ac, at) = a.as_chunks::<8>();
        let (bc, bt) = b.as_chunks::<8>();
        for (x, y) in ac.iter().zip(bc) {
            for k in 0..8 {
                lanes[k] += x[k] * y[k];
            }
        }
        lanes.iter().sum::<f64>() + at.iter().zip(bt).map(|(x, y)| x * y).sum::<f64>()
    };
    let sums: Vec<f64> = a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).map(piece).collect();
    sums.iter().sum()
}

/// The same of f32 vectors.
pub(crate) fn dot32(a: &[f32], b: &[f32]) -> f64 {
    let piece =
        |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(x, y)| f64::from(*x) * f64::from(*y)).sum::<f64>();
    let sums: Vec<f64> = a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).map(piece).collect();
    sums.iter().sum()
}

/// `y += factor x`.
pub(crate) fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    y.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(|(y, x)| {
        y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
    });
}

/// `y = x + factor y`.
pub(crate) fn scale_and_add(y: &mut [f64], factor: f64, x: &[f64]) {
    y.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(|(y, x)| {
        y.iter_mut().zip(x).for_each(|(y, x)| *y = x + factor * *y);
    });
}
