//! A program that is a child process for material laws and nothing else.

use std::process::ExitCode;

fn main() -> ExitCode {
    #[cfg(unix)]
    if let Some(code) = tangent_check::library::child::serve_if_asked() {
        return code;
    }
    eprintln!("This program calls material laws for another program. It has no use of its own.");
    ExitCode::FAILURE
}
