//! Pictures as PNG.

use super::font;
use super::picture::{Anchor, Color, Element, Picture, Point, Text};
use crate::output::OutputError;
use tiny_skia::{FillRule, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, PixmapPaint, Stroke, Transform};

/// Pixels per unit of a picture.
const SCALE: f32 = 2.0;

impl Picture {
    /// The content of a PNG file, at two pixels per unit on white. `name` names the picture in an error.
    ///
    /// # Errors
    /// The picture has no pixels, or more than fit into memory.
    pub(crate) fn png(&self, name: &'static str) -> Result<Vec<u8>, OutputError> {
        let fail = |reason: String| OutputError::Draw { name, reason };
        let (width, height) = self.size;
        let pixels = |length: f64| (length.round() as f32 * SCALE) as u32;
        let (width, height) = (pixels(width), pixels(height));
        let pixmap = Pixmap::new(width, height).ok_or_else(|| fail(format!("{width} x {height} pixels")))?;
        let mut canvas = Canvas { pixmap, mask: None };
        canvas.pixmap.fill(tiny_skia::Color::WHITE);
        canvas.draw(&self.elements);
        canvas.pixmap.encode_png().map_err(|error| fail(error.to_string()))
    }
}

/// The pixels, and the part of them that may be changed.
struct Canvas {
    pixmap: Pixmap,
    mask: Option<Mask>,
}

impl Canvas {
    fn draw(&mut self, elements: &[Element]) {
        for element in elements {
            match element {
                Element::Line { points, color, width } => self.stroke(polyline(points, false), *color, *width),
                Element::Polygon { points, color } => {
                    self.fill(polyline(points, true), *color);
                    self.stroke(polyline(points, true), *color, Picture::RIM);
                }
                Element::Disc { center: (x, y), radius, color, rim } => {
                    let circle = || PathBuilder::from_circle(*x as f32, *y as f32, *radius as f32);
                    self.fill(circle(), *color);
                    self.stroke(circle(), *rim, Picture::DISC_RIM);
                }
                Element::Text(text) => self.fill(letters(text), text.color),
                Element::Inside { lines, elements } => self.inside(lines, elements),
                Element::Translucent { opacity, elements } => self.translucent(*opacity, elements),
            }
        }
    }

    fn fill(&mut self, path: Option<Path>, color: Color) {
        if let Some(path) = path {
            self.pixmap.fill_path(&path, &paint(color), FillRule::Winding, scaled(), self.mask.as_ref());
        }
    }

    fn stroke(&mut self, path: Option<Path>, color: Color, width: f64) {
        let stroke = Stroke { width: width as f32, line_join: LineJoin::Round, ..Stroke::default() };
        if let Some(path) = path {
            self.pixmap.stroke_path(&path, &paint(color), &stroke, scaled(), self.mask.as_ref());
        }
    }

    fn inside(&mut self, lines: &[Vec<Point>], elements: &[Element]) {
        let mut path = PathBuilder::new();
        lines.iter().filter_map(|line| polyline(line, true)).for_each(|line| path.push_path(&line));
        let (Some(path), Some(mut mask)) = (path.finish(), Mask::new(self.pixmap.width(), self.pixmap.height())) else {
            return;
        };
        mask.fill_path(&path, FillRule::Winding, true, scaled());
        let outside = self.mask.replace(mask);
        self.draw(elements);
        self.mask = outside;
    }

    fn translucent(&mut self, opacity: f64, elements: &[Element]) {
        let Some(pixmap) = Pixmap::new(self.pixmap.width(), self.pixmap.height()) else { return };
        let mut layer = Self { pixmap, mask: self.mask.take() };
        layer.draw(elements);
        self.mask = layer.mask;
        let paint = PixmapPaint { opacity: opacity as f32, ..PixmapPaint::default() };
        self.pixmap.draw_pixmap(0, 0, layer.pixmap.as_ref(), &paint, Transform::identity(), None);
    }
}

fn scaled() -> Transform {
    Transform::from_scale(SCALE, SCALE)
}

fn paint([r, g, b]: Color) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

