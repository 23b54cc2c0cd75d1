//! Points of a surface on which supports and loads act.

use crate::{Load, LoadCase, Region};
use glam::DVec3;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{Connectivity, Design, FaceId, Part, RegionId, TriangleMesh};

/// A small piece of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Its middle, mm.
    pub point: DVec3,
    /// Unit normal, out of the material.
    pub normal: DVec3,
    /// Its area, mm^2.
    pub area: f64,
}

/// A region of space or of a reference surface, ready to be asked.
pub enum Selector {
    /// From low to high corner.
    Box(DVec3, DVec3),
    /// Point, unit axis, length, radius.
    Cylinder(DVec3, DVec3, f64, f64),
    /// Near some faces: nearer than the distance, mm.
    Faces(Box<SurfaceIndex>, f64),
}

impl Selector {
    /// Makes a region ready. `labelled` has the labels, `featured` the planes and cylinders; `slack` (mm) is how far outside
    /// of the region a point may lie. Says what is missing where the region can not be found.
    pub fn new(
        region: &Region,
        labelled: Option<&Part>,
        featured: Option<&Part>,
        slack: f64,
    ) -> Result<Self, String> {
        let faces = |part: &Part, chosen: Vec<FaceId>| {
            let triangles = chosen.iter().map(|f| part.mesh.triangles[f.index()]).collect();
            let mesh = TriangleMesh { positions: part.mesh.positions.clone(), triangles };
            Self::Faces(Box::new(SurfaceIndex::build(&mesh)), slack)
        };
        match region {
            Region::Box { min, max } => {
                let grown = DVec3::splat(slack);
                Ok(Self::Box(DVec3::from_array(*min) - grown, DVec3::from_array(*max) + grown))
            }
            Region::Cylinder { point, axis, length, diameter } => {
                let axis = DVec3::from_array(*axis).normalize_or(DVec3::Z);
                let point = DVec3::from_array(*point) - slack * axis;
                Ok(Self::Cylinder(point, axis, length + 2.0 * slack, 0.5 * diameter + slack))
            }
            Region::NonDesign { near } => {
                let part = labelled.ok_or("there is no mesh with labels here")?;
                let is = |f: FaceId| part.design[f.index()] == Design::NonDesign;
                let all: Vec<FaceId> = part.mesh.faces().filter(|&f| is(f)).collect();
                let start = nearest_of(part, &all, DVec3::from_array(*near))
                    .ok_or("no face is labelled as non-design; give `labels` in the import")?;
                let connectivity = Connectivity::build(&part.mesh).map_err(|e| e.to_string())?;
                let mut chosen = vec![start];
                let mut seen = vec![false; part.mesh.face_count()];
                seen[start.index()] = true;
                let mut next = 0;
                while next < chosen.len() {
                    for corner in 0..3 {
                        let f = connectivity.neighbor(chosen[next], corner);
                        if f != FaceId::NONE && !seen[f.index()] && is(f) {
                            seen[f.index()] = true;
                            chosen.push(f);
                        }
                    }
                    next += 1;
                }
                Ok(faces(part, chosen))
            }
            Region::Feature { near } => {
                let part = featured
                    .ok_or("there is no smoothed mesh here, whose planes and cylinders could be named")?;
                let all: Vec<FaceId> =
                    part.mesh.faces().filter(|f| part.region_of_face[f.index()] != RegionId::NONE).collect();
                let start = nearest_of(part, &all, DVec3::from_array(*near))
                    .ok_or("smoothing has found no plane and no cylinder on this part")?;
                let region = part.region_of_face[start.index()];
                Ok(faces(
                    part,
                    all.into_iter().filter(|f| part.region_of_face[f.index()] == region).collect(),
                ))
            }
        }
    }

    /// Whether a point lies in the region.
    pub fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Box(low, high) => p.cmpge(*low).all() && p.cmple(*high).all(),
            Self::Cylinder(point, axis, length, radius) => {
                let along = (p - *point).dot(*axis);
                (0.0..=*length).contains(&along)
                    && (p - *point).reject_from_normalized(*axis).length_squared() <= radius * radius
            }
            Self::Faces(index, slack) => index.is_within(p, *slack),
        }
    }

    fn may_contain(&self, low: DVec3, high: DVec3) -> bool {
        match self {
            Self::Box(l, h) => low.cmple(*h).all() && high.cmpge(*l).all(),
            Self::Cylinder(point, axis, length, radius) => {
                let (a, b) = (*point, *point + *axis * *length);
                let r = DVec3::splat(*radius);
                low.cmple(a.max(b) + r).all() && high.cmpge(a.min(b) - r).all()
            }
            Self::Faces(index, slack) => {
                let (l, h) = index.bounds();
                low.cmple(h + *slack).all() && high.cmpge(l - *slack).all()
            }
        }
    }
}

fn nearest_of(part: &Part, faces: &[FaceId], point: DVec3) -> Option<FaceId> {
    let distance = |f: FaceId| {
        let corners = part.mesh.corners(f);
        topipe_mesh::spatial::closest_point_on_triangle(point, corners).distance_squared(point)
    };
    faces.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.0.cmp(&b.0)))
}

