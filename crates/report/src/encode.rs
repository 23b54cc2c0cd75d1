//! Geometry as few bytes.
//!
//! Positions are rounded to 16 bits of the box of the scene, a value to 16 bits of its range, and everything is written as
//! the difference from what came before: neighbours in a mesh are near in its arrays, so most differences are small and
//! their high bytes zero. High and low bytes stand apart, which deflate likes. On the bracket this takes 1.9 bytes a
//! coordinate where 16 bits are kept, and 1.1 a corner of a triangle.

use crate::scene::{Categories, Field, Scene};
use base64::Engine;
use flate2::{Compression, write::DeflateEncoder};
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use topipe_mesh::DVec3;

/// A scene as a page holds it. Making it takes longer than the rest of the page, and needs nothing else of a run.
#[derive(Debug, Clone)]
pub struct EncodedScene {
    /// JSON, without anything that ends a script element.
    pub(crate) header: String,
    /// Deflated, in base 64.
    pub(crate) geometry: String,
    pub(crate) is_empty: bool,
}

impl From<&Scene> for EncodedScene {
    fn from(scene: &Scene) -> Self {
        let (header, geometry) = encode(scene);
        // In a script element only `</` and `<!--` are special; JSON may write `<` as an escape.
        let header = serde_json::to_string(&header).unwrap_or_default().replace('<', "\\u003c");
        let is_empty = scene.surfaces.is_empty() && scene.lines.is_empty() && scene.points.is_empty();
        Self { header, geometry, is_empty }
    }
}

impl Default for EncodedScene {
    fn default() -> Self {
        Self::from(&Scene::default())
    }
}

/// Where an array stands in the bytes.
#[derive(Debug, Clone, Copy, Serialize)]
struct Block {
    at: usize,
    count: usize,
}

/// What the viewer is told about the bytes.
#[derive(Debug, Serialize)]
struct Header {
    low: [f64; 3],
    high: [f64; 3],
    /// Length of the bytes when they are unpacked.
    bytes: usize,
    sequential: Vec<[u8; 3]>,
    diverging: Vec<[u8; 3]>,
    surfaces: Vec<SurfaceHeader>,
    lines: Vec<LinesHeader>,
    points: Vec<PointsHeader>,
    labels: Vec<LabelHeader>,
}

#[derive(Debug, Serialize)]
struct SurfaceHeader {
    id: String,
    name: String,
    crease: f64,
    positions: Block,
    triangles: Block,
    categories: Vec<CategoriesHeader>,
    fields: Vec<FieldHeader>,
}

#[derive(Debug, Serialize)]
struct CategoriesHeader {
    name: String,
    one: String,
    ids: Block,
    colors: Vec<[u8; 3]>,
    names: Vec<String>,
}

#[derive(Debug, Serialize)]
struct FieldHeader {
    name: String,
    unit: String,
    values: Block,
    low: f64,
    high: f64,
    diverging: bool,
    limit: f64,
}

#[derive(Debug, Serialize)]
struct LinesHeader {
    id: String,
    name: String,
    points: Block,
    segments: Block,
    color: [u8; 3],
    width: f32,
    in_front: bool,
    field: Option<FieldHeader>,
}

#[derive(Debug, Serialize)]
struct PointsHeader {
    id: String,
    name: String,
    points: Block,
    color: [u8; 3],
    size: f32,
    in_front: bool,
}

#[derive(Debug, Serialize)]
struct LabelHeader {
    at: [f64; 3],
    text: String,
}

/// Arrays one after the other.
struct Arrays {
    bytes: Vec<u8>,
    low: DVec3,
    extent: DVec3,
}

const STEPS: f64 = 65535.0;

/// Small numbers of either sign as small numbers without one: 0, -1, 1, -2 ... become 0, 1, 2, 3 ...
fn fold(difference: i16) -> u16 {
    ((difference << 1) ^ (difference >> 15)) as u16
}

impl Arrays {
    /// Differences of 16-bit numbers, all high bytes before all low bytes.
    fn differences(&mut self, values: impl Iterator<Item = u16>) {
        let mut before = 0u16;
        let folded: Vec<u16> = values
            .map(|value| fold(value.wrapping_sub(std::mem::replace(&mut before, value)) as i16))
            .collect();
        self.bytes.extend(folded.iter().map(|value| (value >> 8) as u8));
        self.bytes.extend(folded.iter().map(|value| *value as u8));
    }

