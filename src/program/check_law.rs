//! `bfree check-law`: the program `tangent-check` as a command.

use super::failure::Failure;
use clap::Args;
use std::ffi::OsString;
use tangent_check::library::child::Host;

/// `bfree check-law`.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub(super) struct CheckLaw {
    /// The files and options of `tangent-check`; --help lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "FILE…|OPTIONS")]
    arguments: Vec<OsString>,
}

impl CheckLaw {
    /// Checks the law and writes the reports.
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let host = Host::this_program().map_err(Failure::scene)?;
        match tangent_check::program::run("bfree check-law", self.arguments, host) {
            0 => Ok(()),
            code => Err(Failure::Told(code)),
        }
    }
}
