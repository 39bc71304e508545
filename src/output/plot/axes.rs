//! A pair of axes: tick labels, names, and the position of a point in the frame.

use super::font::width;
use super::palette::{BLACK, GREY, LIGHT};
use super::picture::{Anchor, Picture, Point};

/// Font size of tick labels and axis names.
pub(super) const LABEL: f64 = 13.0;

/// Height of the tick labels below the frame.
pub(super) const TICK_LABELS: f64 = 25.0;

/// Height of the axis name below the tick labels.
pub(super) const AXIS_NAME: f64 = 20.0;

/// Ticks of an axis: multiples of 1, 2 or 5 times a power of ten.
pub(super) struct Ticks {
    /// Values of the ticks.
    pub at: Vec<f64>,
    decimals: usize,
    /// Labels are in units of ten to this power.
    power: i32,
}

impl Ticks {
    /// About `most` ticks in a range; only whole numbers if `whole`.
    pub(super) fn new((low, high): (f64, f64), most: usize, whole: bool) -> Self {
        let raw = ((high - low) / most as f64).max(if whole { 1.0 } else { 0.0 });
        let ten = 10.0_f64.powi(raw.log10().floor() as i32);
        let step = [1.0, 2.0, 5.0].iter().map(|k| k * ten).find(|step| *step >= 0.999 * raw).unwrap_or(10.0 * ten);
        let first = (low / step - 1e-9).ceil();
        let at = (0..=2 * most).map(|k| (first + k as f64) * step).take_while(|x| *x <= high + 1e-9 * step).collect();
        let size = low.abs().max(high.abs());
        // Powers of a thousand, like the prefixes of units.
        let power = if (1e-2..1e5).contains(&size) { 0 } else { 3 * (size.log10() / 3.0).floor() as i32 };
        let decimals = (f64::from(power) - (step.log10() + 1e-9).floor()).clamp(0.0, 12.0) as usize;
        Self { at, decimals, power }
    }

    /// Label of a tick.
    pub(super) fn label(&self, x: f64) -> String {
        let text = format!("{:.*}", self.decimals, x / 10.0_f64.powi(self.power));
        // Zero has no sign.
        let zero = text.trim_start_matches('-').bytes().all(|byte| byte == b'0' || byte == b'.');
        if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
    }

    /// Name of the axis, with the power of ten of its labels.
    pub(super) fn name(&self, name: &str) -> String {
        let power: String = self.power.to_string().chars().map(raised).collect();
        if self.power == 0 { name.to_owned() } else { format!("{name} (×10{power})") }
    }

    /// Width of the widest label.
    pub(super) fn width(&self) -> f64 {
        self.at.iter().map(|x| width(&self.label(*x), LABEL)).fold(0.0, f64::max)
    }
}

/// A digit or a minus as a superscript.
fn raised(digit: char) -> char {
    let place = digit.to_digit(10).and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize));
    place.unwrap_or('⁻')
}

/// Axes around a frame.
pub(super) struct Axes {
    /// Upper left corner of the frame.
    pub corner: Point,
    /// Width and height of the frame.
    pub size: Point,
    /// Range of the horizontal axis.
    pub x: (f64, f64),
    /// Range of the vertical axis.
    pub y: (f64, f64),
}

