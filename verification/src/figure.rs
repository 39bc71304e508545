//! A line chart as SVG.

use plotters::prelude::*;
use std::ops::Range;

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// Whether it is logarithmic; values that are not positive are then left out.
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

    /// Where `value` stands on the axis.
    pub(crate) fn place(&self, value: f64) -> Option<f64> {
        let place = if self.logarithmic { value.log10() } else { value };
        place.is_finite().then_some(place)
    }

    pub(crate) fn tick(&self, place: f64) -> String {
        let value = if self.logarithmic { 10.0_f64.powf(place) } else { place };
        // Without the round-off of its place.
        let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
        if (1e-4..1e5).contains(&rounded.abs()) || rounded.abs() < 1e-12 {
            format!("{}", if rounded.abs() < 1e-12 { 0.0 } else { rounded })
        } else {
            format!("{rounded:e}")
        }
    }

    /// Places of the labels within `range`: 1, 2 and 5 times powers of ten.
    pub(crate) fn ticks(&self, range: &Range<f64>) -> Vec<f64> {
        let (low, high) = (range.start, range.end);
        if self.logarithmic {
            let digits: &[f64] = if high - low > 2.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let decades = low.floor() as i32..=high.ceil() as i32;
            return decades
                .flat_map(|decade| digits.iter().map(move |digit| f64::from(decade) + digit.log10()))
                .filter(|place| (low..=high).contains(place))
                .collect();
        }
        let least = (high - low) / 8.0;
        let power = 10.0_f64.powf(least.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|&step| step >= least).unwrap_or(least);
        let first = (low / step).ceil() as i64;
        (0..=20).map(|k| (first + k) as f64 * step).take_while(|&place| place <= high).collect()
    }
}

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
    /// The line above it.
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
    /// Those of the plotting library.
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
        let root = SVGBackend::with_string(text, (900, 560)).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(range(all().map(|p| p.0)), range(all().map(|p| p.1)))?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&|&x| self.x.tick(x))
            .y_label_formatter(&|&y| self.y.tick(y))
            .draw()?;
        for (k, line, points) in &placed {
            let color = Palette99::pick(*k).to_rgba();
            chart
                .draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], color.stroke_width(2)));
            chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, color.filled())))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        root.present()?;
        drop(chart);
        drop(root);
        Ok(())
    }
}
