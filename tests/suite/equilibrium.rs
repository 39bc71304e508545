//! The equilibrium of one step, asked directly: whether its own check sees a wrong tangent, and what its magnitudes are.

use crate::support::Failure;
use bfree::approximation::{Approximation, Linear};
use bfree::grid::Grid;
use bfree::material::{ClosedTangent, Lame, Law, NeoHookean};
use bfree::mechanics::check::{CheckError, Compared, Site, TangentMismatch, direction, tangent_bound};
use bfree::mechanics::loads::{PrescribedDof, PressurePoint};
use bfree::mechanics::residual::{Carry, Equilibrium};
use bfree::mechanics::sweep::Supports;
use bfree::mechanics::tangent::Term;
use bfree::mechanics::time::Newmark;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::{Body, Particles};
use bfree::scalar::Real;
use bfree::solver::NonlinearProblem;
use bfree::tensor::{Deformation, Tensor, Vector, scaled};

/// What is wrong with a law.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Nothing,
    /// ℂ is larger than ∂S/∂E.
    Elasticity,
    /// What is frozen is not the tangent.
    Frozen,
}

/// Ciarlet's law, a millionth of its tangent too much.
#[derive(Clone, Copy, Debug)]
struct Faulty(NeoHookean, Fault);

const EXCESS: f64 = 1.0 + 1e-6;

impl Law for Faulty {
    type Frozen<T: Real, const D: usize> = ClosedTangent<T, D>;

    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        self.0.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        self.0.stress(at)
    }

    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        let factor = if self.1 == Fault::Elasticity { EXCESS } else { 1.0 };
        scaled(&self.0.elasticity(at, x), T::lit(factor))
    }

    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> ClosedTangent<T, D> {
        let factor = if self.1 == Fault::Frozen { EXCESS } else { 1.0 };
        self.0.freeze(f_n, at, volume * T::lit(factor))
    }
}

