//! The model: surfaces, lines, points and labels, each a layer that can be shown or hidden.

use topipe_mesh::{DVec3, TriangleMesh};

/// Everything that can be shown. Lengths in mm.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Surfaces.
    pub surfaces: Vec<Surface>,
    /// Lines.
    pub lines: Vec<Lines>,
    /// Points.
    pub points: Vec<Points>,
    /// Texts at places.
    pub labels: Vec<Label>,
    /// How numbers become colours.
    pub color_maps: ColorMaps,
}

/// Two maps from numbers to colours, as colours at even steps.
#[derive(Debug, Clone, Default)]
pub struct ColorMaps {
    /// From the smallest value to the largest.
    pub sequential: Vec<[u8; 3]>,
    /// From negative over zero to positive.
    pub diverging: Vec<[u8; 3]>,
}

/// A triangle mesh.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Identifies the layer.
    pub id: String,
    /// Names it for people.
    pub name: String,
    /// The mesh.
    pub mesh: TriangleMesh,
    /// Normals are averaged, except across edges that turn by more than so many degrees.
    pub crease_deg: f64,
    /// Groups of faces that may be told apart by colour.
    pub categories: Vec<Categories>,
    /// Numbers at the vertices that may be shown as colours.
    pub fields: Vec<Field>,
}

impl Surface {
    /// A surface without categories and fields, smooth up to creases of 35 degrees.
    pub fn new(id: &str, name: &str, mesh: TriangleMesh) -> Self {
        Self {
            id: id.into(),
            name: name.into(),
            mesh,
            crease_deg: 35.0,
            categories: Vec::new(),
            fields: Vec::new(),
        }
    }
}

/// Faces in groups.
#[derive(Debug, Clone)]
pub struct Categories {
    /// Names the grouping: "Tiles".
    pub name: String,
    /// Names one group: "tile".
    pub one: String,
    /// The group of each face, `u32::MAX` for none.
    pub id_of_face: Vec<u32>,
    /// The colour of each group.
    pub colors: Vec<[u8; 3]>,
    /// What is to be said about each group; may be empty.
    pub names: Vec<String>,
}

/// A number at each vertex.
#[derive(Debug, Clone)]
pub struct Field {
    /// Names it: "Distance from the original".
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// One per vertex. What is not finite counts as zero.
    pub values: Vec<f64>,
    /// Whether zero is in the middle.
    pub diverging: bool,
    /// The value at the end of the colours, beyond which they no longer change.
    pub limit: f64,
}

/// Polylines of one kind.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Identifies the layer.
    pub id: String,
    /// Names it.
    pub name: String,
    /// The points.
    pub points: Vec<DVec3>,
    /// Pairs of points.
    pub segments: Vec<[u32; 2]>,
    /// Colour where there is no field.
    pub color: [u8; 3],
    /// Width in pixels.
    pub width: f32,
    /// Seen through surfaces.
    pub in_front: bool,
    /// Numbers at the points.
    pub field: Option<Field>,
}

/// Dots.
#[derive(Debug, Clone)]
pub struct Points {
    /// Identifies the layer.
    pub id: String,
    /// Names it.
    pub name: String,
    /// Where.
    pub points: Vec<DVec3>,
    /// Their colour.
    pub color: [u8; 3],
    /// Diameter in pixels.
    pub size: f32,
    /// Seen through surfaces.
    pub in_front: bool,
}

/// A text at a place.
#[derive(Debug, Clone)]
pub struct Label {
    /// Where.
    pub at: DVec3,
    /// What.
    pub text: String,
}

impl Scene {
    /// The box around everything; a unit box where there is nothing.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let surfaces = self.surfaces.iter().flat_map(|surface| &surface.mesh.positions);
        let lines = self.lines.iter().flat_map(|lines| &lines.points);
        let points = self.points.iter().flat_map(|points| &points.points);
        for &p in surfaces.chain(lines).chain(points).filter(|p| p.is_finite()) {
            (low, high) = (low.min(p), high.max(p));
        }
        if low.is_finite() { (low, high) } else { (DVec3::ZERO, DVec3::ONE) }
    }
}
