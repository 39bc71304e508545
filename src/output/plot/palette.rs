//! Colours that remain distinct to colour-blind readers.

use super::picture::Color;

// Okabe and Ito, "Color Universal Design", 2008.
pub(super) const BLACK: Color = [0x00, 0x00, 0x00];
pub(super) const BLUE: Color = [0x00, 0x72, 0xb2];
pub(super) const SKY: Color = [0x56, 0xb4, 0xe9];
pub(super) const VERMILLION: Color = [0xd5, 0x5e, 0x00];
pub(super) const GREEN: Color = [0x00, 0x9e, 0x73];
pub(super) const PURPLE: Color = [0xcc, 0x79, 0xa7];

/// Frames, ticks and secondary text.
pub(super) const GREY: Color = [0x46, 0x46, 0x46];
/// Grid lines.
pub(super) const LIGHT: Color = [0xde, 0xde, 0xde];

/// Viridis (Smith, van der Walt; CC0), every eighth of its range.
pub(super) const VIRIDIS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// The colour of `x` in [0, 1]. A value outside gets the colour of the nearest end, NaN the colour of 0.
pub(super) fn viridis(x: f64) -> Color {
    let last = VIRIDIS.len() - 1;
    let place = if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) * last as f64 };
    let piece = (place as usize).min(last - 1);
    let weight = place - piece as f64;
    let mix = |k: usize| (VIRIDIS[piece][k] * (1.0 - weight) + VIRIDIS[piece + 1][k] * weight).round() as u8;
    [mix(0), mix(1), mix(2)]
}
