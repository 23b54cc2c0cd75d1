//! Writes `fixtures/zoo/`: small meshes and files with one defect each. What import makes of them is the table in
//! `tests/zoo.rs`. `cargo run -p topipe-mesh --example make_zoo`

use std::fmt::Write as _;
use std::path::Path;

type Point = [f64; 3];

/// Points and faces of any number of corners.
#[derive(Clone, Default)]
struct Mesh {
    points: Vec<Point>,
    faces: Vec<Vec<usize>>,
}

impl Mesh {
    /// An axis-aligned cube of triangles with its normals outward.
    fn cube(low: Point, size: f64) -> Self {
        let corner = |k: usize| [0, 1, 2].map(|axis| low[axis] + if k >> axis & 1 == 1 { size } else { 0.0 });
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|&[a, b, c, d]| [vec![a, b, c], vec![a, c, d]]).collect();
        Self { points: (0..8).map(corner).collect(), faces }
    }

    fn with(mut self, other: Self) -> Self {
        let first = self.points.len();
        self.points.extend(other.points);
        self.faces.extend(other.faces.into_iter().map(|f| f.into_iter().map(|v| v + first).collect()));
        self
    }

    fn inverted(mut self) -> Self {
        self.faces.iter_mut().for_each(|f| f.reverse());
        self
    }

    fn off(&self) -> String {
        let mut text = format!("OFF\n{} {} 0\n", self.points.len(), self.faces.len());
        for [x, y, z] in &self.points {
            writeln!(text, "{x} {y} {z}").expect("strings take all text");
        }
        for face in &self.faces {
            write!(text, "{}", face.len()).expect("strings take all text");
            for v in face {
                write!(text, " {v}").expect("strings take all text");
            }
            text.push('\n');
        }
        text
    }

    fn ascii(&self) -> String {
        let mut text = String::from("solid part\n");
        for face in &self.faces {
            text.push_str("facet normal 0 0 0\n outer loop\n");
            for [x, y, z] in face.iter().map(|&v| self.points[v]) {
                writeln!(text, "  vertex {x} {y} {z}").expect("strings take all text");
            }
            text.push_str(" endloop\nendfacet\n");
        }
        text + "endsolid part\n"
    }

    fn binary(&self, header: &str) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes[..header.len()].copy_from_slice(header.as_bytes());
        bytes.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            bytes.extend([0; 12]);
            for x in face.iter().flat_map(|&v| self.points[v]) {
                bytes.extend((x as f32).to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
        bytes
    }
}

/// A strip around a ring with half a turn.
fn moebius() -> Mesh {
    let n = 16;
    let mut mesh = Mesh::default();
    for i in 0..n {
        let u = std::f64::consts::TAU * i as f64 / n as f64;
        for side in [-0.5, 0.5] {
            let r = 3.0 + side * (u / 2.0).cos();
            mesh.points.push([r * u.cos(), r * u.sin(), side * (u / 2.0).sin()]);
        }
    }
    for i in 0..n {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i + 1 < n { (a + 2, b + 2) } else { (1, 0) };
        mesh.faces.extend([vec![a, c, b], vec![b, c, d]]);
    }
    mesh
}

/// A Klein bottle as a figure eight that is turned by half a turn on its way around a ring.
fn klein() -> Mesh {
    use std::f64::consts::TAU;
    let (n, m) = (24, 16);
    let mut mesh = Mesh::default();
    for i in 0..n {
        for k in 0..m {
            // The offset keeps the double line of the eight from having vertices.
            let (u, v) = (TAU * i as f64 / n as f64, TAU * (k as f64 + 0.3) / m as f64);
            let (s, t) = (v.sin(), (2.0 * v).sin());
            let r = 4.0 + (u / 2.0).cos() * s - (u / 2.0).sin() * t;
            mesh.points.push([r * u.cos(), r * u.sin(), (u / 2.0).sin() * s + (u / 2.0).cos() * t]);
        }
    }
    let at = |i: usize, k: usize| i * m + k % m;
    for i in 0..n {
        for k in 0..m {
            let (a, b) = (at(i, k), at(i, k + 1));
            // After one way around, v has become -v; with the offset of the grid that is the grid again only for
            // the topology, which is what counts here.
            let (c, d) = if i + 1 < n {
                (at(i + 1, k), at(i + 1, k + 1))
            } else {
                (at(0, m - k), at(0, 2 * m - k - 1))
            };
            mesh.faces.extend([vec![a, c, b], vec![b, c, d]]);
        }
    }
    mesh
}

/// A block of unit voxels, each with all its faces.
fn voxels(cells: &[[i32; 3]]) -> Mesh {
    cells.iter().fold(Mesh::default(), |mesh, c| mesh.with(Mesh::cube(c.map(f64::from), 1.0)))
}

