//! A law with internal variables: restarts, failed steps and reordering must keep them.

use crate::support::{Failure, Random, advance, restored, scene};
use bfree::material::{InternalVariable, Lame, Law, MaterialState, NeoHookean};
use bfree::particles::Particles;
use bfree::scalar::Real;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, contract, scaled};

/// Ciarlet's solid softens with the largest strain energy W so far: S = e^(−κ/k) S₀, with κ' = κ + (W − κ) Δt/(τ + Δt) where W > κ. The
/// softening takes about the time τ. Internal variables: κ and, for the test, the age of the particle. A solid that does not soften has
/// none. In a solid that breaks, the age is no number once the energy exceeds a hundredth of the limit k.
#[derive(Clone, Copy, Debug)]
struct Softening {
    solid: NeoHookean,
    softens: bool,
    breaks: bool,
}

const LIMIT: f64 = 2.0;
const TIME: f64 = 0.05;
const NAMES: [InternalVariable; 2] =
    [InternalVariable::zero("energy met"), InternalVariable { name: "age", at_rest: 3.0 }];

impl Softening {
    /// κ' and dκ'/dW.
    fn met<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> (T, f64) {
        if !self.softens {
            return (T::zero(), 0.0);
        }
        let (met, rate) = (at.internal[0], at.dt / (TIME + at.dt));
        let energy = self.solid.energy(at);
        if energy.value() > met {
            (T::lit(met) + (energy - T::lit(met)) * T::lit(rate), rate)
        } else {
            (T::lit(met), 0.0)
        }
    }

    fn factor<T: Real>(met: T) -> T {
        (-met / T::lit(LIMIT)).exp()
    }
}

impl Law for Softening {
    fn internal_variables(&self) -> &[InternalVariable] {
        if self.softens { &NAMES } else { &[] }
    }

    /// ∫ e^(−κ'(W)/k) dW
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let (met, rate) = self.met(at);
        if rate == 0.0 {
            return self.solid.energy(at) * Self::factor(met);
        }
        let before = at.internal[0];
        let sum = Self::factor(T::lit(before)) - Self::factor(met);
        T::lit(before * Self::factor(before)) + sum * T::lit(LIMIT / rate)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let (met, _) = self.met(at);
        scaled(&self.solid.stress(at), Self::factor(met))
    }

    /// ℂ:X = e^(−κ'/k) [ℂ₀:X − (dκ'/dW)/k (S₀:X) S₀]
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let (met, rate) = self.met(at);
        let stress = self.solid.stress(at);
        let softer = stress * (rate / LIMIT * contract(&stress, x));
        scaled(&(self.solid.elasticity(at, x) - softer), Self::factor(met))
    }

    fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
        if self.softens {
            let broken = self.breaks && self.solid.energy(at) > 0.01 * LIMIT;
            variables.copy_from_slice(&[self.met(at).0, if broken { f64::NAN } else { at.internal[1] + at.dt }]);
        }
    }
}

/// Two adjacent discs collide at once; the soft one softens.
fn collision(overrides: &[&str]) -> Result<Simulation<2, Softening>, Failure> {
    let near = ["bodies.1.shape.ball.center=[5.4, 2.75]", "output.probes=[]"];
    let solids =
        [Lame::from_young_poisson(100.0, 0.3)?, Lame::from_young_poisson(1000.0, 0.3)?].map(NeoHookean::ciarlet);
    let plain = scene::<2>("collision.json", &[&near[..], overrides].concat())?;
    Ok(plain.with_laws(|body| {
        let softens = body.name == "soft";
        Softening { solid: solids[usize::from(!softens)], softens, breaks: false }
    }))
}

const STEPS: usize = 30;

/// The internal variables of each particle.
fn remembered(particles: &Particles<2>) -> Vec<[f64; 2]> {
    (0..particles.len()).map(|p| std::array::from_fn(|i| particles.state(p, 0.0).internal[i])).collect()
}

