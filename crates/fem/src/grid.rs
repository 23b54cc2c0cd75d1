//! A regular grid of cubes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Where the cells are. Cell `(x, y, z)` has number `x + nx (y + ny z)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The lowest corner, mm.
    pub origin: DVec3,
    /// Length of the edges of a cell, mm.
    pub size: f64,
    /// Cells along each axis.
    pub cells: [usize; 3],
}

impl Grid {
    /// The grid of the given cell size that covers a box, its planes through the lowest corner. It reaches `margin` cells
    /// beyond the box on every side; a box that is a whole number of cells to rounding gets no further cell.
    pub fn around(low: DVec3, high: DVec3, size: f64, margin: usize) -> Self {
        let extent = (high - low) / size;
        let cells = extent.to_array().map(|e| ((e - 1e-6).ceil().max(1.0) as usize) + 2 * margin);
        Self { origin: low - DVec3::splat(size * margin as f64), size, cells }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Number of a cell.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.cells[0] * (y + self.cells[1] * z)
    }

    /// Place of a cell by its number.
    pub fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// Middle of a cell, mm.
    pub fn middle(&self, [x, y, z]: [usize; 3]) -> DVec3 {
        self.origin + (DVec3::new(x as f64, y as f64, z as f64) + 0.5) * self.size
    }

    /// A point in units of cells from the lowest corner.
    pub fn coordinates(&self, point: DVec3) -> DVec3 {
        (point - self.origin) / self.size
    }

    /// The cell that contains a point, if it lies in the grid.
    pub fn cell_at(&self, point: DVec3) -> Option<[usize; 3]> {
        let at = self.coordinates(point).floor().to_array();
        let inside = (0..3).all(|d| at[d] >= 0.0 && at[d] < self.cells[d] as f64);
        inside.then(|| at.map(|x| x as usize))
    }
}
