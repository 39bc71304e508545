//! Lines against time, in panels one above the other.

use super::axes::{AXIS_NAME, Axes, LABEL, TICK_LABELS, Ticks, range};
use super::font::{shortened, width};
use super::palette::{BLACK, GREY};
use super::picture::{Anchor, Color, Picture, Point};

/// Width of a figure, in SVG units.
const WIDTH: f64 = 900.0;

/// Largest width of a name beside a curve.
const LEGEND_WIDTH: f64 = 250.0;

/// Height of the line of a name beside a curve.
const LEGEND_LINE: f64 = 17.0;

/// A line with more than two points per interval is thinned to the extremes of this many intervals.
const INTERVALS: usize = 1500;

/// Font size of a title.
const TITLE: f64 = 19.0;

/// Font size of the line below a title.
const SUBTITLE: f64 = 13.0;

/// A line with its place in the legend.
pub(super) struct Line {
    /// Name; empty for a line that is not in the legend.
    pub label: String,
    pub color: Color,
    pub points: Vec<Point>,
}

impl Line {
    pub(super) fn new(label: &str, color: Color, points: Vec<Point>) -> Self {
        Self { label: label.to_owned(), color, points }
    }
}

/// One pair of axes.
pub(super) struct Panel {
    /// Name of the horizontal axis, and whether its ticks are whole numbers only.
    pub x: (&'static str, bool),
    /// Name of the vertical axis.
    pub y: String,
    /// Smallest length of the vertical axis.
    pub least: f64,
    /// A line of text above the panel; none if it is empty.
    pub caption: String,
    pub lines: Vec<Line>,
    /// Height relative to the sum over all panels.
    pub share: f64,
}

impl Panel {
    /// A panel over time.
    pub(super) fn over_time(y: &str, lines: Vec<Line>) -> Self {
        Self { x: ("time", false), y: y.to_owned(), least: 0.0, caption: String::new(), lines, share: 1.0 }
    }

    /// The range of the vertical axis.
    pub(super) fn upright(&self) -> (f64, f64) {
        let values = self.lines.iter().flat_map(|line| &line.points).map(|point| point.1);
        let (low, high) = range(values, 0.06);
        let air = 0.5 * (self.least - (high - low)).max(0.0);
        (low - air, high + air)
    }

    /// Largest absolute value of the finite values.
    pub(super) fn size(&self) -> f64 {
        let values = self.lines.iter().flat_map(|line| &line.points).map(|point| point.1.abs());
        values.filter(|size| size.is_finite()).fold(0.0, f64::max)
    }

    /// Lines of the legend. A single line with the name of the axis needs no legend.
    fn named(&self) -> Vec<&Line> {
        let named: Vec<&Line> = self.lines.iter().filter(|line| !line.label.is_empty()).collect();
        let same = self.lines.len() == 1 && named.iter().all(|line| line.label == self.y);
        if same { vec![] } else { named }
    }
}

/// Heading of a picture: its subject, and the title of the run.
#[derive(Clone, Debug, Default)]
pub(super) struct Heading {
    pub what: String,
    pub run: String,
}

impl Heading {
    /// Height of the heading.
    pub(super) const HEIGHT: f64 = 56.0;

