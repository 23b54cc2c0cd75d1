//! Legacy VTK files, text or binary: unstructured grids and structured points with a number per cell or point, and surfaces.
//!
//! Versions up to 5.1, which lists cells as offsets and connectivity. Binary data are big-endian.

use super::density::{Cells, Image, choose, index, surface_in_image, surface_of_cells, wrong};
use super::soup::{Soup, excerpt, number, words};
use super::{ImportError, ImportOptions};
use glam::DVec3;

/// Whether the content is such a file.
pub(super) fn looks_like(start: &[u8]) -> bool {
    start.starts_with(b"# vtk DataFile")
}

/// Numbers with a name.
struct Scalars<'a> {
    of_cells: bool,
    name: &'a str,
    values: Vec<f64>,
}

struct Reader<'a> {
    file: &'a str,
    rest: &'a [u8],
    binary: bool,
}

impl<'a> Reader<'a> {
    fn wrong(&self, place: &str, problem: &str) -> ImportError {
        wrong(self.file, place, problem)
    }

    /// The next line with something in it.
    fn line(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
            let line = self.rest[..end].trim_ascii();
            self.rest = &self.rest[(end + 1).min(self.rest.len())..];
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }

    /// So many numbers of a type, which begin behind the line that announced them.
    fn numbers(&mut self, count: usize, kind: &str, place: &str) -> Result<Vec<f64>, ImportError> {
        let cut = "the file is cut off here, or announces more numbers than it holds";
        let width = match kind {
            "char" | "unsigned_char" => 1,
            "short" | "unsigned_short" => 2,
            "int" | "unsigned_int" | "float" | "vtkIdType" => 4,
            "long" | "unsigned_long" | "double" | "vtktypeint64" | "vtktypeuint64" => 8,
            other => return Err(self.wrong(place, &format!("numbers of type {other} are not read"))),
        };
        if self.binary {
            let size = count.checked_mul(width).filter(|size| *size <= self.rest.len());
            let (bytes, rest) = self.rest.split_at(size.ok_or_else(|| self.wrong(place, cut))?);
            self.rest = rest;
            return Ok(bytes.chunks_exact(width).map(|b| big_endian(kind, b)).collect());
        }
        // Each takes at least two bytes, so the announced number does not decide how much memory is taken.
        let mut values = Vec::with_capacity(count.min(self.rest.len() / 2 + 1));
        while values.len() < count {
            self.rest = self.rest.trim_ascii_start();
            let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
            let (word, rest) = self.rest.split_at(end);
            if word.is_empty() {
                return Err(self.wrong(place, cut));
            }
            let value = number(word);
            let found = || self.wrong(place, &format!("a number was expected, not \"{}\"", excerpt(word)));
            values.push(value.ok_or_else(found)?);
            self.rest = rest;
        }
        Ok(values)
    }

    /// Cells as (corners of all, where each ends); `announced` are the two numbers behind the keyword.
    fn cells(&mut self, announced: [usize; 2], place: &str) -> Result<(Vec<u32>, Vec<usize>), ImportError> {
        let before = self.rest;
        let next = self.line().unwrap_or_default();
        if let Some((b"OFFSETS", kind)) = pair(next) {
            let offsets = self.numbers(announced[0], kind, place)?;
            let Some((b"CONNECTIVITY", kind)) = pair(self.line().unwrap_or_default()) else {
                return Err(self.wrong(place, "CONNECTIVITY is missing"));
            };
            let corners = self.numbers(announced[1], kind, place)?;
            let ends = offsets.into_iter().skip(1).map(|end| end as usize).collect();
            return Ok((corners.into_iter().map(index).collect(), ends));
        }
        self.rest = before;
        let list = self.numbers(announced[1], "int", place)?;
        let (mut corners, mut ends, mut at) = (Vec::with_capacity(list.len()), Vec::new(), 0);
        while ends.len() < announced[0] {
            let count = list.get(at).map_or(usize::MAX, |count| *count as usize);
            let Some(cell) = at.checked_add(1).and_then(|from| list.get(from..from.checked_add(count)?))
            else {
                let problem = "it has more points than are listed";
                return Err(self.wrong(&format!("{place} {}", ends.len()), problem));
            };
            corners.extend(cell.iter().copied().map(index));
            ends.push(corners.len());
            at += 1 + count;
        }
        Ok((corners, ends))
    }
}

/// The two words of a line.
fn pair(line: &[u8]) -> Option<(&[u8], &str)> {
    let mut words = words(line);
    let (first, second) = (words.next()?, words.next()?);
    Some((first, std::str::from_utf8(second).ok()?))
}

