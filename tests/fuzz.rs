//! Readers of foreign bytes fed with what nobody would write: no panic, no hang, no absurd allocation.
//!
//! A deterministic mutation fuzzer: inputs start from the corpus (fixtures/zoo, tests/corpus and small files made here),
//! are mangled by bytes, numbers, words and pieces of each other, and are read. What comes of an input, its message or what
//! was repaired, leads the way: an input with which something comes for the first time is mangled further, so that the
//! fuzzer gets behind the first check. With `TOPIPE_FUZZ_KEEP=1` such inputs are written to `tests/corpus/TARGET`, which is
//! where the corpus there is from. An input that made trouble is written to `target/fuzz` before anything else is done with
//! it, and belongs into the corpus once it is understood.
//!
//! Each target runs some thousand times with all other tests, and as often as wanted by
//! `just fuzz 10000000` (`TOPIPE_FUZZ=10000000`), which also varies with `TOPIPE_FUZZ_SEED`.

use std::collections::BTreeSet;
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use topipe_engine::{ArtifactKind, Pipeline, codec};

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        // splitmix64 (Steele, Lea, Flood 2014).
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }
}

/// Numbers and words on which readers stumble.
const WORDS: [&[u8]; 34] = [
    b"0",
    b"-1",
    b"1",
    b"4294967295",
    b"4294967296",
    b"18446744073709551615",
    b"-9223372036854775808",
    b"1e308",
    b"1e999",
    b"-1e-320",
    b"nan",
    b"inf",
    b"-inf",
    b"0x10",
    b"\n",
    b"\r\n",
    b" ",
    b"\t",
    b"#",
    b"\"",
    b"'",
    b"[",
    b"]",
    b"{",
    b"}",
    b"=",
    b".",
    b"/",
    b"\\",
    b"\0",
    b"\xff",
    b"\xef\xbb\xbf",
    b"facet normal",
    b"element vertex 4000000000",
];

