//! What is drawn.

use crate::camera::Projection;
use crate::crease_normals::crease_normals;
use crate::{Color, RenderError};
use topipe_mesh::{DVec3, FaceId, TriangleMesh};

/// How the elements of a layer are coloured.
#[derive(Debug, Clone, PartialEq)]
pub enum Coloring {
    /// All alike.
    Uniform(Color),
    /// One colour per face, or per polyline.
    PerElement(Vec<Color>),
    /// One colour per vertex, interpolated over faces (meshes only).
    PerVertex(Vec<Color>),
}

/// How the facets of a mesh are lit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shading {
    /// Every facet has its own normal.
    Flat,
    /// Normals are averaged, except across edges that turn by more than `crease` degrees.
    Smooth {
        /// Degrees.
        crease: f64,
    },
}

/// Draws the edges of the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeOverlay {
    /// Colour of the edges.
    pub color: Color,
    /// Width in pixels.
    pub width: f64,
}

/// A triangle mesh.
#[derive(Debug, Clone)]
pub struct MeshLayer<'a> {
    /// The mesh.
    pub mesh: &'a TriangleMesh,
    /// Its colours.
    pub coloring: Coloring,
    /// Its shading.
    pub shading: Shading,
    /// Its edges, where they are to be seen.
    pub edges: Option<EdgeOverlay>,
    /// 1 is solid; below, the layers behind shine through.
    pub opacity: f32,
    /// Whether faces seen from behind are tinted.
    pub warn_back_faces: bool,
}

impl<'a> MeshLayer<'a> {
    /// A solid, steel-coloured mesh, smooth up to creases of 35 degrees.
    pub fn new(mesh: &'a TriangleMesh) -> Self {
        Self {
            mesh,
            coloring: Coloring::Uniform(Color::STEEL),
            shading: Shading::Smooth { crease: 35.0 },
            edges: None,
            opacity: 1.0,
            warn_back_faces: true,
        }
    }
}

/// How thick lines are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LineWidth {
    /// A flat line that many pixels wide, drawn slightly in front of the surface it lies on.
    Pixels(f64),
    /// A lit tube of that radius in millimetres.
    Tube(f64),
}

/// Polylines; one of a single point is a dot.
#[derive(Debug, Clone, PartialEq)]
pub struct LineLayer {
    /// The points of each polyline.
    pub polylines: Vec<Vec<DVec3>>,
    /// Their colours.
    pub coloring: Coloring,
    /// Their width.
    pub width: LineWidth,
}

/// A list of layers.
#[derive(Debug, Clone, Default)]
pub struct Scene<'a> {
    layers: Vec<Layer<'a>>,
}

#[derive(Debug, Clone)]
enum Layer<'a> {
    Mesh(MeshLayer<'a>),
    Lines(LineLayer),
}

impl<'a> Scene<'a> {
    /// Adds a mesh.
    pub fn add_mesh(&mut self, layer: MeshLayer<'a>) -> &mut Self {
        self.layers.push(Layer::Mesh(layer));
        self
    }

    /// Adds lines.
    pub fn add_lines(&mut self, layer: LineLayer) -> &mut Self {
        self.layers.push(Layer::Lines(layer));
        self
    }

    /// All points of the scene.
    pub(crate) fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.layers.iter().flat_map(|layer| -> Box<dyn Iterator<Item = DVec3> + '_> {
            match layer {
                Layer::Mesh(layer) => Box::new(layer.mesh.positions.iter().copied()),
                Layer::Lines(layer) => Box::new(layer.polylines.iter().flatten().copied()),
            }
        })
    }

    /// Every layer has as many colours as it needs.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        for (index, layer) in self.layers.iter().enumerate() {
            let (coloring, elements, vertices) = match layer {
                Layer::Mesh(layer) => (&layer.coloring, layer.mesh.face_count(), layer.mesh.vertex_count()),
                Layer::Lines(layer) => (&layer.coloring, layer.polylines.len(), layer.polylines.len()),
            };
            let (colors, elements, what) = match coloring {
                Coloring::Uniform(_) => continue,
                Coloring::PerElement(colors) => (colors.len(), elements, "faces or polylines"),
                Coloring::PerVertex(colors) => (colors.len(), vertices, "vertices or polylines"),
            };
            if colors != elements {
                return Err(RenderError::ColorCount { layer: index, colors, elements, what });
            }
        }
        Ok(())
    }

    pub(crate) fn project(&self, projection: &Projection) -> Vec<ProjectedLayer<'_>> {
        self.layers
            .iter()
            .map(|layer| match layer {
                Layer::Mesh(layer) => layer.project(projection),
                Layer::Lines(layer) => layer.project(projection),
            })
            .collect()
    }
}

/// What the rasterizer draws. Points are in samples.
#[derive(Debug, Clone)]
pub(crate) enum Primitive {
    Triangle {
        points: [DVec3; 3],
    },
    /// A segment with round ends.
    Capsule {
        ends: [DVec3; 2],
        radius: f64,
        /// How much nearer to the viewer it is drawn than it is; 0 for a tube, which bulges instead.
        lift: f64,
        tube: bool,
        color: [f32; 3],
    },
}