    fn positions(&mut self, points: &[DVec3]) -> Block {
        let block = Block { at: self.bytes.len(), count: points.len() };
        for axis in 0..3 {
            let (low, extent) = (self.low[axis], self.extent[axis]);
            // Not a number becomes zero.
            let round = |p: &DVec3| ((p[axis] - low) / extent * STEPS).round().clamp(0.0, STEPS) as u16;
            self.differences(points.iter().map(round));
        }
        block
    }

    /// Differences of whole numbers in groups of seven bits, the lowest first.
    fn integers(&mut self, values: impl ExactSizeIterator<Item = u32>) -> Block {
        let block = Block { at: self.bytes.len(), count: values.len() };
        let mut before = 0i64;
        for value in values {
            let difference = i64::from(value) - std::mem::replace(&mut before, i64::from(value));
            let mut rest = ((difference << 1) ^ (difference >> 63)) as u64;
            while rest >= 0x80 {
                self.bytes.push(rest as u8 | 0x80);
                rest >>= 7;
            }
            self.bytes.push(rest as u8);
        }
        block
    }

    fn field(&mut self, field: &Field) -> FieldHeader {
        let finite = || field.values.iter().copied().filter(|value| value.is_finite());
        let (low, high) = finite().fold((0.0, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)));
        let range = if high > low { high - low } else { 1.0 };
        let values = Block { at: self.bytes.len(), count: field.values.len() };
        let round = |&value: &f64| {
            let value = if value.is_finite() { value } else { 0.0 };
            ((value - low) / range * STEPS).round().clamp(0.0, STEPS) as u16
        };
        self.differences(field.values.iter().map(round));
        FieldHeader {
            name: field.name.clone(),
            unit: field.unit.clone(),
            values,
            low,
            high: low + range,
            diverging: field.diverging,
            limit: field.limit,
        }
    }

    fn categories(&mut self, categories: &Categories) -> CategoriesHeader {
        // None becomes 0, and every group one more.
        let ids = categories.id_of_face.iter().map(|id| id.wrapping_add(1));
        CategoriesHeader {
            name: categories.name.clone(),
            one: categories.one.clone(),
            ids: self.integers(ids),
            colors: categories.colors.clone(),
            names: categories.names.clone(),
        }
    }
}

/// The scene as a header and its arrays, deflated and in base 64.
fn encode(scene: &Scene) -> (Header, String) {
    let (low, high) = scene.bounds();
    let extent = (high - low).map(|side| if side > 0.0 { side } else { 1.0 });
    let mut arrays = Arrays { bytes: Vec::new(), low, extent };
    let surfaces = scene
        .surfaces
        .iter()
        .map(|surface| SurfaceHeader {
            id: surface.id.clone(),
            name: surface.name.clone(),
            crease: surface.crease_deg,
            positions: arrays.positions(&surface.mesh.positions),
            triangles: {
                let corners: Vec<u32> = surface.mesh.triangles.iter().flatten().map(|v| v.0).collect();
                arrays.integers(corners.into_iter())
            },
            categories: surface.categories.iter().map(|c| arrays.categories(c)).collect(),
            fields: surface.fields.iter().map(|f| arrays.field(f)).collect(),
        })
        .collect();
    let lines = scene
        .lines
        .iter()
        .map(|lines| LinesHeader {
            id: lines.id.clone(),
            name: lines.name.clone(),
            points: arrays.positions(&lines.points),
            segments: {
                let ends: Vec<u32> = lines.segments.iter().flatten().copied().collect();
                arrays.integers(ends.into_iter())
            },
            color: lines.color,
            width: lines.width,
            in_front: lines.in_front,
            field: lines.field.as_ref().map(|field| arrays.field(field)),
        })
        .collect();
    let points = scene
        .points
        .iter()
        .map(|points| PointsHeader {
            id: points.id.clone(),
            name: points.name.clone(),
            points: arrays.positions(&points.points),
            color: points.color,
            size: points.size,
            in_front: points.in_front,
        })
        .collect();
    let label = |label: &crate::Label| LabelHeader { at: label.at.to_array(), text: label.text.clone() };
    let header = Header {
        low: low.to_array(),
        high: (low + extent).to_array(),
        bytes: arrays.bytes.len(),
        sequential: scene.color_maps.sequential.clone(),
        diverging: scene.color_maps.diverging.clone(),
        surfaces,
        lines,
        points,
        labels: scene.labels.iter().map(label).collect(),
    };
    let pieces: Vec<String> = arrays.bytes.par_chunks(PIECE).map(pack).collect();
    (header, pieces.join(" "))
}

