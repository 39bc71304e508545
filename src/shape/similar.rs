//! Solids turned and scaled: a similarity scales all distances by one factor.

use super::{Face, Feature, Shape, Solid};
use crate::tensor::{Tensor, Vector, identity};

/// A solid turned and scaled about a point, x ↦ c + s R (x − c).
#[derive(Clone, Debug, PartialEq)]
pub struct Similar<const D: usize> {
    /// The solid before turning and scaling.
    pub of: Box<Shape<D>>,
    /// The fixed point c.
    pub about: Vector<f64, D>,
    /// The rotation R.
    pub rotation: Tensor<f64, D>,
    /// The factor s, > 0.
    pub factor: f64,
}

impl<const D: usize> Similar<D> {
    /// The point of `of` that is now at `x`: c + Rᵀ (x − c)/s.
    fn before(&self, x: &Vector<f64, D>) -> Vector<f64, D> {
        self.about + self.rotation.tr_mul(&(x - self.about)) / self.factor
    }

    fn after(&self, (d, n): Face<D>) -> Face<D> {
        (self.factor * d, self.rotation * n)
    }
}

impl<const D: usize> Solid<D> for Similar<D> {
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        self.after(self.of.solid().nearest(&self.before(x)))
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        self.of.feature(&self.before(x)).moved(&self.about, &self.rotation, self.factor)
    }

    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let others = planes.len();
        let departure = self.of.solid().add_planes(&self.before(x), radius / self.factor, planes);
        planes.iter_mut().skip(others).for_each(|plane| *plane = self.after(*plane));
        self.factor * departure
    }

    /// max n·(c + s R (x − c)) = n·c + s (max m·x − m·c),  m = Rᵀn
    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let m = self.rotation.tr_mul(n);
        n.dot(&self.about) + self.factor * (self.of.solid().reach(&m) - m.dot(&self.about))
    }
}

/// The rotation by an angle in degrees, exact for multiples of 90. In 2D the rotation is counter-clockwise, without an axis. In 3D it is
/// about an axis of any length but zero, by the right-hand rule. `None` in 1D, with an axis in 2D, and without an axis in 3D.
///
/// ```
/// use bfree::shape::rotation;
/// use bfree::tensor::Vector;
///
/// let quarter = rotation::<2>(90.0, None).ok_or("plane")?;
/// assert_eq!(quarter * Vector::from([1.0, 0.0]), Vector::from([0.0, 1.0]));
/// // y turns to z about x
/// let quarter = rotation::<3>(450.0, Some(&Vector::from([2.0, 0.0, 0.0]))).ok_or("space")?;
/// assert_eq!(quarter * Vector::from([0.0, 1.0, 0.0]), Vector::from([0.0, 0.0, 1.0]));
/// assert!(rotation::<3>(90.0, None).is_none());
/// # Ok::<(), &str>(())
/// ```
pub fn rotation<const D: usize>(degrees: f64, axis: Option<&Vector<f64, D>>) -> Option<Tensor<f64, D>> {
    // K x = e × x
    let spin: Tensor<f64, D> = match (D, axis) {
        (2, None) => Tensor::from_fn(|i, k| i as f64 - k as f64),
        (3, Some(axis)) => {
            let e = axis / axis.norm();
            Tensor::from_fn(|i, k| match (3 + k - i) % 3 {
                1 => -e[(i + 2) % 3],
                2 => e[(i + 1) % 3],
                _ => 0.0,
            })
        }
        _ => return None,
    };
    let (sin, cos) = sin_cos(degrees);
    // R = I + sin φ K + (1 − cos φ) K²
    Some(identity() + spin * sin + spin * spin * (1.0 - cos))
}

/// Sine and cosine of an angle in degrees, exact for multiples of 90.
fn sin_cos(degrees: f64) -> (f64, f64) {
    let within = degrees % 360.0;
    let quarters = (within / 90.0).round();
    let (sin, cos) = (within - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}
