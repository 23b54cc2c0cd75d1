#!/usr/bin/env python3
"""Centeredness of a curve skeleton, measured independently of topipe (the thesis on skeletonization of beam-like
topology optimization results, eq. 2.2 and section 4.4).

  python3 check_skeleton.py skeleton.json mesh.off [--labels mesh.labels.csv | --cube SIDE_MM] [--axes truth.json]

needs (PyPI): numpy, scipy, trimesh, rtree, networkx.
skeleton.json: {"points": [[x, y, z], ...] in mm, "edges": [[i, j], ...], "kinds": ["branch" | "junction" | "interface" | "end" | "non-design", ...]}
(kinds may be absent: then points of degree 2 are branch points). Other keys are ignored.
The section is clipped to a cube: with --labels (one 0/1 per face of the mesh, in its order) of twice the largest distance from
an interface's points to its centre, as the thesis has it; with --cube of that side; else not at all.
The first of the 36 rays, which the thesis leaves open, and the cube turn with the part: see first_ray.
Points of kind "non-design" and their edges count for cycles and components only.
Prints: compactness (branch points), e_center, the same with arc-length weights, points outside, components, cycles,
genus of the mesh, length; with --axes ({"nodes": ..., "beams": [[i, j, radius], ...]}) the distance to the true axes.
"""
import argparse, json
import numpy as np, trimesh, networkx as nx


def first_ray(mesh, point, tangent, u, w):
    """Angle in (u, w) of a principal axis of the nearest contour's area about the point; of its farthest corner if all are principal."""
    cut = mesh.section(plane_origin=point, plane_normal=tangent)
    loops = [np.stack([(c - point) @ u, (c - point) @ w], axis=1) for c in cut.discrete]

    def distance(loop):
        a, d = loop[:-1], np.diff(loop, axis=0)
        t = np.clip(-(a * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300), 0, 1)
        return np.linalg.norm(a + t[:, None] * d, axis=1).min()

    loop = min(loops, key=distance)
    (ax, ay), (bx, by) = loop[:-1].T, loop[1:].T
    area = ax * by - ay * bx
    xx, yy = (area * (ax * ax + ax * bx + bx * bx)).sum(), (area * (ay * ay + ay * by + by * by)).sum()
    xy = (area * (ax * ay + (ax * by + ay * bx) / 2 + bx * by)).sum()
    if np.hypot(xx - yy, 2 * xy) > 1e-9 * abs(xx + yy):
        return np.arctan2(2 * xy, xx - yy) / 2
    far = loop[np.argmax((loop * loop).sum(axis=1))]
    return np.arctan2(far[1], far[0])


def rays(mesh, points, tangents, inside, cube):
    ref = np.where(np.abs(tangents[:, :1]) < .9, [[1., 0, 0]], [[0, 1., 0]])
    u = np.cross(tangents, ref)
    u /= np.linalg.norm(u, axis=1)[:, None]
    w = np.cross(tangents, u)
    first = np.array([first_ray(mesh, *at) for at in zip(points, tangents, u, w)])
    th = np.arange(36) * np.pi / 18
    at = (first[:, None] + th)[:, :, None]
    D = (np.cos(at) * u[:, None] + np.sin(at) * w[:, None]).reshape(-1, 3)
    O = np.repeat(points, 36, axis=0)
    d = np.zeros(len(O))
    loc, ir, _ = mesh.ray.intersects_location(O, D, multiple_hits=False)
    d[ir] = np.linalg.norm(loc - O[ir], axis=1)
    out = np.where(~inside)[0]
    if len(out):  # a point outside: the far hit counts, a miss is 0
        idx = (out[:, None] * 36 + np.arange(36)).ravel()
        d[idx] = 0
        loc, ir, _ = mesh.ray.intersects_location(O[idx], D[idx], multiple_hits=True)
        far = np.zeros(len(idx))
        np.maximum.at(far, ir, np.linalg.norm(loc - O[idx][ir], axis=1))
        d[idx] = far
    if cube:  # the section is clipped to a cube around a point inside, along the branch and the first ray
        limit = cube / 2 / np.maximum(np.abs(np.cos(th)), np.abs(np.sin(th)))
        d = np.where(np.repeat(inside, 36), np.minimum(d, np.tile(limit, len(points))), d)
    return d.reshape(-1, 36)


