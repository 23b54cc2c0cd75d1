//! Counting on vertices, edges and faces, for layouts and surfaces alike.

/// What counting says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Complex {
    /// Each edge has two sides in opposite directions, and the sides of each face form loops.
    pub(crate) closed: bool,
    /// `components - (V - E + sum of 2 - loops) / 2` over the vertices and edges in use, where closed: a face with
    /// `n` loops is a sphere with `n` holes.
    pub(crate) genus: Option<i64>,
}

/// The sides around a quad or along one loop of a face: edges, and whether they are run backwards.
type Loop = Vec<(u32, bool)>;

/// `faces` gives the loops of each face. All indices must be in range.
pub(crate) fn count(vertices: usize, ends: &[[u32; 2]], faces: impl Iterator<Item = Vec<Loop>>) -> Complex {
    let mut uses = vec![[0u32; 2]; ends.len()];
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    let mut used = vec![false; vertices];
    let (mut all, mut interiors, mut loops) = (0i64, 0i64, true);
    for face in faces {
        all += 1;
        interiors += 2 - face.len() as i64;
        // All loops of a face belong to one component.
        let first =
            face.first().and_then(|sides| sides.first()).map(|&(e, r)| ends[e as usize][usize::from(r)]);
        for sides in &face {
            for (k, &(edge, reversed)) in sides.iter().enumerate() {
                let (next, next_reversed) = sides[(k + 1) % sides.len()];
                uses[edge as usize][usize::from(reversed)] += 1;
                let (start, end) =
                    (ends[edge as usize][usize::from(reversed)], ends[edge as usize][usize::from(!reversed)]);
                loops &= end == ends[next as usize][usize::from(next_reversed)];
                used[start as usize] = true;
                used[end as usize] = true;
                for v in [Some(end), first].into_iter().flatten() {
                    let (a, b) = (root(&mut parent, start), root(&mut parent, v));
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
    }
    // An edge without a side is not a border: it is not there at all.
    let in_use = uses.iter().filter(|u| **u != [0, 0]);
    let closed = all > 0 && loops && in_use.clone().all(|u| *u == [1, 1]);
    let components = (0..vertices).filter(|&v| used[v] && parent[v] == v as u32).count() as i64;
    let euler = used.iter().filter(|&&u| u).count() as i64 - in_use.count() as i64 + interiors;
    Complex { closed, genus: closed.then_some(components - euler / 2) }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Sides = [(u32, bool); 4];

    fn quad_complex(vertices: usize, ends: &[[u32; 2]], quads: impl Iterator<Item = Sides>) -> Complex {
        count(vertices, ends, quads.map(|sides| vec![sides.to_vec()]))
    }

    /// A torus of `m` x `n` quads: edges 2 k (along) and 2 k + 1 (across) start at vertex k.
    fn torus(m: usize, n: usize) -> (Vec<[u32; 2]>, Vec<Sides>) {
        let at = |i: usize, j: usize| (i % m * n + j % n) as u32;
        let (mut ends, mut quads) = (Vec::new(), Vec::new());
        for i in 0..m {
            for j in 0..n {
                ends.push([at(i, j), at(i + 1, j)]);
                ends.push([at(i, j), at(i, j + 1)]);
                quads.push([
                    (2 * at(i, j), false),
                    (2 * at(i + 1, j) + 1, false),
                    (2 * at(i, j + 1), true),
                    (2 * at(i, j) + 1, true),
                ]);
            }
        }
        (ends, quads)
    }

    #[test]
    fn a_torus_has_genus_one_even_with_a_single_quad() {
        for (m, n) in [(4, 3), (1, 1), (2, 1)] {
            let (ends, quads) = torus(m, n);
            let complex = quad_complex(m * n, &ends, quads.into_iter());
            assert_eq!(complex, Complex { closed: true, genus: Some(1) }, "{m} x {n}");
        }
    }

    #[test]
    fn a_missing_quad_or_a_reversed_side_is_seen() {
        let (ends, quads) = torus(3, 3);
        let open = quad_complex(9, &ends, quads[1..].iter().copied());
        assert_eq!(open, Complex { closed: false, genus: None });
        let mut turned = quads;
        turned[4][2].1 = false;
        assert!(!quad_complex(9, &ends, turned.into_iter()).closed);
        assert!(!quad_complex(0, &[], std::iter::empty()).closed);
    }

    #[test]
    fn faces_with_several_loops_count_as_spheres_with_holes() {
        // A tube: four circles, each one closed edge; two walls and two rings, each with two loops.
        let ends: Vec<[u32; 2]> = (0..4).map(|v| [v, v]).collect();
        let face = |a: u32, b: u32| vec![vec![(a, false)], vec![(b, true)]];
        let tube = [face(0, 1), face(1, 2), face(2, 3), face(3, 0)];
        assert_eq!(count(4, &ends, tube.into_iter()), Complex { closed: true, genus: Some(1) });
        // A solid cylinder: a wall and two disks.
        let solid = [face(0, 1), vec![vec![(1, false)]], vec![vec![(0, true)]]];
        assert_eq!(count(2, &ends[..2], solid.into_iter()), Complex { closed: true, genus: Some(0) });
    }
}
