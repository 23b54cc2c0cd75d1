//! Light on samples, and samples to pixels.

use crate::camera::Projection;
use crate::raster::{Buffer, along_segment, barycentric};
use crate::scene::{Look, Primitive, ProjectedLayer};
use crate::{Color, Image, Options};
use rayon::prelude::*;
use topipe_mesh::DVec3;

/// Direction to the main light in view coordinates (right, up, towards the viewer) and its share. It moves with the
/// viewer, so every view of a part is lit alike.
const KEY: (DVec3, f32) = (DVec3::new(-0.42, 0.62, 0.66), 0.62);
/// A weak light from the other side, which keeps shapes readable in the shadow.
const FILL: (DVec3, f32) = (DVec3::new(0.75, 0.05, 0.66), 0.20);
/// Light from above and from below, for normals that point there.
const SKY: f32 = 0.44;
const GROUND: f32 = 0.24;

/// Colour of one sample and how much of what lies behind it is hidden.
struct Shaded {
    color: [f32; 3],
    alpha: f32,
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
}

/// `light` is the share of ambient light that reaches the point.
fn lit(base: [f32; 3], normal: DVec3, light: f32) -> [f32; 3] {
    let sky = GROUND + (SKY - GROUND) * (0.5 + 0.5 * normal.y as f32);
    let lambert = |(direction, share): (DVec3, f32)| share * normal.dot(direction).max(0.0) as f32;
    // Direct light is dimmed less than ambient light: the horizon says nothing about the key light itself.
    let brightness = sky * light + (lambert(KEY) + lambert(FILL)) * (0.45 + 0.55 * light);
    let half = (KEY.0 + DVec3::Z).normalize();
    let gloss = 0.10 * (normal.dot(half).max(0.0) as f32).powi(40) * light;
    base.map(|c| c * brightness + gloss)
}

fn shade_sample(
    (layer, primitive, look): (&ProjectedLayer<'_>, Primitive, Option<&Look>),
    [x, y]: [f64; 2],
    light: f32,
) -> Shaded {
    match &primitive {
        Primitive::Triangle { points } => {
            let Some(Look { normals, colors }) = look else { return Shaded { color: [0.0; 3], alpha: 0.0 } };
            // The rasterizer found the sample inside the triangle, so it has an area.
            let w = barycentric(points, x, y).unwrap_or([1.0, 0.0, 0.0]);
            let [a, b, c] = points;
            let mut normal = (normals[0] * w[0] + normals[1] * w[1] + normals[2] * w[2]).normalize_or_zero();
            let mut base: [f32; 3] = std::array::from_fn(|k| {
                colors[0][k] * w[0] as f32 + colors[1][k] * w[1] as f32 + colors[2][k] * w[2] as f32
            });
            let double_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
            // Rows run downwards, so a face turned to the viewer is clockwise here.
            let from_behind = double_area > 0.0;
            if from_behind {
                normal = -normal;
                if layer.warn_back_faces {
                    base = mix(base, Color::WARNING.to_linear(), 0.8);
                }
            }
            if normal.z < 0.0 {
                // An averaged normal may turn away at the silhouette of a coarse mesh.
                normal = DVec3::new(normal.x, normal.y, 0.0).normalize_or(DVec3::Z);
            }
            let mut color = lit(base, normal, light);
            if let Some((edge_color, half_width)) = layer.edges {
                let on_edge = (0..3).any(|k| {
                    let (p, q) = (points[(k + 1) % 3], points[(k + 2) % 3]);
                    let length = (q - p).truncate().length();
                    w[k] * double_area.abs() < half_width * length
                });
                if on_edge {
                    color = mix(color, edge_color, 0.6);
                }
            }
            // Glass: what is seen at a slant hides more.
            let slant = 1.0 - normal.z.clamp(0.0, 1.0) as f32;
            let alpha = layer.opacity + (1.0 - layer.opacity) * 0.7 * slant.powi(3);
            Shaded { color, alpha }
        }
        Primitive::Capsule { ends, radius, tube, color, .. } => {
            if !tube {
                return Shaded { color: *color, alpha: layer.opacity };
            }
            let (t, distance_squared) = along_segment(ends, x, y);
            let axis = ends[0] + (ends[1] - ends[0]) * t;
            let bulge = (radius * radius - distance_squared).max(0.0).sqrt();
            let normal = DVec3::new(x - axis.x, axis.y - y, bulge).normalize_or(DVec3::Z);
            Shaded { color: lit(*color, normal, light), alpha: layer.opacity }
        }
    }
}

/// Shades every sample and averages those of a pixel.
pub(crate) fn shade(
    solid: &Buffer<'_>,
    translucent: &[Buffer<'_>],
    occlusion: Option<&[f32]>,
    projection: &Projection,
    options: &Options,
) -> Image {
    let s = projection.supersampling;
    let (width, height) = (options.width, options.height);
    let background = options.background.to_linear();
    let pixel = |index: usize| {
        let (left, top) = (index % width * s, index / width * s);
        let light =
            occlusion.map_or(1.0, |light| 1.0 - options.occlusion.clamp(0.0, 1.0) * (1.0 - light[index]));
        let mut sum = [0.0f32; 3];
        let mut hit = false;
        for k in 0..s * s {
            let (x, y) = (left + k % s, top + k / s);
            let sample = y * solid.width + x;
            let center = [x as f64 + 0.5, y as f64 + 0.5];
            let mut color = background;
            if let Some(seen) = solid.at(sample) {
                color = shade_sample(seen, center, light).color;
                hit = true;
            }
            for buffer in translucent {
                let in_front = buffer.depth[sample] > solid.depth[sample];
                if let (true, Some(seen)) = (in_front, buffer.at(sample)) {
                    let over = shade_sample(seen, center, 1.0);
                    color = mix(color, over.color, over.alpha);
                    hit = true;
                }
            }
            sum = std::array::from_fn(|c| sum[c] + color[c]);
        }
        if !hit {
            return options.background;
        }
        Color::from_linear(sum.map(|c| c / (s * s) as f32))
    };
    Image::from_pixels(width, height, (0..width * height).into_par_iter().map(pixel).collect())
}
