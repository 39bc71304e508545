//! The particles of a snapshot over the background grid, coloured by a field.

use super::axes::{AXIS_NAME, Axes, LABEL, TICK_LABELS, Ticks, extremes, range};
use super::box_edges::{self, corner};
use super::chart::Heading;
use super::colouring::Colouring;
use super::facets::Facets;
use super::font::width;
use super::neighbours::Neighbours;
use super::palette::{BLACK, BLUE, GREY, LIGHT, viridis};
use super::picture::{Anchor, Color, Picture};
use super::segments;
use super::view::Directions;
use crate::output::history::AXES;
use crate::output::moved_outlines::MAX_CELLS;
use crate::output::vtu::Snapshot;
use crate::tensor::Vector;

/// Largest width of the drawing.
const MAX_WIDTH: f64 = 760.0;

/// Largest height of the drawing.
const MAX_HEIGHT: f64 = 620.0;

/// Height below the drawing, for tick labels and the name of the axis.
const BELOW: f64 = TICK_LABELS + AXIS_NAME + 8.0;

/// Smallest width and height of the drawing.
const MIN_SIZE: f64 = 160.0;

/// Largest number of grid lines along an axis. More grid lines would be a grey area.
const MAX_LINES: f64 = 100.0;

/// Largest number of particles that are drawn. Of more particles, an even sample is drawn.
const MAX_DRAWN: usize = 50_000;

/// Obstacles in space are drawn up to this distance from the box around the particles, relative to the longest edge of the box. The least
/// distance is a cell.
const MARGIN: f64 = 0.25;

/// Radius of a disc over the distance of neighbours. The disc has the area of a square of the lattice.
const RADIUS: f64 = 0.56;

/// Settings that all pictures of a run have in common.
pub(super) struct Scene {
    /// Direction of sight.
    pub directions: Directions,
    /// Lower and upper corner of the box around all particles at all times.
    pub bounds: [[f64; 3]; 2],
    /// The range of the colours.
    pub span: (f64, f64),
    /// Title of the run.
    pub run: String,
}

/// The surfaces beside the particles, at the same time.
#[derive(Default)]
pub(super) struct Surfaces {
    /// The surfaces of obstacles.
    pub obstacles: Option<Snapshot>,
    /// The outlines of bodies in the plane.
    pub bodies: Option<Snapshot>,
}

/// A picture under construction: the particles `ids` of a snapshot.
struct Frame<'a> {
    snapshot: &'a Snapshot,
    scene: &'a Scene,
    colouring: Option<&'a Colouring>,
    ids: Vec<usize>,
}

