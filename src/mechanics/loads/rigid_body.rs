//! A rigid body that gravity and forces of contact move.

use super::Pose;
use crate::mechanics::schemes::Alphas;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, identity, outer};

/// A rigid body with mass. Its motion in a step is q = (d, Θ): the translation d of its centre of mass, and a rotation vector Θ in the frame
/// of the body. In 2D only d and Θ₃ are in use, in 1D only d.
///
/// R = R_n exp Θ̂
///
/// A steady turn about one axis is exact for every step length. The time integration scheme relates q, the velocity (v, W) and the acceleration (a, A). W and
/// A are the angular velocity and acceleration in the frame of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidBody<const D: usize> {
    /// The mass; in 2D per unit thickness.
    pub mass: f64,
    /// The inertia tensor J about the centre of mass, in the frame of the body.
    pub inertia: Tensor<f64, 3>,
    /// The centre of mass in the frame of the body.
    pub center: Vector<f64, D>,
    /// The centre of mass at t_n.
    pub position: Vector<f64, D>,
    /// R_n
    pub rotation: Tensor<f64, 3>,
    /// v, then W at t_n.
    pub velocity: Vector<f64, 6>,
    /// a, then A at t_n.
    pub acceleration: Vector<f64, 6>,
}

/// Whether component `k` of q is in use in D dimensions.
pub(crate) fn in_use<const D: usize>(k: usize) -> bool {
    match D {
        1 => k == 0,
        2 => k < 2 || k == 5,
        _ => true,
    }
}

/// The first three components of a vector, or the last three.
fn part<T: Real>(q: &Vector<T, 6>, first: usize) -> Vector<T, 3> {
    Vector::from_fn(|i, _| q[first + i])
}

/// The translation of a motion q.
pub(crate) fn translation<T: Real>(q: &Vector<T, 6>) -> Vector<T, 3> {
    part(q, 0)
}

/// The rotation vector of a motion q.
pub(crate) fn turn<T: Real>(q: &Vector<T, 6>) -> Vector<T, 3> {
    part(q, 3)
}

/// Both parts of a motion, or of a force and a moment.
pub(crate) fn stacked<T: Real>(first: &Vector<T, 3>, last: &Vector<T, 3>) -> Vector<T, 6> {
    Vector::from_fn(|i, _| if i < 3 { first[i] } else { last[i - 3] })
}

/// â, with â b = a × b.
pub(crate) fn skew<T: Real>(a: &Vector<T, 3>) -> Tensor<T, 3> {
    let o = T::zero();
    Tensor::<T, 3>::new(o, -a[2], a[1], a[2], o, -a[0], -a[1], a[0], o)
}

/// A vector of three components; those beyond D are zero.
pub(crate) fn in_space<T: Real, const D: usize>(a: &Vector<T, D>) -> Vector<T, 3> {
    Vector::from_fn(|i, _| if i < D { a[i] } else { T::zero() })
}

/// Terms of the series. They are exact to round-off up to a turn of π.
const TERMS: u32 = 16;

/// Σ (−s)ᵏ/(2k + n)!, which is sin √s/√s for n = 1, (1 − cos √s)/s for n = 2, and (√s − sin √s)/√s³ for n = 3. The series has all derivatives
/// at s = 0.
fn series<T: Real>(s: T, n: u32) -> T {
    let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
    (0..TERMS).rev().fold(T::zero(), |sum, k| T::lit(factorial(2 * k + n).recip()) - s * sum)
}

/// I + f_n Θ̂ + f_{n+1} Θ̂² with the functions f of [`series`] at |Θ|². It is exp Θ̂ for n = 1, and ∂φ/∂Θ of exp Θ̂ for n = 2.
fn of_turn<T: Real>(turn: &Vector<T, 3>, n: u32) -> Tensor<T, 3> {
    let s = turn.dot(turn);
    // Θ̂² = Θ ⊗ Θ − |Θ|² I
    let square = outer(turn, turn) - identity::<T, 3>() * s;
    identity::<T, 3>() + skew(turn) * series(s, n) + square * series(s, n + 1)
}

impl<const D: usize> RigidBody<D> {
    /// A body whose frame is that of space.
    ///
    /// ```
    /// use bfree::mechanics::loads::RigidBody;
    /// use bfree::tensor::{Vector, identity};
    ///
    /// // A disc that turns by a quarter.
    /// let (center, spin) = (Vector::from([2.0, 1.0]), Vector::from([0.0, 0.0, 3.0]));
    /// let disc = RigidBody::new(5.0, identity::<f64, 3>() * 0.5, center, Vector::zeros(), spin);
    /// let mut q = Vector::zeros();
    /// q[5] = std::f64::consts::FRAC_PI_2;
    /// let pose = disc.pose(&q);
    /// let right = pose.rotation * Vector::from([3.0, 1.0]) + pose.shift;
    /// assert!((right - Vector::from([2.0, 2.0])).norm() < 1e-14);
    /// assert_eq!(disc.kinetic_energy(), 2.25);
    /// ```
    pub fn new(
        mass: f64,
        inertia: Tensor<f64, 3>,
        center: Vector<f64, D>,
        velocity: Vector<f64, D>,
        spin: Vector<f64, 3>,
    ) -> Self {
        let velocity = stacked(&in_space(&velocity), &spin);
        let (rotation, acceleration) = (identity(), Vector::zeros());
        Self { mass, inertia, center, position: center, rotation, velocity, acceleration }
    }

