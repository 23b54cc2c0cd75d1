//! VTK's XML files as optimizers write them: unstructured grids (VTU) and images (VTI) with one number per cell or point.
//!
//! Arrays as text, as base64, or appended (raw or base64), plain or in zlib blocks; little endian.

use super::ImportError;
use super::soup::{excerpt, number, words};
use flate2::read::ZlibDecoder;
use std::io::Read;

/// An XML element's start tag.
#[derive(Debug, Clone)]
struct Tag<'a> {
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    /// What follows up to the next tag.
    text: &'a [u8],
}

impl<'a> Tag<'a> {
    fn get(&self, name: &str) -> Option<&'a str> {
        self.attributes.iter().find(|(n, _)| *n == name).map(|(_, value)| *value)
    }
}

/// A data array that is not decoded yet.
#[derive(Debug, Clone)]
struct Array<'a> {
    /// Points, Cells, CellData or PointData.
    group: &'a str,
    tag: Tag<'a>,
}

/// A file.
pub(super) struct VtkFile<'a> {
    file: &'a str,
    /// UnstructuredGrid or ImageData.
    pub(super) kind: &'a str,
    tags: Vec<Tag<'a>>,
    arrays: Vec<Array<'a>>,
    /// Bytes of a length: 4 or 8.
    header: usize,
    compressed: bool,
    /// What stands after the underscore, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
}

/// Whether the content is such a file.
pub(super) fn looks_like(start: &[u8]) -> bool {
    let head = &start[..start.len().min(1000)];
    head.windows(8).any(|w| w == b"<VTKFile")
}

impl<'a> VtkFile<'a> {
    fn wrong(&self, place: impl Into<String>, problem: impl Into<String>) -> ImportError {
        ImportError::Malformed { file: self.file.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// Reads the tags; arrays are decoded when they are asked for.
    pub(super) fn parse(file: &'a str, bytes: &'a [u8]) -> Result<Self, ImportError> {
        let mut vtk = Self {
            file,
            kind: "",
            tags: Vec::new(),
            arrays: Vec::new(),
            header: 4,
            compressed: false,
            appended: None,
        };
        let (mut at, mut group) = (0, "");
        while let Some(start) = bytes[at..].iter().position(|&b| b == b'<').map(|k| at + k) {
            let Some(end) = bytes[start..].iter().position(|&b| b == b'>').map(|k| start + k) else { break };
            let next = bytes[end..].iter().position(|&b| b == b'<').map_or(bytes.len(), |k| end + k);
            at = next;
            let Ok(inside) = std::str::from_utf8(&bytes[start + 1..end]) else {
                return Err(vtk.wrong(format!("byte {start}"), "a tag is no text"));
            };
            if inside.starts_with(['?', '!', '/']) {
                continue;
            }
            let name = inside.split([' ', '\t', '\r', '\n', '/']).next().unwrap_or("");
            let tag =
                Tag { name, attributes: attributes(&inside[name.len()..]), text: &bytes[end + 1..next] };
            match name {
                "VTKFile" => {
                    if tag.get("byte_order") == Some("BigEndian") {
                        return Err(
                            vtk.wrong("VTKFile", "big-endian files are not read; save it as little endian")
                        );
                    }
                    vtk.kind = tag.get("type").unwrap_or("");
                    vtk.header = if tag.get("header_type") == Some("UInt64") { 8 } else { 4 };
                    match tag.get("compressor") {
                        None | Some("") => {}
                        Some("vtkZLibDataCompressor") => vtk.compressed = true,
                        Some(other) => {
                            return Err(vtk.wrong(
                                "VTKFile",
                                format!("{} is not read; save it with zlib", excerpt(other.as_bytes())),
                            ));
                        }
                    }
                }
                "Points" | "Cells" | "CellData" | "PointData" => group = name,
                "DataArray" => vtk.arrays.push(Array { group, tag: tag.clone() }),
                "AppendedData" => {
                    let base64 = tag.get("encoding") == Some("base64");
                    let data = &bytes[end + 1..];
                    let start = data.iter().position(|&b| b == b'_').map_or(data.len(), |k| k + 1);
                    vtk.appended = Some((&data[start..], base64));
                    vtk.tags.push(tag);
                    break;
                }
                _ => {}
            }
            vtk.tags.push(tag);
        }
        Ok(vtk)
    }

    /// An attribute of the first element with this name.
    pub(super) fn attribute(&self, element: &str, name: &str) -> Result<&'a str, ImportError> {
        let tag = self.tags.iter().find(|tag| tag.name == element);
        tag.and_then(|tag| tag.get(name)).ok_or_else(|| self.wrong(element, format!("{name} is missing")))
    }

    /// The same as whole or real numbers.
    pub(super) fn numbers(&self, element: &str, name: &str) -> Result<Vec<f64>, ImportError> {
        let text = self.attribute(element, name)?;
        let all: Option<Vec<f64>> = words(text.as_bytes()).map(number).collect();
        all.ok_or_else(|| self.wrong(element, format!("{name} is not a list of numbers")))
    }

    /// How many elements have this name.
    pub(super) fn count(&self, element: &str) -> usize {
        self.tags.iter().filter(|tag| tag.name == element).count()
    }

    /// Names of the arrays of one number per item.
    pub(super) fn scalars(&self, group: &str) -> Vec<&'a str> {
        let one =
            |a: &&Array<'a>| a.group == group && a.tag.get("NumberOfComponents").is_none_or(|n| n == "1");
        self.arrays.iter().filter(one).filter_map(|a| a.tag.get("Name")).collect()
    }

