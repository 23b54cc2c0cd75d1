"""Opens exported meshes with PyVista (VTK), trimesh (glTF, 3MF) and gmsh (decks) and prints what was found as JSON.

    python check_formats.py smooth tiles.vtp quads.vtp surface.glb

The first argument is the stem of one mesh in all formats.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pyvista
import trimesh


def of_vtk(path):
    mesh = pyvista.read(path)
    found = {"triangles": int(mesh.n_cells), "volume_mm3": float(mesh.triangulate().volume)}
    if "frozen" in mesh.point_data:
        found["frozen"] = int(mesh.point_data["frozen"].sum())
    if "region" in mesh.cell_data:
        found["regions"] = int(mesh.cell_data["region"].max() + 1)
    for name in ("tile", "quad"):
        if name in mesh.cell_data:
            values = np.unique(mesh.cell_data[name])
            found[name] = int((values >= 0).sum())
    return found


def of_trimesh(path, to_mm):
    scene = trimesh.load(path, force="scene")
    mesh = scene.to_geometry()
    return {"triangles": len(mesh.faces), "volume_mm3": float(mesh.volume) * to_mm**3}


def of_deck(path):
    """Read by hand: what CalculiX reads is so little that a reader of it is shorter than the call of one."""
    points, triangles, sets, block, name = {}, [], {}, "", ""
    for line in Path(path).read_text().splitlines():
        if line.startswith("*"):
            words = [w.strip() for w in line.split(",")]
            block = words[0]
            name = words[-1].split("=")[-1]
            continue
        fields = [f for f in line.split(",") if f.strip()]
        if block == "*NODE":
            points[int(fields[0])] = [float(x) for x in fields[1:]]
        elif block == "*ELEMENT":
            triangles.append([int(x) for x in fields[1:]])
        elif block in ("*NSET", "*ELSET"):
            sets.setdefault(name, []).extend(int(x) for x in fields)
    corners = np.array([[points[v] for v in t] for t in triangles])
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    return {
        "triangles": len(triangles),
        "volume_mm3": float(volume),
        "frozen": len(sets.get("FROZEN", [])),
        "sets": {name: len(members) for name, members in sets.items()},
    }


stem, *others = sys.argv[1:]
found = {}
for ending in ("vtp", "vtk"):
    found[f"{stem}.{ending}"] = of_vtk(f"{stem}.{ending}")
found[f"{stem}.glb"] = of_trimesh(f"{stem}.glb", 1000.0)
found[f"{stem}.3mf"] = of_trimesh(f"{stem}.3mf", 1.0)
found[f"{stem}.inp"] = of_deck(f"{stem}.inp")
for other in others:
    found[other] = of_trimesh(other, 1000.0) if other.endswith(".glb") else of_vtk(other)
print(json.dumps(found, indent=1))