/// Something that has a surface: a mesh, or the border of a domain of solids.
pub trait Surface {
    /// Its points in a region, each standing for a piece not much larger than `size` (mm).
    fn points(&self, selector: &Selector, size: f64) -> Vec<SurfacePoint>;
    /// Its bounding box, for messages.
    fn bounds(&self) -> (DVec3, DVec3);
}

impl Surface for TriangleMesh {
    fn points(&self, selector: &Selector, size: f64) -> Vec<SurfacePoint> {
        let mut points = Vec::new();
        for face in self.faces() {
            let [a, b, c] = self.corners(face);
            if !selector.may_contain(a.min(b).min(c), a.max(b).max(c)) {
                continue;
            }
            let area_vector = self.area_vector(face);
            let Some(normal) = area_vector.try_normalize() else { continue };
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let n = (longest / size).ceil().clamp(1.0, 2000.0) as usize;
            let area = 0.5 * area_vector.length() / (n * n) as f64;
            for i in 0..n {
                for j in 0..n - i {
                    for up in [true, false] {
                        if !up && i + j + 1 >= n {
                            continue;
                        }
                        let third = if up { 1.0 / 3.0 } else { 2.0 / 3.0 };
                        let (u, v) = ((i as f64 + third) / n as f64, (j as f64 + third) / n as f64);
                        let point = a + u * (b - a) + v * (c - a);
                        if selector.contains(point) {
                            points.push(SurfacePoint { point, normal, area });
                        }
                    }
                }
            }
        }
        points
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        TriangleMesh::bounds(self)
    }
}

/// The forces of a load on points of a surface, N.
pub fn forces(load: &Load, points: &[SurfacePoint]) -> Vec<DVec3> {
    let area: f64 = points.iter().map(|p| p.area).sum();
    let each = |p: &SurfacePoint| match (load.force, load.pressure) {
        (Some(force), _) => DVec3::from_array(force) * (p.area / area),
        (None, pressure) => p.normal * (-pressure.unwrap_or(0.0) * p.area),
    };
    points.iter().map(each).collect()
}

/// Where all supports and loads of a load case act on a surface.
#[derive(Debug, Clone)]
pub struct Attachment {
    /// Points of each support, with the directions held.
    pub supports: Vec<(Vec<SurfacePoint>, [bool; 3])>,
    /// Points of each load with the force on each, and its case counted from 0.
    pub loads: Vec<(Vec<SurfacePoint>, Vec<DVec3>, usize)>,
    /// Number of cases.
    pub cases: usize,
}

impl Attachment {
    /// Finds them. `of` names the surface in messages (" of the smoothed mesh"), `size` is the size of cells.
    pub fn new(
        load_case: &LoadCase,
        surface: &dyn Surface,
        selectors: &Selectors,
        of: &str,
        size: f64,
    ) -> Result<Self, crate::FemError> {
        let find = |list, k: usize, region: &Region, selector: &Selector| {
            let points = surface.points(selector, 0.25 * size);
            if points.is_empty() {
                let (low, high) = surface.bounds();
                return Err(crate::FemError::NothingThere {
                    list,
                    entry: k + 1,
                    of: of.to_owned(),
                    region: region.describe(),
                    low: crate::error::point(low),
                    high: crate::error::point(high),
                });
            }
            Ok(points)
        };
        let numbers = load_case.cases();
        let mut supports = Vec::new();
        for (k, (support, selector)) in load_case.supports.iter().zip(&selectors.supports).enumerate() {
            supports.push((find("supports", k, &support.region, selector)?, support.directions));
        }
        let mut loads = Vec::new();
        for (k, (load, selector)) in load_case.loads.iter().zip(&selectors.loads).enumerate() {
            let points = find("loads", k, &load.region, selector)?;
            let forces = forces(load, &points);
            loads.push((points, forces, numbers.binary_search(&load.case).unwrap_or(0)));
        }
        Ok(Self { supports, loads, cases: numbers.len() })
    }

    /// All points, of supports and of loads.
    pub fn all_points(&self) -> impl Iterator<Item = DVec3> + '_ {
        let supports = self.supports.iter().flat_map(|s| &s.0);
        supports.chain(self.loads.iter().flat_map(|l| &l.0)).map(|p| p.point)
    }
}

/// The regions of a load case, ready to be asked.
pub struct Selectors {
    supports: Vec<Selector>,
    loads: Vec<Selector>,
}

impl Selectors {
    /// See [`Selector::new`].
    pub fn new(
        load_case: &LoadCase,
        labelled: Option<&Part>,
        featured: Option<&Part>,
        slack: f64,
    ) -> Result<Self, crate::FemError> {
        let make = |list, k: usize, region| {
            Selector::new(region, labelled, featured, slack).map_err(|problem| crate::FemError::Entry {
                list,
                entry: k + 1,
                problem,
            })
        };
        let supports = load_case.supports.iter().enumerate();
        let loads = load_case.loads.iter().enumerate();
        Ok(Self {
            supports: supports.map(|(k, s)| make("supports", k, &s.region)).collect::<Result<_, _>>()?,
            loads: loads.map(|(k, l)| make("loads", k, &l.region)).collect::<Result<_, _>>()?,
        })
    }
}
