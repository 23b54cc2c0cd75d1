//! How each kind of artifact is drawn.

use crate::fields;
use topipe_beams::Structure;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{Connectivity, DVec3, Part, TriangleMesh};
use topipe_mesh::{Design, RegionShape};
use topipe_quad_matching::QuadLayout;
use topipe_render::{
    Camera, Color, Coloring, EdgeOverlay, Image, Legend, LineLayer, LineWidth, MeshLayer, Options,
    RenderError, Scene, palette, render,
};
use topipe_skeleton::Skeleton;
use topipe_spline_fit::SplineSurface;
use topipe_tiling::Tiling;

/// From where, how large.
pub(crate) struct View {
    pub(crate) camera: Camera,
    pub(crate) options: Options,
    /// A mesh that is drawn over a skeleton or beams, so that they shine through.
    pub(crate) over: Option<Part>,
    /// What the colours say.
    pub(crate) paint: Paint,
    /// The value at which colours of numbers end.
    pub(crate) range: Option<f64>,
    /// Whether the edges of triangles are drawn.
    pub(crate) edges: bool,
}

/// What the colours of a picture say.
#[derive(Debug, Clone, Default)]
pub(crate) enum Paint {
    /// What suits the result.
    #[default]
    Usual,
    /// Nothing.
    Plain,
    /// Planes and cylinders, each region its own.
    Regions,
    /// Design and non-design.
    Design,
    /// Tiles, quadrilaterals or patches.
    Ids,
    /// Free-form, plane, hole, boss.
    Kinds,
    /// Mean curvature.
    Curvature,
    /// The distance from a mesh.
    Deviation(Box<TriangleMesh>),
}

impl Default for View {
    fn default() -> Self {
        Self {
            camera: Camera::ISO,
            options: Options::default(),
            over: None,
            paint: Paint::Usual,
            range: None,
            edges: false,
        }
    }
}

/// Largest distance of a drawn surface from the true one over its diagonal: less than a pixel.
const CHORD: f64 = 2e-4;
/// Radius of a drawn skeleton over its diagonal.
const TUBE: f64 = 0.004;

/// A mesh, lit; a color for each region of known shape, and their borders.
pub(crate) fn mesh(part: &Part, view: &View) -> Result<Image, RenderError> {
    let regions: Vec<u32> = part.region_of_face.iter().map(|region| region.0).collect();
    let shape = |f: usize| part.regions.get(regions[f] as usize).map(|region| &region.shape);
    let colors = match view.paint {
        Paint::Usual | Paint::Regions if !part.regions.is_empty() => {
            Some(palette::categorical_faces(&part.mesh, &regions))
        }
        Paint::Kinds => Some((0..regions.len()).map(|f| kind_color(shape(f))).collect()),
        Paint::Design => {
            Some(part.design.iter().map(|design| DESIGN[usize::from(*design == Design::NonDesign)]).collect())
        }
        _ => None,
    };
    let with_borders = matches!(view.paint, Paint::Usual | Paint::Regions | Paint::Kinds);
    let mut borders = Vec::new();
    if with_borders
        && !part.regions.is_empty()
        && let Ok(connectivity) = Connectivity::build(&part.mesh)
    {
        for h in connectivity.edges() {
            let twin = connectivity.twin(h);
            if twin.is_some() && regions[h.face().index()] != regions[twin.face().index()] {
                let ends = [connectivity.origin(h), connectivity.target(h)];
                borders.push(ends.map(|v| part.mesh.position(v)).to_vec());
            }
        }
    }
    draw(&part.mesh, colors, borders, view)
}

/// A mesh with a color for each tile.
pub(crate) fn tiling(tiling: &Tiling, view: &View) -> Result<Image, RenderError> {
    if !matches!(view.paint, Paint::Usual | Paint::Ids) {
        return mesh(&tiling.part, view);
    }
    let tiles: Vec<u32> = tiling.tile_of_face.iter().map(|tile| tile.0).collect();
    let mesh = &tiling.part.mesh;
    draw(mesh, Some(palette::categorical_faces(mesh, &tiles)), Vec::new(), view)
}

