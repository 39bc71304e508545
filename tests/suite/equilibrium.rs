//! The equilibrium of one step, used directly: its own check of the tangent, and its round-off bounds (magnitudes).

use crate::support::{Failure, body, irregular};
use bfree::approximation::{Approximation, Linear};
use bfree::grid::Grid;
use bfree::material::{ClosedTangent, Lame, Law, MaterialState, NeoHookean};
use bfree::mechanics::check::{CheckError, TangentMismatch, direction, tangent_bound};
use bfree::mechanics::loads::ForceField;
use bfree::mechanics::loads::{Curve, Gravity, Loads, PrescribedDof, Pressing, SurfaceLoad, SurfacePoint};
use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::schemes::Newmark;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::{Body, Particles};
use bfree::scalar::Real;
use bfree::solver::NonlinearProblem;
use bfree::tensor::{Tensor, Vector, outer, scaled};
use std::sync::Arc;

/// The function of a law that is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Nothing,
    /// S is larger than the S of the tangents.
    Stress,
    /// S is larger for plain numbers only.
    PlainStress,
    /// ℂ is larger than ∂S/∂E.
    Elasticity,
    /// ℂmat is larger than ℂ.
    Density,
    /// The closed form is larger than the tangent.
    Closed,
}

/// Ciarlet's law, with a closed form or without. The function named by `fault` is a millionth too large.
#[derive(Clone, Copy, Debug)]
struct Faulty {
    law: NeoHookean,
    fault: Fault,
    closed: bool,
}

const EXCESS: f64 = 1.0 + 1e-6;

impl Faulty {
    /// The factor on the result of the function `here`.
    fn factor(&self, here: Fault) -> f64 {
        if self.fault == here { EXCESS } else { 1.0 }
    }
}

impl Law for Faulty {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.law.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let plain = size_of::<T>() == size_of::<f64>();
        let factor = self.factor(Fault::Stress) * if plain { self.factor(Fault::PlainStress) } else { 1.0 };
        scaled(&self.law.stress(at), T::lit(factor))
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        self.law.elasticity(at, x) * self.factor(Fault::Elasticity)
    }

    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        // ℂmat as it follows from ℂ.
        let mut density = Tensor::<f64, D>::zeros();
        for k in 0..D {
            let a = Vector::<f64, D>::from_fn(|i, _| f64::from(i == k));
            density.set_column(k, &(self.elasticity(at, &outer(&a, b)) * v));
        }
        density * self.factor(Fault::Density)
    }

    fn closed<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &MaterialState<T, D>,
        volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        let closed = self.law.closed(f_n, at, volume * T::lit(self.factor(Fault::Closed)));
        closed.filter(|_| self.closed)
    }
}

/// Deformed particles of two bodies on a small grid; the second body begins at particle `SECOND`.
struct Cloud<const D: usize> {
    particles: Particles<D>,
    bodies: Vec<Body<Faulty>>,
    loads: Loads<D>,
    connectivity: Connectivity<D>,
    nodal: Nodal<D>,
}

const SECOND: usize = 7;

/// A cloud whose second body has a wrong law.
fn cloud<const D: usize>(stress: f64, fault: Fault, closed: bool) -> Result<Cloud<D>, Failure> {
    let law = NeoHookean::ciarlet(Lame::new(1.5 * stress, stress)?);
    let body = |fault| body(Faulty { law, fault, closed });
    let mut particles = Particles::default();
    for p in 0..12 {
        let number = |k: usize| irregular(31 * p + k);
        let position = Vector::from_fn(|k, _| 1.5 + 1.4 * number(k));
        particles.push(position, Vector::from_fn(|k, _| number(3 + k)), 0.5, 0.3 * stress, u32::from(p >= SECOND));
        particles.acceleration[p] = Vector::from_fn(|k, _| number(6 + k));
        particles.displacement_gradient[p] = Tensor::from_fn(|i, k| 0.2 * number(9 + D * i + k));
    }
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [3; D] };
    let (connectivity, _) = Connectivity::new(&Approximation::from(Linear), &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
    let bodies = vec![body(Fault::Nothing), body(fault)];
    Ok(Cloud { particles, bodies, loads: Loads::default(), connectivity, nodal })
}

fn truthful<const D: usize>(stress: f64) -> Result<Cloud<D>, Failure> {
    cloud(stress, Fault::Nothing, true)
}

/// Follower pressure of p A N = `force` on some particles.
fn pressures<const D: usize>(particles: &[usize], force: Vector<f64, D>) -> Vec<SurfaceLoad<D>> {
    let points = particles.iter().map(|&particle| SurfacePoint::new(particle, force, 1.0));
    vec![SurfaceLoad { pressing: Pressing::Pressure(1.0), curve: Curve::constant(1.0), points: points.collect() }]
}

