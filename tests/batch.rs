//! Many generated parts through the whole CAD chain: nothing fails, nothing hangs, what is refused is refused by name.
//!
//! Parts are iso-surfaces on grids (plates with holes, lattices of beams, blobs and the blocks that voxel optimizers
//! write) of genus 0 to 100, then in turn roughened, decimated, subdivided, rotated and scaled from 1e-3 to 1e3. Every
//! part goes through import, smoothing, tiling, layout, fit, STEP and validation, and must come out as a closed
//! surface of the same genus and nearly the same volume whose STEP file holds its solids.
//!
//! A few run with all other tests, as many as wanted by `just batch 1000` (`TOPIPE_BATCH=1000`); another
//! `TOPIPE_BATCH_SEED` makes other parts. The file of a part that failed is left in `target/batch`.

use rayon::prelude::*;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;
use topipe_mesh::DVec3;
use topipe_mesh::import::{ImportOptions, read};
use topipe_progress::{Progress, Units};
use topipe_spline_fit::step::{Protocol, write};
use topipe_validation::Inputs;

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

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

#[derive(Clone)]
struct Surface {
    points: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
}

/// The zero set of values on a grid, negative inside, by marching tetrahedra (six around the diagonal of each cell): a
/// closed manifold for any values.
fn iso_surface(size: [usize; 3], values: &[f64]) -> Surface {
    let stride = [1, size[0], size[0] * size[1]];
    let position =
        |v: usize| DVec3::new((v % size[0]) as f64, (v / stride[1] % size[1]) as f64, (v / stride[2]) as f64);
    let mut surface = Surface { points: Vec::new(), triangles: Vec::new() };
    let mut number: HashMap<(usize, usize), usize> = HashMap::new();
    for z in 0..size[2] - 1 {
        for y in 0..size[1] - 1 {
            for x in 0..size[0] - 1 {
                let origin = x + y * stride[1] + z * stride[2];
                for [a, b] in [[0, 1], [1, 0], [1, 2], [2, 1], [2, 0], [0, 2]] {
                    let one = origin + stride[a];
                    let two = one + stride[b];
                    let far = origin + stride[0] + stride[1] + stride[2];
                    let odd = [[0, 1], [1, 2], [2, 0]].contains(&[a, b]);
                    let corners = if odd { [origin, one, two, far] } else { [origin, two, one, far] };
                    tetrahedron(corners, values, &position, &mut surface, &mut number);
                }
            }
        }
    }
    surface
}

