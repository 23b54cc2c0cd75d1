//! What a reader makes of a file: points and faces as they stand there, nothing repaired.

use super::ImportError;
use crate::Repair;
use glam::DVec3;

/// The content of a file.
#[derive(Debug, Clone, Default)]
pub(super) struct Soup {
    /// Name of the format for people.
    pub(super) format: &'static str,
    /// What of the file is the part, where there is a choice. Empty where there is none.
    pub(super) taken: String,
    /// True when every face brings its own three points (STL): then equal points are the rule, not a defect.
    pub(super) unindexed: bool,
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The face of the file each triangle is part of.
    pub(super) face_of: Vec<u32>,
    /// Faces in the file.
    pub(super) face_count: usize,
    pub(super) repairs: Vec<Repair>,
    /// Whether each face of the file is non-design, where the file says so.
    pub(super) non_design: Option<Vec<bool>>,
}

impl Soup {
    /// Faces of any number of corners to triangles. `corners` holds the faces one after the other, `ends` where each
    /// ends.
    pub(super) fn from_polygons(
        file: &str,
        format: &'static str,
        positions: Vec<DVec3>,
        corners: &[u32],
        ends: &[usize],
    ) -> Result<Self, ImportError> {
        let mut soup = Self { format, face_count: ends.len(), ..Self::default() };
        soup.positions = positions;
        soup.check_finite(file)?;
        let mut start = 0;
        let mut too_few = 0;
        for (face, &end) in ends.iter().enumerate() {
            let polygon = &corners[start..end];
            start = end;
            if let Some(&vertex) = polygon.iter().find(|&&v| v as usize >= soup.positions.len()) {
                return Err(ImportError::VertexOutOfRange {
                    file: file.to_owned(),
                    face: face as u32,
                    vertex,
                    count: soup.positions.len(),
                });
            }
            let before = soup.triangles.len();
            match *polygon {
                [a, b, c] => soup.triangles.push([a, b, c]),
                [] | [_] | [_, _] => too_few += 1,
                _ => clip_ears(polygon, &soup.positions, &mut soup.triangles),
            }
            soup.face_of.resize(soup.face_of.len() + soup.triangles.len() - before, face as u32);
        }
        soup.note("dropped faces with fewer than three corners", too_few);
        let more = soup.triangles.len() + too_few - soup.face_count;
        soup.note(Repair::TRIANGULATED, more);
        Ok(soup)
    }

    pub(super) fn note(&mut self, what: &str, count: usize) {
        if count > 0 {
            self.repairs.push(Repair { what: what.to_owned(), count: count as u64 });
        }
    }

    pub(super) fn check_finite(&self, file: &str) -> Result<(), ImportError> {
        match self.positions.iter().position(|p| !in_range(*p)) {
            None => Ok(()),
            Some(v) => Err(ImportError::NotFinite {
                file: file.to_owned(),
                place: if self.unindexed {
                    format!("corner {} of face {}", v % 3, v / 3)
                } else {
                    format!("vertex {v}")
                },
                point: self.positions[v],
            }),
        }
    }
}

/// Cuts a polygon into triangles by cutting off ears, of which the roundest goes first; a polygon that has none (it
/// crosses itself) is cut into a fan. For a convex or concave plane polygon the triangles do not overlap.
fn clip_ears(polygon: &[u32], positions: &[DVec3], triangles: &mut Vec<[u32; 3]>) {
    let point = |v: u32| positions[v as usize];
    let origin = point(polygon[0]);
    let normal: DVec3 = (1..polygon.len() - 1)
        .map(|k| (point(polygon[k]) - origin).cross(point(polygon[k + 1]) - origin))
        .sum();
    let mut ring = polygon.to_vec();
    // A search over all ears for each of them would be slow for a hostile polygon.
    const MOST: usize = 1000;
    while ring.len() > 3 && polygon.len() <= MOST {
        let n = ring.len();
        let ear = (0..n)
            .filter_map(|k| {
                let [a, b, c] = [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]];
                let [p, q, r] = [point(a), point(b), point(c)];
                let area = (q - p).cross(r - p).dot(normal);
                let inside = |x: DVec3| {
                    (q - p).cross(x - p).dot(normal) >= 0.0
                        && (r - q).cross(x - q).dot(normal) >= 0.0
                        && (p - r).cross(x - r).dot(normal) >= 0.0
                };
                let free = ring.iter().all(|&v| [a, b, c].contains(&v) || !inside(point(v)));
                let longest = p.distance_squared(q).max(q.distance_squared(r)).max(r.distance_squared(p));
                (area > 0.0 && free).then(|| (area / longest, k))
            })
            .max_by(|x, y| x.0.total_cmp(&y.0).then(y.1.cmp(&x.1)));
        let Some((_, k)) = ear else { break };
        triangles.push([ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]]);
        ring.remove(k);
    }
    for k in 1..ring.len() - 1 {
        triangles.push([ring[0], ring[k], ring[k + 1]]);
    }
}

/// Finite, and small enough that the cube of a length is finite too.
pub(super) fn in_range(p: DVec3) -> bool {
    p.abs().cmplt(DVec3::splat(1e90)).all()
}

/// The lines of a text, numbered from 1, without their ends and surrounding blanks.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    bytes.split(|&b| b == b'\n').enumerate().map(|(k, line)| (k + 1, line.trim_ascii()))
}

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A word as a number. Accepts `nan` and `inf`, which the check for finite coordinates names later.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// What stands in the place of something expected.
pub(super) fn found(word: &[u8]) -> String {
    if word.is_empty() { "the end of the line".to_owned() } else { format!("\"{}\"", excerpt(word)) }
}

/// A piece of the file for a message: short, printable.
pub(super) fn excerpt(word: &[u8]) -> String {
    String::from_utf8_lossy(word)
        .chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .take(24)
        .collect()
}