impl<const D: usize> Cloud<D> {
    fn nodes(&self) -> usize {
        self.nodal.mass.len()
    }

    fn step(&self, lumping: f64) -> Step<'_, D, Faulty> {
        let Self { particles, bodies, loads, connectivity, nodal } = self;
        let dt = 0.5;
        let alphas = Newmark::default().alphas(dt);
        Step { particles, bodies, loads, connectivity, nodal, alphas, lumping, time: 0.0, dt, poses: None }
    }

    fn equilibrium<'a>(&'a self, lumping: f64, prescribed: &'a [PrescribedDof]) -> Equilibrium<'a, D, Faulty> {
        Equilibrium::new(self.step(lumping), prescribed)
    }

    /// A small irregular increment.
    fn increment(&self) -> Vec<Vector<f64, D>> {
        direction(self.nodes(), 5).iter().map(|u: &Vector<f64, D>| u * 0.03).collect()
    }

    /// The cloud without velocity and without deformation.
    fn at_rest(mut self) -> Self {
        self.particles.displacement_gradient.fill(Tensor::zeros());
        self.nodal.velocity.fill(Vector::zeros());
        self.nodal.acceleration.fill(Vector::zeros());
        self
    }
}

fn mismatch(result: Result<(), CheckError>) -> Result<TangentMismatch, Failure> {
    match result {
        Err(CheckError::Mismatch(mismatch)) => Ok(mismatch),
        other => Err(format!("no mismatch, but {other:?}").into()),
    }
}

/// The pieces whose products differ from the derivatives of their residuals by a hundredth of the excess of a wrong law.
fn wrong_pieces<const D: usize>(
    equilibrium: &Equilibrium<'_, D, Faulty>,
    dphi: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
) -> Result<Vec<&'static str>, Failure> {
    let mut wrong = Vec::new();
    for piece in equilibrium.terms.pieces() {
        let (mut product, dual) = (vec![Vector::zeros(); u.len()], equilibrium.derivative(piece, dphi, u)?);
        equilibrium.tangent(piece, dphi)?.product(u, &mut product);
        let apart: Vec<_> = product.iter().zip(&dual).map(|(a, b)| a - b).collect();
        // In 1D a follower pressure has no derivative.
        let size = norm(&dual).max(norm(&equilibrium.residual_of::<f64>(piece, dphi)?));
        if norm(&apart) > 0.01 * (EXCESS - 1.0) * size {
            wrong.push(piece.name);
        }
    }
    Ok(wrong)
}

fn a_wrong_law_is_found<const D: usize>(stress: f64) -> Result<(), Failure> {
    // The fault in the law of the second body, whether the law has a closed form, and the wrong pieces. The check names the first.
    let both: &[&str] = &["stress", "material"];
    for (fault, closed, wrong) in [
        (Fault::Nothing, true, &[][..]),
        (Fault::Nothing, false, &[]),
        (Fault::Stress, true, both),
        (Fault::Stress, false, both),
        // The closed form needs no S, but its parts do.
        (Fault::PlainStress, true, &["geometric", "material"]),
        (Fault::PlainStress, false, &["stress", "geometric"]),
        // No product needs ℂ or ℂmat if there is a closed form.
        (Fault::Elasticity, true, &[]),
        (Fault::Elasticity, false, both),
        (Fault::Density, true, &[]),
        (Fault::Density, false, both),
        (Fault::Closed, true, both),
    ] {
        let case = format!("{D}D, {fault:?}, closed: {closed}");
        let mut cloud = cloud::<D>(stress, fault, closed)?;
        cloud.loads.surface = pressures(&[3], Vector::repeat(0.1 * stress));
        let (equilibrium, dphi, u) = (cloud.equilibrium(0.5, &[]), cloud.increment(), direction(cloud.nodes(), 1));
        let names: Vec<_> = equilibrium.terms.pieces().iter().map(|piece| piece.name).collect();
        assert_eq!(names, ["inertia", "stress", "geometric", "material", "follower pressure"], "{case}");
        assert_eq!(wrong_pieces(&equilibrium, &dphi, &u)?, wrong, "{case}");
        let Some(&first) = wrong.first() else {
            equilibrium.check_tangent(&dphi, &u).map_err(|error| format!("{case}: {error}"))?;
            continue;
        };
        let found = mismatch(equilibrium.check_tangent(&dphi, &u))?;
        assert_eq!(found.compared, first, "{case}");
        let seen = |p: usize| cloud.connectivity.of(p).any(|(node, _, _)| node == found.node);
        assert!((SECOND..12).any(seen) && found.axis < D, "{case}: {found}");
        assert!((found.analytic - found.dual).abs() > 1e3 * found.bound * found.scale, "{case}: {found}");
    }
    Ok(())
}

