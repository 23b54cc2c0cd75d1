//! The results as layers, with the numbers that are shown on them as colours, and their distributions.

use super::results::Results;
use super::surface_mesh::{grid, surface_mesh};
use crate::artifacts;
use crate::fields::{distances, limit, vertex_areas};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;
use topipe_beams::Structure;
use topipe_engine::{ArtifactKind, StageRecord};
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, Part, RegionId, RegionShape, TriangleMesh};
use topipe_quad_matching::QuadLayout;
use topipe_render::{Color, palette};
use topipe_report::{Categories, ColorMaps, Field, Histogram, Label, Lines, Points, Scene, Surface};
use topipe_skeleton::{PointKind, Skeleton};
use topipe_spline_fit::SplineSurface;
use topipe_tiling::Tiling;

const FREE: [u8; 3] = [176, 190, 204];
const PLANE: [u8; 3] = [222, 213, 193];
const HOLE: [u8; 3] = [214, 122, 60];
const BOSS: [u8; 3] = [120, 168, 128];
const NON_DESIGN: [u8; 3] = [150, 120, 178];
const INK: [u8; 3] = [42, 52, 64];
const SKELETON: [u8; 3] = [196, 44, 56];
const NODE: [u8; 3] = [32, 64, 140];
const FROZEN: [u8; 3] = [28, 96, 168];

/// Share of the area whose values the colours tell apart.
const SHOWN: f64 = 0.98;
/// Pieces of the edge of a face that is a whole circle.
const CIRCLE: f64 = 72.0;

/// The layers of one kind of result.
struct Builder<'a> {
    results: &'a Results<'a>,
    indices: &'a Indices,
    room: &'a Room,
    scene: Scene,
    histograms: Vec<Histogram>,
}

/// Search structures by the stage of the mesh, each built when it is first asked for. Building one must have no parallel part: a
/// thread that waits for it would take up other layers, and wait for the structure that it is itself building.
type Indices = HashMap<String, OnceLock<SurfaceIndex>>;

/// Triangles of meshes, tiles and quadrilaterals that a page may hold: about 20 MB, and what a browser turns without a card
/// of its own. (A CAD surface has never more than a few hundred thousand.)
const MOST: usize = 1_500_000;

/// Which results are shown, in their order, and what is said of the others.
struct Room {
    shown: HashSet<String>,
    left_out: Vec<String>,
}

impl Room {
    fn of(results: &Results<'_>) -> Self {
        let meshes = results.of::<artifacts::Mesh>();
        let meshes = meshes.into_iter().map(|(stage, part)| {
            let name = if results.original(stage).is_some() { "Smoothed mesh" } else { "Original mesh" };
            (name, stage, part.mesh.face_count())
        });
        let tilings = results.of::<artifacts::Tiling>();
        let tilings =
            tilings.into_iter().map(|(stage, tiling)| ("Tiles", stage, tiling.part.mesh.face_count()));
        let layouts = results.of::<artifacts::QuadLayout>();
        let layouts = layouts
            .into_iter()
            .map(|(stage, layout)| ("Quadrilaterals", stage, layout.part.mesh.face_count()));
        let mut room = Self { shown: HashSet::new(), left_out: Vec::new() };
        let mut triangles = 0;
        for (name, stage, count) in meshes.chain(tilings).chain(layouts) {
            if triangles + count <= MOST {
                triangles += count;
                room.shown.insert(stage.stage.clone());
            } else {
                let more = "too many to be shown here as well";
                room.left_out.push(format!("{name} of stage {}: {count} triangles are {more}.", stage.stage));
            }
        }
        room
    }
}

/// Kinds of results that no layer shows.
pub(super) const NOT_SHOWN: [&str; 2] = [artifacts::Report::NAME, artifacts::Stiffness::NAME];

