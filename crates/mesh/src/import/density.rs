//! The surface of a density field: of the kept cells of a grid (VTU), or where an image has a value (VTI).

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

fn wrong(file: &str, place: &str, problem: &str) -> ImportError {
    ImportError::Malformed { file: file.to_owned(), place: place.to_owned(), problem: problem.to_owned() }
}

/// The field that is meant: the one named, else `density`, else the only one.
fn choose<'a>(file: &str, names: &[&'a str], options: &ImportOptions) -> Result<&'a str, ImportError> {
    let named = |name: &str| names.iter().copied().find(|n| n.eq_ignore_ascii_case(name));
    match (&options.field, names) {
        (Some(field), _) => named(field),
        (None, [only]) => Some(*only),
        (None, _) => named("density"),
    }
    .ok_or_else(|| {
        let problem = format!(
            "the file has the fields {}; say with `field` which one is the density",
            names.join(", ")
        );
        wrong(file, "DataArray", &problem)
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

fn cells(file: &str, vtk: &VtkFile<'_>, options: &ImportOptions) -> Result<Soup, ImportError> {
    let points = whole(file, vtk, "Piece", "NumberOfPoints")?;
    let count = whole(file, vtk, "Piece", "NumberOfCells")?;
    let positions = vtk.array("Points", None, points.saturating_mul(3))?;
    let kinds = vtk.array("Cells", Some("types"), count)?;
    let ends = vtk.array("Cells", Some("offsets"), count)?;
    let corners = vtk.array("Cells", Some("connectivity"), count.saturating_mul(27))?;
    let names = vtk.scalars("CellData");
    // A mesh of solid cells and nothing else is a part as it is.
    let (field, density) = if names.is_empty() && options.field.is_none() {
        (
            "",
            vec![if options.inside == Inside::Above { f64::INFINITY } else { f64::NEG_INFINITY }; ends.len()],
        )
    } else {
        let field = choose(file, &names, options)?;
        (field, vtk.array("CellData", Some(field), count)?)
    };
    if positions.len() != points.saturating_mul(3) || [kinds.len(), ends.len(), density.len()] != [count; 3] {
        return Err(wrong(
            file,
            "DataArray",
            "an array has not as many numbers as there are points or cells",
        ));
    }
    let limit = threshold(options, field);
    let labels = vtk.scalars("CellData").into_iter().find(|n| n.eq_ignore_ascii_case("non_design"));
    let passive = labels.map(|name| vtk.array("CellData", Some(name), count)).transpose()?;
    let mut border: BTreeMap<Vec<u32>, (Vec<u32>, bool)> = BTreeMap::new();
    let mut start = 0;
    for cell in 0..count {
        let end = ends[cell] as usize;
        let Some(nodes) = corners.get(start..end) else {
            return Err(wrong(file, &format!("cell {cell}"), "its offsets point beyond the connectivity"));
        };
        start = end;
        let is_passive = passive.as_ref().is_some_and(|p| p.get(cell).is_some_and(|&p| p > 0.5));
        let inside = match options.inside {
            Inside::Above => density[cell] >= limit,
            Inside::Below => density[cell] <= limit,
        };
        if !inside && !is_passive {
            continue;
        }
        let Some((least, faces)) = faces_of(kinds[cell] as u8).filter(|(least, _)| nodes.len() >= *least)
        else {
            let problem = format!(
                "a cell of VTK type {} is not read; tetrahedra, hexahedra, wedges and pyramids are",
                kinds[cell]
            );
            return Err(wrong(file, &format!("cell {cell}"), &problem));
        };
        if let Some(&bad) = nodes[..least].iter().find(|&&v| !(v >= 0.0 && v < points as f64)) {
            return Err(wrong(
                file,
                &format!("cell {cell}"),
                &format!("it names point {bad}, but there are only {points}"),
            ));
        }
        for face in faces {
            let face: Vec<u32> = face.iter().map(|&k| nodes[k] as u32).collect();
            let mut key = face.clone();
            key.sort_unstable();
            // A face of two kept cells lies inside.
            if border.remove(&key).is_none() {
                border.insert(key, (face, is_passive));
            }
        }
    }
    if border.is_empty() {
        let problem = format!("no cell has a {field} beyond {limit}; give another `threshold`");
        return Err(wrong(file, "CellData", &problem));
    }
    let positions = positions.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect();
    let (mut list, mut face_ends, mut labelled) = (Vec::new(), Vec::new(), Vec::new());
    for (face, is_passive) in border.into_values() {
        list.extend(face);
        face_ends.push(list.len());
        labelled.push(is_passive);
    }
    let mut soup = Soup::from_polygons(file, "VTU", positions, &list, &face_ends)?;
    // What is cut out of a grid brings all points of the grid; those without faces are no defect.
    soup.repairs.clear();
    soup.unindexed = true;
    soup.non_design = passive.map(|_| labelled);
    Ok(soup)
}

fn image(file: &str, vtk: &VtkFile<'_>, options: &ImportOptions) -> Result<Soup, ImportError> {
    let extent = vtk.numbers("ImageData", "WholeExtent")?;
    let [origin, spacing] = [vtk.numbers("ImageData", "Origin")?, vtk.numbers("ImageData", "Spacing")?];
    let (&[x0, x1, y0, y1, z0, z1], &[ox, oy, oz], &[dx, dy, dz]) = (&extent[..], &origin[..], &spacing[..])
    else {
        return Err(wrong(file, "ImageData", "extent, origin and spacing are six, three and three numbers"));
    };
    let (per_point, names) = (vtk.scalars("PointData"), vtk.scalars("CellData"));
    let (group, names) = if per_point.is_empty() { ("CellData", names) } else { ("PointData", per_point) };
    let extra = if group == "PointData" { 1.0 } else { 0.0 };
    let counts = [x1 - x0 + extra, y1 - y0 + extra, z1 - z0 + extra];
    if counts.iter().any(|n| !(*n >= 1.0 && *n < 1e6)) || counts.iter().product::<f64>() > 1e9 {
        return Err(wrong(file, "ImageData", "its extent is empty or too large"));
    }
    let counts = counts.map(|n| n as usize);
    let field = choose(file, &names, options)?;
    let total = counts.iter().product();
    let values = vtk.array(group, Some(field), total)?;
    if values.len() != total {
        let problem = format!("{} numbers, but {total} are announced", values.len());
        return Err(wrong(file, field, &problem));
    }
    let limit = threshold(options, field);
    let sign = if options.inside == Inside::Above { 1.0 } else { -1.0 };
    let step = DVec3::new(dx, dy, dz);
    // Values of cells stand in their middles.
    let first = DVec3::new(ox, oy, oz) + step * DVec3::new(x0, y0, z0) + 0.5 * (1.0 - extra) * step;
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
    let mut soup = Soup { format: "VTI", ..Soup::default() };
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
