//! The arguments of a UMAT over rotating steps of a run, each against its formula from the deformation gradients of the particles.

use super::Library;
use crate::support::{Failure, built, with};
use bfree::simulation::Simulation;
use bfree::tensor::Tensor;
use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

const LAMBDA: f64 = 1.2;
const SHEAR: f64 = 0.7;
const TEMPERATURE: f64 = 293.25;
const NAME: &str = "Recorder 7";

/// Numbers that the law records beside its `n` components: see `records.c`.
fn recorded(n: usize) -> usize {
    1 + 3 * n + 9 + 3 + 9 + 1 + 18 + 9 + 4 + 1 + 1
}

/// A block that is held below, and whose top half is turned about an oblique axis and pulled away.
fn twisted(dimension: usize, plane_strain: bool, library: &Library) -> Value {
    let corner = |x: f64| vec![x; dimension];
    let (mut top, mut bottom) = (vec![0.0; dimension], corner(2.0));
    (top[1], bottom[1]) = (1.25, 0.5);
    let names: Vec<String> =
        (0..recorded(if plane_strain { 4 } else { 6 })).map(|number| format!("recorded_{number}")).collect();
    let law = json!({"umat": {
        "library": library.name(), "properties": [LAMBDA, SHEAR], "tangent": "strain", "state": {"names": names},
        "temperature": TEMPERATURE, "name": NAME, "plane_strain": plane_strain
    }});
    let angle = json!([[0, 0], [0.4, 0.5], [1, 1.1]]);
    let turn = if dimension == 3 {
        json!({"center": [1.1, 1.7, 0.9], "axis": [0.3, 1, -0.4], "angle": angle})
    } else {
        json!({"center": [1.1, 1.3], "angle": angle})
    };
    json!({
        "grid": {"size": corner(2.0), "spacing": 0.5},
        "approximation": "linear",
        "aggregation": false,
        "time": {"step": 0.25, "end": 1, "scheme": "none"},
        "bodies": [{"name": "block", "density": 0.1, "material": law, "particles_per_cell": 1, "layout": "regular",
                    "shape": {"box": {"min": corner(0.5), "max": corner(1.5)}}}],
        "prescribed": [
            {"region": {"box": {"min": corner(0.0), "max": bottom}}, "displacement": [[0, vec![0; dimension]]]},
            {"region": {"box": {"min": top, "max": corner(2.0)}}, "rotation": turn}
        ],
        "solver": {"krylov": {"method": {"gmres": {}}}}
    })
}

/// The deformation gradients of all particles by id, in three dimensions.
fn gradients<const D: usize>(simulation: &Simulation<D>) -> Vec<Matrix3<f64>> {
    let in_space = |h: &Tensor<f64, D>| Matrix3::from_fn(|i, k| if i < D && k < D { h[(i, k)] } else { 0.0 });
    simulation.particles.by_id().displacement_gradient.iter().map(|h| Matrix3::identity() + in_space(h)).collect()
}

/// R and ln V of F₁ F₀⁻¹ = V R.
fn increment(before: &Matrix3<f64>, after: &Matrix3<f64>) -> Result<[Matrix3<f64>; 2], Failure> {
    let svd = (after * before.try_inverse().ok_or("F is singular")?).svd(true, true);
    let (u, v) = svd.u.zip(svd.v_t).ok_or("no singular values")?;
    Ok([u * v, u * Matrix3::from_diagonal(&svd.singular_values.map(f64::ln)) * u.transpose()])
}

/// The components of Abaqus: 11, 22, 33, 12, 13, 23, the first four in plane strain.
fn components(tensor: &Matrix3<f64>, shear: f64, plane_strain: bool) -> Vec<f64> {
    let places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
    let factor = |(i, j): (usize, usize)| if i == j { 1.0 } else { shear };
    places.iter().take(if plane_strain { 4 } else { 6 }).map(|&place| factor(place) * tensor[place]).collect()
}

/// The strain and the stress of a particle, as sums over the steps.
#[derive(Clone, Copy, Default)]
struct Accumulated {
    strain: Matrix3<f64>,
    stress: Matrix3<f64>,
}

/// The inputs of a step beside its deformation gradients.
struct StepOfRun {
    time: f64,
    dt: f64,
    number: usize,
}

