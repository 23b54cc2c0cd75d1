//! Small pictures of the layers: what is seen of the model in print, without scripts, and at the first glance.

use rayon::prelude::*;
use topipe_mesh::DVec3;
use topipe_render::{
    Camera, Color, Coloring, LineLayer, LineWidth, MeshLayer, Options, RenderError, Scene, Shading, render,
};
use topipe_report::{Lines, Picture, Scene as Model, Surface};

/// Pixels. Without ambient occlusion, which would take longer than all else in a report.
const SIZE: (usize, usize) = (240, 180);
/// Radius of a drawn centre line over the diagonal of the part.
const TUBE: f64 = 0.006;

/// A picture of each surface, and of each centre line in the mesh it belongs to.
pub(super) fn pictures(model: &Model) -> Vec<Picture> {
    let surfaces = model.surfaces.par_iter().map(|surface| (&surface.name, of_surface(surface)));
    let lines: Vec<&Lines> = model.lines.iter().filter(|lines| is_center_line(lines)).collect();
    let lines = lines.into_par_iter().map(|lines| (&lines.name, of_center_line(lines, model)));
    let drawn: Vec<_> = surfaces.chain(lines).collect();
    // What cannot be drawn is in the model all the same.
    drawn.into_iter().filter_map(|(name, png)| Some(Picture { name: name.clone(), png: png.ok()? })).collect()
}

fn is_center_line(lines: &Lines) -> bool {
    lines.id == "skeleton" || lines.id.starts_with("skeleton:")
}

fn png(scene: &Scene<'_>) -> Result<Vec<u8>, RenderError> {
    let options =
        Options { width: SIZE.0, height: SIZE.1, supersampling: 2, occlusion: 0.0, ..Options::default() };
    render(scene, &Camera::ISO, &options)?.encode_png()
}

fn of_surface(surface: &Surface) -> Result<Vec<u8>, RenderError> {
    let mut layer = MeshLayer::new(&surface.mesh);
    // Triangles smaller than pixels need no normals between them, which take a third of the time.
    layer.shading = match surface.mesh.face_count() > SIZE.0 * SIZE.1 {
        true => Shading::Flat,
        false => Shading::Smooth { crease: surface.crease_deg },
    };
    if let Some(groups) = surface.categories.first() {
        let color = |id: &u32| groups.colors.get(*id as usize).map_or(Color::STEEL, |color| Color(*color));
        layer.coloring = Coloring::PerElement(groups.id_of_face.iter().map(color).collect());
    }
    let mut scene = Scene::default();
    scene.add_mesh(layer);
    png(&scene)
}

fn of_center_line(lines: &Lines, model: &Model) -> Result<Vec<u8>, RenderError> {
    let low = lines.points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = lines.points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let ends = |segment: &[u32; 2]| segment.map(|end| lines.points[end as usize]).to_vec();
    let mut scene = Scene::default();
    scene.add_lines(LineLayer {
        polylines: lines.segments.iter().map(ends).collect(),
        coloring: Coloring::Uniform(Color(lines.color)),
        width: LineWidth::Tube(TUBE * (high - low).length()),
    });
    let inside =
        ["smoothed", "original"].into_iter().find_map(|id| model.surfaces.iter().find(|s| s.id == id));
    if let Some(surface) = inside {
        let shading = Shading::Smooth { crease: 20.0 };
        scene.add_mesh(MeshLayer { opacity: 0.35, shading, ..MeshLayer::new(&surface.mesh) });
    }
    png(&scene)
}
