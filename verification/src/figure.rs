//! A line chart as SVG.

use crate::report::short;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

/// Colours that people with any colour vision distinguish (Okabe and Ito, 2008), without yellow, which is too pale for a line. Black, blue,
/// vermillion, green, purple, orange, sky; grey for the background.
pub(crate) const COLORS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(170, 170, 170),
];

/// The width of a line. Each line is thinner than those below it, so that coincident lines all show.
fn width(line: usize, lines: usize) -> u32 {
    2 + 2 * (lines - 1 - line).min(3) as u32
}

/// The height of a line of the legend, and the width of a letter.
const LEGEND: (i32, i32) = (22, 8);

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

/// A range with its own ticks: the plotting library would divide the logarithms into tenths.
struct Ticked {
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for Ticked {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range.clone()).map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Ticked {}

/// A line with its points.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// The points (x, y).
    pub points: Vec<(f64, f64)>,
}

/// A line chart.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of the file, without `.svg`.
    pub name: String,
    /// The title above the chart.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The lines.
    pub lines: Vec<Line>,
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

/// The chart could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the figure cannot be drawn: {0}")]
pub struct FigureError(String);

impl FigureError {
    pub(crate) fn new(error: &dyn std::error::Error) -> Self {
        Self(error.to_string())
    }
}

impl Figure {
    /// The picture.
    ///
    /// # Errors
    /// Errors of the plotting library.
    pub fn svg(&self) -> Result<String, FigureError> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|error| FigureError(error.to_string()))?;
        Ok(text)
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let placed: Vec<_> = (self.lines.iter().enumerate())
            .map(|(k, line)| {
                let points = line.points.iter().filter_map(|&(x, y)| Some((self.x.place(x)?, self.y.place(y)?)));
                (k, line, points.collect::<Vec<(f64, f64)>>())
            })
            .collect();
        let all = || placed.iter().flat_map(|(_, _, points)| points.iter());
        let root = SVGBackend::with_string(text, (1000, 560)).into_drawing_area();
        root.fill(&WHITE)?;
        let longest = self.lines.iter().map(|line| line.name.chars().count()).max().unwrap_or(0) as i32;
        // The legend stands beside the chart and covers nothing.
        let (area, legend) = root.split_horizontally(1000 - (LEGEND.1 * longest + 60).min(400));
        let (x, y) = (range(all().map(|p| p.0)), range(all().map(|p| p.1)));
        // Labels of the vertical axis stand above each other, so they need no room along it.
        let (x_ticks, y_ticks) = (self.x.ticks(&x, 500.0), self.y.ticks(&y, f64::INFINITY));
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(Ticked { range: x, ticks: x_ticks }, Ticked { range: y, ticks: y_ticks })?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&|&x| self.x.tick(x))
            .y_label_formatter(&|&y| self.y.tick(y))
            .draw()?;
        for (k, line, points) in &placed {
            let (color, width) = (COLORS[(k + 1) % COLORS.len()].to_rgba(), width(*k, self.lines.len()));
            chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(width)))?;
            let dot = 2 + width / 2;
            chart.draw_series(points.iter().map(|&point| Circle::new(point, dot, color.filled())))?;
            let height = 60 + LEGEND.0 * *k as i32;
            legend.draw(&PathElement::new(vec![(4, height), (30, height)], color.stroke_width(width)))?;
            legend.draw(&Text::new(line.name.clone(), (38, height - 7), ("sans-serif", 14)))?;
        }
        root.present()?;
        drop(chart);
        drop(root);
        Ok(())
    }
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
