//! The checkers pass for shipped laws, judge a law with memory from where it starts, and say why a simulation cannot be judged. The studies tell
//! the rest: shipped shape functions pass (`patch`), and wrong ones and wrong laws are named (`mutants`).

use bfree::approximation::{Approximation, Bspline};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{InternalVariable, Lame, LameError, Law, Material, MaterialState, NeoHookean};
use bfree::particles::{Body, Particles};
use bfree::scalar::Real;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, contract, scaled, symmetric};
use verification::{Report, check_material, check_material_from, check_tangent};

/// The first labels of the cells that fail, each once.
fn red(report: &Report) -> Vec<&str> {
    let mut red: Vec<&str> = report.failures().filter_map(|cell| cell.labels.first().map(String::as_str)).collect();
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
        assert_eq!(red(&later), expected, "{later}");
    }
}

#[test]
fn a_simulation_that_cannot_be_set_up_fails_with_the_reason() -> Result<(), LameError> {
    let mut particles = Particles::default();
    particles.push(Vector::from([-7.0, 1.0]), Vector::zeros(), 0.09, 0.09, 0);
    let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [6, 6] };
    let law: Material = NeoHookean::ciarlet(lame()?).into();
    let bodies = vec![Body { name: "patch".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }];
    let shape: Approximation = Bspline::Quadratic.into();
    let report = check_tangent(&Simulation::new(grid, shape, bodies, particles, Clock::new(0.01, 0)));
    assert!(!report.passed());
    assert!(report.to_string().contains("particle 0"), "{report}");
    Ok(())
}
