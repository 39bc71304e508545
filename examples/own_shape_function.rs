//! Your own shape function: hats and quadratic B-splines mixed.
//!
//! N = (1 − c) hat + c spline inherits two properties from both: Σ N = 1 and Σ N x_I = x. At a wall of the box, only the nodes of the wall
//! have N ≠ 0. N is a product of functions of one coordinate, so it implements [`Separable`] and uses the fast, sum-factorised transfer
//! without further code. In your own CI let `verification::check_approximation(&Mixed(0.5))` judge it.
//!
//! The example checks consistency at many points, and then mechanics: a free bar that was stretched vibrates with the period T = 2L/c of
//! its first mode, c² = M/ρ with the modulus M of uniaxial strain.
//!
//! `cargo run --release --features examples --example own_shape_function`

use bfree::approximation::{ApproximationError, AxisWeights, Bspline, Linear, Separable, Validate};
use bfree::clock::Clock;
use bfree::grid::{Axis, Grid};
use bfree::material::{Lame, Material, NeoHookean};
use bfree::particles::{Body, Particles};
use bfree::simulation::{Settings, Simulation};
use bfree::tensor::Vector;
use std::error::Error;

/// The share c of the spline, in [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct Mixed(pub f64);

impl Validate for Mixed {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        // A real family would refuse c outside [0, 1] here, with an error of its own.
        Ok(())
    }
}

impl Separable for Mixed {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        let (mut hat, mut spline) = (AxisWeights::default(), AxisWeights::default());
        Linear.axis(axis, x, &mut hat)?;
        Bspline::Quadratic.axis(axis, x, &mut spline)?;
        let end = |weights: &AxisWeights| weights.first + weights.values.len() as u32;
        let first = hat.first.min(spline.first);
        out.start(first);
        for node in first..end(&hat).max(end(&spline)) {
            let of = |weights: &AxisWeights| {
                let k = node.checked_sub(weights.first).map(|k| k as usize);
                k.and_then(|k| Some((*weights.values.get(k)?, *weights.derivatives.get(k)?))).unwrap_or_default()
            };
            let ((n_hat, d_hat), (n_spline, d_spline)) = (of(&hat), of(&spline));
            out.push((1.0 - self.0) * n_hat + self.0 * n_spline, (1.0 - self.0) * d_hat + self.0 * d_spline);
        }
        Ok(())
    }

    fn width(&self) -> usize {
        3
    }
}

const LENGTH: f64 = 2.0;
const DENSITY: f64 = 1.0;

/// A bar of length 2 in a box of length 4, stretched in the shape of its first mode: u = A sin(π s/L), with s measured from its middle.
fn stretched(lame: Lame) -> Simulation<1, Material, Mixed> {
    let grid = Grid { origin: Vector::zeros(), spacing: 0.05, cells: [80] };
    let (mut particles, count, amplitude) = (Particles::default(), 80, 1e-4);
    let volume = LENGTH / f64::from(count);
    for k in 0..count {
        let s = (f64::from(k) + 0.5) * volume - 0.5 * LENGTH;
        let phase = std::f64::consts::PI * s / LENGTH;
        particles.push(Vector::from([2.0 + s + amplitude * phase.sin()]), Vector::zeros(), volume, DENSITY * volume, 0);
        let gradient = amplitude * std::f64::consts::PI / LENGTH * phase.cos();
        if let Some(h) = particles.displacement_gradient.last_mut() {
            h[(0, 0)] = gradient;
        }
    }
    let bodies = vec![Body {
        name: "bar".into(),
        law: NeoHookean::ciarlet(lame).into(),
        density: DENSITY,
        dilatation: Default::default(),
        field: 0,
    }];
    Simulation {
        settings: Settings { lumping: 0.02, ..Settings::default() },
        ..Simulation::new(grid, Mixed(0.5), bodies, particles, Clock::new(0.01, 0))
    }
}

/// Checks consistency and the period.
pub fn main() -> Result<(), Box<dyn Error>> {
    let axis = Axis { origin: -1.0, spacing: 0.25, cells: 8 };
    for k in 0..=1000 {
        let x = -1.0 + 0.002 * f64::from(k);
        let mut weights = AxisWeights::default();
        Mixed(0.5).axis(&axis, x, &mut weights)?;
        let nodes = (0..).map(|i| axis.origin + axis.spacing * f64::from(weights.first + i));
        let sum: f64 = weights.values.iter().sum();
        let place: f64 = weights.values.iter().zip(nodes).map(|(n, node)| n * node).sum();
        let slope: f64 = weights.derivatives.iter().sum();
        assert!((sum - 1.0).abs() < 1e-14 && (place - x).abs() < 1e-14 && slope.abs() < 1e-12, "x = {x}");
    }

    let lame = Lame::from_young_poisson(1.0, 0.0)?;
    let period = 2.0 * LENGTH / (lame.p_wave_modulus() / DENSITY).sqrt();
    let mut simulation = stretched(lame);
    // The strain energy, (1 + cos 4πt/T)/2 of its first value, vanishes at T/4 and has its next maximum at T/2.
    let (mut greatest, mut when) = (0.0, 0.0);
    while simulation.clock.time() < 0.7 * period {
        simulation.advance()?;
        let (t, energy) = (simulation.clock.time(), simulation.strain_energy());
        if t > 0.3 * period && energy > greatest {
            (greatest, when) = (energy, t);
        }
    }
    println!("half a period is {when:.3}, and {:.3} in theory", 0.5 * period);
    assert!((when - 0.5 * period).abs() < 0.02 * period, "{when}, not {}", 0.5 * period);
    Ok(())
}
