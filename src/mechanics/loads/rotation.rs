//! Rotation of all nodes of a condition.

use super::curve::Curve;
use super::motion_step::MotionStep;
use crate::tensor::Vector;
use nalgebra::Vector3;

/// Rotation about a fixed axis: x(t) = c + R(θ(t)) (X − c).
#[derive(Clone, Debug, PartialEq)]
pub struct Rotation<const D: usize> {
    center: Vector<f64, D>,
    /// A unit vector.
    axis: Vector3<f64>,
    /// θ(t)
    angle: Curve,
}

impl<const D: usize> Rotation<D> {
    /// A rotation about an axis through `center`, counterclockwise where the axis points at the reader. `axis` has any length but zero. In
    /// the plane the axis is z.
    pub fn new(center: Vector<f64, D>, axis: [f64; 3], angle: Curve) -> Self {
        Self { center, axis: Vector3::from(axis).normalize(), angle }
    }

    /// x − c
    fn arm(&self, x: &Vector<f64, D>) -> Vector3<f64> {
        Vector3::from_fn(|i, _| if i < D { x[i] - self.center[i] } else { 0.0 })
    }

    /// The motion of component `i` of a node over the step from `t` to `t + dt`. The node is at `x` at time `t`. ω is the slope of the
    /// curve inside the step.
    pub(crate) fn over(&self, t: f64, dt: f64, x: &Vector<f64, D>, i: usize) -> MotionStep {
        let (arm, angle) = (self.arm(x), self.angle.value(t + dt) - self.angle.value(t));
        // (R − 1) r = sin θ a × r + (1 − cos θ) a × (a × r), with 1 − cos θ = 2 sin² θ/2 to the last digit
        let turned = |arm: &Vector3<f64>| (self.axis.cross(arm), self.axis.cross(&self.axis.cross(arm)));
        let (across, inwards) = turned(&arm);
        let increment = across * angle.sin() + inwards * (2.0 * (0.5 * angle).sin().powi(2));
        let (across_end, inwards_end) = turned(&(arm + increment));
        let [start, end] = self.angle.slopes(t, dt);
        MotionStep {
            increment: increment[i],
            velocity_start: start * across[i],
            acceleration_start: start * start * inwards[i],
            velocity_end: end * across_end[i],
            acceleration_end: end * end * inwards_end[i],
        }
    }

    /// a · ((x − c) × f e_i), the moment about the axis of component `i` of a force at `x`.
    pub(crate) fn moment(&self, x: &Vector<f64, D>, i: usize, force: f64) -> f64 {
        force * self.axis.cross(&self.arm(x))[i]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_turn_moves_a_point_from_the_right_to_above() -> Result<(), super::super::CurveError> {
        let quarter = Curve::new(vec![[0.0, 0.0], [2.0, FRAC_PI_2]])?;
        let rotation = Rotation::new(Vector::from([1.0, 1.0]), [0.0, 0.0, 1.0], quarter);
        let x = Vector::from([4.0, 1.0]);
        let up: Vec<_> = (0..2).map(|i| rotation.over(0.0, 2.0, &x, i).increment).collect();
        assert!((up[0] + 3.0).abs() < 1e-15 && (up[1] - 3.0).abs() < 1e-15);
        // The point starts with v = ω × r, upwards, and is accelerated inwards with ω² r.
        let omega = 0.5 * FRAC_PI_2;
        assert!((rotation.over(0.0, 2.0, &x, 1).velocity_start - 3.0 * omega).abs() < 1e-15);
        assert!((rotation.over(0.0, 2.0, &x, 0).acceleration_start + 3.0 * omega * omega).abs() < 1e-15);
        // A force of 2 upwards at x has the moment 3 · 2 about the axis.
        assert_eq!(rotation.moment(&x, 1, 2.0), 6.0);
        Ok(())
    }
}
