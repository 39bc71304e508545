//! Charts side by side in one picture, for print.

use crate::axis::{Axis, range};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::ops::Range;

type PlottingError = Box<dyn std::error::Error>;

/// Plotters rounds coordinates to whole units. Pictures are drawn larger by this factor and shown smaller, so that lines are smooth.
const FINE: u32 = 4;

/// The lengths of a dash of a broken line and of the gap after it.
const DASH: (u32, u32) = (6 * FINE, 4 * FINE);

/// The margin beside a chart, and the space for the numbers at its vertical axis.
const MARGINS: (u32, u32) = (8, 18);
const NUMBERS: u32 = 66;

const LABEL: (&str, u32) = ("sans-serif", 14 * FINE);

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

/// The style of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line.
    Line,
    /// A thin broken line.
    Dashed,
    /// Dots.
    Dots,
    /// A line with its points.
    Joined,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The name in the legend; a curve without a name is not listed.
    pub name: String,
    /// The number of its colour; 0 is black.
    pub color: usize,
    /// The style of the curve.
    pub mark: Mark,
    /// The points (x, y).
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// A curve of the given name, colour and mark.
    pub fn new(name: impl Into<String>, color: usize, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), color, mark, points }
    }
}

/// One chart.
#[derive(Clone, Debug)]
pub struct Panel {
    /// The title above the chart.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The ends of both axes; without them all points are shown.
    pub window: Option<[(f64, f64); 2]>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// The position of the legend, if there is one.
    pub legend: Option<SeriesLabelPosition>,
}

/// A picture of one or more charts.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Name of the files, without extension.
    pub name: &'static str,
    /// The caption.
    pub caption: String,
    /// The number of charts in a row.
    pub columns: usize,
    /// Width and height of one chart, in units of the SVG.
    pub size: (u32, u32),
    /// The charts, row by row.
    pub panels: Vec<Panel>,
}

impl Sheet {
    /// The picture as SVG.
    ///
    /// # Errors
    /// Errors of the plotting library.
    pub fn svg(&self) -> Result<String, PlottingError> {
        let mut text = String::new();
        self.draw(&mut text)?;
        let (width, height) = self.extent();
        let drawn = format!(r#"width="{}" height="{}" viewBox"#, width * FINE, height * FINE);
        Ok(text.replacen(&drawn, &format!(r#"width="{width}" height="{height}" viewBox"#), 1))
    }

    fn rows(&self) -> usize {
        self.panels.len().div_ceil(self.columns.max(1))
    }

    /// The width and height of the whole picture.
    fn extent(&self) -> (u32, u32) {
        (self.size.0 * self.columns as u32, self.size.1 * self.rows() as u32)
    }

    fn draw(&self, text: &mut String) -> Result<(), PlottingError> {
        let (width, height) = self.extent();
        let root = SVGBackend::with_string(text, (width * FINE, height * FINE)).into_drawing_area();
        root.fill(&WHITE)?;
        for (area, panel) in root.split_evenly((self.rows(), self.columns)).iter().zip(&self.panels) {
            panel.draw(area)?;
        }
        root.present()?;
        Ok(())
    }
}

/// An axis with labels at given values.
struct Scale {
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        // `as` saturates, also for points far outside.
        start + (f64::from(end - start) * share).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, _hint: H) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl Panel {
    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), PlottingError> {
        let placed: Vec<_> = self.curves.iter().map(|curve| self.placed(curve)).collect();
        let [x, y] = self.ranges(&placed);
        let length = (area.dim_in_pixel().0 / FINE).saturating_sub(MARGINS.0 + MARGINS.1 + NUMBERS);
        let ticks_x = self.x.ticks(&x, f64::from(length));
        // Labels of the vertical axis stand above each other, so they need no room along it.
        let ticks_y = self.y.ticks(&y, f64::INFINITY);
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 16 * FINE))
            .margin(MARGINS.0 * FINE)
            .margin_right(MARGINS.1 * FINE)
            .x_label_area_size(44 * FINE)
            .y_label_area_size(NUMBERS * FINE)
            .build_cartesian_2d(
                Scale { range: x.clone(), ticks: ticks_x },
                Scale { range: y.clone(), ticks: ticks_y },
            )?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12).stroke_width(FINE))
            .axis_style(BLACK.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .label_style(LABEL)
            .axis_desc_style(LABEL)
            .x_label_formatter(&|&x| self.x.tick(x))
            .y_label_formatter(&|&y| self.y.tick(y))
            .draw()?;
        let within = |range: &Range<f64>, value: f64| (range.start..=range.end).contains(&value);
        for (curve, mut points) in self.curves.iter().zip(placed) {
            points.retain(|point| within(&x, point.0) && (within(&y, point.1) || curve.mark != Mark::Dots));
            curve.draw(&mut chart, points)?;
        }
        if let Some(position) = &self.legend {
            chart
                .configure_series_labels()
                .position(position.clone())
                .label_font(LABEL)
                .margin(6 * FINE)
                .legend_area_size(28 * FINE)
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.3).stroke_width(FINE))
                .draw()?;
        }
        Ok(())
    }

    /// The points of a curve in the coordinates of the axes.
    fn placed(&self, curve: &Curve) -> Vec<(f64, f64)> {
        let place = |&(x, y): &(f64, f64)| Some((self.x.place(x)?, self.y.place(y)?));
        curve.points.iter().filter_map(place).collect()
    }

    /// The ranges of both axes: the window, or all points.
    fn ranges(&self, placed: &[Vec<(f64, f64)>]) -> [Range<f64>; 2] {
        match self.window {
            Some([x, y]) => [(&self.x, x), (&self.y, y)]
                .map(|(axis, (low, high))| axis.place(low).unwrap_or(0.0)..axis.place(high).unwrap_or(1.0)),
            None => [range(placed.iter().flatten().map(|p| p.0)), range(placed.iter().flatten().map(|p| p.1))],
        }
    }
}

impl Curve {
    fn color(&self) -> RGBColor {
        COLORS[self.color % COLORS.len()]
    }

    fn draw(
        &self,
        chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<Scale, Scale>>,
        points: Vec<(f64, f64)>,
    ) -> Result<(), PlottingError> {
        let color = self.color();
        let thin = color.stroke_width(3 * FINE / 2);
        let dots = |radius: u32| points.iter().map(move |&point| Circle::new(point, radius, color.filled()));
        let series = match self.mark {
            Mark::Line | Mark::Joined => chart.draw_series(LineSeries::new(points.clone(), thin))?,
            Mark::Dashed => chart.draw_series(DashedLineSeries::new(points.clone(), DASH.0, DASH.1, thin))?,
            Mark::Dots => chart.draw_series(dots(5 * FINE / 2))?,
        };
        if !self.name.is_empty() {
            let length = 20 * FINE as i32;
            let (start, end, width) = match self.mark {
                Mark::Dots => (length / 2, length / 2 + 5 * FINE as i32, 5 * FINE),
                _ => (0, length, 2 * FINE),
            };
            // The library underestimates the width of text: without the blanks it would leave the box.
            let series = series.label(format!("{}    ", self.name));
            let line = move |(x, y)| [(x + start, y), (x + end, y)];
            let style = color.stroke_width(width);
            match self.mark {
                Mark::Dashed => series.legend(move |at| DashedPathElement::new(line(at), DASH.0, DASH.1, style)),
                _ => series.legend(move |at| PathElement::new(line(at), style)),
            };
        }
        if self.mark == Mark::Joined {
            chart.draw_series(dots(3 * FINE))?;
        }
        Ok(())
    }
}