/// The picture as SVG. In one dimension the field is drawn over x.
pub(super) fn draw(snapshot: &Snapshot, surfaces: &Surfaces, scene: &Scene, colouring: Option<&Colouring>) -> Picture {
    let span = range([scene.span.0, scene.span.1].into_iter(), 0.0);
    let label = colouring.map_or("particles", |one| &one.label);
    let stride = snapshot.points.len().div_ceil(MAX_DRAWN).max(1);
    let part = if stride > 1 { format!(", one particle in {stride}") } else { String::new() };
    let first = label.chars().next().map(|letter| letter.to_uppercase().to_string()).unwrap_or_default();
    let rest: String = label.chars().skip(1).collect();
    let what = format!("{first}{rest}, t = {}{part}", super::axes::rounded(snapshot.time));
    let heading = Heading { what, run: scene.run.clone() };
    let frame = Frame { snapshot, scene, colouring, ids: (0..snapshot.points.len()).step_by(stride).collect() };
    if snapshot.background.dimension == 1 {
        return frame.over_x(&heading);
    }
    let (mut x, mut y) = scene.window(snapshot);
    let scale = (MAX_WIDTH / (x.1 - x.0)).min(MAX_HEIGHT / (y.1 - y.0));
    let size = (widened(&mut x, scale), widened(&mut y, scale));
    let flat = scene.directions.plane();
    let ticks = [Ticks::new(x, (size.0 / 80.0) as usize, false), Ticks::new(y, (size.1 / 60.0) as usize, false)];
    let left = if flat.is_some() { Axes::left(&ticks[1]) } else { 50.0 };
    let bar = Ticks::new(span, (size.1 / 60.0) as usize, false);
    let beside = if colouring.is_some() { 24.0 + 16.0 + 10.0 + bar.width() + 2.0 * LABEL + 8.0 } else { 20.0 };
    let wide = left + size.0 + beside;
    let mut picture = heading.picture(wide, Heading::HEIGHT + size.1 + BELOW);
    let axes = Axes { corner: (left, Heading::HEIGHT), size, x, y };
    let mut labels = Vec::new();
    match flat {
        Some([right, up]) => {
            grid(&mut picture, snapshot, &axes, [right, up], scale);
            axes.draw(&mut picture, [&ticks[0], &ticks[1]], [AXES[right], AXES[up]], false);
        }
        None => labels = box_edges::draw(&mut picture, &scene.directions, scene.bounds, &axes),
    }
    match (&surfaces.obstacles, flat) {
        (Some(obstacles), _) if obstacles.corners == 3 => frame.in_space(&mut picture, &axes, span, Some(obstacles)),
        (Some(obstacles), Some(plane)) if obstacles.corners == 2 => {
            frame.bodies(&mut picture, &axes, span, surfaces.bodies.as_ref());
            segments::draw(&mut picture, obstacles, &axes, plane);
        }
        _ => frame.bodies(&mut picture, &axes, span, surfaces.bodies.as_ref()),
    }
    // Obstacles may lie under the labels of the box.
    labels.iter().for_each(|label| label.draw(&mut picture));
    if colouring.is_some() {
        colour_bar(&mut picture, &axes, span, &bar, label);
    }
    picture
}

/// Widens a range to the smallest size of a drawing. Returns its length in the picture.
fn widened(range: &mut (f64, f64), scale: f64) -> f64 {
    let length = (range.1 - range.0) * scale;
    let air = 0.5 * (MIN_SIZE - length).max(0.0) / scale;
    *range = (range.0 - air, range.1 + air);
    length.max(MIN_SIZE)
}

impl Scene {
    /// The part of space whose obstacles are drawn, by its lower and upper corner: the box around all particles and [`MARGIN`] around it.
    fn around(&self, snapshot: &Snapshot) -> [[f64; 3]; 2] {
        let [low, high] = self.bounds;
        let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let margin = snapshot.background.spacing.max(MARGIN * longest);
        [low.map(|x| x - margin), high.map(|x| x + margin)]
    }

    /// Horizontal and vertical extent of the picture: the box and one cell around it. In a plane, the extent ends at the grid.
    fn window(&self, snapshot: &Snapshot) -> ((f64, f64), (f64, f64)) {
        let grid = &snapshot.background;
        let corners = || (0..8).map(|number| self.directions.project(corner(self.bounds, number)));
        let (x, y) = (extremes(corners().map(|corner| corner.0)), extremes(corners().map(|corner| corner.1)));
        let plane = self.directions.plane();
        // Discs at a wall reach beyond the grid.
        let beyond = if grid.dimension == 3 { 0.5 * grid.spacing } else { 0.0 };
        let wider = |(low, high): (f64, f64), place: usize| {
            let around = (low - grid.spacing, high + grid.spacing);
            let Some(axis) = plane.map(|plane| plane[place]) else { return around };
            let start = grid.origin[axis] - beyond;
            let end = grid.origin[axis] + grid.spacing * f64::from(grid.cells[axis]) + beyond;
            (around.0.max(start).min(low), around.1.min(end).max(high))
        };
        (wider(x, 0), wider(y, 1))
    }
}