impl Accumulated {
    /// All inputs of the law in a step, in the order of `records.c`. The sums go on to the end of the step.
    fn inputs(
        &mut self,
        [before, after]: [&Matrix3<f64>; 2],
        StepOfRun { time, dt, number }: &StepOfRun,
        plane_strain: bool,
    ) -> Result<Vec<f64>, Failure> {
        let [turn, stretch] = increment(before, after)?;
        let turned = |tensor: &Matrix3<f64>| turn * tensor * turn.transpose();
        let (strain, stress) = (turned(&self.strain), turned(&self.stress));
        let n = if plane_strain { 4 } else { 6 };
        let number = *number as f64;
        let mut all = vec![number];
        all.extend(components(&stress, 1.0, plane_strain));
        all.extend(components(&strain, 2.0, plane_strain));
        all.extend(components(&stretch, 2.0, plane_strain));
        // TIME twice: there is one step in the sense of Abaqus, whose increments are the steps of the run.
        all.extend([*time, *time, *dt, TEMPERATURE, 0.0, 0.0, 0.0, LAMBDA, SHEAR]);
        // COORDS and CELENT are not those of the particle: docs/src/libraries.md says so.
        all.extend([0.0; 3]);
        // Matrices by columns, as nalgebra stores them.
        all.extend(&turn);
        all.push(1.0);
        all.extend(before.iter().chain(after));
        all.extend([3.0, n as f64 - 3.0, n as f64, recorded(n) as f64, 2.0]);
        all.extend([1.0; 4]);
        all.extend([1.0, 0.0, 0.0, 0.0, number]);
        let letters = NAME.bytes().chain(std::iter::repeat(b' ')).take(80).enumerate();
        all.push(letters.map(|(place, letter)| (place as f64 + 1.0) * f64::from(letter)).sum());
        self.strain = strain + stretch;
        self.stress = stress + Matrix3::identity() * (LAMBDA * stretch.trace()) + stretch * (2.0 * SHEAR);
        Ok(all)
    }
}

/// Four steps. Returns the largest turn and the largest principal strain of a step.
fn inputs_of_a_run<const D: usize>(scene: &Value, plane_strain: bool) -> Result<[f64; 2], Failure> {
    let mut simulation = built::<D>(scene)?;
    let mut sums = vec![Accumulated::default(); simulation.particles.len()];
    let mut largest = [0.0_f64; 2];
    for number in 1..=4 {
        let (time, before) = (simulation.clock.time(), gradients(&simulation));
        let report = simulation.advance()?;
        assert!(report.failed.is_empty(), "the law tells steps apart");
        let step = StepOfRun { time, dt: report.dt, number };
        let (particles, after) = (simulation.particles.by_id(), gradients(&simulation));
        for (p, sum) in sums.iter_mut().enumerate() {
            let wanted = sum.inputs([&before[p], &after[p]], &step, plane_strain)?;
            let found = &particles.state(p, 0.0).internal[..wanted.len()];
            for (k, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                let close = (found - wanted).abs() <= 1e-11 * wanted.abs().max(1.0);
                assert!(close, "D = {D}, step {number}, particle {p}, number {k}: {found} instead of {wanted}");
            }
            let [turn, stretch] = increment(&before[p], &after[p])?;
            let axis =
                Vector3::new(turn[(2, 1)] - turn[(1, 2)], turn[(0, 2)] - turn[(2, 0)], turn[(1, 0)] - turn[(0, 1)]);
            largest = [largest[0].max(0.5 * axis.norm()), largest[1].max(stretch.symmetric_eigenvalues().amax())];
        }
    }
    Ok(largest)
}

#[test]
fn a_umat_is_given_the_inputs_of_its_steps() -> Result<(), Failure> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/foreign");
    let Some(library) = Library::compiled(&folder, "records.c")? else { return Ok(()) };
    let dynamics = json!({"step": 0.25, "end": 1});
    for reset in ["never", "every_step"] {
        for time in [None, Some(&dynamics)] {
            let changed = |scene: Value| {
                let scene = with(scene, &[("/grid/reset", json!(reset))]);
                time.map_or(scene.clone(), |time| with(scene, &[("/time", time.clone())]))
            };
            let largest = [
                inputs_of_a_run::<3>(&changed(twisted(3, false, &library)), false)?,
                inputs_of_a_run::<2>(&changed(twisted(2, false, &library)), false)?,
                inputs_of_a_run::<2>(&changed(twisted(2, true, &library)), true)?,
            ];
            let enough = |[turn, strain]: &[f64; 2]| *turn > 0.1 && *strain > 0.05;
            assert!(largest.iter().all(enough), "{reset}: nothing turns or stretches: {largest:?}");
        }
    }
    Ok(())
}
