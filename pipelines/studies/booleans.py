"""Cuts and joins bodies on each of the nine examples as a modeller does, runs `topipe edit`, and says how much of the fit was made again.

    pip install manifold3d trimesh
    python3 pipelines/studies/booleans.py target/release/topipe [PART ...]

On each part, at random triangles: a hole is drilled through it, a cylinder is joined, a ball is joined, a ball is cut out, a box is cut out, 1 to 3 % of
the diagonal in radius. Ends with 1 where a surface is not closed, or a run fails or does not end within two minutes.
"""

import json
import re
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

import manifold3d
import numpy as np
import trimesh

ROOT = Path(__file__).resolve().parents[2]
PARTS = "bracket beam-two-holes bridge bell-crank support cantilever cantilever-four y-form monster-lite".split()
SEED = 1
# Seconds for one run.
MOST = 120


def bodies(mesh, random):
    """The part with each body cut out or joined."""
    part = manifold3d.Manifold(
        manifold3d.Mesh(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
    )
    size = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])

    def placed(body):
        face = random.integers(len(mesh.faces))
        turn = trimesh.geometry.align_vectors([0, 0, 1], mesh.face_normals[face])
        turn[:3, 3] = mesh.triangles_center[face]
        return body.transform(turn[:3, :4])

    radius = lambda: size * random.choice([0.01, 0.02, 0.03])
    cylinder = lambda length, r: manifold3d.Manifold.cylinder(length * size, r, r, 48, True)
    ball = lambda: manifold3d.Manifold.sphere(radius(), 32)
    r = radius()
    yield "hole", part - placed(cylinder(0.3, radius()))
    yield "stud", part + placed(cylinder(0.06, radius()))
    yield "ball", part + placed(ball())
    yield "dent", part - placed(ball())
    yield "box", part - placed(manifold3d.Manifold.cube([4 * r, 2 * r, r], True))


def run(topipe, folder, *words):
    try:
        ended = subprocess.run([topipe, *words], cwd=folder, capture_output=True, text=True, timeout=MOST)
    except subprocess.TimeoutExpired:
        return None, f"it did not end within {MOST} s"
    return ended.returncode, ended.stdout + ended.stderr


def main():
    topipe = str(Path(sys.argv[1]).resolve())
    random = np.random.default_rng(SEED)
    shares, failed = [], 0
    for part in sys.argv[2:] or PARTS:
        folder = ROOT / "target" / "booleans" / part
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for ending in ("stl", "labels.csv"):
            shutil.copy(ROOT / "fixtures" / part / f"{part}.{ending}", folder)
        pipeline = (ROOT / "pipelines" / f"{part}.toml").read_text().replace(f"../fixtures/{part}/", "")
        (folder / f"{part}.toml").write_text(pipeline)
        run(topipe, folder, "run", f"{part}.toml")
        mesh = trimesh.load(folder / f"{part}.stl")
        mesh.merge_vertices()
        for name, body in bodies(mesh, random):
            # What is cut off is not looked at.
            body = max(body.decompose(), key=lambda piece: piece.volume()).to_mesh()
            corners = np.asarray(body.vert_properties)[:, :3]
            trimesh.Trimesh(corners, np.asarray(body.tri_verts), process=False).export(folder / f"{name}.stl")
            run(topipe, folder, "edit", f"{part}.toml", f"{name}.stl")
            code, said = run(topipe, folder, "run", "-v", f"{name}.toml")
            fitted = re.search(r"(\d+) parts reused, (\d+) computed", said)
            if code != 0 or not fitted:
                failed += 1
                print(f"{part} {name}: exit code {code}\n{said[-600:]}", flush=True)
                continue
            reused, computed = map(int, fitted.groups())
            report = json.loads((folder / "topipe-out" / name / "report.json").read_text())
            surface = report["surface"]
            failed += not surface["closed"]
            shares.append(computed / (reused + computed))
            kept = re.search(r"quads: (.*tiles are kept)", said)
            print(
                f"{part} {name}: {kept.group(1) if kept else 'all of it was laid out anew'}; {reused} parts of the fit reused and "
                f"{computed} computed ({shares[-1]:.0%}); {surface['patches']} patches, genus {surface['genus']}, "
                f"deviation {surface['deviation']['max_rel']:.2%}, jump {surface['normal_jump_deg']['max']:.3f}, "
                f"gap {surface['gap_mm']:.1e} mm, volume of the smoothed mesh {report['smoothing']['volume_error']:.0e}, closed: {surface['closed']}",
                flush=True,
            )
    print(f"{failed} failed; computed: {min(shares):.1%} to {max(shares):.0%}, median {statistics.median(shares):.0%}")
    sys.exit(failed > 0)


main()
