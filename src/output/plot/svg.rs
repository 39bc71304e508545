//! The few elements of SVG that pictures need, with coordinates to a hundredth of a unit.

use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// A point of a picture: to the right and down from its upper left corner.
pub(super) type Point = (f64, f64);

/// The part of a text that lies at its point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// The middle; the text runs upwards.
    Upright,
}

/// A picture under construction.
pub(super) struct Svg {
    size: Point,
    body: String,
}

impl Svg {
    /// An empty white picture.
    pub(super) fn new(width: f64, height: f64) -> Self {
        Self { size: (width, height), body: String::new() }
    }

    /// A line through `points`.
    pub(super) fn line(&mut self, points: impl IntoIterator<Item = Point>, color: &str, width: f64) {
        let points = listed(points);
        self.body += &format!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"/>\n"
        );
    }

    /// A filled polygon. Its rim has the same colour, so that neighbours leave no seam.
    pub(super) fn polygon(&mut self, points: impl IntoIterator<Item = Point>, color: &str) {
        let points = listed(points);
        self.body +=
            &format!("<polygon points=\"{points}\" fill=\"{color}\" stroke=\"{color}\" stroke-width=\"0.5\"/>\n");
    }

    /// A disc with a rim.
    pub(super) fn disc(&mut self, (x, y): Point, radius: f64, color: &str, rim: &str) {
        self.body += &format!(
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\" fill=\"{color}\" stroke=\"{rim}\" stroke-width=\"0.4\"/>\n"
        );
    }

    /// Draws what lies inside closed lines. The inside of a line lies at one side of it, the same for all lines.
    pub(super) fn inside(&mut self, lines: &[Vec<Point>], draw: impl FnOnce(&mut Self)) {
        let path: String = lines.iter().map(|line| format!("M{}Z", listed(line.iter().copied()))).collect();
        self.body +=
            &format!("<clipPath id=\"inside\"><path d=\"{path}\"/></clipPath>\n<g clip-path=\"url(#inside)\">\n");
        draw(self);
        self.body += "</g>\n";
    }

    /// Draws as one translucent layer.
    pub(super) fn translucent(&mut self, opacity: f64, draw: impl FnOnce(&mut Self)) {
        self.body += &format!("<g opacity=\"{opacity}\">\n");
        draw(self);
        self.body += "</g>\n";
    }

    /// A text with the font size `size`. The point lies on the base line.
    pub(super) fn text(&mut self, (x, y): Point, anchor: Anchor, size: f64, color: &str, text: &str) {
        let (place, turned) = match anchor {
            Anchor::Start => ("start", String::new()),
            Anchor::Middle => ("middle", String::new()),
            Anchor::End => ("end", String::new()),
            Anchor::Upright => ("middle", format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"")),
        };
        let text = escaped(text);
        self.body += &format!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{place}\" fill=\"{color}\"{turned}>{text}</text>\n"
        );
    }

    /// The content of the SVG file.
    pub(super) fn finish(self) -> String {
        let Self { size: (width, height), body } = self;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }
}

fn listed(points: impl IntoIterator<Item = Point>) -> String {
    points.into_iter().map(|(x, y)| format!("{x:.2},{y:.2} ")).collect()
}

/// A text escaped for XML and HTML, without control characters, which XML forbids. A line break counts as a space there.
pub(super) fn escaped(text: &str) -> String {
    let text = text.replace(|letter: char| letter.is_control() && letter != '\n', "");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Width of a text with the font size `size`, in the font of the pictures.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let Ok(font) = FontRef::new(dejavu::sans::regular()) else { return size * text.chars().count() as f64 };
    let metrics = font.glyph_metrics(Size::new(size as f32), LocationRef::default());
    let letters = font.charmap();
    let width = |letter: char| letters.map(letter).and_then(|glyph| metrics.advance_width(glyph));
    // A letter that the font lacks is at most as wide as it is high.
    text.chars().map(|letter| width(letter).map_or(size, f64::from)).sum()
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
