//! What the tests of whole runs share.

use bfree::scene;
use bfree::simulation::Simulation;
use std::path::Path;

pub type Failure = Box<dyn std::error::Error>;

/// A shipped scene, with `KEY.PATH=JSON` overrides.
pub fn scene<const D: usize>(name: &str, overrides: &[&str]) -> Result<Simulation<D>, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let overrides = overrides.iter().map(|text| text.parse()).collect::<Result<Vec<scene::Override>, _>>()?;
    Ok(scene::read_file(&folder.join(name), &overrides)?.build(&folder)?)
}

/// The rows of a reference table, without its header.
pub fn rows(text: &str) -> impl Iterator<Item = Vec<f64>> + '_ {
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect())
}