/// A mesh with a color for each quad, and the sides of the quads.
pub(crate) fn layout(layout: &QuadLayout, view: &View) -> Result<Image, RenderError> {
    let mesh = &layout.part.mesh;
    let colors = match view.paint {
        Paint::Usual | Paint::Ids => Some(palette::categorical_faces(mesh, &layout.quad_of_face)),
        Paint::Regions | Paint::Design | Paint::Kinds => return self::mesh(&layout.part, view),
        _ => None,
    };
    let sides =
        layout.edges.iter().map(|edge| edge.path.iter().map(|&v| mesh.position(v)).collect()).collect();
    draw(mesh, colors, sides, view)
}

/// A surface and the edges of its patches.
pub(crate) fn surface(surface: &SplineSurface, view: &View) -> Result<Image, RenderError> {
    let extent = extent(&surface.vertices);
    // Numbers are shown at vertices: faces of known shape need some inside.
    let longest = match view.paint {
        Paint::Deviation(_) | Paint::Curvature => LONGEST * extent,
        _ => f64::INFINITY,
    };
    let (mesh, face_of_triangle) = surface.tessellate_with(CHORD * extent, longest);
    let patches = surface.patches.len();
    let shape = |face: u32| {
        let at = (face as usize).checked_sub(patches)?;
        surface.faces.get(at).map(|face| &face.shape)
    };
    let colors = match view.paint {
        Paint::Ids => Some(palette::categorical_faces(&mesh, &face_of_triangle)),
        Paint::Kinds | Paint::Regions => {
            Some(face_of_triangle.iter().map(|&face| kind_color(shape(face))).collect())
        }
        _ => None,
    };
    let edges = surface.edges.iter();
    let edges = edges.map(|edge| (0..=32).map(|k| edge.position(f64::from(k) / 32.0)).collect()).collect();
    draw(&mesh, colors, edges, view)
}

/// A mesh with the given colors of faces and lines, or with the numbers that the view asks for.
fn draw(
    mesh: &TriangleMesh,
    colors: Option<Vec<Color>>,
    polylines: Vec<Vec<DVec3>>,
    view: &View,
) -> Result<Image, RenderError> {
    let mut layer = MeshLayer::new(mesh);
    let mut options = view.options.clone();
    let numbers = match &view.paint {
        Paint::Curvature => Some((mesh.mean_curvature(), "1/mm", true, 0.9)),
        Paint::Deviation(from) => {
            Some((fields::distances(&mesh.positions, &SurfaceIndex::build(from)), "mm", false, 0.98))
        }
        _ => None,
    };
    if let Some((values, unit, diverging, share)) = numbers {
        let range = view.range.unwrap_or_else(|| fields::limit(&values, share));
        let color = |t: f64| if diverging { palette::diverging(t) } else { palette::sequential(t) };
        layer.coloring = Coloring::PerVertex(values.iter().map(|value| color(value / range)).collect());
        let low = if diverging { -1.0 } else { 0.0 };
        options.legend = Some(Legend {
            colors: (0..256).map(|k| color(low + (1.0 - low) * f64::from(k) / 255.0)).collect(),
            low: low * range,
            high: range,
            unit: unit.into(),
        });
    } else if let Some(colors) = colors {
        layer.coloring = Coloring::PerElement(colors);
    }
    if view.edges {
        layer.edges = Some(EdgeOverlay { color: Color::LINE, width: 1.0 });
    }
    let mut scene = Scene::default();
    scene.add_mesh(layer).add_lines(lines(polylines));
    render(&scene, &view.camera, &options)
}

/// Longest edge inside a face of known shape over the diagonal where numbers are shown.
const LONGEST: f64 = 0.02;
/// Design and non-design.
const DESIGN: [Color; 2] = [Color::STEEL, Color([176, 148, 200])];