/// All layers, the distributions of what is measured on them, and what is said of results without one.
pub(super) fn scene(results: &Results<'_>) -> (Scene, Vec<Histogram>, Vec<String>) {
    let stops = |color: &dyn Fn(f64) -> Color| (0..=32).map(|k| color(f64::from(k) / 32.0).0).collect();
    let color_maps = ColorMaps {
        sequential: stops(&palette::sequential),
        diverging: stops(&|t| palette::diverging(2.0 * t - 1.0)),
    };
    let mut scene = Scene { color_maps, ..Scene::default() };
    let meshes = results.of::<artifacts::Mesh>();
    let indices: Indices = meshes.iter().map(|(stage, _)| (stage.stage.clone(), OnceLock::new())).collect();
    let room = Room::of(results);
    let built: Vec<Builder<'_>> = (Builder::KINDS.into_par_iter().with_max_len(1))
        .map(|layers| {
            let (scene, histograms) = (Scene::default(), Vec::new());
            let mut builder = Builder { results, indices: &indices, room: &room, scene, histograms };
            layers(&mut builder);
            builder
        })
        .collect();
    let mut histograms = Vec::new();
    for mut builder in built {
        scene.surfaces.append(&mut builder.scene.surfaces);
        scene.lines.append(&mut builder.scene.lines);
        scene.points.append(&mut builder.scene.points);
        scene.labels.append(&mut builder.scene.labels);
        histograms.append(&mut builder.histograms);
    }
    (scene, histograms, room.left_out)
}

/// The first layer of its kind has the plain name, further ones that of their stage too.
fn named(count: usize, id: &str, name: &str, stage: &str) -> (String, String) {
    match count {
        0 => (id.to_owned(), name.to_owned()),
        _ => (format!("{id}:{stage}"), format!("{name} ({stage})")),
    }
}

/// A diameter without digits that say nothing.
fn diameter(radius: f64) -> String {
    let text = format!("{:.4}", 2.0 * radius);
    format!("\u{2300} {} mm", text.trim_end_matches('0').trim_end_matches('.'))
}

fn shape_words(shape: &RegionShape) -> (String, [u8; 3]) {
    match *shape {
        RegionShape::Plane { .. } => ("flat face".into(), PLANE),
        RegionShape::Cylinder { radius, hole: true, .. } => (format!("hole {}", diameter(radius)), HOLE),
        RegionShape::Cylinder { radius, .. } => (format!("boss {}", diameter(radius)), BOSS),
    }
}

fn field(name: &str, unit: &str, values: Vec<f64>, diverging: bool) -> Field {
    let limit = limit(&values, SHOWN);
    Field { name: name.into(), unit: unit.into(), values, diverging, limit }
}

/// Categories with different colours side by side.
fn by_id(mesh: &TriangleMesh, ids: &[u32], name: &str, one: &str) -> Categories {
    let colors = palette::categorical(mesh, ids).into_iter().map(|color| color.0).collect();
    Categories { name: name.into(), one: one.into(), id_of_face: ids.to_vec(), colors, names: Vec::new() }
}

/// Polylines as segments.
#[derive(Default)]
struct Chains {
    points: Vec<DVec3>,
    segments: Vec<[u32; 2]>,
}

impl Chains {
    fn add(&mut self, chain: impl IntoIterator<Item = DVec3>) {
        let first = self.points.len() as u32;
        self.points.extend(chain);
        self.segments.extend((first + 1..self.points.len() as u32).map(|at| [at - 1, at]));
    }

    fn lines(self, (id, name): (String, String), color: [u8; 3], width: f32) -> Lines {
        let Self { points, segments } = self;
        Lines { id, name, points, segments, color, width, in_front: false, field: None }
    }
}

impl<'a> Builder<'a> {
    /// What adds layers, in the order in which they are listed.
    const KINDS: [fn(&mut Self); 6] =
        [Self::surfaces, Self::meshes, Self::tilings, Self::layouts, Self::skeletons, Self::beams];

    /// The distances of points from the mesh of a stage.
    fn distances(&self, points: &[DVec3], stage: &StageRecord, part: &Part) -> Vec<f64> {
        distances(points, self.index(stage, part))
    }

