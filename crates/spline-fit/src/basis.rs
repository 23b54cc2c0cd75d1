//! Univariate B-spline bases on [0, 1] (Piegl and Tiller, The NURBS Book, chapter 2).

use serde::{Deserialize, Serialize};

/// Highest degree that is supported; evaluation uses arrays of this size on the stack.
pub const MAX_DEGREE: usize = 7;

/// A clamped B-spline basis: degree and knot vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Basis {
    degree: u32,
    knots: Vec<f64>,
}

/// Values and first two derivatives of the `degree + 1` functions that are not zero at a parameter.
#[derive(Debug, Clone, Copy)]
pub struct Local {
    /// Index of the first of them.
    pub first: usize,
    /// Their number.
    pub count: usize,
    /// Values, first and second derivatives.
    pub derivatives: [[f64; MAX_DEGREE + 1]; 3],
}

impl Basis {
    /// A clamped basis of `degree` with the given interior knots, in [0, 1].
    ///
    /// `None` unless 1 <= degree <= [`MAX_DEGREE`], the interior knots increase weakly inside (0, 1), and none is
    /// repeated more than `degree` times (the curve stays continuous).
    pub fn clamped(degree: usize, interior: &[f64]) -> Option<Self> {
        let inside = interior.iter().all(|&k| k > 0.0 && k < 1.0);
        let ordered = interior.windows(2).all(|w| w[0] <= w[1]);
        let simple = interior.windows(degree + 1).all(|w| w[0] < w[degree]);
        if !(1..=MAX_DEGREE).contains(&degree) || !inside || !ordered || !simple {
            return None;
        }
        let mut knots = vec![0.0; degree + 1];
        knots.extend_from_slice(interior);
        knots.extend(std::iter::repeat_n(1.0, degree + 1));
        Some(Self { degree: degree as u32, knots })
    }

    /// A clamped basis with `spans` equal knot spans.
    pub fn uniform(degree: usize, spans: usize) -> Option<Self> {
        let interior: Vec<f64> = (1..spans).map(|k| k as f64 / spans as f64).collect();
        Self::clamped(degree, &interior)
    }

    /// The cubic basis with `spans` equal spans (at least one) and double interior knots: curves in it have a
    /// continuous first derivative, and each span can have any point and slope at its ends.
    pub fn double(spans: usize) -> Self {
        let inner: Vec<f64> = (1..spans).map(|k| k as f64 / spans as f64).collect();
        Self::with_double_knots(&inner)
    }

    /// The same with the given interior knots, ascending inside (0, 1).
    pub(crate) fn with_double_knots(inner: &[f64]) -> Self {
        let mut knots = vec![0.0; 4];
        knots.extend(inner.iter().flat_map(|&t| [t; 2]));
        knots.extend([1.0; 4]);
        Self { degree: 3, knots }
    }

    /// Polynomial degree.
    #[inline]
    pub fn degree(&self) -> usize {
        self.degree as usize
    }

    /// The knot vector, with the end knots repeated `degree + 1` times.
    #[inline]
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Number of basis functions.
    #[inline]
    pub fn len(&self) -> usize {
        self.knots.len() - self.degree() - 1
    }

    /// Never true; here because `len` is.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The distinct knots, 0 and 1 included: the ends of the polynomial pieces.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots.clone();
        breaks.dedup();
        breaks
    }

    /// The knot span that contains `t`: the last `k` with `knots[k] <= t < knots[k + 1]`, the last span at 1.
    #[inline]
    fn span(&self, t: f64) -> usize {
        let p = self.degree();
        let n = self.len();
        if t >= self.knots[n] {
            return n - 1;
        }
        (self.knots.partition_point(|&k| k <= t)).clamp(p + 1, n) - 1
    }

    /// Values and derivatives at `t`, which is clamped to [0, 1] (algorithm A2.3).
    pub fn evaluate(&self, t: f64) -> Local {
        // Cubics, which are nearly all there is, with loops of known length: a third of the time.
        match self.degree() {
            3 => self.evaluate_with::<4>(t),
            _ => self.evaluate_with::<{ MAX_DEGREE + 1 }>(t),
        }
    }

    /// `N` is the degree plus one, or more.
    #[inline]
    fn evaluate_with<const N: usize>(&self, t: f64) -> Local {
        let p = if N == MAX_DEGREE + 1 { self.degree() } else { N - 1 };
        let t = t.clamp(0.0, 1.0);
        let span = self.span(t);
        let knots = &self.knots;
        let (mut left, mut right) = ([0.0; N], [0.0; N]);
        // Upper triangle: basis functions of rising degree; lower: knot differences.
        let mut ndu = [[0.0; N]; N];
        ndu[0][0] = 1.0;
        for j in 1..=p {
            left[j] = t - knots[span + 1 - j];
            right[j] = knots[span + j] - t;
            let mut saved = 0.0;
            for r in 0..j {
                ndu[j][r] = right[r + 1] + left[j - r];
                let term = ndu[r][j - 1] / ndu[j][r];
                ndu[r][j] = saved + right[r + 1] * term;
                saved = left[j - r] * term;
            }
            ndu[j][j] = saved;
        }
        let mut derivatives = [[0.0; MAX_DEGREE + 1]; 3];
        for j in 0..=p {
            derivatives[0][j] = ndu[j][p];
        }
        for r in 0..=p {
            let mut a = [[0.0; N]; 2];
            let (mut s1, mut s2) = (0, 1);
            a[0][0] = 1.0;
            for k in 1..=2.min(p) {
                let mut d = 0.0;
                let pk = p - k;
                if r >= k {
                    a[s2][0] = a[s1][0] / ndu[pk + 1][r - k];
                    d = a[s2][0] * ndu[r - k][pk];
                }
                let j1 = if r + 1 >= k { 1 } else { k - r };
                let j2 = if r <= pk + 1 { k - 1 } else { p - r };
                for j in j1..=j2 {
                    a[s2][j] = (a[s1][j] - a[s1][j - 1]) / ndu[pk + 1][r + j - k];
                    d += a[s2][j] * ndu[r + j - k][pk];
                }
                if r <= pk {
                    a[s2][k] = -a[s1][k - 1] / ndu[pk + 1][r];
                    d += a[s2][k] * ndu[r][pk];
                }
                derivatives[k][r] = d;
                std::mem::swap(&mut s1, &mut s2);
            }
        }
        let mut factor = p as f64;
        for k in 1..=2.min(p) {
            for value in &mut derivatives[k][..=p] {
                *value *= factor;
            }
            factor *= (p - k) as f64;
        }
        Local { first: span - p, count: p + 1, derivatives }
    }
}
