//! The entries of `report.json` that pictures show.

use super::error::PlotError;
use crate::mechanics::schemes::Parameters;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// The report of a run that has ended.
pub(super) fn read(directory: &Path) -> Result<Option<Value>, PlotError> {
    let path = directory.join("report.json");
    match std::fs::read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|source| PlotError::Report { path, source }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(PlotError::Read { path, source }),
    }
}

/// The title of a run's scene.
pub(super) fn title(report: Option<&Value>) -> String {
    report.and_then(|report| report["settings"]["title"].as_str()).unwrap_or_default().to_owned()
}

/// Whether bodies had inertia according to the report; `true` if the report does not say.
pub(super) fn has_inertia(report: Option<&Value>) -> bool {
    let scheme = report.map(|report| Parameters::deserialize(&report["settings"]["time"]["scheme"]));
    scheme.and_then(Result::ok).is_none_or(|scheme| scheme.has_inertia())
}

/// The quantity of a panel of probes or reactions. Panels of the same quantity have the same scale.
pub(super) fn quantity(report: Option<&Value>, table: &str, panel: &str) -> String {
    if table == "reactions" {
        return if panel.ends_with("_torque") { "torque" } else { "force" }.to_owned();
    }
    let probes = report.and_then(|report| report["settings"]["output"]["probes"].as_array());
    let probe = probes.into_iter().flatten().find(|probe| probe["name"] == panel);
    // An unknown probe has its own scale.
    probe.and_then(|probe| probe["field"].as_str()).unwrap_or(panel).to_owned()
}
