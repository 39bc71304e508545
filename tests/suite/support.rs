//! Shared code of the tests of whole runs.

use bfree::checkpoint::{Checkpoints, Identity, restore};
use bfree::material::{Lame, Law, Material, MaterialState, NonPositiveJacobian};
use bfree::output::{Audience, OutputSettings, Recorder, Reference};
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, identity};
use serde_json::Value;
use std::path::Path;

pub type Failure = Box<dyn std::error::Error>;

/// A shipped scene, with `KEY.PATH=JSON` overrides.
pub fn scene<const D: usize>(name: &str, overrides: &[&str]) -> Result<Simulation<D>, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let overrides = overrides.iter().map(|text| text.parse()).collect::<Result<Vec<scene::Override>, _>>()?;
    Ok(scene::read_file(&folder.join(name), &overrides)?.build(&folder)?)
}

/// The simulation of a scene in JSON.
pub fn built<const D: usize>(scene: &Value) -> Result<Simulation<D>, Failure> {
    Ok(scene::read(&scene.to_string(), &[])?.build(Path::new("."))?)
}

/// The output of a run that ends at t = 1 and writes no snapshots.
pub fn output<const D: usize>(directory: &Path) -> OutputSettings<D> {
    OutputSettings {
        directory: directory.to_owned(),
        fields: vec![],
        snapshot_every: None,
        probes: vec![],
        end_time: 1.0,
        audience: Audience::Nobody,
    }
}

/// Continues `start` from a checkpoint of `simulation`, which began in the same way.
pub fn restored<const D: usize, L: Law + Clone>(
    simulation: &Simulation<D, L>,
    start: &Simulation<D, L>,
) -> Result<Simulation<D, L>, Failure> {
    let folder = tempfile::tempdir()?;
    let identity = Identity::new(Value::Null, &start.particles);
    let mut recorder = Recorder::start(output(folder.path()), start, Reference::of(start))?;
    Checkpoints::new(folder.path().to_owned(), identity.clone(), Value::Null, 1.0, None)
        .write(simulation, &mut recorder)?;
    let mut continued = start.clone();
    restore(folder.path(), &identity, &mut continued)?;
    Ok(continued)
}

/// The largest distance between the positions of a particle in the two simulations.
pub fn apart<const D: usize>(a: &Simulation<D>, b: &Simulation<D>) -> f64 {
    let (a, b) = (a.particles.by_id(), b.particles.by_id());
    a.position.iter().zip(&b.position).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// The shipped laws whose tangent has a closed form. Vector lanes linearise only these.
pub fn closed_laws(lame: Lame) -> Vec<Material> {
    let at_rest = MaterialState::new(Tensor::zeros());
    let closed = |law: &Material| law.closed(&identity::<f64, 1>(), &at_rest, 1.0).is_some();
    Material::examples(lame).into_iter().map(|(_, law)| law).filter(closed).collect()
}

/// P = F S of a law without internal variables.
pub fn piola<const D: usize>(law: &impl Law, h: Tensor<f64, D>) -> Result<Tensor<f64, D>, NonPositiveJacobian> {
    let at = MaterialState::new(h).admissible()?;
    Ok(at.f * law.stress(&at))
}

/// λ with P(λ) = `stress` in uniaxial strain, by bisection.
pub fn stretch(law: &impl Law, stress: f64) -> f64 {
    let piola = |stretch: f64| piola(law, Tensor::<f64, 1>::new(stretch - 1.0)).map_or(f64::NAN, |p| p[0]);
    let (mut low, mut high) = (0.01, 10.0);
    for _ in 0..100 {
        let middle: f64 = 0.5 * (low + high);
        if piola(middle) < stress { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The displacement of the point X of a column of this height under its weight ρ₀ g, by Simpson's rule: P = −ρ₀ g (H − X), u = ∫ (λ − 1)
/// dX.
pub fn moved_in_column(law: &impl Law, weight: f64, height: f64, x: f64) -> f64 {
    let n = 200;
    let share = |k: usize| if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
    let strain = |x: f64| stretch(law, -weight * (height - x)) - 1.0;
    let sum: f64 = (0..=n).map(|k| share(k) * strain(x * k as f64 / n as f64)).sum();
    sum * x / (3.0 * n as f64)
}

/// The rows of a reference table, without its header.
pub fn rows(text: &str) -> impl Iterator<Item = Vec<f64>> + '_ {
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect())
}

/// Numbers without pattern from a fixed seed (Knuth's MMIX).
pub struct Random(pub u64);

impl Random {
    /// A number below `limit`, and 0 for 0.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit.max(1)
    }

    /// An entry of a list that is not empty.
    pub fn of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len() as u64) as usize]
    }
}
