"""Edits each of the nine examples four times with `topipe edit`, and says how much of the fit was made again.

    python3 pipelines/studies/edits.py target/release/topipe [PART ...]

An edit is a bump on the surface around a corner of a triangle: 3 % of the diagonal in radius and 0.3 % high twice, 6 % and 1 % once. A fourth
edit has other triangles as well: it is a bump as the first one somewhere else, with four triangles for each one below it, in a file in which
triangles are in another order. Needs nothing but Python.
"""

import json
import math
import random
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
OTHER_TRIANGLES = (0.45, 0.03, 0.003)
UP = (0.6, 0.0, 0.8)


def corners(stl):
    """Where the corners of a binary STL are, and their coordinates."""
    (count,) = struct.unpack_from("<I", stl, 80)
    places = [84 + 50 * face + 12 + 12 * k for face in range(count) for k in range(3)]
    return [(place, struct.unpack_from("<3f", stl, place)) for place in places]


def divided(stl, share, radius):
    """With edges halved around a corner, and triangles in another order."""
    points = [p for _, p in corners(stl)]
    size = diagonal(points)
    center = points[3 * int(share * len(points) / 3)]
    single = lambda p: struct.unpack("<3f", struct.pack("<3f", *p))
    middle = lambda p, q: single([(x + y) / 2 for x, y in zip(p, q)])
    near = lambda p: math.dist(p, center) < radius * size
    triangles = []
    for k in range(0, len(points), 3):
        outline, halved = [], []
        for p, q in zip(points[k : k + 3], points[k + 1 : k + 3] + points[k : k + 1]):
            outline.append(p)
            if near(p) and near(q):
                halved.append(len(outline))
                outline.append(middle(p, q))
        if len(halved) == 3:
            triangles += [[outline[0], outline[1], outline[5]], [outline[1], outline[2], outline[3]]]
            triangles += [[outline[3], outline[4], outline[5]], [outline[1], outline[3], outline[5]]]
        else:
            # All of them from the middle of an edge, if there is one.
            first = halved[0] if halved else 0
            outline = outline[first:] + outline[:first]
            triangles += [[outline[0], outline[k], outline[k + 1]] for k in range(1, len(outline) - 1)]
    random.Random(7).shuffle(triangles)
    records = (struct.pack("<12fH", 0, 0, 0, *(x for p in t for x in p), 0) for t in triangles)
    return stl[:80] + struct.pack("<I", len(triangles)) + b"".join(records), center


def diagonal(points):
    low, high = ([f(p[k] for p in points) for k in range(3)] for f in (min, max))
    return math.dist(low, high)


def bumped(stl, share, radius, height, center=None):
    stl = bytearray(stl)
    points = corners(stl)
    size = diagonal([p for _, p in points])
    center = center or points[3 * int(share * len(points) / 3)][1]
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
        for number, edit in enumerate([*EDITS, OTHER_TRIANGLES], 1):
            mesh, center = (stl, None) if edit in EDITS else divided(stl, *edit[:2])
            (folder / f"edit-{number}.stl").write_bytes(bumped(mesh, *edit, center))
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