#[test]
fn a_run_that_checks_its_tangent_finds_a_wrong_law_in_every_unit_of_stress() -> Result<(), Failure> {
    for stress in [1e-9, 1.0, 1e9] {
        a_wrong_law_is_found::<1>(stress)?;
        a_wrong_law_is_found::<2>(stress)?;
        a_wrong_law_is_found::<3>(stress)?;
    }
    Ok(())
}

#[test]
fn what_is_not_a_number_is_a_mismatch_at_its_node() -> Result<(), Failure> {
    for node in [0, 5] {
        let mut cloud = truthful::<2>(1.0)?;
        cloud.nodal.mass[node] = f64::NAN;
        let (dphi, u) = (cloud.increment(), direction(cloud.nodes(), 1));
        let found = mismatch(cloud.equilibrium(1.0, &[]).check_tangent(&dphi, &u))?;
        assert_eq!((found.compared, found.node), ("inertia", node), "{found}");
    }
    Ok(())
}

#[test]
fn the_bound_on_the_tangent_is_round_off_times_the_condition_of_f_and_has_a_limit() {
    let stretched = |a: f64, b: f64| tangent_bound(&Tensor::<f64, 2>::new(a, 0.0, 0.0, b));
    // ‖F‖ ‖F⁻¹‖ = a/b + b/a for stretches a and b, at any size of the body.
    for (a, b) in [(1.0, 1.0), (10.0, 1.0), (3.0, 0.2), (5e-3, 4e3)] {
        let condition: f64 = a / b + b / a;
        let expected = (64.0 * f64::EPSILON * condition.powi(2)).min(1e-10);
        assert!((stretched(a, b) / expected - 1.0).abs() < 1e-13, "{} for {expected}", stretched(a, b));
    }
    let rotation = Tensor::<f64, 2>::new(0.6, -0.8, 0.8, 0.6);
    assert!((tangent_bound(&rotation) / stretched(1.0, 1.0) - 1.0).abs() < 1e-13);
    assert_eq!(stretched(1e4, 1.0), 1e-10);
}

fn norm<const D: usize>(field: &[Vector<f64, D>]) -> f64 {
    field.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}

fn flat<const D: usize>(field: &[Vector<f64, D>]) -> Vec<f64> {
    field.iter().flat_map(|x| x.iter().copied().collect::<Vec<_>>()).collect()
}

/// The magnitude over the norm of the residual. Newton's method must receive the same magnitude.
fn share<const D: usize>(equilibrium: &Equilibrium<'_, D, Faulty>, dphi: &[Vector<f64, D>]) -> Result<f64, Failure> {
    let mut residual = equilibrium.residual::<f64>(dphi)?;
    equilibrium.clear_prescribed(&mut residual);
    let magnitude = equilibrium.magnitude(dphi)?;
    assert_eq!(NonlinearProblem::magnitude(equilibrium, &flat(dphi))?, magnitude);
    Ok(magnitude / norm(&residual))
}

fn magnitudes<const D: usize>() -> Result<(), Failure> {
    let moving = truthful::<D>(3.0)?;
    // Contributions of both signs cancel, so the magnitude exceeds the residual.
    assert!(share(&moving.equilibrium(1.0, &[]), &moving.increment())? > 1.0);
    let mut cloud = moving.at_rest();
    let rest = vec![Vector::zeros(); cloud.nodes()];
    let alone = |what: &str, share: f64| assert!((share - 1.0).abs() < 1e-12, "{D}D, {what} alone: {share}");
    let acceleration = Vector::from_fn(|k, _| -9.81 * (k as f64 + 1.0));
    cloud.loads.gravity = Some(Gravity { acceleration, curve: Curve::constant(1.0) });
    alone("gravity", share(&cloud.equilibrium(1.0, &[]), &rest)?);
    let surface = pressures(&[2, 9], Vector::from_fn(|k, _| -2.0 - k as f64));
    cloud.loads = Loads { surface, ..Loads::default() };
    alone("pressure", share(&cloud.equilibrium(1.0, &[]), &rest)?);
    cloud.loads = Loads::default();
    // α₁ Δφ: a uniform Δφ causes no strain.
    let carried = vec![Vector::repeat(-0.1); cloud.nodes()];
    alone("α₁", share(&cloud.equilibrium(1.0, &[]), &carried)?);
    // α₂ v_n and α₃ a_n, with both signs of α₃.
    for a3 in [0.7, -0.7] {
        for velocity in [true, false] {
            let mut nodal = cloud.nodal.clone();
            let field = if velocity { &mut nodal.velocity } else { &mut nodal.acceleration };
            field.copy_from_slice(&direction(cloud.nodes(), 3));
            let mut step = Step { nodal: &nodal, ..cloud.step(1.0) };
            step.alphas.a3 = a3;
            alone("v_n or a_n", share(&Equilibrium::new(step, &[]), &rest)?);
        }
    }
    Ok(())
}