/// Bytes that are deflated together: enough that nothing is lost by starting anew, few enough to keep threads busy.
const PIECE: usize = 1 << 19;

/// Differences are mostly literals, so searching for matches gains little: on the bell crank 6.6 MB with level 1 and 6.3 MB with
/// level 5, which takes 0.17 s of processor time more, a fifth of the whole report.
const LEVEL: u32 = 1;

fn pack(bytes: &[u8]) -> String {
    let mut deflate = DeflateEncoder::new(Vec::new(), Compression::new(LEVEL));
    // Writing to a vector does not fail.
    let packed = deflate.write_all(bytes).and_then(|()| deflate.finish()).unwrap_or_default();
    base64::engine::general_purpose::STANDARD.encode(packed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use std::io::Read;
    use topipe_mesh::TriangleMesh;

    fn unfold(value: u16) -> u16 {
        (value >> 1) ^ (value & 1).wrapping_neg()
    }

    fn numbers(bytes: &[u8], at: usize, count: usize) -> Vec<u16> {
        let mut value = 0u16;
        (0..count)
            .map(|k| {
                let folded = u16::from(bytes[at + k]) << 8 | u16::from(bytes[at + count + k]);
                value = value.wrapping_add(unfold(folded));
                value
            })
            .collect()
    }

    #[test]
    fn what_is_written_is_read_back_to_within_half_a_step() {
        let positions: Vec<[f64; 3]> = (0..500)
            .map(|k| {
                let t = f64::from(k) * 0.37;
                [70.0 * t.sin() - 3.0, 1e-3 * t, 1e3 * (2.0 * t).cos()]
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..498).map(|k| [k, 499 - k, k + 1]).collect();
        let mesh = TriangleMesh::from_arrays(positions.clone(), triangles.clone());
        let values: Vec<f64> =
            (0..500).map(|k| if k == 7 { f64::NAN } else { f64::from(k) * 0.01 - 2.0 }).collect();
        let mut surface = Surface::new("a", "A", mesh);
        let field =
            |values| Field { name: "f".into(), unit: "mm".into(), values, diverging: true, limit: 1.0 };
        surface.fields.push(field(values.clone()));
        let scene = Scene { surfaces: vec![surface], ..Scene::default() };
        let (header, text) = encode(&scene);
        let mut bytes = Vec::new();
        for piece in text.split(' ') {
            let packed = base64::engine::general_purpose::STANDARD.decode(piece).unwrap();
            flate2::read::DeflateDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        }
        assert_eq!(bytes.len(), header.bytes);
        let surface = &header.surfaces[0];
        for axis in 0..3 {
            let at = surface.positions.at + axis * 2 * positions.len();
            let step = (header.high[axis] - header.low[axis]) / STEPS;
            for (read, p) in numbers(&bytes, at, positions.len()).into_iter().zip(&positions) {
                assert!((header.low[axis] + f64::from(read) * step - p[axis]).abs() <= 0.5001 * step);
            }
        }
        let (mut at, mut value, mut corners) = (surface.triangles.at, 0i64, Vec::new());
        while corners.len() < surface.triangles.count {
            let (mut folded, mut shift) = (0u64, 0);
            loop {
                folded |= u64::from(bytes[at] & 0x7f) << shift;
                shift += 7;
                at += 1;
                if bytes[at - 1] < 0x80 {
                    break;
                }
            }
            value += (folded >> 1) as i64 ^ -((folded & 1) as i64);
            corners.push(value as u32);
        }
        assert_eq!(corners, triangles.concat());
        let field = &surface.fields[0];
        let step = (field.high - field.low) / STEPS;
        for (read, value) in numbers(&bytes, field.values.at, 500).into_iter().zip(&values) {
            let value = if value.is_finite() { *value } else { 0.0 };
            assert!((field.low + f64::from(read) * step - value).abs() <= 0.5001 * step);
        }
    }

    #[test]
    fn nothing_and_nonsense_are_encoded_without_complaint() {
        assert_eq!(encode(&Scene::default()).0.bytes, 0);
        let mesh = TriangleMesh::from_arrays(vec![[f64::NAN, f64::INFINITY, 0.0]; 3], vec![[0, 1, 2]]);
        let scene = Scene { surfaces: vec![Surface::new("a", "A", mesh)], ..Scene::default() };
        assert!(encode(&scene).0.bytes > 0);
    }
}