fn mutate(random: &mut Random, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len() + 1);
        match random.below(9) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 if at < bytes.len() => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at),
            3 => {
                let end = (at + 1 + random.below(16)).min(bytes.len());
                bytes.drain(at.min(end)..end);
            }
            4 => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
            5 => {
                // A word in place of another.
                let word = WORDS[random.below(WORDS.len())];
                let end =
                    bytes[at..].iter().position(u8::is_ascii_whitespace).map_or(bytes.len(), |n| at + n);
                bytes.splice(at..end, word.iter().copied());
            }
            6 => {
                // Extreme numbers in binary files.
                let value =
                    [0u64, 1, 0xFF, 0x7FFF_FFFF, 0xFFFF_FFFF, u64::MAX, 1 << 40, 0x7FF0_0000_0000_0000];
                let number = value[random.below(value.len())].to_le_bytes();
                let length = [1, 2, 4, 8][random.below(4)];
                let end = (at + length).min(bytes.len());
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            7 => {
                let other = &seeds[random.below(seeds.len())];
                let from = random.below(other.len() + 1);
                let to = (from + random.below(200)).min(other.len());
                bytes.splice(at..at, other[from..to].iter().copied());
            }
            _ => {
                let end = (at + random.below(200)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
        bytes.truncate(20_000);
    }
    bytes
}

/// Longer than this for an input of 20 kB is a hang.
const PATIENCE: Duration = Duration::from_secs(10);

/// Inputs that lead somewhere new are mangled further, up to so many.
const MOST_SEEDS: usize = 2_000;

/// Longer inputs are not kept, and no more than so many for a target.
const KEPT_LENGTH: usize = 3_000;
const MOST_KEPT: usize = 80;

fn fuzz(target: &str, seeds: &[Vec<u8>], read: impl Fn(&[u8]) -> String) {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let rounds = number("TOPIPE_FUZZ").unwrap_or(3000);
    let keep = std::env::var_os("TOPIPE_FUZZ_KEEP").is_some();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut random = Random(number("TOPIPE_FUZZ_SEED").unwrap_or(1) ^ target.len() as u64);
    std::panic::set_hook(Box::new(|_| {}));
    assert!(!seeds.is_empty(), "{target} has no seeds");
    let run = |bytes: &[u8]| {
        let start = Instant::now();
        let result = std::panic::catch_unwind(AssertUnwindSafe(|| read(bytes)));
        let what = match result {
            Ok(outcome) if start.elapsed() <= PATIENCE => return outcome,
            Ok(_) => "hangs on",
            Err(_) => "panics on",
        };
        let folder = root.join("target/fuzz");
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join(format!("{target}-{}", &blake3_name(bytes)));
        std::fs::write(&file, bytes).unwrap();
        panic_with(format!("{target} {what} {}", file.display()));
    };
    // The seeds as they are, among them all that ever made trouble.
    let mut known: BTreeSet<String> = seeds.iter().map(|seed| kind_of(&run(seed))).collect();
    let mut seeds = seeds.to_vec();
    for _ in 0..rounds {
        let bytes = mutate(&mut random, &seeds);
        let kind = kind_of(&run(&bytes));
        if seeds.len() < MOST_SEEDS && !known.contains(&kind) {
            known.insert(kind);
            if keep && bytes.len() <= KEPT_LENGTH {
                let folder = root.join("tests/corpus").join(target);
                std::fs::create_dir_all(&folder).unwrap();
                if std::fs::read_dir(&folder).unwrap().count() < MOST_KEPT {
                    std::fs::write(folder.join(blake3_name(&bytes)), &bytes).unwrap();
                }
            }
            seeds.push(bytes);
        }
    }
}

/// An outcome without numbers and without what it quotes, of which there is too much.
fn kind_of(outcome: &str) -> String {
    // Pieces of repairs and of several outcomes, each up to what it quotes.
    let unquoted = |piece: &str| {
        let ends = ["`", "\"", ": '", " found "].map(|quote| piece.find(quote));
        piece[..ends.into_iter().flatten().min().unwrap_or(piece.len())].to_owned()
    };
    let text: String = outcome.split("; ").map(unquoted).collect::<Vec<_>>().join("; ");
    let digits = |c: char| c.is_ascii_digit() || "+-.,".contains(c) || !c.is_ascii();
    text.split(digits)
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join("#")
        .chars()
        .take(120)
        .collect()
}

fn panic_with(message: String) -> ! {
    let _ = std::panic::take_hook();
    panic!("{message}");
}

fn blake3_name(bytes: &[u8]) -> String {
    topipe_engine::ContentHash::of(bytes).short()
}

/// The files with this ending in the zoo and the corpus, small ones only.
fn corpus(target: &str, endings: &[&str]) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Vec::new();
    let mut open: Vec<PathBuf> = vec![root.join("fixtures/zoo"), root.join("tests/corpus").join(target)];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let kept_here = path.parent().is_some_and(|folder| folder.ends_with(target));
            if path.is_dir() {
                open.push(path);
            } else if kept_here || path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending))
            {
                files.push(path);
            }
        }
    }
    files.sort();
    files.into_iter().map(|file| std::fs::read(file).unwrap()).filter(|bytes| bytes.len() <= 20_000).collect()
}

fn tetrahedron() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    (points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
}

fn mesh(target: &str, ending: &str, mut seeds: Vec<Vec<u8>>) {
    seeds.extend(corpus(target, &[ending]));
    let name = format!("part.{ending}");
    fuzz(target, &seeds, |bytes| match topipe_mesh::import::read(&name, bytes, &Default::default()) {
        Ok(part) => format!("{:?}", part.import.repairs),
        Err(error) => error.to_string(),
    });
}

#[test]
fn stl() {
    let (points, faces) = tetrahedron();
    let mut binary = vec![0u8; 80];
    binary.extend((faces.len() as u32).to_le_bytes());
    let mut text = String::from("solid t\n");
    for face in &faces {
        binary.extend([0u8; 12]);
        text += "facet normal 0 0 0\nouter loop\n";
        for corner in face.map(|corner| points[corner as usize]) {
            binary.extend(corner.iter().flat_map(|x| x.to_le_bytes()));
            text += &format!("vertex {} {} {}\n", corner[0], corner[1], corner[2]);
        }
        binary.extend([0u8; 2]);
        text += "endloop\nendfacet\n";
    }
    text += "endsolid t\n";
    mesh("stl", "stl", vec![binary, text.into_bytes()]);
}

