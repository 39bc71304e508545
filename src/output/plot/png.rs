//! PNG from SVG.

use crate::output::OutputError;
use resvg::{tiny_skia, usvg};

/// Pixels per unit of the SVG.
const SCALE: f32 = 2.0;

/// The family of the embedded font.
const FAMILY: &str = "DejaVu Sans";

/// Renders an SVG on white, at two pixels per unit. `name` names the picture in an error.
///
/// ```
/// use bfree::output::plot::png::from_svg;
///
/// let png = from_svg("a square", r#"<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20"/>"#)?;
/// // Width and height stand in the first chunk, at two pixels to a unit.
/// assert_eq!((&png[..4], &png[16..24]), (b"\x89PNG".as_slice(), [0, 0, 0, 60, 0, 0, 0, 40].as_slice()));
/// # Ok::<(), bfree::output::OutputError>(())
/// ```
///
/// # Errors
/// The SVG cannot be read or drawn.
pub fn from_svg(name: &'static str, svg: &str) -> Result<Vec<u8>, OutputError> {
    let fail = |reason: String| OutputError::Draw { name, reason };
    let tree = tree(name, svg)?;
    let size = tree.size().to_int_size();
    let pixels = |length: u32| (length as f32 * SCALE) as u32;
    let (width, height) = (pixels(size.width()), pixels(size.height()));
    let mut pixmap = tiny_skia::Pixmap::new(width, height).ok_or_else(|| fail(format!("{width} x {height} pixels")))?;
    pixmap.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|error| fail(error.to_string()))
}

fn tree(name: &'static str, svg: &str) -> Result<usvg::Tree, OutputError> {
    let mut options = usvg::Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family(FAMILY);
    usvg::Tree::from_str(svg, &options).map_err(|error| OutputError::Draw { name, reason: error.to_string() })
}

/// Extent of a text.
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

/// Width and height in pixels.
#[cfg(test)]
type Size = (f64, f64);

/// The size of a picture, and its texts.
#[cfg(test)]
pub(super) fn texts(svg: &str) -> Result<(Size, Vec<(String, Extent)>), OutputError> {
    let tree = tree("texts", svg)?;
    let text = |node: &usvg::Node| match node {
        usvg::Node::Text(text) => {
            let (chunks, extent) = (text.chunks(), text.abs_bounding_box());
            let [left, top, right, bottom] =
                [extent.left(), extent.top(), extent.right(), extent.bottom()].map(f64::from);
            let letters = chunks.iter().map(usvg::TextChunk::text).collect();
            Some((letters, Extent { left, top, right, bottom }))
        }
        _ => None,
    };
    let size = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    Ok((size, tree.root().children().iter().filter_map(text).collect()))
}
