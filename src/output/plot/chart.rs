//! Lines against time, in panels one above the other.

use super::{PlotError, draw_error};
use plotters::coord::Shift;
use plotters::prelude::*;

/// Size of a figure, in SVG units.
const SIZE: (u32, u32) = (900, 640);

/// Above so many points, a line is thinned to the extremes of as many intervals.
const INTERVALS: usize = 1500;

/// Font of titles and labels.
pub(super) const TITLE: (&str, u32) = ("sans-serif", 20);
/// See [`TITLE`].
pub(super) const LABEL: (&str, u32) = ("sans-serif", 14);

/// A line with its place in the legend.
pub(super) struct Line {
    /// Name; lines without one are not in the legend.
    pub label: String,
    /// Colour.
    pub color: RGBColor,
    /// Points.
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes.
pub(super) struct Panel {
    /// Label of the level axis.
    pub x: &'static str,
    /// Numbers at it, at most.
    pub x_labels: usize,
    /// Label of the upright axis.
    pub y: &'static str,
    /// The lines.
    pub lines: Vec<Line>,
    /// Height in parts of the sum over all panels.
    pub share: u32,
}

/// The figure as SVG.
pub(super) fn draw(name: &'static str, title: &str, panels: &[Panel]) -> Result<String, PlotError> {
    let fail = draw_error(name);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(|e| fail(&e))?;
        let mut rest = root.titled(title, TITLE).map_err(|e| fail(&e))?;
        let mut shares: u32 = panels.iter().map(|panel| panel.share).sum();
        for panel in panels {
            let height = rest.dim_in_pixel().1 * panel.share / shares.max(1);
            let (area, below) = rest.split_vertically(height);
            draw_panel(&area, panel).map_err(|e| fail(&*e))?;
            rest = below;
            shares -= panel.share;
        }
        root.present().map_err(|e| fail(&e))?;
    }
    Ok(svg)
}

fn draw_panel(area: &DrawingArea<SVGBackend<'_>, Shift>, panel: &Panel) -> Result<(), Box<dyn std::error::Error>> {
    let points = || panel.lines.iter().flat_map(|line| &line.points);
    let (x, y) = (range(points().map(|point| point.0), 0.0), range(points().map(|point| point.1), 0.06));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .x_label_area_size(42)
        .y_label_area_size(86)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_desc(panel.x)
        .y_desc(panel.y)
        .label_style(LABEL)
        .axis_desc_style(LABEL)
        .x_label_formatter(&|at| tick(*at, x))
        .y_label_formatter(&|at| tick(*at, y))
        .x_labels(panel.x_labels)
        .y_labels(6)
        .draw()?;
    // One line that is called what its axis is needs no legend.
    let named = panel.lines.len() > 1 || panel.lines.iter().any(|line| line.label != panel.y);
    for line in &panel.lines {
        let color = line.color;
        let width = if line.label.is_empty() { 1 } else { 2 };
        let drawn = chart.draw_series(LineSeries::new(thinned(&line.points), color.stroke_width(width)))?;
        if line.label.is_empty() || !named {
            continue;
        }
        drawn.label(&line.label).legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], color.stroke_width(2)));
    }
    if !named {
        return Ok(());
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .margin(6)
        .legend_area_size(28)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .label_font(LABEL)
        .draw()?;
    Ok(())
}

/// The range of the finite values, `padding` wider at either end, and never so narrow that axes could not be labelled.
pub(super) fn range(values: impl Iterator<Item = f64>, padding: f64) -> (f64, f64) {
    let drawable = values.filter(|x| x.abs() < 1e100);
    let (low, high) = drawable.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (x.min(a), x.max(b)));
    if low > high {
        return (0.0, 1.0);
    }
    let least = 1e-6 * low.abs().max(high.abs());
    match high - low {
        span if span < 1e-100 && least < 1e-100 => (low - 1.0, high + 1.0),
        // What does not vary is shown as such, not as its round-off.
        span if span <= least => (low - 0.5 * low.abs(), high + 0.5 * high.abs()),
        span => (low - padding * span, high + padding * span),
    }
}

/// A number at an axis that shows `range`, without the round-off of its place.
pub(super) fn tick(x: f64, range: (f64, f64)) -> String {
    if x.abs() < 1e-9 * (range.1 - range.0) { "0".to_owned() } else { rounded(x) }
}

/// A number with at most ten digits.
pub(super) fn rounded(x: f64) -> String {
    let rounded: f64 = format!("{x:.9e}").parse().unwrap_or(x);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e6).contains(&size) => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

/// The finite points; if they are many, only the lowest and the highest of each interval, in their order: no peak is lost.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let drawable: Vec<_> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.abs() < 1e100).collect();
    if drawable.len() <= 2 * INTERVALS {
        return drawable;
    }
    let mut kept: Vec<(f64, f64)> = Vec::with_capacity(2 * INTERVALS);
    for interval in drawable.chunks(drawable.len().div_ceil(INTERVALS)) {
        let by_height = |a: &&(f64, f64), b: &&(f64, f64)| f64::total_cmp(&a.1, &b.1);
        let extremes = interval.iter().min_by(by_height).into_iter().chain(interval.iter().max_by(by_height));
        let start = kept.len();
        kept.extend(extremes);
        kept[start..].sort_by(|a, b| f64::total_cmp(&a.0, &b.0));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_a_lone_peak_and_the_order() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        points[77_777].1 = f64::NAN;
        let kept = thinned(&points);
        assert!(kept.len() <= 2 * INTERVALS && kept.contains(&(54_321.0, 7.0)));
        assert!(kept.is_sorted_by(|a, b| a.0 <= b.0) && kept.iter().all(|point| point.1.is_finite()));
    }

    #[test]
    fn ranges_can_always_be_labelled() {
        for values in [&[][..], &[f64::NAN], &[0.0, 0.0], &[1.0, 1.0 + 1e-15], &[-3e-14, 2e-14], &[f64::MAX, 1.0]] {
            let (low, high) = range(values.iter().copied(), 0.05);
            assert!(high - low > 1e-7 * low.abs().max(high.abs()), "{values:?}: {low}, {high}");
        }
        let labels = [0.30000000000000004, -2e-14, 0.0, 250.0].map(rounded);
        assert_eq!(labels, ["0.3", "-2e-14", "0", "250"]);
        // what plotters makes of 0 among ticks of 0.05, and the same number where it counts
        assert_eq!([tick(2.8e-17, (-0.2, 0.0)), tick(2.8e-17, (0.0, 1e-16))], ["0", "2.8e-17"]);
    }
}