fn tetrahedron(
    corners: [usize; 4],
    values: &[f64],
    position: &impl Fn(usize) -> DVec3,
    surface: &mut Surface,
    number: &mut HashMap<(usize, usize), usize>,
) {
    let mut crossing = |i: usize, j: usize| {
        let (a, b) = (corners[i].min(corners[j]), corners[i].max(corners[j]));
        *number.entry((a, b)).or_insert_with(|| {
            let share = (values[a] / (values[a] - values[b])).clamp(0.1, 0.9);
            surface.points.push(position(a).lerp(position(b), share));
            surface.points.len() - 1
        })
    };
    let inside: Vec<usize> = (0..4).filter(|&k| values[corners[k]] < 0.0).collect();
    let outside: Vec<usize> = (0..4).filter(|&k| values[corners[k]] >= 0.0).collect();
    let faces: Vec<[usize; 3]> = match (&inside[..], &outside[..]) {
        ([i], [a, b, c]) | ([a, b, c], [i]) => vec![[crossing(*i, *a), crossing(*i, *b), crossing(*i, *c)]],
        ([i, j], [a, b]) => {
            let quad = [crossing(*i, *a), crossing(*i, *b), crossing(*j, *b), crossing(*j, *a)];
            vec![[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
        }
        _ => return,
    };
    // Out of the material: away from the inner corners.
    let center: DVec3 = inside.iter().map(|&k| position(corners[k])).sum::<DVec3>() / inside.len() as f64;
    for [a, b, c] in faces {
        let [p, q, r] = [a, b, c].map(|v| surface.points[v]);
        let out = (q - p).cross(r - p).dot(p - center) > 0.0;
        surface.triangles.push(if out { [a, b, c] } else { [a, c, b] });
    }
}

/// Values of a part on a grid, and what it is.
fn part(random: &mut Random) -> (String, Surface) {
    let kind = random.below(4);
    let (size, shape): ([usize; 3], Box<dyn Fn(DVec3) -> f64>) = match kind {
        // A plate with rows of holes: as many handles.
        0 => {
            // Mostly few holes, now and then a hundred.
            let most = if random.below(12) == 0 { 10 } else { 4 };
            let (rows, columns) = (random.below(most + 1), 1 + random.below(most));
            let pitch = random.between(4.5, 6.0);
            let (radius, thick) = (random.between(1.3, 1.7), random.between(2.0, 3.5));
            let half = DVec3::new(rows.max(1) as f64, columns as f64, 0.0) * pitch / 2.0;
            let size = [2.0 * half.x + 6.0, 2.0 * half.y + 6.0, thick + 6.0].map(|s| s.ceil() as usize);
            let center = DVec3::new(size[0] as f64, size[1] as f64, size[2] as f64) / 2.0 - 0.5;
            let plate = move |p: DVec3| {
                let d = p - center;
                let body = (d.x.abs() - half.x).max(d.y.abs() - half.y).max(d.z.abs() - thick / 2.0);
                if rows == 0 {
                    return body;
                }
                let cell = |x: f64, half: f64| (x + half).rem_euclid(pitch) - pitch / 2.0;
                let hole = cell(d.x, half.x).hypot(cell(d.y, half.y));
                body.max(radius - hole)
            };
            (size, Box::new(plate))
        }
        // Beams between random nodes.
        1 => {
            let side = 12.0 + random.between(0.0, 8.0);
            let nodes: Vec<DVec3> = (0..3 + random.below(5))
                .map(|_| DVec3::splat(side / 2.0) + random.vector() * (side / 2.0 - 4.0))
                .collect();
            let mut beams: Vec<(DVec3, DVec3)> = (1..nodes.len()).map(|k| (nodes[k - 1], nodes[k])).collect();
            for _ in 0..random.below(4) {
                beams.push((nodes[random.below(nodes.len())], nodes[random.below(nodes.len())]));
            }
            let radius = random.between(1.3, 2.0);
            let frame = move |p: DVec3| {
                let off = |&(a, b): &(DVec3, DVec3)| {
                    let d = b - a;
                    let t = ((p - a).dot(d) / d.length_squared().max(1e-9)).clamp(0.0, 1.0);
                    (p - a - t * d).length()
                };
                beams.iter().map(off).fold(f64::INFINITY, f64::min) - radius
            };
            ([side as usize + 2; 3], Box::new(frame))
        }
        // Blobs with pits.
        2 => {
            let balls: Vec<(DVec3, f64)> = (0..2 + random.below(4))
                .map(|_| (DVec3::splat(9.0) + random.vector() * 3.5, random.between(2.0, 4.5)))
                .collect();
            let pits: Vec<(DVec3, f64)> = (0..random.below(4))
                .map(|_| (DVec3::splat(9.0) + random.vector() * 6.0, random.between(1.5, 3.0)))
                .collect();
            let blob = move |p: DVec3| {
                let ball = |&(c, r): &(DVec3, f64)| p.distance(c) - r;
                let body = balls.iter().map(ball).fold(f64::INFINITY, f64::min);
                pits.iter().map(ball).fold(body, |body, pit| body.max(-pit))
            };
            ([19; 3], Box::new(blob))
        }
        // Voxels of an optimizer: a block with material left where three waves say so.
        _ => {
            let n = 9.0 + random.between(0.0, 6.0);
            let waves: Vec<(DVec3, f64)> =
                (0..3).map(|_| (random.vector() * 0.9, random.between(0.0, 6.0))).collect();
            let level = random.between(-1.2, 0.2);
            let voxels = move |p: DVec3| {
                let d = p - DVec3::splat(n / 2.0);
                let field: f64 = waves.iter().map(|(k, phase)| (k.dot(p) + phase).sin()).sum();
                let inside = d.abs().max_element() < n / 2.0 - 2.0 && field > level;
                if inside { -1.0 } else { 1.0 }
            };
            ([n as usize + 1; 3], Box::new(voxels))
        }
    };
    let border = |c: usize, n: usize| c == 0 || c + 1 == n;
    let mut values = Vec::with_capacity(size.iter().product());
    for z in 0..size[2] {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let on_border = border(x, size[0]) || border(y, size[1]) || border(z, size[2]);
                let value = shape(DVec3::new(x as f64, y as f64, z as f64));
                values.push(if on_border { value.max(0.5) } else { value });
            }
        }
    }
    (["plate", "frame", "blob", "voxels"][kind].to_string(), iso_surface(size, &values))
}

