"""Edits each of the nine examples three times with `topipe edit`, and says how much of the fit was made again.

    python3 pipelines/studies/edits.py target/release/topipe [PART ...]

An edit is a bump on the surface around a corner of a triangle: 3 % of the diagonal in radius and 0.3 % high twice, 6 % and 1 % once. Needs
nothing but Python.
"""

import json
import math
import re
import shutil
import statistics
import struct
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = "bracket beam-two-holes bridge bell-crank support cantilever cantilever-four y-form monster-lite".split()
# Share of the triangles at which the bump is; radius and height over the diagonal.
EDITS = [(0.3, 0.03, 0.003), (0.6, 0.03, 0.003), (0.85, 0.06, 0.01)]
UP = (0.6, 0.0, 0.8)


def corners(stl):
    """Where the corners of a binary STL are, and their coordinates."""
    (count,) = struct.unpack_from("<I", stl, 80)
    places = [84 + 50 * face + 12 + 12 * k for face in range(count) for k in range(3)]
    return [(place, struct.unpack_from("<3f", stl, place)) for place in places]


def bumped(stl, share, radius, height):
    stl = bytearray(stl)
    points = corners(stl)
    low, high = ([f(p[k] for _, p in points) for k in range(3)] for f in (min, max))
    size = math.dist(low, high)
    center = points[3 * int(share * len(points) / 3)][1]
    for place, p in points:
        r = math.dist(p, center) / (radius * size)
        if r < 1.0:
            lift = height * size * (1.0 - r * r) ** 2
            struct.pack_into("<3f", stl, place, *(x + lift * up for x, up in zip(p, UP)))
    return bytes(stl)


def run(topipe, folder, *words):
    ended = subprocess.run([topipe, *words], cwd=folder, capture_output=True, text=True)
    if ended.returncode != 0:
        sys.exit(ended.stdout + ended.stderr)
    return ended.stdout + ended.stderr


def fitted(said):
    reused, computed = re.search(r"(\d+) parts reused, (\d+) computed", said).groups()
    return int(reused), int(computed)


def main():
    topipe = str(Path(sys.argv[1]).resolve())
    shares = []
    for part in sys.argv[2:] or PARTS:
        folder = ROOT / "target" / "edits" / part
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for ending in ("stl", "labels.csv"):
            shutil.copy(ROOT / "fixtures" / part / f"{part}.{ending}", folder)
        pipeline = (ROOT / "pipelines" / f"{part}.toml").read_text().replace(f"../fixtures/{part}/", "")
        (folder / f"{part}.toml").write_text(pipeline)
        _, first = fitted(run(topipe, folder, "run", "-v", f"{part}.toml"))
        stl = (folder / f"{part}.stl").read_bytes()
        for number, edit in enumerate(EDITS, 1):
            (folder / f"edit-{number}.stl").write_bytes(bumped(stl, *edit))
            run(topipe, folder, "edit", f"{part}.toml", f"edit-{number}.stl")
            said = run(topipe, folder, "run", "-v", f"edit-{number}.toml")
            reused, computed = fitted(said)
            report = json.loads((folder / "topipe-out" / f"edit-{number}" / "report.json").read_text())
            surface = report["surface"]
            tiles = re.search(r"quads: (?:all )?(\d+) (?:of (\d+) )?tiles are kept", said)
            kept = tiles.group(0)[7:] if tiles else "all of it was laid out anew"
            shares.append(computed / (reused + computed))
            print(
                f"{part} {number}: {kept}; {first} parts of the fit before, now {reused} reused and {computed} computed ({shares[-1]:.0%}); "
                f"{surface['patches']} patches, deviation {surface['deviation']['max_rel']:.2%}, "
                f"jump {surface['normal_jump_deg']['max']:.3f}, gap {surface['gap_mm']:.1e} mm, closed: {surface['closed']}",
                flush=True,
            )
    print(f"computed: {min(shares):.1%} to {max(shares):.0%}, median {statistics.median(shares):.0%}")


main()
