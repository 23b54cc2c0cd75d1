//! The artifact: a graph of points with what is known about each.

use crate::Method;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a point of the skeleton stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PointKind {
    /// On the axis of a beam.
    Branch,
    /// Where beams meet, or in a piece between them that has no section of its own.
    Junction,
    /// The centre of a border between design and non-design.
    Interface,
    /// A free end, or where a branch could not be continued.
    End,
    /// Inside a non-design part; joins the interfaces of that part.
    NonDesign,
}

impl PointKind {
    /// The name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Branch => "branch",
            Self::Junction => "junction",
            Self::Interface => "interface",
            Self::End => "end",
            Self::NonDesign => "non-design",
        }
    }
}

/// What was measured around a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Section {
    /// Nothing: an extrapolated or joining point.
    None,
    /// The identifier box whose nodes the point is the mean of.
    Box {
        /// Lowest corner, mm.
        low: DVec3,
        /// Highest corner, mm.
        high: DVec3,
    },
    /// A plane section of the surface.
    Plane {
        /// Area, mm^2.
        area: f64,
        /// Unit normal: the tangent of the branch.
        normal: DVec3,
        /// Second moments about the area centroid along the principal axes, the larger first, mm^4.
        moments: [f64; 2],
        /// The principal axis of the larger moment: the bending axis in which the section is stiffest.
        axis: DVec3,
        /// Torsion constant of the section as a solid one, mm^4; see [`crate::torsion_constant`].
        torsion: f64,
    },
}

/// A curve skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Skeleton {
    /// The method that made it.
    pub method: Method,
    /// Points, mm.
    pub points: Vec<DVec3>,
    /// One per point.
    pub kinds: Vec<PointKind>,
    /// One per point.
    pub sections: Vec<Section>,
    /// Pairs of points, the smaller first, sorted, each once.
    pub edges: Vec<[u32; 2]>,
    /// Holes that non-design parts have of their own: the genus of the part exceeds the cycles by as many.
    pub non_design_holes: usize,
    /// What a user should know: unfinished branches, loops inside non-design parts, parts left out.
    pub remarks: Vec<String>,
}

/// The shape of a skeleton as a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GraphMeasures {
    /// Connected components.
    pub components: usize,
    /// Independent cycles: edges - points + components.
    pub cycles: usize,
    /// Points where more than two edges meet.
    pub junctions: usize,
    /// Points with one edge.
    pub ends: usize,
    /// Points without edges.
    pub isolated: usize,
}

impl Skeleton {
    pub(crate) fn new(method: Method) -> Self {
        Self {
            method,
            points: Vec::new(),
            kinds: Vec::new(),
            sections: Vec::new(),
            edges: Vec::new(),
            non_design_holes: 0,
            remarks: Vec::new(),
        }
    }

    pub(crate) fn add_point(&mut self, point: DVec3, kind: PointKind, section: Section) -> u32 {
        self.points.push(point);
        self.kinds.push(kind);
        self.sections.push(section);
        (self.points.len() - 1) as u32
    }

    /// Joins two points; joining a point to itself or twice does nothing once [`Self::finish`] has run.
    pub(crate) fn add_edge(&mut self, a: u32, b: u32) {
        self.edges.push([a.min(b), a.max(b)]);
    }

    /// Brings the edges into their documented form.
    pub(crate) fn finish(&mut self) {
        self.edges.retain(|[a, b]| a != b);
        self.edges.sort_unstable();
        self.edges.dedup();
    }

    /// How many edges meet at each point.
    pub fn degrees(&self) -> Vec<u32> {
        let mut degrees = vec![0; self.points.len()];
        for &[a, b] in &self.edges {
            degrees[a as usize] += 1;
            degrees[b as usize] += 1;
        }
        degrees
    }

