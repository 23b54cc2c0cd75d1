//! Solids and their cavities among the connected pieces of a closed surface.

use super::draft::Draft;
use super::{Components, ImportError};
use crate::spatial::{DIRECTIONS, SurfaceIndex};
use crate::{Connectivity, FaceId, TriangleMesh};
use glam::DVec3;

/// One connected piece of the surface.
struct Shell {
    faces: Vec<u32>,
    volume: f64,
    low: DVec3,
    high: DVec3,
}

impl Shell {
    fn encloses_box(&self, other: &Self) -> bool {
        self.low.cmple(other.low).all() && self.high.cmpge(other.high).all()
    }
}

/// Keeps the solids that `components` asks for with their cavities; turns outer shells outward and cavities inward.
pub(super) fn select(
    file: &str,
    draft: &mut Draft,
    connectivity: &Connectivity,
    components: Components,
) -> Result<(), ImportError> {
    let (shell_of, count) = connectivity.components();
    let mut shells = measure(&draft.mesh, &shell_of, count);
    // A shell encloses something if its volume is more than the rounding of its summands.
    let solid: Vec<bool> = shells
        .iter()
        .map(|s| {
            let size = s.high - s.low;
            s.volume.abs() > 1e-13 * size.length().powi(3)
        })
        .collect();
    if !solid.iter().any(|&s| s) {
        return Err(ImportError::NoVolume { file: file.to_owned() });
    }
    let container = containers(&draft.mesh, &shells, &shell_of, &solid);
    let depth = |mut s: usize| {
        let mut depth = 0;
        while let Some(outer) = container[s] {
            depth += 1;
            s = outer;
        }
        depth
    };
    let is_cavity: Vec<bool> = (0..count).map(|s| depth(s) % 2 == 1).collect();
    let largest = (0..count)
        .filter(|&s| solid[s] && !is_cavity[s])
        .reduce(|best, s| if shells[s].volume.abs() > shells[best].volume.abs() { s } else { best });
    let keep: Vec<bool> = (0..count)
        .map(|s| {
            let outer = if is_cavity[s] { container[s] } else { Some(s) };
            solid[s] && (components == Components::All || outer == largest)
        })
        .collect();
    let mut turned = 0;
    for (s, shell) in shells.iter_mut().enumerate().filter(|&(s, _)| keep[s]) {
        if (shell.volume < 0.0) != is_cavity[s] {
            for &f in &shell.faces {
                draft.mesh.triangles[f as usize].swap(1, 2);
            }
            turned += 1;
        }
    }
    let dropped = (0..count).filter(|&s| solid[s] && !keep[s] && !is_cavity[s]).count();
    let dropped_cavities = (0..count).filter(|&s| solid[s] && !keep[s] && is_cavity[s]).count();
    let empty = solid.iter().filter(|&&s| !s).count();
    if keep.contains(&false) {
        draft.retain_faces(|f| keep[shell_of[f] as usize]);
        draft.drop_unused_vertices();
    }
    draft.note("turned shells that were inside out", turned);
    draft.note("dropped shells without volume", empty);
    draft.note("dropped smaller components", dropped);
    draft.note("dropped cavities of smaller components", dropped_cavities);
    Ok(())
}

fn measure(mesh: &TriangleMesh, shell_of: &[u32], count: usize) -> Vec<Shell> {
    let mut shells: Vec<Shell> = (0..count)
        .map(|_| Shell { faces: Vec::new(), volume: 0.0, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY })
        .collect();
    for (f, &s) in shell_of.iter().enumerate() {
        let shell = &mut shells[s as usize];
        shell.faces.push(f as u32);
        for p in mesh.corners(FaceId::new(f)) {
            shell.low = shell.low.min(p);
            shell.high = shell.high.max(p);
        }
    }
    for shell in &mut shells {
        // About its own centre, so that a shell far from the origin keeps its digits.
        let center = (shell.low + shell.high) / 2.0;
        shell.volume = shell
            .faces
            .iter()
            .map(|&f| {
                let [a, b, c] = mesh.corners(FaceId(f)).map(|p| p - center);
                a.dot(b.cross(c))
            })
            .sum::<f64>()
            / 6.0;
    }
    shells
}

/// For each shell the innermost shell around it.
///
/// One ray from a point of the shell finds all shells around it: those that it crosses an odd number of times. The
/// innermost of them has the least volume. A shell that crosses another is not around it, as its box shows.
fn containers(mesh: &TriangleMesh, shells: &[Shell], shell_of: &[u32], solid: &[bool]) -> Vec<Option<usize>> {
    let mut container = vec![None; shells.len()];
    if shells.len() < 2 {
        return container;
    }
    let index = SurfaceIndex::build(mesh);
    for (s, shell) in shells.iter().enumerate().filter(|&(s, _)| solid[s]) {
        container[s] = around(mesh, s, shell, shell_of, &index)
            .into_iter()
            .filter(|&outer| solid[outer] && shells[outer].encloses_box(shell))
            .reduce(|best, t| if shells[t].volume.abs() < shells[best].volume.abs() { t } else { best });
    }
    container
}

/// The shells around `shell`, which is number `own`.
fn around(
    mesh: &TriangleMesh,
    own: usize,
    shell: &Shell,
    shell_of: &[u32],
    index: &SurfaceIndex,
) -> Vec<usize> {
    // Shells may touch, and there inside and outside can not be told apart: other points are tried.
    const CANDIDATES: usize = 64;
    let touching = 1e-6 * (shell.high - shell.low).length();
    let step = (shell.faces.len() / CANDIDATES).max(1);
    let mut last = Vec::new();
    for &f in shell.faces.iter().step_by(step) {
        let point = mesh.centroid(FaceId(f));
        for direction in DIRECTIONS.map(DVec3::normalize) {
            let mut hits = Vec::new();
            let mut unsure = false;
            // From a little behind the point, so that a surface through the point itself is noticed.
            index.all_hits(point - direction * touching, direction, |face, t, grazing| {
                let hit = shell_of[face.index()] as usize;
                if hit != own {
                    unsure |= grazing || t < 2.0 * touching;
                    hits.push(hit);
                }
            });
            hits.sort_unstable();
            last = hits.chunk_by(|x, y| x == y).filter(|g| g.len() % 2 == 1).map(|g| g[0]).collect();
            if !unsure {
                return last;
            }
        }
    }
    last
}
