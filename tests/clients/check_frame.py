#!/usr/bin/env python3
"""Compare a frame model with the solid it stands for, both solved by CalculiX.

  python3 check_frame.py frame.inp beams.json mesh.off [--size MM] [--work DIR]

frame.inp and beams.json are exports of one `beams` stage with supports and loads; mesh.off is the part, closed.
The part is filled with quadratic tetrahedra (gmsh). Behind each support of the frame the solid is clamped, and each load is
spread over the nodes of the solid beyond the loaded node (around it, where beams leave to all sides).
Needs ccx (Debian: calculix-ccx) on the path and gmsh, numpy, trimesh (PyPI).
Prints one JSON object: compliance of both in N mm (the work of the loads), their ratio, and the number of nodes.
"""
import argparse, json, os, re, subprocess, sys, tempfile
import numpy as np


def solve(folder, name):
    run = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "2"})
    dat = os.path.join(folder, name + ".dat")
    if run.returncode or not os.path.exists(dat) or not os.path.getsize(dat):
        raise SystemExit(f"ccx failed on {name}:\n" + run.stdout[-2000:])
    text = open(dat).read()
    block = text.split("displacements")[-1].split("forces")[0]
    out = {}
    for line in block.splitlines():
        m = line.split()
        if len(m) == 4 and m[0].isdigit():
            out[int(m[0])] = np.array([float(x) for x in m[1:]])
    return out


def solid(mesh_file, size, beams, young, poisson, folder):
    import gmsh, trimesh
    mesh = trimesh.load_mesh(mesh_file)
    mesh.merge_vertices()
    stl = os.path.join(folder, "part.stl")
    mesh.export(stl)
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(stl)
    gmsh.model.mesh.createTopology()
    surfaces = [s[1] for s in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    types, _, nodes = gmsh.model.mesh.getElements(3)
    tets = np.concatenate([n.reshape(-1, 10) for t, n in zip(types, nodes) if t == 11])
    gmsh.finalize()
    tets = tets[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]  # gmsh and CalculiX number the last two middles the other way round
    used = np.unique(tets)
    where = {int(t): x for t, x in zip(tags, xyz.reshape(-1, 3))}
    ids = np.array([int(t) for t in used])
    P = np.array([where[i] for i in ids])
    N = np.array([n["position"] for n in beams["nodes"]])
    radius = lambda n: max(np.sqrt(b["section"]["area"] / np.pi) for b in beams["beams"] if n in b["nodes"])
    def beyond(n):
        """The nodes of the solid past frame node n, seen from its beams; around it where beams leave to all sides."""
        away = []
        for b in beams["beams"]:
            if n in b["nodes"]:
                other = b["nodes"][1] if b["nodes"][0] == n else b["nodes"][0]
                d = N[other] - N[n]
                away.append((b["length"], d / np.linalg.norm(d)))
        # Where a support divides a beam, the longer piece is the frame and the stub behind it is held with it.
        directions = [d for _, d in sorted(away, key=lambda x: -x[0])]
        if len(directions) == 2 and directions[0] @ directions[1] < -0.99:
            directions = directions[:1]
        mean = np.mean(directions, axis=0)
        r, off = radius(n), P - N[n]
        if np.linalg.norm(mean) > 0.5:
            return (off @ mean < 0) & (np.linalg.norm(off, axis=1) < 2.5 * r)
        return np.linalg.norm(off, axis=1) < r

    fixed = np.zeros(len(P), bool)
    for n in beams["supports"]:
        fixed |= beyond(n)
    force = np.zeros((len(P), 3))
    for load in beams["loads"]:
        near = beyond(load["node"])
        force[near] += np.array(load["force_N"]) / near.sum()
    with open(os.path.join(folder, "solid.inp"), "w") as f:
        f.write("*NODE, NSET=NALL\n")
        for i, p in zip(ids, P):
            f.write(f"{i}, {p[0]!r}, {p[1]!r}, {p[2]!r}\n".replace("np.float64(", "").replace(")", ""))
        f.write("*ELEMENT, TYPE=C3D10, ELSET=EALL\n")
        for k, t in enumerate(tets):
            f.write(f"{k + 1}, " + ", ".join(str(int(x)) for x in t) + "\n")
        f.write(f"*MATERIAL, NAME=M\n*ELASTIC\n{young}, {poisson}\n*SOLID SECTION, ELSET=EALL, MATERIAL=M\n*NSET, NSET=FIX\n")
        f.write(",\n".join(str(i) for i in ids[fixed]) + "\n")
        loaded = np.abs(force).max(axis=1) > 0
        f.write("*NSET, NSET=LOAD\n" + ",\n".join(str(i) for i in ids[loaded]) + "\n")
        f.write("*BOUNDARY\nFIX, 1, 3\n*STEP\n*STATIC\n*CLOAD\n")
        for i, v in zip(ids[loaded], force[loaded]):
            for k in range(3):
                if v[k]:
                    f.write(f"{i}, {k + 1}, {float(v[k])!r}\n")
        f.write("*NODE PRINT, NSET=LOAD\nU\n*END STEP\n")
    u = solve(folder, "solid")
    return float(sum(u[int(i)] @ v for i, v in zip(ids[loaded], force[loaded]))), len(P), int(fixed.sum())


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("deck")
    ap.add_argument("beams")
    ap.add_argument("mesh")
    ap.add_argument("--size", type=float, default=1.2)
    ap.add_argument("--work")
    a = ap.parse_args()
    folder = a.work or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    deck = open(a.deck).read()
    young, poisson = map(float, re.search(r"NAME=SOLID\n\*ELASTIC\n(.*), (.*)\n", deck).groups())
    beams = json.load(open(a.beams))
    open(os.path.join(folder, "frame.inp"), "w").write(deck)
    u = solve(folder, "frame")
    frame = float(sum(u[l["node"] + 1] @ np.array(l["force_N"]) for l in beams["loads"]))
    whole, nodes, fixed = solid(a.mesh, a.size, beams, young, poisson, folder)
    print(json.dumps({"frame_Nmm": frame, "solid_Nmm": whole, "ratio": frame / whole, "solid_nodes": nodes, "clamped_nodes": fixed}, indent=1))


if __name__ == "__main__":
    main()
