//! Cells and nodes that take part, numbered without gaps.
//!
//! A part fills a small share of its bounding box, an optimized one a few percent. Cells and nodes are numbered row by row
//! (x runs fastest, then y, then z) over those that exist; each row is a few runs without gaps. A run of cells touches four
//! rows of nodes, in each of which its nodes are consecutive too, so that loops along x read and write consecutive memory
//! and know no table of indices.

/// Consecutive cells along x.
#[derive(Debug, Clone, Copy)]
pub struct CellRun {
    /// Place of the first.
    pub at: [u32; 3],
    /// How many.
    pub count: u32,
    /// Number of the first.
    pub first: u32,
    /// Number of the node at the lower x end of the first cell in the four rows (y, z), (y+1, z), (y, z+1), (y+1, z+1).
    pub nodes: [u32; 4],
}

/// Consecutive nodes along x.
#[derive(Debug, Clone, Copy)]
pub struct NodeRun {
    /// Place of the first.
    pub at: [u32; 3],
    /// How many.
    pub count: u32,
    /// Number of the first.
    pub first: u32,
}

/// The active cells of a grid and their nodes.
#[derive(Debug, Clone)]
pub struct Lattice {
    /// Cells of the grid along each axis.
    pub cells: [usize; 3],
    /// Runs of cells in the order of their numbers.
    pub cell_runs: Vec<CellRun>,
    /// Runs of nodes in the order of their numbers.
    pub node_runs: Vec<NodeRun>,
    /// Where the runs of each row of cells begin: row `y + ny z`.
    cell_rows: Vec<u32>,
    /// Where the runs of each row of nodes begin: row `y + (ny + 1) z`.
    node_rows: Vec<u32>,
    /// Number of cells.
    pub cell_count: usize,
    /// Number of nodes.
    pub node_count: usize,
}

