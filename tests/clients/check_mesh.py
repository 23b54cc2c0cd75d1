#!/usr/bin/env python3
"""Look at a triangle mesh (STL, OFF, OBJ, PLY) independently of topipe.

  python3 check_mesh.py out.stl [--reference in.stl] [--facts case.json]

needs (PyPI): numpy, scipy, trimesh, rtree.
Prints one JSON object: vertices, triangles, closed, genus, components, volume, bounding box; with --reference the two-sided
deviation and the volume error; with --facts (a case file in fixtures/) the fitted diameter, axis offset and roundness of each
known hole and, for each known flat face, the area found in its plane, measured on this mesh.
Exit status: 0 closed 2-manifold with outward orientation, 1 otherwise.
"""
import argparse, json, sys
import numpy as np, trimesh


def facts(mesh):
    e = np.sort(mesh.edges, axis=1)
    _, n = np.unique(e, axis=0, return_counts=True)
    comps = mesh.body_count
    out = {"vertices": len(mesh.vertices), "triangles": len(mesh.faces), "closed": bool((n == 2).all()),
           "boundary_edges": int((n == 1).sum()), "nonmanifold_edges": int((n > 2).sum()),
           "oriented": bool(mesh.is_winding_consistent), "components": int(comps),
           "volume_mm3": float(mesh.volume), "area_mm2": float(mesh.area), "bounds": mesh.bounds.tolist()}
    if out["closed"]:
        out["genus"] = float(comps - mesh.euler_number / 2)
    return out


def holes(mesh, case):
    rows = []
    v = mesh.vertices
    for h in case.get("holes", []):
        p, a = np.array(h["point"], float), np.array(h["axis"], float)
        a /= np.linalg.norm(a)
        r0, length = h["diameter"] / 2, h["length"]
        t = (v - p) @ a
        d = np.linalg.norm((v - p) - t[:, None] * a, axis=1)
        wall = (t > -0.01 * length) & (t < 1.01 * length) & (abs(d - r0) < 0.05 * r0)
        row = {"diameter_nominal": 2 * r0, "wall_vertices": int(wall.sum())}
        if wall.sum() >= 8:
            u = np.cross(a, [1, 0, 0] if abs(a[0]) < 0.9 else [0, 1, 0])
            u /= np.linalg.norm(u)
            w = np.cross(a, u)
            q = (v[wall] - p) - t[wall, None] * a
            x, y = q @ u, q @ w
            c = np.linalg.lstsq(np.c_[x, y, np.ones_like(x)], x * x + y * y, rcond=None)[0]
            cx, cy = c[0] / 2, c[1] / 2
            r = np.hypot(x - cx, y - cy)
            row |= {"diameter": float(2 * r.mean()), "diameter_error": float(2 * r.mean() - 2 * r0),
                    "axis_offset_mm": float(np.hypot(cx, cy)), "roundness_mm": float(r.max() - r.min())}
        rows.append(row)
    return rows


def flats(mesh, case):
    rows = []
    for f in case.get("flat_faces_measured", []):
        k = "xyz".index(f["axis"])
        n = np.zeros(3)
        n[k] = f["normal_sign"]
        facing = mesh.face_normals @ n > 0.999
        d = np.abs(mesh.triangles[:, :, k] - f["value"]).max(axis=1)
        on = facing & (d < 1e-4 * np.ptp(mesh.bounds[:, k]))
        rows.append({"plane": f"{f['axis']} = {f['value']}", "area_known_mm2": f["area"],
                     "area_kept": float(mesh.area_faces[on].sum() / f["area"]), "flatness_mm": float(d[on].max()) if on.any() else None})
    return rows


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("mesh")
    ap.add_argument("--reference")
    ap.add_argument("--facts")
    a = ap.parse_args()
    mesh = trimesh.load_mesh(a.mesh)
    mesh.merge_vertices()
    out = {"file": a.mesh, **facts(mesh)}
    if a.reference:
        ref = trimesh.load_mesh(a.reference)
        ref.merge_vertices()
        diag = float(np.linalg.norm(ref.extents))
        rng = np.random.default_rng(0)
        pick = lambda m: m.vertices[rng.choice(len(m.vertices), min(8000, len(m.vertices)), replace=False)]
        for name, pts, m in (("to_reference", pick(mesh), ref), ("from_reference", pick(ref), mesh)):
            d = trimesh.proximity.closest_point(m, pts)[1]
            out[name] = {"mean_mm": float(d.mean()), "rms_mm": float((d ** 2).mean() ** .5), "max_mm": float(d.max()),
                         "mean_rel": float(d.mean() / diag), "max_rel": float(d.max() / diag)}
        out["volume_error"] = float(mesh.volume / ref.volume - 1)
    if a.facts:
        case = json.load(open(a.facts))
        out["holes"], out["flat_faces"] = holes(mesh, case), flats(mesh, case)
    print(json.dumps(out, indent=1))
    sys.exit(0 if out["closed"] and out["oriented"] and out["volume_mm3"] > 0 else 1)


if __name__ == "__main__":
    main()