fn big_endian(kind: &str, bytes: &[u8]) -> f64 {
    let mut word = [0u8; 8];
    word[8 - bytes.len()..].copy_from_slice(bytes);
    let whole = u64::from_be_bytes(word);
    match kind {
        "float" => f64::from(f32::from_bits(whole as u32)),
        "double" => f64::from_bits(whole),
        "char" => f64::from(whole as u8 as i8),
        "short" => f64::from(whole as u16 as i16),
        "int" | "vtkIdType" => f64::from(whole as u32 as i32),
        "long" | "vtktypeint64" => whole as i64 as f64,
        _ => whole as f64,
    }
}

/// What a file holds.
#[derive(Default)]
struct Content<'a> {
    positions: Vec<DVec3>,
    cells: (Vec<u32>, Vec<usize>),
    kinds: Vec<u8>,
    polygons: (Vec<u32>, Vec<usize>),
    dimensions: Option<[f64; 3]>,
    origin: DVec3,
    spacing: Option<DVec3>,
    scalars: Vec<Scalars<'a>>,
}

/// Reads a legacy VTK file.
pub(super) fn parse(file: &str, bytes: &[u8], options: &ImportOptions) -> Result<Soup, ImportError> {
    let mut reader = Reader { file, rest: bytes, binary: false };
    let (_, _) = (reader.line(), reader.line());
    // A title may be empty: then the line taken for it says how the data are written.
    let title_missing =
        !matches!(bytes.split(|&b| b == b'\n').nth(1), Some(title) if !title.trim_ascii().is_empty());
    if title_missing {
        reader.rest = bytes;
        reader.line();
    }
    reader.binary = match reader.line() {
        Some(b"ASCII") => false,
        Some(b"BINARY") => true,
        _ => return Err(wrong(file, "line 3", "ASCII or BINARY was expected")),
    };
    let kind = match pair(reader.line().unwrap_or_default()) {
        Some((b"DATASET", kind)) => kind,
        _ => return Err(wrong(file, "line 4", "DATASET was expected")),
    };
    if !["UNSTRUCTURED_GRID", "STRUCTURED_POINTS", "POLYDATA"].contains(&kind) {
        let problem = format!("{kind} is not read; UNSTRUCTURED_GRID, STRUCTURED_POINTS and POLYDATA are");
        return Err(wrong(file, "DATASET", &problem));
    }
    let content = read(&mut reader)?;
    let fields = |of_cells: bool| content.scalars.iter().filter(move |s| s.of_cells == of_cells);
    let take = |of_cells: bool| -> Result<&Scalars<'_>, ImportError> {
        let names: Vec<&str> = fields(of_cells).map(|s| s.name).collect();
        let name = choose(file, &names, options)?;
        fields(of_cells).find(|s| s.name == name).ok_or_else(|| wrong(file, name, "there is no such field"))
    };
    match kind {
        "POLYDATA" => {
            let (corners, ends) = &content.polygons;
            if ends.last().is_some_and(|&end| end > corners.len()) || !ends.is_sorted() {
                return Err(wrong(file, "POLYGONS", "its offsets point beyond the connectivity"));
            }
            Soup::from_polygons(file, "VTK", content.positions, corners, ends)
        }
        "STRUCTURED_POINTS" => {
            let of_cells = fields(false).next().is_none();
            let dimensions = content.dimensions.and_then(|points| Image::counts(points, of_cells));
            let (Some(counts), Some(step)) = (dimensions, content.spacing) else {
                return Err(wrong(file, "DIMENSIONS", "they or SPACING are missing, empty or too large"));
            };
            let Scalars { name: field, values, .. } = take(of_cells)?;
            let first = content.origin + if of_cells { 0.5 * step } else { DVec3::ZERO };
            let values = values.clone();
            surface_in_image(file, &Image { format: "VTK", field, counts, first, step, values }, options)
        }
        _ => {
            let field = match (fields(true).next(), &options.field) {
                (None, None) => None,
                _ => take(true).map(|found| Some((found.name.to_owned(), found.values.clone())))?,
            };
            let labels = fields(true).find(|s| s.name.eq_ignore_ascii_case("non_design"));
            let passive = labels.map(|labels| labels.values.iter().map(|&p| p > 0.5).collect());
            let ((corners, ends), kinds, positions) = (content.cells, content.kinds, content.positions);
            let cells = Cells { format: "VTK", positions, kinds, corners, ends, field, passive };
            surface_of_cells(file, cells, options)
        }
    }
}

