//! Primitives to samples: for each sample the depth and the primitive that is nearest to the viewer.

use crate::camera::Projection;
use crate::scene::{Look, Primitive, ProjectedLayer};
use rayon::prelude::*;
use topipe_mesh::DVec3;

/// Rows of samples that are rasterized as one piece of work.
const BAND: usize = 48;

/// Depth and primitive of each sample.
pub(crate) struct Buffer<'a> {
    layers: Vec<&'a ProjectedLayer<'a>>,
    /// Index of the first primitive of each layer, and the total.
    first: Vec<u32>,
    pub(crate) width: usize,
    /// Towards the viewer, in samples; negative infinity where nothing is.
    pub(crate) depth: Vec<f32>,
    primitive: Vec<u32>,
    /// Of each primitive its place among the looks of its layer.
    place: Vec<u32>,
    /// The looks of what is seen, by layer.
    looks: Vec<Vec<Look>>,
}

impl<'a> Buffer<'a> {
    /// The primitive seen at a sample, its layer, and its look, if it is a triangle.
    pub(crate) fn at(&self, sample: usize) -> Option<(&'a ProjectedLayer<'a>, Primitive, Option<&Look>)> {
        let primitive = self.primitive[sample];
        if primitive == u32::MAX {
            return None;
        }
        let layer = self.layer_of(primitive);
        let within = (primitive - self.first[layer]) as usize;
        let look = self.looks[layer].get(self.place[primitive as usize] as usize);
        Some((self.layers[layer], self.layers[layer].primitive(within)?, look))
    }

    fn layer_of(&self, primitive: u32) -> usize {
        self.first.partition_point(|&first| first <= primitive) - 1
    }

    /// Finds the looks of all that is seen.
    fn look(&mut self, projection: &Projection) {
        let mut seen = vec![false; self.place.len()];
        self.primitive.iter().filter(|p| **p != u32::MAX).for_each(|&p| seen[p as usize] = true);
        for (k, layer) in self.layers.iter().enumerate() {
            let own = self.first[k]..self.first[k + 1];
            let seen: Vec<u32> = own.filter(|&p| seen[p as usize]).collect();
            for (place, &primitive) in seen.iter().enumerate() {
                self.place[primitive as usize] = place as u32;
            }
            let seen: Vec<u32> = seen.into_iter().map(|p| p - self.first[k]).collect();
            self.looks.push(layer.looks(&seen, projection));
        }
    }
}

/// Barycentric weights of the sample point `(x, y)`, if the triangle is not seen edge on.
pub(crate) fn barycentric(points: &[DVec3; 3], x: f64, y: f64) -> Option<[f64; 3]> {
    let [a, b, c] = points;
    let double_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if double_area == 0.0 {
        return None;
    }
    let w1 = ((x - a.x) * (c.y - a.y) - (y - a.y) * (c.x - a.x)) / double_area;
    let w2 = ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) / double_area;
    Some([1.0 - w1 - w2, w1, w2])
}

/// Position along the segment (0 to 1) nearest to `(x, y)` in the picture, and the squared distance there.
pub(crate) fn along_segment(ends: &[DVec3; 2], x: f64, y: f64) -> (f64, f64) {
    let (dx, dy) = (ends[1].x - ends[0].x, ends[1].y - ends[0].y);
    let length_squared = dx * dx + dy * dy;
    let t = if length_squared > 0.0 {
        (((x - ends[0].x) * dx + (y - ends[0].y) * dy) / length_squared).clamp(0.0, 1.0)
    } else if ends[0].z >= ends[1].z {
        0.0
    } else {
        1.0
    };
    let (px, py) = (ends[0].x + t * dx - x, ends[0].y + t * dy - y);
    (t, px * px + py * py)
}

impl Primitive {
    /// Bounds in the picture: low x, high x, low y, high y.
    fn bounds(&self) -> [f64; 4] {
        let (low, high) = match self {
            Self::Triangle { points: [a, b, c] } => (a.min(*b).min(*c), a.max(*b).max(*c)),
            Self::Capsule { ends: [a, b], radius, .. } => (a.min(*b) - *radius, a.max(*b) + *radius),
        };
        [low.x, high.x, low.y, high.y]
    }

    fn depth(&self, x: f64, y: f64) -> Option<f64> {
        match self {
            Self::Triangle { points } => {
                let w = barycentric(points, x, y)?;
                let inside = w.iter().all(|&w| w >= 0.0);
                inside.then(|| w[0] * points[0].z + w[1] * points[1].z + w[2] * points[2].z)
            }
            Self::Capsule { ends, radius, lift, tube, .. } => {
                let (t, distance_squared) = along_segment(ends, x, y);
                let bulge = radius * radius - distance_squared;
                (bulge >= 0.0).then(|| {
                    let axis = ends[0].z + t * (ends[1].z - ends[0].z);
                    axis + if *tube { bulge.sqrt() } else { *lift }
                })
            }
        }
    }
}

/// The samples whose centres (at k + 1/2) lie in `[low, high]`, cut to `[first, end)`.
fn samples(low: f64, high: f64, first: usize, end: usize) -> std::ops::Range<usize> {
    let from = (low - 0.5).ceil().clamp(first as f64, end as f64) as usize;
    let to = ((high - 0.5).floor() + 1.0).clamp(from as f64, end as f64) as usize;
    from..to
}

/// Draws all layers into one buffer.
pub(crate) fn rasterize<'a>(layers: &[&'a ProjectedLayer<'a>], projection: &Projection) -> Buffer<'a> {
    let [width, height] = projection.size;
    let mut first = vec![0u32];
    // By band the primitives in it, each with its layer.
    let mut bands: Vec<Vec<(u32, u32)>> = vec![Vec::new(); height.div_ceil(BAND)];
    let mut count = 0u32;
    for (number, layer) in layers.iter().enumerate() {
        for index in 0..layer.len() {
            if let Some(primitive) = layer.primitive(index) {
                let [low_x, high_x, low_y, high_y] = primitive.bounds();
                let rows = samples(low_y, high_y, 0, height);
                if !rows.is_empty() && !samples(low_x, high_x, 0, width).is_empty() {
                    for band in &mut bands[rows.start / BAND..=(rows.end - 1) / BAND] {
                        band.push((count, number as u32));
                    }
                }
            }
            count += 1;
        }
        first.push(count);
    }
    let mut depth = vec![f32::NEG_INFINITY; width * height];
    let mut nearest = vec![u32::MAX; width * height];
    let rows = depth.par_chunks_mut(width * BAND).zip(nearest.par_chunks_mut(width * BAND)).zip(&bands);
    rows.enumerate().for_each(|(band, ((depth, nearest), primitives))| {
        let top = band * BAND;
        for &(number, layer) in primitives {
            let within = number - first[layer as usize];
            let Some(primitive) = layers[layer as usize].primitive(within as usize) else { continue };
            let [low_x, high_x, low_y, high_y] = primitive.bounds();
            let columns = samples(low_x, high_x, 0, width);
            for y in samples(low_y, high_y, top, top + depth.len() / width) {
                for x in columns.clone() {
                    if let Some(z) = primitive.depth(x as f64 + 0.5, y as f64 + 0.5) {
                        let at = (y - top) * width + x;
                        if z as f32 > depth[at] {
                            depth[at] = z as f32;
                            nearest[at] = number;
                        }
                    }
                }
            }
        }
    });
    let place = vec![u32::MAX; count as usize];
    let layers = layers.to_vec();
    let mut buffer = Buffer { layers, first, width, depth, primitive: nearest, place, looks: Vec::new() };
    buffer.look(projection);
    buffer
}