    fn index(&self, stage: &StageRecord, part: &Part) -> &'a SurfaceIndex {
        self.indices[&stage.stage].get_or_init(|| SurfaceIndex::build(&part.mesh))
    }

    fn histogram(&mut self, title: &str, about: &str, unit: &str, values: &[f64], weights: &[f64]) {
        self.histograms.extend(Histogram::of(title, about, unit, values, weights));
    }

    fn surfaces(&mut self) {
        let results = self.results;
        for (count, (stage, surface)) in results.of::<artifacts::SplineSurface>().into_iter().enumerate() {
            let (mesh, face_of_triangle) = surface_mesh(surface);
            let (id, name) = named(count, "surface", "CAD surface", &stage.stage);
            let mut layer = Surface::new(&id, &name, mesh);
            layer.crease_deg = 25.0;
            layer.categories.push(faces_by_kind(surface, &face_of_triangle));
            layer.categories.push(by_id(&layer.mesh, &face_of_triangle, "Patches", "face"));
            let reference = results.mesh_before(stage);
            let original = results.original(stage);
            let areas = vertex_areas(&layer.mesh);
            for (part, from) in [(reference, "smoothed mesh"), (original, "original mesh")] {
                let same = reference.map(|r| &r.0.stage) == original.map(|o| &o.0.stage);
                if let Some((mesh_stage, part)) = part.filter(|_| from == "original mesh" || !same) {
                    let values = self.distances(&layer.mesh.positions, mesh_stage, part);
                    self.histogram(
                        &format!("Distance of the CAD surface from the {from}"),
                        "by area, one way, from the model above; the figures count both ways",
                        "mm",
                        &values,
                        &areas,
                    );
                    layer.fields.push(field(&format!("Distance from the {from}"), "mm", values, false));
                }
            }
            self.scene.surfaces.push(layer);
            let mut edges = Chains::default();
            for edge in &surface.edges {
                let turns = edge.sweep().map_or(0.0, |sweep| sweep / std::f64::consts::TAU);
                let pieces = grid(surface).max((CIRCLE * turns).ceil() as usize);
                edges.add((0..=pieces).map(|k| edge.exact(k as f64 / pieces as f64).position));
            }
            let edges = edges.lines(named(count, "patch-edges", "Edges of patches", &stage.stage), INK, 1.2);
            self.scene.lines.push(edges);
            self.scene
                .lines
                .push(control_net(surface, named(count, "control-net", "Control net", &stage.stage)));
        }
    }

    fn meshes(&mut self) {
        let results = self.results;
        let (mut originals, mut smoothed) = (0, 0);
        for (stage, part) in results.of::<artifacts::Mesh>() {
            let before = results.original(stage);
            let (id, name) = match before {
                None => named(originals, "original", "Original mesh", &stage.stage),
                Some(_) => named(smoothed, "smoothed", "Smoothed mesh", &stage.stage),
            };
            let count = if before.is_some() { smoothed } else { 0 };
            originals += usize::from(before.is_none());
            smoothed += usize::from(before.is_some());
            if !self.room.shown.contains(&stage.stage) {
                continue;
            }
            let mut layer = Surface::new(&id, &name, part.mesh.clone());
            layer.categories.extend(regions(part));
            layer.categories.extend(non_design(part));
            if let Some((first, original)) = before {
                let values = self.distances(&part.mesh.positions, first, original);
                self.histogram(
                    &format!("Distance of the {} from the original mesh", name.to_lowercase()),
                    "by area, one way, at the vertices; the figures count both ways",
                    "mm",
                    &values,
                    &vertex_areas(&part.mesh),
                );
                layer.fields.push(field("Distance from the original mesh", "mm", values, false));
            }
            let mut curvature = field("Mean curvature", "1/mm", part.mesh.mean_curvature(), true);
            // Sharp edges and slivers have curvatures as large as their triangles are small.
            curvature.limit = limit(&curvature.values, 0.9);
            layer.fields.push(curvature);
            self.scene.surfaces.push(layer);
            if before.is_some() || !part.feature_edges.is_empty() {
                self.overlays_of_mesh(part, count, &stage.stage);
            }
        }
    }

    /// Feature edges, frozen vertices, and the diameters of holes.
    fn overlays_of_mesh(&mut self, part: &Part, count: usize, stage: &str) {
        let mut edges = Chains::default();
        for edge in &part.feature_edges {
            edges.add(edge.vertices.map(|v| part.mesh.position(v)));
        }
        if !edges.points.is_empty() {
            self.scene.lines.push(edges.lines(named(count, "features", "Feature edges", stage), INK, 1.8));
        }
        let frozen = part.mesh.positions.iter().zip(&part.frozen).filter(|(_, frozen)| **frozen);
        let points: Vec<DVec3> = frozen.map(|(&p, _)| p).collect();
        if !points.is_empty() {
            let (id, name) = named(count, "frozen", "Frozen vertices", stage);
            self.scene.points.push(Points { id, name, points, color: FROZEN, size: 3.2, in_front: false });
        }
        if count == 0 {
            for region in &part.regions {
                if let RegionShape::Cylinder { point, radius, hole: true, .. } = region.shape {
                    self.scene.labels.push(Label { at: point, text: diameter(radius) });
                }
            }
        }
    }

    fn tilings(&mut self) {
        for (count, (stage, tiling)) in self.results.of::<artifacts::Tiling>().into_iter().enumerate() {
            let (id, name) = named(count, "tiles", "Tiles", &stage.stage);
            if !self.room.shown.contains(&stage.stage) {
                continue;
            }
            self.scene.surfaces.push(tiles(tiling, &id, &name));
        }
    }

    fn layouts(&mut self) {
        for (count, (stage, layout)) in self.results.of::<artifacts::QuadLayout>().into_iter().enumerate() {
            let mesh = &layout.part.mesh;
            if !self.room.shown.contains(&stage.stage) {
                continue;
            }
            let (id, name) = named(count, "quads", "Quadrilaterals", &stage.stage);
            let mut layer = Surface::new(&id, &name, mesh.clone());
            layer.categories.push(by_id(mesh, &layout.quad_of_face, "Quadrilaterals", "quadrilateral"));
            self.scene.surfaces.push(layer);
            self.scene.lines.push(quad_sides(
                layout,
                named(count, "quad-sides", "Sides of quadrilaterals", &stage.stage),
            ));
            if count == 0 {
                let mut counts = vec![0u64; 36];
                for angle in layout.corner_angles().into_iter().flatten().map(f64::to_degrees) {
                    let bar = (angle / 5.0) as usize;
                    if bar >= counts.len() {
                        counts.resize(bar.min(71) + 1, 0);
                    }
                    counts[bar.min(71)] += 1;
                }
                let about = "one for each corner; 90 is a square, near 0 or 180 a patch may fold";
                let corners =
                    Histogram::of_counts("Corners of quadrilaterals", about, "degrees", 5.0, &counts);
                self.histograms.extend(corners);
            }
        }
    }

    fn skeletons(&mut self) {
        let results = self.results;
        for (count, (stage, skeleton)) in results.of::<artifacts::Skeleton>().into_iter().enumerate() {
            let mut values = vec![0.0; skeleton.points.len()];
            if let Some((mesh_stage, part)) = results.mesh_before(stage) {
                let index = self.index(mesh_stage, part);
                let off = topipe_validation::off_center_of_points(skeleton, part, index);
                for &(point, value) in &off {
                    values[point] = value;
                }
                let radius = topipe_validation::bounding_sphere(&part.mesh.positions).1;
                let relative: Vec<f64> = off.iter().map(|(_, value)| value / radius).collect();
                if count == 0 && radius > 0.0 {
                    let about = "one for each point of a branch; their mean is E_center";
                    self.histogram(
                        "Centre line off centre, over the radius of the part",
                        about,
                        "",
                        &relative,
                        &[],
                    );
                }
            }
            let (id, name) = named(count, "skeleton", "Centre line", &stage.stage);
            self.scene.lines.push(Lines {
                id,
                name,
                points: skeleton.points.clone(),
                segments: skeleton.edges.clone(),
                color: SKELETON,
                width: 4.5,
                in_front: true,
                field: Some(field("Off centre", "mm", values, false)),
            });
            let (id, name) = named(count, "skeleton-nodes", "Junctions and ends", &stage.stage);
            let points = nodes(skeleton);
            self.scene.points.push(Points { id, name, points, color: NODE, size: 10.0, in_front: true });
        }
    }

    fn beams(&mut self) {
        for (count, (stage, structure)) in self.results.of::<artifacts::Beams>().into_iter().enumerate() {
            let (id, name) = named(count, "beams", "Beams", &stage.stage);
            if let Some(mesh) = beam_mesh(structure) {
                let mut layer = Surface::new(&id, &name, mesh);
                layer.crease_deg = 25.0;
                self.scene.surfaces.push(layer);
            }
            let mut axes = Chains::default();
            structure.beams.iter().for_each(|beam| axes.add(structure.line(beam, 16)));
            let (id, name) = named(count, "beam-axes", "Axes of beams", &stage.stage);
            let mut lines = axes.lines((id, name), SKELETON, 3.0);
            lines.in_front = true;
            self.scene.lines.push(lines);
        }
    }
}