/// Two pillars between two plates, touching along an edge: the ends of the edge are single fans, so that it can not be
/// taken apart by copying its ends.
fn touching_pillars() -> Mesh {
    let plate = |z| [[0, 0, z], [1, 0, z], [0, 1, z], [1, 1, z]];
    voxels(&[plate(0).as_slice(), &[[0, 0, 1], [1, 1, 1]], &plate(2)].concat())
}

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/zoo");
    std::fs::create_dir_all(&folder)?;
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes);
    let cube = || Mesh::cube([0.0; 3], 1.0);

    // Surfaces.
    write("cube.off", cube().off().as_bytes())?;
    write("inverted-cube.off", cube().inverted().off().as_bytes())?;
    let mut mixed = cube();
    mixed.faces[3].reverse();
    mixed.faces[8].reverse();
    write("mixed-orientation.off", mixed.off().as_bytes())?;
    let mut open = cube();
    open.faces.drain(2..4);
    write("open-box.off", open.off().as_bytes())?;
    write("moebius.off", moebius().off().as_bytes())?;
    write("klein-bottle.off", klein().off().as_bytes())?;
    write("cubes-sharing-vertex.off", cube().with(Mesh::cube([1.0; 3], 1.0)).off().as_bytes())?;
    write("cubes-sharing-edge.off", cube().with(Mesh::cube([1.0, 1.0, 0.0], 1.0)).off().as_bytes())?;
    write("cubes-sharing-face.off", voxels(&[[0, 0, 0], [1, 0, 0]]).off().as_bytes())?;
    let mut other_diagonal = Mesh::cube([1.0, 0.0, 0.0], 1.0);
    // The shared face of the second cube, cut along its other diagonal.
    other_diagonal.faces[8] = vec![0, 4, 2];
    other_diagonal.faces[9] = vec![4, 6, 2];
    write("cubes-other-diagonal.off", cube().with(other_diagonal).off().as_bytes())?;
    write("touching-pillars.off", touching_pillars().off().as_bytes())?;
    let bow_tie = Mesh {
        points: vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
            [-1.0, -1.0, 1.0],
            [1.0, 0.0, -1.0],
            [0.0, 1.0, -1.0],
            [-1.0, -1.0, -1.0],
        ],
        faces: [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3], [0, 4, 5], [0, 5, 6], [0, 6, 4], [4, 6, 5]]
            .map(|f| f.to_vec())
            .to_vec(),
    };
    write("bow-tie-vertex.off", bow_tie.off().as_bytes())?;
    let mut t_junction = cube();
    t_junction.points.push([0.5, 0.0, 0.0]);
    // Edge 0-1 is divided in the bottom, but not in the front.
    t_junction.faces[1] = vec![0, 3, 8];
    t_junction.faces.push(vec![8, 3, 1]);
    write("t-junction.off", t_junction.off().as_bytes())?;
    let mut zero_area = t_junction.clone();
    zero_area.faces.push(vec![0, 8, 1]);
    write("zero-area-face.off", zero_area.off().as_bytes())?;
    let mut repeated = cube();
    repeated.faces.push(vec![3, 3, 5]);
    write("repeated-corner.off", repeated.off().as_bytes())?;
    let mut duplicated = cube();
    duplicated.faces.push(vec![1, 5, 0]);
    duplicated.faces.push(duplicated.faces[7].clone());
    write("duplicate-faces.off", duplicated.off().as_bytes())?;
    let mut membrane = voxels(&[[0, 0, 0], [1, 0, 0]]);
    // One of the two coincident walls is missing: the solid is divided by a sheet.
    membrane.faces.drain(10..12);
    write("inner-wall.off", membrane.off().as_bytes())?;
    let mut fin = cube();
    fin.points.push([2.0, 2.0, 0.5]);
    fin.faces.push(vec![3, 7, 8]);
    write("fin.off", fin.off().as_bytes())?;
    write("nested-shells.off", Mesh::cube([-1.0; 3], 3.0).with(cube()).off().as_bytes())?;
    let russian = Mesh::cube([-2.0; 3], 5.0).with(Mesh::cube([-1.0; 3], 3.0)).with(cube());
    write("solid-in-cavity.off", russian.off().as_bytes())?;
    write("two-components.off", Mesh::cube([5.0, 0.0, 0.0], 2.0).with(cube()).off().as_bytes())?;
    let mut pillow = cube();
    pillow.faces = vec![vec![0, 1, 3], vec![0, 3, 1]];
    write("pillow.off", pillow.off().as_bytes())?;
    let crossing = cube().with(Mesh::cube([0.3, 0.4, 0.55], 1.0));
    write("crossing-cubes.off", crossing.off().as_bytes())?;
    let mut spike = cube();
    // A corner is pulled through the opposite side.
    spike.points[7] = [0.4, 0.45, -0.5];
    write("spike-through-side.off", spike.off().as_bytes())?;
    let mut flap = cube();
    flap.points.push([3.0, 3.0, 0.5]);
    flap.faces.extend([vec![3, 7, 8], vec![7, 3, 8]]);
    write("flap.off", flap.off().as_bytes())?;
    let checkered: Vec<[i32; 3]> =
        (0..27).map(|k| [k % 3, k / 3 % 3, k / 9]).filter(|c| c.iter().sum::<i32>() % 2 == 0).collect();
    write("checkered-voxels.off", voxels(&checkered).off().as_bytes())?;
    let block: Vec<[i32; 3]> = (0..27).map(|k| [k % 3, k / 3 % 3, k / 9]).collect();
    write("voxel-block.off", voxels(&block).off().as_bytes())?;

    // Files.
    let ascii = cube().ascii();
    write("empty.stl", b"")?;
    write("blank.stl", b" \n\n")?;
    write("no-facets.stl", b"solid nothing\nendsolid nothing\n")?;
    write(
        "text.stl",
        b"this is not a mesh, although its name says so, and it is longer than the header is; so it goes",
    )?;
    write("ascii.stl", ascii.as_bytes())?;
    write("without-normals.stl", ascii.replace("facet normal 0 0 0", "facet").as_bytes())?;
    write("nameless-solid.stl", ascii.replace(" part", "").as_bytes())?;
    write("upper-case-bom.stl", format!("\u{feff}{}", ascii.to_uppercase()).as_bytes())?;
    write("carriage-returns.stl", ascii.replace('\n', "\r\n").as_bytes())?;
    write("two-solids.stl", (ascii.clone() + &Mesh::cube([3.0; 3], 1.0).ascii()).as_bytes())?;
    write("decimal-comma.stl", ascii.replacen("vertex 1 1 0", "vertex 1,0 1,0 0", 1).as_bytes())?;
    write("not-a-number.stl", ascii.replacen("vertex 1 1 0", "vertex 1 NaN 0", 1).as_bytes())?;
    write("trailing-text.stl", (ascii.clone() + "exported by hand\n").as_bytes())?;
    write("truncated-ascii.stl", &ascii.as_bytes()[..ascii.len() / 2])?;
    let quad = ascii.replacen("vertex 1 1 0\n", "vertex 1 1 0\n  vertex 1 0.5 0\n", 1);
    write("four-corners.stl", quad.as_bytes())?;
    let mut zeros = cube();
    for face in zeros.faces.iter_mut().take(6) {
        // The same corners again, with zeros of the other sign.
        for v in face.iter_mut() {
            zeros.points.push(zeros.points[*v].map(|x| if x == 0.0 { -0.0 } else { x }));
            *v = zeros.points.len() - 1;
        }
    }
    write("minus-zero.stl", &zeros.binary("zeros of both signs"))?;
    let binary = cube().binary("made by hand");
    write("binary.stl", &binary)?;
    write("solid-header.stl", &cube().binary("solid part"))?;
    write("truncated-binary.stl", &binary[..400])?;
    write("truncated-header.stl", &binary[..60])?;
    let mut hostile = binary.clone();
    hostile[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    write("hostile-count.stl", &hostile)?;
    write("trailing-bytes.stl", &[binary.as_slice(), b"junk"].concat())?;
    let mut infinite = cube();
    infinite.points[5][2] = f64::INFINITY;
    write("infinite.stl", &infinite.binary("made by hand"))?;
    write("hostile-count.off", b"OFF\n4000000000 4000000000 0\n0 0 0\n")?;
    write("index-out-of-range.off", cube().off().replace("3 0 2 3\n", "3 0 2 9\n").as_bytes())?;
    write("hostile-face.off", cube().off().replace("3 0 2 3\n", "4000000000 0 2 3\n").as_bytes())?;
    write("counts-in-header-line.off", cube().off().replace("OFF\n", "# a cube\nOFF ").as_bytes())?;
    let obj: String = cube()
        .points
        .iter()
        .map(|[x, y, z]| format!("v {x} {y} {z} 1.0\n"))
        .chain(["g cube\nusemtl steel\nvn 0 0 1\n".to_owned()])
        .chain(
            ["-8 -6 -5 -7", "5//1 6//1 8//1 7//1", "1/1 2/1 6/1 5/1", "3 7 8 4", "1 5 7 3", "2 4 8 6"]
                .map(|f| format!("f {f}\n")),
        )
        .collect();
    write("cube.obj", obj.as_bytes())?;
    write("bad-index.obj", obj.replace("f 3 7", "f 0 7").as_bytes())?;
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nelement face 4\nproperty list uchar int vertex_index\nend_header\n\
               0 0 0 9\n1 0 0 9\n0 1 0 9\n0 0 1 9\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    write("tetrahedron.ply", ply.as_bytes())?;
    write("hostile-count.ply", ply.replace("face 4", "face 4000000000").as_bytes())?;
    write(
        "no-properties.ply",
        ply.replace("element face", "element ghost 4000000000\nelement face").as_bytes(),
    )?;
    write("truncated.ply", &ply.as_bytes()[..ply.len() - 20])?;
    Ok(())
}