/// What the light falls on: normals in view coordinates and colours in linear light, at the corners of a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    pub(crate) normals: [DVec3; 3],
    pub(crate) colors: [[f32; 3]; 3],
}

/// A layer in the picture. Triangles are put together when they are asked for: kept, those of a fine surface would take more memory than
/// all else, and most of them are not seen.
#[derive(Debug)]
pub(crate) struct ProjectedLayer<'a> {
    shape: Shape<'a>,
    pub(crate) opacity: f32,
    /// Colour and half width in samples of the edges of triangles.
    pub(crate) edges: Option<([f32; 3], f64)>,
    pub(crate) warn_back_faces: bool,
}

#[derive(Debug)]
enum Shape<'a> {
    Mesh {
        layer: &'a MeshLayer<'a>,
        /// The vertices in samples.
        points: Vec<DVec3>,
    },
    Capsules(Vec<Primitive>),
}

impl ProjectedLayer<'_> {
    /// Number of primitives.
    pub(crate) fn len(&self) -> usize {
        match &self.shape {
            Shape::Mesh { layer, .. } => layer.mesh.face_count(),
            Shape::Capsules(capsules) => capsules.len(),
        }
    }

    /// A primitive; none where a corner has no place.
    #[inline]
    pub(crate) fn primitive(&self, index: usize) -> Option<Primitive> {
        match &self.shape {
            Shape::Mesh { layer, points } => {
                let triangle = layer.mesh.triangles[index];
                if triangle.iter().any(|v| v.index() >= points.len()) {
                    return None;
                }
                let points = triangle.map(|v| points[v.index()]);
                points.iter().all(|p| p.is_finite()).then_some(Primitive::Triangle { points })
            }
            Shape::Capsules(capsules) => capsules.get(index).cloned(),
        }
    }

    /// The looks of some triangles, ascending; of other primitives none.
    pub(crate) fn looks(&self, seen: &[u32], projection: &Projection) -> Vec<Look> {
        let Shape::Mesh { layer, .. } = &self.shape else { return Vec::new() };
        let mesh = layer.mesh;
        let normals = match layer.shading {
            Shading::Flat => seen.iter().map(|&f| [mesh.normal(FaceId(f)); 3]).collect(),
            Shading::Smooth { crease } => crease_normals(mesh, crease, seen),
        };
        let look = |(&f, normals): (&u32, [DVec3; 3])| Look {
            normals: normals.map(|n| projection.direction(n)),
            colors: match &layer.coloring {
                Coloring::PerVertex(colors) => {
                    mesh.triangles[f as usize].map(|v| colors[v.index()].to_linear())
                }
                coloring => [coloring.element(f as usize); 3],
            },
        };
        seen.iter().zip(normals).map(look).collect()
    }
}

impl Coloring {
    fn element(&self, index: usize) -> [f32; 3] {
        match self {
            Self::Uniform(color) => color.to_linear(),
            Self::PerElement(colors) | Self::PerVertex(colors) => colors[index].to_linear(),
        }
    }
}

impl MeshLayer<'_> {
    fn project(&self, projection: &Projection) -> ProjectedLayer<'_> {
        let points = self.mesh.positions.iter().map(|&p| projection.point(p)).collect();
        let half_width = |width: f64| width * projection.supersampling as f64 / 2.0;
        ProjectedLayer {
            shape: Shape::Mesh { layer: self, points },
            opacity: self.opacity.clamp(0.0, 1.0),
            edges: self.edges.map(|e| (e.color.to_linear(), half_width(e.width))),
            warn_back_faces: self.warn_back_faces,
        }
    }
}

impl LineLayer {
    fn project(&self, projection: &Projection) -> ProjectedLayer<'_> {
        let (radius, tube) = match self.width {
            LineWidth::Pixels(width) => (width * projection.supersampling as f64 / 2.0, false),
            LineWidth::Tube(radius) => (radius * projection.scale, true),
        };
        // A line on a surface seen at a slant would be half buried: lift it by a little more than its own width.
        let lift = if tube { 0.0 } else { 3.0 * radius };
        let mut primitives = Vec::new();
        for (index, line) in self.polylines.iter().enumerate() {
            let color = self.coloring.element(index);
            let points: Vec<DVec3> = line.iter().map(|&p| projection.point(p)).collect();
            let mut push = |a: DVec3, b: DVec3| {
                if a.is_finite() && b.is_finite() && radius.is_finite() && radius > 0.0 {
                    primitives.push(Primitive::Capsule { ends: [a, b], radius, lift, tube, color });
                }
            };
            if let [point] = points[..] {
                push(point, point);
            }
            points.windows(2).for_each(|pair| push(pair[0], pair[1]));
        }
        let shape = Shape::Capsules(primitives);
        ProjectedLayer { shape, opacity: 1.0, edges: None, warn_back_faces: false }
    }
}