    /// Sets the acceleration to that without contact.
    pub(crate) fn fall_freely(&mut self, gravity: &Vector<f64, D>) {
        let spin = turn(&self.velocity);
        let moment = -spin.cross(&(self.inertia * spin));
        // In 2D nothing turns about x and y, and the inertia about them is not in use.
        let turning = self.inertia.lu().solve(&moment).unwrap_or_else(Vector::zeros);
        let acceleration = stacked(&in_space(gravity), &turning);
        self.acceleration = Vector::from_fn(|k, _| if in_use::<D>(k) { acceleration[k] } else { 0.0 });
    }

    /// R after the motion q since t_n.
    pub(crate) fn turned<T: Real>(&self, q: &Vector<T, 6>) -> Tensor<T, 3> {
        self.rotation.map(T::lit) * of_turn(&turn(q), 1)
    }

    /// The centre of mass after the motion q since t_n.
    pub(crate) fn moved<T: Real>(&self, q: &Vector<T, 6>) -> Vector<T, D> {
        Vector::from_fn(|i, _| T::lit(self.position[i]) + q[i])
    }

    /// The pose after the motion q since t_n.
    pub fn pose<T: Real>(&self, q: &Vector<T, 6>) -> Pose<D, T> {
        let turned = self.turned(q);
        let rotation = Tensor::<T, D>::from_fn(|i, k| turned[(i, k)]);
        Pose { rotation, shift: self.moved(q) - rotation * self.center.map(T::lit) }
    }

    /// P with δφ = P δΘ, the rotation of space that a change of Θ causes.
    pub(crate) fn turning(&self, q: &Vector<f64, 6>) -> Tensor<f64, 3> {
        self.rotation * of_turn(&turn(q), 2)
    }

    /// The force of inertia m a, and its moment J A + W × J W in the frame of the body.
    pub(crate) fn inertia_force<T: Real>(&self, q: &Vector<T, 6>, alphas: &Alphas) -> Vector<T, 6> {
        let (velocity, acceleration) = self.rates(q, alphas);
        let inertia = self.inertia.map(T::lit);
        let spin = turn(&velocity);
        let moment = inertia * turn(&acceleration) + spin.cross(&(inertia * spin));
        stacked(&(translation(&acceleration) * T::lit(self.mass)), &moment)
    }

    /// The derivative of [`Self::inertia_force`].
    pub(crate) fn inertia_slope(&self, q: &Vector<f64, 6>, alphas: &Alphas) -> Tensor<f64, 6> {
        let spin = turn(&self.rates(q, alphas).0);
        // δ(W × J W) = (Ŵ J − (J W)^) δW
        let gyroscopic = skew(&spin) * self.inertia - skew(&(self.inertia * spin));
        let turning = self.inertia * alphas.a1 + gyroscopic * alphas.a4;
        Tensor::from_fn(|i, k| match (i < 3, k < 3) {
            (true, true) if i == k => self.mass * alphas.a1,
            (false, false) => turning[(i - 3, k - 3)],
            _ => 0.0,
        })
    }

    /// Velocity and acceleration after the motion q since t_n.
    fn rates<T: Real>(&self, q: &Vector<T, 6>, alphas: &Alphas) -> (Vector<T, 6>, Vector<T, 6>) {
        // In the order of operations of `Alphas`, so that uniform motion changes not a bit.
        let beyond = q - (self.velocity * alphas.dt).map(T::lit);
        let velocity = self.velocity + self.acceleration * alphas.a6;
        let acceleration = self.acceleration * -alphas.a3;
        let added = |start: Vector<f64, 6>, factor: f64| start.map(T::lit) + beyond * T::lit(factor);
        (added(velocity, alphas.a4), added(acceleration, alphas.a1))
    }

    /// The body at the end of a step with the motion q. `alphas` are those of the end.
    pub(crate) fn after(&self, q: &Vector<f64, 6>, alphas: &Alphas) -> Self {
        let (velocity, acceleration) = self.rates(q, alphas);
        Self { position: self.moved(q), rotation: self.turned(q), velocity, acceleration, ..self.clone() }
    }

    /// Position, rotation, velocity and acceleration as numbers.
    pub(crate) fn state(&self) -> impl Iterator<Item = f64> {
        let Self { position, rotation, velocity, acceleration, .. } = self;
        let all = position.iter().chain(rotation.iter()).chain(velocity.iter()).chain(acceleration.iter());
        all.copied()
    }

