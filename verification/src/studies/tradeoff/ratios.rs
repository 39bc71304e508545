//! Error, work, seconds and bytes of each value of a knob, over those of its default.

use super::measured::{Measured, Point};
use super::setting::Setting;
use crate::table::Table;

/// A duration of less than a few ticks of the processor clock is meaningless.
const LEAST_SECONDS: f64 = 0.02;

/// Ratios to the base over the problems: the geometric mean, the least, the greatest.
#[derive(Clone, Copy, Debug)]
struct Ratio {
    mean: f64,
    least: f64,
    greatest: f64,
}

impl Ratio {
    fn of(ratios: &[f64]) -> Self {
        let mean = (ratios.iter().map(|x| x.ln()).sum::<f64>() / ratios.len() as f64).exp();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        Self { mean, least, greatest: ratios.iter().copied().fold(0.0, f64::max) }
    }

    fn text(&self) -> String {
        let Self { mean, least, greatest } = self;
        if mean.is_nan() {
            return "-".into();
        }
        if greatest / least < 1.02 {
            format!("×{mean:.2}")
        } else {
            format!("×{mean:.2} ({least:.2} to {greatest:.2})")
        }
    }
}

/// One value of a knob, relative to the base.
struct Value {
    name: String,
    error: Ratio,
    work: Ratio,
    seconds: Ratio,
    bytes: Ratio,
    /// Whether Newton's method stays quadratic on all problems.
    quadratic: bool,
    /// Number of problems in which it was run.
    problems: usize,
    /// The problems in which it failed.
    failed: Vec<&'static str>,
}

/// All measurements of a knob, including the base, by rising work.
fn values(all: &[Measured], knob: &str, default: &str) -> Vec<Value> {
    let mut names = vec![default];
    for measured in all {
        let turned =
            measured.points.iter().map(|point| &point.setting).chain(measured.failures.iter().map(|one| &one.0));
        for name in turned.filter_map(|setting| setting.of_knob(knob)) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    let of = |name: &str| {
        let (mut ratios, mut quadratic, mut failed) = ([const { Vec::new() }; 4], true, Vec::new());
        for measured in all {
            let matches = |setting: &Setting| setting.of_knob(knob) == Some(name);
            let base = measured.base_of(knob);
            let found =
                if name == default { base } else { measured.points.iter().find(|point| matches(&point.setting)) };
            if let (Some(Point { error, cost, .. }), Some(base)) = (found, base) {
                let pairs = [
                    (*error, base.error),
                    (cost.work, base.cost.work),
                    (cost.seconds, base.cost.seconds),
                    (cost.bytes as f64, base.cost.bytes as f64),
                ];
                ratios.iter_mut().zip(pairs).for_each(|(list, (value, base))| list.push(value / base));
                if cost.seconds.min(base.cost.seconds) < LEAST_SECONDS {
                    ratios[2].pop();
                }
                quadratic &= cost.tally.quadratic();
            }
            if measured.failures.iter().any(|(setting, _)| matches(setting)) {
                failed.push(measured.problem);
            }
        }
        let problems = ratios[0].len();
        let [error, work, seconds, bytes] = ratios.map(|ratios| Ratio::of(&ratios));
        Value { name: name.to_owned(), error, work, seconds, bytes, quadratic, problems, failed }
    };
    let mut values: Vec<Value> = names.into_iter().map(of).collect();
    values.sort_by(|a, b| a.work.mean.total_cmp(&b.work.mean));
    values
}

/// The table of a knob.
pub(super) fn table(all: &[Measured], knob: &'static str, default: &str) -> Table {
    let header = ["value", "error", "work", "CPU s", "bytes", "Newton", "problems", "fails on"];
    let mut table =
        Table::new(format!("{knob}: ratios to the default, the geometric mean (least to greatest)"), header);
    for value in values(all, knob, default) {
        let ratio = |ratio: Ratio| if value.problems > 0 { ratio.text() } else { "-".into() };
        table.push([
            shown(&value.name),
            ratio(value.error),
            ratio(value.work),
            ratio(value.seconds),
            ratio(value.bytes),
            if value.problems == 0 {
                "-"
            } else if value.quadratic {
                "quadratic"
            } else {
                "linear"
            }
            .to_owned(),
            value.problems.to_string(),
            value.failed.join(", "),
        ]);
    }
    table
}

/// A value with its rate in words.
fn shown(value: &str) -> String {
    value.replace('"', "")
}
