//! The surface of a density field: of the kept cells of a grid (VTU, legacy VTK, element sets), or where an image has a value
//! (VTI, legacy VTK).

use super::soup::Soup;
use super::vtk::VtkFile;
use super::{ImportError, ImportOptions, Inside};
use glam::DVec3;
use std::collections::BTreeMap;

/// The threshold where none is given: half full. Distance fields (by their name) have 0.
fn threshold(options: &ImportOptions, field: &str) -> f64 {
    let distance = field.to_ascii_lowercase().contains("dist") || field.eq_ignore_ascii_case("sdf");
    options.threshold.unwrap_or(if distance { 0.0 } else { 0.5 })
}

/// Reads a VTU or VTI file.
pub(super) fn parse(file: &str, bytes: &[u8], options: &ImportOptions) -> Result<Soup, ImportError> {
    let vtk = VtkFile::parse(file, bytes)?;
    if vtk.count("Piece") > 1 {
        return Err(wrong(file, "Piece", "files of several pieces are not read; merge them"));
    }
    match vtk.kind {
        "UnstructuredGrid" => cells(file, &vtk, options),
        "ImageData" => image(file, &vtk, options),
        other => {
            let problem = format!("{other} is not read; UnstructuredGrid and ImageData are");
            Err(wrong(file, "VTKFile", &problem))
        }
    }
}

pub(super) fn wrong(file: &str, place: &str, problem: &str) -> ImportError {
    ImportError::Malformed { file: file.to_owned(), place: place.to_owned(), problem: problem.to_owned() }
}

/// Names of fields in a message.
const MOST_NAMES: usize = 8;

/// The field that is meant: the one named, else `density`, else the only one.
pub(super) fn choose<'a>(
    file: &str,
    names: &[&'a str],
    options: &ImportOptions,
) -> Result<&'a str, ImportError> {
    let named = |name: &str| names.iter().copied().find(|n| n.eq_ignore_ascii_case(name));
    match (&options.field, names) {
        (Some(field), _) => named(field),
        (None, [only]) => Some(*only),
        (None, _) => named("density"),
    }
    .ok_or_else(|| {
        // A field for each iteration makes a long list.
        let mut list = names.iter().take(MOST_NAMES).copied().collect::<Vec<_>>().join(", ");
        if let Some(last) = names.get(MOST_NAMES..).and_then(<[_]>::last) {
            list += &format!(" and {} more, the last of them {last}", names.len() - MOST_NAMES);
        }
        let problem = match names {
            [] => "the file has no field of single numbers".to_owned(),
            _ => format!("the file has the fields {list}; say with `field` which one is the density"),
        };
        wrong(file, "fields", &problem)
    })
}

fn whole(file: &str, vtk: &VtkFile<'_>, element: &str, name: &str) -> Result<usize, ImportError> {
    let text = vtk.attribute(element, name)?;
    text.trim().parse().map_err(|_| wrong(file, element, &format!("{name} is no whole number")))
}

/// Corners of the faces of a cell, seen from outside counterclockwise.
fn faces_of(kind: u8) -> Option<(usize, &'static [&'static [usize]])> {
    match kind {
        // Tetrahedron, also with middles of edges.
        10 | 24 => Some((4, &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]])),
        // Voxel: numbered x first.
        11 => Some((
            8,
            &[&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]],
        )),
        // Hexahedron, also with middles of edges.
        12 | 25 => Some((
            8,
            &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]],
        )),
        13 => Some((6, &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]])),
        14 => Some((5, &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]])),
        _ => None,
    }
}

/// The cells of a grid, some of which are kept.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// Name of the format for people.
    pub(super) format: &'static str,
    pub(super) positions: Vec<DVec3>,
    /// What each cell is, as VTK counts kinds.
    pub(super) kinds: Vec<u8>,
    /// The points of all cells, one after the other, and where each ends. What is beyond the points is found out later.
    pub(super) corners: Vec<u32>,
    pub(super) ends: Vec<usize>,
    /// Name of the field that says which are kept, and its value for each cell; without one all are.
    pub(super) field: Option<(String, Vec<f64>)>,
    /// Cells that are kept whatever the field says, as non-design.
    pub(super) passive: Option<Vec<bool>>,
}

