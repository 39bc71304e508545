//! The particles of a snapshot over the background grid, coloured by a field.

use super::chart::{LABEL, TITLE, range, rounded, tick};
use super::palette::{BLUE, viridis};
use super::{PlotError, draw_error};
use crate::output::vtu::{Array, Snapshot, Values};
use plotters::prelude::*;

/// The longer side of the drawing of the box, and the least the shorter one may have.
const SIDE: (f64, f64) = (760.0, 160.0);

/// Width of the labels at the left, height of those below and of the title, width of the colour bar.
const MARGINS: (u32, u32, u32, u32) = (76, 52, 40, 150);

/// Grid lines beyond so many along an axis would be a grey area.
const MAX_LINES: u32 = 200;

/// More particles than this are drawn in part, evenly thinned.
const MAX_DRAWN: usize = 50_000;

/// The picture as SVG, with the axes `view` to the right and up; colours span `extremes`, or those there are.
///
/// In one dimension the field is drawn over x. The field is the first of the snapshot that is not the body: in one dimension its
/// first component, otherwise the length of a vector, the Frobenius norm of a tensor.
pub(super) fn draw(
    name: &'static str,
    snapshot: &Snapshot,
    view: [usize; 2],
    extremes: Option<(f64, f64)>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    draw_on(&mut svg, snapshot, view, extremes).map_err(|error| draw_error(name)(&*error))?;
    Ok(svg)
}