/// What is in a report as counts.
pub(super) fn histogram_of_report(results: &Results<'_>) -> Option<Histogram> {
    let reports = results.reports().into_iter();
    let shape = reports.filter_map(|(_, report, _)| report.smoothing.as_ref()?.shape.as_ref()).next()?;
    let about = "one for each edge of the smoothed mesh: 0 is flat, 180 folded back";
    let counts: Vec<u64> = shape.after.histogram.iter().map(|&count| count as u64).collect();
    Histogram::of_counts("Angles between triangles", about, "degrees", 10.0, &counts)
}

/// Groups of faces by what they are, each face a group of its own.
fn faces_by_kind(surface: &SplineSurface, face_of_triangle: &[u32]) -> Categories {
    let patches = surface.patches.len();
    let shapes: Vec<(String, [u8; 3])> = surface.faces.iter().map(|face| shape_words(&face.shape)).collect();
    Categories {
        name: "Kinds of faces".into(),
        one: "face".into(),
        id_of_face: face_of_triangle.to_vec(),
        colors: std::iter::repeat_n(FREE, patches).chain(shapes.iter().map(|shape| shape.1)).collect(),
        names: (0..patches)
            .map(|k| format!("patch {k}"))
            .chain(shapes.into_iter().map(|shape| shape.0))
            .collect(),
    }
}

