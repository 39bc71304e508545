//! Your own law with its own analytic tangent, checked in your CI.
//!
//! A quadratic–cubic solid, W = Λ/2 (tr E)² + G E:E + κ/3 (tr E)³: St. Venant–Kirchhoff that stiffens in tension by κ. A law needs its
//! energy and its stress. This one also writes the action ℂ:X of its tangent; without it, dual numbers would differentiate the stress. The
//! first test below is all that is needed to know, by term and by name, that they belong together. The second test pulls a bar:
//! `cargo test --release --package own_law`.

pub mod creep;

use bfree::material::{Law, MaterialState};
use bfree::scalar::Real;
use bfree::tensor::{Tensor, contract, identity, scaled, symmetric, trace};

/// W = Λ/2 (tr E)² + G E:E + κ/3 (tr E)³
#[derive(Clone, Copy, Debug)]
pub struct Stiffening {
    /// Λ
    pub lambda: f64,
    /// G
    pub shear: f64,
    /// κ
    pub kappa: f64,
}

impl Law for Stiffening {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let e = at.green_lagrange();
        let tr = trace(&e);
        T::lit(0.5 * self.lambda) * tr * tr
            + T::lit(self.shear) * contract(&e, &e)
            + T::lit(self.kappa / 3.0) * tr * tr * tr
    }

    /// S = (Λ tr E + κ (tr E)²) I + 2G E
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let e = at.green_lagrange();
        let tr = trace(&e);
        scaled(&identity(), T::lit(self.lambda) * tr + T::lit(self.kappa) * tr * tr)
            + scaled(&e, T::lit(2.0 * self.shear))
    }

    /// ℂ:X = (Λ + 2κ tr E) tr(X) I + 2G sym X
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let volumetric = self.lambda + 2.0 * self.kappa * trace(&at.green_lagrange());
        scaled(&identity(), volumetric * trace(x)) + scaled(&symmetric(x), 2.0 * self.shear)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bfree::scene;
    use verification::check_material;

    const LAW: Stiffening = Stiffening { lambda: 100.0, shear: 60.0, kappa: 40.0 };

    #[test]
    fn stress_and_tangent_are_the_derivatives_of_the_energy() {
        let report = check_material(&LAW);
        assert!(report.passed(), "{report}");
    }

    const BAR: &str = r#"{
        "grid": { "size": [3], "spacing": 0.25 },
        "time": { "step": 0.5, "end": 1, "scheme": "none" },
        "bodies": [{ "name": "bar", "shape": { "box": { "min": [0], "max": [2] } }, "density": 1,
                     "material": { "neo_hookean": { "lambda": 100, "shear": 60 } } }],
        "boundary": { "left": "fixed" },
        "tractions": [{ "body": "bar", "region": { "half_space": { "point": [2], "normal": [-1] } },
                        "traction": [25.8951], "curve": [[0, 0], [1, 1]] }]
    }"#;

    #[test]
    fn a_bar_under_this_traction_is_a_tenth_longer() -> Result<(), Box<dyn std::error::Error>> {
        // Uniaxial strain with F = 1.1: E = 0.105, S = (Λ + 2G) E + κ E² = 23.541, and the traction is P = F S = 25.8951.
        let mut simulation = scene::read(BAR, &[])?.build::<1>(".".as_ref())?.with_laws(|_| LAW);
        while simulation.clock.time() < 1.0 {
            simulation.advance()?;
        }
        let particles = simulation.particles.by_id();
        let stretch = 1.0 + particles.displacement_gradient[particles.position.len() / 2][(0, 0)];
        assert!((stretch - 1.1).abs() < 1e-3, "{stretch}");
        Ok(())
    }
}