/// The least and the largest value of the field that is drawn; those of none are ∞ and −∞.
pub(super) fn extremes(snapshot: &Snapshot) -> (f64, f64) {
    let values = colouring(snapshot).map(|(_, values)| values).unwrap_or_default();
    let finite = values.into_iter().filter(|x| x.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The name of a field, and one number a particle.
fn colouring(snapshot: &Snapshot) -> Option<(String, Vec<f64>)> {
    fn float(array: &Array) -> Option<(String, &[String], Vec<f64>)> {
        match &array.values {
            Values::Float(values) => Some((array.name.replace('_', " "), &array.components, values.clone())),
            Values::Index(_) => None,
        }
    }
    let (name, components, values) = snapshot.arrays.iter().find_map(float)?;
    let (width, component) = (components.len(), components.first()?);
    // The off-diagonal components of a symmetric tensor count twice.
    let weight = |k: usize| if width == 6 && k >= 3 { 2.0 } else { 1.0 };
    let size = |tuple: &[f64]| tuple.iter().enumerate().map(|(k, x)| weight(k) * x * x).sum::<f64>().sqrt();
    match width {
        1 => Some((name, values)),
        _ if snapshot.background.dimension == 1 => Some((
            format!("{name} {component}"),
            values.chunks(width).filter_map(|tuple| tuple.first().copied()).collect(),
        )),
        _ => Some((format!("|{name}|"), values.chunks(width).map(size).collect())),
    }
}

fn draw_on(
    svg: &mut String,
    snapshot: &Snapshot,
    [right, up]: [usize; 2],
    span: Option<(f64, f64)>,
) -> Result<(), Box<dyn std::error::Error>> {
    let background = &snapshot.background;
    let colouring = colouring(snapshot);
    let values = |p: usize| colouring.as_ref().and_then(|(_, values)| values.get(p).copied());
    let span = span.unwrap_or_else(|| extremes(snapshot));
    let (low, high) = range([span.0, span.1].into_iter(), 0.0);
    let label = colouring.as_ref().map_or("", |(name, _)| name);

    // In one dimension the field itself goes up.
    let up = (background.dimension > 1).then_some(up);
    let extent = |axis: usize| {
        let start = background.origin[axis];
        (start, start + background.spacing * f64::from(background.cells[axis]))
    };
    let (mut x, mut y) = (extent(right), up.map_or_else(|| range([low, high].into_iter(), 0.05), extent));
    let scale = match up {
        Some(_) => SIDE.0 / (x.1 - x.0).max(y.1 - y.0),
        None => SIDE.0 / (x.1 - x.0),
    };
    // A slender box gets air on both sides rather than another scale.
    let widened = |range: (f64, f64)| {
        let length = (range.1 - range.0) * scale;
        let air = 0.5 * (SIDE.1 - length).max(0.0) / scale;
        ((range.0 - air, range.1 + air), length.max(SIDE.1))
    };
    let (width, height);
    (x, width) = widened(x);
    (y, height) = if up.is_some() { widened(y) } else { (y, SIDE.0 / 2.0) };
    let (left, below, above, bar) = MARGINS;
    let size = (left + width as u32 + 20 + bar, above + height as u32 + below + 10);

    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let stride = snapshot.points.len().div_ceil(MAX_DRAWN).max(1);
    let part = if stride > 1 { format!(", one particle in {stride}") } else { String::new() };
    let rest = root.titled(&format!("t = {}{part}", rounded(snapshot.time)), TITLE)?;
    let (main, side) = rest.split_horizontally(left + width as u32 + 20);

    let mut chart = ChartBuilder::on(&main)
        .margin_right(20)
        .margin_top(10)
        .margin_left(6)
        .x_label_area_size(below)
        .y_label_area_size(left - 6)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    // Over the background grid, lines at the labels would only confuse.
    let grey = BLACK.mix(0.15);
    let mesh = if up.is_some() { TRANSPARENT } else { grey };
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(mesh)
        .x_desc(["x", "y", "z"][right])
        .y_desc(up.map_or(label, |axis| ["x", "y", "z"][axis]))
        .label_style(LABEL)
        .axis_desc_style(LABEL)
        .x_label_formatter(&|at| tick(*at, x))
        .y_label_formatter(&|at| tick(*at, y))
        .draw()?;
    if let Some(up) = up {
        let (wide, tall) = (extent(right), extent(up));
        let node = |axis: usize, k: u32| background.origin[axis] + background.spacing * f64::from(k);
        if background.cells[right] <= MAX_LINES && background.cells[up] <= MAX_LINES {
            let upright = (0..=background.cells[right]).map(|k| [(node(right, k), tall.0), (node(right, k), tall.1)]);
            let level = (0..=background.cells[up]).map(|k| [(wide.0, node(up, k)), (wide.1, node(up, k))]);
            chart.draw_series(upright.chain(level).map(|line| PathElement::new(line, grey)))?;
        }
    }
    let least = if up.is_some() { 1.5 } else { 3.0 };
    let radius = (0.22 * background.spacing * scale).clamp(least, 6.0) as i32;
    // The nearest to the eye last: to the right × up = towards it.
    let mut order: Vec<usize> = (0..snapshot.points.len()).step_by(stride).collect();
    if let (Some(up), 3) = (up, background.dimension) {
        let axis = 3 - right - up;
        let sign = if up == right + 1 { 1.0 } else { -1.0 };
        order.sort_by(|&a, &b| f64::total_cmp(&(sign * snapshot.points[a][axis]), &(sign * snapshot.points[b][axis])));
    }
    let dots = order.into_iter().filter_map(|p| {
        let point = &snapshot.points[p];
        let value = values(p);
        let color = value.map_or(BLUE, |value| viridis((value - low) / (high - low)));
        let upright = up.map_or(value, |axis| Some(point[axis]))?;
        (point[right].is_finite() && upright.is_finite())
            .then(|| Circle::new((point[right], upright), radius, color.filled()))
    });
    chart.draw_series(dots)?;

    if up.is_some() && colouring.is_some() {
        let mut chart = ChartBuilder::on(&side)
            .margin_top(10)
            .margin_bottom(below)
            .margin_right(24)
            .right_y_label_area_size(98)
            .build_cartesian_2d(0.0..1.0, low..high)?;
        let steps = 128;
        let at = |k: i32| low + (high - low) * f64::from(k) / f64::from(steps);
        chart.draw_series((0..steps).map(|k| {
            let color = viridis((f64::from(k) + 0.5) / f64::from(steps));
            Rectangle::new([(0.0, at(k)), (1.0, at(k + 1))], color.filled())
        }))?;
        chart
            .configure_mesh()
            .disable_mesh()
            .disable_x_axis()
            .y_desc(label)
            .label_style(LABEL)
            .axis_desc_style(LABEL)
            .y_label_formatter(&|at| tick(*at, (low, high)))
            .draw()?;
    }
    root.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::vtu::Background;

    /// Two particles in a box of 2 cells along each axis, with a scalar.
    fn snapshot(dimension: u32, values: [f64; 2]) -> Snapshot {
        let array =
            Array { name: "von_mises".into(), components: vec!["".into()], values: Values::Float(values.into()) };
        let background = Background { dimension, origin: [0.0; 3], spacing: 1.0, cells: [2; 3] };
        Snapshot { time: 0.0, background, points: vec![[0.5, 0.5, 0.25], [1.5, 0.5, 1.75]], arrays: vec![array] }
    }

    #[test]
    fn colours_of_a_movie_are_not_widened_by_a_frame_in_which_nothing_varies() {
        assert_eq!(extremes(&snapshot(2, [3.0, 3.0])), (3.0, 3.0));
        assert_eq!(extremes(&snapshot(2, [f64::NAN, 3.0])), (3.0, 3.0));
    }

    #[test]
    fn a_body_is_drawn_on_the_plane_of_its_motion() -> Result<(), PlotError> {
        let drawn = |view| draw("particles", &snapshot(3, [0.0, 1.0]), view, None);
        // Seen along y, the particles are at other heights; seen along z, at the same.
        let heights = |svg: &str| {
            let circles =
                svg.split("<circle ").skip(1).filter_map(|circle| circle.split("cy=\"").nth(1)?.split('"').next());
            circles.map(str::to_owned).collect::<Vec<_>>()
        };
        let (level, upright) = (heights(&drawn([0, 1])?), heights(&drawn([0, 2])?));
        assert!(level.len() == 2 && level[0] == level[1] && upright[0] != upright[1], "{level:?} {upright:?}");
        Ok(())
    }
}
