//! The checkers pass for shipped laws and shape functions, and name the fault in wrong ones.

use bfree::approximation::{Approximation, ApproximationError, AxisWeights, Bspline, Linear, Lme, Separable, Validate};
use bfree::clock::Clock;
use bfree::grid::{Axis, Grid};
use bfree::material::{InternalVariable, Lame, LameError, Law, Material, MaterialState, NeoHookean};
use bfree::particles::{Body, Particles};
use bfree::scalar::Real;
use bfree::simulation::{Settings, Simulation};
use bfree::tensor::{Tensor, Vector, contract, scaled, symmetric};
use verification::{Report, check_approximation, check_material, check_material_from, check_tangent};

/// The labels in column `column` of the cells that fail, each once.
fn red(report: &Report, column: usize) -> Vec<&str> {
    let mut red: Vec<&str> = report.failures().filter_map(|cell| cell.labels.get(column).map(String::as_str)).collect();
    red.sort_unstable();
    red.dedup();
    red
}

fn lame() -> Result<Lame, LameError> {
    Lame::from_young_poisson(1000.0, 0.3)
}

#[test]
fn shipped_laws_pass() -> Result<(), LameError> {
    for (_, law) in Material::examples(lame()?) {
        let report = check_material(&law);
        assert!(report.passed(), "{law:?}\n{report}");
    }
    Ok(())
}

#[test]
fn shipped_shape_functions_pass() {
    for (_, shape) in Approximation::examples().into_iter().chain([("almost hats", Lme::new(4.0, 1e-6).into())]) {
        let report = check_approximation(&shape);
        assert!(report.passed(), "{shape:?}\n{report}");
    }
}

/// The fault of [`Wrong`]. A law without fault has the same type, so that what is generic is compiled once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Nothing,
    /// ℂ:X twice as large.
    Factor,
    /// ℂ treats X as symmetric.
    Symmetrisation,
}

/// Ciarlet's law with a fault in ℂ.
#[derive(Clone, Copy, Debug)]
struct Wrong {
    right: NeoHookean,
    fault: Fault,
}

impl Law for Wrong {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.right.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        self.right.stress(at)
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        match self.fault {
            Fault::Nothing => return self.right.elasticity(at, x),
            Fault::Factor => return scaled(&self.right.elasticity(at, x), 2.0),
            Fault::Symmetrisation => {}
        }
        // ΛJ² (C⁻¹:X) C⁻¹ − 2q C⁻¹ X C⁻¹
        let Lame { lambda, shear } = self.right.lame;
        let f_inv_t = at.inverse_transpose();
        let c_inv = f_inv_t.transpose() * f_inv_t;
        let q = 0.5 * lambda * at.jacobian_squared_minus_one() - shear;
        scaled(&c_inv, lambda * at.jacobian * at.jacobian * contract(&c_inv, x)) - scaled(&(c_inv * x * c_inv), q + q)
    }
}

fn wrong(fault: Fault) -> Result<Wrong, LameError> {
    Ok(Wrong { right: NeoHookean::ciarlet(lame()?), fault })
}

#[test]
fn a_factor_in_the_elasticity_is_named_and_nothing_else() -> Result<(), LameError> {
    let report = check_material(&wrong(Fault::Factor)?);
    assert_eq!(red(&report, 0), ["C:X against dual(S)"], "{report}");
    assert_eq!(red(&report, 1), ["1", "2", "3"], "{report}");
    assert_eq!(red(&report, 2).len(), 5, "{report}");
    Ok(())
}

#[test]
fn a_dropped_symmetrisation_shows_in_the_plane_and_in_space() -> Result<(), LameError> {
    let report = check_material(&wrong(Fault::Symmetrisation)?);
    assert_eq!(red(&report, 0), ["C:X against dual(S)"], "{report}");
    assert_eq!(red(&report, 1), ["2", "3"], "in 1D nothing is to be symmetrised\n{report}");
    Ok(())
}

/// 2G (1 − d) E with a damage d from earlier steps; `forgets` omits d in ℂ.
struct Damaged {
    shear: f64,
    forgets: bool,
}

