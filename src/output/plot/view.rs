//! Direction of sight.

use crate::tensor::Vector;
use std::str::FromStr;

/// A direction of sight, written `xy`, `30,20` or `xz,30,20`: the plane of the picture, then two angles in degrees. The eye moves by these
/// angles from the front of the plane to the right and up.
///
/// ```
/// use bfree::output::plot::View;
///
/// let view: View = "xz,30,20".parse()?;
/// assert_eq!(view, View { plane: Some([0, 2]), azimuth: 30.0, elevation: 20.0 });
/// assert!("xx".parse::<View>().is_err() && "30".parse::<View>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Horizontal and vertical axis of the plane; `None` for the plane of the largest motion.
    pub plane: Option<[usize; 2]>,
    /// Angle of the eye to the right, in degrees.
    pub azimuth: f64,
    /// Angle of the eye upwards, in degrees.
    pub elevation: f64,
}

impl FromStr for View {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("{text:?} is no view: give a plane, two angles in degrees, or both, as xy, 30,20 or xz,30,20");
        let axis = |letter: char| "xyz".find(letter);
        let parts: Vec<&str> = text.split(',').collect();
        let angle = |text: &str| text.parse().ok().filter(|angle: &f64| angle.abs() <= 360.0).ok_or_else(wrong);
        let plane = |text: &str| match text.chars().map(axis).collect::<Vec<_>>()[..] {
            [Some(right), Some(up)] if right != up => Ok(Some([right, up])),
            _ => Err(wrong()),
        };
        match parts[..] {
            [one] => Ok(Self { plane: plane(one)?, azimuth: 0.0, elevation: 0.0 }),
            [a, e] => Ok(Self { plane: None, azimuth: angle(a)?, elevation: angle(e)? }),
            [p, a, e] => Ok(Self { plane: plane(p)?, azimuth: angle(a)?, elevation: angle(e)? }),
            _ => Err(wrong()),
        }
    }
}

/// Unit vectors of a picture: to the right, up, and towards the eye.
#[derive(Clone, Copy, Debug)]
pub(super) struct Directions {
    right: Vector<f64, 3>,
    up: Vector<f64, 3>,
    toward: Vector<f64, 3>,
}

impl Directions {
    /// The directions of a view of a body in `dimension` dimensions. Without a plane in the view, the plane is `moves`, on which the motion
    /// is best seen. Without a view, the eye in three dimensions is in front, to the right and above.
    pub(super) fn new(view: Option<View>, dimension: u32, moves: [usize; 2]) -> Self {
        let standard = if dimension == 3 { (30.0, 20.0) } else { (0.0, 0.0) };
        let view = view.unwrap_or(View { plane: None, azimuth: standard.0, elevation: standard.1 });
        let unit = |axis: usize| Vector::from_fn(|k, _| f64::from(u8::from(k == axis)));
        let [right, up]: [Vector<f64, 3>; 2] = view.plane.unwrap_or(moves).map(unit);
        let toward = right.cross(&up);
        let (sin_azimuth, cos_azimuth) = view.azimuth.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = view.elevation.to_radians().sin_cos();
        let level = cos_azimuth * toward + sin_azimuth * right;
        Self {
            right: cos_azimuth * right - sin_azimuth * toward,
            up: cos_elevation * up - sin_elevation * level,
            toward: cos_elevation * level + sin_elevation * up,
        }
    }

    /// Position of a point in the picture.
    pub(super) fn project(&self, x: [f64; 3]) -> (f64, f64) {
        (self.right.dot(&Vector::from(x)), self.up.dot(&Vector::from(x)))
    }

    /// Distance of a point towards the eye.
    pub(super) fn depth(&self, x: [f64; 3]) -> f64 {
        self.toward.dot(&Vector::from(x))
    }

    /// Numbers of the axes to the right and up, if the picture lies in a plane of two axes.
    pub(super) fn plane(&self) -> Option<[usize; 2]> {
        let axis = |direction: &Vector<f64, 3>| direction.iter().position(|x| (x - 1.0).abs() < 1e-12);
        Some([axis(&self.right)?, axis(&self.up)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eye_moves_to_the_right_and_up() -> Result<(), String> {
        let of = |text: &str| -> Result<Directions, String> { Ok(Directions::new(Some(text.parse()?), 3, [0, 1])) };
        assert_eq!((of("zy")?.plane(), of("0,0")?.plane(), of("30,0")?.plane()), (Some([2, 1]), Some([0, 1]), None));
        // From the right, x comes towards the eye; from above, y does.
        for (view, towards) in [("90,0", [1.0, 0.0, 0.0]), ("0,90", [0.0, 1.0, 0.0])] {
            let directions = of(view)?;
            assert!(directions.depth(towards) > 1.0 - 1e-12, "{view}: {directions:?}");
            let [a, b, c] = [directions.right, directions.up, directions.toward];
            assert!(a.dot(&b).abs() + b.dot(&c).abs() + c.dot(&a).abs() < 1e-12);
        }
        Ok(())
    }
}