/// Numbers without pattern in (−1, 1).
fn irregular(k: usize) -> f64 {
    2.0 * ((k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0
}

/// Deformed particles of two bodies on a small grid; the second body begins at particle `SECOND`.
struct Cloud<const D: usize> {
    particles: Particles<D>,
    bodies: Vec<Body<Faulty>>,
    supports: Supports<D>,
    nodal: Nodal<D>,
}

const SECOND: usize = 7;

fn cloud<const D: usize>(stress: f64, fault: Fault) -> Result<Cloud<D>, Failure> {
    let law = NeoHookean::ciarlet(Lame::new(1.5 * stress, stress)?);
    let body = |fault| Body { name: "part".into(), law: Faulty(law, fault), density: 1.0 };
    let mut particles = Particles::default();
    for p in 0..12 {
        let number = |k: usize| irregular(31 * p + k);
        let position = Vector::from_fn(|k, _| 1.5 + 1.4 * number(k));
        particles.push(position, Vector::from_fn(|k, _| number(3 + k)), 0.5, 0.3 * stress, u32::from(p >= SECOND));
        particles.acceleration[p] = Vector::from_fn(|k, _| number(6 + k));
        particles.displacement_gradient[p] = Tensor::from_fn(|i, k| 0.2 * number(9 + D * i + k));
    }
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [3; D] };
    let (supports, nodes) = Supports::new(&Approximation::from(Linear), &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &supports, nodes.len(), 1.0)?;
    Ok(Cloud { particles, bodies: vec![body(Fault::Nothing), body(fault)], supports, nodal })
}

impl<const D: usize> Cloud<D> {
    fn nodes(&self) -> usize {
        self.nodal.mass.len()
    }

    fn equilibrium<'a>(&'a self, lumping: f64, prescribed: &'a [PrescribedDof]) -> Equilibrium<'a, D, Faulty> {
        let alphas = Newmark::default().alphas(0.5);
        let dead = vec![Vector::zeros(); self.nodes()];
        Equilibrium::new(
            &self.particles,
            &self.bodies,
            &self.supports,
            alphas,
            lumping,
            &self.nodal,
            dead,
            Vec::new(),
            prescribed,
        )
    }

    /// A small increment without pattern.
    fn increment(&self) -> Vec<Vector<f64, D>> {
        direction(self.nodes(), 5).iter().map(|u: &Vector<f64, D>| u * 0.03).collect()
    }

    /// Nothing moves and nothing is deformed.
    fn at_rest(mut self) -> Self {
        self.particles.displacement_gradient.fill(Tensor::zeros());
        self.nodal.velocity.fill(Vector::zeros());
        self.nodal.acceleration.fill(Vector::zeros());
        self
    }
}

fn mismatch(result: Result<(), CheckError>) -> Result<TangentMismatch, Failure> {
    match result {
        Err(CheckError::Mismatch(mismatch)) => Ok(*mismatch),
        other => Err(format!("no mismatch, but {other:?}").into()),
    }
}

fn a_wrong_law_is_found<const D: usize>(stress: f64) -> Result<(), Failure> {
    let check = |fault| -> Result<_, Failure> {
        let cloud = cloud::<D>(stress, fault)?;
        let mut equilibrium = cloud.equilibrium(0.5, &[]);
        let force = Vector::repeat(0.1 * stress);
        equilibrium.pressures = vec![PressurePoint { particle: 3, force }];
        Ok(equilibrium.check_tangent(&cloud.increment(), &direction(cloud.nodes(), 1)))
    };
    check(Fault::Nothing)??;
    for (fault, compared) in [(Fault::Elasticity, Compared::Term(Term::Material)), (Fault::Frozen, Compared::Frozen)] {
        let found = mismatch(check(fault)?)?;
        assert_eq!((found.compared, found.site), (compared, Site::Particle(SECOND)), "{D}D, {fault:?}");
        assert!(found.row < D && found.column < D);
        // The whole tangent, or its material term, is too large by the same factor in every component.
        assert!((found.analytic / found.dual / EXCESS - 1.0).abs() < 1e-12, "{found}");
        assert!((found.analytic - found.dual).abs() > 1e3 * found.bound * found.scale, "{found}");
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
    let cloud = cloud::<2>(1.0, Fault::Nothing)?;
    let (dphi, u) = (cloud.increment(), direction(cloud.nodes(), 1));
    let mut equilibrium = cloud.equilibrium(1.0, &[]);
    equilibrium.alphas.a1 = f64::NAN;
    let found = mismatch(equilibrium.check_tangent(&dphi, &u))?;
    assert_eq!((found.compared, found.site), (Compared::Term(Term::Inertia), Site::Node(0)));
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

#[test]
fn directions_fill_the_interval_evenly_and_differ() {
    let entries = |seed| -> Vec<f64> {
        direction::<3>(500, seed).iter().flat_map(|u| u.iter().copied().collect::<Vec<_>>()).collect()
    };
    for seed in [0, 1, 2, 1000] {
        let u = entries(seed);
        let mut tenths = [0; 10];
        for x in &u {
            assert!((-1.0..1.0).contains(x));
            tenths[(5.0 * (x + 1.0)) as usize] += 1;
        }
        assert!(tenths.iter().all(|&count: &i32| (count - 150).abs() <= 5), "seed {seed}: {tenths:?}");
        let mut sorted = u.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] > 1e-4), "seed {seed}: an entry twice");
        assert!(entries(seed + 1).iter().zip(&u).all(|(x, y)| (x - y).abs() > 1e-2), "seeds {seed} and the next");
    }
}

fn norm<const D: usize>(field: &[Vector<f64, D>]) -> f64 {
    field.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}

fn flat<const D: usize>(field: &[Vector<f64, D>]) -> Vec<f64> {
    field.iter().flat_map(|x| x.iter().copied().collect::<Vec<_>>()).collect()
}