fn cells(file: &str, vtk: &VtkFile<'_>, options: &ImportOptions) -> Result<Soup, ImportError> {
    let points = whole(file, vtk, "Piece", "NumberOfPoints")?;
    let count = whole(file, vtk, "Piece", "NumberOfCells")?;
    let positions = vtk.array("Points", None, points.saturating_mul(3))?;
    let kinds = vtk.array("Cells", Some("types"), count)?;
    let ends = vtk.array("Cells", Some("offsets"), count)?;
    let corners = vtk.array("Cells", Some("connectivity"), count.saturating_mul(27))?;
    let names = vtk.scalars("CellData");
    // A mesh of solid cells and nothing else is a part as it is.
    let field = if names.is_empty() && options.field.is_none() {
        None
    } else {
        let field = choose(file, &names, options)?;
        Some((field.to_owned(), vtk.array("CellData", Some(field), count)?))
    };
    if positions.len() != points.saturating_mul(3) || [kinds.len(), ends.len()] != [count; 2] {
        return Err(wrong(file, "DataArray", UNEQUAL));
    }
    let labels = names.into_iter().find(|n| n.eq_ignore_ascii_case("non_design"));
    let passive = labels.map(|name| vtk.array("CellData", Some(name), count)).transpose()?;
    let cells = Cells {
        format: "VTU",
        positions: positions.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect(),
        kinds: kinds.into_iter().map(|kind| kind as u8).collect(),
        corners: corners.into_iter().map(index).collect(),
        ends: ends.into_iter().map(|end| end as usize).collect(),
        field,
        passive: passive.map(|passive| passive.into_iter().map(|p| p > 0.5).collect()),
    };
    surface_of_cells(file, cells, options)
}

const UNEQUAL: &str = "an array has not as many numbers as there are points or cells";

/// A number that names a point; what is none names one beyond all points.
pub(super) fn index(number: f64) -> u32 {
    if number >= 0.0 && number < f64::from(u32::MAX) { number as u32 } else { u32::MAX }
}

/// The faces of the kept cells that are not between two of them.
pub(super) fn surface_of_cells(
    file: &str,
    cells: Cells,
    options: &ImportOptions,
) -> Result<Soup, ImportError> {
    let Cells { format, positions, kinds, corners, ends, field, passive } = cells;
    let (count, points) = (ends.len(), positions.len());
    if kinds.len() != count || field.as_ref().is_some_and(|(_, values)| values.len() != count) {
        return Err(wrong(file, "cells", UNEQUAL));
    }
    let limit = threshold(options, field.as_ref().map_or("", |(name, _)| name));
    let mut border: BTreeMap<Vec<u32>, (Vec<u32>, bool)> = BTreeMap::new();
    let mut start = 0;
    for cell in 0..count {
        let end = ends[cell];
        let Some(nodes) = corners.get(start..end) else {
            return Err(wrong(file, &format!("cell {cell}"), "its offsets point beyond the connectivity"));
        };
        start = end;
        let is_passive = passive.as_ref().is_some_and(|p| p.get(cell).is_some_and(|&p| p));
        let inside = field.as_ref().is_none_or(|(_, density)| match options.inside {
            Inside::Above => density[cell] >= limit,
            Inside::Below => density[cell] <= limit,
        });
        if !inside && !is_passive {
            continue;
        }
        let Some((least, faces)) = faces_of(kinds[cell]).filter(|(least, _)| nodes.len() >= *least) else {
            let problem = format!(
                "a cell of VTK type {} is not read; tetrahedra, hexahedra, wedges and pyramids are",
                kinds[cell]
            );
            return Err(wrong(file, &format!("cell {cell}"), &problem));
        };
        if nodes[..least].iter().any(|&v| v as usize >= points) {
            let problem = format!("it names a point that is not there; there are only {points}");
            return Err(wrong(file, &format!("cell {cell}"), &problem));
        }
        for face in faces {
            let face: Vec<u32> = face.iter().map(|&k| nodes[k]).collect();
            let mut key = face.clone();
            key.sort_unstable();
            // A face of two kept cells lies inside.
            if border.remove(&key).is_none() {
                border.insert(key, (face, is_passive));
            }
        }
    }
    if border.is_empty() {
        let problem = match field {
            Some((field, _)) => format!("no cell has a {field} beyond {limit}; give another `threshold`"),
            None => "there are no solid cells".to_owned(),
        };
        return Err(wrong(file, "cells", &problem));
    }
    let (mut list, mut face_ends, mut labelled) = (Vec::new(), Vec::new(), Vec::new());
    for (face, is_passive) in border.into_values() {
        list.extend(face);
        face_ends.push(list.len());
        labelled.push(is_passive);
    }
    let mut soup = Soup::from_polygons(file, format, positions, &list, &face_ends)?;
    // What is cut out of a grid brings all points of the grid; those without faces are no defect.
    soup.repairs.clear();
    soup.unindexed = true;
    soup.taken = match (field, options.inside) {
        (None, _) => "all solid cells".to_owned(),
        (Some((field, _)), Inside::Above) => format!("cells with {field} of at least {limit}"),
        (Some((field, _)), Inside::Below) => format!("cells with {field} of at most {limit}"),
    };
    soup.non_design = passive.map(|_| labelled);
    Ok(soup)
}

