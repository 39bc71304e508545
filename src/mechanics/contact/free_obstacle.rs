//! The motion of an obstacle that moves freely. For each Δφ, its balance of forces is solved for its motion q, so that the bodies' equations
//! have no further unknowns. With the forces f of contact on the bodies at the places x, the centre of mass c, gravity g and the rotation R:
//!
//! r(q) = ( m a − m g + Σ f,  J A + W × J W + Rᵀ Σ (x − c) × f ) = 0
//!
//! A change of the places changes q by δq = −(∂r/∂q)⁻¹ Σ ∂r/∂x δx.

use super::ContactPoint;
use crate::mechanics::loads::RigidBody;
use crate::mechanics::loads::rigid_body::{in_space, in_use, skew, stacked, translation, turn};
use crate::mechanics::schemes::Alphas;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, embed};
use nalgebra::{Matrix3x6, Matrix6x3, SMatrix};
use std::f64::consts::PI;

/// The largest number of Newton iterations.
const MOST_ITERATIONS: usize = 50;

/// The last Newton step, relative to the grid spacing. The iteration after it is exact to round-off.
const LAST_STEP: f64 = 1e-8;

/// The largest number of halvings of a Newton step that does not reduce the residual.
const MOST_HALVINGS: i32 = 10;

/// The balance of forces of a free obstacle.
pub(crate) struct FreeBalance<'a, const D: usize> {
    pub body: &'a RigidBody<D>,
    /// The relations of a and v to q.
    pub alphas: Alphas,
    /// g
    pub gravity: Vector<f64, D>,
    pub spacing: f64,
}

/// The motion of a free obstacle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreeMotion {
    /// q
    pub q: Vector<f64, 6>,
    /// (∂r/∂q)⁻¹
    pub inverse_slope: Tensor<f64, 6>,
    /// Whether forces are in balance there.
    pub is_balanced: bool,
}

/// A place of contact on a free obstacle, linearised.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreePoint<const D: usize> {
    /// ∂f/∂q
    pub of_motion: SMatrix<f64, D, 6>,
    /// ∂q/∂x, also through the other forces on the obstacle.
    pub motion: SMatrix<f64, 6, D>,
}

impl FreeMotion {
    /// The motion of the whole step, of which this is the part `theta`; `None` if it is not accepted. A turn of the whole step is below π.
    pub(crate) fn whole(&self, theta: f64) -> Option<Vector<f64, 6>> {
        let q = self.q / theta;
        mutant!("free obstacles: they stay where forces are in balance": q = self.q);
        (self.is_balanced && turn(&q).norm() < PI).then_some(q)
    }
}

