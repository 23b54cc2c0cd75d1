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
