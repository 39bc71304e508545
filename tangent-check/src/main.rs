//! The program `tangent-check`. It calls the law in a child process, which is this program, too.

use std::process::ExitCode;

#[cfg(unix)]
fn main() -> ExitCode {
    use tangent_check::library::child::{Host, serve_if_asked};
    if let Some(code) = serve_if_asked() {
        return code;
    }
    match Host::this_program() {
        Ok(host) => ExitCode::from(tangent_check::program::run("tangent-check", std::env::args_os().skip(1), host)),
        Err(error) => {
            eprintln!("error: the system does not tell where this program is: {error}.");
            ExitCode::from(2)
        }
    }
}

#[cfg(not(unix))]
fn main() -> ExitCode {
    eprintln!("error: this program loads laws on Linux and macOS only.");
    ExitCode::from(2)
}