impl<const D: usize> FreeBalance<'_, D> {
    /// q with r(q) = 0. `points_at` gives the points in contact after a motion.
    pub(crate) fn solve(&self, points_at: impl Fn(&Vector<f64, 6>) -> Vec<ContactPoint<f64, D>>) -> FreeMotion {
        // At t_n the pose is known.
        if self.alphas.dt == 0.0 {
            return FreeMotion { q: Vector::zeros(), inverse_slope: Tensor::zeros(), is_balanced: true };
        }
        let mut q = within_half_turn(self.alphas.predicted(&self.body.velocity, &self.body.acceleration));
        let mut points = points_at(&q);
        let mut residual = self.residual(&q, &points);
        for _ in 0..MOST_ITERATIONS {
            let Some(step) = self.slope(&q, &points).lu().solve(&-residual) else { break };
            if self.length(&step) <= LAST_STEP * self.spacing {
                let q = within_half_turn(q + step);
                return self.found(q, &points_at(&q), true);
            }
            let (start, before) = (q, self.size(&residual));
            for halvings in 0..=MOST_HALVINGS {
                q = within_half_turn(start + step * 0.5_f64.powi(halvings));
                points = points_at(&q);
                residual = self.residual(&q, &points);
                if self.size(&residual) < before {
                    break;
                }
            }
        }
        self.found(q, &points, false)
    }

    fn found(&self, q: Vector<f64, 6>, points: &[ContactPoint<f64, D>], is_balanced: bool) -> FreeMotion {
        let inverse = self.slope(&q, points).try_inverse();
        let inverse_slope = inverse.unwrap_or_else(Tensor::zeros);
        let q = q - inverse_slope * self.residual(&q, points);
        FreeMotion { q, inverse_slope, is_balanced: is_balanced && inverse.is_some() }
    }

    /// q with all derivatives that `T` carries, by the implicit function theorem. Each iteration makes one more order of them right. The last
    /// iteration changes nothing if ∂r/∂q is exact, so that the check of the tangent sees a wrong ∂r/∂q.
    pub(crate) fn implicit<T: Real>(
        &self,
        FreeMotion { q, inverse_slope, .. }: FreeMotion,
        points_at: impl Fn(&Vector<T, 6>) -> Vec<ContactPoint<T, D>>,
    ) -> Vector<T, 6> {
        let inverse = inverse_slope.map(T::lit);
        let iterations = if T::NDERIV > 0 { T::NDERIV + 1 } else { 0 };
        (0..iterations).fold(q.map(T::lit), |q, _| {
            let step = inverse * self.residual(&q, &points_at(&q));
            // The value stays the same bits for all number types.
            q - (step - step.map(T::value).map(T::lit))
        })
    }

    /// r(q)
    fn residual<T: Real>(&self, q: &Vector<T, 6>, points: &[ContactPoint<T, D>]) -> Vector<T, 6> {
        let (mut force, mut moment) = (Vector::<T, 3>::zeros(), Vector::<T, 3>::zeros());
        for one in points {
            let f = in_space(&one.force());
            mutant!("free obstacles: contact does not push back": f = Vector::zeros());
            force += f;
            moment += self.arm(q, one).cross(&f);
        }
        let weight = in_space(&(self.gravity * self.body.mass)).map(T::lit);
        let forces = stacked(&(force - weight), &self.body.turned(q).tr_mul(&moment));
        let residual = self.body.inertia_force(q, &self.alphas) + forces;
        Vector::from_fn(|k, _| if in_use::<D>(k) { residual[k] } else { T::zero() })
    }

    /// x − c
    fn arm<T: Real>(&self, q: &Vector<T, 6>, one: &ContactPoint<T, D>) -> Vector<T, 3> {
        in_space(&(one.pose.to_space(&one.y) - self.body.moved(q)))
    }

    /// ∂r/∂q
    fn slope(&self, q: &Vector<f64, 6>, points: &[ContactPoint<f64, D>]) -> Tensor<f64, 6> {
        let (back, turning) = (self.body.turned(q).transpose(), self.body.turning(q));
        let mut slope = self.body.inertia_slope(q, &self.alphas);
        for one in points {
            let (f, arm) = (in_space(&one.force()), self.arm(q, one));
            let change = self.of_motion(q, one);
            // δ(Rᵀ (x − c) × f) = Rᵀ (−δd × f + (x − c) × δf + ((x − c) × f) × δφ)
            let mut moment = skew(&arm) * change;
            add_columns(&mut moment, 0, &skew(&f));
            let turned = skew(&arm.cross(&f)) * turning;
            mutant!("free obstacles: the moment does not turn with the obstacle": turned = Tensor::zeros());
            add_columns(&mut moment, 3, &turned);
            add_rows(&mut slope, 0, &change);
            add_rows(&mut slope, 3, &(back * moment));
        }
        Tensor::from_fn(|i, k| match in_use::<D>(i) && in_use::<D>(k) {
            true => slope[(i, k)],
            false => f64::from(i == k),
        })
    }

    /// ∂f/∂q of the force f with the stiffness K at fixed pose: δf = K (δd + δφ × (x − c)) + δφ × f.
    fn of_motion(&self, q: &Vector<f64, 6>, one: &ContactPoint<f64, D>) -> Matrix3x6<f64> {
        let (stiffness, turning) = (embed(&one.stiffness()), self.body.turning(q));
        let mut change = Matrix3x6::zeros();
        add_columns(&mut change, 0, &stiffness);
        let turned = stiffness * skew(&self.arm(q, one)) + skew(&in_space(&one.force()));
        mutant!("free obstacles: forces do not turn with the obstacle": turned = stiffness * skew(&self.arm(q, one)));
        add_columns(&mut change, 3, &(turned * -turning));
        change
    }

    /// ∂q/∂x of a point, and ∂f/∂q of its force.
    pub(crate) fn linearized(
        &self,
        FreeMotion { q, inverse_slope, .. }: &FreeMotion,
        one: &ContactPoint<f64, D>,
    ) -> FreePoint<D> {
        let (stiffness, f, arm) = (embed(&one.stiffness()), in_space(&one.force()), self.arm(q, one));
        // δ((x − c) × f) = δx × f − (x − c) × K δx
        let moment = self.body.turned(q).transpose() * -(skew(&f) + skew(&arm) * stiffness);
        let of_place = Matrix6x3::from_fn(|i, k| if i < 3 { -stiffness[(i, k)] } else { moment[(i - 3, k)] });
        let of_place = Matrix6x3::from_fn(|i, k| if in_use::<D>(i) { of_place[(i, k)] } else { 0.0 });
        let motion = inverse_slope * -of_place;
        let of_motion = self.of_motion(q, one);
        FreePoint {
            of_motion: SMatrix::from_fn(|i, k| if in_use::<D>(k) { of_motion[(i, k)] } else { 0.0 }),
            motion: SMatrix::from_fn(|i, k| motion[(i, k)]),
        }
    }

    /// The length of a motion: its translation, and its rotation times the radius of gyration.
    fn length(&self, q: &Vector<f64, 6>) -> f64 {
        let radius = (self.body.inertia.trace() / self.body.mass).sqrt();
        q.fixed_rows::<3>(0).norm() + radius * q.fixed_rows::<3>(3).norm()
    }

    /// The size of a residual in units of a force: a moment counts with the arm of the radius of gyration.
    fn size(&self, residual: &Vector<f64, 6>) -> f64 {
        let radius = (self.body.inertia.trace() / self.body.mass).sqrt().max(f64::MIN_POSITIVE);
        residual.fixed_rows::<3>(0).norm().hypot(residual.fixed_rows::<3>(3).norm() / radius)
    }
}

