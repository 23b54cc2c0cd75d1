//! The comparison of Bacciaglia, Ceruti, Liverani 2021, section 4, on any part: their tables 1 to 4 and figures 7 and 10.
//!
//! What the paper leaves open is read as follows. The "mesh distance" below 0.01 that ends an iteration is the
//! root of the sum of the squared steps of all vertices, in mm. "Total change" is the sum over the vertices of
//! the distance from their first place, and a second column adds up the steps of all iterations, which is nearer to the
//! numbers printed. The classic methods run on all vertices; the optimized one keeps labels, flat faces and cylinders where
//! they are. HC uses the same alpha and beta. Times are no property of a part: the benchmark of the crate has them.

use crate::features::{self, published};
use crate::smooth::smooth_observed;
use crate::{Method, Parameters, SmoothingError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_mesh::{Connectivity, DVec3, Part, RegionShape, TriangleMesh};
use topipe_progress::Progress;

/// Parameters of [`study`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StudyParameters {
    /// Rows of the sensitivity matrix; the middle one is used for the methods. Table 3 of the paper: 0.18, 0.27, 0.36;
    /// table 1: 0.75, 0.8, 0.85.
    pub alphas: Vec<f64>,
    /// Columns of the sensitivity matrix; the middle one is used for the methods.
    pub betas: Vec<f64>,
    /// Step towards the neighbours.
    pub lambda: f64,
    /// The most iterations.
    pub iterations: u32,
    /// The mesh distance that ends an iteration, mm.
    pub distance: f64,
}

impl Default for StudyParameters {
    fn default() -> Self {
        Self {
            alphas: vec![0.18, 0.27, 0.36],
            betas: vec![0.5, 0.51, 0.56],
            lambda: 0.6307,
            iterations: 150,
            distance: 0.01,
        }
    }
}

impl StudyParameters {
    /// Checks the ranges.
    pub fn check(&self) -> Result<(), SmoothingError> {
        for (name, list) in [("alphas", &self.alphas), ("betas", &self.betas)] {
            if list.is_empty() {
                return Err(SmoothingError::Parameter {
                    name,
                    value: "[]".to_owned(),
                    range: "a list of at least one number",
                    source_of_range: "the rows and columns of the sensitivity matrix",
                });
            }
        }
        for &alpha in &self.alphas {
            for &beta in &self.betas {
                Parameters { alpha: Some(alpha), beta, lambda: self.lambda, ..Parameters::default() }
                    .check()?;
            }
        }
        if !(self.distance >= 0.0 && self.distance.is_finite()) {
            return Err(SmoothingError::Parameter {
                name: "distance",
                value: self.distance.to_string(),
                range: "0 or more",
                source_of_range: "a distance between two meshes, mm",
            });
        }
        Ok(())
    }
}

/// One method on the part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodRow {
    /// What was run.
    pub name: String,
    /// Iterations made.
    pub iterations: u32,
    /// Whether the mesh distance was reached.
    pub converged: bool,
    /// Vertices that were held.
    pub frozen: usize,
    /// Volume, mm^3.
    pub volume: f64,
    /// Sides of the bounding box, mm.
    pub extent: [f64; 3],
    /// Diameters of the holes, mm, in the order of [`Study::holes`]; `None` where the wall is no cylinder any more.
    pub diameters: Vec<Option<f64>>,
    /// Sum of the distances from the first place, per iteration, mm.
    pub change: Vec<f64>,
    /// Sum of the steps so far, per iteration, mm.
    pub cumulative: Vec<f64>,
    /// Volume per iteration, mm^3.
    pub volumes: Vec<f64>,
    /// Mesh distance per iteration, mm.
    pub distances: Vec<f64>,
}

/// One cell of the sensitivity matrix.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// Alpha.
    pub alpha: f64,
    /// Beta.
    pub beta: f64,
    /// Iterations made.
    pub iterations: u32,
    /// Mesh distance at the end, mm.
    pub distance: f64,
    /// Sum of the distances from the first place, mm.
    pub change: f64,
    /// Sum of all steps, mm.
    pub cumulative: f64,
}

/// The comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// The part as it came, then the methods.
    pub methods: Vec<MethodRow>,
    /// The sensitivity matrix, row by row.
    pub sensitivity: Vec<Sensitivity>,
    /// Diameters of the holes that were found, mm.
    pub holes: Vec<f64>,
    /// What the published detectors find: vertices on flat facets, vertices on closed loops, loops.
    pub published: [usize; 3],
    /// Vertices of the part.
    pub vertices: usize,
}

