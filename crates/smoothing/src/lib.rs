//! Mesh smoothing that keeps volume, holes and flat faces.
