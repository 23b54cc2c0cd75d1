//! Density fields as optimizers write them.

use topipe_mesh::import::{ImportOptions, Inside, read};
use topipe_mesh::{Connectivity, Design, Part};

fn closed(part: &Part) {
    let connectivity = Connectivity::build(&part.mesh).unwrap();
    assert!(connectivity.is_closed());
    assert!(part.mesh.volume() > 0.0);
}

/// Two cubes side by side, one of them full.
fn two_cubes(density: &str, extra: &str) -> String {
    let points: Vec<String> = (0..12).map(|k| format!("{} {} {}", k % 3, k / 3 % 2, k / 6)).collect();
    format!(
        "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"12\" NumberOfCells=\"2\">\
         <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">{}</DataArray></Points>\
         <Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 4 3 6 7 10 9 1 2 5 4 7 8 11 10</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">8 16</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">12 12</DataArray></Cells>\
         <CellData><DataArray type=\"Float64\" Name=\"density\" format=\"ascii\">{density}</DataArray>{extra}</CellData>\
         </Piece></UnstructuredGrid></VTKFile>",
        points.join(" ")
    )
}

#[test]
fn kept_cells_become_their_border() {
    let options = ImportOptions::default();
    let one = read("a.vtu", two_cubes("0.9 0.1", "").as_bytes(), &options).unwrap();
    closed(&one);
    assert_eq!((one.mesh.face_count(), one.mesh.volume()), (12, 1.0));
    let both = read("a.vtu", two_cubes("0.9 0.6", "").as_bytes(), &options).unwrap();
    assert_eq!((both.mesh.face_count(), both.mesh.volume()), (20, 2.0));
    let none = read("a.vtu", two_cubes("0.1 0.2", "").as_bytes(), &options).unwrap_err();
    assert!(none.to_string().contains("give another `threshold`"), "{none}");
    let low = ImportOptions { threshold: Some(0.15), ..ImportOptions::default() };
    let other = read("a.vtu", two_cubes("0.1 0.2", "").as_bytes(), &low).unwrap();
    assert_eq!(other.mesh.bounds().0.x, 1.0);
    let below = ImportOptions { inside: Inside::Below, ..ImportOptions::default() };
    assert_eq!(read("a.vtu", two_cubes("0.9 0.1", "").as_bytes(), &below).unwrap().mesh.bounds().0.x, 1.0);
    // Non-design cells are kept and labelled.
    let passive = "<DataArray type=\"UInt8\" Name=\"non_design\" format=\"ascii\">0 1</DataArray>";
    let labelled = read("a.vtu", two_cubes("0.9 0.1", passive).as_bytes(), &options).unwrap();
    assert_eq!(labelled.mesh.volume(), 2.0);
    assert_eq!(labelled.design.iter().filter(|d| **d == Design::NonDesign).count(), 10);
}

#[test]
fn an_image_of_a_ball_is_a_ball() {
    let (n, center) = (16, 7.3);
    let mut values = String::new();
    for k in 0..n * n * n {
        let p = [k % n, k / n % n, k / n / n].map(|x| f64::from(x) - center);
        let r = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        values += &format!("{} ", 5.0 - r);
    }
    let file = format!(
        "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 {m} 0 {m} 0 {m}\" Origin=\"1 2 3\" \
         Spacing=\"0.5 0.5 0.5\"><Piece Extent=\"0 {m} 0 {m} 0 {m}\"><PointData>\
         <DataArray type=\"Float32\" Name=\"distance\" format=\"ascii\">{values}</DataArray></PointData></Piece></ImageData></VTKFile>",
        m = n - 1
    );
    let ball = read("ball.vti", file.as_bytes(), &ImportOptions::default()).unwrap();
    closed(&ball);
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 2.5f64.powi(3);
    assert!((ball.mesh.volume() / exact - 1.0).abs() < 0.03, "{}", ball.mesh.volume());
    let (low, high) = ball.mesh.bounds();
    assert!(
        (low.x - (1.0 + 0.5 * center - 2.5)).abs() < 0.05
            && (high.z - (3.0 + 0.5 * center + 2.5)).abs() < 0.05
    );
    // Half of it: what reaches the border of the image is closed there.
    let cut = ImportOptions { threshold: Some(-20.0), ..ImportOptions::default() };
    let all = read("ball.vti", file.as_bytes(), &cut).unwrap();
    closed(&all);
    assert!((all.mesh.volume() / 7.5f64.powi(3) - 1.0).abs() < 0.3, "{}", all.mesh.volume());
}

