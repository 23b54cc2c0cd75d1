#!/usr/bin/env python3
"""Solve a part under a load case with CalculiX.

  python3 check_stiffness.py PART CASE [--size MM] [--work DIR]

PART is a STEP solid, or a closed triangle mesh (STL). CASE is a JSON file with young, poisson, supports and loads as in the
`stiffness` stage (regions box and cylinder; loads of one case only). gmsh fills the part with quadratic tetrahedra (C3D10);
nodes of the surface in the regions of supports are fixed; loads are spread over the surface triangles in their regions with the
nodal forces that belong to a constant traction.
Needs ccx (Debian: calculix-ccx) on the path, gmsh and numpy (PyPI).
Prints one JSON object: compliance in N mm (the work of the loads), volume, number of nodes.
"""
import argparse, json, os, subprocess, tempfile
import numpy as np


def mesh(part, size):
    """Node numbers and places, tetrahedra (10 nodes) and surface triangles (6 nodes)."""
    import gmsh
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if part.endswith((".step", ".stp")):
        gmsh.model.occ.importShapes(part)
        gmsh.model.occ.synchronize()
    else:
        gmsh.open(part)
        gmsh.model.mesh.createTopology()
        surfaces = [s[1] for s in gmsh.model.getEntities(2)]
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
        gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size / 4)
    gmsh.model.mesh.generate(3)
    # Straight edges: curved ones can turn an element over where patches are small.
    gmsh.option.setNumber("Mesh.SecondOrderLinear", 1)
    gmsh.model.mesh.setOrder(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()

    def elements(dim, kind, nodes):
        types, _, lists = gmsh.model.mesh.getElements(dim)
        found = [l.reshape(-1, nodes) for t, l in zip(types, lists) if t == kind]
        return np.concatenate(found).astype(int)

    tets, triangles = elements(3, 11, 10), elements(2, 9, 6)
    gmsh.finalize()
    tets = tets[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]  # gmsh and CalculiX number the last two middles the other way round
    place = np.zeros((int(tags.max()) + 1, 3))
    place[tags.astype(int)] = xyz.reshape(-1, 3)
    return place, tets, triangles


def selector(region, slack):
    if region["type"] == "box":
        low, high = np.array(region["min"]) - slack, np.array(region["max"]) + slack
        return lambda p: ((p >= low) & (p <= high)).all(axis=1)
    axis = np.array(region["axis"], float)
    axis /= np.linalg.norm(axis)
    point = np.array(region["point"], float)

    def inside(p):
        along = (p - point) @ axis
        off = np.linalg.norm(p - point - np.outer(along, axis), axis=1)
        return (along >= -slack) & (along <= region["length"] + slack) & (off <= region["diameter"] / 2 + slack)

    return inside


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("part")
    ap.add_argument("case")
    ap.add_argument("--size", type=float, default=3.0)
    ap.add_argument("--work")
    a = ap.parse_args()
    folder = a.work or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    case = json.load(open(a.case))
    for factor in (1.0, 0.8, 1.25, 0.64):
        try:
            place, tets, triangles = mesh(a.part, factor * a.size)
            break
        except Exception as error:  # gmsh may fail on a surface mesh of one size and not of another
            problem = error
            import gmsh
            gmsh.finalize()
    else:
        raise SystemExit(f"gmsh fills the part at none of four sizes: {problem}")
    used = np.unique(tets)
    slack = 0.02 * a.size
    corners = place[triangles[:, :3]]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    middles = corners.mean(axis=1)
    # The area of a triangle that lies in a region by its middle; normals point out of the part.
    outward = 1.0 if (middles * vectors).sum() > 0 else -1.0
    surface = np.unique(triangles)
    fixed = {}
    for support in case["supports"]:
        inside = surface[selector(support["region"], slack)(place[surface])]
        for d, held in enumerate(support.get("directions", [True] * 3)):
            if held:
                fixed.setdefault(d, set()).update(inside.tolist())
    force = np.zeros_like(place)
    for load in case["loads"]:
        chosen = selector(load["region"], slack)(middles)
        area = np.linalg.norm(vectors[chosen], axis=1)
        if "force" in load:
            traction = np.outer(area / area.sum(), load["force"])
        else:
            traction = -load["pressure"] * outward * vectors[chosen]
        # A constant traction on a quadratic triangle acts on its middle nodes alone.
        for k in range(3, 6):
            np.add.at(force, triangles[chosen, k], traction / 3)
    loaded = np.flatnonzero(np.abs(force).max(axis=1))
    with open(os.path.join(folder, "solid.inp"), "w") as f:
        f.write("*NODE, NSET=NALL\n")
        for i in used:
            # ccx reads numbers of 20 characters.
            f.write(f"{i}, {place[i, 0]:.12g}, {place[i, 1]:.12g}, {place[i, 2]:.12g}\n")
        f.write("*ELEMENT, TYPE=C3D10, ELSET=EALL\n")
        for k, t in enumerate(tets):
            f.write(f"{k + 1}, " + ", ".join(map(str, t)) + "\n")
        f.write(f"*MATERIAL, NAME=M\n*ELASTIC\n{case['young']}, {case['poisson']}\n*SOLID SECTION, ELSET=EALL, MATERIAL=M\n")
        f.write("*NSET, NSET=LOAD\n" + ",\n".join(map(str, loaded)) + "\n*BOUNDARY\n")
        for d, nodes in fixed.items():
            for i in sorted(nodes):
                f.write(f"{i}, {d + 1}, {d + 1}\n")
        f.write("*STEP\n*STATIC\n*CLOAD\n")
        for i in loaded:
            for d in range(3):
                if force[i, d]:
                    f.write(f"{i}, {d + 1}, {force[i, d]:.12g}\n")
        f.write("*NODE PRINT, NSET=LOAD\nU\n*END STEP\n")
    env = {**os.environ, "OMP_NUM_THREADS": "2"}
    run = subprocess.run(["ccx", "solid"], cwd=folder, capture_output=True, text=True, env=env)
    dat = os.path.join(folder, "solid.dat")
    if run.returncode or not os.path.exists(dat) or not os.path.getsize(dat):
        raise SystemExit("ccx failed:\n" + run.stdout[-2000:])
    compliance = 0.0
    for line in open(dat):
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            compliance += float(np.array([float(w) for w in words[1:]]) @ force[int(words[0])])
    p = place[tets[:, :4]]
    volume = np.abs(np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0])).sum() / 6
    print(json.dumps({
        "compliance_Nmm": compliance,
        "volume_mm3": float(volume),
        "nodes": int(len(used)),
        "fixed_nodes": int(len(set().union(*fixed.values()))),
        "force_N": force.sum(axis=0).tolist(),
    }, indent=1))


if __name__ == "__main__":
    main()
