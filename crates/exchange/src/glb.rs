//! Binary glTF 2.0 (Khronos, *glTF 2.0 Specification*, 4.4 and 3.7): one mesh, smooth up to creases, with colours.

use crate::Model;
use crate::corners::split;
use serde_json::{Value, json};
use std::io::{self, Write};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes `model` as `.glb`. Positions are f32 in mm; the node scales to metres and turns z up to y up.
pub fn glb(model: &Model<'_>, out: &mut impl Write) -> io::Result<()> {
    model.check()?;
    let corners = split(model.mesh, &model.face_colors);
    let mut bytes: Vec<u8> = Vec::new();
    let mut views: Vec<Value> = Vec::new();
    let mut view = |bytes: &[u8], buffer: &mut Vec<u8>, target: u32| {
        views.push(
            json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": bytes.len(), "target": target}),
        );
        buffer.extend_from_slice(bytes);
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        views.len() - 1
    };
    let floats = |points: &[topipe_mesh::DVec3]| -> Vec<u8> {
        points.iter().flat_map(|p| p.to_array()).flat_map(|x| (x as f32).to_le_bytes()).collect()
    };
    let count = corners.positions.len();
    let mut accessors: Vec<Value> = Vec::new();
    let mut attributes = serde_json::Map::new();
    if count > 0 {
        let as_f32 = |p: topipe_mesh::DVec3| p.to_array().map(|x| x as f32);
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in corners.positions.iter().map(|&p| as_f32(p)) {
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        let at = view(&floats(&corners.positions), &mut bytes, ARRAY_BUFFER);
        attributes.insert("POSITION".into(), accessors.len().into());
        accessors.push(json!({"bufferView": at, "componentType": FLOAT, "count": count, "type": "VEC3", "min": low, "max": high}));
        let at = view(&floats(&corners.normals), &mut bytes, ARRAY_BUFFER);
        attributes.insert("NORMAL".into(), accessors.len().into());
        accessors.push(json!({"bufferView": at, "componentType": FLOAT, "count": count, "type": "VEC3"}));
        if !corners.colors.is_empty() {
            // Colours of vertices are linear light in glTF.
            let linear = |c: u8| (255.0 * (f64::from(c) / 255.0).powf(2.2)).round() as u8;
            let colors: Vec<u8> =
                corners.colors.iter().flat_map(|c| [linear(c[0]), linear(c[1]), linear(c[2]), 255]).collect();
            let at = view(&colors, &mut bytes, ARRAY_BUFFER);
            attributes.insert("COLOR_0".into(), accessors.len().into());
            accessors.push(json!({
                "bufferView": at, "componentType": UNSIGNED_BYTE, "normalized": true, "count": count, "type": "VEC4"
            }));
        }
        let indices: Vec<u8> = corners.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let at = view(&indices, &mut bytes, ELEMENT_ARRAY_BUFFER);
        accessors.push(json!({
            "bufferView": at, "componentType": UNSIGNED_INT, "count": 3 * corners.triangles.len(), "type": "SCALAR"
        }));
    }
    let base = if corners.colors.is_empty() { [0.43, 0.51, 0.6, 1.0] } else { [1.0; 4] };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut document = json!({
        "asset": {"version": "2.0", "generator": "topipe"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": model.name, "scale": [1e-3, 1e-3, 1e-3], "rotation": [-half, 0.0, 0.0, half]}],
    });
    if count > 0 {
        document["nodes"][0]["mesh"] = 0.into();
        document["materials"] = json!([{"pbrMetallicRoughness": {"baseColorFactor": base, "metallicFactor": 0.1, "roughnessFactor": 0.6}}]);
        document["meshes"] = json!([{"name": model.name, "primitives": [{
            "attributes": attributes, "indices": accessors.len() - 1, "material": 0
        }]}]);
        document["accessors"] = accessors.into();
        document["bufferViews"] = views.into();
        document["buffers"] = json!([{"byteLength": bytes.len()}]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + if bytes.is_empty() { 0 } else { 8 + bytes.len() };
    let length = u32::try_from(length)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "glTF holds at most 4 GB"))?;
    out.write_all(b"glTF")?;
    out.write_all(&2u32.to_le_bytes())?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&(text.len() as u32).to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if !bytes.is_empty() {
        out.write_all(&(bytes.len() as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        out.write_all(&bytes)?;
    }
    Ok(())
}