#[test]
fn one_contribution_alone_is_as_large_as_the_residual() -> Result<(), Failure> {
    magnitudes::<1>()?;
    magnitudes::<2>()?;
    magnitudes::<3>()
}

#[test]
fn the_potential_without_loads_is_a_sum_of_nothing_negative() -> Result<(), Failure> {
    for lumping in [1.0, 0.5, 0.0] {
        let mut cloud = truthful::<2>(3.0)?;
        let dphi = cloud.increment();
        let of = |equilibrium: &Equilibrium<'_, 2, Faulty>| equilibrium.potential::<f64>(&dphi).ok_or("no potential");
        let (potential, magnitude) = of(&cloud.equilibrium(lumping, &[]))??;
        assert!(potential > 0.0 && (magnitude / potential - 1.0).abs() < 1e-14, "{potential} {magnitude}");
        // A load subtracts its work from the potential and adds the magnitudes of its parts to the bound.
        let forces = direction::<2>(cloud.particles.len(), 9);
        cloud.loads.field = Some(ForceField(Arc::new(move |id, _, _| forces[id])));
        let equilibrium = cloud.equilibrium(lumping, &[]);
        let force = equilibrium.external_force(&dphi)?;
        let works: Vec<f64> = force.iter().zip(&dphi).map(|(f, u)| f.dot(u)).collect();
        let (loaded, larger) = of(&equilibrium)??;
        let merit = NonlinearProblem::potential(&equilibrium, &flat(&dphi)).ok_or("no merit")??;
        assert_eq!(merit, (loaded, larger), "what the line search sees");
        let (work, size): (f64, f64) = (works.iter().sum(), works.iter().map(|w| w.abs()).sum());
        assert!(work.abs() > 1e-3 * potential, "{work}");
        assert!((loaded - (potential - work)).abs() < 1e-13 * potential, "{loaded}");
        assert!((larger - (magnitude + size)).abs() < 1e-13 * magnitude, "{larger}");
        // Under follower pressure there is no potential.
        cloud.loads.surface = pressures(&[0], Vector::zeros());
        assert!(cloud.equilibrium(lumping, &[]).potential::<f64>(&dphi).is_none());
    }
    Ok(())
}

/// The area vector is a polynomial of F, so the tangent of a pressure has all digits at a particle that is pressed flat. In 1D it is zero.
fn a_pressure_acts_on_flat_particles<const D: usize>() -> Result<(), Failure> {
    let mut cloud = truthful::<D>(1.0)?;
    let normal = Vector::<f64, D>::from_fn(|k, _| 1.0 + irregular(k)).normalize();
    // F_r = I − n ⊗ n has no inverse.
    cloud.particles.displacement_gradient[3] = -outer(&normal, &normal);
    cloud.loads.surface = pressures(&[3], Vector::from_fn(|k, _| 1.0 + k as f64));
    let (equilibrium, dphi, u) = (cloud.equilibrium(1.0, &[]), cloud.increment(), direction(cloud.nodes(), 1));
    let piece = equilibrium.terms.pieces().into_iter().find(|piece| piece.name == "follower pressure");
    let piece = piece.ok_or("no pressure")?;
    let tangent = equilibrium.tangent(piece, &dphi)?;
    let checked = |u: &[Vector<f64, D>]| -> Result<_, Failure> {
        let (mut product, dual) = (vec![Vector::zeros(); u.len()], equilibrium.derivative(piece, &dphi, u)?);
        tangent.product(u, &mut product);
        let apart: Vec<_> = product.iter().zip(&dual).map(|(a, b)| a - b).collect();
        assert!(norm(&apart) <= 1e-14 * norm(&dual), "{D}D: {} of {}", norm(&apart), norm(&dual));
        Ok(product)
    };
    checked(&u)?;
    let blocks = tangent.diagonal_blocks();
    for ((node, ..), k) in cloud.connectivity.of(3).flat_map(|of_node| (0..D).map(move |k| (of_node, k))) {
        let mut unit = vec![Vector::zeros(); u.len()];
        unit[node][k] = 1.0;
        let column = checked(&unit)?[node];
        assert!((column - blocks[node].column(k)).norm() <= 1e-14 * blocks[node].norm(), "{D}D, node {node}");
    }
    Ok(())
}

#[test]
fn a_pressure_on_a_flat_particle_has_an_exact_tangent() -> Result<(), Failure> {
    a_pressure_acts_on_flat_particles::<1>()?;
    a_pressure_acts_on_flat_particles::<2>()?;
    a_pressure_acts_on_flat_particles::<3>()
}
