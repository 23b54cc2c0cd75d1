//! `topipe`: from a topology optimization result to a closed CAD solid.

fn main() {}