fn regions(part: &Part) -> Option<Categories> {
    if part.regions.is_empty() {
        return None;
    }
    let shapes: Vec<(String, [u8; 3])> =
        part.regions.iter().map(|region| shape_words(&region.shape)).collect();
    Some(Categories {
        name: "Holes, bosses, flat faces".into(),
        one: "region".into(),
        id_of_face: part
            .region_of_face
            .iter()
            .map(|r| if *r == RegionId::NONE { u32::MAX } else { r.0 })
            .collect(),
        colors: shapes.iter().map(|shape| shape.1).collect(),
        names: shapes.into_iter().map(|shape| shape.0).collect(),
    })
}

fn non_design(part: &Part) -> Option<Categories> {
    let fixed = |design: &topipe_mesh::Design| *design == topipe_mesh::Design::NonDesign;
    part.design.iter().any(fixed).then(|| Categories {
        name: "Non-design".into(),
        one: "non-design".into(),
        id_of_face: part.design.iter().map(|design| if fixed(design) { 0 } else { u32::MAX }).collect(),
        colors: vec![NON_DESIGN],
        names: vec!["non-design: not to be moved".into()],
    })
}

fn tiles(tiling: &Tiling, id: &str, name: &str) -> Surface {
    let mut layer = Surface::new(id, name, tiling.part.mesh.clone());
    let ids: Vec<u32> = tiling.tile_of_face.iter().map(|tile| tile.0).collect();
    layer.categories.push(by_id(&tiling.part.mesh, &ids, "Tiles", "tile"));
    layer
}

fn quad_sides(layout: &QuadLayout, names: (String, String)) -> Lines {
    let mut sides = Chains::default();
    for edge in &layout.edges {
        sides.add(edge.path.iter().map(|&v| layout.part.mesh.position(v)));
    }
    sides.lines(names, INK, 1.3)
}

fn control_net(surface: &SplineSurface, (id, name): (String, String)) -> Lines {
    let mut points = Vec::new();
    let mut segments = Vec::new();
    for patch in &surface.patches {
        let (nu, nv, first) = (patch.basis_u.len() as u32, patch.basis_v.len() as u32, points.len() as u32);
        points.extend(&patch.control);
        for j in 0..nv {
            for i in 0..nu {
                let at = first + j * nu + i;
                if i + 1 < nu {
                    segments.push([at, at + 1]);
                }
                if j + 1 < nv {
                    segments.push([at, at + nu]);
                }
            }
        }
    }
    Lines { id, name, points, segments, color: [120, 72, 150], width: 0.8, in_front: false, field: None }
}

fn nodes(skeleton: &Skeleton) -> Vec<DVec3> {
    let of_branch = |kind: &PointKind| *kind == PointKind::Branch;
    let nodes = skeleton.points.iter().zip(&skeleton.kinds).filter(|(_, kind)| !of_branch(kind));
    nodes.map(|(&p, _)| p).collect()
}

/// Beams as their solid; where none can be built they are their axes only.
fn beam_mesh(structure: &Structure) -> Option<TriangleMesh> {
    let solid = topipe_beams::solid::solid(structure).ok()?;
    Some(topipe_beams::solid::triangulate(&solid.brep, std::f64::consts::TAU / 48.0))
}
