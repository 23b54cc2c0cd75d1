//! The element: a cube of isotropic material with eight nodes.
//!
//! Trilinear displacements with nine incompatible modes (1 - xi^2 and so on for each component; Wilson, Taylor, Doherty,
//! Ghaboussi 1973; on cubes they pass the patch test as they are), condensed out. They make pure bending exact, which
//! trilinear displacements alone make too stiff: by a third in a wall of two elements.
//!
//! Its stiffness is `E h K`, with one `K` for all cubes. In the basis of sums and differences along the axes (Walsh
//! functions: each is a product of 1 or xi, 1 or eta, 1 or zeta) the reflections of the cube split `K` into eight blocks
//! of 3 x 3, so that a product takes 144 additions and 72 multiplications instead of 576 of each.

/// Unknowns of a cell, whose nodes have numbers `x + 2 y + 4 z`: component `c` of node `n` is number `8 c + n`.
pub(crate) const UNKNOWNS: usize = 24;

/// The stiffness of a cube with Young's modulus 1 and edges of length 1.
#[derive(Debug, Clone)]
pub struct Hexahedron {
    /// By `UNKNOWNS`.
    pub stiffness: [[f64; UNKNOWNS]; UNKNOWNS],
    /// In the Walsh basis: block `p` joins component `c`, function `p ^ (1 << c)`, for the three `c`.
    pub(crate) blocks: [[f64; 9]; 8],
    /// Stress from strain, Young's modulus 1: xx, yy, zz, xy, yz, zx, shear strains as angles.
    pub elasticity: [[f64; 6]; 6],
}

impl Hexahedron {
    /// The element for a Poisson's ratio below 1/2.
    pub fn new(poisson: f64) -> Self {
        let elasticity = elasticity(poisson);
        // 24 displacements and 9 incompatible modes.
        const N: usize = UNKNOWNS + 9;
        let mut full = vec![[0.0; N]; N];
        let g = 1.0 / 3f64.sqrt();
        for q in 0..8 {
            let at: [f64; 3] = std::array::from_fn(|d| if q >> d & 1 == 1 { g } else { -g });
            let mut gradients = [[0.0; 3]; 11];
            for (n, gradient) in gradients.iter_mut().take(8).enumerate() {
                let sign: [f64; 3] = std::array::from_fn(|d| if n >> d & 1 == 1 { 1.0 } else { -1.0 });
                for d in 0..3 {
                    let mut product = 2.0 * sign[d] / 8.0;
                    for e in 0..3 {
                        if e != d {
                            product *= 1.0 + sign[e] * at[e];
                        }
                    }
                    gradient[d] = product;
                }
            }
            for d in 0..3 {
                gradients[8 + d][d] = -4.0 * at[d];
            }
            let mut strains = [[0.0; 6]; N];
            for (n, gradient) in gradients.iter().enumerate() {
                for c in 0..3 {
                    let at = if n < 8 { 8 * c + n } else { UNKNOWNS + 3 * c + (n - 8) };
                    strains[at] = strain_of(c, *gradient);
                }
            }
            for a in 0..N {
                let stress: [f64; 6] =
                    std::array::from_fn(|i| (0..6).map(|j| elasticity[i][j] * strains[a][j]).sum());
                for b in 0..N {
                    full[a][b] += (0..6).map(|i| stress[i] * strains[b][i]).sum::<f64>() / 8.0;
                }
            }
        }
        // Eliminates the incompatible modes, which are positive definite.
        for m in (UNKNOWNS..N).rev() {
            let row = full[m];
            for a in 0..m {
                let factor = full[a][m] / row[m];
                for b in 0..m {
                    full[a][b] -= factor * row[b];
                }
            }
        }
        let mut stiffness = [[0.0; UNKNOWNS]; UNKNOWNS];
        for a in 0..UNKNOWNS {
            for b in 0..UNKNOWNS {
                stiffness[a][b] = 0.5 * (full[a][b] + full[b][a]);
            }
        }
        Self { blocks: walsh_blocks(&stiffness), stiffness, elasticity }
    }

    /// The largest eigenvalue of the stiffness over its diagonal. As matrices are sums over elements, it bounds that of
    /// every assembled matrix, whatever the moduli of the elements.
    pub(crate) fn largest_eigenvalue(&self) -> f64 {
        let mut x: [f64; UNKNOWNS] = std::array::from_fn(|i| 1.0 + 0.37 * ((i * 7919) % 13) as f64);
        let mut value = 0.0;
        for _ in 0..200 {
            let mut y = [0.0; UNKNOWNS];
            for i in 0..UNKNOWNS {
                y[i] = (0..UNKNOWNS).map(|j| self.stiffness[i][j] * x[j]).sum::<f64>() / self.stiffness[i][i];
            }
            let weighted = |v: &[f64; UNKNOWNS]| {
                (0..UNKNOWNS).map(|i| v[i] * v[i] * self.stiffness[i][i]).sum::<f64>().sqrt()
            };
            value = weighted(&y) / weighted(&x);
            let scale = weighted(&y);
            x = y.map(|v| v / scale);
        }
        value
    }

    /// Strain in the middle of a cell with edges of length 1 (divide by the true length).
    pub fn middle_strain(&self, displacement: &[f64; UNKNOWNS]) -> [f64; 6] {
        let mut strain = [0.0; 6];
        for c in 0..3 {
            let mut gradient = [0.0; 3];
            for n in 0..8 {
                for (d, slope) in gradient.iter_mut().enumerate() {
                    let sign = if n >> d & 1 == 1 { 0.25 } else { -0.25 };
                    *slope += sign * displacement[8 * c + n];
                }
            }
            let part = strain_of(c, gradient);
            (0..6).for_each(|i| strain[i] += part[i]);
        }
        strain
    }

