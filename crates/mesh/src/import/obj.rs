//! Wavefront OBJ: `v` and `f` lines; normals, texture coordinates, groups and materials are ignored.

use super::ImportError;
use super::soup::{Soup, found, lines, number, words};
use glam::DVec3;

/// Reads the vertices and faces.
pub(super) fn parse(file: &str, text: &[u8]) -> Result<Soup, ImportError> {
    let (mut positions, mut corners, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    for (line, content) in lines(text) {
        let malformed = |problem: String| ImportError::Malformed {
            file: file.to_owned(),
            place: format!("line {line}"),
            problem,
        };
        let mut words = words(content);
        match words.next() {
            Some(b"v") => {
                let mut point = [0.0; 3];
                for x in &mut point {
                    let word = words.next().unwrap_or_default();
                    *x = number(word)
                        .ok_or_else(|| malformed(format!("a number was expected, not {}", found(word))))?;
                }
                positions.push(DVec3::from_array(point));
            }
            Some(b"f") => {
                for word in words {
                    let index = word.split(|&b| b == b'/').next().unwrap_or_default();
                    let index = std::str::from_utf8(index).ok().and_then(|w| w.parse::<i64>().ok());
                    // Counted from 1, or backwards from the last vertex so far.
                    let vertex = match index {
                        Some(k) if k > 0 => k - 1,
                        Some(k) if k < 0 => positions.len() as i64 + k,
                        _ => -1,
                    };
                    let vertex = u32::try_from(vertex).map_err(|_| {
                        malformed(format!("a vertex index was expected, not {}", found(word)))
                    })?;
                    corners.push(vertex);
                }
                ends.push(corners.len());
            }
            _ => {}
        }
    }
    if ends.is_empty() {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    for (count, what) in [(positions.len(), "vertices"), (corners.len(), "face corners")] {
        if count >= u32::MAX as usize {
            return Err(ImportError::TooLarge { file: file.to_owned(), count, what });
        }
    }
    Soup::from_polygons(file, "OBJ", positions, &corners, &ends)
}
