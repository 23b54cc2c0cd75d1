//! What import makes of each inmate of `fixtures/zoo/`.

use std::path::Path;
use topipe_mesh::Connectivity;
use topipe_mesh::import::{Components, ImportOptions, read};

fn outcome(name: &str, components: Components) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/zoo").join(name);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
    match read(name, &bytes, &ImportOptions { components, ..ImportOptions::default() }) {
        Err(error) => error.to_string(),
        Ok(part) => {
            let connectivity = Connectivity::build(&part.mesh).expect(name);
            assert!(connectivity.is_closed(), "{name}");
            assert_eq!(part.provenance.len(), part.mesh.vertex_count(), "{name}");
            assert_eq!(part.design.len(), part.mesh.face_count(), "{name}");
            let repairs: Vec<String> =
                part.import.repairs.iter().map(|r| format!("; {} {}", r.count, r.what)).collect();
            format!(
                "{}: {} vertices, {} faces, genus {}, {} shell(s), volume {:.6}{}",
                part.import.format,
                part.mesh.vertex_count(),
                part.mesh.face_count(),
                connectivity.genus(&part.mesh).expect(name),
                connectivity.components().1,
                part.mesh.volume(),
                repairs.concat(),
            )
        }
    }
}

#[test]
fn every_inmate_has_the_expected_outcome() {
    for &(name, expected) in LARGEST {
        assert_eq!(outcome(name, Components::Largest), expected, "{name}");
        let all = ALL.iter().find(|(n, _)| *n == name).map_or(expected, |(_, e)| e);
        assert_eq!(outcome(name, Components::All), all, "{name}, all components");
    }
}

#[test]
fn the_table_is_complete() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/zoo");
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, LARGEST.iter().map(|e| e.0).collect::<Vec<_>>());
}