const CUBES: &str = "0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0 0 0 1 1 0 1 2 0 1 0 1 1 1 1 1 2 1 1";

#[test]
fn vtk() {
    let start = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET";
    let grid = format!(
        "{start} UNSTRUCTURED_GRID\nPOINTS 12 float\n{CUBES}\nCELLS 2 18\n8 0 1 4 3 6 7 10 9\n8 1 2 5 4 7 8 11 10\n\
         CELL_TYPES 2\n12 12\nCELL_DATA 2\nSCALARS density float 1\nLOOKUP_TABLE default\n1 0\nVECTORS u float\n1 2 3 4 5 6\n"
    );
    let new = grid.replace(
        "CELLS 2 18\n8 0 1 4 3 6 7 10 9\n8 1 2 5 4 7 8 11 10\n",
        "CELLS 3 16\nOFFSETS vtktypeint64\n0 8 16\nCONNECTIVITY vtktypeint64\n0 1 4 3 6 7 10 9 1 2 5 4 7 8 11 10\n",
    );
    let points = format!(
        "{start} STRUCTURED_POINTS\nDIMENSIONS 3 3 3\nORIGIN 0 0 0\nSPACING 1 1 1\nPOINT_DATA 27\nFIELD f 1\nrho 1 27 double\n{}1\n",
        "0 0.2 1 ".repeat(9)
    );
    let surface = format!(
        "{start} POLYDATA\nPOINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1\nPOLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    );
    let binary = [
        b"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET POLYDATA\nPOINTS 4 char\n".to_vec(),
        vec![0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1],
        b"\nPOLYGONS 4 16\n".to_vec(),
        [3, 0, 2, 1, 3, 0, 1, 3, 3, 1, 2, 3, 3, 2, 0, 3].iter().flat_map(|k: &i32| k.to_be_bytes()).collect(),
    ]
    .concat();
    let texts = [grid, new, points, surface].map(String::into_bytes);
    mesh("vtk", "vtk", texts.into_iter().chain([binary]).collect());
}

#[test]
fn inp() {
    let mut deck = "*HEADING\nx\n*NODE\n".to_owned();
    let numbers: Vec<&str> = CUBES.split(' ').collect();
    for (k, p) in numbers.chunks(3).enumerate() {
        deck += &format!("{}, {}, {}, {}\n", k + 1, p[0], p[1], p[2]);
    }
    deck += "*ELEMENT, TYPE=C3D8, ELSET=EALL\n1, 1, 2, 5, 4, 7, 8, 11, 10\n2, 2, 3, 6, 5, 8, 9,\n12, 11\n\
             *ELSET, ELSET=A, GENERATE\n1, 2, 1\n*ELSET, ELSET=NON_DESIGN\nA, 1\n";
    let shells =
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=S3\n1,1,3,2\n2,1,2,4\n3,2,3,4\n4,3,1,4\n";
    mesh("inp", "inp", vec![deck.into_bytes(), shells.as_bytes().to_vec()]);
}

fn text_mesh(header: &str, face: &str, from: u32) -> Vec<u8> {
    let (points, faces) = tetrahedron();
    let mut text = header.to_owned();
    let vertex = if face == "f" { "v " } else { "" };
    for [x, y, z] in points {
        text += &format!("{vertex}{x} {y} {z}\n");
    }
    for [a, b, c] in faces {
        text += &format!("{face} {} {} {}\n", a + from, b + from, c + from);
    }
    text.into_bytes()
}

#[test]
fn off() {
    mesh("off", "off", vec![text_mesh("OFF\n4 4 0\n", "3", 0)]);
}

#[test]
fn obj() {
    mesh("obj", "obj", vec![text_mesh("# t\n", "f", 1)]);
}

#[test]
fn ply() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let ascii = text_mesh(&header("ascii"), "3", 0);
    let (points, faces) = tetrahedron();
    let mut binary = header("binary_little_endian").into_bytes();
    binary.extend(points.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for face in faces {
        binary.push(3);
        binary.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    mesh("ply", "ply", vec![ascii, binary]);
}

#[test]
fn spec() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines");
    let mut seeds = corpus("spec", &[]);
    for name in ["bracket.toml", "cantilever.toml"] {
        seeds.push(std::fs::read(root.join(name)).unwrap());
    }
    seeds.push(
        b"[stage.a]\nkind = \"import\"\npath = \"x.stl\"\n[stage.b]\nkind = \"smoothing\"\ninput = \"a\"\n\
          [export]\n\"b.stl\" = \"b\"\n[sweep]\ngrid = { \"b.lambda\" = [0.1, 0.2], b.mu = [1] }\n\
          zip = { \"b.iterations\" = [1, 2] }\ncases = [{ name = \"x\", \"b.method\" = \"taubin\" }]\nfigures = [\"b.x\"]\n"
            .to_vec(),
    );
    let registry = topipe::stages::registry();
    fuzz("spec", &seeds, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return String::new() };
        // A message must be printable, whatever it points at.
        match Pipeline::parse(Path::new("p.toml"), text.to_owned(), &[], &registry) {
            Ok(pipeline) => format!("{} stages", pipeline.stages.len()),
            Err(error) => first_line(&error),
        }
    });
}

