//! The equilibrium path by arc length: loads may rise and fall along the path. A step has a prescribed arc length Δs; the load parameter λ
//! at its end is solved for together with the motion.
//!
//! d·Δφ + w Δλ = Δs, with d the direction of the last step, is the plane of Riks (1979). The weight w is fixed, so λ is a function of φ,
//! and R(φ, λ(φ)) is a residual like any other. Its tangent K + f′ dᵀ/w is regular at limit points, where K is singular.

use crate::gpu::{Gpu, GpuVector};
use crate::material::Law;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::pooled::Pooled;
use crate::solver::{LinearOperator, Linearization, LocalForm, NonlinearProblem, OnDevice};
use crate::space::vector::{self, Vectors};
use crate::tensor::Vector;
use std::sync::Arc;

/// Upper bound of the loads' share in the arc length. With a small share, the plane meets the path even where loads fall steeply.
const SHARE: f64 = 0.1;

/// Width of the finite difference for f′(λ), relative to the load increment of a step. Within one piece of a load curve, its only error is
/// round-off.
const DIFFERENCE: f64 = 1e-3;

/// The position of a simulation on its equilibrium path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Path {
    /// λ, the load parameter: the time at which the loads are evaluated.
    pub load: f64,
    /// Δλ of the last step; 0 before the first.
    pub(crate) increment: f64,
    /// Δs/Δt of the first step, valid for all later steps.
    pub(crate) speed: f64,
    /// w, the weight of Δλ in the arc length.
    pub(crate) weight: f64,
}

impl Path {
    /// λ at the end of a load step of length `dt`. Such a step comes first and after every grid reset. After a reset the load goes on in
    /// the direction of the last step.
    pub(crate) fn load_step(&self, dt: f64) -> f64 {
        self.load + if self.increment < 0.0 { -dt } else { dt }
    }

    /// The path after a step of length `dt` with the motion Δφ to the load λ.
    pub(crate) fn after<const D: usize>(self, load: f64, dphi: &[Vector<f64, D>], dt: f64) -> Self {
        let increment = load - self.load;
        let length = vector::norm(bytemuck::cast_slice(dphi));
        let weight = SHARE * length / increment.abs();
        let first = self.speed == 0.0;
        Self {
            load,
            increment,
            speed: if first { length / dt } else { self.speed },
            weight: if first { weight } else { weight.min(self.weight) },
        }
    }
}

/// The equilibrium at the end of a step of arc length Δs.
pub(crate) struct OnPath<'a, const D: usize, L> {
    path: Path,
    /// The equilibrium under the loads at λ_n.
    start: &'a Equilibrium<'a, D, L>,
    /// f(λ), the external force on the free degrees of freedom.
    force: &'a dyn Fn(f64) -> Result<Pooled<Vector<f64, D>>, Inadmissible>,
    at_start: Pooled<Vector<f64, D>>,
    /// φ_n
    before: Pooled<Vector<f64, D>>,
    /// d
    direction: Vec<Vector<f64, D>>,
    /// Δs
    length: f64,
}

impl<'a, const D: usize, L: Law> OnPath<'a, D, L> {
    /// A step of length `dt` in the direction of the last step, whose Δφ/Δt was `rate`.
    ///
    /// # Errors
    /// det F ≤ 0 at the start.
    pub(crate) fn new(
        path: Path,
        start: &'a Equilibrium<'a, D, L>,
        force: &'a dyn Fn(f64) -> Result<Pooled<Vector<f64, D>>, Inadmissible>,
        rate: &[Vector<f64, D>],
        dt: f64,
    ) -> Result<Self, Inadmissible> {
        let size = vector::norm(bytemuck::cast_slice(rate));
        let before = start.step.nodal.motion_of(rate.len(), start.step.connectivity.pool());
        let direction = rate.iter().map(|rate| rate / size).collect();
        Ok(Self { path, start, force, at_start: force(path.load)?, before, direction, length: path.speed * dt })
    }

