//! Refuses a surface that passes through itself.

use super::ImportError;
use super::draft::Draft;
use crate::spatial::crossings;

/// Refuses a surface that passes through itself.
pub(super) fn refuse_crossings(file: &str, draft: &Draft) -> Result<(), ImportError> {
    let found = crossings(&draft.mesh);
    let Some(first) = found.first() else { return Ok(()) };
    let [x, y] = first.faces.map(|f| draft.face_of[f.index()]);
    Err(ImportError::SelfIntersection {
        file: file.to_owned(),
        pairs: found.len(),
        first: x.min(y),
        second: x.max(y),
        point: first.point,
    })
}
