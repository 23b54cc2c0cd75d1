//! A voxel model: cells with moduli, nodes that are held, forces on nodes.

use crate::error::{number, point};
use crate::moments::Cuts;
use crate::solver::bedding::Bedding;
use crate::solver::coarse::Particular;
use crate::solver::cut::CutCells;
use crate::solver::multigrid::Hierarchy;
use crate::surface::{Attachment, SurfacePoint};
use crate::{FemError, Grid, Hexahedron, Lattice, fractions, rigid};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::TriangleMesh;

/// Cells with less material than this are left out. They would hold on to little and make the equations harder; the volume
/// they have is below 0.1 % of a part of some cells' thickness.
const LEAST_FRACTION: f32 = 0.02;

/// Where cells count as softer material, a support or a load acts on a cell only if that has so much; else on the next one
/// inwards.
const FIRM: f32 = 0.4;

/// Stiffness of the bedding by which a surface between grid planes is held, in moduli per cell. It gives way like a layer of a
/// fiftieth of a cell; much stiffer, the displacements of a cell that a curved surface passes through could hardly change across
/// it. Errors of the compliance of a ring held at its bore, 4 and 8 cells to the radius (`tests/elasticity.rs`), pressed: with 10,
/// 2.2 and 1.3 %; 20, 0.9 and 0.7 %; 30, 0.5 and 0.5 %; 50, 0.1 and 0.3 %; 100, -0.2 and 0.1 %; sheared along its axis: 1.0 and
/// 0.6 %; 0.2 and 0.2 %; 0.0 and 0.1 %; -0.3 and 0.0 %; -0.5 and -0.2 %.
const BEDDING: f64 = 50.0;

/// A node in a plane support is fixed if so much of its share of the surface is held. An edge of the support that passes
/// midway between two nodes covers a quarter of the share of the outer one.
const COVERED: f64 = 0.25;

/// Most cells of a grid, filled or not: half a gigabyte for their fractions.
const MOST_CELLS: u64 = 1 << 27;

/// A grid with the share of material in each cell.
#[derive(Debug, Clone)]
pub struct Body {
    /// The grid.
    pub grid: Grid,
    /// From 0 to 1, by the number of the cell in the grid.
    pub fraction: Vec<f32>,
    /// Where the material is in cells that are filled in part. A cell that is not among them counts as one of softer material.
    pub cuts: Cuts,
}

impl Body {
    /// What a closed mesh fills of a grid. Its faces must look outwards.
    pub fn new(mesh: &TriangleMesh, grid: Grid) -> Self {
        let fraction = fractions(mesh, &grid);
        Self { cuts: Cuts::new(mesh, &grid, &fraction), fraction, grid }
    }

    /// Volume of the material, mm^3.
    pub fn volume(&self) -> f64 {
        self.fraction.iter().map(|&f| f64::from(f)).sum::<f64>() * self.grid.size.powi(3)
    }
}

/// Checks that a grid can be held in memory.
pub fn check_size(low: DVec3, high: DVec3, size: f64) -> Result<(), FemError> {
    let cells: f64 = ((high - low) / size + 2.0).to_array().iter().product();
    if cells.is_finite() && cells <= MOST_CELLS as f64 {
        Ok(())
    } else {
        Err(FemError::TooFine { size: number(size), cells: format!("{cells:.0}"), most: MOST_CELLS })
    }
}

/// Everything about the equations but the moduli.
#[derive(Debug, Clone)]
pub struct Model {
    /// Where the cells are.
    pub grid: Grid,
    /// The cells that take part, and their nodes.
    pub lattice: Lattice,
    /// Share of material in each of these cells.
    pub fraction: Vec<f64>,
    /// Cells that were left out because nothing holds them, and nothing loads them.
    pub islands: usize,
    /// Young's modulus, MPa.
    pub young: f64,
    pub(crate) element: Hexahedron,
    pub(crate) cuts: CutCells,
    pub(crate) hierarchy: Hierarchy,
    /// Unknowns that are fixed, sorted.
    pub(crate) fixed: Vec<u32>,
    /// Cells whose surface is held between the planes of the grid.
    pub(crate) beddings: Vec<Bedding>,
    pub(crate) particular: Particular,
    /// Forces on the unknowns, N, one vector per load case.
    pub(crate) forces: Vec<Vec<f64>>,
}

