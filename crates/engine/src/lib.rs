//! A staged pipeline engine: spec, graph, plan, run, content-addressed artifacts. Knows no geometry.
