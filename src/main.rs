//! The binary: all of it is in [`offbd::cli`].

fn main() -> std::process::ExitCode {
    offbd::cli::main()
}