/// The line through `points`; `None` for less than two.
fn polyline(points: &[Point], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (number, (x, y)) in points.iter().enumerate() {
        let (x, y) = (*x as f32, *y as f32);
        if number == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    if closed {
        path.close();
    }
    path.finish()
}

/// The letters of a text at their place.
fn letters(text: &Text) -> Option<Path> {
    let width = font::width(&text.text, text.size);
    let start = match text.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle | Anchor::Upright => -width / 2.0,
        Anchor::End => -width,
    };
    let turn = if text.anchor == Anchor::Upright { -90.0 } else { 0.0 };
    let place = Transform::from_rotate(turn).post_translate(text.at.0 as f32, text.at.1 as f32);
    font::outline(&text.text, text.size)?.transform(place.pre_translate(start as f32, 0.0))
}

/// The part of a picture that a text covers.
#[cfg(test)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

#[cfg(test)]
impl Extent {
    /// Whether two texts overlap.
    pub(super) fn covers(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }
}

/// The texts of a picture.
#[cfg(test)]
pub(super) fn texts(picture: &Picture) -> Vec<(String, Extent)> {
    let text = |element: &Element| match element {
        Element::Text(text) => {
            let bounds = letters(text)?.bounds();
            let [left, top, right, bottom] =
                [bounds.left(), bounds.top(), bounds.right(), bounds.bottom()].map(f64::from);
            Some((text.text.clone(), Extent { left, top, right, bottom }))
        }
        _ => None,
    };
    picture.elements.iter().filter_map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_ends_or_begins_where_its_anchor_says() -> Result<(), &'static str> {
        let extent = |anchor| -> Result<Extent, &'static str> {
            let mut picture = Picture::new(200.0, 100.0);
            picture.text((100.0, 50.0), anchor, 20.0, [0; 3], "HH");
            Ok(texts(&picture).pop().ok_or("no text")?.1)
        };
        // An H stands on the base line, is 0.729 of the font size high, and has blanks of 0.098 of it at both sides.
        let (width, blank, high) = (font::width("HH", 20.0), 0.098 * 20.0, 0.729 * 20.0);
        let right = |from: f64| [from + blank, 50.0 - high, from + width - blank, 50.0];
        let upwards = [100.0 - high, 50.0 - width / 2.0 + blank, 100.0, 50.0 + width / 2.0 - blank];
        for (anchor, expected) in [
            (Anchor::Start, right(100.0)),
            (Anchor::Middle, right(100.0 - width / 2.0)),
            (Anchor::End, right(100.0 - width)),
            (Anchor::Upright, upwards),
        ] {
            let Extent { left, top, right, bottom } = extent(anchor)?;
            let near = |(a, b): (f64, f64)| (a - b).abs() < 0.02;
            assert!(
                [left, top, right, bottom].into_iter().zip(expected).all(near),
                "{anchor:?}: {:?}, {expected:?}",
                [left, top, right, bottom]
            );
        }
        Ok(())
    }

    #[test]
    fn later_elements_cover_earlier_ones_inside_lines_and_through_layers() -> Result<(), Box<dyn std::error::Error>> {
        let square = |from: f64, to: f64| vec![(from, from), (to, from), (to, to), (from, to)];
        let mut picture = Picture::new(40.0, 40.0);
        picture.polygon(square(2.0, 38.0), [255, 0, 0]);
        // The hole runs the other way round.
        let hole = square(14.0, 26.0).into_iter().rev().collect();
        let lines = vec![square(6.0, 34.0), hole, square(28.0, 36.0)];
        picture.inside(lines, |picture| picture.polygon(square(0.0, 40.0), [0, 0, 255]));
        picture.disc((36.0, 4.0), 1.5, [0, 255, 0], [0, 255, 0]);
        picture.translucent(0.5, |picture| picture.disc((10.0, 10.0), 2.0, [0; 3], [0; 3]));
        let png = picture.png("squares")?;
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info()?;
        let mut bytes = vec![0; reader.output_buffer_size().ok_or("too large")?];
        reader.next_frame(&mut bytes)?;
        let pixel = |x: usize, y: usize| &bytes[(2 * y * 80 + 2 * x) * 4..][..4];
        let [white, red, green, blue] = [[255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255]];
        for (x, y, color) in [(1, 1, white), (4, 4, red), (20, 20, red), (30, 30, blue), (35, 35, blue), (36, 4, green)]
        {
            assert_eq!(pixel(x, y), [color[0], color[1], color[2], 255], "at ({x}, {y})");
        }
        // Half black over blue.
        assert!(pixel(10, 10)[2].abs_diff(128) <= 1 && pixel(10, 10)[..2] == [0, 0], "{:?}", pixel(10, 10));
        Ok(())
    }
}
