//! Augmented Voronoi tessellation of a triangle mesh.
