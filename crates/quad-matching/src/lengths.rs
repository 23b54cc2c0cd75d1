//! How large a part and its triangles are.

use serde::{Deserialize, Serialize};
use topipe_mesh::TriangleMesh;

/// Octaves within which lengths are the same after an edit: 4.4 %.
const ALIKE: f64 = 1.0 / 16.0;

/// Lengths of a whole part, mm, that a fit takes as a measure of what is small. Each border and each patch depends on them, so they are those
/// of the part that a layout was first made for: where it is divided, or carried over to an edited part of about the same size, patches
/// elsewhere stay what they are. Rounded to a 64th of an octave.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lengths {
    /// Of the box around the part.
    pub diagonal: f64,
    /// The length of an edge of the triangle at a random place of the surface. Cuts leave many short edges beside them, which
    /// hardly count here: it is about the mean edge length of the mesh before it was cut.
    pub edge: f64,
}

impl Lengths {
    /// Of a mesh; 0 without faces.
    pub fn of(mesh: &TriangleMesh) -> Self {
        let (mut sum, mut area) = (0.0, 0.0);
        for f in mesh.faces() {
            let [a, b, c] = mesh.corners(f);
            let weight = mesh.area_vector(f).length();
            sum += weight * (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0;
            area += weight;
        }
        Self { diagonal: rounded(mesh.diagonal()), edge: rounded(sum / area) }
    }

    /// The `earlier` ones if both are about the same, else these.
    pub(crate) fn after(self, earlier: Self) -> Self {
        let alike = |own: f64, earlier: f64| (own.log2() - earlier.log2()).abs() <= ALIKE;
        let [own, before] = [self, earlier].map(|lengths| [lengths.diagonal, lengths.edge]);
        if alike(own[0], before[0]) && alike(own[1], before[1]) { earlier } else { self }
    }
}

fn rounded(length: f64) -> f64 {
    if length > 0.0 && length.is_finite() { ((64.0 * length.log2()).round() / 64.0).exp2() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::DVec3;

    #[test]
    fn lengths_stay_while_a_part_is_about_as_large() {
        let cube = |size: f64| TriangleMesh::cuboid(DVec3::ZERO, DVec3::splat(size));
        let first = Lengths::of(&cube(10.0));
        assert!((first.diagonal / (10.0 * 3f64.sqrt()) - 1.0).abs() < 6e-3);
        assert!((first.edge / (10.0 * (2.0 + 2f64.sqrt()) / 3.0) - 1.0).abs() < 6e-3);
        for (size, same) in [(9.7, true), (10.3, true), (9.0, false), (11.0, false)] {
            let own = Lengths::of(&cube(size));
            assert_ne!(own, first);
            assert_eq!(own.after(first), if same { first } else { own }, "{size}");
        }
        let none = Lengths::of(&TriangleMesh::default());
        assert_eq!((none.diagonal, none.edge), (0.0, 0.0));
        assert_eq!(first.after(none), first);
    }
}