#[test]
fn damaged_files_are_refused() {
    let whole = two_cubes("0.9 0.1", "");
    for (from, to) in [
        ("8 16", "8 99"),
        ("0 1 4 3", "0 1 4 77"),
        ("12 12", "12 7"),
        ("Name=\"density\"", "Name=\"a\""),
        ("NumberOfCells=\"2\"", "NumberOfCells=\"99999999999999\""),
        ("LittleEndian", "BigEndian"),
        ("format=\"ascii\">0.9", "format=\"appended\" offset=\"7\">0.9"),
        ("format=\"ascii\">0.9 0.1", "format=\"binary\">%%%%"),
    ] {
        let damaged = whole.replacen(from, to, 1);
        assert_ne!(damaged, whole);
        let result = read("a.vtu", damaged.as_bytes(), &ImportOptions::default());
        // The only field is taken whatever its name; a kind of cell counts only where it is kept.
        if from.starts_with("Name") || to == "12 7" {
            assert!(result.is_ok());
        } else {
            assert!(result.is_err(), "{to}");
        }
    }
    for cut in (0..whole.len()).step_by(7) {
        let _ = read("a.vtu", &whole.as_bytes()[..cut], &ImportOptions::default());
    }
}

const POINTS: &str = "0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0 0 0 1 1 0 1 2 0 1 0 1 1 1 1 1 2 1 1";

/// The two cubes in the legacy format: as cells were listed up to version 4, and since.
fn two_cubes_legacy(version: u32, data: &str) -> String {
    let (first, second) = ("0 1 4 3 6 7 10 9", "1 2 5 4 7 8 11 10");
    let cells = match version {
        5 => format!(
            "CELLS 3 16\nOFFSETS vtktypeint64\n0 8 16\nCONNECTIVITY vtktypeint64\n{first}\n{second}\n"
        ),
        _ => format!("CELLS 2 18\n8 {first}\n8 {second}\n"),
    };
    format!(
        "# vtk DataFile Version {version}.0\ntwo cubes\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 12 float\n{POINTS}\n\
         {cells}CELL_TYPES 2\n12\n12\n{data}"
    )
}

#[test]
fn legacy_files_are_read_as_the_others_are() {
    let scalars =
        |name: &str, values: &str| format!("SCALARS {name} float 1\nLOOKUP_TABLE default\n{values}\n");
    let one = format!("CELL_DATA 2\n{}", scalars("density", "0.9 0.1"));
    let named = |field: &str| ImportOptions { field: Some(field.into()), ..ImportOptions::default() };
    for version in [3, 5] {
        let part = read("a.vtk", two_cubes_legacy(version, &one).as_bytes(), &named("density")).unwrap();
        closed(&part);
        assert_eq!((part.mesh.face_count(), part.mesh.volume()), (12, 1.0));
        assert_eq!(part.import.format, "VTK: cells with density of at least 0.5");
        // Without numbers all is material.
        let all = read("a.vtk", two_cubes_legacy(version, "").as_bytes(), &ImportOptions::default()).unwrap();
        assert_eq!(all.mesh.volume(), 2.0);
    }
    // One field for each iteration, and vectors that are passed over.
    let series = format!(
        "CELL_DATA 2\n{}VECTORS u float\n1 2 3 4 5 6\n{}FIELD f 2\ntwo 2 2 double\n1 2 3 4\nnon_design 1 2 int\n1 0\n",
        scalars("state000", "1 1"),
        scalars("state001", "0 1")
    );
    let series = two_cubes_legacy(3, &series);
    let refused = read("a.vtk", series.as_bytes(), &ImportOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("state000, state001, non_design; say with `field`"), "{refused}");
    let last = read("a.vtk", series.as_bytes(), &named("state001")).unwrap();
    assert_eq!(last.mesh.volume(), 2.0, "the other one is non-design");
    assert_eq!(last.design.iter().filter(|d| **d == Design::NonDesign).count(), 10);
}

#[test]
fn a_binary_legacy_file_is_read() {
    let floats = |text: &str| -> Vec<u8> {
        text.split_whitespace().flat_map(|x| x.parse::<f32>().unwrap().to_be_bytes()).collect()
    };
    let ints = |text: &str| -> Vec<u8> {
        text.split_whitespace().flat_map(|x| x.parse::<i32>().unwrap().to_be_bytes()).collect()
    };
    let file = [
        b"# vtk DataFile Version 3.0\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 12 float\n".to_vec(),
        floats(POINTS),
        b"\nCELLS 2 18\n".to_vec(),
        ints("8 0 1 4 3 6 7 10 9 8 1 2 5 4 7 8 11 10"),
        b"\nCELL_TYPES 2\n".to_vec(),
        ints("12 12"),
        b"\nCELL_DATA 2\nSCALARS rho float\nLOOKUP_TABLE default\n".to_vec(),
        floats("0.2 0.8"),
        b"\n".to_vec(),
    ]
    .concat();
    let part = read("a.vtk", &file, &ImportOptions::default()).unwrap();
    assert_eq!((part.mesh.volume(), part.mesh.bounds().0.x), (1.0, 1.0));
    for cut in 0..file.len() {
        let _ = read("a.vtk", &file[..cut], &ImportOptions::default());
    }
}

