//! Curve skeletons of beam-like parts.
