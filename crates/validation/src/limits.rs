//! Limits that the surface shall keep, and where it does not.

use crate::report::{LimitFigures, SurfaceFigures};
use crate::{Parameters, ValidationError};
use topipe_spline_fit::SplineSurface;

/// Compares the surface with the limits that are set, its distance from the mesh with what it was `fitted` to where none is set for it.
/// Fails with `require` where one is broken.
pub(crate) fn check(
    surface: &SurfaceFigures,
    fitted: &SplineSurface,
    diagonal: f64,
    parameters: &Parameters,
) -> Result<Vec<LimitFigures>, ValidationError> {
    // The narrower of both.
    let narrower = |mm: Option<f64>, share: Option<f64>| {
        let both = [mm, share.map(|share| share * diagonal)];
        both.into_iter().flatten().filter(|limit| *limit >= 0.0).min_by(f64::total_cmp)
    };
    let narrower = narrower(parameters.max_deviation_mm, parameters.max_deviation)
        .or_else(|| narrower(fitted.tolerance_mm, fitted.tolerance));
    let mut limits = Vec::new();
    if let (Some(limit), Some(deviation)) = (narrower, &surface.deviation) {
        limits.push(LimitFigures {
            figure: "surface.deviation.max_mm".into(),
            value: deviation.max_mm,
            limit,
            kept: deviation.max_mm <= limit,
            at: Some(deviation.max_at),
        });
    }
    if let Some(limit) = parameters.max_normal_jump {
        let (value, at) = surface.normal_jump_deg.as_ref().map_or((0.0, None), |j| (j.max, Some(j.max_at)));
        limits.push(LimitFigures {
            figure: "surface.normal_jump_deg.max".into(),
            value,
            limit,
            kept: value <= limit,
            at,
        });
    }
    if let Some(limit) = parameters.max_gap_mm {
        let value = surface.gap_mm;
        let kept = value <= limit;
        limits.push(LimitFigures { figure: "surface.gap_mm".into(), value, limit, kept, at: None });
    }
    let broken: Vec<String> = limits.iter().filter(|l| !l.kept).map(LimitFigures::describe).collect();
    if parameters.require && !broken.is_empty() {
        return Err(ValidationError::Limits { broken: broken.join("; ") });
    }
    Ok(limits)
}

impl LimitFigures {
    /// In a sentence without its end.
    pub(crate) fn describe(&self) -> String {
        let at = self.at.map_or_else(String::new, |[x, y, z]| format!(" at ({x:.3}, {y:.3}, {z:.3})"));
        let state = if self.kept { "within" } else { "above" };
        format!("{} is {:.4e}, {state} {:.4e}{at}", self.figure, self.value, self.limit)
    }
}
