//! Which meshes are tessellations of CAD parts.

use topipe_mesh::TriangleMesh;

/// Above any of these a mesh is taken for a tessellation. Seventeen results of optimization, of up to a million triangles, have at most
/// 0.07, 0.042 and 16; eighteen parts as OpenCASCADE and trimesh write them exceed at least one but for two whose triangles are even: 0.33 to 1,
/// 0.19 to 0.88, or 23 to 65.
const SLENDER: f64 = 0.2;
const COARSE: f64 = 0.15;
const VALENCE: usize = 20;

/// What the triangles of a mesh are like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tessellation {
    /// The share of the surface that slender triangles have: less than half as good as an even one, 0 to 1.
    pub slender: f64,
    /// The mean of the longest sides of triangles, by area, over the square root of the surface.
    pub coarse: f64,
    /// The most triangles around one vertex.
    pub valence: usize,
}

impl Tessellation {
    /// Measures a mesh.
    pub fn measure(mesh: &TriangleMesh) -> Self {
        let (mut slender, mut longest, mut total) = (0.0, 0.0, 0.0);
        for f in mesh.faces() {
            let [a, b, c] = mesh.corners(f);
            let squares = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
            let area = mesh.area_vector(f).length() / 2.0;
            // One for an even triangle.
            let quality = 4.0 * 3f64.sqrt() * area / squares.iter().sum::<f64>();
            slender += if quality < 0.5 { area } else { 0.0 };
            longest += area * squares.into_iter().fold(0.0, f64::max).sqrt();
            total += area;
        }
        let mut around = vec![0; mesh.vertex_count()];
        mesh.triangles.as_flattened().iter().for_each(|v| around[v.index()] += 1);
        let valence = around.into_iter().max().unwrap_or(0);
        if total > 0.0 {
            Self { slender: slender / total, coarse: longest / total / total.sqrt(), valence }
        } else {
            Self { slender: 0.0, coarse: 0.0, valence }
        }
    }

    /// What a mesh is like that should be remeshed before it is smoothed; `None` for one that need not be.
    pub fn of(mesh: &TriangleMesh) -> Option<Self> {
        let measured = Self::measure(mesh);
        let asks = measured.slender > SLENDER || measured.coarse > COARSE || measured.valence > VALENCE;
        asks.then_some(measured)
    }
}

impl std::fmt::Display for Tessellation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.slender > SLENDER {
            write!(f, "{:.0} % of the surface are slender triangles", 100.0 * self.slender)
        } else if self.coarse > COARSE {
            f.write_str("it has few and large triangles")
        } else {
            write!(f, "{} triangles meet in one vertex", self.valence)
        }
    }
}
