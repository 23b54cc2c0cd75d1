//! Numbering of the control points of a whole surface: one per vertex, then those inside each edge, then those
//! inside each patch. A control point that patches share has one number, so its value is the same bit for bit.

use topipe_quad_matching::QuadLayout;

/// The numbers of a surface's control points.
pub(crate) struct Unknowns<'a> {
    layout: &'a QuadLayout,
    /// Control points along a side.
    n: usize,
}

impl<'a> Unknowns<'a> {
    pub(crate) fn new(layout: &'a QuadLayout, n: usize) -> Self {
        Self { layout, n }
    }

    pub(crate) fn count(&self) -> usize {
        self.face(self.layout.quads.len(), 0, 0)
    }

    /// Number of the `m`-th control point of an edge, in its own direction; the ends belong to vertices.
    pub(crate) fn edge(&self, edge: usize, m: usize) -> usize {
        let ends = self.layout.edges.get(edge).map(|e| e.ends);
        match ends {
            Some([a, _]) if m == 0 => a as usize,
            Some([_, b]) if m == self.n - 1 => b as usize,
            _ => self.layout.vertices.len() + edge * (self.n - 2) + m - 1,
        }
    }

    fn face(&self, quad: usize, i: usize, j: usize) -> usize {
        let inner = self.n - 2;
        self.layout.vertices.len() + self.layout.edges.len() * inner + quad * inner * inner + j * inner + i
    }

    /// Number of control point (i, j) of a patch.
    pub(crate) fn patch(&self, quad: usize, i: usize, j: usize) -> usize {
        let last = self.n - 1;
        // The side it lies on, and how far along it.
        let (side, k) = if j == 0 {
            (0, i)
        } else if i == last {
            (1, j)
        } else if j == last {
            (2, last - i)
        } else if i == 0 {
            (3, last - j)
        } else {
            return self.face(quad, i - 1, j - 1);
        };
        let side = self.layout.quads[quad][side];
        self.edge(side.edge as usize, if side.reversed { last - k } else { k })
    }

    /// Numbers of all control points of a patch, u fastest.
    pub(crate) fn of_patch(&self, quad: usize) -> Vec<usize> {
        (0..self.n)
            .flat_map(|j| (0..self.n).map(move |i| (i, j)))
            .map(|(i, j)| self.patch(quad, i, j))
            .collect()
    }
}
