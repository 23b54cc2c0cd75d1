//! The rule for `alpha` against a sweep.

use crate::{Noise, read, smoothed};
use topipe_mesh::Part;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_smoothing::Parameters;

const SWEEP: [f64; 6] = [0.04, 0.06, 0.15, 0.27, 0.4, 0.8];

fn run(part: &Part, alpha: Option<f64>) -> Part {
    let parameters = Parameters { alpha, spike_angle: 180.0, keep_embedded: false, ..Parameters::default() };
    smoothed(part, &parameters)
}

#[test]
fn the_rule_is_near_the_best_for_known_noise() {
    let part = read("cantilever");
    let clean = run(&part, Some(0.05));
    let edge = clean.mesh.mean_edge_length();
    let index = SurfaceIndex::build(&clean.mesh);
    let mut still = clean.frozen.clone();
    for (t, region) in clean.mesh.triangles.iter().zip(&clean.region_of_face) {
        if region.is_some() {
            t.iter().for_each(|v| still[v.index()] = true);
        }
    }
    let error = |part: &Part| -> f64 {
        let free = part.mesh.vertices().filter(|v| !still[v.index()]);
        let nearest = |p| index.nearest(p).expect("a surface").point.distance_squared(p);
        free.map(|v| nearest(part.mesh.position(v))).sum::<f64>().sqrt()
    };
    for sigma in [0.02, 0.1, 0.3] {
        let mut noisy = clean.clone();
        noisy.frozen = still.clone();
        let mut noise = Noise(5);
        // Twelve uniform numbers between -1 and 1 have a variance of 4.
        let mut normal = || (0..12).map(|_| noise.next()).sum::<f64>() / 2.0;
        for (p, still) in noisy.mesh.positions.iter_mut().zip(&still) {
            if !still {
                *p += sigma * edge * topipe_mesh::DVec3::new(normal(), normal(), normal());
            }
        }
        let best =
            SWEEP.map(|alpha| error(&run(&noisy, Some(alpha)))).into_iter().fold(f64::INFINITY, f64::min);
        let rule = error(&run(&noisy, None));
        assert!(rule <= 1.06 * best, "noise {sigma}: {rule} with the rule, {best} at best");
    }
}

#[test]
fn the_rule_changes_most_of_what_can_be_changed_in_96_iterations() {
    for case in ["bracket", "beam-two-holes", "support", "y-form"] {
        let part = read(case);
        let record = |alpha| run(&part, alpha).smoothing.expect("a record");
        let rule = record(None);
        assert!(rule.converged && rule.iterations <= 96, "{case}: {} iterations", rule.iterations);
        let settled = SWEEP.map(|alpha| record(Some(alpha))).into_iter().filter(|r| r.iterations <= 96);
        let best = settled.map(|r| r.total_change).fold(0.0, f64::max);
        assert!(rule.total_change >= 0.96 * best, "{case}: {} of {best}", rule.total_change);
    }
}