/// Runs all methods and the sensitivity matrix on `part`.
pub fn study(
    part: &Part,
    parameters: &StudyParameters,
    progress: &Progress,
) -> Result<Study, SmoothingError> {
    parameters.check()?;
    let middle = |v: &[f64]| v[v.len() / 2];
    let (alpha, beta) = (middle(&parameters.alphas), middle(&parameters.betas));
    let connectivity = Connectivity::build(&part.mesh)?;
    let published = published::detect(&part.mesh, &connectivity);
    let found = features::detect(part, &connectivity, &Parameters::default(), progress)?;
    // The walls of the holes, to be measured again after each method.
    let mut walls = Vec::new();
    for (id, region) in found.regions.iter().enumerate() {
        if let RegionShape::Cylinder { hole: true, radius, .. } = region.shape {
            let faces: Vec<_> =
                part.mesh.faces().filter(|f| found.region_of_face[f.index()].index() == id).collect();
            walls.push((region.shape, 2.0 * radius, faces));
        }
    }
    let plain = Parameters {
        alpha: Some(alpha),
        beta,
        lambda: parameters.lambda,
        iterations: Some(parameters.iterations),
        tolerance: 0.0,
        preserve_volume: Some(false),
        freeze_non_design: false,
        detect_planes: false,
        detect_holes: false,
        detect_bosses: false,
        slide_outlines: false,
        spike_angle: 180.0,
        keep_embedded: false,
        ..Parameters::default()
    };
    let kept = Parameters {
        freeze_non_design: true,
        detect_planes: true,
        detect_holes: true,
        detect_bosses: true,
        ..plain.clone()
    };
    let with = |method: Method, base: &Parameters| Parameters { method, ..base.clone() };
    let optimized = Parameters { preserve_volume: Some(true), ..with(Method::HcSdu, &kept) };
    let paper_mu = |base: &Parameters| Parameters { mu: -0.53, ..with(Method::Taubin, base) };
    let runs = [
        ("laplacian", with(Method::Laplacian, &plain)),
        ("sdu", with(Method::Sdu, &plain)),
        ("hc", with(Method::Hc, &plain)),
        ("taubin mu=-0.53", paper_mu(&plain)),
        ("taubin mu=-0.6732", with(Method::Taubin, &plain)),
        ("taubin mu=-0.53 with no-smoothing space", paper_mu(&kept)),
        ("optimized hc-sdu", optimized.clone()),
        ("optimized hc-sdu, alpha by rule", Parameters { alpha: None, ..optimized.clone() }),
    ];
    let measure = |name: &str, mesh: &TriangleMesh| {
        let (low, high) = mesh.bounds();
        MethodRow {
            name: name.to_owned(),
            iterations: 0,
            converged: true,
            frozen: 0,
            volume: mesh.volume(),
            extent: (high - low).to_array(),
            diameters: walls
                .iter()
                .map(|(shape, _, faces)| features::diameter(mesh, *shape, faces))
                .collect(),
            change: Vec::new(),
            cumulative: Vec::new(),
            volumes: Vec::new(),
            distances: Vec::new(),
        }
    };
    let mut methods = vec![measure("original", &part.mesh)];
    for (name, settings) in runs {
        let (result, history) = run(part, &settings, parameters.distance, progress)?;
        methods.push(MethodRow {
            iterations: history.distances.len() as u32,
            converged: history.distances.last().is_some_and(|d| *d < parameters.distance),
            frozen: result.frozen.iter().filter(|f| **f).count(),
            change: history.change,
            cumulative: history.cumulative,
            volumes: history.volumes,
            distances: history.distances,
            ..measure(name, &result.mesh)
        });
    }
    let mut sensitivity = Vec::new();
    for &alpha in &parameters.alphas {
        for &beta in &parameters.betas {
            let settings = Parameters { alpha: Some(alpha), beta, ..optimized.clone() };
            let (_, history) = run(part, &settings, parameters.distance, progress)?;
            let last = |v: &[f64]| v.last().copied().unwrap_or(0.0);
            sensitivity.push(Sensitivity {
                alpha,
                beta,
                iterations: history.distances.len() as u32,
                distance: last(&history.distances),
                change: last(&history.change),
                cumulative: last(&history.cumulative),
            });
        }
    }
    let count = |v: &[bool]| v.iter().filter(|x| **x).count();
    Ok(Study {
        methods,
        sensitivity,
        holes: walls.iter().map(|w| w.1).collect(),
        published: [count(&published.flat), count(&published.on_loop), published.loops],
        vertices: part.mesh.vertex_count(),
    })
}

#[derive(Default)]
struct History {
    change: Vec<f64>,
    cumulative: Vec<f64>,
    volumes: Vec<f64>,
    distances: Vec<f64>,
}

fn run(
    part: &Part,
    settings: &Parameters,
    distance: f64,
    progress: &Progress,
) -> Result<(Part, History), SmoothingError> {
    let mut history = History::default();
    let original = &part.mesh.positions;
    let mut watch = |before: &[DVec3], after: &[DVec3], volume: f64| {
        let total: f64 = original.iter().zip(after).map(|(a, b)| a.distance(*b)).sum();
        let (mut step, mut squares) = (0.0, 0.0);
        for (a, b) in before.iter().zip(after) {
            let square = a.distance_squared(*b);
            step += square.sqrt();
            squares += square;
        }
        history.change.push(total);
        history.cumulative.push(history.cumulative.last().copied().unwrap_or(0.0) + step);
        history.volumes.push(volume);
        history.distances.push(squares.sqrt());
        squares.sqrt() < distance
    };
    let result = smooth_observed(part, settings, progress, Some(&mut watch))?;
    Ok((result, history))
}
