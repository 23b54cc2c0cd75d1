//! The branches of a skeleton, and where they have to be divided to be straight.

use glam::DVec3;
use topipe_skeleton::{PointKind, Skeleton};

/// A chain of points between two nodes (which are the same for a loop).
#[derive(Debug, Clone)]
pub(crate) struct Branch {
    /// Points of the skeleton, those of the nodes included.
    pub(crate) chain: Vec<u32>,
}

/// All chains between points that are no plain branch points; a ring starts at its lowest point. Edges between an
/// interface and the point of its part are no branches.
pub(crate) fn find(skeleton: &Skeleton) -> Vec<Branch> {
    let neighbors = skeleton.neighbors();
    let n = neighbors.len();
    let mut is_node: Vec<bool> =
        (0..n).map(|p| skeleton.kinds[p] != PointKind::Branch || neighbors[p].len() != 2).collect();
    // A component of plain points only is a ring.
    let mut seen = is_node.clone();
    let mut stack: Vec<usize> = (0..n).filter(|&p| is_node[p]).collect();
    let mut reached = seen.clone();
    let mut flood = |stack: &mut Vec<usize>| {
        while let Some(p) = stack.pop() {
            for &q in &neighbors[p] {
                if !std::mem::replace(&mut reached[q as usize], true) {
                    stack.push(q as usize);
                }
            }
        }
        reached.iter().position(|r| !r).inspect(|&p| reached[p] = true)
    };
    while let Some(p) = flood(&mut stack) {
        is_node[p] = true;
        seen[p] = true;
        stack.push(p);
    }
    let mut branches = Vec::new();
    for start in (0..n).filter(|&p| is_node[p]) {
        for &next in &neighbors[start] {
            let mut chain = vec![start as u32, next];
            while let Some(&here) = chain.last()
                && !is_node[here as usize]
            {
                let before = chain[chain.len() - 2];
                let ahead = neighbors[here as usize].iter().copied().find(|&q| q != before);
                chain.push(ahead.unwrap_or(before));
            }
            let (first, last) = (chain[0], chain[chain.len() - 1]);
            // Each is met from both ends; a loop at one node from both its sides.
            let forwards = (first, chain[1]) <= (last, chain[chain.len() - 2]);
            let link = chain.len() == 2
                && [first, last].iter().any(|&p| skeleton.kinds[p as usize] == PointKind::NonDesign);
            if forwards && !link {
                branches.push(Branch { chain });
            }
        }
    }
    branches
}

/// Positions in `line` at which it is to be divided so that no piece leaves its chord by more than `most`, and at least
/// into `pieces`. Ascending, without the ends.
pub(crate) fn divisions(line: &[DVec3], most: f64, pieces: usize) -> Vec<usize> {
    let last = line.len().saturating_sub(1);
    let mut cuts: Vec<usize> = vec![0, last];
    cuts.extend((1..pieces).map(|k| k * last / pieces));
    cuts.sort_unstable();
    cuts.dedup();
    let mut k = 0;
    while k + 1 < cuts.len() {
        let (from, to) = (cuts[k], cuts[k + 1]);
        let (a, along) = (line[from], line[to] - line[from]);
        let off = |p: DVec3| {
            let t = ((p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            p.distance(a + t * along)
        };
        let far = (from + 1..to).map(|i| (off(line[i]), i)).max_by(|x, y| x.0.total_cmp(&y.0));
        match far {
            Some((distance, i)) if distance > most => cuts.insert(k + 1, i),
            _ => k += 1,
        }
    }
    cuts[1..cuts.len() - 1].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bent_line_is_divided_at_its_corner() {
        let line: Vec<_> = (0..=10)
            .map(f64::from)
            .map(|x| if x <= 6.0 { DVec3::new(x, 0.0, 0.0) } else { DVec3::new(6.0, x - 6.0, 0.0) })
            .collect();
        assert_eq!(divisions(&line, 0.5, 1), vec![6]);
        assert!(divisions(&line, 10.0, 1).is_empty());
        assert_eq!(divisions(&line, 10.0, 3), vec![3, 6]);
    }
}
