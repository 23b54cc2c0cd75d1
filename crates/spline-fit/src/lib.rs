//! Tensor-product B-spline surfaces over a quadrilateral layout, and their STEP files.
