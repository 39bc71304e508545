//! The command-line program `bfree`. All of it is compiled in the library, see [`bfree::program`].

fn main() -> std::process::ExitCode {
    bfree::program::main()
}
