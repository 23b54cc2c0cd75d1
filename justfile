# The short ways. `just` alone lists them.

_list:
    @just --list

# Everything that must hold before a change lands.
check:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets -- -D warnings
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
    cargo test --workspace

# Run one of the example pipelines: `just run bell-crank`.
run case="bracket" *options:
    cargo run --release -- run pipelines/{{case}}.toml {{options}}

# Run all example pipelines.
all *options:
    cargo build --release
    for pipeline in pipelines/*.toml; do target/release/topipe run "$pipeline" {{options}} || exit 1; done

# Bytes must not depend on the number of threads: run a case with 1, 2 and 8 and compare all artifacts.
threads case="bracket":
    cargo build --release
    for n in 1 2 8; do \
        rm -rf target/threads/$n; \
        RAYON_NUM_THREADS=$n target/release/topipe -q run pipelines/{{case}}.toml --jobs $n \
            --cache target/threads/$n/cache --out target/threads/$n/out || exit 1; \
        (cd target/threads/$n/cache && find artifacts-v1 -type f | sort) > target/threads/$n.txt; \
    done
    cmp target/threads/1.txt target/threads/2.txt && cmp target/threads/1.txt target/threads/8.txt

# Draw the pictures of the README, of pipelines/README.md and of the guide anew. The one of the report needs the packages of
# tests/clients and Chromium.
pictures python="target/clients/bin/python": gallery
    {{python}} tests/clients/check_report.py topipe-out/bracket/report.html --picture docs/src/pictures/report.png
    for stage in mesh smooth tiles quads surface; do \
        target/release/topipe -q render $stage --pipeline pipelines/bracket.toml \
            -o docs/src/pictures/$stage.png --size 720x540 || exit 1; \
    done
    target/release/topipe -q render surface --pipeline pipelines/bracket.toml --color deviation --against smooth --scale-bar \
        -o docs/src/pictures/deviation.png --size 720x540
    for stage in frame beams; do \
        target/release/topipe -q render $stage --pipeline pipelines/cantilever.toml --over smooth \
            -o docs/src/pictures/$([ $stage = frame ] && echo skeleton || echo beams).png --size 720x540 || exit 1; \
    done
    for stage in mesh smooth quads surface; do \
        target/release/topipe -q render $stage --pipeline pipelines/bracket.toml \
            -o pipelines/pictures/bracket-$stage.png --size 900x680 || exit 1; \
    done
    for case in beam-two-holes bridge bell-crank support cantilever cantilever-four y-form monster-lite; do \
        target/release/topipe -q render surface --pipeline pipelines/$case.toml \
            -o pipelines/pictures/$case.png --size 720x540 || exit 1; \
    done
    target/release/topipe -q run pipelines/filleted-block.toml
    for stage in mesh even surface; do \
        target/release/topipe -q render $stage --pipeline pipelines/filleted-block.toml --edges \
            -o docs/src/pictures/filleted-block-$stage.png --size 720x540 || exit 1; \
    done
    target/release/topipe -q render mesh --pipeline pipelines/filleted-block.toml --edges \
        -o pipelines/pictures/filleted-block-mesh.png --size 720x540
    target/release/topipe -q render surface --pipeline pipelines/filleted-block.toml \
        -o pipelines/pictures/filleted-block.png --size 720x540
    for case in cantilever cantilever-four y-form monster-lite space-frame; do \
        over=$([ $case = space-frame ] && echo mesh || echo smooth); \
        target/release/topipe -q render frame --pipeline pipelines/$case.toml --over $over \
            -o pipelines/pictures/$case-skeleton.png --size 720x540 || exit 1; \
        target/release/topipe -q render beams --pipeline pipelines/$case.toml --over $over \
            -o pipelines/pictures/$case-beams.png --size 720x540 || exit 1; \
    done

# The gallery of the guide: mesh, smoothed, quadrilaterals and CAD surface of the nine parts.
gallery: all
    mkdir -p docs/src/pictures/gallery
    for case in bracket beam-two-holes bridge bell-crank support cantilever cantilever-four y-form monster-lite; do \
        for stage in mesh smooth quads surface; do \
            target/release/topipe -q render $stage --pipeline pipelines/$case.toml \
                -o docs/src/pictures/gallery/$case-$stage.png --size 320x240 || exit 1; \
        done; \
    done

# Open all nine STEP files in OpenCASCADE and mesh their volumes with gmsh, at four sizes. monster-lite is ten times as large as the
# others. Needs the packages of tests/clients.
clients python="target/clients/bin/python": all
    for case in bracket beam-two-holes bridge bell-crank support cantilever cantilever-four y-form monster-lite; do \
        sizes=$([ $case = monster-lite ] && echo 160,80,40,20 || echo 16,8,4,2); \
        {{python}} tests/clients/check_step.py topipe-out/$case/$case.step \
            --reference topipe-out/$case/$case-smooth.stl --gmsh $sizes --volumes || exit 1; \
    done

# SIGKILL at 300 random moments, of the engine with toy stages and of the command with a whole pipeline.
kills rounds="300":
    TOPIPE_KILLS={{rounds}} cargo test -p topipe-engine --test it killed
    TOPIPE_KILLS={{rounds}} cargo test -p topipe --test command killed

# Every class of files in a cache damaged at 1,000 random places.
damage rounds="1000":
    TOPIPE_DAMAGES={{rounds}} cargo test -p topipe-engine --test it random_damage

# Generated parts through the whole CAD chain, so many.
batch parts="1000" seed="1":
    TOPIPE_BATCH={{parts}} TOPIPE_BATCH_SEED={{seed}} cargo test --release -p topipe-validation --test batch -- --nocapture

# The guide as a web site, in target/book. Needs mdBook (cargo install mdbook).
guide:
    mdbook build docs

# The remote cache in a bucket, against a server on this machine. Apart from the other tests: the feature brings an HTTP client.
s3:
    cargo test -p topipe --features s3 --test command s3::

# Feed the readers of meshes, specs and artifacts with mangled files, so many times each: 11 minutes of one processor. In the
# development profile, which is optimized and sees overflows too.
fuzz executions="10000000" seed="1":
    ulimit -v 8000000; TOPIPE_FUZZ={{executions}} TOPIPE_FUZZ_SEED={{seed}} cargo test -p topipe --test fuzz

# The same, and what leads somewhere new is added to tests/corpus.
fuzz-corpus executions="200000" seed="1":
    TOPIPE_FUZZ={{executions}} TOPIPE_FUZZ_SEED={{seed}} TOPIPE_FUZZ_KEEP=1 cargo test -p topipe --test fuzz

# Time of a run with nothing to do, beside DVC and Snakemake.
nothing-to-do:
    cargo build --release
    test -x target/peers/bin/dvc || (python3 -m venv target/peers && target/peers/bin/pip install -q dvc snakemake)
    target/peers/bin/python benchmarks/nothing_to_do.py target/release/topipe

# 100 iterations of HC and of Taubin beside trimesh, pymeshlab and VTK, at 16k and 1.05M triangles, with the memory's bandwidth.
smoothing-peers *options:
    cargo build --release -p topipe-smoothing --example bench
    test -d target/smoothing-peers || (python3 -m venv target/smoothing-peers && \
        target/smoothing-peers/bin/pip install -q trimesh scipy pymeshlab pyvista)
    target/smoothing-peers/bin/python crates/smoothing/benches/peers.py {{options}}

# Time of an elastic solution beside pyMOTO on the same grid.
stiffness-peer cells="16000":
    cargo build --release -p topipe-fem --example speed
    test -x target/pymoto/bin/python || (python3 -m venv target/pymoto && target/pymoto/bin/pip install -q pymoto==2.0.1)
    target/pymoto/bin/python benchmarks/stiffness.py target/release/examples/speed --cells {{cells}}

# Marching sections beside CGAL's mean curvature flow. Needs libcgal-dev, libeigen3-dev and g++.
skeleton-peers *options:
    cargo build --release -p topipe-skeleton --example skeletonize
    test -d target/skeleton-peers || (python3 -m venv target/skeleton-peers && \
        target/skeleton-peers/bin/pip install -q numpy scipy trimesh networkx)
    target/skeleton-peers/bin/python crates/skeleton/benches/peers.py {{options}}

# How time and memory grow with the number of triangles: the bracket smoothed, divided and roughened again.
scale sizes="30000 100000 300000 1000000":
    cargo build --release
    cargo build --release -p topipe-smoothing --example finer
    for n in {{sizes}}; do \
        target/release/examples/finer fixtures/bracket/bracket $n target/scale/bracket-$n || exit 1; \
        sed -e "s|../fixtures/bracket/bracket|../target/scale/bracket-$n|" -e 's|^units = .*|&\nallow_self_intersection = true|' \
            pipelines/bracket.toml > target/scale-$n.toml; \
        /usr/bin/time -f "$n triangles: %e s, %U s of processors, %M kB" target/release/topipe -q run target/scale-$n.toml \
            --cache target/scale/cache --out target/scale/out-$n || exit 1; \
    done

# How much of a fit is made again after edits of the nine examples.
edits *parts:
    cargo build --release
    python3 pipelines/studies/edits.py target/release/topipe {{parts}}

# The same after holes are drilled and bodies are joined to them; needs manifold3d and trimesh of PyPI.
booleans *parts:
    cargo build --release
    python3 pipelines/studies/booleans.py target/release/topipe {{parts}}

# Times of elastic solutions and of an optimization: a million cells, full and of bars in void; the whole cantilever.
stiffness-speed:
    cargo build --release -p topipe
    cargo build --release -p topipe-fem --example speed
    target/release/examples/speed 1000000
    target/release/examples/speed 1000000 1e6 9
    rm -rf target/stiffness-speed
    time target/release/topipe run pipelines/optimization/cantilever.toml --until part \
        --cache target/stiffness-speed/cache --out target/stiffness-speed/out
