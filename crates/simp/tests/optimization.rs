//! Optimizations of small domains.

use topipe_fem::{Load, Region, Support};
use topipe_mesh::{Connectivity, DVec3, Design, TriangleMesh};
use topipe_progress::{Progress, UnitKey, UnitStore, Units};
use topipe_simp::{Axis, FractionOf, Parameters, Shape, SimpError, SurfaceForm, optimize};

/// A beam of 24 x 12 x 6 mm with a hole, held at one end and loaded at the other.
fn beam() -> Parameters {
    let hole =
        |diameter| Shape::Cylinder { point: [12.0, 6.0, 0.0], axis: [0.0, 0.0, 1.0], length: 6.0, diameter };
    Parameters {
        domain: vec![Shape::Box { min: [0.0; 3], max: [24.0, 12.0, 6.0] }],
        subtract: vec![hole(4.0)],
        non_design: vec![hole(8.0), Shape::Box { min: [22.0, 4.0, 0.0], max: [24.0, 8.0, 6.0] }],
        supports: vec![Support {
            region: Region::Box { min: [0.0; 3], max: [0.0, 12.0, 6.0] },
            directions: [true; 3],
        }],
        loads: vec![Load {
            region: Region::Box { min: [24.0, 4.0, 0.0], max: [24.0, 8.0, 6.0] },
            force: Some([0.0, -100.0, 0.0]),
            pressure: None,
            case: 0,
        }],
        cell: Some(1.0),
        volume_fraction: 0.4,
        symmetry: vec![Axis::Z],
        ..Parameters::default()
    }
}

#[test]
fn a_beam_gets_stiffer_at_its_volume_and_keeps_its_hole() {
    for surface in [SurfaceForm::Threshold, SurfaceForm::Iso] {
        let parameters = Parameters { surface, ..beam() };
        let result = optimize(&parameters, None, &Units::none(), &Progress::silent()).unwrap();
        let c = &result.densities.compliances;
        assert!(result.densities.converged && c.len() < 60, "{c:?}");
        assert!(c[c.len() - 1] < 0.5 * c[0], "{c:?}");
        assert!(c.windows(2).skip(3).all(|w| w[1] < 1.02 * w[0]), "{c:?}");

        // Volume: of the densities exactly, of the surface roughly.
        let d = &result.densities;
        let design = |k: usize| {
            let p = d.grid.middle(d.grid.place(k));
            let off = DVec3::new(p.x - 12.0, p.y - 6.0, 0.0).length();
            off > 4.0 && !(p.x > 22.0 && (4.0..8.0).contains(&p.y))
        };
        let sum =
            |value: &dyn Fn(usize) -> f64| (0..d.grid.count()).filter(|&k| design(k)).map(value).sum::<f64>();
        let share = |k: usize| f64::from(d.fraction[k]);
        let reached = sum(&|k| f64::from(d.density[k]) * share(k)) / sum(&share);
        assert!((reached - 0.4).abs() < 1e-4, "{reached}");
        let part = &result.part;
        assert!((part.mesh.volume() / d.volume - 1.0).abs() < 0.1, "{} {}", part.mesh.volume(), d.volume);

        // Closed, symmetric in its volume about z = 3, inside of the domain.
        let connectivity = Connectivity::build(&part.mesh).unwrap();
        assert!(connectivity.is_closed());
        let (low, high) = part.mesh.bounds();
        assert!(low.cmpge(DVec3::splat(-1e-9)).all() && high.cmple(DVec3::new(24.0, 12.0, 6.0) + 1e-9).all());

        // The hole: vertices within the boss lie on its wall, on a plane, or beyond it.
        let radius = |p: DVec3| DVec3::new(p.x - 12.0, p.y - 6.0, 0.0).length();
        let wall = part.mesh.positions.iter().filter(|p| (radius(**p) - 2.0).abs() < 1e-9).count();
        assert!(wall > 40, "{wall}");
        assert!(part.mesh.positions.iter().all(|p| radius(*p) > 2.0 - 1e-9));
        let labelled = part.mesh.faces().filter(|f| part.design[f.index()] == Design::NonDesign);
        let of_wall =
            labelled.filter(|f| part.mesh.corners(*f).iter().all(|p| (radius(*p) - 2.0).abs() < 1e-9));
        let area: f64 = of_wall.map(|f| 0.5 * part.mesh.area_vector(f).length()).sum();
        assert!((area / (4.0 * std::f64::consts::PI * 6.0) - 1.0).abs() < 0.1, "{area}");
    }
}

#[derive(Default)]
struct Store(std::sync::Mutex<(std::collections::BTreeMap<UnitKey, Vec<u8>>, usize)>);