impl Model {
    /// Sets up the equations, and checks that they have a solution.
    pub fn new(body: &Body, attachment: &Attachment, young: f64, poisson: f64) -> Result<Self, FemError> {
        let grid = body.grid;
        let mut active: Vec<bool> = body.fraction.iter().map(|&f| f >= LEAST_FRACTION).collect();
        let pieces = pieces(&grid, &active);
        if pieces.count == 0 {
            return Err(FemError::Empty { size: number(grid.size) });
        }
        let place = |points: &[SurfacePoint]| -> Vec<Option<Attached>> {
            points.iter().map(|p| attach(body, p)).collect()
        };
        let supports: Vec<_> = attachment.supports.iter().map(|(points, d)| (place(points), *d)).collect();
        let loads: Vec<_> = attachment.loads.iter().map(|(points, ..)| place(points)).collect();

        // Which rigid motions are left to each piece?
        let mut held = vec![rigid::Constraints::default(); pieces.count];
        let middle = pieces.middles(&grid);
        for (points, directions) in &supports {
            for at in points.iter().flatten() {
                let piece = pieces.of[grid.index(at.cell)] as usize;
                for (d, _) in directions.iter().enumerate().filter(|(_, held)| **held) {
                    held[piece].add((at.point - middle[piece].0) / middle[piece].1, d);
                }
            }
        }
        let mut kept = vec![false; pieces.count];
        for (piece, constraints) in held.iter().enumerate() {
            kept[piece] = constraints.free_motion().is_none();
        }
        for (k, points) in loads.iter().enumerate() {
            for at in points.iter().flatten() {
                let piece = pieces.of[grid.index(at.cell)] as usize;
                if kept[piece] {
                    continue;
                }
                return Err(if held[piece].is_empty() {
                    FemError::Disconnected {
                        what: format!("load {}", k + 1),
                        at: point(middle[piece].0),
                        size: number(grid.size),
                    }
                } else {
                    FemError::Loose {
                        motion: held[piece]
                            .free_motion()
                            .map_or_else(String::new, |m| m.describe(middle[piece].0)),
                    }
                });
            }
        }
        let mut islands = 0;
        for (cell, active) in active.iter_mut().enumerate() {
            if *active && !kept[pieces.of[cell] as usize] {
                *active = false;
                islands += 1;
            }
        }
        let lattice = Lattice::new(grid.cells, &active);
        let fraction =
            lattice.cell_places().map(|place| f64::from(body.fraction[grid.index(place)])).collect();
        let cuts = CutCells::new(&lattice, &body.cuts, |place| grid.index(place), poisson);
        let mut model = Self {
            hierarchy: Hierarchy::new(&lattice),
            grid,
            lattice,
            fraction,
            islands,
            young,
            element: Hexahedron::new(poisson),
            cuts,
            fixed: Vec::new(),
            beddings: Vec::new(),
            particular: Particular::default(),
            forces: Vec::new(),
        };
        model.hold(&supports, attachment);
        model.load(&loads, attachment);
        Ok(model)
    }

