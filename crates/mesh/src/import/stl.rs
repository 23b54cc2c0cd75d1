//! STL, binary and ASCII.
//!
//! Binary files go through `stl_io`, behind checks it does not make: it takes a binary file whose header starts with
//! "solid " for text, and believes the count in the header. ASCII is read here: `stl_io` stops at a nameless `solid`,
//! at upper case and at a byte order mark, and rounds to 32 bits.

use super::ImportError;
use super::soup::{Soup, excerpt, found, lines, number, words};
use glam::DVec3;
use std::io::{self, Read, Seek, SeekFrom};

const HEADER: usize = 80;
const RECORD: usize = 50;

/// The number of faces a binary file announces.
fn announced(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER..HEADER + 4)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

/// True when the length is exactly that of a binary STL with the announced number of faces.
pub(super) fn has_binary_length(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|n| bytes.len() == HEADER + 4 + RECORD * n)
}

/// True for text that starts with `solid` and goes on as an ASCII STL does.
pub(super) fn looks_ascii(start: &[u8]) -> bool {
    let begins = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let mut rest = lines(start).skip(1).map(|(_, l)| l).filter(|l| !l.is_empty());
    let keyword = rest.next().and_then(|l| words(l).next());
    begins
        && keyword.is_none_or(|w| w.eq_ignore_ascii_case(b"facet") || w.eq_ignore_ascii_case(b"endsolid"))
        && !start[..start.len().min(HEADER)].contains(&0)
}

/// Reads a binary file. Bytes after the last face are counted and left.
pub(super) fn parse_binary(file: &str, bytes: &[u8]) -> Result<Soup, ImportError> {
    let body = bytes.len().saturating_sub(HEADER + 4);
    let Some(count) = announced(bytes) else {
        return Err(ImportError::Truncated {
            file: file.to_owned(),
            expected: "a header of 84 bytes".to_owned(),
            found: format!("{} bytes", bytes.len()),
        });
    };
    if body / RECORD < count {
        // Less than 2^24 faces leave a zero byte there, which no text has.
        if bytes[..HEADER + 4].iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace()) {
            return Err(ImportError::UnknownFormat { file: file.to_owned() });
        }
        return Err(ImportError::Truncated {
            file: file.to_owned(),
            expected: format!("{count} faces"),
            found: format!("{} faces", body / RECORD),
        });
    }
    if count == 0 {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    let mut soup = Soup { format: "STL (binary)", unindexed: true, face_count: count, ..Soup::default() };
    soup.positions.reserve_exact(3 * count);
    let damaged = |e: io::Error| ImportError::Malformed {
        file: file.to_owned(),
        place: "binary STL".to_owned(),
        problem: e.to_string(),
    };
    let mut reader = BlankHeader { bytes, position: 0 };
    for triangle in stl_io::create_stl_reader(&mut reader).map_err(damaged)? {
        let corners = triangle.map_err(damaged)?.vertices;
        soup.positions.extend(corners.iter().map(|v| DVec3::from_array(v.0.map(f64::from))));
    }
    finish(&mut soup, file)?;
    soup.note("ignored bytes after the last face", body - count * RECORD);
    Ok(soup)
}

/// Reads an ASCII file with any case, names and number of solids, with or without normals.
pub(super) fn parse_ascii(file: &str, text: &[u8]) -> Result<Soup, ImportError> {
    let mut soup = Soup { format: "STL (ASCII)", unindexed: true, ..Soup::default() };
    let last_line = 1 + text.trim_ascii_end().iter().filter(|&&b| b == b'\n').count();
    let malformed = |line: usize, problem: String| match line {
        // A last line that makes no sense is the stump of one.
        line if line == last_line => ImportError::Truncated {
            file: file.to_owned(),
            expected: "the end of the solid".to_owned(),
            found: format!("a broken line {line}"),
        },
        line => ImportError::Malformed { file: file.to_owned(), place: format!("line {line}"), problem },
    };
    // The line a facet started at, and where its points start.
    let mut facet: Option<(usize, usize)> = None;
    let mut ended = false;
    let mut ignored = 0;
    for (line, content) in lines(text) {
        let mut words = words(content);
        let Some(keyword) = words.next() else { continue };
        let is = |name: &str| keyword.eq_ignore_ascii_case(name.as_bytes());
        if is("vertex") {
            if facet.is_none() {
                return Err(malformed(line, "a vertex outside of a facet".to_owned()));
            }
            let mut point = [0.0; 3];
            for x in &mut point {
                let word = words.next().unwrap_or_default();
                *x = number(word)
                    .ok_or_else(|| malformed(line, format!("a number was expected, not {}", found(word))))?;
            }
            soup.positions.push(DVec3::from_array(point));
        } else if is("facet") {
            if let Some((opened, _)) = facet {
                return Err(malformed(line, format!("the facet of line {opened} has no end")));
            }
            facet = Some((line, soup.positions.len()));
        } else if is("endfacet") {
            let Some((opened, first)) = facet.take() else {
                return Err(malformed(line, "the end of a facet that was not begun".to_owned()));
            };
            let corners = soup.positions.len() - first;
            if corners != 3 {
                return Err(malformed(
                    opened,
                    format!("a facet with {corners} vertices; STL knows triangles only"),
                ));
            }
        } else if is("endsolid") && facet.is_none() {
            ended = true;
        } else if is("solid") && facet.is_none() {
            ended = false;
        } else if !(is("outer") || is("endloop") || is("color")) {
            if !ended {
                return Err(malformed(
                    line,
                    format!("\"{}\" does not belong into an STL file", excerpt(keyword)),
                ));
            }
            ignored += 1;
        }
    }
    if let Some((opened, _)) = facet {
        return Err(ImportError::Truncated {
            file: file.to_owned(),
            expected: format!("the end of the facet that begins in line {opened}"),
            found: "the end of the file".to_owned(),
        });
    }
    soup.face_count = soup.positions.len() / 3;
    if soup.face_count == 0 {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    finish(&mut soup, file)?;
    soup.note("ignored lines after the end of the solid", ignored);
    Ok(soup)
}

fn finish(soup: &mut Soup, file: &str) -> Result<(), ImportError> {
    if soup.positions.len() >= u32::MAX as usize {
        return Err(ImportError::TooLarge {
            file: file.to_owned(),
            count: soup.positions.len(),
            what: "face corners",
        });
    }
    soup.check_finite(file)?;
    soup.triangles = (0..soup.face_count as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    soup.face_of = (0..soup.face_count as u32).collect();
    Ok(())
}

/// The file with zeros for its header, so that no header can pass for text.
struct BlankHeader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl Read for BlankHeader<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let rest = self.bytes.get(self.position..).unwrap_or_default();
        let n = rest.len().min(out.len());
        out[..n].copy_from_slice(&rest[..n]);
        let header = HEADER.saturating_sub(self.position).min(n);
        out[..header].fill(0);
        self.position += n;
        Ok(n)
    }
}

impl Seek for BlankHeader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (base, offset) = match to {
            SeekFrom::Start(n) => (0, i64::try_from(n).unwrap_or(i64::MAX)),
            SeekFrom::End(n) => (self.bytes.len() as i64, n),
            SeekFrom::Current(n) => (self.position as i64, n),
        };
        let target = base.saturating_add(offset);
        self.position = usize::try_from(target).map_err(|_| io::ErrorKind::InvalidInput)?;
        Ok(self.position as u64)
    }
}
