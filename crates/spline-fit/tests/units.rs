//! Patches that are kept: an interrupted fit takes up where it was, and an edit costs the patches it touches.

mod common;

use common::{fixture, layout, sphere};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use topipe_progress::{Progress, UnitKey, UnitStore, Units};
use topipe_spline_fit::{Continuity, Parameters, SplineSurface, first_patches, fit};

#[derive(Default)]
struct Kept {
    values: BTreeMap<[u8; 32], Vec<u8>>,
    found: usize,
    put: usize,
    announced: Vec<UnitKey>,
}

#[derive(Default)]
struct Store(Mutex<Kept>);

impl UnitStore for Store {
    fn get(&self, key: UnitKey) -> Option<Vec<u8>> {
        let mut kept = self.0.lock().unwrap();
        let value = kept.values.get(key.as_bytes()).cloned();
        kept.found += usize::from(value.is_some());
        value
    }

    fn put(&self, key: UnitKey, value: &[u8]) {
        let mut kept = self.0.lock().unwrap();
        kept.put += 1;
        kept.values.insert(*key.as_bytes(), value.to_vec());
    }

    fn announce(&self, _: &str, keys: &[UnitKey]) {
        self.0.lock().unwrap().announced = keys.to_vec();
    }
}

impl Store {
    /// Patches found and computed since the last call.
    fn counts(&self) -> (usize, usize) {
        let mut kept = self.0.lock().unwrap();
        let counts = (kept.found, kept.put);
        (kept.found, kept.put) = (0, 0);
        counts
    }
}

fn parameters() -> Parameters {
    Parameters { refinements: 0, ..Default::default() }
}

fn fitted(layout: &topipe_quad_matching::QuadLayout, store: &Arc<Store>) -> SplineSurface {
    fit(layout, &parameters(), &Units::new(store.clone()), &Progress::silent()).unwrap()
}

#[test]
fn what_is_kept_is_found_again_and_changes_nothing() {
    let layout = layout(&sphere(4), 1.0);
    let store = Arc::new(Store::default());
    let first = fitted(&layout, &store);
    let patches = layout.quads.len();
    assert_eq!(store.counts(), (0, patches));
    assert_eq!(first, fit(&layout, &parameters(), &Units::none(), &Progress::silent()).unwrap());
    // What plan asks for is what the fit announces.
    assert_eq!(first_patches(&layout, &parameters()).unwrap(), store.0.lock().unwrap().announced);
    let position = Parameters { continuity: Continuity::Position, ..parameters() };
    assert!(first_patches(&layout, &position).unwrap().is_empty());
    // Died at 90 %: the last tenth is computed, and nothing else.
    let lost = {
        let mut kept = store.0.lock().unwrap();
        let keys: Vec<_> = kept.values.keys().copied().collect();
        keys.iter().step_by(10).filter(|key| kept.values.remove(*key).is_some()).count()
    };
    let again = fitted(&layout, &store);
    assert_eq!(store.counts(), (patches - lost, lost));
    assert_eq!(again, first);
}

#[test]
fn an_edit_costs_the_patches_it_touches() {
    let mut layout = layout(&sphere(4), 1.0);
    let store = Arc::new(Store::default());
    fitted(&layout, &store);
    store.counts();
    // A vertex inside a quad moves.
    let mesh = &layout.part.mesh;
    let inside = mesh
        .faces()
        .flat_map(|f| mesh.triangles[f.index()])
        .find(|v| layout.edges.iter().all(|e| !e.path.contains(v)))
        .unwrap();
    layout.part.mesh.positions[inside.index()] *= 1.01;
    let edited = fitted(&layout, &store);
    let (found, computed) = store.counts();
    assert_eq!(found + computed, layout.quads.len());
    assert!((1..=layout.quads.len() / 4).contains(&computed), "{computed} of {}", layout.quads.len());
    assert_eq!(edited, fit(&layout, &parameters(), &Units::none(), &Progress::silent()).unwrap());
}

/// As above on a part with borders, whose curves are smoothed by the size of the mesh's edges: a little more of one vertex is no
/// reason to fit all patches at borders anew.
#[test]
fn an_edit_leaves_borders_elsewhere_as_they_are() {
    let mut layout = fixture("y-form");
    let before = first_patches(&layout, &parameters()).unwrap();
    let mesh = &layout.part.mesh;
    let inside = mesh
        .faces()
        .filter(|f| layout.quad_of_face[f.index()] != topipe_quad_matching::QuadLayout::NO_QUAD)
        .flat_map(|f| mesh.triangles[f.index()])
        .find(|v| layout.edges.iter().all(|e| !e.path.contains(v)))
        .unwrap();
    let step = 0.01 * mesh.mean_edge_length();
    layout.part.mesh.positions[inside.index()].x += step;
    let after = first_patches(&layout, &parameters()).unwrap();
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    assert!((1..=before.len() / 10).contains(&changed), "{changed} of {}", before.len());
}

/// A division of the layout is another fit, but what it does not touch is kept.
#[test]
fn a_division_costs_the_patches_it_touches() {
    let layout = fixture("monster-lite");
    let store = Arc::new(Store::default());
    let with = |divisions: u32| {
        let parameters = Parameters { divisions, tolerance: 1.6e-3, ..Default::default() };
        fit(&layout, &parameters, &Units::new(store.clone()), &Progress::silent()).unwrap()
    };
    let whole = with(0);
    let (_, alone) = store.counts();
    let divided = with(1);
    let (found, computed) = store.counts();
    assert!(divided.patches.len() > whole.patches.len());
    assert!(computed > 0 && 2 * computed < alone, "{computed} after {alone}, {found} found");
    assert!(with(1) == divided);
    assert_eq!(store.counts().1, 0);
}