/// The magnitude over the norm of the residual; Newton's method is told the same one.
fn share<const D: usize>(equilibrium: &Equilibrium<'_, D, Faulty>, dphi: &[Vector<f64, D>]) -> Result<f64, Failure> {
    let mut residual = equilibrium.residual::<f64>(dphi, Carry::ALL)?;
    equilibrium.clear_prescribed(&mut residual);
    let magnitude = equilibrium.magnitude(dphi)?;
    assert_eq!(NonlinearProblem::magnitude(equilibrium, &flat(dphi))?, magnitude);
    Ok(magnitude / norm(&residual))
}

fn magnitudes<const D: usize>() -> Result<(), Failure> {
    let moving = cloud::<D>(3.0, Fault::Nothing)?;
    // Many contributions of both signs: more than what is left of them.
    assert!(share(&moving.equilibrium(1.0, &[]), &moving.increment())? > 1.0);
    let cloud = moving.at_rest();
    let rest = vec![Vector::zeros(); cloud.nodes()];
    let alone = |what: &str, share: f64| assert!((share - 1.0).abs() < 1e-12, "{D}D, {what} alone: {share}");
    // Gravity.
    let mut equilibrium = cloud.equilibrium(1.0, &[]);
    for (dead, m) in equilibrium.dead_load.iter_mut().zip(&cloud.nodal.mass) {
        *dead = Vector::from_fn(|k, _| -9.81 * m * (k as f64 + 1.0));
    }
    alone("gravity", share(&equilibrium, &rest)?);
    // Follower pressure on two particles.
    let mut equilibrium = cloud.equilibrium(1.0, &[]);
    let force = Vector::from_fn(|k, _| -2.0 - k as f64);
    equilibrium.pressures = [2, 9].map(|particle| PressurePoint { particle, force }).to_vec();
    alone("pressure", share(&equilibrium, &rest)?);
    // α₁ Δφ: the same Δφ everywhere strains nothing.
    let carried = vec![Vector::repeat(-0.1); cloud.nodes()];
    alone("α₁", share(&cloud.equilibrium(1.0, &[]), &carried)?);
    // α₂ v_n and α₃ a_n, α₃ of either sign.
    for a3 in [0.7, -0.7] {
        for velocity in [true, false] {
            let mut nodal = cloud.nodal.clone();
            let field = if velocity { &mut nodal.velocity } else { &mut nodal.acceleration };
            field.copy_from_slice(&direction(cloud.nodes(), 3));
            let mut equilibrium = cloud.equilibrium(1.0, &[]);
            equilibrium.nodal = &nodal;
            equilibrium.alphas.a3 = a3;
            alone("v_n or a_n", share(&equilibrium, &rest)?);
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
        let cloud = cloud::<2>(3.0, Fault::Nothing)?;
        let mut equilibrium = cloud.equilibrium(lumping, &[]);
        let dphi = cloud.increment();
        let of = |equilibrium: &Equilibrium<'_, 2, Faulty>| equilibrium.potential::<f64>(&dphi).ok_or("no potential");
        let (potential, magnitude) = of(&equilibrium)??;
        assert!(potential > 0.0 && (magnitude / potential - 1.0).abs() < 1e-14, "{potential} {magnitude}");
        // A load adds minus its work to the one and the magnitudes of its parts to the other.
        equilibrium.dead_load.copy_from_slice(&direction(cloud.nodes(), 9));
        let works: Vec<f64> = equilibrium.dead_load.iter().zip(&dphi).map(|(f, u)| f.dot(u)).collect();
        let (loaded, larger) = of(&equilibrium)??;
        let merit = NonlinearProblem::potential(&equilibrium, &flat(&dphi)).ok_or("no merit")??;
        assert_eq!(merit, (loaded, larger), "what the line search sees");
        let (work, size): (f64, f64) = (works.iter().sum(), works.iter().map(|w| w.abs()).sum());
        assert!((loaded - (potential - work)).abs() < 1e-13 * potential, "{loaded}");
        assert!((larger - (magnitude + size)).abs() < 1e-13 * magnitude, "{larger}");
        // Under follower pressure there is none.
        equilibrium.pressures = vec![PressurePoint { particle: 0, force: Vector::zeros() }];
        assert!(equilibrium.potential::<f64>(&dphi).is_none());
    }
    Ok(())
}
