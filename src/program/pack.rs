//! `bfree pack`: the snapshots of a run in one file.

use super::failure::{Failure, print};
use super::provenance::Provenance;
use crate::output;
use std::path::{Path, PathBuf};

/// Packs the snapshots in the directory of a run, and prints the files written.
pub(crate) fn pack(directory: &Path) -> Result<(), Failure> {
    let bodies = Provenance::read(directory).map_or_else(|_| Vec::new(), |made| made.bodies);
    let written = output::pack(directory, &bodies).map_err(Failure::run)?;
    let line = |(path, [count, missing]): &(PathBuf, [usize; 2])| {
        let without =
            if *missing == 0 { String::new() } else { format!("; {missing} of the run are not there any more") };
        format!("{}  {count} snapshots{without}", path.display())
    };
    let lines = written.iter().map(line);
    print(lines.collect::<Vec<_>>().join("\n"))
}
