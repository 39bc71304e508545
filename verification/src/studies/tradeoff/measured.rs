//! Settings with their results, and the front of the settings that no other dominates.

use super::cost::Cost;
use super::problem::Problem;
use super::setting::{Origin, Setting, origin};
use crate::report::chain;
use crate::studies::StudyError;

/// A smaller ratio of work does not count, because the times of the evaluations are rounded.
const MARGIN: f64 = 1.1;

/// A run that succeeded.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub setting: Setting,
    /// The error, relative to the size of the answer.
    pub error: f64,
    pub cost: Cost,
}

impl Point {
    /// The distance of `self` from being dominated by `other`, below 1 if it is: the larger of the two ratios of error and work, or the
    /// ratio of work alone if `other` has no larger error.
    pub fn dominated(&self, other: &Self) -> f64 {
        let (error, work) = (other.error / self.error, MARGIN * other.cost.work / self.cost.work);
        if error <= 1.0 { work } else { error.max(work) }
    }
}

/// All runs of one problem.
pub(super) struct Measured {
    pub problem: &'static str,
    /// Whether the answer has no jumps.
    pub smooth: bool,
    /// All successful runs, the base first.
    pub points: Vec<Point>,
    /// Settings that failed, with the reason.
    pub failures: Vec<(Setting, String)>,
}

impl Measured {
    /// Runs the base and the settings.
    pub fn of(problem: &dyn Problem, settings: &[Setting]) -> Result<Self, StudyError> {
        let (error, cost) = problem.run(&Setting::base())?;
        let (mut points, mut failures) = (vec![Point { setting: Setting::base(), error, cost }], Vec::new());
        for setting in settings.iter().filter(|setting| setting.origin != Origin::Default) {
            match problem.run(setting) {
                Ok((error, cost)) if error.is_finite() => points.push(Point { setting: setting.clone(), error, cost }),
                Ok((error, _)) => failures.push((setting.clone(), format!("the error is {error}"))),
                Err(why) => failures.push((setting.clone(), chain(&*why))),
            }
        }
        Ok(Self { problem: problem.name(), smooth: problem.smooth(), points, failures })
    }

    /// The run with the defaults.
    pub fn base(&self) -> &Point {
        &self.points[0]
    }

    /// The reference for the values of a knob: the base, or the defaults of the shape functions that have the knob; `None` if these have
    /// failed.
    pub fn base_of(&self, knob: &str) -> Option<&Point> {
        let origin = origin(knob);
        self.points.iter().find(|point| point.setting.origin == origin)
    }

    /// The points for which no other is both cheaper and more accurate, from the cheapest to the most accurate.
    pub fn front(&self) -> Vec<&Point> {
        front(self.points.iter().collect())
    }
}

fn front(mut points: Vec<&Point>) -> Vec<&Point> {
    points.sort_by(|a, b| a.cost.work.total_cmp(&b.cost.work).then(a.error.total_cmp(&b.error)));
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
    fn no_point_beats_the_front() {
        let point = |work: f64, error: f64| {
            let cost = Cost { tally: Tally::default(), work, seconds: work, bytes: 0 };
            Point { setting: Setting::base(), error, cost }
        };
        let points =
            [point(3.0, 0.1), point(1.0, 0.5), point(2.0, 0.5), point(2.0, 0.2), point(4.0, 0.1), point(5.0, 0.3)];
        let found: Vec<_> = front(points.iter().collect()).iter().map(|p| (p.cost.work, p.error)).collect();
        assert_eq!(found, [(1.0, 0.5), (2.0, 0.2), (3.0, 0.1)]);
        assert!(points[5].dominated(&points[0]) < 1.0 && points[1].dominated(&points[0]) > 1.0);
        // An equal error with less work, by more than the margin and by less; no point dominates itself.
        assert!(points[2].dominated(&points[1]) < 1.0 && point(2.1, 0.5).dominated(&points[2]) > 1.0);
        assert!(points.iter().all(|point| point.dominated(point) > 1.0));
    }
}
