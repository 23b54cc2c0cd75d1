//! What a division leaves as it was.
//!
//! Vertices, edges, quads and faces that are not divided keep their numbers, see [`topipe_quad_matching::divide`]. What is found for
//! them depends on a neighbourhood that is small; where all of it is the same, so is what would be found.

use crate::setting::Setting;
use topipe_quad_matching::QuadLayout;

/// Which quads have the faces, sides and paths that those of the same numbers have in another layout.
pub(crate) fn same_quads(before: &QuadLayout, now: &QuadLayout) -> Vec<bool> {
    let (old, new) = (&before.part.mesh, &now.part.mesh);
    if !new.positions.starts_with(&old.positions) {
        return vec![false; now.quads.len()];
    }
    let mut same = vec![true; now.quads.len()];
    let mut differs = |quad: u32| {
        if let Some(same) = same.get_mut(quad as usize) {
            *same = false;
        }
    };
    for (f, &quad) in now.quad_of_face.iter().enumerate() {
        if before.quad_of_face.get(f) != Some(&quad) || old.triangles[f] != new.triangles[f] {
            before.quad_of_face.get(f).into_iter().for_each(|&quad| differs(quad));
            differs(quad);
        }
    }
    let edges = same_paths(before, now);
    for (quad, sides) in now.quads.iter().enumerate() {
        if before.quads.get(quad) != Some(sides) || sides.iter().any(|side| !edges[side.edge as usize]) {
            same[quad] = false;
        }
    }
    same
}

/// Which edges have the path of the edge of the same number in another layout.
fn same_paths(before: &QuadLayout, now: &QuadLayout) -> Vec<bool> {
    now.edges.iter().enumerate().map(|(e, edge)| before.edges.get(e) == Some(edge)).collect()
}

/// What is the same in two settings.
pub(crate) struct Common {
    /// Quads that are the same, and what is known of their sides before the fit is.
    pub(crate) quads: Vec<bool>,
    /// Edges with the same path, between patches or shapes in the same way.
    pub(crate) edges: Vec<bool>,
    /// The number that a sector had before, where all its quads and spokes are the same.
    pub(crate) sectors: Vec<Option<usize>>,
}

impl Common {
    /// `quads` are those of [`same_quads`].
    pub(crate) fn of(before: &Setting<'_>, now: &Setting<'_>, quads: &[bool]) -> Self {
        let edges: Vec<bool> = same_paths(before.layout, now.layout)
            .into_iter()
            .enumerate()
            .map(|(e, same)| {
                same && before.roles[e] == now.roles[e]
                    && before.features[e] == now.features[e]
                    && before.tangent_to[e] == now.tangent_to[e]
                    && before.borders.curves[e] == now.borders.curves[e]
            })
            .collect();
        let has_sides = |quad: usize| now.layout.quads[quad].iter().all(|side| edges[side.edge as usize]);
        let quads: Vec<bool> = (0..quads.len()).map(|quad| quads[quad] && has_sides(quad)).collect();
        let sector_before = |sector: &crate::fans::Sector| {
            let &(quad, corner) = sector.quads.first()?;
            let number = before.sectors.at.get(quad as usize)?[corner as usize] as usize;
            let v = sector.vertex as usize;
            let same = before.sectors.list.get(number) == Some(sector)
                && sector.quads.iter().all(|&(quad, _)| quads[quad as usize])
                && sector.spokes.iter().all(|spoke| edges[spoke.edge as usize])
                && before.borders.vertices.get(v) == now.borders.vertices.get(v);
            same.then_some(number)
        };
        let sectors = now.sectors.list.iter().map(sector_before).collect();
        Self { quads, edges, sectors }
    }

    /// Whether all is the same that the local fits along a smooth edge see: the quads around both of its ends.
    pub(crate) fn is_curve_known(&self, now: &Setting<'_>, e: usize) -> bool {
        let Some(&(quad, side)) = now.beside[e].first() else { return false };
        let corners = [side, (side + 1) % 4].map(|k| now.sectors.at[quad as usize][k as usize] as usize);
        self.edges[e]
            && now.beside[e].iter().all(|&(quad, _)| self.quads[quad as usize])
            && corners.iter().all(|&sector| self.sectors[sector].is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setting::tests::layout;
    use topipe_progress::Progress;
    use topipe_quad_matching::{Division, divide};

    #[test]
    fn what_a_division_does_not_touch_is_the_same() {
        let (layout, samples) = layout("y-form");
        let quad = layout.quads.len() / 2;
        let wanted = [layout.corners(quad).to_vec()];
        let Division { layout: finer, .. } = divide(&layout, &wanted, &Progress::silent()).unwrap().unwrap();
        let same = same_quads(&layout, &finer);
        assert_eq!(same.len(), finer.quads.len());
        assert!(!same[quad] && same[layout.quads.len()..].iter().all(|same| !same));
        let changed = same[..layout.quads.len()].iter().filter(|same| !**same).count();
        assert!((3..60).contains(&changed), "{changed}");
        // The same quad has the same samples.
        let faces = crate::samples::faces_by_quad(&finer);
        for q in (0..layout.quads.len()).filter(|&q| same[q]) {
            let again = crate::samples::sample(&finer, q, &faces[q]).unwrap();
            assert_eq!(crate::unit::key_of(&again), crate::unit::key_of(&samples[q]), "{q}");
        }
        let (before, now) = (Setting::new(&layout).unwrap(), Setting::new(&finer).unwrap());
        let common = Common::of(&before, &now, &same);
        assert!(
            !common.quads[quad] && common.quads.iter().filter(|same| **same).count() > layout.quads.len() / 2
        );
        assert!(common.sectors.iter().any(Option::is_none) && common.sectors.iter().any(Option::is_some));
        // Of two layouts of different meshes nothing is.
        let mut moved = finer.clone();
        moved.part.mesh.positions[0].x += 1.0;
        assert!(!same_quads(&layout, &moved).contains(&true));
    }
}
