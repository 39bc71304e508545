//! Lines against time, in panels one above the other.

use super::{PlotError, draw_error};
use plotters::coord::Shift;
use plotters::prelude::*;

/// Width of a figure, in SVG units.
const WIDTH: u32 = 900;

/// Width of a letter of a legend, at most; letters of a name, at most; height of its line.
const LEGEND: (u32, usize, i32) = (8, 30, 17);

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
    pub y: String,
    /// The lines.
    pub lines: Vec<Line>,
    /// Height in parts of the sum over all panels.
    pub share: u32,
}

/// The figure as SVG, so many units high.
pub(super) fn draw(name: &'static str, title: &str, height: u32, panels: &[Panel]) -> Result<String, PlotError> {
    let fail = draw_error(name);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
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
    // One line that is called what its axis is needs no legend.
    let named: Vec<&Line> = panel.lines.iter().filter(|line| !line.label.is_empty()).collect();
    let named = if panel.lines.len() == 1 && named.iter().all(|line| line.label == panel.y) { vec![] } else { named };
    let letters = named.iter().map(|line| shortened(&line.label).chars().count() as u32).max();
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24 + LEGEND.0 * letters.unwrap_or(0))
        .x_label_area_size(42)
        .y_label_area_size(86)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_desc(panel.x)
        .y_desc(&panel.y)
        .label_style(LABEL)
        .axis_desc_style(LABEL)
        .x_label_formatter(&|at| tick(*at, x))
        .y_label_formatter(&|at| tick(*at, y))
        .x_labels(panel.x_labels)
        .y_labels(6)
        .draw()?;
    for line in &panel.lines {
        let width = if line.label.is_empty() { 1 } else { 2 };
        chart.draw_series(LineSeries::new(thinned(&line.points), line.color.stroke_width(width)))?;
    }
    // Names stand where their curves end, from top to bottom, as far apart as letters need.
    let base = area.get_base_pixel();
    let end = |line: &&Line| thinned(&line.points).last().map_or(0, |point| chart.backend_coord(point).1 - base.1);
    let mut ends: Vec<(i32, &Line)> = named.iter().map(|line| (end(line), *line)).collect();
    ends.sort_by_key(|(height, _)| *height);
    let heights = apart(ends.iter().map(|(height, _)| *height).collect(), area.dim_in_pixel().1 as i32 - 42);
    let right = chart.backend_coord(&(x.1, y.0)).0 - base.0;
    for ((_, line), height) in ends.iter().zip(heights) {
        let style = LABEL.into_font().color(&line.color);
        area.draw(&Text::new(shortened(&line.label), (right + 8, height - LEGEND.2 / 2), style))?;
    }
    Ok(())
}

/// A name that leaves room for the curves.
fn shortened(name: &str) -> String {
    let short: String = name.chars().take(LEGEND.1 - 1).collect();
    if name.chars().count() > LEGEND.1 { format!("{short}…") } else { name.to_owned() }
}

/// Heights in ascending order, moved until lines of text fit between them, none below `lowest` as long as there is room above.
fn apart(mut heights: Vec<i32>, lowest: i32) -> Vec<i32> {
    for k in 1..heights.len() {
        heights[k] = heights[k].max(heights[k - 1] + LEGEND.2);
    }
    let mut below = lowest + LEGEND.2;
    for height in heights.iter_mut().rev() {
        *height = (*height).min(below - LEGEND.2);
        below = *height;
    }
    heights
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
    fn names_that_would_cover_each_other_move_apart() {
        assert_eq!(apart(vec![10, 100, 103, 104, 300], 400), [10, 100, 117, 134, 300]);
        assert_eq!(apart(vec![10, 395, 398], 400), [10, 383, 400]);
        assert!(apart(vec![], 400).is_empty());
        assert_eq!(shortened(&"ä".repeat(40)).chars().count(), 30);
    }

    #[test]
    fn a_name_cannot_break_the_picture() -> Result<(), PlotError> {
        let line = |label: &str| Line { label: label.to_owned(), color: BLACK, points: vec![(0.0, 0.0), (1.0, 1.0)] };
        let lines = vec![line("</text><script>&"), line("x")];
        let panel = Panel { x: "time", x_labels: 5, y: "<script>\"&".to_owned(), lines, share: 1 };
        let svg = draw("names", "<script>", 300, &[panel])?;
        assert!(!svg.contains("<script>") && svg.contains("&lt;script&gt;"), "{svg}");
        Ok(())
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
