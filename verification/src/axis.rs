//! An axis of a chart: its label, its scale and its ticks.

use crate::report::short;
use std::ops::Range;

/// The largest number of ticks of an axis, and the length that a label of a decade, such as 1e-12, takes.
const TICKS: f64 = 8.0;
const DECADE: f64 = 56.0;

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The quantity on the axis, with its unit.
    pub label: String,
    /// Whether the axis is logarithmic. It then omits values that are not positive.
    pub logarithmic: bool,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: false }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: true }
    }

    /// The coordinate of `value` on the axis.
    pub(crate) fn place(&self, value: f64) -> Option<f64> {
        let place = if self.logarithmic { value.log10() } else { value };
        place.is_finite().then_some(place)
    }

    pub(crate) fn tick(&self, place: f64) -> String {
        if self.logarithmic {
            short(10.0_f64.powf(place))
        } else {
            // Removes the round-off of a multiple.
            format!("{}", (place * 1e9).round() / 1e9)
        }
    }

    /// The ticks of the axis: at decades, with 2 and 5 between them if they are few, or at multiples of 1, 2 or 5. On an axis of `length`
    /// units of the picture their labels fit side by side.
    pub(crate) fn ticks(&self, range: &Range<f64>, length: f64) -> Vec<f64> {
        let span = range.end - range.start;
        if self.logarithmic {
            let most = (length / DECADE).clamp(1.0, TICKS);
            let every = (span / most).ceil().max(1.0) as usize;
            let digits: &[f64] = if span < 3.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let decades = (range.start.floor() as i64..=range.end.ceil() as i64).filter(|d| d % every as i64 == 0);
            decades
                .flat_map(|d| digits.iter().map(move |m| d as f64 + m.log10()))
                .filter(|t| (range.start..=range.end).contains(t))
                .collect()
        } else {
            let rough = span / TICKS;
            let decade = 10.0_f64.powf(rough.log10().floor());
            let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|&s| s >= rough).unwrap_or(rough);
            let (first, last) = ((range.start / step).ceil() as i64, (range.end / step).floor() as i64);
            (first..=last).map(|k| k as f64 * step).collect()
        }
    }
}

/// The range of the values, a little wider.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low > high {
        return 0.0..1.0;
    }
    let margin = if high > low { 0.04 * (high - low) } else { 1.0 };
    low - margin..high + margin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let axis = Axis::logarithmic("h");
        let labels = |axis: &Axis, range: Range<f64>| -> Vec<String> {
            axis.ticks(&range, 500.0).into_iter().map(|place| axis.tick(place)).collect()
        };
        assert_eq!(labels(&axis, 0.9..1.6), ["10", "20"]);
        assert_eq!(axis.ticks(&(-16.5..0.5), 500.0), [-15.0, -12.0, -9.0, -6.0, -3.0, 0.0]);
        assert_eq!(labels(&axis, -13.0..0.1).len(), 7);
        assert_eq!(axis.ticks(&(-12.5..0.1), 268.0), [-12.0, -9.0, -6.0, -3.0, 0.0]);
        assert_eq!(labels(&Axis::linear("t"), -0.1..0.52), ["-0.1", "0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
    }
}
