//! The entries of `report.json` that pictures show.

use crate::mechanics::schemes::Parameters;
use crate::output::OutputError;
use crate::output::files::read_if_there;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// The report of a run that has ended; null for a run that goes on or was killed.
pub(super) fn read(directory: &Path) -> Result<Value, OutputError> {
    let path = directory.join("report.json");
    let wrong = |source| OutputError::content(&path, format!("is no report written by bfree: {source}"));
    read_if_there(&path)?.map_or(Ok(Value::Null), |bytes| serde_json::from_slice(&bytes).map_err(wrong))
}

/// The title of a run's scene.
pub(super) fn title(report: &Value) -> &str {
    report["settings"]["title"].as_str().unwrap_or_default()
}

/// Whether bodies had inertia according to the report; `true` if the report does not say.
pub(super) fn has_inertia(report: &Value) -> bool {
    Parameters::deserialize(&report["settings"]["time"]["scheme"]).map_or(true, |scheme| scheme.has_inertia())
}

/// The quantity of a panel of probes or forces. Panels of the same quantity have the same scale.
pub(super) fn quantity(report: &Value, table: &str, panel: &str) -> String {
    if table != "probes" {
        return if panel.ends_with("_torque") { "torque" } else { "force" }.to_owned();
    }
    let probes = report["settings"]["output"]["probes"].as_array();
    let probe = probes.into_iter().flatten().find(|probe| probe["name"] == panel);
    // An unknown probe has its own scale.
    probe.and_then(|probe| probe["field"].as_str()).unwrap_or(panel).to_owned()
}