    /// Fixes the nodes of supports in planes of the grid, and puts the cells of all others on a bedding.
    fn hold(&mut self, supports: &[(Vec<Option<Attached>>, [bool; 3])], attachment: &Attachment) {
        let n = self.lattice.node_count as u32;
        // By unknown, of supports in planes: area that is held and area that there is.
        let mut planes: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        // Unknowns of the four corners of each face that is held, if only in part.
        let mut faces: Vec<[u32; 4]> = Vec::new();
        let mut beddings: BTreeMap<u32, Bedding> = BTreeMap::new();
        for ((points, directions), (surface, _)) in supports.iter().zip(&attachment.supports) {
            let held = || (0..3).filter(|&d| directions[d]);
            let mut seen = BTreeSet::new();
            for (at, surface) in points.iter().zip(surface) {
                let Some((at, corners)) = at.as_ref().and_then(|a| Some((a, self.lattice.corners(a.cell)?)))
                else {
                    continue;
                };
                let Some(cell) = self.lattice.cell(at.cell) else { continue };
                let weights = at.weights();
                if let Some(axis) = at.plane {
                    let first = seen.insert((cell, axis));
                    let side = usize::from(at.local[axis] > 0.5);
                    let whole = 0.25 * self.fraction[cell as usize] * self.grid.size * self.grid.size;
                    for d in held() {
                        let mut face = [0; 4];
                        for (k, corner) in (0..8).filter(|c| c >> axis & 1 == side).enumerate() {
                            face[k] = d as u32 * n + corners[corner];
                            let [covered, there] = planes.entry(face[k]).or_default();
                            *covered += weights[corner] * surface.area;
                            *there += if first { whole } else { 0.0 };
                        }
                        faces.extend(first.then_some(face));
                    }
                } else {
                    let none = || Bedding { nodes: corners, stiffness: [[0.0; 64]; 3] };
                    let bedding = beddings.entry(cell).or_insert_with(none);
                    let stiffness = BEDDING * self.young / self.grid.size * surface.area;
                    for d in held() {
                        for (k, to) in bedding.stiffness[d].iter_mut().enumerate() {
                            *to += stiffness * weights[k / 8] * weights[k % 8];
                        }
                    }
                }
            }
        }
        let is_covered = |unknown: &u32| planes.get(unknown).is_some_and(|[c, there]| *c >= COVERED * there);
        let mut fixed: Vec<u32> = planes.keys().copied().filter(is_covered).collect();
        // A support narrower than the cells covers no node; it holds the one nearest to it.
        for face in faces.iter().filter(|face| !face.iter().any(is_covered)) {
            let cover = |unknown: &u32| planes.get(unknown).map_or(0.0, |p| p[0]);
            fixed.extend(face.iter().copied().max_by(|a, b| cover(a).total_cmp(&cover(b)).then(b.cmp(a))));
        }
        fixed.sort_unstable();
        fixed.dedup();
        self.fixed = fixed;
        for (cell, place) in self.lattice.cell_places().enumerate() {
            let Some(corners) = self.lattice.corners(place) else { continue };
            for (corner, node) in corners.into_iter().enumerate() {
                for d in 0..3 {
                    if self.fixed.binary_search(&(d as u32 * n + node)).is_ok() {
                        self.particular.cells.entry(cell as u32).or_default().fixed.push(8 * d + corner);
                    }
                }
            }
        }
        for (cell, bedding) in beddings {
            self.particular.cells.entry(cell).or_default().bedding = Some(self.beddings.len());
            self.beddings.push(bedding);
        }
    }

    fn load(&mut self, loads: &[Vec<Option<Attached>>], attachment: &Attachment) {
        let n = self.lattice.node_count;
        self.forces = vec![vec![0.0; 3 * n]; attachment.cases];
        for (points, (_, forces, case)) in loads.iter().zip(&attachment.loads) {
            for (at, force) in points.iter().zip(forces) {
                let Some((at, corners)) = at.as_ref().and_then(|a| Some((a, self.lattice.corners(a.cell)?)))
                else {
                    continue;
                };
                for (corner, weight) in at.weights().into_iter().enumerate() {
                    for d in 0..3 {
                        self.forces[*case][d * n + corners[corner] as usize] += weight * force[d];
                    }
                }
            }
        }
        for forces in &mut self.forces {
            self.fixed.iter().for_each(|&i| forces[i as usize] = 0.0);
        }
    }

    /// Factor of the stiffness of each cell for the modulus of its material over that of the model.
    pub(crate) fn scale(&self, modulus: impl Fn(usize) -> f64) -> Vec<f64> {
        let of = |cell: usize| self.young * self.grid.size * modulus(cell);
        let mut scale: Vec<f64> =
            (0..self.lattice.cell_count).map(|cell| self.fraction[cell] * of(cell)).collect();
        self.cuts.cells.iter().for_each(|&cell| scale[cell as usize] = of(cell as usize));
        scale
    }

