//! Speed against accuracy: error, work, seconds and bytes for every knob of a scene, on four problems with known answers.

mod cost;
mod levels;
mod measured;
mod problem;
mod ratios;
mod setting;

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report, chain};
use crate::table::Table;
use measured::{Measured, Point};
use problem::{Bar, Compaction, Manufactured, Problem};
use setting::{BASE_LEVEL, COURANT, KNOBS, Origin, design, knobs, one_at_a_time};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "speed against accuracy: error, work, seconds and bytes over every knob of a scene, on four problems with known answers";

fn problems(effort: Effort) -> Result<Vec<Box<dyn Problem>>, StudyError> {
    let (plane, space) = ([6.0, 8.0, 12.0, 16.0, 24.0], [3.0, 4.0, 6.0, 8.0, 12.0]);
    Ok(match effort {
        Effort::Short => vec![
            Box::new(Manufactured::<2> { name: "manufactured 2D", cells: plane, end: 1.0 }),
            Box::new(Bar { end: 1e-3 }),
            Box::new(Compaction::new(0.4, 16)?),
            Box::new(Manufactured::<3> { name: "manufactured 3D", cells: space, end: 1.0 }),
        ],
        Effort::Full => vec![
            Box::new(Manufactured::<2> { name: "manufactured 2D", cells: plane, end: 1.0 }),
            Box::new(Bar { end: 3e-3 }),
            Box::new(Compaction::new(1.5, 32)?),
            Box::new(Manufactured::<3> { name: "manufactured 3D", cells: space, end: 1.0 }),
        ],
    })
}

/// Runs each problem on a thread of its own.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let effort = *effort;
    let problems = problems(effort)?;
    let all: Vec<Result<Measured, String>> = std::thread::scope(|scope| {
        let threads: Vec<_> = problems.iter().map(|problem| scope.spawn(|| measure(&**problem, effort))).collect();
        let lost = |_| Err("a problem did not come to its end".to_owned());
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(lost)).collect()
    });
    let all = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut outcome =
        Outcome { reports: vec![defaults(&all, effort), levels::report(&all, effort)], ..Outcome::default() };
    let defaults = problems.first().map(|problem| knobs(&**problem)).unwrap_or_default();
    outcome.remarks.push(base(&problems));
    outcome.tables.extend(all.iter().map(front));
    outcome.tables.extend(defaults.iter().map(|(knob, default)| ratios::table(&all, knob, default)));
    outcome.tables.extend(all.iter().map(everything));
    Ok(outcome)
}

/// All runs of a problem. Its transfers use one thread, so that seconds are those of one core.
fn measure(problem: &dyn Problem, effort: Effort) -> Result<Measured, String> {
    let settings =
        [one_at_a_time(problem, effort), design(problem, effort), levels::settings(problem, effort)].concat();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| chain(&error))?;
    one.install(|| Measured::of(problem, &settings).map_err(|error| chain(&*error)))
}

/// The base in words.
fn base(problems: &[Box<dyn Problem>]) -> String {
    let sizes: Vec<_> =
        problems.iter().map(|one| format!("h = 1/{:.4} ({})", one.cells()[BASE_LEVEL], one.name())).collect();
    format!(
        "The base: what a scene has that gives no knob, at cΔt/h = {COURANT} and {}. Errors are relative to the size of the answer. Work is \
         counted: shape functions, residuals, linearisations, products with the tangent and iterations of the projection, each times its usual \
         time. The unit is the share of one node in the product of one particle. The vectors of the Krylov method are left out. CPU seconds are those of one thread. Bytes are those of the plan. A knob of shape functions that \
         are not the default is turned from the defaults of those.",
        sizes.join(", ")
    )
}

/// Whether any setting dominates the defaults: one knob at a time, and the combinations.
fn defaults(all: &[Measured], effort: Effort) -> Report {
    // Short runs are too few to choose defaults by.
    let bound = if effort == Effort::Full { Bound::AtLeast(1.0) } else { Bound::Reported };
    let title = "the defaults are on the front: how far they are from being dominated in error and work, by settings that keep Newton's method \
                 quadratic";
    let mut report = Report::new(title, &["knob", "problem", "by"]);
    for measured in all {
        let base = measured.base();
        let mut least = |what: &str, base: Option<&Point>, chosen: &dyn Fn(&Point) -> bool| {
            let others = measured.points.iter().filter(|point| point.cost.tally.quadratic() && chosen(point));
            // Every setting dominates defaults that fail.
            let dominated = |other: &Point| base.map_or(0.0, |base| base.dominated(other));
            let nearest = others.min_by(|a, b| dominated(a).total_cmp(&dominated(b)));
            if let Some(nearest) = nearest {
                let by = base.map_or_else(|| nearest.setting.name(), |base| by_how_much(base, nearest));
                report.push(&[what, measured.problem, &by], dominated(nearest), bound);
            }
        };
        for knob in KNOBS {
            least(knob.key, measured.base_of(knob.key), &|point| point.setting.of_knob(knob.key).is_some());
        }
        least("combinations", Some(base), &|point| matches!(point.setting.origin, Origin::Design(..)));
        let quadratic = if base.cost.tally.quadratic() { 1.0 } else { 0.0 };
        report.push(&["Newton quadratic with the defaults", measured.problem, "-"], quadratic, Bound::AtLeast(1.0));
    }
    report
}

/// A setting, with its error and work over those of the defaults.
fn by_how_much(base: &Point, other: &Point) -> String {
    let (error, work) = (other.error / base.error, other.cost.work / base.cost.work);
    format!("{} (error ×{error:.6}, work ×{work:.2})", other.setting.name())
}

const HEADER: [&str; 8] = ["setting", "error", "work (1e6)", "CPU s", "KiB", "steps", "products / step", "Newton"];

fn row(point: &Point) -> [String; 8] {
    let tally = &point.cost.tally;
    [
        point.setting.name(),
        format!("{:.3e}", point.error),
        format!("{:.3}", point.cost.work / 1e6),
        format!("{:.3}", point.cost.seconds),
        (point.cost.bytes / 1024).to_string(),
        tally.steps.to_string(),
        format!("{:.1}", tally.products as f64 / tally.steps as f64),
        if tally.quadratic() { "quadratic" } else { "linear" }.to_owned(),
    ]
}

fn front(measured: &Measured) -> Table {
    let mut table = Table::new(format!("{}: the front, cheap to accurate", measured.problem), HEADER);
    measured.front().into_iter().for_each(|point| table.push(row(point)));
    table
}

fn everything(measured: &Measured) -> Table {
    let mut table = Table::new(format!("{}: everything measured", measured.problem), HEADER);
    measured.points.iter().for_each(|point| table.push(row(point)));
    for (setting, why) in &measured.failures {
        table.push([setting.name(), format!("fails: {why}")]);
    }
    table
}
