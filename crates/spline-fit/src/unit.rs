//! Patches that survive the death of a run.
//!
//! What a patch becomes depends on its samples, its borders and a few parameters, and on nothing else. Their hash is
//! the key under which it is kept: an interrupted fit takes up where it was, and after an edit only the patches are
//! fitted again whose mesh or whose borders have changed.

use crate::hermite;
use crate::patch_fit::{Border, Net};
use crate::samples::PatchSamples;
use crate::{Parameters, SplineFitError};
use topipe_mesh::DVec3;
use topipe_progress::{UnitKey, Units};

/// The key of what a patch is fitted to, with the parameters that its samples begin with.
pub(crate) fn key_of(samples: &PatchSamples) -> UnitKey {
    let mut numbers = Vec::with_capacity(6 * samples.samples.len() + 1);
    numbers.push(samples.area);
    for sample in &samples.samples {
        numbers.extend(sample.point.to_array());
        numbers.extend([sample.u, sample.v, sample.weight]);
    }
    UnitKey::of("samples of a spline patch").f64s(&numbers).finish()
}

/// The key of a patch.
pub(crate) fn key(
    samples: UnitKey,
    borders: &[Border; 4],
    corners: &[DVec3; 4],
    parameters: &Parameters,
    near_enough: f64,
) -> UnitKey {
    let mut hasher = UnitKey::of("spline patch")
        .key(samples)
        .f64s(&[parameters.lambda, near_enough])
        .u64(parameters.foot_point_rounds.into());
    for border in borders {
        let flat = |points: &[DVec3]| points.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>();
        hasher = hasher
            .u64(border.spans as u64)
            .f64s(&flat(&border.control))
            .u64(border.ribbon.is_some().into())
            .f64s(&flat(border.ribbon.as_deref().unwrap_or(&[])));
    }
    hasher.f64s(&corners.map(|c| c.to_array()).concat()).finish()
}

/// The patch kept under `key`, or what `compute` makes of it. The samples are moved to their foot points either way.
pub(crate) fn recall(
    units: &Units,
    key: UnitKey,
    samples: &mut PatchSamples,
    borders: &[Border; 4],
    compute: impl FnOnce(&mut PatchSamples) -> Result<Net, SplineFitError>,
) -> Result<Net, SplineFitError> {
    let (basis_u, basis_v) = (hermite::basis(borders[0].spans), hermite::basis(borders[1].spans));
    let net = basis_u.len() * basis_v.len();
    let numbers = units.f64s(key, || {
        let net = compute(samples)?;
        let control = net.control.iter().flat_map(|p| p.to_array());
        let places = samples.samples.iter().flat_map(|s| [s.u, s.v]);
        Ok::<Vec<f64>, SplineFitError>(control.chain(places).collect())
    })?;
    if numbers.len() != 3 * net + 2 * samples.samples.len() {
        return Err(SplineFitError::Layout("a kept patch has the wrong size".into()));
    }
    let (control, places) = numbers.split_at(3 * net);
    for (sample, place) in samples.samples.iter_mut().zip(places.chunks_exact(2)) {
        (sample.u, sample.v) = (place[0], place[1]);
    }
    Ok(Net { basis_u, basis_v, control: control.chunks_exact(3).map(DVec3::from_slice).collect() })
}