#[test]
fn command_line_values() {
    let spec =
        "[stage.a]\nkind = \"import\"\npath = \"x.stl\"\n[stage.b]\nkind = \"smoothing\"\ninput = \"a\"\n";
    let registry = topipe::stages::registry();
    let seeds = [&b"b.lambda=0.5"[..], b"b.method=taubin", b"b.path=\"x\"", b"a.non_design=[{type=\"box\"}]"];
    fuzz("set", &seeds.map(<[u8]>::to_vec), |bytes| {
        let Some(over) = std::str::from_utf8(bytes).ok().and_then(|text| text.parse().ok()) else {
            return String::new();
        };
        match Pipeline::parse(Path::new("p.toml"), spec.to_owned(), &[over], &registry) {
            Ok(_) => "good".into(),
            Err(error) => first_line(&error),
        }
    });
}

/// The message without the line of the spec that it shows.
fn first_line(error: &topipe_engine::Diagnostic) -> String {
    let text = error.to_string();
    assert!(text.starts_with("error: "), "{text}");
    text.lines().next().unwrap_or_default().to_owned()
}

/// Whole files, and payloads under a header that vouches for them: what a hostile hand would write.
fn artifact<K: ArtifactKind>(seeds: Vec<Vec<u8>>)
where
    K::Value: 'static,
{
    let target = format!("artifact-{}", K::NAME.replace(' ', "-"));
    let mut seeds = seeds;
    seeds.extend(corpus(&target, &[]));
    seeds.push(vec![0; 64]);
    seeds.push([(1u64 << 61).to_le_bytes(), [0xFF; 8]].concat());
    fuzz(&target, &seeds, |bytes| {
        let framed = codec::frame(bytes, K::NAME, K::VERSION);
        let told = [bytes, &framed].map(|file| match codec::decode::<K::Value>(file, K::NAME, K::VERSION) {
            Ok(_) => "good".to_owned(),
            Err(error) => error.to_string(),
        });
        told.join("; ")
    });
}

#[test]
fn artifacts() {
    use topipe::artifacts::{Mesh, QuadLayout, Report, Skeleton, SplineSurface, Tiling};
    let off = text_mesh("OFF\n4 4 0\n", "3", 0);
    let part = topipe_mesh::import::read("t.off", &off, &Default::default()).unwrap();
    let file = codec::encode(&part, Mesh::NAME, Mesh::VERSION).unwrap();
    let payload = codec::open(&file).unwrap().1.to_vec();
    artifact::<Mesh>(vec![file, payload.clone()]);
    // A part is what most others begin with.
    artifact::<Tiling>(vec![payload.clone()]);
    artifact::<QuadLayout>(vec![payload.clone()]);
    artifact::<SplineSurface>(vec![payload]);
    artifact::<Skeleton>(Vec::new());
    artifact::<Report>(Vec::new());
}
