//! The numbers that a pass adds: positions, or positions padded to a whole vector register.

use crate::kernel::in_chunks_mut;
use std::ops::{Add, Mul, Sub};
use topipe_mesh::DVec3;

/// Three coordinates. Whatever computes with it makes the same bits of each of them, whichever type it is.
pub(crate) trait Vector:
    Copy
    + Default
    + Send
    + Sync
    + PartialEq
    + From<DVec3>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<f64, Output = Self>
{
    /// The coordinates.
    fn coordinates(self) -> [f64; 3];
}

impl Vector for DVec3 {
    #[inline(always)]
    fn coordinates(self) -> [f64; 3] {
        self.to_array()
    }
}

/// A position padded to four numbers: a neighbour is one load and one addition of a register of 256 bits, where a processor has them.
/// The fourth number is 0.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Padded([f64; 4]);

impl Padded {
    /// Positions, padded.
    pub(crate) fn all(positions: &[DVec3]) -> Vec<Self> {
        convert(positions)
    }
}

/// The same values of the other kind.
pub(crate) fn convert<A: Copy + Sync, B: Clone + Default + From<A> + Send>(values: &[A]) -> Vec<B> {
    let mut converted = vec![B::default(); values.len()];
    in_chunks_mut(&mut converted, |base, chunk| {
        chunk.iter_mut().zip(&values[base..]).for_each(|(to, from)| *to = B::from(*from));
    });
    converted
}

impl Vector for Padded {
    #[inline(always)]
    fn coordinates(self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }
}

impl From<DVec3> for Padded {
    #[inline(always)]
    fn from(p: DVec3) -> Self {
        Self([p.x, p.y, p.z, 0.0])
    }
}

impl From<Padded> for DVec3 {
    #[inline(always)]
    fn from(p: Padded) -> Self {
        Self::new(p.0[0], p.0[1], p.0[2])
    }
}

impl Add for Padded {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let (Self([a, b, c, d]), Self([e, f, g, h])) = (self, other);
        Self([a + e, b + f, c + g, d + h])
    }
}

impl Sub for Padded {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let (Self([a, b, c, d]), Self([e, f, g, h])) = (self, other);
        Self([a - e, b - f, c - g, d - h])
    }
}

impl Mul<f64> for Padded {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        let Self([a, b, c, d]) = self;
        Self([a * factor, b * factor, c * factor, d * factor])
    }
}
