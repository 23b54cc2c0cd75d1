//! Quadrilateral layout: dual macro-triangles, disk maps, minimum-weight perfect matching.
