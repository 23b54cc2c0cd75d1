"""How long a run with nothing to do takes: topipe beside DVC and Snakemake on the same graph.

    python3 -m venv target/peers && target/peers/bin/pip install dvc snakemake
    target/peers/bin/python benchmarks/nothing_to_do.py target/release/topipe [STAGES ...]

The graph: one source, then chains of nine stages each. In topipe the stages smooth a small box with no iterations; in DVC
and Snakemake they copy a file. Each is run until everything is done and then five times more; the median of those
counts. Everything happens in a temporary folder.
"""

import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

BOX = """OFF
8 6 0
0 0 0
3 0 0
3 2 0
0 2 0
0 0 1
3 0 1
3 2 1
0 2 1
4 0 3 2 1
4 4 5 6 7
4 0 1 5 4
4 1 2 6 5
4 2 3 7 6
4 3 0 4 7
"""
CHAIN = 9


def graph(stages):
    """(name, input) of each stage but the source."""
    edges = []
    for k in range(stages - 1):
        edges.append((f"s{k}", "source" if k % CHAIN == 0 else f"s{k - 1}"))
    return edges


def topipe_files(folder, stages):
    (folder / "box.off").write_text(BOX)
    text = '[stage.source]\nkind = "import"\npath = "box.off"\n'
    for k, (name, source) in enumerate(graph(stages)):
        # Different parameters, so that no two stages are the same.
        text += f'[stage.{name}]\nkind = "smoothing"\ninput = "{source}"\niterations = 0\n'
        text += f"alpha = {0.1 + k / 10000}\n"
    last = graph(stages)[-1][0] if stages > 1 else "source"
    text += f'[export]\n"last.stl" = "{last}"\n'
    (folder / "p.toml").write_text(text)


def dvc_files(folder, stages):
    (folder / "source").write_text("data\n")
    text = "stages:\n"
    for name, source in graph(stages):
        text += f"  {name}:\n    cmd: cp {source} {name}\n    deps: [{source}]\n    outs: [{name}]\n"
    (folder / "dvc.yaml").write_text(text)


def snakemake_files(folder, stages):
    (folder / "source").write_text("data\n")
    edges = graph(stages)
    ends = [name for k, (name, _) in enumerate(edges) if k % CHAIN == CHAIN - 1 or k == len(edges) - 1]
    text = "rule all:\n    input: " + ", ".join(f'"{name}"' for name in ends) + "\n"
    for name, source in edges:
        text += f'rule {name}:\n    input: "{source}"\n    output: "{name}"\n    shell: "cp {{input}} {{output}}"\n'
    (folder / "Snakefile").write_text(text)


def measure(folder, command, prepare=()):
    for step in prepare:
        subprocess.run(step, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    times = []
    for _ in range(6):
        start = time.perf_counter()
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        times.append(time.perf_counter() - start)
    # The first one hashes again what was just written.
    return statistics.median(times[1:])


def main():
    topipe = pathlib.Path(sys.argv[1]).resolve()
    counts = [int(text) for text in sys.argv[2:]] or [10, 1000]
    tools = pathlib.Path(sys.executable).parent
    for stages in counts:
        results = {}
        with tempfile.TemporaryDirectory() as root:
            root = pathlib.Path(root)
            peers = {
                "topipe": (topipe_files, [topipe, "run", "p.toml"], ()),
                "dvc": (
                    dvc_files,
                    [tools / "dvc", "repro", "-q"],
                    ([tools / "dvc", "init", "--no-scm", "-q"],),
                ),
                "snakemake": (snakemake_files, [tools / "snakemake", "-c2", "-q", "all"], ()),
            }
            for name, (files, command, prepare) in peers.items():
                if name != "topipe" and not shutil.which(command[0]):
                    print(f"{name} is not installed beside {sys.executable}", file=sys.stderr)
                    continue
                folder = root / name
                folder.mkdir()
                files(folder, stages)
                results[name] = measure(folder, command, prepare)
        base = results["topipe"]
        for name, seconds in results.items():
            print(f"{stages:5} stages  {name:10} {seconds * 1e3:10.1f} ms  {seconds / base:8.1f} x")


if __name__ == "__main__":
    main()