    /// The nodes of a cell.
    pub fn corners(&self, place: [usize; 3]) -> Option<[u32; 8]> {
        self.lattice.corners(place)
    }
}

/// A point of the surface in the cell that it acts on.
#[derive(Debug, Clone)]
struct Attached {
    cell: [usize; 3],
    /// In the cell, 0 to 1.
    local: DVec3,
    /// The axis across which the surface lies in a plane of the grid.
    plane: Option<usize>,
    point: DVec3,
}

impl Attached {
    /// Shape functions of the eight nodes.
    fn weights(&self) -> [f64; 8] {
        std::array::from_fn(|n| {
            (0..3).map(|d| if n >> d & 1 == 1 { self.local[d] } else { 1.0 - self.local[d] }).product()
        })
    }
}

/// Finds the cell: the first one inwards with enough material, else the best one within a cell's length.
fn attach(body: &Body, surface: &SurfacePoint) -> Option<Attached> {
    let grid = &body.grid;
    // Where the material is in a cell is known or not.
    let firm = if body.cuts.cells.is_empty() { FIRM } else { LEAST_FRACTION };
    let mut best: Option<(f32, [usize; 3])> = None;
    for depth in [0.01, 0.25, 0.5, 0.75, 1.0] {
        let Some(cell) = grid.cell_at(surface.point - surface.normal * (depth * grid.size)) else { continue };
        let fraction = body.fraction[grid.index(cell)];
        if fraction >= LEAST_FRACTION && best.is_none_or(|(f, _)| fraction > f) {
            best = Some((fraction, cell));
        }
        if fraction >= firm {
            break;
        }
    }
    let (_, cell) = best?;
    let at = grid.coordinates(surface.point);
    let local = at - DVec3::new(cell[0] as f64, cell[1] as f64, cell[2] as f64);
    let axis = (0..3).max_by(|&a, &b| surface.normal[a].abs().total_cmp(&surface.normal[b].abs()))?;
    let on_plane = surface.normal[axis].abs() > 1.0 - 1e-6 && (at[axis] - at[axis].round()).abs() < 1e-4;
    let mut local = local.clamp(DVec3::ZERO, DVec3::ONE);
    if on_plane {
        local[axis] = local[axis].round();
    }
    Some(Attached { cell, local, plane: on_plane.then_some(axis), point: surface.point })
}

/// Cells joined through faces.
struct Pieces {
    of: Vec<u32>,
    count: usize,
}

fn pieces(grid: &Grid, active: &[bool]) -> Pieces {
    let [nx, ny, nz] = grid.cells;
    let mut of = vec![u32::MAX; active.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for start in 0..active.len() {
        if !active[start] || of[start] != u32::MAX {
            continue;
        }
        of[start] = count;
        stack.push(start);
        while let Some(cell) = stack.pop() {
            let [x, y, z] = grid.place(cell);
            let around = [
                (x > 0, cell.wrapping_sub(1)),
                (x + 1 < nx, cell + 1),
                (y > 0, cell.wrapping_sub(nx)),
                (y + 1 < ny, cell + nx),
                (z > 0, cell.wrapping_sub(nx * ny)),
                (z + 1 < nz, cell + nx * ny),
            ];
            for (_, next) in around.into_iter().filter(|(inside, _)| *inside) {
                if active[next] && of[next] == u32::MAX {
                    of[next] = count;
                    stack.push(next);
                }
            }
        }
        count += 1;
    }
    Pieces { of, count: count as usize }
}

impl Pieces {
    /// Middle of each piece's bounding box, and half of its longest side, mm.
    fn middles(&self, grid: &Grid) -> Vec<(DVec3, f64)> {
        let mut boxes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); self.count];
        for (cell, &piece) in self.of.iter().enumerate().filter(|(_, p)| **p != u32::MAX) {
            let middle = grid.middle(grid.place(cell));
            let (low, high) = &mut boxes[piece as usize];
            (*low, *high) = (low.min(middle), high.max(middle));
        }
        let half = 0.5 * grid.size;
        boxes.into_iter().map(|(l, h)| (0.5 * (l + h), 0.5 * (h - l).max_element() + half)).collect()
    }
}