/// Free-form, plane, hole, boss.
fn kind_color(shape: Option<&RegionShape>) -> Color {
    match shape {
        None => Color::STEEL,
        Some(RegionShape::Plane { .. }) => Color([222, 213, 193]),
        Some(RegionShape::Cylinder { hole: true, .. }) => Color([214, 122, 60]),
        Some(RegionShape::Cylinder { .. }) => Color([120, 168, 128]),
    }
}

/// A skeleton: edges as tubes, ends and junctions as balls.
pub(crate) fn skeleton(skeleton: &Skeleton, view: &View) -> Result<Image, RenderError> {
    let radius = TUBE * extent(&skeleton.points);
    let at = |point: u32| skeleton.points[point as usize];
    let degrees = skeleton.degrees();
    let nodes = (0..skeleton.points.len()).filter(|&point| degrees[point] != 2);
    let mut scene = Scene::default();
    scene
        .add_lines(LineLayer {
            polylines: skeleton.edges.iter().map(|&[a, b]| vec![at(a), at(b)]).collect(),
            coloring: Coloring::Uniform(SKELETON),
            width: LineWidth::Tube(radius),
        })
        .add_lines(LineLayer {
            polylines: nodes.map(|point| vec![skeleton.points[point]]).collect(),
            coloring: Coloring::Uniform(NODE),
            width: LineWidth::Tube(2.2 * radius),
        });
    add_over(&mut scene, view);
    render(&scene, &view.camera, &view.options)
}

/// Beams as their solid; where none can be built, as tubes.
pub(crate) fn beams(structure: &Structure, view: &View) -> Result<Image, RenderError> {
    let positions: Vec<DVec3> = structure.nodes.iter().map(|n| n.position).collect();
    let line = |beam: &topipe_beams::Beam| structure.line(beam, 16);
    let mut scene = Scene::default();
    let mesh = topipe_beams::solid::solid(structure)
        .map(|solid| topipe_beams::solid::triangulate(&solid.brep, std::f64::consts::TAU / 64.0));
    match &mesh {
        Ok(mesh) => {
            scene.add_mesh(MeshLayer {
                shading: topipe_render::Shading::Smooth { crease: 25.0 },
                coloring: Coloring::Uniform(SKELETON),
                ..MeshLayer::new(mesh)
            });
        }
        Err(_) => {
            for beam in &structure.beams {
                scene.add_lines(LineLayer {
                    polylines: vec![line(beam)],
                    coloring: Coloring::Uniform(SKELETON),
                    width: LineWidth::Tube(beam.section.radius()),
                });
            }
        }
    }
    let ball = 2.2 * TUBE * extent(&positions);
    scene.add_lines(LineLayer {
        polylines: structure.links.iter().map(|l| l.map(|n| structure.position(n)).to_vec()).collect(),
        coloring: Coloring::Uniform(NODE),
        width: LineWidth::Tube(ball / 2.2),
    });
    add_over(&mut scene, view);
    render(&scene, &view.camera, &view.options)
}

const SKELETON: Color = Color([196, 44, 56]);
const NODE: Color = Color([40, 70, 150]);

fn add_over<'a>(scene: &mut Scene<'a>, view: &'a View) {
    if let Some(part) = &view.over {
        let shading = topipe_render::Shading::Smooth { crease: 20.0 };
        scene.add_mesh(MeshLayer { opacity: 0.35, shading, ..MeshLayer::new(&part.mesh) });
    }
}

fn lines(polylines: Vec<Vec<DVec3>>) -> LineLayer {
    LineLayer { polylines, coloring: Coloring::Uniform(Color::LINE), width: LineWidth::Pixels(1.5) }
}

/// The diagonal of the box around some points.
fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    if points.is_empty() { 0.0 } else { (high - low).length() }
}