    /// Sets the state from its numbers, and returns the numbers after them.
    pub(crate) fn set_state<'n>(&mut self, numbers: &'n [f64]) -> &'n [f64] {
        let Self { position, rotation, velocity, acceleration, .. } = self;
        let all =
            position.iter_mut().chain(rotation.iter_mut()).chain(velocity.iter_mut()).chain(acceleration.iter_mut());
        all.zip(numbers).for_each(|(to, number)| *to = *number);
        &numbers[numbers.len().min(D + 21)..]
    }

    /// ½ m v·v + ½ W·J W
    pub fn kinetic_energy(&self) -> f64 {
        let (v, spin) = (translation(&self.velocity), turn(&self.velocity));
        0.5 * (self.mass * v.norm_squared() + spin.dot(&(self.inertia * spin)))
    }

    /// The angular velocity in the frame of space.
    pub(crate) fn spin(&self) -> Vector<f64, 3> {
        self.rotation * turn(&self.velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::schemes::{GeneralizedAlpha, Newmark, Scheme};
    use num_dual::Dual64;

    /// A body with different moments of inertia, in the midst of a turn.
    fn turning() -> RigidBody<3> {
        let inertia = Tensor::<f64, 3>::new(3.0, 0.4, 0.1, 0.4, 2.0, -0.2, 0.1, -0.2, 1.0);
        let (center, velocity) = (Vector::from([0.5, -0.2, 0.1]), Vector::from([1.0, 2.0, -1.0]));
        let mut body = RigidBody::new(4.0, inertia, center, velocity, Vector::from([0.3, -0.7, 1.1]));
        body.rotation = of_turn(&Vector::from([0.4, 0.8, -0.5]), 1);
        body.fall_freely(&Vector::from([0.0, -1.0, 0.0]));
        body
    }

    #[test]
    fn poses_are_rotations_and_their_rates_are_those_of_dual_numbers() {
        let (body, alphas) = (turning(), Newmark::default().alphas(0.1));
        let q = Vector::<f64, 6>::from([0.2, -0.1, 0.4, 0.3, -0.6, 0.9]);
        let pose = body.pose(&q);
        let half_turn = of_turn(&Vector::from([0.0, 0.0, std::f64::consts::PI]), 1);
        assert!((half_turn - Tensor::from_diagonal(&Vector::from([-1.0, -1.0, 1.0]))).norm() < 1e-14);
        assert!((pose.rotation.transpose() * pose.rotation - identity::<f64, 3>()).norm() < 1e-15);
        for k in 0..6 {
            let mut along = q.map(Dual64::from);
            along[k].eps = 1.0;
            // δR = δφ × R with δφ = P δΘ
            let change = body.pose(&along).rotation.map(|x| x.eps);
            let direction = Vector::<f64, 6>::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
            let phi = body.turning(&q) * turn(&direction);
            assert!((change - skew(&phi) * pose.rotation).norm() < 1e-15, "{k}");
            let force = body.inertia_force(&along, &alphas).map(|x| x.eps);
            let slope = body.inertia_slope(&q, &alphas) * direction;
            assert!((force - slope).norm() < 1e-13 * slope.norm(), "{k}: {force} {slope}");
        }
    }

    /// The error of W after a time of 1, for a symmetric top without forces: W turns about the axis with the rate (J₃ − J₁)/J₁ W₃.
    fn error_of_top(scheme: &dyn Scheme, steps: u32) -> f64 {
        let dt = 1.0 / f64::from(steps);
        let inertia = Tensor::from_diagonal(&Vector::from([1.0, 1.0, 1.5]));
        let mut top =
            RigidBody::<3>::new(1.0, inertia, Vector::zeros(), Vector::zeros(), Vector::from([0.5, 0.0, 2.0]));
        top.fall_freely(&Vector::zeros());
        let (theta, alphas, end) = (scheme.instant(), scheme.balance(dt), scheme.end(dt));
        for _ in 0..steps {
            let mut q = alphas.predicted(&top.velocity, &top.acceleration);
            for _ in 0..9 {
                let step = top.inertia_slope(&q, &alphas).lu().solve(&top.inertia_force(&q, &alphas));
                q -= step.unwrap_or_else(Vector::zeros);
            }
            top = top.after(&(q / theta), &end);
        }
        let angle = 0.5 * 2.0;
        (turn(&top.velocity) - Vector::from([0.5 * f64::cos(angle), 0.5 * f64::sin(angle), 2.0])).norm()
    }

    #[test]
    fn a_symmetric_top_precesses_with_second_order() {
        for scheme in [&Newmark::default() as &dyn Scheme, &GeneralizedAlpha { spectral_radius: 0.5 }] {
            let order = (error_of_top(scheme, 50) / error_of_top(scheme, 100)).log2();
            assert!((order - 2.0).abs() < 0.1, "{scheme:?}: {order}");
            assert!(error_of_top(scheme, 100) < 1e-3, "{scheme:?}: {}", error_of_top(scheme, 100));
        }
    }
}
