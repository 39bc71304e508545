//! `bfree pack`: the snapshots of a run in one file.

use super::failure::{Failure, print};
use super::provenance::Provenance;
use crate::output;
use std::path::Path;

/// Packs the snapshots in the directory of a run, and prints the files written.
pub(crate) fn pack(directory: &Path) -> Result<(), Failure> {
    let bodies = Provenance::read(directory).map_or_else(|_| Vec::new(), |made| made.bodies);
    let written = output::pack(directory, &bodies).map_err(Failure::run)?;
    let lines = written.iter().map(|(path, count)| format!("{}  {count} snapshots", path.display()));
    print(lines.collect::<Vec<_>>().join("\n"))
}