/// Numbers on a regular grid, x fastest.
#[derive(Debug)]
pub(super) struct Image<'a> {
    /// Name of the format for people.
    pub(super) format: &'static str,
    /// Name of the field.
    pub(super) field: &'a str,
    /// Numbers along x, y and z.
    pub(super) counts: [usize; 3],
    /// Where the first number is, and how far it is to the next.
    pub(super) first: DVec3,
    pub(super) step: DVec3,
    pub(super) values: Vec<f64>,
}

impl Image<'_> {
    /// The numbers of points or cells of a grid of that many points, if that can be.
    pub(super) fn counts(points: [f64; 3], of_cells: bool) -> Option<[usize; 3]> {
        let counts = points.map(|n| if of_cells { n - 1.0 } else { n });
        let fits = counts.iter().all(|n| *n >= 1.0 && *n < 1e6) && counts.iter().product::<f64>() <= 1e9;
        fits.then(|| counts.map(|n| n as usize))
    }
}

fn image(file: &str, vtk: &VtkFile<'_>, options: &ImportOptions) -> Result<Soup, ImportError> {
    let extent = vtk.numbers("ImageData", "WholeExtent")?;
    let [origin, spacing] = [vtk.numbers("ImageData", "Origin")?, vtk.numbers("ImageData", "Spacing")?];
    let (&[x0, x1, y0, y1, z0, z1], &[ox, oy, oz], &[dx, dy, dz]) = (&extent[..], &origin[..], &spacing[..])
    else {
        return Err(wrong(file, "ImageData", "extent, origin and spacing are six, three and three numbers"));
    };
    let (per_point, names) = (vtk.scalars("PointData"), vtk.scalars("CellData"));
    let of_cells = per_point.is_empty();
    let (group, names) = if of_cells { ("CellData", names) } else { ("PointData", per_point) };
    let Some(counts) = Image::counts([x1 - x0 + 1.0, y1 - y0 + 1.0, z1 - z0 + 1.0], of_cells) else {
        return Err(wrong(file, "ImageData", "its extent is empty or too large"));
    };
    let field = choose(file, &names, options)?;
    let values = vtk.array(group, Some(field), counts.iter().product())?;
    let step = DVec3::new(dx, dy, dz);
    // Values of cells stand in their middles.
    let middle = if of_cells { 0.5 * step } else { DVec3::ZERO };
    let first = DVec3::new(ox, oy, oz) + step * DVec3::new(x0, y0, z0) + middle;
    surface_in_image(file, &Image { format: "VTI", field, counts, first, step, values }, options)
}