def interface_cube(mesh, labels):
    pairs, edges = mesh.face_adjacency, mesh.face_adjacency_edges
    cut = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    G = nx.Graph()
    G.add_edges_from(map(tuple, edges[cut]))
    radii = [np.linalg.norm(mesh.vertices[list(c)] - mesh.vertices[list(c)].mean(axis=0), axis=1).max() for c in nx.connected_components(G)]
    return 2 * max(radii) if radii else 0.0


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("skeleton")
    ap.add_argument("mesh")
    ap.add_argument("--cube", type=float, default=0.0)
    ap.add_argument("--labels")
    ap.add_argument("--axes")
    a = ap.parse_args()
    s = json.load(open(a.skeleton))
    mesh = trimesh.load_mesh(a.mesh)
    mesh.merge_vertices()
    P = np.array(s["points"], float)
    G = nx.Graph()
    G.add_nodes_from(range(len(P)))
    G.add_edges_from((i, j) for i, j in s["edges"] if i != j)
    deg = np.array([G.degree(i) for i in range(len(P))])
    kinds = s.get("kinds") or ["branch" if k == 2 else "other" for k in deg]
    sel = [i for i in range(len(P)) if kinds[i] == "branch" and deg[i] == 2]
    r = trimesh.nsphere.minimum_nsphere(mesh.convex_hull.vertices)[1]
    if a.labels:
        labels = np.loadtxt(a.labels, dtype=int, delimiter=",", ndmin=1)
        if len(labels) != len(mesh.faces):
            raise SystemExit(f"{a.labels} has {len(labels)} labels, the mesh {len(mesh.faces)} faces")
        a.cube = interface_cube(mesh, labels)
    if not sel:
        print(json.dumps({"compactness": 0, "error": "no branch points of degree 2"}))
        raise SystemExit(1)
    T, L = [], []
    for i in sel:
        p, q = list(G.neighbors(i))
        T.append(P[q] - P[p])
        L.append((np.linalg.norm(P[q] - P[i]) + np.linalg.norm(P[p] - P[i])) / 2)
    T = np.array(T).reshape(-1, 3)
    T /= np.linalg.norm(T, axis=1)[:, None]
    inside = mesh.contains(P[sel])
    d = rays(mesh, P[sel], T, inside, a.cube)
    off = np.abs(d[:, :18] - d[:, 18:]).max(axis=1)
    comps = nx.number_connected_components(G)
    out = {"compactness": len(sel), "e_center": float(off.mean() / r), "e_center_by_length": float(np.average(off, weights=L) / r),
           "e_center_max": float(off.max() / r), "out_of_object": int((~mesh.contains(P[[k != "non-design" for k in kinds]])).sum()), "cube_mm": a.cube, "components": comps,
           "cycles": G.number_of_edges() - G.number_of_nodes() + comps, "mesh_genus": float(mesh.body_count - mesh.euler_number / 2),
           "junctions": int((deg > 2).sum()), "free_ends": int((deg == 1).sum()), "bounding_sphere_radius_mm": float(r),
           "length_mm": float(sum(np.linalg.norm(P[i] - P[j]) for i, j in G.edges))}
    if a.axes:
        t = json.load(open(a.axes))
        N, e = np.array(t["nodes"]), np.full(len(P), 1e9)
        for i, j, _ in t["beams"]:
            ab = N[j] - N[i]
            k = np.clip(((P - N[i]) @ ab) / (ab @ ab), 0, 1)
            e = np.minimum(e, np.linalg.norm(P - N[i] - k[:, None] * ab, axis=1))
        near = t.get("exclude_mm") or [2 * max(r for u, v, r in t["beams"] if j in (u, v)) for j in range(len(N))]
        far = np.array([all(np.linalg.norm(P[i] - N[j]) > near[j] for j in range(len(N))) for i in sel])
        for name, pick in (("all", e[sel]), ("away_from_nodes", e[sel][far])):
            if len(pick):
                out[f"axis_{name}"] = {"points": len(pick), "rms_mm": float((pick ** 2).mean() ** .5), "max_mm": float(pick.max())}
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
