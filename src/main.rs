//! The binary `offbd`; its code is in [`offbd::cli`].

fn main() -> std::process::ExitCode {
    offbd::cli::main()
}