    /// The array of a group, by name or, without one, the first. `count` is how many numbers there must be at the most.
    pub(super) fn array(
        &self,
        group: &str,
        name: Option<&str>,
        count: usize,
    ) -> Result<Vec<f64>, ImportError> {
        let array =
            self.arrays.iter().find(|a| a.group == group && (name.is_none() || a.tag.get("Name") == name));
        let what = format!("{group} {}", name.unwrap_or_default());
        let Some(array) = array else { return Err(self.wrong(what, "there is no such array")) };
        let tag = &array.tag;
        let width = match tag.get("type") {
            Some("Int8" | "UInt8") => 1,
            Some("Int16" | "UInt16") => 2,
            Some("Int32" | "UInt32" | "Float32") => 4,
            Some("Int64" | "UInt64" | "Float64") => 8,
            _ => return Err(self.wrong(what, "its type is none that is read")),
        };
        let most = count.saturating_mul(width);
        let bytes = match tag.get("format") {
            Some("ascii") | None => {
                let values: Option<Vec<f64>> = words(tag.text).take(count + 1).map(number).collect();
                return values.ok_or_else(|| self.wrong(what, "it holds something that is no number"));
            }
            Some("binary") => {
                let text: Vec<u8> = tag.text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect();
                self.blocks(&Base64(&text), most, &what)?
            }
            Some("appended") => {
                let offset = tag.get("offset").and_then(|o| o.parse::<usize>().ok());
                let data =
                    self.appended.zip(offset).and_then(|((data, base64), o)| Some((data.get(o..)?, base64)));
                match data {
                    Some((data, false)) => self.blocks(&Raw(data), most, &what)?,
                    Some((data, true)) => self.blocks(&Base64(data), most, &what)?,
                    None => return Err(self.wrong(what, "its offset points beyond the file")),
                }
            }
            _ => return Err(self.wrong(what, "its format is none that is read")),
        };
        let kind = tag.get("type").unwrap_or("");
        Ok(bytes.chunks_exact(width).map(|b| value(kind, b)).collect())
    }

