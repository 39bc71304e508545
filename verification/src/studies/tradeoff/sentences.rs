//! Sentences from the measured numbers: the cost of each knob, its gain, and the limit of that gain.

use super::measured::{Measured, Point};
use super::setting::Setting;
use crate::table::Table;

/// An error ratio above this does not pay.
const PAYS: f64 = 0.95;

/// A work ratio below this is cheaper.
const CHEAPER: f64 = 0.9;

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
        if greatest / least < 1.02 { format!("×{mean:.2}") } else { format!("×{mean:.2} ({least:.2} to {greatest:.2})") }
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
        let turned = measured.points.iter().map(|point| &point.setting).chain(measured.failures.iter().map(|one| &one.0));
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
            let found = if name == default { base } else { measured.points.iter().find(|point| matches(&point.setting)) };
            if let (Some(Point { error, work, cost, .. }), Some(base)) = (found, base) {
                let pairs = [
                    (*error, base.error),
                    (*work, base.work),
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
    let mut table = Table::new(format!("{knob}: ratios to the default, the geometric mean (least to greatest)"), header);
    for value in values(all, knob, default) {
        let ratio = |ratio: Ratio| if value.problems > 0 { ratio.text() } else { "-".into() };
        table.push([
            shown(&value.name),
            ratio(value.error),
            ratio(value.work),
            ratio(value.seconds),
            ratio(value.bytes),
            if value.problems == 0 { "-" } else if value.quadratic { "quadratic" } else { "linear" }.to_owned(),
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

/// The values that cost less than the default on every problem, with an error equal within a percent and with Newton's method quadratic.
pub(super) fn cheaper_at_equal_error(all: &[Measured], knobs: &[(&'static str, String)]) -> String {
    let mut found = Vec::new();
    for (knob, default) in knobs {
        for value in values(all, knob, default) {
            let equal = value.error.least > 0.99 && value.error.greatest < 1.01;
            if value.name != *default && value.quadratic && value.problems == all.len() && equal && value.work.greatest < CHEAPER {
                found.push(format!("{knob} = {} (work {})", shown(&value.name), value.work.text()));
            }
        }
    }
    match found.is_empty() {
        true => "No value of a knob has the same error on every problem for less work than the default.".to_owned(),
        false => format!("The same error on every problem for less work than the default: {}.", found.join("; ")),
    }
}

/// The sentence of a knob.
pub(super) fn sentence(all: &[Measured], knob: &str, default: &str) -> String {
    let mut values = values(all, knob, default);
    let mut failures = String::new();
    for value in values.iter().filter(|value| !value.failed.is_empty()) {
        failures += &format!(" {} fails on {}.", shown(&value.name), value.failed.join(", "));
    }
    values.retain(|value| value.problems > 0);
    let (Some(cheapest), Some(default_value)) = (values.first(), values.iter().find(|value| value.name == default)) else {
        return format!("`{knob}`: nothing was measured.{failures}");
    };
    if values.len() == 1 {
        return format!("`{knob}`: at this effort only the default, {}, was run.{failures}", shown(default));
    }
    let Some(best) = values.iter().min_by(|a, b| a.error.mean.total_cmp(&b.error.mean)) else { return String::new() };
    // The cheapest value for which no dearer value lowers the error by more than PAYS.
    let enough = values.iter().enumerate().find(|(k, value)| {
        values[k + 1..].iter().all(|dearer| dearer.error.mean >= PAYS * value.error.mean)
    });
    let enough = enough.map_or(best, |(_, value)| value);
    let cost = |value: &Value| {
        format!("work {}, CPU seconds {}, bytes ×{:.2}", value.work.text(), value.seconds.text(), value.bytes.mean)
    };
    let mut text = format!("`{knob}`, default {}: ", shown(default));
    if cheapest.name == default {
        text += "the default is the cheapest value. ";
    } else {
        text += &format!("the cheapest, {}, has {} and an error {} of the default's. ", shown(&cheapest.name), cost(cheapest), cheapest.error.text());
    }
    if best.name == default {
        text += "The default is the most accurate. ";
    } else if best.error.mean >= PAYS {
        text += &format!("No value lowers the error by more than {:.0} %. ", 100.0 * (1.0 - PAYS));
    } else {
        text += &format!("The most accurate, {}, buys an error {} for {}. ", shown(&best.name), best.error.text(), cost(best));
    }
    let place = match (enough.work.mean / default_value.work.mean, enough.name == default) {
        (_, true) => "at the default".to_owned(),
        (ratio, _) => format!("at {}, work ×{ratio:.2}, error ×{:.2}", shown(&enough.name), enough.error.mean),
    };
    text += &format!("It stops paying {place}: nothing dearer lowers the error by more than {:.0} %.", 100.0 * (1.0 - PAYS));
    let linear: Vec<_> = values.iter().filter(|value| !value.quadratic).map(|value| shown(&value.name)).collect();
    if !linear.is_empty() {
        text += &format!(" Newton's method is not quadratic with {}.", linear.join(", "));
    }
    text + &failures
}