/// The component with the most triangles.
fn largest_component(surface: &mut Surface) {
    let mut parent: Vec<usize> = (0..surface.points.len()).collect();
    fn root(parent: &mut [usize], mut v: usize) -> usize {
        while parent[v] != v {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        v
    }
    for &[a, b, c] in &surface.triangles {
        for v in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, v));
            parent[x.max(y)] = x.min(y);
        }
    }
    let mut count = vec![0; parent.len()];
    for t in &surface.triangles {
        count[root(&mut parent, t[0])] += 1;
    }
    let best = (0..count.len()).max_by_key(|&k| (count[k], usize::MAX - k)).unwrap_or(0);
    surface.triangles.retain(|t| root(&mut parent, t[0]) == best);
}

fn subdivide(surface: &mut Surface) {
    let mut middles: HashMap<(usize, usize), usize> = HashMap::new();
    let mut finer = Vec::with_capacity(4 * surface.triangles.len());
    for &[a, b, c] in &surface.triangles {
        let [d, e, f] = [(a, b), (b, c), (c, a)].map(|(v, w)| {
            *middles.entry((v.min(w), v.max(w))).or_insert_with(|| {
                surface.points.push((surface.points[v] + surface.points[w]) / 2.0);
                surface.points.len() - 1
            })
        });
        finer.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    surface.triangles = finer;
}

/// Collapses edges that neither change the topology (link condition) nor turn a face over, one pass.
fn decimate(surface: &mut Surface) {
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); surface.points.len()];
    for (f, t) in surface.triangles.iter().enumerate() {
        t.iter().for_each(|&v| around[v].push(f));
    }
    let mut touched = vec![false; surface.points.len()];
    let mut gone = vec![false; surface.triangles.len()];
    let neighbours = |v: usize, triangles: &[[usize; 3]]| {
        let mut list: Vec<usize> = around[v].iter().flat_map(|&f| triangles[f]).filter(|&w| w != v).collect();
        list.sort_unstable();
        list.dedup();
        list
    };
    for v in 0..surface.points.len() {
        if touched[v] || around[v].is_empty() {
            continue;
        }
        let own = neighbours(v, &surface.triangles);
        if own.iter().any(|&w| touched[w]) {
            continue;
        }
        let target = own.iter().copied().min_by(|&a, &b| {
            let d = |w: usize| surface.points[w].distance(surface.points[v]);
            d(a).total_cmp(&d(b))
        });
        let Some(w) = target else { continue };
        let other = neighbours(w, &surface.triangles);
        let common = own.iter().filter(|x| other.binary_search(x).is_ok()).count();
        let sound = around[v].iter().filter(|&&f| !surface.triangles[f].contains(&w)).all(|&f| {
            let normal = |t: [usize; 3]| {
                let [p, q, r] = t.map(|x| surface.points[x]);
                (q - p).cross(r - p)
            };
            let before = normal(surface.triangles[f]);
            let after = normal(surface.triangles[f].map(|x| if x == v { w } else { x }));
            after.dot(before) > 0.5 * after.length() * before.length()
        });
        if common != 2 || !sound || own.len() < 4 {
            continue;
        }
        for &f in &around[v] {
            if surface.triangles[f].contains(&w) {
                gone[f] = true;
            } else {
                surface.triangles[f] = surface.triangles[f].map(|x| if x == v { w } else { x });
            }
        }
        own.iter().chain(&other).for_each(|&x| touched[x] = true);
        touched[v] = true;
    }
    let mut keep = gone.iter().map(|g| !g);
    surface.triangles.retain(|_| keep.next().unwrap_or(true));
}