/// Name of the file and what becomes of it with the default options.
#[rustfmt::skip]
const LARGEST: &[(&str, &str)] = &[
    ("ascii.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("bad-index.obj", "bad-index.obj, line 15: a vertex index was expected, not \"0\""),
    ("binary.stl", "STL (binary): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("blank.stl", "blank.stl: there are no faces in this file"),
    ("bow-tie-vertex.off", "OFF: 4 vertices, 4 faces, genus 0, 1 shell(s), volume 0.500000; 1 copied vertices where the surface touches itself; 1 dropped smaller components"),
    ("carriage-returns.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("checkered-voxels.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 48 welded vertices with equal coordinates; 36 took apart edges with more than two faces; 48 copied vertices where the surface touches itself; 13 dropped smaller components"),
    ("counts-in-header-line.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("crossing-cubes.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 dropped smaller components"),
    ("cube.obj", "OBJ: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 6 triangles added for faces with more than three corners"),
    ("cube.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("cubes-other-diagonal.off", "cubes-other-diagonal.off: faces 10 and 20 lie on each other at (1, 0.5, 0); unite the touching bodies in the program that made the mesh"),
    ("cubes-sharing-edge.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 2 welded vertices with equal coordinates; 1 took apart edges with more than two faces; 2 copied vertices where the surface touches itself; 1 dropped smaller components"),
    ("cubes-sharing-face.off", "OFF: 12 vertices, 20 faces, genus 0, 1 shell(s), volume 2.000000; 4 welded vertices with equal coordinates; 4 dropped internal faces (two back to back)"),
    ("cubes-sharing-vertex.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 welded vertices with equal coordinates; 1 copied vertices where the surface touches itself; 1 dropped smaller components"),
    ("decimal-comma.stl", "decimal-comma.stl, line 6: a number was expected, not \"1,0\""),
    ("duplicate-faces.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 2 dropped duplicate faces"),
    ("empty.stl", "empty.stl: there are no faces in this file"),
    ("fin.off", "fin.off: the surface is not closed: it has 1 border; the longest, 2 edges and 3.0000 long, passes (1.5, 1.5, 0.25) beside face 12; close the holes in the program that made the mesh"),
    ("flap.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 2 dropped internal faces (two back to back)"),
    ("four-corners.stl", "four-corners.stl, line 2: a facet with 4 vertices; STL knows triangles only"),
    ("hostile-count.off", "hostile-count.off: the file is cut off: 4000000000 vertices should be there, but only 1 vertices; copy or export it again"),
    ("hostile-count.ply", "hostile-count.ply: the file is cut off: 4000000000 elements \"face\" should be there, but only 244 bytes; copy or export it again"),
    ("hostile-count.stl", "hostile-count.stl: the file is cut off: 4294967295 faces should be there, but only 12 faces; copy or export it again"),
    ("hostile-face.off", "hostile-face.off, line 11: a vertex index was expected, not the end of the line"),
    ("index-out-of-range.off", "index-out-of-range.off: face 0 names vertex 9, but there are only 8 vertices"),
    ("infinite.stl", "infinite.stl: corner 1 of face 2 has a coordinate that is not a number, or beyond all bounds: (1, 0, inf)"),
    ("inner-wall.off", "inner-wall.off: 3 faces meet at the edge from (1, 0, 0) to (1, 1, 0) (faces 1, 10, 19) and do not separate inside from outside; remove inner walls in the program that made the mesh"),
    ("inverted-cube.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 turned shells that were inside out"),
    ("klein-bottle.off", "klein-bottle.off: the surface has only one side (like a Moebius strip): faces 414 and 415 can not be turned to agree at (-4.0824, -0.5893, -0.0417)"),
    ("minus-zero.stl", "STL (binary): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("mixed-orientation.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 2 turned faces to agree with their neighbours"),
    ("moebius.off", "moebius.off: the surface is not closed: it has 1 border; the longest, 32 edges and 37.5878 long, passes (2.4093, 0.4802, -0.0488) beside face 0; close the holes in the program that made the mesh"),
    ("nameless-solid.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("nested-shells.off", "OFF: 16 vertices, 24 faces, genus 0, 2 shell(s), volume 26.000000; 1 turned shells that were inside out"),
    ("no-facets.stl", "no-facets.stl: there are no faces in this file"),
    ("no-properties.ply", "no-properties.ply: the file is cut off: 4000000000 elements \"ghost\" should be there, but only 260 bytes; copy or export it again"),
    ("not-a-number.stl", "not-a-number.stl: corner 2 of face 0 has a coordinate that is not a number, or beyond all bounds: (1, NaN, 0)"),
    ("open-box.off", "open-box.off: the surface is not closed: it has 1 border; the longest, 4 edges and 4.0000 long, passes (0.5, 0, 1) beside face 3; close the holes in the program that made the mesh"),
    ("pillow.off", "pillow.off: the surface encloses no volume; a solid is needed"),
    ("repeated-corner.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 dropped faces with a repeated corner"),
    ("solid-header.stl", "STL (binary): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("solid-in-cavity.off", "OFF: 16 vertices, 24 faces, genus 0, 2 shell(s), volume 98.000000; 1 turned shells that were inside out; 1 dropped smaller components"),
    ("spike-through-side.off", "spike-through-side.off: the surface passes through itself in 5 place(s), the first at (0.3, 0.3, 0) between faces 0 and 2; unite the bodies in the program that made the mesh, or set allow_self_intersection"),
    ("t-junction.off", "t-junction.off: the surface is not closed: it has 1 border; the longest, 3 edges and 2.0000 long, passes (0.5, 0, 0) beside face 4; close the holes in the program that made the mesh; nothing is missing there, but its two sides do not share their vertices; where these nearly coincide, weld_tolerance helps"),
    ("tetrahedron.ply", "PLY (ASCII): 4 vertices, 4 faces, genus 0, 1 shell(s), volume 0.166667"),
    ("text.stl", "text.stl: this is not a mesh that can be read; STL, OFF, OBJ, PLY, VTU, VTI, VTK and INP can"),
    ("touching-pillars.off", "OFF: 37 vertices, 74 faces, genus 1, 1 shell(s), volume 10.000000; 44 welded vertices with equal coordinates; 48 dropped internal faces (two back to back); 1 took apart edges with more than two faces; 1 divided edges along which the surface touches itself"),
    ("trailing-bytes.stl", "STL (binary): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 4 ignored bytes after the last face"),
    ("trailing-text.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 ignored lines after the end of the solid"),
    ("truncated-ascii.stl", "truncated-ascii.stl: the file is cut off: the end of the solid should be there, but only a broken line 44; copy or export it again"),
    ("truncated-binary.stl", "truncated-binary.stl: the file is cut off: 12 faces should be there, but only 6 faces; copy or export it again"),
    ("truncated-header.stl", "truncated-header.stl: the file is cut off: a header of 84 bytes should be there, but only 60 bytes; copy or export it again"),
    ("truncated.ply", "truncated.ply, line 16: Couldn't read element line. String: '3 0 ' Error: Expected 3 list elements, but found only 1."),
    ("two-components.off", "OFF: 8 vertices, 12 faces, genus 0, 1 shell(s), volume 8.000000; 1 dropped smaller components"),
    ("two-solids.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000; 1 dropped smaller components"),
    ("upper-case-bom.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("voxel-block.off", "OFF: 56 vertices, 108 faces, genus 0, 1 shell(s), volume 27.000000; 152 welded vertices with equal coordinates; 216 dropped internal faces (two back to back)"),
    ("without-normals.stl", "STL (ASCII): 8 vertices, 12 faces, genus 0, 1 shell(s), volume 1.000000"),
    ("zero-area-face.off", "OFF: 9 vertices, 14 faces, genus 0, 1 shell(s), volume 1.000000; 1 flipped the longest edge of faces without area"),
];

/// The same with `components = "all"`, where that makes a difference.
#[rustfmt::skip]
const ALL: &[(&str, &str)] = &[
    ("bow-tie-vertex.off", "OFF: 8 vertices, 8 faces, genus 0, 2 shell(s), volume 1.000000; 1 copied vertices where the surface touches itself"),
    ("checkered-voxels.off", "OFF: 112 vertices, 168 faces, genus 0, 14 shell(s), volume 14.000000; 48 welded vertices with equal coordinates; 36 took apart edges with more than two faces; 48 copied vertices where the surface touches itself"),
    ("crossing-cubes.off", "crossing-cubes.off: the surface passes through itself in 12 place(s), the first at (1, 0.4, 1) between faces 2 and 16; unite the bodies in the program that made the mesh, or set allow_self_intersection"),
    ("cubes-sharing-edge.off", "OFF: 16 vertices, 24 faces, genus 0, 2 shell(s), volume 2.000000; 2 welded vertices with equal coordinates; 1 took apart edges with more than two faces; 2 copied vertices where the surface touches itself"),
    ("cubes-sharing-vertex.off", "OFF: 16 vertices, 24 faces, genus 0, 2 shell(s), volume 2.000000; 1 welded vertices with equal coordinates; 1 copied vertices where the surface touches itself"),
    ("solid-in-cavity.off", "OFF: 24 vertices, 36 faces, genus 0, 3 shell(s), volume 99.000000; 1 turned shells that were inside out"),
    ("two-components.off", "OFF: 16 vertices, 24 faces, genus 0, 2 shell(s), volume 9.000000"),
    ("two-solids.stl", "STL (ASCII): 16 vertices, 24 faces, genus 0, 2 shell(s), volume 2.000000"),
];