    /// Undoes compression. At most `most` bytes are made, and never more than a thousand times the compressed ones.
    fn blocks(&self, source: &dyn Encoded, most: usize, what: &str) -> Result<Vec<u8>, ImportError> {
        let cut = || self.wrong(what, "the data are cut off or damaged");
        let h = self.header;
        let length = |bytes: &[u8]| {
            let mut word = [0; 8];
            word[..h].copy_from_slice(&bytes[..h]);
            usize::try_from(u64::from_le_bytes(word)).unwrap_or(usize::MAX)
        };
        if !self.compressed {
            let head = source.take(0, h).ok_or_else(cut)?;
            let size = length(&head).min(most);
            // In base64, length and data are one piece.
            return source.take(0, h.saturating_add(size)).map(|bytes| bytes[h..].to_vec()).ok_or_else(cut);
        }
        let count = length(&source.take(0, h).ok_or_else(cut)?);
        let head_size = count.checked_add(3).and_then(|n| n.checked_mul(h)).ok_or_else(cut)?;
        let head = source.take(0, head_size).ok_or_else(cut)?;
        let sizes: Vec<usize> = head.chunks_exact(h).skip(3).map(length).collect();
        let total = sizes.iter().try_fold(0usize, |sum, &s| sum.checked_add(s)).ok_or_else(cut)?;
        let data = source.take_after(head_size, total).ok_or_else(cut)?;
        let (mut bytes, mut at) = (Vec::new(), 0);
        for size in sizes {
            let room = (most - bytes.len().min(most)) as u64;
            let block = &data[at..at + size];
            ZlibDecoder::new(block).take(room).read_to_end(&mut bytes).map_err(|_| cut())?;
            at += size;
        }
        Ok(bytes)
    }
}

/// Bytes in the file, as they stand or as base64.
trait Encoded {
    /// The first `count` bytes after `at` of the first piece.
    fn take(&self, at: usize, count: usize) -> Option<Vec<u8>>;
    /// `count` bytes after a header of `head` bytes, which is a piece of its own in base64.
    fn take_after(&self, head: usize, count: usize) -> Option<Vec<u8>>;
}

struct Raw<'a>(&'a [u8]);

impl Encoded for Raw<'_> {
    fn take(&self, at: usize, count: usize) -> Option<Vec<u8>> {
        Some(self.0.get(at..at.checked_add(count)?)?.to_vec())
    }
    fn take_after(&self, head: usize, count: usize) -> Option<Vec<u8>> {
        self.take(head, count)
    }
}

struct Base64<'a>(&'a [u8]);

impl Base64<'_> {
    fn piece(&self, start: usize, count: usize) -> Option<Vec<u8>> {
        let digits = count.div_ceil(3).checked_mul(4)?;
        let text = self.0.get(start..start.checked_add(digits)?)?;
        let mut bytes = Vec::with_capacity(count);
        for four in text.chunks_exact(4) {
            let mut word = 0u32;
            for &c in four {
                let digit = match c {
                    b'A'..=b'Z' => c - b'A',
                    b'a'..=b'z' => c - b'a' + 26,
                    b'0'..=b'9' => c - b'0' + 52,
                    b'+' => 62,
                    b'/' => 63,
                    b'=' => 0,
                    _ => return None,
                };
                word = word << 6 | u32::from(digit);
            }
            bytes.extend_from_slice(&word.to_be_bytes()[1..]);
        }
        bytes.truncate(count);
        Some(bytes)
    }
}

impl Encoded for Base64<'_> {
    fn take(&self, at: usize, count: usize) -> Option<Vec<u8>> {
        let bytes = self.piece(0, at.checked_add(count)?)?;
        Some(bytes[at..].to_vec())
    }
    fn take_after(&self, head: usize, count: usize) -> Option<Vec<u8>> {
        self.piece(head.div_ceil(3) * 4, count)
    }
}

fn value(kind: &str, b: &[u8]) -> f64 {
    let mut word = [0u8; 8];
    word[..b.len()].copy_from_slice(b);
    let [four, two] = [[word[0], word[1], word[2], word[3]], [word[0], word[1], 0, 0]];
    match kind {
        "Float64" => f64::from_le_bytes(word),
        "Float32" => f64::from(f32::from_le_bytes(four)),
        "Int8" => f64::from(word[0] as i8),
        "UInt8" => f64::from(word[0]),
        "Int16" => f64::from(i16::from_le_bytes([two[0], two[1]])),
        "Int32" => f64::from(i32::from_le_bytes(four)),
        "Int64" => i64::from_le_bytes(word) as f64,
        _ => u64::from_le_bytes(word) as f64,
    }
}

/// `name="value"` pairs.
fn attributes(mut text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    while let Some(equals) = text.find('=') {
        let name = text[..equals].trim();
        let rest = text[equals + 1..].trim_start();
        let Some(quote) = rest.chars().next().filter(|c| *c == '"' || *c == '\'') else { break };
        let Some(end) = rest[1..].find(quote) else { break };
        found.push((name, &rest[1..=end]));
        text = &rest[end + 2..];
    }
    found
}