#[test]
fn particles_remember_at_the_end_of_every_step_what_their_law_says() -> Result<(), Failure> {
    let mut simulation = collision(&[])?;
    let at_rest = |particles: &Particles<2>| {
        particles.body.iter().map(|&body| if body == 0 { [0.0, 3.0] } else { [0.0; 2] }).collect::<Vec<_>>()
    };
    assert_eq!(remembered(&simulation.particles), at_rest(&simulation.particles));
    let mut expected = remembered(&simulation.particles.by_id());
    for _ in 0..STEPS {
        let report = simulation.advance()?;
        let particles = simulation.particles.by_id();
        for p in 0..particles.len() {
            if particles.body[p] == 0 {
                let energy = simulation.bodies[0].law.solid.energy(&particles.state(p, 0.0));
                let [met, age] = expected[p];
                let grown = met + (energy - met) * (report.dt / (TIME + report.dt));
                expected[p] = [if energy > met { grown } else { met }, age + report.dt];
            }
        }
        assert_eq!(remembered(&particles), expected);
    }
    let most = expected.iter().map(|[met, _]| *met).fold(0.0, f64::max);
    assert!(most > 0.1 * LIMIT, "the test is meant to see softening: {most}");
    // Softening changes the motion: without it the discs separate with other velocities.
    let mut elastic = collision(&[])?.with_laws(|body| Softening { softens: false, ..body.law });
    assert!(elastic.particles.memory.is_empty());
    advance(&mut elastic, STEPS)?;
    let parted = elastic.particles.momentum() - simulation.particles.momentum();
    let (with, without) = (simulation.particles.by_id(), elastic.particles.by_id());
    let apart = with.velocity.iter().zip(&without.velocity).map(|(a, b)| (a - b).norm());
    assert!(apart.fold(0.0, f64::max) > 0.01 && parted.norm() < 1e-6);
    Ok(())
}

#[test]
fn a_restart_knows_what_particles_remember() -> Result<(), Failure> {
    let start = collision(&[])?;
    let mut simulation = start.clone();
    advance(&mut simulation, STEPS / 2)?;
    let mut continued = restored(&simulation, &start)?;
    assert!(continued.particles.memory.iter().any(|x| *x > 0.0) && continued.particles == simulation.particles);
    advance(&mut simulation, STEPS / 2)?;
    advance(&mut continued, STEPS / 2)?;
    assert_eq!(continued.particles, simulation.particles);
    // The same scene with laws without internal variables is another run.
    let forgetful = start.with_laws(|body| Softening { softens: false, ..body.law });
    let refused = restored(&simulation, &forgetful).err().ok_or("another law")?;
    assert!(bfree::causes::on_one_line(&*refused).contains("of memory instead of 0"), "{refused:?}");
    Ok(())
}

#[test]
fn a_step_that_fails_is_forgotten() -> Result<(), Failure> {
    let mut simulation = collision(&["bodies.0.velocity=[4,0]"])?;
    let (mut failed, body) = (0, simulation.particles.by_id().body);
    simulation.settings.newton.max_iterations = 3;
    while simulation.clock.time() < 0.4 {
        let before = simulation.clone();
        if simulation.step().is_err() {
            assert_eq!(simulation.particles.by_id(), before.particles.by_id());
            failed += simulation.advance()?.failed.len();
        }
        // A failed attempt adds no Δt to the age.
        for ([_, age], body) in remembered(&simulation.particles.by_id()).iter().zip(&body) {
            let expected = if *body == 0 { 3.0 + simulation.clock.time() } else { 0.0 };
            assert!((age - expected).abs() < 1e-13, "{age} at t = {}", simulation.clock.time());
        }
    }
    assert!(failed > 0, "the test is meant to see steps that fail");
    Ok(())
}

#[test]
fn memory_follows_its_particle_wherever_it_lies() -> Result<(), Failure> {
    let mut one = collision(&[])?;
    let (mut random, mut other) = (Random(9), one.clone());
    for _ in 0..STEPS / 6 {
        let before = other.particles.by_id();
        other.rearrange(&random.order(before.len()));
        assert_eq!(other.particles.by_id(), before);
        advance(&mut one, 6)?;
        advance(&mut other, 6)?;
        assert_eq!(one.particles.by_id(), other.particles.by_id());
    }
    assert!(one.particles.memory.iter().any(|x| *x > 0.0));
    Ok(())
}

#[test]
fn a_state_that_is_no_number_is_refused_and_leaves_the_last_one() -> Result<(), Failure> {
    let mut simulation = collision(&[])?.with_laws(|body| Softening { breaks: true, ..body.law });
    let mut before = simulation.particles.clone();
    let error = loop {
        match simulation.step() {
            Ok(_) => before = simulation.particles.clone(),
            Err(error) => break error,
        }
        assert!(simulation.clock.steps() < 200, "no step was refused");
    };
    assert!(error.to_string().contains("not finite"), "{error}");
    // The step that failed may have sorted the particles.
    assert_eq!(simulation.particles.by_id(), before.by_id());
    assert!(before.memory.iter().all(|one| one.is_finite()));
    Ok(())
}