impl Law for Damaged {
    fn internal_variables(&self) -> &[InternalVariable] {
        &[InternalVariable { name: "damage", at_rest: 0.0 }]
    }

    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let e = at.green_lagrange();
        contract(&e, &e) * T::lit(self.shear * (1.0 - at.internal[0]))
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        scaled(&at.green_lagrange(), T::lit(2.0 * self.shear * (1.0 - at.internal[0])))
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let left = if self.forgets { 1.0 } else { 1.0 - at.internal[0] };
        scaled(&symmetric(x), 2.0 * self.shear * left)
    }
}

#[test]
fn a_law_with_memory_is_judged_from_where_it_starts() {
    for law in [Damaged { shear: 3.0, forgets: false }, Damaged { shear: 3.0, forgets: true }] {
        let (at_rest, later) = (check_material(&law), check_material_from(&law, 0.1, &[0.25]));
        assert!(at_rest.passed(), "{at_rest}");
        let expected: &[&str] = if law.forgets { &["C:X against dual(S)"] } else { &[] };
        assert_eq!(red(&later, 0), expected, "{later}");
    }
}

/// Nine particles of one body in the middle of a grid, in motion.
fn patch(fault: Fault) -> Result<Simulation<2, Wrong>, LameError> {
    let mut particles = Particles::default();
    for p in 0..9 {
        let (i, k) = (f64::from(p % 3), f64::from(p / 3));
        let position = Vector::from([1.1 + 0.31 * i + 0.05 * k, 1.2 + 0.27 * k]);
        particles.push(position, Vector::from([0.4 * k - i, 0.7 * i]), 0.09, 0.09, 0);
    }
    let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [6, 6] };
    let law = wrong(fault)?;
    let bodies = vec![Body { name: "patch".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }];
    Ok(Simulation {
        settings: Settings { lumping: 0.5, ..Settings::default() },
        ..Simulation::new(grid, Bspline::Quadratic.into(), bodies, particles, Clock::new(0.01, 0))
    })
}

#[test]
fn the_tangent_of_a_simulation_is_judged_by_piece() -> Result<(), LameError> {
    let report = check_tangent(&patch(Fault::Nothing)?);
    assert!(report.passed(), "{report}");
    for fault in [Fault::Factor, Fault::Symmetrisation] {
        let report = check_tangent(&patch(fault)?);
        // Without a closed form the product uses ℂ: every piece that contains ℂ is wrong, and no other.
        assert_eq!(red(&report, 0), ["material", "stress", "whole product"], "{fault:?}\n{report}");
    }
    Ok(())
}

#[test]
fn a_simulation_that_cannot_be_set_up_fails_with_the_reason() -> Result<(), LameError> {
    let mut outside = patch(Fault::Nothing)?;
    outside.particles.position[4][0] = -7.0;
    let report = check_tangent(&outside);
    assert!(!report.passed());
    assert!(report.to_string().contains("particle 4"), "{report}");
    Ok(())
}

/// Hat functions whose slopes are a thousandth too steep.
struct Steep;

impl Validate for Steep {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

impl Separable for Steep {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        Linear.axis(axis, x, out)?;
        for derivative in &mut out.derivatives {
            *derivative *= 1.001;
        }
        Ok(())
    }

    fn width(&self) -> usize {
        2
    }
}

/// Splines without the ghost functions beyond a wall, which should be folded back.
struct Cut;

impl Validate for Cut {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

impl Separable for Cut {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        // Evaluated on a longer axis; the nodes that do not exist are dropped.
        const BEYOND: u32 = 3;
        let origin = axis.origin - f64::from(BEYOND) * axis.spacing;
        let longer = Axis { origin, cells: axis.cells + 2 * BEYOND, ..*axis };
        let mut all = AxisWeights::default();
        Bspline::Quadratic.axis(&longer, x, &mut all)?;
        let listed = |k: usize| (all.first + k as u32).checked_sub(BEYOND).filter(|&node| node <= axis.cells);
        out.start((0..all.values.len()).find_map(listed).unwrap_or(0));
        for k in (0..all.values.len()).filter(|&k| listed(k).is_some()) {
            out.push(all.values[k], all.derivatives[k]);
        }
        Ok(())
    }

    fn width(&self) -> usize {
        3
    }
}

#[test]
fn wrong_shape_functions_are_named() {
    let report = check_approximation(&Steep);
    assert_eq!(red(&report, 0), ["grad N against differences", "sum x_I grad N = I"], "{report}");
    let report = check_approximation(&Cut);
    let quantities = red(&report, 0);
    assert!(quantities.contains(&"sum N = 1") && !quantities.contains(&"grad N against differences"), "{report}");
}
