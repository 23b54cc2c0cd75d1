//! OFF, the Object File Format of Geomview: text, faces of any number of corners, colours and normals ignored.

use super::ImportError;
use super::soup::{Soup, found, lines, number, words};
use glam::DVec3;

/// True for the header lines of OFF and its variants with colours, normals and texture coordinates.
pub(super) fn has_header(start: &[u8]) -> bool {
    header(words(start).next().unwrap_or_default())
}

fn header(word: &[u8]) -> bool {
    ["OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"]
        .iter()
        .any(|h| h.as_bytes() == word)
}

/// Reads the vertices and faces.
pub(super) fn parse(file: &str, text: &[u8]) -> Result<Soup, ImportError> {
    let malformed = |line: usize, problem: String| ImportError::Malformed {
        file: file.to_owned(),
        place: format!("line {line}"),
        problem,
    };
    let mut content = lines(text)
        .map(|(k, line)| (k, line.split(|&b| b == b'#').next().unwrap_or_default().trim_ascii()))
        .filter(|(_, line)| !line.is_empty())
        .peekable();
    let cut_off = |expected: String, present: usize, what: &str| ImportError::Truncated {
        file: file.to_owned(),
        expected,
        found: format!("{present} {what}"),
    };

    // The counts stand behind the header word or in the next line; some files have no header word.
    let (mut line, mut counts) =
        content.next().ok_or_else(|| ImportError::Empty { file: file.to_owned() })?;
    if header(words(counts).next().unwrap_or_default()) {
        let word = words(counts).next().map_or(0, <[u8]>::len);
        counts = counts[word..].trim_ascii();
        if counts.is_empty() {
            (line, counts) =
                content.next().ok_or_else(|| cut_off("the number of vertices".to_owned(), 0, "lines"))?;
        }
    }
    let mut counts = words(counts).map(|w| {
        std::str::from_utf8(w)
            .ok()
            .and_then(|w| w.parse::<usize>().ok())
            .ok_or_else(|| malformed(line, format!("a count was expected, not {}", found(w))))
    });
    let mut count = || counts.next().unwrap_or_else(|| Err(malformed(line, "a count is missing".to_owned())));
    let (vertices, faces) = (count()?, count()?);
    for (n, what) in [(vertices, "vertices"), (faces, "faces")] {
        if n >= u32::MAX as usize {
            return Err(ImportError::TooLarge { file: file.to_owned(), count: n, what });
        }
    }

    // The counts are not to be believed: a vertex takes at least six bytes, a face at least eight.
    let mut positions = Vec::with_capacity(vertices.min(text.len() / 6));
    while positions.len() < vertices {
        let Some((line, content)) = content.next() else {
            return Err(cut_off(format!("{vertices} vertices"), positions.len(), "vertices"));
        };
        let mut words = words(content);
        let mut point = [0.0; 3];
        for x in &mut point {
            let word = words.next().unwrap_or_default();
            *x = number(word)
                .ok_or_else(|| malformed(line, format!("a number was expected, not {}", found(word))))?;
        }
        positions.push(DVec3::from_array(point));
    }
    let mut corners = Vec::with_capacity(faces.min(text.len() / 8).saturating_mul(3));
    let mut ends = Vec::with_capacity(faces.min(text.len() / 8));
    while ends.len() < faces {
        let Some((line, content)) = content.next() else {
            return Err(cut_off(format!("{faces} faces"), ends.len(), "faces"));
        };
        let mut indices = words(content);
        let mut index = || {
            let word = indices.next().unwrap_or_default();
            std::str::from_utf8(word)
                .ok()
                .and_then(|w| w.parse::<u32>().ok())
                .ok_or_else(|| malformed(line, format!("a vertex index was expected, not {}", found(word))))
        };
        for _ in 0..index()? {
            corners.push(index()?);
        }
        ends.push(corners.len());
    }
    if ends.is_empty() {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    let ignored = content.count();
    let mut soup = Soup::from_polygons(file, "OFF", positions, &corners, &ends)?;
    soup.note("ignored lines after the last face", ignored);
    Ok(soup)
}
