//! The edges of the box around the particles in space, and their labels.

use super::axes::{Axes, LABEL, Ticks};
use super::font::width;
use super::palette::{BLACK, GREY, LIGHT};
use super::picture::{Anchor, Color, Picture, Point};
use super::view::Directions;
use crate::output::history::AXES;

/// A corner of the box, numbered from 0 to 7.
pub(super) fn corner(bounds: [[f64; 3]; 2], number: usize) -> [f64; 3] {
    std::array::from_fn(|k| bounds[number >> k & 1][k])
}

/// Draws the edges of the box behind the particles. Returns labels along one edge of each axis at the outline.
pub(super) fn draw(picture: &mut Picture, directions: &Directions, bounds: [[f64; 3]; 2], axes: &Axes) -> Vec<Label> {
    let place = |number: usize| axes.place(directions.project(corner(bounds, number)));
    let depth = |number: usize| directions.depth(corner(bounds, number));
    let nearest = (0..8).max_by(|&a, &b| depth(a).total_cmp(&depth(b)));
    let (mut names, mut numbers) = (Vec::new(), Vec::new());
    for (axis, name) in AXES.into_iter().enumerate() {
        let starts = || (0..8).filter(|number| number >> axis & 1 == 0);
        let end = |start: usize| start | 1 << axis;
        for start in starts().filter(|&start| Some(start) != nearest && Some(end(start)) != nearest) {
            picture.line([place(start), place(end(start))], LIGHT, 1.0);
        }
        // The lowest of the edges that run horizontally, the leftmost of the edges that run vertically.
        let run = |start: usize| (place(end(start)).0 - place(start).0, place(end(start)).1 - place(start).1);
        let left = run(0).1.abs() > run(0).0.abs();
        let outward = |start: &usize| {
            let (a, b) = (place(*start), place(end(*start)));
            if left { -(a.0 + b.0) } else { a.1 + b.1 }
        };
        let Some(start) = starts().max_by(|a, b| outward(a).total_cmp(&outward(b))) else { continue };
        let (from, to) = (place(start), place(end(start)));
        picture.line([from, to], GREY, 1.0);
        let ends = (bounds[0][axis], bounds[1][axis]);
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let ticks = Ticks::new(ends, ((length / 45.0) as usize).max(2), false);
        let at = |part: f64| (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
        let far = if left { ticks.width() + 12.0 } else { 24.0 };
        names.push(Label { point: at(0.5), left, far, color: BLACK, text: ticks.name(name) });
        numbers.extend(ticks.at.iter().map(|&x| {
            let point = at((x - ends.0) / (ends.1 - ends.0));
            Label { point, left, far: 5.0, color: GREY, text: ticks.label(x) }
        }));
    }
    // Where edges meet, labels may overlap. A label that would cover another label is left out.
    let mut drawn: Vec<Label> = Vec::new();
    for text in names.into_iter().chain(numbers) {
        if drawn.iter().all(|other| !text.covers(other)) {
            drawn.push(text);
        }
    }
    drawn
}

/// A text below a point, or at its left, at the distance `far`.
pub(super) struct Label {
    point: Point,
    left: bool,
    far: f64,
    color: Color,
    text: String,
}

impl Label {
    /// Left, right, upper and lower end of the text, with the space between lines.
    fn extent(&self) -> [f64; 4] {
        let ((x, y), wide) = (self.point, width(&self.text, LABEL));
        match self.left {
            true => [x - self.far - wide, x - self.far, y - 0.8 * LABEL, y + 0.8 * LABEL],
            false => [x - wide / 2.0, x + wide / 2.0, y + self.far - 4.0, y + self.far + LABEL + 2.0],
        }
    }

    fn covers(&self, other: &Self) -> bool {
        let ([a, b, c, d], [e, f, g, h]) = (self.extent(), other.extent());
        a < f + 3.0 && e < b + 3.0 && c < h && g < d
    }

    /// Draws the text.
    pub(super) fn draw(&self, picture: &mut Picture) {
        let (x, y) = self.point;
        match self.left {
            true => picture.text((x - self.far, y + 0.35 * LABEL), Anchor::End, LABEL, self.color, &self.text),
            false => picture.text((x, y + self.far + 10.0), Anchor::Middle, LABEL, self.color, &self.text),
        }
    }
}
