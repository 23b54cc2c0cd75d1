//! Solids and their cavities among the connected pieces of a closed surface.

use super::draft::Draft;
use super::{Components, ImportError};
use crate::spatial::SurfaceIndex;
use crate::{Connectivity, TriangleMesh};
use glam::DVec3;

/// One connected piece of the surface.
struct Shell {
    faces: Vec<u32>,
    volume: f64,
    low: DVec3,
    high: DVec3,
}

impl Shell {
    fn mesh(&self, whole: &TriangleMesh) -> TriangleMesh {
        // Positions are shared by copy: only shells that enclose the box of another come here.
        TriangleMesh {
            positions: whole.positions.clone(),
            triangles: self.faces.iter().map(|&f| whole.triangles[f as usize]).collect(),
        }
    }

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
    let container = containers(&draft.mesh, &shells, &solid);
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
        for p in mesh.corners(crate::FaceId::new(f)) {
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
                let [a, b, c] = mesh.corners(crate::FaceId(f)).map(|p| p - center);
                a.dot(b.cross(c))
            })
            .sum::<f64>()
            / 6.0;
    }
    shells
}

/// For each shell the innermost shell around it.
fn containers(mesh: &TriangleMesh, shells: &[Shell], solid: &[bool]) -> Vec<Option<usize>> {
    // From small to large: the first shell that contains another is the innermost.
    let mut by_volume: Vec<usize> = (0..shells.len()).filter(|&s| solid[s]).collect();
    by_volume.sort_by(|&a, &b| shells[a].volume.abs().total_cmp(&shells[b].volume.abs()).then(a.cmp(&b)));
    let mut index: Vec<Option<SurfaceIndex>> = shells.iter().map(|_| None).collect();
    let mut container = vec![None; shells.len()];
    for (rank, &inner) in by_volume.iter().enumerate() {
        for &outer in &by_volume[rank + 1..] {
            if !shells[outer].encloses_box(&shells[inner]) {
                continue;
            }
            let around = index[outer].get_or_insert_with(|| SurfaceIndex::build(&shells[outer].mesh(mesh)));
            if around.contains(sample(mesh, &shells[inner], around)) {
                container[inner] = Some(outer);
                break;
            }
        }
    }
    container
}

/// A point of `shell` off the surface `other`: shells may touch, and there inside and outside can not be told apart.
fn sample(mesh: &TriangleMesh, shell: &Shell, other: &SurfaceIndex) -> DVec3 {
    let far = 1e-6 * (shell.high - shell.low).length();
    let step = (shell.faces.len() / 64).max(1);
    let candidates = || shell.faces.iter().step_by(step).map(|&f| mesh.centroid(crate::FaceId(f)));
    candidates()
        .find(|&p| other.nearest(p).is_some_and(|n| n.distance > far))
        .or_else(|| candidates().next())
        .unwrap_or(DVec3::NAN)
}
