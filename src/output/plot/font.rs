//! The font of the pictures, DejaVu Sans, which is part of the program.

use std::sync::LazyLock;
use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

static FACE: LazyLock<Option<Face<'static>>> = LazyLock::new(|| Face::parse(dejavu::sans::regular(), 0).ok());

/// The glyphs of a text, each with the length from the start of the text to its own start. Lengths are in units of the font, of which
/// there are as many to the font size as the second result says. A letter that the font lacks is drawn as an empty box.
fn glyphs(text: &str) -> (Vec<(GlyphId, f64)>, f64, f64) {
    let Some(face) = &*FACE else { return (Vec::new(), text.chars().count() as f64, 1.0) };
    let mut end = 0.0;
    let glyphs = text.chars().map(|letter| {
        let glyph = face.glyph_index(letter).unwrap_or_default();
        let start = end;
        end += f64::from(face.glyph_hor_advance(glyph).unwrap_or_default());
        (glyph, start)
    });
    (glyphs.collect(), end, f64::from(face.units_per_em()))
}

/// Width of a text with the font size `size`.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let (_, end, units) = glyphs(text);
    end * size / units
}

/// A text cut to the width `most`, with an ellipsis if it is cut.
pub(super) fn shortened(text: &str, size: f64, most: f64) -> String {
    if width(text, size) <= most {
        return text.to_owned();
    }
    let mut short: String = text.to_owned();
    while short.pop().is_some() && width(&short, size) + size > most {}
    short + "…"
}

/// The letters of a text of font size `size`. The base line starts at the origin; y points down. `None` for blanks alone.
pub(super) fn outline(text: &str, size: f64) -> Option<Path> {
    let mut path = PathBuilder::new();
    let (glyphs, _, units) = glyphs(text);
    for (glyph, start) in glyphs {
        let mut outline = Outline { path: &mut path, start: start as f32 };
        FACE.as_ref().and_then(|face| face.outline_glyph(glyph, &mut outline));
    }
    let scale = (size / units) as f32;
    path.finish()?.transform(Transform::from_scale(scale, -scale))
}

/// Adds the curves of a glyph to a path.
struct Outline<'a> {
    path: &'a mut PathBuilder,
    start: f32,
}

impl OutlineBuilder for Outline<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(self.start + x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(self.start + x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.path.quad_to(self.start + x1, y1, self.start + x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.path.cubic_to(self.start + x1, y1, self.start + x2, y2, self.start + x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}