/// All that stands behind the kind of the data.
fn read<'a>(reader: &mut Reader<'a>) -> Result<Content<'a>, ImportError> {
    let mut content = Content::default();
    // Of cells or of points, and how many.
    let (mut of_cells, mut items) = (true, 0);
    while let Some(line) = reader.line() {
        let mut all = words(line).map(|word| std::str::from_utf8(word).unwrap_or("?"));
        let keyword = all.next().unwrap_or_default().to_ascii_uppercase();
        let arguments: Vec<&'a str> = all.collect();
        let place = keyword.as_str();
        let argument = |k: usize| -> Result<&'a str, ImportError> {
            arguments.get(k).copied().ok_or_else(|| wrong(reader.file, place, "the line is cut off"))
        };
        let whole = |k: usize| -> Result<usize, ImportError> {
            let text = argument(k)?;
            text.parse().map_err(|_| wrong(reader.file, place, &format!("{text} is no whole number")))
        };
        let three = || -> Result<[f64; 3], ImportError> {
            let mut numbers = [0.0; 3];
            for (k, slot) in numbers.iter_mut().enumerate() {
                let text = argument(k)?;
                let number = text.parse().ok();
                *slot = number.ok_or_else(|| wrong(reader.file, place, &format!("{text} is no number")))?;
            }
            Ok(numbers)
        };
        match place {
            "POINTS" => {
                let (count, kind) = (whole(0)?, argument(1)?);
                let numbers = reader.numbers(count.saturating_mul(3), kind, place)?;
                content.positions =
                    numbers.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect();
            }
            "CELLS" => content.cells = reader.cells([whole(0)?, whole(1)?], place)?,
            "POLYGONS" => content.polygons = reader.cells([whole(0)?, whole(1)?], place)?,
            "VERTICES" | "LINES" => drop(reader.cells([whole(0)?, whole(1)?], place)?),
            "TRIANGLE_STRIPS" => {
                return Err(reader.wrong(place, "strips are not read; save the surface as triangles"));
            }
            "CELL_TYPES" => {
                let kinds = reader.numbers(whole(0)?, "int", place)?;
                content.kinds = kinds.into_iter().map(|kind| kind as u8).collect();
            }
            "DIMENSIONS" => content.dimensions = Some(three()?),
            "ORIGIN" => content.origin = DVec3::from_array(three()?),
            "SPACING" | "ASPECT_RATIO" => content.spacing = Some(DVec3::from_array(three()?)),
            "CELL_DATA" | "POINT_DATA" => (of_cells, items) = (place == "CELL_DATA", whole(0)?),
            "SCALARS" => {
                let (name, kind) = (argument(0)?, argument(1)?);
                let components = if arguments.len() > 2 { whole(2)? } else { 1 };
                let before = reader.rest;
                // Says which colours are meant; may be left out.
                if !matches!(pair(reader.line().unwrap_or_default()), Some((b"LOOKUP_TABLE", _))) {
                    reader.rest = before;
                }
                let values = reader.numbers(items.saturating_mul(components), kind, name)?;
                if components == 1 {
                    content.scalars.push(Scalars { of_cells, name, values });
                }
            }
            "VECTORS" | "NORMALS" => drop(reader.numbers(items.saturating_mul(3), argument(1)?, place)?),
            "TENSORS" => drop(reader.numbers(items.saturating_mul(9), argument(1)?, place)?),
            "TEXTURE_COORDINATES" => {
                let count = items.saturating_mul(whole(1)?);
                drop(reader.numbers(count, argument(2)?, place)?);
            }
            "FIELD" => {
                for _ in 0..whole(1)? {
                    let line = reader.line().unwrap_or_default();
                    let words: Vec<&'a str> =
                        words(line).map(|word| std::str::from_utf8(word).unwrap_or("?")).collect();
                    let &[name, components, tuples, kind] = &words[..] else {
                        return Err(reader.wrong(place, "name, components, tuples and type were expected"));
                    };
                    let sizes: Option<(usize, usize)> = components.parse().ok().zip(tuples.parse().ok());
                    let Some((components, tuples)) = sizes else {
                        return Err(reader.wrong(name, "its sizes are no whole numbers"));
                    };
                    let values = reader.numbers(tuples.saturating_mul(components), kind, name)?;
                    if components == 1 && tuples == items {
                        content.scalars.push(Scalars { of_cells, name, values });
                    }
                }
            }
            "METADATA" => {
                // Ends with an empty line.
                let end = reader.rest.windows(2).position(|two| two == b"\n\n");
                reader.rest = end.map_or(&[][..], |end| &reader.rest[end + 2..]);
            }
            other => {
                let problem = format!("\"{}\" is not read", excerpt(other.as_bytes()));
                return Err(reader.wrong("the file", &problem));
            }
        }
    }
    Ok(content)
}
