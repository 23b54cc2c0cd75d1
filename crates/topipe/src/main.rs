//! The `topipe` command; see the library for what it does.

fn main() -> std::process::ExitCode {
    topipe::main()
}
