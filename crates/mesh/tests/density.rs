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