/// The bytes of an STL file, and what is in it.
fn generate(random: &mut Random) -> (String, Vec<u8>) {
    let (mut name, mut surface) = part(random);
    largest_component(&mut surface);
    if random.below(3) == 0 {
        name += " decimated";
        (0..1 + random.below(3)).for_each(|_| decimate(&mut surface));
    }
    if surface.triangles.len() < 4_000 && random.below(5) == 0 {
        name += " subdivided";
        subdivide(&mut surface);
    }
    if random.below(2) == 0 {
        name += " rough";
        // A share of the shortest edge at each vertex: more could make the surface pass through itself.
        let mut reach = vec![f64::INFINITY; surface.points.len()];
        for t in &surface.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let length = surface.points[a].distance(surface.points[b]);
                reach[a] = reach[a].min(length);
                reach[b] = reach[b].min(length);
            }
        }
        let noise = random.between(0.02, 0.15);
        surface.points.iter_mut().zip(reach).for_each(|(p, reach)| {
            if reach.is_finite() {
                *p += noise * reach * random.vector();
            }
        });
    }
    let axis = random.vector().normalize_or(DVec3::X);
    let turn = glam::DQuat::from_axis_angle(axis, random.between(0.0, 6.0));
    let scale = 10f64.powf(random.between(-3.0, 3.0));
    let shift = random.vector() * 20.0;
    surface.points.iter_mut().for_each(|p| *p = scale * (turn * *p + shift));
    name += &format!(" scale {scale:.1e}");
    let mut bytes = vec![0; 80];
    bytes.extend((surface.triangles.len() as u32).to_le_bytes());
    for t in &surface.triangles {
        bytes.extend([0u8; 12]);
        for v in t {
            let p = surface.points[*v];
            [p.x, p.y, p.z].iter().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
        }
        bytes.extend([0u8; 2]);
    }
    (name, bytes)
}

enum Outcome {
    Passed {
        genus: i64,
        patches: usize,
    },
    /// Not taken by the importer, with its words.
    Refused(String),
    Failed(String),
}

/// Largest relative difference of volumes: rough parts of few triangles lose a little.
const VOLUME: f64 = 0.03;