    /// A picture with the heading in its middle.
    pub(super) fn picture(&self, width: f64, height: f64) -> Picture {
        let mut picture = Picture::new(width, height);
        let lines = [(&self.what, TITLE, 26.0, BLACK), (&self.run, SUBTITLE, 45.0, GREY)];
        for (text, size, base, color) in lines {
            picture.text((width / 2.0, base), Anchor::Middle, size, color, &shortened(text, size, width - 20.0));
        }
        picture
    }
}

/// The figure, with the given height.
pub(super) fn draw(heading: &Heading, height: f64, panels: &[Panel]) -> Picture {
    let mut picture = heading.picture(WIDTH, height);
    let mut top = Heading::HEIGHT;
    let spans = |panel: &Panel| {
        let points = panel.lines.iter().flat_map(|line| &line.points);
        (range(points.map(|point| point.0), 0.0), panel.upright())
    };
    let shares: f64 = panels.iter().map(|panel| panel.share).sum();
    let captions = panels.iter().filter(|panel| !panel.caption.is_empty()).count() as f64 * 20.0;
    let between = 14.0 + TICK_LABELS;
    let free = height - top - captions - between * panels.len() as f64 - AXIS_NAME;
    let tall = |panel: &Panel| free * panel.share / shares;
    let ticks = |panel: &Panel| {
        let (x, y) = spans(panel);
        (Ticks::new(x, 10, panel.x.1), Ticks::new(y, ((tall(panel) / 30.0) as usize).clamp(1, 6), false))
    };
    // The widest tick labels and names set the margins of all panels.
    let left = panels.iter().map(|panel| Axes::left(&ticks(panel).1)).fold(0.0, f64::max);
    let names = panels.iter().flat_map(Panel::named).map(|line| width(&name(line), LABEL));
    let right = names.fold(0.0, f64::max) + 28.0;
    for (number, panel) in panels.iter().enumerate() {
        if !panel.caption.is_empty() {
            let caption = shortened(&panel.caption, LABEL, WIDTH - left - 10.0);
            picture.text((left, top + 12.0), Anchor::Start, LABEL, GREY, &caption);
            top += 20.0;
        }
        let (x, y) = spans(panel);
        let size = (WIDTH - left - right, tall(panel));
        let axes = Axes { corner: (left, top), size, x, y };
        let (level, upright) = ticks(panel);
        let last = number + 1 == panels.len();
        // Beside the name there must be room for a power of ten.
        let upright_name = shortened(&panel.y, LABEL, size.1 - 60.0);
        axes.draw(&mut picture, [&level, &upright], [if last { panel.x.0 } else { "" }, &upright_name], true);
        for line in &panel.lines {
            let thickness = if line.label.is_empty() { 0.8 } else { 1.8 };
            picture.line(thinned(&line.points).into_iter().map(|point| axes.place(point)), line.color, thickness);
        }
        legend(&mut picture, &axes, &panel.named());
        top += size.1 + between;
    }
    picture
}

fn name(line: &Line) -> String {
    shortened(&line.label, LABEL, LEGEND_WIDTH)
}

/// Draws each name at the end of its curve. Names that would overlap are moved apart.
fn legend(picture: &mut Picture, axes: &Axes, named: &[&Line]) {
    let end = |line: &&&Line| thinned(&line.points).last().map_or(axes.corner.1, |point| axes.place(*point).1);
    let mut ends: Vec<(f64, &Line)> = named.iter().map(|line| (end(&line), *line)).collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let heights = apart(ends.iter().map(|(height, _)| *height).collect(), axes.corner.1 + axes.size.1);
    for ((_, line), height) in ends.iter().zip(heights) {
        let at = (axes.corner.0 + axes.size.0 + 8.0, height + 0.35 * LABEL);
        picture.text(at, Anchor::Start, LABEL, line.color, &name(line));
    }
}

/// Moves ascending heights apart until lines of text fit between them. None lies below `lowest` as long as there is room above.
fn apart(mut heights: Vec<f64>, lowest: f64) -> Vec<f64> {
    for k in 1..heights.len() {
        heights[k] = heights[k].max(heights[k - 1] + LEGEND_LINE);
    }
    let mut below = lowest + LEGEND_LINE;
    for height in heights.iter_mut().rev() {
        *height = height.min(below - LEGEND_LINE);
        below = *height;
    }
    heights
}

/// The finite points, in their order. If they are many, only the lowest and the highest of each interval are kept: no peak is lost.
fn thinned(points: &[Point]) -> Vec<Point> {
    let drawable: Vec<_> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.abs() < 1e100).collect();
    if drawable.len() <= 2 * INTERVALS {
        return drawable;
    }
    let mut kept: Vec<Point> = Vec::with_capacity(2 * INTERVALS);
    for interval in drawable.chunks(drawable.len().div_ceil(INTERVALS)) {
        let by_height = |a: &&Point, b: &&Point| f64::total_cmp(&a.1, &b.1);
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
    use crate::output::plot::picture::Element;
    use crate::output::plot::png::texts;

    #[test]
    fn thinning_keeps_a_lone_peak_and_the_order() {
        let mut points: Vec<Point> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        points[77_777].1 = f64::NAN;
        let kept = thinned(&points);
        assert!(kept.len() <= 2 * INTERVALS && kept.contains(&(54_321.0, 7.0)));
        assert!(kept.is_sorted_by(|a, b| a.0 <= b.0) && kept.iter().all(|point| point.1.is_finite()));
    }

    #[test]
    fn names_that_would_cover_each_other_move_apart() {
        assert_eq!(apart(vec![10.0, 100.0, 103.0, 104.0, 300.0], 400.0), [10.0, 100.0, 117.0, 134.0, 300.0]);
        assert_eq!(apart(vec![10.0, 395.0, 398.0], 400.0), [10.0, 383.0, 400.0]);
        assert!(apart(vec![], 400.0).is_empty());
    }

    fn line(label: &str, high: f64) -> Line {
        Line::new(label, BLACK, vec![(0.0, 0.0), (1.0, high)])
    }

    #[test]
    fn a_name_cannot_break_the_picture() {
        let panel = Panel::over_time("<script>\"&", vec![line("</text><script>&", 1.0), line("x", 2.0)]);
        let svg = draw(&Heading { what: "<script>".into(), run: "\u{1}".into() }, 300.0, &[panel]).svg();
        assert!(!svg.contains("<script>") && svg.contains("&lt;script&gt;") && !svg.contains('\u{1}'), "{svg}");
    }

    /// Frames, as left and right ends of their upper sides.
    fn frames(picture: &Picture) -> Vec<(f64, f64)> {
        let corners = picture.elements.iter().filter_map(|element| match element {
            Element::Line { points, .. } if points.len() == 5 && points[0] == points[4] => {
                Some((points[0].0, points[2].0))
            }
            _ => None,
        });
        corners.collect()
    }

    #[test]
    fn panels_have_one_width_and_no_text_is_cut_or_covered() {
        let long = "W".repeat(60);
        let narrow =
            Panel { caption: long.clone(), share: 0.4, ..Panel::over_time("balance", vec![line("balance", 1e-7)]) };
        let wide = Panel::over_time(&long, vec![line(&long, 3e9), line("total − initial − external work", 3e9)]);
        let picture = draw(&Heading { what: long.clone(), run: long }, 400.0, &[wide, narrow]);
        let found = frames(&picture);
        assert!(found.len() == 2 && found[0] == found[1], "{found:?}");
        let (size, texts) = (picture.size, texts(&picture));
        assert!(texts.len() > 15, "{}", texts.len());
        for (k, (text, one)) in texts.iter().enumerate() {
            assert!(
                one.left >= 0.0 && one.top >= 0.0 && one.right <= size.0 && one.bottom <= size.1,
                "{text}: {one:?}"
            );
            let covered = texts[..k].iter().find(|(_, other)| one.covers(other));
            assert!(covered.is_none(), "{text} covers {covered:?}");
        }
    }
}