    /// φ − φ_n, and d, at the nodes.
    fn moved<'b>(&'b self, phi: &'b [Vector<f64, D>]) -> impl Iterator<Item = (Vector<f64, D>, &'b Vector<f64, D>)> {
        phi.iter().zip(&self.before).map(|(phi, before)| phi - before).zip(&self.direction)
    }

    /// λ(φ) = λ_n + (Δs − d·(φ − φ_n))/w
    pub(crate) fn load(&self, phi: &[Vector<f64, D>]) -> f64 {
        let along: f64 = self.moved(phi).map(|(moved, d)| d.dot(&moved)).sum();
        self.path.load + (self.length - along) / self.path.weight
    }

    /// The cosine of the angle between φ − φ_n and d; 1 where nothing moves.
    pub(crate) fn cosine(&self, phi: &[Vector<f64, D>]) -> f64 {
        let (mut along, mut squares) = (0.0, 0.0);
        for (moved, d) in self.moved(phi) {
            along += d.dot(&moved);
            squares += moved.norm_squared();
        }
        if squares > 0.0 { along / squares.sqrt() } else { 1.0 }
    }

    /// f′(λ)
    fn slope(&self, load: f64) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        // Δλ of the last step is no measure: it is nearly zero at a limit point.
        let by = DIFFERENCE * SHARE * self.length / self.path.weight;
        let mut slope = (self.force)(load + by)?;
        slope.iter_mut().zip(&(self.force)(load)?).for_each(|(slope, force)| *slope = (*slope - force) / by);
        Ok(slope)
    }

    /// Whether f′(λ) = 0: the loads no longer change, and the path ends.
    pub(crate) fn ends(&self, load: f64) -> Result<bool, Inadmissible> {
        Ok(self.slope(load)?.iter().all(|slope| slope.norm() == 0.0))
    }
}

impl<const D: usize, L: Law> NonlinearProblem for OnPath<'_, D, L> {
    type Inadmissible = Inadmissible;

    /// R(φ, λ_n) − (f(λ) − f(λ_n))
    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Inadmissible> {
        NonlinearProblem::residual(self.start, x, r)?;
        let force = (self.force)(self.load(bytemuck::cast_slice(x)))?;
        let out: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(r);
        out.iter_mut().zip(&force).zip(&self.at_start).for_each(|((r, force), start)| *r -= force - start);
        Ok(())
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        NonlinearProblem::magnitude(self.start, x)
    }

    fn sensitivity(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        NonlinearProblem::sensitivity(self.start, x)
    }

    /// None: the tangent is not symmetric.
    fn potential(&self, _: &[f64]) -> Option<Result<(f64, f64), Inadmissible>> {
        None
    }

    fn is_stopped(&self) -> bool {
        self.start.is_stopped()
    }

    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Inadmissible> {
        let mut slope = self.slope(self.load(bytemuck::cast_slice(x)))?;
        slope.iter_mut().for_each(|slope| *slope /= self.path.weight);
        let tangent = NonlinearProblem::linearize(self.start, x)?;
        Ok(Box::new(Bordered { tangent, slope, direction: &self.direction }))
    }
}

/// K + (f′/w) dᵀ
struct Bordered<'a, const D: usize> {
    tangent: Box<dyn Linearization + 'a>,
    slope: Pooled<Vector<f64, D>>,
    direction: &'a [Vector<f64, D>],
}

impl<const D: usize> LinearOperator for Bordered<'_, D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.tangent.apply(x, y);
        let along = vector::dot(bytemuck::cast_slice(self.direction), x);
        mutant!("path: its tangent forgets the loads": along = 0.0 * along);
        vector::axpy(along, bytemuck::cast_slice(&self.slope), y);
    }
}

/// The diagonal blocks and the local form are those of K.
impl<const D: usize> Linearization for Bordered<'_, D> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        self.tangent.diagonal_blocks()
    }

    fn on_device(&self) -> Option<Box<dyn OnDevice + '_>> {
        let tangent = self.tangent.on_device()?;
        let on_device = |field: &[Vector<f64, D>]| tangent.gpu().vector(bytemuck::cast_slice(field));
        let (slope, direction) = (on_device(&self.slope), on_device(self.direction));
        Some(Box::new(DeviceBordered { tangent, slope, direction }))
    }

    fn local_form(&self) -> Option<LocalForm> {
        self.tangent.local_form()
    }
}

/// [`Bordered`] on a device.
struct DeviceBordered<'a> {
    tangent: Box<dyn OnDevice + 'a>,
    slope: GpuVector,
    direction: GpuVector,
}

impl LinearOperator<GpuVector> for DeviceBordered<'_> {
    fn apply(&self, x: &GpuVector, y: &mut GpuVector) {
        self.tangent.apply(x, y);
        let along = self.gpu().dot(&self.direction, x);
        self.gpu().axpy(along, &self.slope, y);
    }
}

impl OnDevice for DeviceBordered<'_> {
    fn gpu(&self) -> &Arc<Gpu> {
        self.tangent.gpu()
    }
}