    /// The points next to each point, in the order of the edges.
    pub fn neighbors(&self) -> Vec<Vec<u32>> {
        let mut neighbors = vec![Vec::new(); self.points.len()];
        for &[a, b] in &self.edges {
            neighbors[a as usize].push(b);
            neighbors[b as usize].push(a);
        }
        neighbors
    }

    /// Components, cycles, junctions and ends.
    pub fn measures(&self) -> GraphMeasures {
        let neighbors = self.neighbors();
        let mut seen = vec![false; self.points.len()];
        let mut components = 0;
        for start in 0..self.points.len() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            components += 1;
            let mut stack = vec![start];
            while let Some(p) = stack.pop() {
                for &q in &neighbors[p] {
                    if !std::mem::replace(&mut seen[q as usize], true) {
                        stack.push(q as usize);
                    }
                }
            }
        }
        let count = |wanted: fn(usize) -> bool| neighbors.iter().filter(|n| wanted(n.len())).count();
        GraphMeasures {
            components,
            cycles: self.edges.len() + components - self.points.len(),
            junctions: count(|d| d > 2),
            ends: count(|d| d == 1),
            isolated: count(|d| d == 0),
        }
    }

    /// The total length of the edges, mm.
    pub fn length(&self) -> f64 {
        self.edges.iter().map(|&[a, b]| self.points[a as usize].distance(self.points[b as usize])).sum()
    }

    /// The contract's `skeleton.json`.
    pub fn to_json(&self) -> serde_json::Value {
        let vector = |v: DVec3| serde_json::json!([v.x, v.y, v.z]);
        let sections: Vec<_> = self
            .sections
            .iter()
            .map(|section| match *section {
                Section::None => serde_json::Value::Null,
                Section::Box { low, high } => {
                    serde_json::json!({"box_low": vector(low), "box_high": vector(high)})
                }
                Section::Plane { area, normal, moments, axis, torsion } => {
                    let (u, v) = section_frame(normal);
                    let [uu, vv, uv] = second_moments(moments, axis, [u, v]);
                    serde_json::json!({
                        "area": area, "normal": vector(normal), "moments": moments, "axis": vector(axis),
                        "torsion": torsion, "u": vector(u), "v": vector(v), "Iuu": uu, "Ivv": vv, "Iuv": uv
                    })
                }
            })
            .collect();
        let measures = self.measures();
        serde_json::json!({
            "method": self.method,
            "units": "mm",
            "points": self.points.iter().map(|&p| vector(p)).collect::<Vec<_>>(),
            "kinds": self.kinds.iter().map(|k| k.name()).collect::<Vec<_>>(),
            "edges": self.edges,
            "sections": sections,
            "components": measures.components,
            "cycles": measures.cycles,
            "non_design_holes": self.non_design_holes,
            "remarks": self.remarks,
        })
    }
}

/// Axes across `normal`, as users of beams expect them: `u` is horizontal (`z` is up; for a vertical normal it is `x`),
/// and `u`, `v`, `normal` are right-handed.
pub fn section_frame(normal: DVec3) -> (DVec3, DVec3) {
    let horizontal = DVec3::Z.cross(normal);
    let u = if horizontal.length() > 1e-6 {
        horizontal.normalize()
    } else {
        (DVec3::X - normal.x * normal).normalize_or(DVec3::X)
    };
    (u, normal.cross(u))
}

/// `[Iuu, Ivv, Iuv]` about given axes, from the principal moments and the axis of the larger one:
/// `Iuu = int v^2 dA`, `Ivv = int u^2 dA`, `Iuv = int u v dA`.
pub fn second_moments(moments: [f64; 2], axis: DVec3, [u, v]: [DVec3; 2]) -> [f64; 3] {
    let (c, s) = (axis.dot(u), axis.dot(v));
    let [large, small] = moments;
    // About an axis the moment is that of distances across it: a tensor with the axes as eigenvectors.
    [large * c * c + small * s * s, large * s * s + small * c * c, (small - large) * c * s]
}