impl UnitStore for Store {
    fn get(&self, key: UnitKey) -> Option<Vec<u8>> {
        self.0.lock().unwrap().0.get(&key).cloned()
    }
    fn put(&self, key: UnitKey, value: &[u8]) {
        let mut store = self.0.lock().unwrap();
        store.0.insert(key, value.to_vec());
        store.1 += 1;
    }
    fn announce(&self, _: &str, _: &[UnitKey]) {}
}

#[test]
fn an_interrupted_run_ends_with_the_same_bytes() {
    let mut parameters = beam();
    let whole = optimize(&parameters, None, &Units::none(), &Progress::silent()).unwrap();
    let store = std::sync::Arc::new(Store::default());
    parameters.iterations = 5;
    optimize(&parameters, None, &Units::new(store.clone()), &Progress::silent()).unwrap();
    assert_eq!(store.0.lock().unwrap().1, 5);
    parameters.iterations = 100;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let rest = pool
        .install(|| optimize(&parameters, None, &Units::new(store.clone()), &Progress::silent()))
        .unwrap();
    assert_eq!(rest, whole);
    assert_eq!(store.0.lock().unwrap().1, whole.densities.compliances.len());
}

#[test]
fn symmetry_and_extrusion_hold_exactly() {
    let parameters =
        Parameters { average_along: Some(Axis::Z), symmetry: vec![Axis::Y], iterations: 6, ..beam() };
    let d = optimize(&parameters, None, &Units::none(), &Progress::silent()).unwrap().densities;
    for k in 0..d.grid.count() {
        let [x, y, z] = d.grid.place(k);
        assert_eq!(d.density[k], d.density[d.grid.index([x, 11 - y, z])]);
        assert_eq!(d.density[k], d.density[d.grid.index([x, y, 0])]);
    }
}

#[test]
fn what_can_not_be_is_said_before_anything_is_solved() {
    let error = |edit: &dyn Fn(&mut Parameters)| {
        let mut parameters = beam();
        edit(&mut parameters);
        optimize(&parameters, None, &Units::none(), &Progress::silent()).map(|_| ()).unwrap_err()
    };
    assert_eq!(error(&|p| p.domain.clear()), SimpError::NoDomain);
    let small = error(&|p| (p.fraction_of, p.volume_fraction) = (FractionOf::Whole, 0.1));
    assert!(matches!(small, SimpError::FractionTooSmall { .. }), "{small}");
    assert!(small.to_string().contains("can not hold the non-design parts"), "{small}");
    let passive = error(&|p| p.non_design = p.domain.clone());
    assert!(matches!(passive, SimpError::NoDesign(_)), "{passive}");
    assert!(error(&|p| p.supports.clear()).to_string().contains("not held"));
    let beside = error(&|p| p.loads[0].region = Region::Box { min: [30.0; 3], max: [31.0; 3] });
    assert!(beside.to_string().contains("no surface of the part"), "{beside}");
    let feature = error(&|p| p.loads[0].region = Region::Feature { near: [0.0; 3] });
    assert!(feature.to_string().contains("`box` or a `cylinder`"), "{feature}");
    let flat = error(&|p| p.domain.push(Shape::Box { min: [0.0; 3], max: [1.0, 0.0, 1.0] }));
    assert!(flat.to_string().contains("along y"), "{flat}");
    let apart = error(&|p| {
        p.domain.push(Shape::Box { min: [40.0, 0.0, 0.0], max: [50.0, 5.0, 5.0] });
        p.loads[0].region = Region::Box { min: [50.0, 0.0, 0.0], max: [50.0, 5.0, 5.0] };
    });
    assert!(apart.to_string().contains("disconnected"), "{apart}");
}

/// The same box as a solid and as triangles: the same fractions to a sample, and about the same part.
#[test]
fn a_mesh_is_a_design_space_as_well() {
    let parameters = beam();
    let solid = optimize(&parameters, None, &Units::none(), &Progress::silent()).unwrap();
    let space = TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(24.0, 12.0, 6.0));
    let without = Parameters { domain: Vec::new(), ..parameters };
    let meshed = optimize(&without, Some(&space), &Units::none(), &Progress::silent()).unwrap();
    assert_eq!(meshed.densities.fraction, solid.densities.fraction);
    let [a, b] = [&solid, &meshed].map(|r| r.densities.compliances.last().unwrap());
    assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    assert!((meshed.part.mesh.volume() / solid.part.mesh.volume() - 1.0).abs() < 0.01);
    assert!(Connectivity::build(&meshed.part.mesh).unwrap().is_closed());
    let (low, high) = meshed.part.mesh.bounds();
    assert!(low.cmpge(DVec3::splat(-1e-9)).all() && high.cmple(DVec3::new(24.0, 12.0, 6.0) + 1e-9).all());
}
