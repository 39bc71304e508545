//! A law with internal variables, given by values alone: Norton's creep. Its stress solves an equation at each particle.
//!
//! You write the energy, the stress and the internal variables. The tangent comes from dual numbers, through the equation:
//! [`bfree::scalar::implicit`] gives the root of the equation the derivatives that the number type needs.

use bfree::material::{DISSIPATED, InternalVariable, Law, MaterialState, PLASTIC_STRAIN};
use bfree::scalar::{Real, implicit};
use bfree::tensor::{Tensor, contract, identity, scaled, trace};

/// S = (Λ + 2G/3) tr(E) I + 2G dev(E − E_c). The creep strain E_c grows along the deviator of S: ṗ = A (q/σ₀)ⁿ with q = √(3/2) ‖dev S‖ and
/// the accumulated creep strain p. Backward Euler in time. Strains must be small; rotations may be large.
#[derive(Clone, Copy, Debug)]
pub struct Creep {
    /// Λ
    pub lambda: f64,
    /// G
    pub shear: f64,
    /// σ₀
    pub stress: f64,
    /// A (1/time)
    pub rate: f64,
    /// n
    pub power: i32,
}

const INTERNAL: [InternalVariable; 8] = [
    InternalVariable::zero(PLASTIC_STRAIN),
    InternalVariable::zero(DISSIPATED),
    InternalVariable::zero("creep_xx"),
    InternalVariable::zero("creep_yy"),
    InternalVariable::zero("creep_zz"),
    InternalVariable::zero("creep_xy"),
    InternalVariable::zero("creep_yz"),
    InternalVariable::zero("creep_xz"),
];

/// Rows and columns of the six components of E_c.
const PLACES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// The end of a step.
struct Crept<T> {
    volume: T,
    /// dev(E − E_c) before creep.
    trial: Tensor<T, 3>,
    /// q before and after creep.
    q: [T; 2],
}

impl Creep {
    /// q + 3G A Δt (q/σ₀)ⁿ = q_trial
    fn crept<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Crept<T> {
        let e = at.green_lagrange();
        let mut strain: Tensor<T, 3> = Tensor::from_fn(|i, k| if i < D && k < D { e[(i, k)] } else { T::zero() });
        let volume = trace(&strain);
        for (&(i, k), &crept) in PLACES.iter().zip(at.internal.iter().skip(2)) {
            strain[(i, k)] -= T::lit(crept);
            strain[(k, i)] = strain[(i, k)];
        }
        let trial: Tensor<T, 3> = strain - scaled(&identity(), volume / T::lit(3.0));
        let squared = contract(&trial, &trial);
        if squared.value() == 0.0 {
            return Crept { volume, trial, q: [T::zero(); 2] };
        }
        let q_trial = squared.sqrt() * T::lit(6.0_f64.sqrt() * self.shear);
        let factor = 3.0 * self.shear * self.rate * at.dt;
        let slope =
            |q: f64| 1.0 + factor * f64::from(self.power) / self.stress * (q / self.stress).powi(self.power - 1);
        // Newton's method converges from above, because the left side is convex.
        let mut q = q_trial.value();
        for _ in 0..100 {
            let step = (q + factor * (q / self.stress).powi(self.power) - q_trial.value()) / slope(q);
            q -= step;
            if step <= f64::EPSILON * q {
                break;
            }
        }
        let residual = |q: T| q + (q / T::lit(self.stress)).powi(self.power) * T::lit(factor) - q_trial;
        Crept { volume, trial, q: [q_trial, implicit(q, slope(q), residual)] }
    }
}

impl Law for Creep {
    fn internal_variables(&self) -> &[InternalVariable] {
        &INTERNAL
    }

