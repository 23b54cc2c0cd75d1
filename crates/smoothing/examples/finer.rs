//! A part with more triangles: it is smoothed, its longest edges are split until there are as many as wanted, new vertices
//! of the design space are put on a curved surface (Boubekeur and Alexa 2008, Phong tessellation) and get noise along their
//! normals. For measuring how time grows with size: `just scale`.
//!
//!     cargo run --release -p topipe-smoothing --example finer -- fixtures/bracket/bracket 1000000 target/scale/bracket-1000000
//!
//! reads PART.stl and PART.labels.csv and writes the same two files at the other place.

use std::collections::BinaryHeap;
use std::error::Error;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, Design, FaceId, HalfEdgeId, Part, VertexId, write};
use topipe_progress::Progress;

/// Largest displacement over the mean length of the edges at the end.
const NOISE: f64 = 0.05;
/// Share of the way from the middle of an edge to the curved surface.
const CURVED: f64 = 0.75;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [from, count, to] = &arguments[..] else { return Err("usage: finer PART TRIANGLES RESULT".into()) };
    let (stl, labels) = (std::fs::read(format!("{from}.stl"))?, std::fs::read(format!("{from}.labels.csv"))?);
    let source = Source { labels: Some(("labels", &labels)), ..Source::new("part.stl", &stl) };
    let part = read_source(&source, &ImportOptions::default(), &Progress::silent())?;
    let part = topipe_smoothing::smooth(&part, &Default::default(), &Progress::silent())?;
    let (finer, design) = split(&part, count.parse()?)?;
    if let Some(folder) = std::path::Path::new(to).parent() {
        std::fs::create_dir_all(folder)?;
    }
    write::stl(&finer.mesh, &mut std::fs::File::create(format!("{to}.stl"))?)?;
    let lines: String = design.iter().map(|design| if *design { "0\n" } else { "1\n" }).collect();
    std::fs::write(format!("{to}.labels.csv"), lines)?;
    println!("{to}: {} triangles", finer.mesh.face_count());
    Ok(())
}

/// Splits the longest edge until there are `count` faces; tells which of them belong to the design space.
fn split(part: &Part, count: usize) -> Result<(Part, Vec<bool>), Box<dyn Error>> {
    let mut refiner = Refiner::new(part)?;
    let key = |refiner: &Refiner, h: HalfEdgeId| {
        let ends = [refiner.origin(h), refiner.target(h)];
        let length = refiner.part().mesh.position(ends[0]).distance(refiner.part().mesh.position(ends[1]));
        // Positive numbers are ordered as their bits are.
        (length.to_bits(), ends[0].index(), ends[1].index())
    };
    let mut longest: BinaryHeap<(u64, usize, usize)> = BinaryHeap::new();
    for face in part.mesh.faces() {
        longest.extend((0..3).map(|k| key(&refiner, HalfEdgeId::of(face, k))));
    }
    let mut surface = Curved::of(part);
    while refiner.part().mesh.face_count() < count {
        let Some((length, a, b)) = longest.pop() else { break };
        let Some(h) = refiner.half_edge(VertexId::new(a), VertexId::new(b)) else { continue };
        if key(&refiner, h).0 != length {
            continue;
        }
        let vertex = refiner.split_edge(h, 0.5).vertex;
        surface.push_between(a, b);
        for h in refiner.outgoing(vertex) {
            for h in [h, refiner.twin(h), h.next()] {
                longest.push(key(&refiner, h));
            }
        }
    }
    let (mut finer, parents) = refiner.finish();
    let design = parents.iter().map(|f: &FaceId| part.design[f.index()] == Design::Design).collect();
    let area: f64 = finer.mesh.faces().map(|f| finer.mesh.area_vector(f).length()).sum();
    let edge = (area / finer.mesh.face_count() as f64 * 4.0 / 3.0_f64.sqrt()).sqrt();
    finer.mesh.positions = surface.with_noise(NOISE * edge, part.mesh.vertex_count());
    Ok((finer, design))
}

/// Where the vertices are, which way the surface faces there, and whether they may leave the flat faces of the mesh.
struct Curved {
    places: Vec<DVec3>,
    normals: Vec<DVec3>,
    free: Vec<bool>,
}

impl Curved {
    fn of(part: &Part) -> Self {
        let mesh = &part.mesh;
        let mut normals = vec![DVec3::ZERO; mesh.vertex_count()];
        let mut free = vec![true; mesh.vertex_count()];
        for f in mesh.faces() {
            for v in mesh.triangles[f.index()] {
                normals[v.index()] += mesh.area_vector(f);
                free[v.index()] &= part.design[f.index()] == Design::Design && !part.frozen[v.index()];
            }
        }
        let normals = normals.into_iter().map(DVec3::normalize_or_zero).collect();
        Self { places: mesh.positions.clone(), normals, free }
    }

    fn push_between(&mut self, a: usize, b: usize) {
        let middle = (self.places[a] + self.places[b]) / 2.0;
        let free = self.free[a] || self.free[b];
        // On the tangent planes of the ends that are free.
        let moved: DVec3 = [a, b]
            .iter()
            .filter(|&&v| self.free[v])
            .map(|&v| (self.places[v] - middle).dot(self.normals[v]) * self.normals[v] / 2.0)
            .sum();
        self.places.push(middle + CURVED * moved);
        self.normals.push((self.normals[a] + self.normals[b]).normalize_or_zero());
        self.free.push(free);
    }

    /// The places, those from `first` on moved by up to `height` along their normals.
    fn with_noise(mut self, height: f64, first: usize) -> Vec<DVec3> {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        for v in first..self.places.len() {
            // xorshift64: the same for every run.
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let share = (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0;
            if self.free[v] {
                self.places[v] += self.normals[v] * (share * height);
            }
        }
        self.places
    }
}