impl<const D: usize> FreePoint<D> {
    pub(crate) fn zero() -> Self {
        Self { of_motion: SMatrix::zeros(), motion: SMatrix::zeros() }
    }

    /// Adds a point with a weight for every component of its place.
    pub(crate) fn add(&mut self, Self { of_motion, motion }: &Self, weights: &[f64; D]) {
        self.of_motion += SMatrix::<f64, D, 6>::from_fn(|i, k| weights[i] * of_motion[(i, k)]);
        self.motion += SMatrix::<f64, 6, D>::from_fn(|i, k| motion[(i, k)] * weights[k]);
    }
}

/// A motion whose turn is shortened to π where it is longer. Longer turns need more terms of their series.
fn within_half_turn(q: Vector<f64, 6>) -> Vector<f64, 6> {
    let share = (PI / turn(&q).norm()).min(1.0);
    stacked(&translation(&q), &(turn(&q) * share))
}

/// Adds a block to three columns.
fn add_columns(to: &mut Matrix3x6<f64>, first: usize, block: &Tensor<f64, 3>) {
    let mut columns = to.fixed_columns_mut::<3>(first);
    columns += block;
}

/// Adds a block to three rows.
fn add_rows(to: &mut Tensor<f64, 6>, first: usize, block: &Matrix3x6<f64>) {
    let mut rows = to.fixed_rows_mut::<3>(first);
    rows += block;
}