    /// The potential of the step: the elastic energy plus q Δp n/(n + 1).
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let Crept { volume, q: [q_trial, q], .. } = self.crept(at);
        let (bulk, power) = (self.lambda + 2.0 * self.shear / 3.0, f64::from(self.power));
        let delta_p = (q_trial - q) / T::lit(3.0 * self.shear);
        volume * volume * T::lit(0.5 * bulk)
            + q * q / T::lit(6.0 * self.shear)
            + q * delta_p * T::lit(power / (power + 1.0))
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let Crept { volume, trial, q: [q_trial, q] } = self.crept(at);
        let pressure = volume * T::lit(self.lambda + 2.0 * self.shear / 3.0);
        let share = if q_trial.value() > 0.0 { q / q_trial } else { T::one() };
        let stress = scaled(&identity(), pressure) + scaled(&trial, share * T::lit(2.0 * self.shear));
        Tensor::from_fn(|i, k| stress[(i, k)])
    }

    fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
        let Crept { trial, q: [q_trial, q], .. } = self.crept(at);
        if q_trial > 0.0 {
            let delta_p = (q_trial - q) / (3.0 * self.shear);
            variables[0] += delta_p;
            variables[1] += q * delta_p;
            for (crept, place) in variables[2..].iter_mut().zip(PLACES) {
                *crept += (1.0 - q / q_trial) * trial[place];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bfree::scene;
    use std::num::NonZeroU64;
    use verification::{check_material, check_material_from};

    const LAW: Creep = Creep { lambda: 100.0, shear: 60.0, stress: 1.0, rate: 0.01, power: 3 };

    #[test]
    fn stress_and_tangent_are_the_derivatives_of_the_potential() {
        let report = check_material(&LAW);
        assert!(report.passed(), "{report}");
        let internal = [0.02, 0.1, 0.01, -0.005, -0.005, 0.01, -0.003, 0.002];
        let report = check_material_from(&LAW, 0.3, &internal);
        assert!(report.passed(), "{report}");
    }

    /// Relaxation at constant strain: q̇ = −3G A (q/σ₀)ⁿ.
    #[test]
    fn stress_relaxes_as_the_closed_form_with_order_one() {
        let sheared = MaterialState::new(Tensor::<f64, 2>::new(0.0, 0.01, 0.01, 0.0));
        let q = |stress: &Tensor<f64, 2>| 3.0_f64.sqrt() * stress[(0, 1)];
        let error = |steps: u32| {
            let (mut internal, mut stress, dt) = (vec![0.0; 8], Tensor::zeros(), 1.0 / f64::from(steps));
            for _ in 0..steps {
                let at = sheared.in_step(dt, &internal);
                stress = LAW.stress(&at);
                let mut next = internal.clone();
                LAW.update_variables(&at, &mut next);
                internal = next;
            }
            let q_0 = q(&LAW.stress(&sheared.in_step(0.0, &[0.0; 8])));
            let closed = (q_0.powi(-2) + 2.0 * 3.0 * LAW.shear * LAW.rate / LAW.stress.powi(3)).powf(-0.5);
            q(&stress) / closed - 1.0
        };
        let (coarse, fine) = (error(200), error(400));
        assert!(fine.abs() < 5e-3 && (coarse / fine - 2.0).abs() < 0.05, "{coarse:e} {fine:e}");
    }

    const BAR: &str = r#"{
        "grid": { "size": [3], "spacing": 0.25 },
        "time": { "step": 0.1, "end": 1, "scheme": "none" },
        "bodies": [{ "name": "bar", "shape": { "box": { "min": [0], "max": [2] } }, "density": 1,
                     "material": { "neo_hookean": { "lambda": 100, "shear": 60 } } }],
        "boundary": { "left": "fixed" },
        "tractions": [{ "body": "bar", "region": { "half_space": { "point": [2], "normal": [-1] } }, "traction": [3] }]
    }"#;

    #[test]
    fn a_bar_creeps_and_every_tangent_is_checked() -> Result<(), Box<dyn std::error::Error>> {
        let mut simulation = scene::read(BAR, &[])?.build::<1>(".".as_ref())?.with_laws(|_| LAW);
        simulation.settings.check_tangent = NonZeroU64::new(1);
        let middle = |of: &bfree::particles::Particles<1>| of.by_id().displacement_gradient[of.len() / 2][(0, 0)];
        simulation.advance()?;
        let at_first = middle(&simulation.particles);
        while simulation.clock.time() < 1.0 {
            let step = simulation.advance()?;
            assert!(step.newton.history.iterations.len() <= 5);
        }
        // When q has vanished, only the volumetric stress is left: E → S/K, S = 3 to first order.
        let (last, bulk) = (middle(&simulation.particles), LAW.lambda + 2.0 * LAW.shear / 3.0);
        assert!(at_first < last && last < 3.0 / bulk, "{at_first} {last}");
        Ok(())
    }
}
