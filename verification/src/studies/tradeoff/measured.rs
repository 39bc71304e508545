//! Settings with what came of them, and the front of those that nothing beats.

use super::cost::Cost;
use super::problem::Problem;
use super::setting::{Origin, Setting, origin};
use crate::report::chain;
use crate::studies::StudyError;

/// How often it is measured again what evaluations take.
const ROUNDS: usize = 4;

/// A run that succeeded.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub setting: Setting,
    /// Relative to the size of the answer.
    pub error: f64,
    pub cost: Cost,
    /// What was counted, in products of one particle with the default functions.
    pub work: f64,
}

impl Point {
    /// How far `self` is from being beaten by `other`: the larger of the two ratios of error and work; below 1, `other` is better in both.
    pub fn beaten(&self, other: &Self) -> f64 {
        (other.error / self.error).max(other.work / self.work)
    }
}

/// All runs of one problem.
pub(super) struct Measured {
    pub problem: &'static str,
    /// Whether the answer has no jumps.
    pub smooth: bool,
    pub base: Point,
    /// All that succeeded, the base first.
    pub points: Vec<Point>,
    /// Settings that failed, and why.
    pub failures: Vec<(Setting, String)>,
}

impl Measured {
    /// Runs the base and the settings, the first of which is the base; and measures what evaluations take again and again, so that a
    /// time in which the machine is slow falls on no setting alone.
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
        for _ in 0..ROUNDS {
            for (setting, _, cost) in &mut runs {
                cost.units = cost.units.least(&problem.units(setting)?);
            }
        }
        let unit = runs[0].2.units.product_of_one;
        let point = |(setting, error, cost): (Setting, f64, Cost)| Point { setting, error, work: cost.counted() / unit, cost };
        let points: Vec<Point> = runs.into_iter().map(point).collect();
        Ok(Self { problem: problem.name(), smooth: problem.smooth(), base: points[0].clone(), points, failures })
    }

    /// What the values of a knob are compared with: the base, or the defaults of the shape functions that have it; `None` where these
    /// have failed.
    pub fn base_of(&self, knob: &str) -> Option<&Point> {
        let origin = origin(knob);
        self.points.iter().find(|point| point.setting.origin == origin)
    }

    /// The points that nothing beats, from the cheapest to the most accurate.
    pub fn front(&self) -> Vec<&Point> {
        front(self.points.iter().collect(), |point| point.work)
    }

    /// The same by bytes in place of work.
    pub fn front_in_bytes(&self) -> Vec<&Point> {
        front(self.points.iter().collect(), |point| point.cost.bytes as f64)
    }
}

/// Those than which no other is both cheaper and more accurate, by rising price.
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
    use crate::studies::tradeoff::cost::{Tally, Units};

    #[test]
    fn the_front_is_what_nothing_beats() {
        let point = |work: f64, error: f64| Point {
            setting: Setting::base(),
            error,
            cost: Cost { tally: Tally::default(), seconds: work, units: Units::default(), bytes: 0 },
            work,
        };
        let points = [point(3.0, 0.1), point(1.0, 0.5), point(2.0, 0.5), point(2.0, 0.2), point(4.0, 0.1), point(5.0, 0.3)];
        let found: Vec<_> = front(points.iter().collect(), |point| point.work).iter().map(|p| (p.work, p.error)).collect();
        assert_eq!(found, [(1.0, 0.5), (2.0, 0.2), (3.0, 0.1)]);
        assert!(points[5].beaten(&points[0]) < 1.0 && points[1].beaten(&points[0]) > 1.0);
    }
}
