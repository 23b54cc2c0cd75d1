//! What is written says what was meant.

use topipe_exchange::{Model, Numbers, Set, glb, inp, legacy_vtk, three_mf, vtp};
use topipe_mesh::TriangleMesh;

fn cube() -> TriangleMesh {
    let corner = |k: u32| [f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1)];
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh::from_arrays((0..8).map(corner).collect(), triangles)
}

fn model(mesh: &TriangleMesh) -> Model<'_> {
    Model {
        vertex_data: vec![(
            "height mm".into(),
            Numbers::Real(mesh.positions.iter().map(|p| p.z / 3.0).collect()),
        )],
        face_data: vec![("side".into(), Numbers::Whole((0..12).map(|f| f / 2).collect()))],
        face_colors: (0..12).map(|f| [20 * f, 0, 255]).collect(),
        face_sets: vec![Set { name: "hole-1".into(), members: (0..12).collect() }],
        vertex_sets: vec![Set { name: "frozen".into(), members: vec![0, 7] }],
        ..Model::new("a <cube>", mesh)
    }
}

#[test]
fn a_glb_has_whole_chunks_and_split_corners() {
    let mesh = cube();
    let mut bytes = Vec::new();
    glb(&model(&mesh), &mut bytes).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + word(12)]).unwrap();
    assert_eq!(&bytes[16..20], b"JSON");
    let position = &json["accessors"][0];
    // Every corner of a cube has three normals; each side has two colours, which share two corners.
    assert_eq!(position["count"], 36);
    assert_eq!(
        (position["min"].clone(), position["max"].clone()),
        ([0.0; 3].as_slice().into(), [1.0; 3].as_slice().into())
    );
    assert_eq!(json["accessors"][3]["count"], 36);
    let binary = 20 + word(12);
    assert_eq!((&bytes[binary + 4..binary + 8], word(binary)), (&b"BIN\0"[..], bytes.len() - binary - 8));
    assert_eq!(json["buffers"][0]["byteLength"], word(binary));
    let plain = Model { face_colors: vec![], ..model(&mesh) };
    let mut bytes = Vec::new();
    glb(&plain, &mut bytes).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("\"count\":24"));
}

#[test]
fn a_3mf_is_a_package_with_the_mesh() {
    let mesh = cube();
    let write = || {
        let mut bytes = Vec::new();
        three_mf(&model(&mesh), &mut bytes).unwrap();
        bytes
    };
    let bytes = write();
    assert_eq!(bytes, write());
    let mut package = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut text = String::new();
    std::io::Read::read_to_string(&mut package.by_name("3D/3dmodel.model").unwrap(), &mut text).unwrap();
    assert_eq!((text.matches("<vertex ").count(), text.matches("<triangle ").count()), (8, 12));
    assert!(text.contains("unit=\"millimeter\"") && text.contains("name=\"a &lt;cube&gt;\""));
    assert!(package.by_name("[Content_Types].xml").is_ok() && package.by_name("_rels/.rels").is_ok());
}

#[test]
fn vtk_files_hold_all_numbers() {
    let mesh = cube();
    let (mut xml, mut legacy) = (Vec::new(), Vec::new());
    vtp(&model(&mesh), &mut xml).unwrap();
    legacy_vtk(&model(&mesh), &mut legacy).unwrap();
    let (xml, legacy) = (String::from_utf8(xml).unwrap(), String::from_utf8(legacy).unwrap());
    for name in ["Name=\"height mm\"", "Name=\"side\"", "Name=\"rgb\"", "NumberOfPolys=\"12\""] {
        assert!(xml.contains(name), "{name}");
    }
    assert!(legacy.contains("SCALARS height_mm double 1\n") && legacy.contains("POLYGONS 12 48\n"));
    assert!(legacy.contains("\n0.3333333333333333\n"), "numbers are written in full");
}

#[test]
fn element_sets_are_numbered_from_one() {
    let mesh = cube();
    let mut text = Vec::new();
    inp(&model(&mesh), &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("*ELSET, ELSET=HOLE_1\n1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,\n"));
    assert!(text.contains("*NSET, NSET=FROZEN\n1, 8,\n"));
    assert!(text.contains("*ELEMENT, TYPE=S3, ELSET=SURFACE\n1, 1, 3, 4\n"));
}

#[test]
fn lists_that_do_not_fit_are_refused_before_a_byte_is_written() {
    let mesh = cube();
    let bad = [
        Model { vertex_data: vec![("x".into(), Numbers::Real(vec![1.0]))], ..Model::new("m", &mesh) },
        Model { face_data: vec![("x".into(), Numbers::Whole(vec![1]))], ..Model::new("m", &mesh) },
        Model { face_colors: vec![[0; 3]], ..Model::new("m", &mesh) },
        Model { face_sets: vec![Set { name: "s".into(), members: vec![12] }], ..Model::new("m", &mesh) },
    ];
    for model in &bad {
        let mut bytes = Vec::new();
        assert!(
            glb(model, &mut bytes).is_err()
                && three_mf(model, &mut bytes).is_err()
                && inp(model, &mut bytes).is_err()
        );
        assert!(
            vtp(model, &mut bytes).is_err() && legacy_vtk(model, &mut bytes).is_err() && bytes.is_empty()
        );
    }
    let empty = TriangleMesh::default();
    let mut bytes = Vec::new();
    glb(&Model::new("nothing", &empty), &mut bytes).unwrap();
}
