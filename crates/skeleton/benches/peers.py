#!/usr/bin/env python3
"""Marching sections beside CGAL's mean curvature flow on the space frame with known axes, in one run.

    apt-get install libcgal-dev libeigen3-dev g++
    python3 -m venv target/peers && target/peers/bin/pip install numpy trimesh networkx scipy
    cargo build --release -p topipe-skeleton --example skeletonize
    target/peers/bin/python crates/skeleton/benches/peers.py [--rounds 3]

The frame as it is (20,360 triangles) and subdivided once. Programs take turns; times are the best of the rounds and leave out reading
and writing. The distance is that of the points from the true axes, on branches and away from the nodes as `axes.json` says, as a root
mean square. Figures stand
in README.md beside this file.
"""
import argparse, json, os, re, subprocess, tempfile
import numpy as np, trimesh

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "../../..")


def rms(skeleton, axes):
    nodes, beams = np.array(axes["nodes"], float), axes["beams"]
    near = axes.get("exclude_mm") or [2 * max(r for u, v, r in beams if j in (u, v)) for j in range(len(nodes))]
    points = np.array(skeleton["points"])
    degree = np.bincount(np.array(skeleton["edges"]).ravel(), minlength=len(points))
    points = points[degree == 2]
    points = points[(np.linalg.norm(points[:, None] - nodes[None], axis=2) > np.array(near)).all(1)]
    distance = np.full(len(points), np.inf)
    for i, j, _ in beams:
        a, d = nodes[i], nodes[j] - nodes[i]
        t = np.clip((points - a) @ d / (d @ d), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(points - a - t[:, None] * d, axis=1))
    return np.sqrt((distance ** 2).mean())


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--binary", default=os.path.join(ROOT, "target/release/examples/skeletonize"))
    options = arguments.parse_args()
    frame = os.path.join(ROOT, "fixtures/space-frame")
    axes = json.load(open(os.path.join(frame, "axes.json")))
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        subprocess.run(["g++", "-O2", "-std=c++17", "-DNDEBUG", "-DCGAL_EIGEN3_ENABLED", "-I/usr/include/eigen3",
                        os.path.join(HERE, "cgal_skeleton.cpp"), "-o", at("cgal"), "-lgmp", "-lmpfr"], check=True)
        mesh = trimesh.load(os.path.join(frame, "space-frame.off"), process=False)
        for _ in range(2):
            mesh.export(at("mesh.off"))
            times = {}
            for _ in range(options.rounds):
                out = subprocess.run([options.binary, at("mesh.off"), "-", "marching-sections"], capture_output=True, check=True, text=True)
                open(at("topipe.json"), "w").write(out.stdout)
                times.setdefault("topipe", []).append(float(re.search(r"in ([0-9.]+) s", out.stderr)[1]))
                out = subprocess.run([at("cgal"), at("mesh.off"), at("cgal.json")], capture_output=True, check=True, text=True)
                times.setdefault("cgal", []).append(json.loads(out.stdout)["seconds"])
            print(f"{len(mesh.faces)} triangles, best of {options.rounds}")
            for name, t in times.items():
                skeleton = json.load(open(at(name + ".json")))
                print(f"  {name:7} {min(t):7.3f} s   {len(skeleton['points'])} points, rms distance from the axes {rms(skeleton, axes):.4f} mm")
            mesh = mesh.subdivide()


main()
