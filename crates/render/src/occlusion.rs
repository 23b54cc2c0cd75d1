//! Ambient occlusion from the depth buffer (Bavoil, Sainz, Dimitrov 2008, horizon-based, simplified): around each
//! pixel, in a few directions, how far the neighbourhood rises above the tangent plane.

use crate::camera::Projection;
use crate::raster::Buffer;
use rayon::prelude::*;

const DIRECTIONS: usize = 12;
const STEPS: usize = 8;
/// Sine of the rise that is still taken as flat: facets of a smooth surface must not darken each other.
const BIAS: f32 = 0.12;

/// The light that reaches each pixel, 0 to 1.
pub(crate) fn ambient_occlusion(buffer: &Buffer<'_>, projection: &Projection) -> Vec<f32> {
    let s = projection.supersampling;
    let (width, height) = (projection.size[0] / s, projection.size[1] / s);
    // One depth a pixel, in pixels: that of its nearest sample.
    let depth: Vec<f32> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width * s, pixel / width * s);
            let samples = (0..s * s).map(|k| buffer.depth[(y + k / s) * buffer.width + x + k % s]);
            samples.fold(f32::NEG_INFINITY, f32::max) / s as f32
        })
        .collect();
    let reach = (projection.occlusion_reach / s as f64) as f32;
    let at = |x: i64, y: i64| {
        let inside = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
        if inside { depth[y as usize * width + x as usize] } else { f32::NEG_INFINITY }
    };
    let raw: Vec<f32> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let center = depth[pixel];
            if !center.is_finite() || reach < 1.0 {
                return 1.0;
            }
            let (x, y) = ((pixel % width) as i64, (pixel / width) as i64);
            // Slopes by the smaller one-sided difference, so that silhouettes do not tilt the plane.
            let slope = |back: f32, ahead: f32| {
                let (b, a) = (center - back, ahead - center);
                let s = if b.abs() < a.abs() { b } else { a };
                if s.is_finite() { s } else { 0.0 }
            };
            let (sx, sy) = (slope(at(x - 1, y), at(x + 1, y)), slope(at(x, y - 1), at(x, y + 1)));
            let steepness = (1.0 + sx * sx + sy * sy).sqrt();
            // A pattern of 4 x 4 turned and shifted fans, averaged out below.
            let pattern = (x & 3) * 4 + ((y + 2 * x) & 3);
            let turn = pattern as f32 / 16.0;
            let mut occluded = 0.0;
            for d in 0..DIRECTIONS {
                let angle = std::f32::consts::TAU * (d as f32 + turn) / DIRECTIONS as f32;
                let (sin, cos) = angle.sin_cos();
                let mut highest = 0.0f32;
                for k in 0..STEPS {
                    // Steps grow away from the pixel: contact shadows need the near ones.
                    let f = (k as f32 + 0.5 + 0.5 * turn) / STEPS as f32;
                    let length = 1.0 + (reach - 1.0) * f * f;
                    let (dx, dy) = ((cos * length).round(), (sin * length).round());
                    let there = at(x + dx as i64, y + dy as i64);
                    let rise = there - center;
                    let distance = (dx * dx + dy * dy + rise * rise).sqrt();
                    if distance > 0.0 && distance < reach {
                        let sine = (rise - sx * dx - sy * dy) / (steepness * distance);
                        let fade = 1.0 - (distance / reach) * (distance / reach);
                        highest = highest.max((sine - BIAS) / (1.0 - BIAS) * fade);
                    }
                }
                occluded += highest;
            }
            1.0 - occluded / DIRECTIONS as f32
        })
        .collect();
    // The mean over the pattern, of pixels at a similar depth.
    (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let center = depth[pixel];
            if !center.is_finite() {
                return 1.0;
            }
            let (x, y) = ((pixel % width) as i64, (pixel / width) as i64);
            let (mut sum, mut weight) = (0.0, 0.0);
            for (dx, dy) in (-2..3).flat_map(|dy| (-2..3).map(move |dx| (dx, dy))) {
                if (at(x + dx, y + dy) - center).abs() < 0.25 * reach + 2.0 {
                    // The outermost of the five are half pixels of a window of four.
                    let w = if dx.abs() == 2 { 0.5 } else { 1.0 } * if dy.abs() == 2 { 0.5 } else { 1.0 };
                    sum += w * raw[(y + dy) as usize * width + (x + dx) as usize];
                    weight += w;
                }
            }
            sum / weight
        })
        .collect()
}