impl Axes {
    /// Position of a point in the picture.
    pub(super) fn place(&self, (x, y): Point) -> Point {
        let along = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low);
        let (left, top) = self.corner;
        (left + self.size.0 * along(x, self.x), top + self.size.1 * (1.0 - along(y, self.y)))
    }

    /// Width that the vertical axis needs at the left of the frame.
    pub(super) fn left(numbers: &Ticks) -> f64 {
        numbers.width() + 2.0 * LABEL + 18.0
    }

    /// Draws the frame, ticks and names, and grid lines if `lines`. An empty name is left out.
    pub(super) fn draw(&self, picture: &mut Picture, [level, upright]: [&Ticks; 2], [x, y]: [&str; 2], lines: bool) {
        let ((left, top), (wide, tall)) = (self.corner, self.size);
        let (right, bottom) = (left + wide, top + tall);
        for &at in &level.at {
            let place = self.place((at, self.y.0)).0;
            if lines {
                picture.line([(place, top), (place, bottom)], LIGHT, 0.8);
            }
            picture.line([(place, bottom), (place, bottom + 5.0)], GREY, 1.0);
            picture.text((place, bottom + 21.0), Anchor::Middle, LABEL, BLACK, &level.label(at));
        }
        for &at in &upright.at {
            let place = self.place((self.x.0, at)).1;
            if lines {
                picture.line([(left, place), (right, place)], LIGHT, 0.8);
            }
            picture.line([(left - 5.0, place), (left, place)], GREY, 1.0);
            picture.text((left - 8.0, place + 0.35 * LABEL), Anchor::End, LABEL, BLACK, &upright.label(at));
        }
        picture.line([(left, top), (left, bottom), (right, bottom), (right, top), (left, top)], GREY, 1.0);
        if !x.is_empty() {
            picture.text(
                ((left + right) / 2.0, bottom + TICK_LABELS + 15.0),
                Anchor::Middle,
                LABEL,
                BLACK,
                &level.name(x),
            );
        }
        let beside = left - 16.0 - upright.width();
        picture.text((beside, (top + bottom) / 2.0), Anchor::Upright, LABEL, BLACK, &upright.name(y));
    }
}

/// Smallest and largest finite value; ∞ and −∞ if there is none.
pub(super) fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = values.filter(|x| x.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Range of the finite values, widened at either end by the fraction `padding`. The range is always wide enough for labels.
pub(super) fn range(values: impl Iterator<Item = f64>, padding: f64) -> (f64, f64) {
    let (low, high) = extremes(values.filter(|x| x.abs() < 1e100));
    if low > high {
        return (0.0, 1.0);
    }
    let least = 1e-6 * low.abs().max(high.abs());
    match high - low {
        span if span < 1e-100 && least < 1e-100 => (low - 1.0, high + 1.0),
        // A constant value is shown as constant, without its round-off.
        span if span <= least => (low - 0.5 * low.abs(), high + 0.5 * high.abs()),
        span => (low - padding * span, high + padding * span),
    }
}

/// A number with at most ten digits.
pub(in crate::output) fn rounded(x: f64) -> String {
    let rounded: f64 = format!("{x:.9e}").parse().unwrap_or(x);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e6).contains(&size) => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_can_always_be_labelled() {
        for values in [&[][..], &[f64::NAN], &[0.0, 0.0], &[1.0, 1.0 + 1e-15], &[-3e-14, 2e-14], &[f64::MAX, 1.0]] {
            let (low, high) = range(values.iter().copied(), 0.05);
            assert!(high - low > 1e-7 * low.abs().max(high.abs()), "{values:?}: {low}, {high}");
            let ticks = Ticks::new((low, high), 6, false);
            let labels: Vec<String> = ticks.at.iter().map(|x| ticks.label(*x)).collect();
            let mut unique = labels.clone();
            unique.dedup();
            assert!(labels.len() >= 2 && labels == unique, "{values:?}: {labels:?}");
        }
        assert_eq!([0.30000000000000004, -2e-14, 0.0, 250.0].map(rounded), ["0.3", "-2e-14", "0", "250"]);
    }

    #[test]
    fn numbers_of_an_axis_have_the_same_decimals_and_a_common_power() {
        let shown = |range, whole| {
            let ticks = Ticks::new(range, 5, whole);
            (ticks.at.iter().map(|x| ticks.label(*x)).collect::<Vec<_>>(), ticks.name("E"))
        };
        let owned = |list: &[&str]| list.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        assert_eq!(shown((-0.5, 1.0), false), (owned(&["−0.5", "0.0", "0.5", "1.0"]), "E".into()));
        assert_eq!(shown((0.0, 4e6), false), (owned(&["0", "1", "2", "3", "4"]), "E (×10⁶)".into()));
        assert_eq!(shown((0.0, 3e-7), false).1, "E (×10⁻⁹)");
        assert_eq!(shown((0.0, 2.0), true).0, ["0", "1", "2"]);
    }
}
