//! The `topipe` command; see the library for what it does.

/// See the workspace's `Cargo.toml` for what it is good for.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    topipe::main()
}