impl Lattice {
    /// The cells for which `active` holds, by their number in the grid.
    pub fn new(cells: [usize; 3], active: &[bool]) -> Self {
        let [nx, ny, nz] = cells;
        let mut cell_runs: Vec<CellRun> = Vec::new();
        let mut cell_rows = vec![0];
        let mut count = 0;
        for z in 0..nz {
            for y in 0..ny {
                let row = &active[nx * (y + ny * z)..][..nx];
                for (x, length) in runs(row) {
                    let at = [x as u32, y as u32, z as u32];
                    cell_runs.push(CellRun { at, count: length as u32, first: count, nodes: [0; 4] });
                    count += length as u32;
                }
                cell_rows.push(cell_runs.len() as u32);
            }
        }
        let mut node_runs = Vec::new();
        let mut node_rows = vec![0];
        let mut node_count = 0;
        let mut marks = vec![false; nx + 1];
        for z in 0..=nz {
            for y in 0..=ny {
                marks.fill(false);
                for (dy, dz) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    if y < dy || z < dz || y - dy >= ny || z - dz >= nz {
                        continue;
                    }
                    let row = y - dy + ny * (z - dz);
                    for run in &cell_runs[cell_rows[row] as usize..cell_rows[row + 1] as usize] {
                        marks[run.at[0] as usize..=(run.at[0] + run.count) as usize].fill(true);
                    }
                }
                for (x, length) in runs(&marks) {
                    let at = [x as u32, y as u32, z as u32];
                    node_runs.push(NodeRun { at, count: length as u32, first: node_count });
                    node_count += length as u32;
                }
                node_rows.push(node_runs.len() as u32);
            }
        }
        let mut lattice = Self {
            cells,
            cell_runs,
            node_runs,
            cell_rows,
            node_rows,
            cell_count: count as usize,
            node_count: node_count as usize,
        };
        for k in 0..lattice.cell_runs.len() {
            let [x, y, z] = lattice.cell_runs[k].at.map(|v| v as usize);
            lattice.cell_runs[k].nodes = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(dy, dz)| lattice.node([x, y + dy, z + dz]).unwrap_or_default());
        }
        lattice
    }

    /// The lattice of cells twice as large.
    pub fn coarser(&self) -> Self {
        let cells = self.cells.map(|n| n.div_ceil(2));
        let mut active = vec![false; cells.iter().product()];
        for run in &self.cell_runs {
            let [x, y, z] = run.at.map(|v| v as usize);
            let row = cells[0] * (y / 2 + cells[1] * (z / 2));
            active[row + x / 2..=row + (x + run.count as usize - 1) / 2].fill(true);
        }
        Self::new(cells, &active)
    }

    /// Number of the node at a place.
    pub fn node(&self, [x, y, z]: [usize; 3]) -> Option<u32> {
        let row = y + (self.cells[1] + 1) * z;
        let runs = &self.node_runs[self.node_rows[row] as usize..self.node_rows[row + 1] as usize];
        let k = runs.partition_point(|run| run.at[0] as usize <= x).checked_sub(1)?;
        let offset = x as u32 - runs[k].at[0];
        (offset < runs[k].count).then(|| runs[k].first + offset)
    }

    /// Number of the cell at a place.
    pub fn cell(&self, [x, y, z]: [usize; 3]) -> Option<u32> {
        if x >= self.cells[0] || y >= self.cells[1] || z >= self.cells[2] {
            return None;
        }
        let row = y + self.cells[1] * z;
        let runs = &self.cell_runs[self.cell_rows[row] as usize..self.cell_rows[row + 1] as usize];
        let k = runs.partition_point(|run| run.at[0] as usize <= x).checked_sub(1)?;
        let offset = x as u32 - runs[k].at[0];
        (offset < runs[k].count).then(|| runs[k].first + offset)
    }

    /// The eight nodes of the cell at a place, which must be active.
    pub fn corners(&self, [x, y, z]: [usize; 3]) -> Option<[u32; 8]> {
        let row = y + self.cells[1] * z;
        if x >= self.cells[0] || y >= self.cells[1] || z >= self.cells[2] {
            return None;
        }
        let runs = &self.cell_runs[self.cell_rows[row] as usize..self.cell_rows[row + 1] as usize];
        let k = runs.partition_point(|run| run.at[0] as usize <= x).checked_sub(1)?;
        let offset = x as u32 - runs[k].at[0];
        (offset < runs[k].count)
            .then(|| std::array::from_fn(|n| runs[k].nodes[n / 2] + offset + (n as u32 & 1)))
    }

    /// Runs of cells in layers `z0..z1`.
    pub(crate) fn layers(&self, z0: usize, z1: usize) -> &[CellRun] {
        let ny = self.cells[1];
        &self.cell_runs[self.cell_rows[ny * z0] as usize..self.cell_rows[ny * z1] as usize]
    }

    /// The runs of nodes in plane `z`.
    pub(crate) fn plane_runs(&self, z: usize) -> std::ops::Range<usize> {
        let rows = self.cells[1] + 1;
        self.node_rows[rows * z] as usize..self.node_rows[rows * (z + 1)] as usize
    }

    /// Number of the first node in plane `z`, which may be one past the last.
    pub(crate) fn plane_start(&self, z: usize) -> usize {
        let first = self.node_rows[(self.cells[1] + 1) * z] as usize;
        self.node_runs.get(first).map_or(self.node_count, |run| run.first as usize)
    }

    /// The places of all cells in the order of their numbers.
    pub fn cell_places(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.cell_runs.iter().flat_map(|run| {
            let [x, y, z] = run.at.map(|v| v as usize);
            (x..x + run.count as usize).map(move |x| [x, y, z])
        })
    }

    /// The places of all nodes in the order of their numbers.
    pub fn node_places(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.node_runs.iter().flat_map(|run| {
            let [x, y, z] = run.at.map(|v| v as usize);
            (x..x + run.count as usize).map(move |x| [x, y, z])
        })
    }
}

/// Start and length of each run of `true`.
fn runs(row: &[bool]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut x = 0;
    std::iter::from_fn(move || {
        x += row[x..].iter().position(|&on| on)?;
        let start = x;
        x += row[x..].iter().position(|&on| !on).unwrap_or(row.len() - x);
        Some((start, x - start))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_no_gaps_and_places_are_found_again() {
        let cells = [5, 3, 4];
        let active: Vec<bool> = (0..60).map(|k: usize| (k * k + k / 7) % 3 < 1).collect();
        let lattice = Lattice::new(cells, &active);
        assert_eq!(lattice.cell_count, active.iter().filter(|&&a| a).count());
        for (number, place) in lattice.cell_places().enumerate() {
            assert_eq!(lattice.cell(place), Some(number as u32));
            let corners = lattice.corners(place).unwrap();
            for (n, corner) in corners.into_iter().enumerate() {
                let at = std::array::from_fn(|d| place[d] + (n >> d & 1));
                assert_eq!(lattice.node(at), Some(corner));
            }
        }
        assert_eq!(lattice.node_places().count(), lattice.node_count);
        for (number, place) in lattice.node_places().enumerate() {
            assert_eq!(lattice.node(place), Some(number as u32));
        }
        let coarse = lattice.coarser();
        for [x, y, z] in lattice.cell_places() {
            assert!(coarse.cell([x / 2, y / 2, z / 2]).is_some());
        }
    }
}