/// Draws the grid lines, unless they would be a grey area.
fn grid(picture: &mut Picture, snapshot: &Snapshot, axes: &Axes, plane: [usize; 2], scale: f64) {
    let (spacing, origin) = (snapshot.background.spacing, snapshot.background.origin);
    if axes.size.0.max(axes.size.1) / (spacing * scale) > MAX_LINES {
        return;
    }
    let inside = |(low, high): (f64, f64), axis: usize| {
        let cell = move |x: f64| (x - origin[axis]) / spacing;
        let (first, last) = ((cell(low) - 1e-9).ceil().max(0.0), (cell(high) + 1e-9).floor());
        let last = last.min(f64::from(snapshot.background.cells[axis]));
        (first as i64..=last as i64).map(move |k| origin[axis] + spacing * k as f64)
    };
    for x in inside(axes.x, plane[0]) {
        picture.line([axes.place((x, axes.y.0)), axes.place((x, axes.y.1))], LIGHT, 0.8);
    }
    for y in inside(axes.y, plane[1]) {
        picture.line([axes.place((axes.x.0, y)), axes.place((axes.x.1, y))], LIGHT, 0.8);
    }
}

impl Frame<'_> {
    /// The value that colours a particle.
    fn value(&self, p: usize) -> Option<f64> {
        self.colouring?.values.get(p).copied()
    }

    /// The colour of a particle, for a range of values.
    fn color(&self, p: usize, (low, high): (f64, f64)) -> Color {
        self.value(p).map_or(BLUE, |value| viridis((value - low) / (high - low)))
    }

    /// Draws the particles of a plane: cells, cut by the outlines of the bodies if there are any. More particles than [`MAX_CELLS`] are discs.
    fn bodies(&self, picture: &mut Picture, axes: &Axes, span: (f64, f64), outlines: Option<&Snapshot>) {
        let Self { snapshot, scene: Scene { directions, .. }, ids, .. } = self;
        let in_plane = snapshot.background.dimension == 2 && directions.plane() == Some([0, 1]);
        if !in_plane || ids.len() > MAX_CELLS {
            self.in_space(picture, axes, span, None);
            return;
        }
        let neighbours = Neighbours::new(snapshot, ids);
        let finite = |p: &&usize| snapshot.points[**p].iter().all(|x| x.is_finite());
        let place = |corner: Vector<f64, 2>| axes.place((corner[0], corner[1]));
        let Some(outlines) = outlines else {
            for &p in ids.iter().filter(finite) {
                picture.polygon(neighbours.cell(p).into_iter().map(place), self.color(p, span));
            }
            return;
        };
        let lines = segments::closed_lines(outlines, axes);
        picture.inside(lines.clone(), |picture| {
            for &p in ids.iter().filter(finite) {
                picture.polygon(neighbours.wide_cell(p).into_iter().map(place), self.color(p, span));
            }
        });
        for line in &lines {
            picture.line(line.iter().chain(line.first()).copied(), BLACK, 0.6);
        }
    }

    /// Draws the particles as discs, and the facets of obstacles between those that the obstacles hide and those that they do not. The disc
    /// nearest to the eye is drawn last.
    fn in_space(&self, picture: &mut Picture, axes: &Axes, span: (f64, f64), obstacles: Option<&Snapshot>) {
        let Self { snapshot, scene, ids, .. } = self;
        let directions = &scene.directions;
        let neighbours = Neighbours::new(snapshot, ids);
        let finite = |p: &usize| snapshot.points[*p].iter().all(|x| x.is_finite());
        let depth = |p: &usize| directions.depth(snapshot.points[*p]);
        let mut order: Vec<usize> = ids.iter().copied().filter(finite).collect();
        order.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let scale = axes.size.0 / (axes.x.1 - axes.x.0);
        let disc = |picture: &mut Picture, p: usize| {
            let at = axes.place(directions.project(snapshot.points[p]));
            let color = self.color(p, span);
            let rim = if snapshot.background.dimension == 3 { GREY } else { color };
            picture.disc(at, (RADIUS * neighbours.diameter(p) * scale).max(0.7), color, rim);
        };
        let facets = obstacles.map(|obstacles| Facets::new(obstacles, directions, scene.around(snapshot)));
        let hides = |p: &usize| facets.as_ref().is_some_and(|facets| facets.hide(snapshot.points[*p]));
        let (hidden, seen): (Vec<usize>, Vec<usize>) = order.into_iter().partition(hides);
        hidden.into_iter().for_each(|p| disc(picture, p));
        if let Some(facets) = facets {
            let (left, right, below, above) = (axes.x.0, axes.x.1, axes.y.0, axes.y.1);
            let drawing = [(left, below), (right, below), (right, above), (left, above)].map(|at| axes.place(at));
            picture.inside(vec![drawing.to_vec()], |picture| facets.draw(picture, axes));
        }
        seen.into_iter().for_each(|p| disc(picture, p));
    }

    /// The picture in one dimension: the field over x.
    fn over_x(&self, heading: &Heading) -> Picture {
        let (x, _) = self.scene.window(self.snapshot);
        let y = range([self.scene.span.0, self.scene.span.1].into_iter(), 0.05);
        let ticks = [Ticks::new(x, 10, false), Ticks::new(y, 7, false)];
        let (left, size) = (Axes::left(&ticks[1]), (MAX_WIDTH, MAX_WIDTH / 2.0));
        let mut picture = heading.picture(left + size.0 + 24.0, Heading::HEIGHT + size.1 + BELOW);
        let axes = Axes { corner: (left, Heading::HEIGHT), size, x, y };
        let label = self.colouring.map_or("", |one| &one.label);
        axes.draw(&mut picture, [&ticks[0], &ticks[1]], ["x", label], true);
        for &p in &self.ids {
            let at = (self.snapshot.points[p][0], self.value(p).unwrap_or(0.0));
            if at.0.is_finite() && at.1.is_finite() {
                picture.disc(axes.place(at), 2.5, BLUE, BLUE);
            }
        }
        picture
    }
}

