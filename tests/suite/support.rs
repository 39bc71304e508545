//! Shared code of the tests of whole runs.

use bfree::checkpoint::{Checkpoints, Identity, restore};
use bfree::material::{ClosedTangent, Lame, Law, Material, MaterialState, NonPositiveJacobian};
use bfree::output::{Audience, OutputSettings, Recorder, Reference};
use bfree::particles::Body;
use bfree::scalar::Real;
use bfree::scene::{self, Place, SceneError};
use bfree::simulation::{AdvanceError, Simulation};
use bfree::tensor::{Tensor, Vector, identity};
use serde_json::{Value, json};
use std::any::Any;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// The files of the shipped scenes.
pub fn shipped() -> Result<Vec<PathBuf>, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut paths = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, Failure>>()?;
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "json"));
    paths.sort();
    Ok(paths)
}

/// A scene with these values at JSON pointers such as `/bodies/0/density`.
pub fn with(mut scene: Value, changes: &[(&str, Value)]) -> Value {
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap_or(("", pointer));
        if let Some(parent) = scene.pointer_mut(parent) {
            parent[key] = value.clone();
        }
    }
    scene
}

/// A scene, or a part of one, with more keys.
pub fn merged(mut scene: Value, more: Value) -> Value {
    if let (Some(scene), Value::Object(more)) = (scene.as_object_mut(), more) {
        scene.extend(more);
    }
    scene
}

/// A body of density 1 with Poisson's ratio 0.3.
pub fn solid(name: &str, young: u32, shape: Value) -> Value {
    json!({"name": name, "shape": shape, "density": 1, "material": {"neo_hookean": {"young": young, "poisson": 0.3}}})
}

/// The rows of a table of cases, split into cells.
pub fn cases(table: &str) -> impl Iterator<Item = Vec<&str>> {
    table.lines().skip(1).map(|row| row.split(" | ").collect())
}

/// The text is a scene with one wrong value, at `path`; the message has these words.
pub fn assert_refused(text: &str, path: &str, words: &[&str]) {
    let error = scene::read(text, &[]).expect_err(text);
    let SceneError::Values(problems) = &error else { panic!("{text}: {error}") };
    assert_eq!(problems.list.len(), 1, "{text}: more than was wrong:\n{error}");
    let (problem, message) = (&problems.list[0], problems.list[0].to_string());
    assert!(problem.path == path && message.starts_with(&format!("{path}: ")), "{path} expected: {message}");
    assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    assert!(matches!(problem.place, Some(Place::Text { .. })), "no place: {message}");
}

/// Takes steps, each shortened where it fails.
pub fn advance<const D: usize, L: Law + 'static>(
    simulation: &mut Simulation<D, L>,
    steps: usize,
) -> Result<(), Failure> {
    (0..steps).try_for_each(|_| simulation.advance().map(drop)).map_err(Into::into)
}

/// Takes steps up to the time `end`.
pub fn run_to<const D: usize, L: Law + 'static>(simulation: &mut Simulation<D, L>, end: f64) -> Result<(), Failure> {
    while simulation.clock.time() < end - 1e-9 {
        simulation.advance()?;
    }
    Ok(())
}

/// Takes steps until one fails.
pub fn failure<const D: usize>(simulation: &mut Simulation<D>) -> AdvanceError {
    loop {
        if let Err(error) = simulation.advance() {
            return error;
        }
    }
}

/// Does the work with this number of threads.
pub fn in_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    Ok(pool.install(|| work().map_err(|error| error.to_string()))?)
}

/// Exit code, standard output and standard error of a program.
pub type Said = (Option<i32>, String, String);

/// Runs a program to its end.
pub fn said(program: &mut Command) -> Result<Said, Failure> {
    let output = program.output()?;
    Ok((output.status.code(), String::from_utf8(output.stdout)?, String::from_utf8(output.stderr)?))
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

/// A body of density 1.
pub fn body<L>(law: L) -> Body<L> {
    Body { name: "body".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }
}

/// The number of calls of a law.
#[derive(Debug, Default)]
pub struct Calls {
    pub energies: AtomicU64,
    pub stresses: AtomicU64,
    /// The number of questions for the kind of the law.
    pub kinds: AtomicU64,
}

/// A law of the list that counts its calls. It may hide its closed form, and that it is of the list.
#[derive(Clone, Debug)]
pub struct Watched {
    pub law: Material,
    pub closed: bool,
    pub listed: bool,
    pub calls: Arc<Calls>,
}

impl Watched {
    /// A law that the library does not know. Without a closed form its tangent comes from ℂmat.
    pub fn unlisted(law: Material, closed: bool) -> Self {
        Self { law, closed, listed: false, calls: Arc::default() }
    }
}

impl Law for Watched {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.calls.energies.fetch_add(1, Ordering::Relaxed);
        self.law.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        self.calls.stresses.fetch_add(1, Ordering::Relaxed);
        self.law.stress(at)
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        self.law.elasticity(at, x)
    }

    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        self.law.tangent_density(at, v, b)
    }

    fn closed<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &MaterialState<T, D>,
        volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        self.law.closed(f_n, at, volume).filter(|_| self.closed)
    }

    fn shipped(&self) -> Option<&dyn Any> {
        self.calls.kinds.fetch_add(1, Ordering::Relaxed);
        self.listed.then_some(&self.law)
    }
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

/// The displacement of the point X of a column of height H under its weight ρ₀ g, by Simpson's rule: P = −ρ₀ g (H − X), u = ∫ (λ − 1) dX.
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

/// Numbers without pattern in (−1, 1): the golden-ratio sequence.
pub fn irregular(k: usize) -> f64 {
    2.0 * ((k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0
}

/// Largest difference over largest value. NaN counts as largest.
pub fn difference<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = b.iter().map(|x| x.amax()).fold(0.0, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, |worst, d| if d <= worst { worst } else { d }) / largest
}

/// Numbers without pattern from a fixed seed (Knuth's MMIX).
pub struct Random(pub u64);

impl Random {
    /// A number below `limit`, and 0 for 0.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit.max(1)
    }

    /// The numbers below `count` in random order.
    pub fn order(&mut self, count: usize) -> Vec<u32> {
        let mut order: Vec<u32> = (0..count as u32).collect();
        for last in (1..order.len()).rev() {
            order.swap(last, self.below(last as u64 + 1) as usize);
        }
        order
    }

    /// An entry of a list that is not empty.
    pub fn of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len() as u64) as usize]
    }
}