/// Where the image has the value of the threshold.
pub(super) fn surface_in_image(
    file: &str,
    image: &Image<'_>,
    options: &ImportOptions,
) -> Result<Soup, ImportError> {
    let &Image { format, field, counts, first, step, ref values } = image;
    let total: usize = counts.iter().product();
    if values.len() != total {
        let problem = format!("{} numbers, but {total} are announced", values.len());
        return Err(wrong(file, field, &problem));
    }
    let limit = threshold(options, field);
    let sign = if options.inside == Inside::Above { 1.0 } else { -1.0 };
    // One more layer all around that is outside, so that what reaches the border is closed there, half a step beyond.
    let padded = counts.map(|n| n + 2);
    let spread = values.iter().fold(0.0f64, |m, v| m.max((v - limit).abs()));
    let at = |p: [usize; 3]| {
        let inner = (0..3).all(|d| p[d] > 0 && p[d] <= counts[d]);
        let [x, y, z] = p.map(|k| k.wrapping_sub(1));
        if inner {
            sign * (values[x + counts[0] * (y + counts[1] * z)] - limit)
        } else {
            -spread.max(f64::MIN_POSITIVE)
        }
    };
    let point = |p: [usize; 3]| first + step * (DVec3::from_array(p.map(|k| k as f64)) - 1.0);
    let index = |p: [usize; 3]| (p[0] + padded[0] * (p[1] + padded[1] * p[2])) as u64;
    let side = if options.inside == Inside::Above { "more" } else { "less" };
    let taken = format!("where {field} is {side} than {limit}");
    let mut soup = Soup { format, taken, ..Soup::default() };
    let mut vertices: BTreeMap<(u64, u64), u32> = BTreeMap::new();
    // Six tetrahedra around the diagonal of each cube: one for each order in which the axes are walked.
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    for z in 0..padded[2] - 1 {
        for y in 0..padded[1] - 1 {
            for x in 0..padded[0] - 1 {
                for (k, order) in ORDERS.iter().enumerate() {
                    let mut corner = [x, y, z];
                    let mut tetrahedron = [corner; 4];
                    for (n, &axis) in order.iter().enumerate() {
                        corner[axis] += 1;
                        tetrahedron[n + 1] = corner;
                    }
                    // The first three orders are even: their tetrahedra are right-handed.
                    if k >= 3 {
                        tetrahedron.swap(2, 3);
                    }
                    let heights = tetrahedron.map(at);
                    let mut vertex = |a: usize, b: usize| {
                        let (p, q) = (tetrahedron[a.min(b)], tetrahedron[a.max(b)]);
                        let (p, q) = if index(p) < index(q) { (p, q) } else { (q, p) };
                        *vertices.entry((index(p), index(q))).or_insert_with(|| {
                            // Not in a corner, where several edges would meet in one point.
                            let t = (at(p) / (at(p) - at(q))).clamp(1e-3, 1.0 - 1e-3);
                            soup.positions.push(point(p).lerp(point(q), t));
                            (soup.positions.len() - 1) as u32
                        })
                    };
                    let inside: Vec<usize> = (0..4).filter(|&n| heights[n] > 0.0).collect();
                    let outside: Vec<usize> = (0..4).filter(|&n| heights[n] <= 0.0).collect();
                    // Even permutations of the corners keep the tetrahedron right-handed.
                    let even = |list: [usize; 4]| {
                        let odd = (0..4)
                            .flat_map(|i| (0..i).map(move |j| (i, j)))
                            .filter(|&(i, j)| list[j] > list[i])
                            .count()
                            % 2;
                        odd == 0
                    };
                    match (&inside[..], &outside[..]) {
                        (&[a], &[b, c, d]) => {
                            let (c, d) = if even([a, b, c, d]) { (c, d) } else { (d, c) };
                            let triangle = [vertex(a, b), vertex(a, c), vertex(a, d)];
                            soup.triangles.push(triangle);
                        }
                        (&[b, c, d], &[a]) => {
                            let (c, d) = if even([a, b, c, d]) { (c, d) } else { (d, c) };
                            let triangle = [vertex(a, b), vertex(a, d), vertex(a, c)];
                            soup.triangles.push(triangle);
                        }
                        (&[a, b], &[c, d]) => {
                            let (c, d) = if even([a, b, c, d]) { (c, d) } else { (d, c) };
                            let [p, q, r, s] = [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)];
                            soup.triangles.push([p, q, r]);
                            soup.triangles.push([p, r, s]);
                        }
                        _ => {}
                    }
                }
            }
        }
    }
    if soup.triangles.is_empty() {
        let problem = format!("nowhere does {field} have the value {limit}; give another `threshold`");
        return Err(wrong(file, field, &problem));
    }
    soup.face_count = soup.triangles.len();
    soup.face_of = (0..soup.face_count as u32).collect();
    soup.check_finite(file)?;
    Ok(soup)
}