fn run(bytes: &[u8]) -> Outcome {
    let silent = Progress::silent();
    let part = match read("part.stl", bytes, &ImportOptions::default()) {
        Ok(part) => part,
        Err(error) => return Outcome::Refused(error.to_string()),
    };
    let failed = |stage: &str, error: &dyn std::fmt::Display| Outcome::Failed(format!("{stage}: {error}"));
    let smooth = match topipe_smoothing::smooth(&part, &Default::default(), &silent) {
        Ok(smooth) => smooth,
        // Flat faces everywhere: what the message advises.
        Err(topipe_smoothing::SmoothingError::EverythingFrozen { .. }) => {
            let parameters = topipe_smoothing::Parameters { iterations: Some(0), ..Default::default() };
            match topipe_smoothing::smooth(&part, &parameters, &silent) {
                Ok(part) => part,
                Err(error) => return failed("smoothing", &error),
            }
        }
        Err(error) => return failed("smoothing", &error),
    };
    let tiling = match topipe_tiling::tile(&smooth, &Default::default(), &silent) {
        Ok(tiling) => tiling,
        Err(error) => return failed("tiling", &error),
    };
    if let Some(violation) = topipe_tiling::verify(&tiling).first() {
        return failed("verification of the tiling", &format!("{violation:?}"));
    }
    let layout = match topipe_quad_matching::match_quads(&tiling, &Default::default(), &silent) {
        Ok(layout) => layout,
        Err(error) => return failed("quad matching", &error),
    };
    if let Some(violation) = topipe_quad_matching::verify(&layout).first() {
        return failed("verification of the layout", violation);
    }
    let surface = match topipe_spline_fit::fit(&layout, &Default::default(), &Units::none(), &silent) {
        Ok(surface) => surface,
        Err(error) => return failed("fit", &error),
    };
    let mut step = Vec::new();
    if let Err(error) = write(&surface, "part", Protocol::Ap214, &mut step) {
        return failed("STEP", &error);
    }
    let inputs =
        Inputs { mesh: Some(&smooth), layout: Some(&layout), surface: Some(&surface), ..Inputs::of(&part) };
    let report = match topipe_validation::validate(&inputs, &Default::default(), &silent) {
        Ok(report) => report,
        Err(error) => return failed("validation", &error),
    };
    let Some(figures) = report.surface else { return failed("validation", &"no figures of the surface") };
    let (genus, volume) = (report.original.genus, figures.volume_error);
    let step = String::from_utf8_lossy(&step);
    if !figures.closed || figures.genus != genus {
        return failed(
            "surface",
            &format!("closed {}, genus {:?} for {genus:?}", figures.closed, figures.genus),
        );
    }
    if volume.is_nan() || volume.abs() > VOLUME {
        return failed("surface", &format!("volume off by {volume:?}"));
    }
    if !step.contains("MANIFOLD_SOLID_BREP(") || step.contains("NaN") || step.contains("inf") {
        return failed("STEP", &"no solid, or no numbers");
    }
    Outcome::Passed { genus: genus.unwrap_or(-1), patches: surface.patches.len() }
}

#[test]
fn generated_parts_become_solids() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let (count, seed) = (number("TOPIPE_BATCH").unwrap_or(16), number("TOPIPE_BATCH_SEED").unwrap_or(1));
    let start = Instant::now();
    let outcomes: Vec<(u64, String, Outcome, f64)> = (0..count)
        .into_par_iter()
        .map(|k| {
            let mut random = Random(seed.wrapping_mul(0x2545_F491_4F6C_DD1D).wrapping_add(k));
            let (name, bytes) = generate(&mut random);
            let start = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| run(&bytes)))
                .unwrap_or_else(|_| Outcome::Failed("panic".into()));
            if let Outcome::Failed(why) = &outcome {
                let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/batch");
                let file = folder.join(format!("{seed}-{k}.stl"));
                let _ = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, &bytes));
                println!("part {k}, {name}: {why} ({})", file.display());
            }
            (k, name, outcome, start.elapsed().as_secs_f64())
        })
        .collect();
    let mut refused: Vec<String> = Vec::new();
    let (mut passed, mut patches, mut genus) = (0, 0, 0);
    let mut failed = Vec::new();
    for (k, name, outcome, _) in &outcomes {
        match outcome {
            Outcome::Passed { genus: g, patches: n } => {
                passed += 1;
                patches += n;
                genus = genus.max(*g);
            }
            Outcome::Refused(why) => refused.push(format!("{k}, {name}: {why}")),
            Outcome::Failed(why) => failed.push(format!("{k}, {name}: {why}")),
        }
    }
    let slowest = outcomes.iter().max_by(|a, b| a.3.total_cmp(&b.3)).unwrap();
    println!(
        "{passed} of {count} parts passed ({patches} patches, genus up to {genus}), {} refused, {} failed, in {:.0} s; the slowest, {} ({}), took {:.1} s",
        refused.len(),
        failed.len(),
        start.elapsed().as_secs_f64(),
        slowest.0,
        slowest.1,
        slowest.3
    );
    refused.iter().for_each(|line| println!("refused: {line}"));
    assert!(failed.is_empty(), "{failed:#?}");
    // A batch in which nothing is taken proves nothing.
    assert!(passed as u64 * 4 >= count * 3, "{refused:#?}");
}
