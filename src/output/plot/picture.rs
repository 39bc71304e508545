//! The few elements that pictures need, and pictures as SVG, with coordinates to a hundredth of a unit.

/// A point of a picture: to the right and down from its upper left corner.
pub(super) type Point = (f64, f64);

/// Red, green and blue.
pub(super) type Color = [u8; 3];

/// The part of a text that lies at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// The middle; the text runs upwards.
    Upright,
}

/// A text; its point lies on the base line.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub at: Point,
    pub anchor: Anchor,
    pub size: f64,
    pub color: Color,
    pub text: String,
}

/// A part of a picture.
#[derive(Clone, Debug)]
pub(super) enum Element {
    Line { points: Vec<Point>, color: Color, width: f64 },
    Polygon { points: Vec<Point>, color: Color },
    Disc { center: Point, radius: f64, color: Color, rim: Color },
    Text(Text),
    Inside { lines: Vec<Vec<Point>>, elements: Vec<Element> },
    Translucent { opacity: f64, elements: Vec<Element> },
}

/// A picture, which becomes [SVG](Self::svg) or [PNG](Self::png).
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width and height.
    pub(super) size: Point,
    /// The elements, from the lowest to the uppermost.
    pub(super) elements: Vec<Element>,
}

impl Picture {
    /// Width of the rim of a polygon, which has the colour of the polygon, so that neighbours leave no seam.
    pub(super) const RIM: f64 = 0.5;

    /// Width of the rim of a disc.
    pub(super) const DISC_RIM: f64 = 0.4;

    /// An empty white picture.
    pub(super) fn new(width: f64, height: f64) -> Self {
        Self { size: (width, height), elements: Vec::new() }
    }

    /// A line through `points`.
    pub(super) fn line(&mut self, points: impl IntoIterator<Item = Point>, color: Color, width: f64) {
        self.elements.push(Element::Line { points: points.into_iter().collect(), color, width });
    }

    /// A filled polygon.
    pub(super) fn polygon(&mut self, points: impl IntoIterator<Item = Point>, color: Color) {
        self.elements.push(Element::Polygon { points: points.into_iter().collect(), color });
    }

    /// A disc with a rim.
    pub(super) fn disc(&mut self, center: Point, radius: f64, color: Color, rim: Color) {
        self.elements.push(Element::Disc { center, radius, color, rim });
    }

    /// Draws what lies inside closed lines. The inside of a line lies at one side of it, the same for all lines.
    pub(super) fn inside(&mut self, lines: Vec<Vec<Point>>, draw: impl FnOnce(&mut Self)) {
        let elements = self.apart(draw);
        self.elements.push(Element::Inside { lines, elements });
    }

    /// Draws as one translucent layer.
    pub(super) fn translucent(&mut self, opacity: f64, draw: impl FnOnce(&mut Self)) {
        let elements = self.apart(draw);
        self.elements.push(Element::Translucent { opacity, elements });
    }

    /// The elements that `draw` adds.
    fn apart(&mut self, draw: impl FnOnce(&mut Self)) -> Vec<Element> {
        let mut apart = Self::new(self.size.0, self.size.1);
        draw(&mut apart);
        apart.elements
    }

    /// A text with the font size `size`.
    pub(super) fn text(&mut self, at: Point, anchor: Anchor, size: f64, color: Color, text: &str) {
        self.elements.push(Element::Text(Text { at, anchor, size, color, text: text.to_owned() }));
    }

    /// The content of an SVG file.
    pub(crate) fn svg(&self) -> String {
        let ((width, height), body) = (self.size, listed(&self.elements));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }
}

fn listed(elements: &[Element]) -> String {
    elements.iter().map(Element::svg).collect()
}

impl Element {
    fn svg(&self) -> String {
        match self {
            Self::Line { points, color, width } => {
                let (points, color) = (places(points), hex(*color));
                format!(
                    "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"/>\n"
                )
            }
            Self::Polygon { points, color } => {
                let (points, color, rim) = (places(points), hex(*color), Picture::RIM);
                format!("<polygon points=\"{points}\" fill=\"{color}\" stroke=\"{color}\" stroke-width=\"{rim}\"/>\n")
            }
            Self::Disc { center: (x, y), radius, color, rim } => {
                let (color, rim, width) = (hex(*color), hex(*rim), Picture::DISC_RIM);
                format!(
                    "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\" fill=\"{color}\" stroke=\"{rim}\" stroke-width=\"{width}\"/>\n"
                )
            }
            Self::Text(text) => text.svg(),
            Self::Inside { lines, elements } => {
                let path: String = lines.iter().map(|line| format!("M{}Z", places(line))).collect();
                let body = listed(elements);
                format!(
                    "<clipPath id=\"inside\"><path d=\"{path}\"/></clipPath>\n<g clip-path=\"url(#inside)\">\n{body}</g>\n"
                )
            }
            Self::Translucent { opacity, elements } => {
                format!("<g opacity=\"{opacity}\">\n{}</g>\n", listed(elements))
            }
        }
    }
}

impl Text {
    fn svg(&self) -> String {
        let Self { at: (x, y), anchor, size, .. } = self;
        let (place, turned) = match anchor {
            Anchor::Start => ("start", String::new()),
            Anchor::Middle => ("middle", String::new()),
            Anchor::End => ("end", String::new()),
            Anchor::Upright => ("middle", format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"")),
        };
        let (color, text) = (hex(self.color), escaped(&self.text));
        format!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{place}\" fill=\"{color}\"{turned}>{text}</text>\n"
        )
    }
}

fn hex([r, g, b]: Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn places(points: &[Point]) -> String {
    points.iter().map(|(x, y)| format!("{x:.2},{y:.2} ")).collect()
}

/// A text escaped for XML and HTML, without control characters, which XML forbids. A line break counts as a space there.
pub(super) fn escaped(text: &str) -> String {
    let text = text.replace(|letter: char| letter.is_control() && letter != '\n', "");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
