//! PLY, ASCII and binary, through `ply-rs-bw`; colours, normals and other properties are ignored.

use super::ImportError;
use super::soup::Soup;
use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Encoding, Property, PropertyAccess, PropertyAccessResult};

#[derive(Debug, Default)]
struct Vertex(DVec3);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        // A vertex without x, y or z is found by the check for finite coordinates.
        Self(DVec3::NAN)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = match property {
            Property::Char(x) => f64::from(x),
            Property::UChar(x) => f64::from(x),
            Property::Short(x) => f64::from(x),
            Property::UShort(x) => f64::from(x),
            Property::Int(x) => f64::from(x),
            Property::UInt(x) => f64::from(x),
            Property::Float(x) => f64::from(x),
            Property::Double(x) => x,
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

#[derive(Debug, Default)]
struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        // A negative index becomes one that no file has, and is named as out of range.
        let index = |x: i32| u32::try_from(x).unwrap_or(u32::MAX);
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(|x| index(i32::from(x))).collect(),
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            Property::ListShort(list) => list.into_iter().map(|x| index(i32::from(x))).collect(),
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListInt(list) => list.into_iter().map(index).collect(),
            Property::ListUInt(list) => list,
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

/// The elements of other kinds, read and left.
#[derive(Debug)]
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Reads the vertices and faces.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, ImportError> {
    let malformed = |e: ply_rs_bw::parser::ParseError| ImportError::Malformed {
        file: file.to_owned(),
        place: e.line().map_or("PLY".to_owned(), |line| format!("line {line}")),
        problem: {
            // The line stands in `place`; the message itself may have several lines.
            let message = e.to_string();
            let words = message.split_whitespace().skip(if e.line().is_some() { 2 } else { 0 });
            words.collect::<Vec<_>>().join(" ")
        },
    };
    let mut reader = Reader::new(bytes);
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(malformed)?;
    let format = match header.encoding {
        Encoding::Ascii => "PLY (ASCII)",
        Encoding::BinaryBigEndian => "PLY (binary, big endian)",
        Encoding::BinaryLittleEndian => "PLY (binary, little endian)",
    };
    let (mut positions, mut corners, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        // An element without properties takes no bytes, so that any count of it could be "read".
        let bytes_at_least = if element.properties.is_empty() { usize::MAX } else { element.count };
        if bytes_at_least > bytes.len() {
            return Err(ImportError::Truncated {
                file: file.to_owned(),
                expected: format!("{} elements \"{name}\"", element.count),
                found: format!("{} bytes", bytes.len()),
            });
        }
        match name.as_str() {
            "vertex" => {
                let read = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                positions = read.map_err(malformed)?.into_iter().map(|v| v.0).collect();
            }
            "face" => {
                let read = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                for face in read.map_err(malformed)? {
                    corners.extend(face.0);
                    ends.push(corners.len());
                }
            }
            _ => {
                Parser::<Other>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(malformed)?;
            }
        }
    }
    if ends.is_empty() {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    Soup::from_polygons(file, format, positions, &corners, &ends)
}