    /// Von Mises stress of a strain, Young's modulus 1.
    pub fn von_mises(&self, strain: &[f64; 6]) -> f64 {
        let s: [f64; 6] = std::array::from_fn(|i| (0..6).map(|j| self.elasticity[i][j] * strain[j]).sum());
        let normal = (s[0] - s[1]).powi(2) + (s[1] - s[2]).powi(2) + (s[2] - s[0]).powi(2);
        (0.5 * normal + 3.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5])).sqrt()
    }
}

/// Stress from strain for Young's modulus 1.
fn elasticity(poisson: f64) -> [[f64; 6]; 6] {
    let factor = 1.0 / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let shear = 0.5 / (1.0 + poisson);
    let mut d = [[0.0; 6]; 6];
    for i in 0..3 {
        for j in 0..3 {
            d[i][j] = factor * if i == j { 1.0 - poisson } else { poisson };
        }
        d[3 + i][3 + i] = shear;
    }
    d
}

/// The strain of a displacement along `c` with the given gradient.
fn strain_of(c: usize, g: [f64; 3]) -> [f64; 6] {
    match c {
        0 => [g[0], 0.0, 0.0, g[1], 0.0, g[2]],
        1 => [0.0, g[1], 0.0, g[0], g[2], 0.0],
        _ => [0.0, 0.0, g[2], 0.0, g[1], g[0]],
    }
}

/// Row `s` of the Walsh functions at node `n`: +1 or -1.
fn walsh(s: usize, n: usize) -> f64 {
    // A factor xi is -1 at the lower nodes.
    if (s & !n).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
}

fn walsh_blocks(stiffness: &[[f64; UNKNOWNS]; UNKNOWNS]) -> [[f64; 9]; 8] {
    let entry = |a: usize, s: usize, b: usize, t: usize| {
        let mut sum = 0.0;
        for m in 0..8 {
            for n in 0..8 {
                sum += walsh(s, m) * stiffness[8 * a + m][8 * b + n] * walsh(t, n);
            }
        }
        sum / 64.0
    };
    std::array::from_fn(|p| {
        std::array::from_fn(|k| {
            let (a, b) = (k / 3, k % 3);
            let value = entry(a, p ^ (1 << a), b, p ^ (1 << b));
            // Rigid motions have no energy: their rows are rounding and nothing else.
            if value.abs() < 1e-13 { 0.0 } else { value }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn energy(element: &Hexahedron, u: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
        let mut x = [0.0; UNKNOWNS];
        for n in 0..8 {
            let at = std::array::from_fn(|d| (n >> d & 1) as f64 - 0.5);
            let value = u(at);
            (0..3).for_each(|c| x[8 * c + n] = value[c]);
        }
        let k = &element.stiffness;
        (0..24).flat_map(|a| (0..24).map(move |b| (a, b))).map(|(a, b)| x[a] * k[a][b] * x[b]).sum::<f64>()
    }

    #[test]
    fn rigid_motions_have_no_energy_and_stretching_has_its_own() {
        let element = Hexahedron::new(0.3);
        for motion in [
            (|_| [1.0, -2.0, 0.5]) as fn([f64; 3]) -> [f64; 3],
            |[x, y, _]| [-y, x, 0.0],
            |[_, y, z]| [0.0, -z, y],
            |[x, _, z]| [z, 0.0, -x],
        ] {
            assert!(energy(&element, motion).abs() < 1e-13);
        }
        // Uniaxial stress: E e^2 V.
        let stretch = energy(&element, |[x, y, z]| [x, -0.3 * y, -0.3 * z]);
        assert!((stretch - 1.0).abs() < 1e-12, "{stretch}");
    }

    /// Pure bending of a cube: the curvature 1 takes E I = 1/12, once the free faces may bulge.
    #[test]
    fn bending_is_exact_without_lateral_contraction() {
        let element = Hexahedron::new(0.0);
        let bent = energy(&element, |[x, y, _]| [x * y, 0.0, 0.0]);
        assert!((bent - 1.0 / 12.0).abs() < 1e-12, "{bent}");
    }

    #[test]
    fn the_walsh_basis_has_nothing_outside_of_its_blocks() {
        let element = Hexahedron::new(0.28);
        let mut outside = 0.0f64;
        for a in 0..3 {
            for b in 0..3 {
                for s in 0..8 {
                    for t in 0..8 {
                        let mut sum = 0.0;
                        for m in 0..8 {
                            for n in 0..8 {
                                sum += walsh(s, m) * element.stiffness[8 * a + m][8 * b + n] * walsh(t, n);
                            }
                        }
                        if s ^ (1 << a) != t ^ (1 << b) {
                            outside = outside.max(sum.abs());
                        }
                    }
                }
            }
        }
        assert!(outside < 1e-12, "{outside}");
    }

    #[test]
    fn von_mises_of_uniaxial_and_shear_stress() {
        let element = Hexahedron::new(0.3);
        assert!((element.von_mises(&[1.0, -0.3, -0.3, 0.0, 0.0, 0.0]) - 1.0).abs() < 1e-12);
        let shear = element.von_mises(&[0.0, 0.0, 0.0, 0.0, 2.6, 0.0]);
        assert!((shear - 3f64.sqrt()).abs() < 1e-12);
    }
}
