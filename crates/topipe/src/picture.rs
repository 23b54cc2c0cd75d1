//! How each kind of artifact is drawn.

use topipe_beams::Structure;
use topipe_mesh::{Connectivity, DVec3, Part, TriangleMesh};
use topipe_quad_matching::QuadLayout;
use topipe_render::{
    Camera, Color, Coloring, Image, LineLayer, LineWidth, MeshLayer, Options, RenderError, Scene, palette,
    render,
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
}

impl Default for View {
    fn default() -> Self {
        Self { camera: Camera::ISO, options: Options::default(), over: None }
    }
}

/// Largest distance of a drawn surface from the true one over its diagonal: less than a pixel.
const CHORD: f64 = 2e-4;
/// Radius of a drawn skeleton over its diagonal.
const TUBE: f64 = 0.004;

/// A mesh, lit; a color for each region of known shape, and their borders.
pub(crate) fn mesh(part: &Part, view: &View) -> Result<Image, RenderError> {
    if part.regions.is_empty() {
        return render(Scene::default().add_mesh(MeshLayer::new(&part.mesh)), &view.camera, &view.options);
    }
    let regions: Vec<u32> = part.region_of_face.iter().map(|region| region.0).collect();
    let mut borders = Vec::new();
    if let Ok(connectivity) = Connectivity::build(&part.mesh) {
        for h in connectivity.edges() {
            let twin = connectivity.twin(h);
            if twin.is_some() && regions[h.face().index()] != regions[twin.face().index()] {
                let ends = [connectivity.origin(h), connectivity.target(h)];
                borders.push(ends.map(|v| part.mesh.position(v)).to_vec());
            }
        }
    }
    let mut scene = Scene::default();
    scene.add_mesh(by_id(&part.mesh, &regions)).add_lines(lines(borders));
    render(&scene, &view.camera, &view.options)
}

/// A mesh with a color for each tile.
pub(crate) fn tiling(tiling: &Tiling, view: &View) -> Result<Image, RenderError> {
    let tiles: Vec<u32> = tiling.tile_of_face.iter().map(|tile| tile.0).collect();
    render(Scene::default().add_mesh(by_id(&tiling.part.mesh, &tiles)), &view.camera, &view.options)
}

/// A mesh with a color for each quad, and the sides of the quads.
pub(crate) fn layout(layout: &QuadLayout, view: &View) -> Result<Image, RenderError> {
    let mesh = &layout.part.mesh;
    let sides =
        layout.edges.iter().map(|edge| edge.path.iter().map(|&v| mesh.position(v)).collect()).collect();
    let mut scene = Scene::default();
    scene.add_mesh(by_id(mesh, &layout.quad_of_face)).add_lines(lines(sides));
    render(&scene, &view.camera, &view.options)
}

/// A surface and the edges of its patches.
pub(crate) fn surface(surface: &SplineSurface, view: &View) -> Result<Image, RenderError> {
    let mesh = surface.tessellate(CHORD * extent(&surface.vertices));
    let edges = surface.edges.iter();
    let edges = edges.map(|edge| (0..=32).map(|k| edge.position(f64::from(k) / 32.0)).collect()).collect();
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer::new(&mesh)).add_lines(lines(edges));
    render(&scene, &view.camera, &view.options)
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

fn by_id<'a>(mesh: &'a TriangleMesh, ids: &[u32]) -> MeshLayer<'a> {
    let coloring = Coloring::PerElement(palette::categorical_faces(mesh, ids));
    MeshLayer { coloring, ..MeshLayer::new(mesh) }
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
