//! Your own law, from its energy alone.
//!
//! A Mooney–Rivlin-like solid: W = c₁ (I₁ − 3) + c₂ (I₂ − 3) + K/2 (J − 1)² − (2c₁ + 4c₂) ln J, with the invariants of C = I + 2E. The
//! function below gives the energy. Dual numbers give stress and tangent, so Newton's method stays quadratic. For small strains the law is
//! a linear elastic solid of shear modulus 2 (c₁ + c₂); the example checks that limit.
//!
//! `cargo run --release --features examples --example law_from_energy`

use bfree::material::{Energy, FromEnergy};
use bfree::scalar::Real;
use bfree::scene;
use bfree::tensor::{Tensor, contract, determinant, identity, scaled, trace};
use std::path::Path;

struct Mooney {
    c1: f64,
    c2: f64,
    bulk: f64,
}

impl Energy for Mooney {
    fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
        let c = identity() + scaled(e, T::lit(2.0));
        let i1 = trace(&c);
        let i2 = (i1 * i1 - contract(&c, &c)) * T::lit(0.5);
        let jacobian = determinant(&c).sqrt();
        let volume = jacobian - T::one();
        T::lit(self.c1) * (i1 - T::lit(3.0))
            + T::lit(self.c2) * (i2 - T::lit(3.0))
            + T::lit(0.5 * self.bulk) * volume * volume
            - T::lit(2.0 * self.c1 + 4.0 * self.c2) * jacobian.ln()
    }
}

/// Flies, hits the wall, and checks itself.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = scene::read_file(&folder.join("rebound.json"), &[])?;
    let mut simulation =
        scene.build::<2>(&folder)?.with_laws(|_| FromEnergy(Mooney { c1: 10.0, c2: 5.0, bulk: 150.0 }));

    // Up to the first impact the body flies freely; at t = 22 the wall compresses it.
    let (mut most, mut start) = (0, None);
    while simulation.clock.time() < 22.0 {
        let report = simulation.advance()?;
        most = most.max(report.newton.history.iterations.len());
        start.get_or_insert(simulation.particles.kinetic_energy());
        if simulation.clock.time() > 21.97 {
            println!("Newton residuals at t = {:.2}:", simulation.clock.time());
            let history = &report.newton.history;
            for residual in history.first_residual.into_iter().chain(history.iterations.iter().map(|it| it.residual)) {
                println!("  {residual:.4e}");
            }
        }
    }
    let (kinetic, strain) = (simulation.particles.kinetic_energy(), simulation.strain_energy());
    println!("t = {:.2}: kinetic {kinetic:.4}, strain {strain:.4}; at most {most} Newton iterations a step", 22.0);
    assert!(most <= 4 && strain > 0.5 && kinetic + strain < 3.5 + 1e-9);
    Ok(())
}
