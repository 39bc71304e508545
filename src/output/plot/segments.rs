//! Segments in the plane: outlines of obstacles and of bodies.

use super::axes::Axes;
use super::palette::BLACK;
use super::picture::{Picture, Point};
use crate::output::vtu::Snapshot;

/// Draws the segments of obstacles in the plane, clipped to the drawing.
pub(super) fn draw(picture: &mut Picture, obstacles: &Snapshot, axes: &Axes, [right, up]: [usize; 2]) {
    for ends in obstacles.points.chunks_exact(2) {
        let at = |end: [f64; 3]| [end[right], end[up]];
        if let Some(inside) = clipped([at(ends[0]), at(ends[1])], [axes.x, axes.y]) {
            picture.line(inside.map(|[x, y]| axes.place((x, y))), BLACK, 1.6);
        }
    }
}

/// The closed lines of outlines of bodies, in the picture. The segments of a line follow each other.
pub(super) fn closed_lines(outlines: &Snapshot, axes: &Axes) -> Vec<Vec<Point>> {
    let mut lines: Vec<Vec<Point>> = Vec::new();
    let mut end = None;
    for [from, to] in outlines.points.as_chunks().0 {
        if end != Some(from) {
            lines.push(Vec::new());
        }
        lines.last_mut().into_iter().for_each(|line| line.push(axes.place((from[0], from[1]))));
        end = Some(to);
    }
    lines
}

/// The part of a segment in a rectangle, if any (Liang and Barsky, 1984).
fn clipped([start, end]: [[f64; 2]; 2], ranges: [(f64, f64); 2]) -> Option<[[f64; 2]; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (k, (low, high)) in ranges.into_iter().enumerate() {
        let along = end[k] - start[k];
        if along == 0.0 {
            if start[k] < low || start[k] > high {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - start[k]) / along, (high - start[k]) / along);
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    let at = |share: f64| [0, 1].map(|k| start[k] + share * (end[k] - start[k]));
    (first < last).then(|| [at(first), at(last)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_end_at_the_drawing() {
        let square = [(0.0, 2.0), (0.0, 1.0)];
        assert_eq!(clipped([[-1.0, 0.5], [3.0, 0.5]], square), Some([[0.0, 0.5], [2.0, 0.5]]));
        assert_eq!(clipped([[1.0, -1.0], [1.0, 0.5]], square), Some([[1.0, 0.0], [1.0, 0.5]]));
        assert_eq!(clipped([[0.5, 0.25], [1.0, 0.5]], square), Some([[0.5, 0.25], [1.0, 0.5]]));
        assert_eq!(clipped([[-1.0, 0.5], [1.0, 2.5]], square), None);
        assert_eq!(clipped([[-1.0, 2.0], [3.0, 2.0]], square), None);
    }
}
