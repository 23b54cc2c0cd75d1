//! A small deterministic software renderer for triangle meshes.