/// Draws the colour bar at the right of the drawing.
fn colour_bar(picture: &mut Picture, axes: &Axes, (low, high): (f64, f64), ticks: &Ticks, label: &str) {
    const STEPS: usize = 128;
    let (left, top, tall) = (axes.corner.0 + axes.size.0 + 24.0, axes.corner.1, axes.size.1);
    let height = |part: f64| top + tall * (1.0 - part);
    for k in 0..STEPS {
        let (from, to) = (k as f64 / STEPS as f64, (k + 1) as f64 / STEPS as f64);
        let corners =
            [(left, height(from)), (left + 16.0, height(from)), (left + 16.0, height(to)), (left, height(to))];
        picture.polygon(corners, viridis((from + to) / 2.0));
    }
    for &at in &ticks.at {
        let y = height((at - low) / (high - low));
        picture.line([(left + 16.0, y), (left + 21.0, y)], GREY, 1.0);
        picture.text((left + 25.0, y + 0.35 * LABEL), Anchor::Start, LABEL, BLACK, &ticks.label(at));
    }
    let at = (left + 25.0 + ticks.width() + 20.0, top + tall / 2.0);
    let name = ticks.name(label);
    // A name longer than the bar is left out, because the heading has it.
    let name = if width(&name, LABEL) > tall { ticks.name("") } else { name };
    picture.text(at, Anchor::Upright, LABEL, BLACK, &name);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::OutputError;
    use crate::output::plot::png::texts;
    use crate::output::plot::view::View;
    use crate::output::vtu::{Array, Background};

    /// A lattice of particles in a grid of 4 cells along each axis, with the origin `from` on each axis. The stress grows with the number
    /// of the particle.
    fn lattice(dimension: u32, from: f64) -> Snapshot {
        let count = 4_usize.pow(dimension);
        let place = |p: usize| {
            let axis = |k: u32| if k < dimension { from + 0.75 + 0.5 * (p / 4_usize.pow(k) % 4) as f64 } else { 0.0 };
            [axis(0), axis(1), axis(2)]
        };
        let values = (0..count).map(|p| 1e7 * p as f64).collect();
        let array = Array { name: "von_mises".into(), components: vec!["".into()], values, is_index: false };
        let background = Background { dimension, origin: [from; 3], spacing: 1.0, cells: [4; 3] };
        Snapshot {
            time: 0.1 + 0.2,
            background,
            points: (0..count).map(place).collect(),
            arrays: vec![array],
            corners: 1,
        }
    }

    fn picture(snapshot: &Snapshot, view: Option<View>) -> Result<Picture, OutputError> {
        let colouring = Colouring::chosen(snapshot, None)?;
        let end = |start: f64, pick: fn(f64, f64) -> f64| -> [f64; 3] {
            std::array::from_fn(|axis| snapshot.points.iter().map(|x| x[axis]).fold(start, pick))
        };
        let scene = Scene {
            directions: Directions::new(view, snapshot.background.dimension, [0, 1]),
            bounds: [end(f64::INFINITY, f64::min), end(f64::NEG_INFINITY, f64::max)],
            span: colouring.as_ref().map_or((0.0, 1.0), Colouring::extremes),
            run: "A scene with a title".into(),
        };
        Ok(draw(snapshot, &Surfaces::default(), &scene, colouring.as_ref()))
    }

    #[test]
    fn no_text_of_a_picture_is_cut_or_covers_another() -> Result<(), OutputError> {
        let views = ["xy", "zy", "30,20", "-60,35", "xz,120,-40"].map(|view| view.parse().ok());
        for (dimension, view, from) in [(1, None, 0.0), (2, None, -1e4), (3, None, 0.0)]
            .into_iter()
            .chain(views.into_iter().map(|view| (3, view, 100.0)))
        {
            let picture = picture(&lattice(dimension, from), view)?;
            let (size, texts) = (picture.size, texts(&picture));
            assert!(texts.len() > 8 && texts.iter().any(|(text, _)| text == "Von Mises stress, t = 0.3"), "{texts:?}");
            for (k, (text, one)) in texts.iter().enumerate() {
                let inside = one.left >= 0.0 && one.top >= 0.0 && one.right <= size.0 && one.bottom <= size.1;
                assert!(inside, "{dimension}, {view:?}: {text}: {one:?} in {size:?}");
                let covered = texts[..k].iter().find(|(_, other)| one.covers(other));
                assert!(covered.is_none(), "{dimension}, {view:?}: {text} covers {covered:?}");
            }
        }
        Ok(())
    }

    #[test]
    fn a_body_in_the_plane_is_filled_with_cells_and_one_in_space_with_discs() -> Result<(), OutputError> {
        let count = |svg: &str, kind: &str| svg.matches(kind).count();
        let (plane, space) = (picture(&lattice(2, 0.0), None)?.svg(), picture(&lattice(3, 0.0), None)?.svg());
        // The colour bar has 128 polygons.
        assert_eq!((count(&plane, "<polygon"), count(&plane, "<circle")), (16 + 128, 0));
        assert_eq!((count(&space, "<polygon"), count(&space, "<circle")), (128, 64));
        Ok(())
    }

    #[test]
    fn colours_of_a_movie_are_not_widened_by_a_frame_in_which_nothing_varies() {
        let extremes = |values: &[f64]| Colouring { label: String::new(), values: values.to_vec() }.extremes();
        assert_eq!((extremes(&[3.0, 3.0]), extremes(&[f64::NAN, 3.0])), ((3.0, 3.0), (3.0, 3.0)));
    }
}