#[test]
fn structured_points_and_surfaces_are_read_from_legacy_files() {
    let n = 8;
    let values: Vec<String> = (0..n * n * n)
        .map(|k| {
            let p = [k % n, k / n % n, k / n / n].map(|x| f64::from(x) - 3.5);
            format!("{}", u8::from(p.iter().map(|x| x * x).sum::<f64>() < 6.0))
        })
        .collect();
    let header = "# vtk DataFile Version 2.0\nball\nASCII\nDATASET STRUCTURED_POINTS\n";
    let grid = format!(
        "ORIGIN 0 0 0\nSPACING 2 2 2\nPOINT_DATA {}\nSCALARS x int\n{}",
        n * n * n,
        values.join("\n")
    );
    let points = format!("{header}DIMENSIONS {n} {n} {n}\n{grid}");
    let ball = read("ball.vtk", points.as_bytes(), &ImportOptions::default()).unwrap();
    closed(&ball);
    let cells = points.replace("POINT_DATA", "CELL_DATA").replace("8 8 8", "9 9 9");
    let moved = read("ball.vtk", cells.as_bytes(), &ImportOptions::default()).unwrap();
    assert!((moved.mesh.volume() / ball.mesh.volume() - 1.0).abs() < 1e-12);
    assert!((moved.mesh.bounds().0 - ball.mesh.bounds().0).abs_diff_eq(glam::DVec3::ONE, 1e-12));
    let surface = "# vtk DataFile Version 3.0\ntetrahedron\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n\
        0 0 0 1 0 0 0 1 0 0 0 1\nPOLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
    let part = read("t.vtk", surface.as_bytes(), &ImportOptions::default()).unwrap();
    assert!((part.mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
    for (from, to, expected) in [
        ("POLYDATA", "RECTILINEAR_GRID", "RECTILINEAR_GRID is not read"),
        ("POLYGONS 4 16", "POLYGONS 4 12", "more points than are listed"),
        ("POINTS 4", "POINTS 400000000000", "a number was expected, not \"POLYGONS\""),
        ("3 0 2 1", "3 0 2 9", "9"),
        ("ASCII", "TEXT", "ASCII or BINARY"),
    ] {
        let error = read("t.vtk", surface.replacen(from, to, 1).as_bytes(), &ImportOptions::default());
        let error = error.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn the_solid_elements_of_a_deck_are_a_part() {
    let nodes: Vec<String> = POINTS
        .split_whitespace()
        .collect::<Vec<_>>()
        .chunks(3)
        .enumerate()
        .map(|(k, p)| format!("{}, {}.D+00, {}., {}", 10 * (k + 1), p[0], p[1], p[2]))
        .collect();
    let deck = format!(
        "** from an optimizer\n*Heading\n of two cubes\n*NODE, NSET=ALL\n{}\n*ELEMENT, TYPE=C3D8R, ELSET=EALL\n\
         1, 10, 20, 50, 40, 70, 80, 110,\n100\n2, 20, 30, 60, 50, 80, 90, 120, 110\n\
         *ELSET, ELSET=STATE1\n2,\n*ELSET, ELSET=BOTH, GENERATE\n1, 2, 1\n*ELSET, ELSET=TWICE\nSTATE1, 1\n",
        nodes.join("\n")
    );
    let kept = |set: Option<&str>| {
        read(
            "a.inp",
            deck.as_bytes(),
            &ImportOptions { field: set.map(Into::into), ..ImportOptions::default() },
        )
    };
    for (set, volume) in [(None, 2.0), (Some("state1"), 1.0), (Some("BOTH"), 2.0), (Some("TWICE"), 2.0)] {
        let part = kept(set).unwrap();
        closed(&part);
        assert_eq!(part.mesh.volume(), volume, "{set:?}");
    }
    assert_eq!(kept(Some("STATE1")).unwrap().mesh.bounds().0.x, 1.0);
    assert!(kept(Some("X")).unwrap_err().to_string().contains("there is no element set X; there are BOTH"));
    let labelled = deck.replace("STATE1", "NON_DESIGN");
    let part = read("a.inp", labelled.as_bytes(), &ImportOptions::default()).unwrap();
    assert_eq!(part.design.iter().filter(|d| **d == Design::NonDesign).count(), 10);
    // A wedge and shells.
    let wedge =
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,1,0,1\n6,0,1,1\n*ELEMENT,TYPE=C3D6\n1,1,2,3,4,5,6\n";
    assert_eq!(read("w.inp", wedge.as_bytes(), &ImportOptions::default()).unwrap().mesh.volume(), 0.5);
    let shells =
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=S3\n1,1,3,2\n2,1,2,4\n3,2,3,4\n4,3,1,4\n";
    let part = read("s.inp", shells.as_bytes(), &ImportOptions::default()).unwrap();
    assert!((part.mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
    for (from, to, expected) in [
        ("C3D8R", "CPE4", "elements of type \"CPE4\" are not read"),
        ("2, 20, 30", "2, 20, 31", "there is no node 31"),
        ("110,\n100", "110", "an element of 8 nodes has 16"),
        ("*ELSET, ELSET=STATE1", "*INCLUDE, INPUT=x", "put them into one deck"),
        ("1, 2, 1\n*", "1\n*", "first, last and step"),
    ] {
        let damaged = deck.replacen(from, to, 1);
        assert_ne!(damaged, deck);
        let error = read("a.inp", damaged.as_bytes(), &ImportOptions::default()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    for cut in (0..deck.len()).step_by(3) {
        let _ = read("a.inp", &deck.as_bytes()[..cut], &ImportOptions::default());
    }
}
