//! Settings with their results, and the front of the settings that no other dominates.

use super::cost::{Cost, Units};
use super::problem::Problem;
use super::setting::{Origin, Setting, origin};
use crate::report::chain;
use crate::studies::StudyError;

/// The number of repeated measurements of the evaluation times.
const ROUNDS: usize = 4;

/// A setting that beats the defaults by less than this is measured again beside them: of hundreds, some do by chance.
const DOUBTFUL: f64 = 0.9;

/// A run that succeeded.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub setting: Setting,
    /// The error, relative to the size of the answer.
    pub error: f64,
    pub cost: Cost,
    /// The counted work, in products of one particle with the default functions.
    pub work: f64,
    /// The least and the greatest measured work.
    pub scatter: [f64; 2],
    /// The second least over the least work.
    pub again: f64,
}

impl Point {
    /// The distance of `self` from being dominated by `other`, below 1 if it is: the larger of the two ratios of error and work, or the
    /// ratio of work alone if `other` has no larger error. Errors are equal in every run; a difference of work within `scatter` does not
    /// count.
    pub fn dominated(&self, other: &Self, scatter: f64) -> f64 {
        let (error, work) = (other.error / self.error, scatter * other.work / self.work);
        if error <= 1.0 { work } else { error.max(work) }
    }
}

/// All runs of one problem.
pub(super) struct Measured {
    pub problem: &'static str,
    /// Whether the answer has no jumps.
    pub smooth: bool,
    pub base: Point,
    /// All successful runs, the base first.
    pub points: Vec<Point>,
    /// Settings that failed, with the reason.
    pub failures: Vec<(Setting, String)>,
}

impl Measured {
    /// Runs the base and the settings, whose first is the base. Repeats the measurement of the evaluations in rounds, so that a slow period
    /// of the machine affects all settings.
    pub fn of(problem: &dyn Problem, settings: &[Setting]) -> Result<Self, StudyError> {
        let (error, cost) = problem.run(&Setting::base())?;
        let (mut runs, mut failures) = (vec![(Setting::base(), error, cost)], Vec::new());
        for setting in settings.iter().filter(|setting| setting.origin != Origin::Default) {
            match problem.run(setting) {
                Ok((error, cost)) if error.is_finite() => runs.push((setting.clone(), error, cost)),
                Ok((error, _)) => failures.push((setting.clone(), format!("the error is {error}"))),
                Err(why) => failures.push((setting.clone(), chain(&*why))),
            }
        }
        let mut units: Vec<Vec<Units>> = runs.iter().map(|(.., cost)| vec![cost.units]).collect();
        for _ in 0..ROUNDS {
            for ((setting, ..), units) in runs.iter().zip(&mut units) {
                units.push(problem.units(setting)?);
            }
        }
        let first = Self::from(problem, &runs, &units);
        let doubtful: Vec<(usize, usize)> = first.doubtful().collect();
        for _ in 0..ROUNDS {
            for &(base, other) in &doubtful {
                for one in [base, other] {
                    units[one].push(problem.units(&runs[one].0)?);
                }
            }
        }
        Ok(Self { failures, ..Self::from(problem, &runs, &units) })
    }

    /// The results of the runs, from all measurements of each.
    fn from(problem: &dyn Problem, runs: &[(Setting, f64, Cost)], units: &[Vec<Units>]) -> Self {
        let least = |units: &[Units]| units.iter().fold(units[0], |least, one| least.least(one));
        let unit = least(&units[0]).product_of_one;
        let point = |((setting, error, cost), units): (&(Setting, f64, Cost), &Vec<Units>)| {
            let mut sorted: Vec<f64> = units.iter().map(|units| cost.counted(units) / unit).collect();
            sorted.sort_by(f64::total_cmp);
            let (scatter, again) = ([sorted[0], sorted[sorted.len() - 1]], sorted[1] / sorted[0]);
            let work = cost.counted(&least(units)) / unit;
            Point { setting: setting.clone(), error: *error, work, cost: *cost, scatter, again }
        };
        let points: Vec<Point> = runs.iter().zip(units).map(point).collect();
        let (problem, smooth) = (problem.name(), problem.smooth());
        Self { problem, smooth, base: points[0].clone(), points, failures: Vec::new() }
    }

    /// The index of each setting that seems slightly better than its reference, after the index of that reference.
    fn doubtful(&self) -> impl Iterator<Item = (usize, usize)> {
        let of = |origin: Origin| self.points.iter().position(|point| point.setting.origin == origin);
        let scatter = self.scatter();
        self.points.iter().enumerate().filter_map(move |(other, point)| {
            let base = match &point.setting.origin {
                Origin::Knob(knob, _) => of(origin(knob))?,
                _ => 0,
            };
            let by = self.points[base].dominated(point, scatter);
            (base != other && (DOUBTFUL..1.0).contains(&by)).then_some((base, other))
        })
    }

    /// The reproducibility of the least work: the second least over the least, at worst over all settings. The value of one setting alone
    /// is no margin: of hundreds of equal pairs, some always differ by more.
    pub fn scatter(&self) -> f64 {
        self.points.iter().map(|point| point.again).fold(1.0, f64::max)
    }

    /// The reference for the values of a knob: the base, or the defaults of the shape functions that have the knob; `None` if these have
    /// failed.
    pub fn base_of(&self, knob: &str) -> Option<&Point> {
        let origin = origin(knob);
        self.points.iter().find(|point| point.setting.origin == origin)
    }

    /// The points that no other dominates, from the cheapest to the most accurate.
    pub fn front(&self) -> Vec<&Point> {
        front(self.points.iter().collect(), |point| point.work)
    }
}

/// The points for which no other is both cheaper and more accurate, by rising price.
fn front(mut points: Vec<&Point>, price: impl Fn(&Point) -> f64) -> Vec<&Point> {
    points.sort_by(|a, b| price(a).total_cmp(&price(b)).then(a.error.total_cmp(&b.error)));
    let mut least = f64::INFINITY;
    points.retain(|point| {
        let better = point.error < least;
        least = least.min(point.error);
        better
    });
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::tradeoff::cost::Tally;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let point = |work: f64, error: f64| Point {
            setting: Setting::base(),
            error,
            cost: Cost { tally: Tally::default(), seconds: work, units: Units::default(), bytes: 0 },
            work,
            scatter: [0.9 * work, 1.1 * work],
            again: 1.2,
        };
        let points = [point(3.0, 0.1), point(1.0, 0.5), point(2.0, 0.5), point(2.0, 0.2), point(4.0, 0.1), point(5.0, 0.3)];
        let found: Vec<_> = front(points.iter().collect(), |point| point.work).iter().map(|p| (p.work, p.error)).collect();
        assert_eq!(found, [(1.0, 0.5), (2.0, 0.2), (3.0, 0.1)]);
        let scatter = 1.2;
        assert!(points[5].dominated(&points[0], scatter) < 1.0 && points[1].dominated(&points[0], scatter) > 1.0);
        // An equal error with less work, by more than the scatter and by less; no point dominates itself.
        assert!(points[2].dominated(&points[1], scatter) < 1.0 && point(2.1, 0.5).dominated(&points[2], scatter) > 1.0);
        assert!(points.iter().all(|point| point.dominated(point, scatter) > 1.0));
    }
}
