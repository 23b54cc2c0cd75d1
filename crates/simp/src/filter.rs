//! Filters: weighted means over the cells within a radius, with weights that fall linearly to zero.

use rayon::prelude::*;
use topipe_fem::Lattice;

/// Neighbours within a radius, for all cells of a lattice.
pub(crate) struct Filter {
    /// Where the neighbours of each cell begin.
    starts: Vec<u32>,
    cells: Vec<u32>,
    weights: Vec<f32>,
}

impl Filter {
    /// For a radius in cells. `allowed` says which cells take part.
    pub(crate) fn new(lattice: &Lattice, radius: f64, allowed: &[bool]) -> Self {
        let reach = radius.ceil() as i64;
        let mut offsets = Vec::new();
        for dz in -reach..=reach {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let weight = radius - ((dx * dx + dy * dy + dz * dz) as f64).sqrt();
                    if weight > 0.0 {
                        offsets.push(([dx, dy, dz], weight as f32));
                    }
                }
            }
        }
        let places: Vec<[usize; 3]> = lattice.cell_places().collect();
        let lists: Vec<Vec<(u32, f32)>> = places
            .par_iter()
            .map(|place| {
                let near = |(offset, weight): &([i64; 3], f32)| {
                    let at: [i64; 3] = std::array::from_fn(|d| place[d] as i64 + offset[d]);
                    if at.iter().any(|&x| x < 0) {
                        return None;
                    }
                    let cell = lattice.cell(at.map(|x| x as usize))?;
                    allowed[cell as usize].then_some((cell, *weight))
                };
                offsets.iter().filter_map(near).collect()
            })
            .collect();
        let mut filter = Self { starts: vec![0], cells: Vec::new(), weights: Vec::new() };
        for list in lists {
            for (cell, weight) in list {
                filter.cells.push(cell);
                filter.weights.push(weight);
            }
            filter.starts.push(filter.cells.len() as u32);
        }
        filter
    }

    /// Sum over the neighbours of each cell of `weight * value(cell, neighbour)`, and the sum of the weights times `mass`.
    pub(crate) fn sums(
        &self,
        value: impl Fn(usize) -> f64 + Sync,
        mass: impl Fn(usize) -> f64 + Sync,
    ) -> Vec<[f64; 2]> {
        (0..self.starts.len() - 1)
            .into_par_iter()
            .map(|cell| {
                let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
                let (mut sum, mut total) = (0.0, 0.0);
                for k in range {
                    let (weight, other) = (f64::from(self.weights[k]), self.cells[k] as usize);
                    sum += weight * value(other);
                    total += weight * mass(other);
                }
                [sum, total]
            })
            .collect()
    }
}
