//! Residuals of Newton's method: a sample of all steps, and the step with the most iterations.

use super::axes::rounded;
use super::chart::{self, Heading, Line, Panel};
use super::palette;
use super::picture::{Color, Picture};
use crate::output::OutputError;
use crate::output::files::read_if_there;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// Number of steps drawn besides the step with the most iterations.
const SAMPLE: usize = 60;

/// The part of a step's line that is drawn. Residuals that are not finite are strings.
#[derive(Deserialize)]
struct Step {
    time: f64,
    newton_residuals: Vec<Value>,
}

/// log₁₀ |R| / |R₀| by iteration.
fn fall(step: &Step) -> Vec<(f64, f64)> {
    let residuals: Vec<f64> = step.newton_residuals.iter().filter_map(Value::as_f64).collect();
    let first = residuals.first().copied().unwrap_or(1.0);
    let ratio = residuals.iter().enumerate().map(|(k, r)| (k as f64, (r / first).log10()));
    ratio.filter(|point| point.1.is_finite()).collect()
}

/// The norms of several solutions against the iterations, as a picture.
pub(crate) fn newton_norms(title: &str, solutions: &[(&str, &[f64])]) -> Picture {
    use palette::{BLACK, BLUE, GREEN, PURPLE, SKY, VERMILLION};
    let colors = [BLUE, VERMILLION, GREEN, PURPLE, SKY, BLACK].iter().cycle();
    let line = |((name, norms), color): (&(&str, &[f64]), &Color)| {
        let points = norms.iter().enumerate().map(|(k, norm)| (k as f64, norm.log10()));
        Line::new(name, *color, points.filter(|point| point.1.is_finite()).collect())
    };
    let lines = solutions.iter().zip(colors).map(line).collect();
    let panel = Panel { x: ("Newton iteration", true), ..Panel::over_time("log₁₀ |R|", lines) };
    chart::draw(&Heading { what: title.to_owned(), run: String::new() }, super::HEIGHT, &[panel])
}

/// The panel; `None` where no step was taken.
pub(super) fn panel(report: &Value, directory: &Path) -> Result<Option<Panel>, OutputError> {
    let steps: Vec<Step> = match report["steps"].as_array() {
        Some(steps) => steps.iter().filter_map(|step| Step::deserialize(step).ok()).collect(),
        None => {
            // A run that goes on or was killed. Its last line may be incomplete.
            let log = read_if_there(&directory.join("newton.jsonl"))?.unwrap_or_default();
            log.split(|&byte| byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok()).collect()
        }
    };
    // The first of several steps with the most iterations.
    let Some(worst) = steps.iter().rev().max_by_key(|step| step.newton_residuals.len()) else { return Ok(None) };
    let stride = steps.len().div_ceil(SAMPLE).max(1);
    let sample = steps.iter().step_by(stride).map(|step| Line::new("", palette::SKY, fall(step)));
    let mut lines: Vec<Line> = sample.collect();
    if let Some(first) = lines.first_mut() {
        first.label = if stride > 1 { format!("one step in {stride}") } else { "all steps".to_owned() };
    }
    let label = format!("t = {}: the most iterations", rounded(worst.time));
    lines.push(Line::new(&label, palette::VERMILLION, fall(worst)));
    let panel = Panel::over_time("log₁₀ |R| / |R₀|", lines);
    Ok(Some(Panel { x: ("Newton iteration", true), ..panel }))
}
