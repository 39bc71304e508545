//! The energy–momentum scheme: energy and angular momentum of long runs on a kept grid, and the tangent of the mean stress.

use super::extremes::bodies;
use super::patch::angular_momentum;
use super::tangent::{SPACING, YOUNG, average, cloud};
use super::{Effort, Outcome, StudyError, short, worse};
use crate::check::regime::Regime;
use crate::check::tangent::measure;
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::material::{Lame, Law, Material, NeoHookean};
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::{EnergyMomentum, GeneralizedAlpha, Newmark, Scheme};
use bfree::particles::Dilatation;
use bfree::scene::{Override, read_file};
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};
use std::path::Path;
use std::sync::Arc;

pub(super) const ABOUT: &str = "the energy-momentum scheme: energy and angular momentum of long runs, and its tangent";

/// The error of a product. c of the mean stress divides the round-off of two energies by |ΔE|².
const TANGENT: f64 = 1e-10;

/// Velocity gradients of the start, in sound speeds over spacings: strains of 0.03, and of a tenth, at which a metal yields.
const SMALL: f64 = 0.02;
const LARGE: f64 = 0.08;

/// The velocity gradient of a body that breathes.
const BREATH: f64 = 0.2;

/// The energy that adaptive steps may lose in an impact.
const ADAPTIVE: f64 = 0.01;

/// The change of energy and of angular momentum that Newton's tolerance allows in 10⁴ steps, relative to the start.
const CONSERVED: f64 = 1e-10;

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let steps = if *effort == Effort::Full { 10_000 } else { 100 };
    let reports = vec![tangents()?, long(steps), laws()?, schemes(), floor(*effort)?];
    Ok(Outcome { reports, ..Outcome::default() })
}

/// Every law, dimension and regime: the pieces of the tangent against dual numbers.
fn tangents() -> Result<Report, StudyError> {
    let columns = ["quantity", "law", "D", "regime"];
    let title = "tangent of the mean stress: |K u - dual(R) u| / |K u|, bound 1e-10";
    let mut report = Report::new(title, &columns).as_matrix(&[0, 2, 1], 3, 3);
    for (name, law) in Material::examples(Lame::from_young_poisson(YOUNG, 0.3)?) {
        dimension::<1>(name, &law, &mut report)?;
        dimension::<2>(name, &law, &mut report)?;
        dimension::<3>(name, &law, &mut report)?;
    }
    report.note("Cubic functions. Gauss's formula is corrected where its error is above round-off.");
    Ok(report)
}

fn dimension<const D: usize>(name: &str, law: &Material, report: &mut Report) -> Result<(), StudyError> {
    for regime in Regime::GENERAL.into_iter().filter(|regime| regime.exists(D)) {
        let mut random = Random::new(1);
        let mut simulation = cloud::<D, Material>(law.clone(), Bspline::Cubic.into(), regime, &mut random)?;
        simulation.loads.surface.clear();
        for averaged in [false, true] {
            if averaged && !average(&mut simulation, &mut random) {
                continue;
            }
            let alphas = EnergyMomentum.balance(simulation.clock.step());
            let coming = simulation.next_step()?.with_alphas(alphas);
            let size = regime.increment() * SPACING;
            let mut dphi: Vec<Vector<f64, D>> = random.field(coming.nodes().len()).iter().map(|x| x * size).collect();
            coming.prescribe(&mut dphi);
            for measured in measure(&coming.equilibrium(), &dphi, &mut random)? {
                let (of_stress, of_both) = (
                    ["stress", "geometric", "material", "damping"],
                    ["mean dilatation", "whole product", "diagonal blocks"],
                );
                let quantity = measured.quantity.as_str();
                if of_both.contains(&quantity) || !averaged && of_stress.contains(&quantity) {
                    let quantity = if averaged { format!("{quantity}, averaged") } else { quantity.to_owned() };
                    report.push(
                        &[&quantity, &*short(name), &D.to_string(), regime.name()],
                        measured.value,
                        Bound::AtMost(TANGENT),
                    );
                }
            }
        }
    }
    Ok(())
}

/// A block that spins and rings on a grid that is kept, with a consistent mass. `courant` is the step over the time a wave needs for a cell.
fn block<const D: usize>(shape: &Approximation, courant: f64, scheme: Arc<dyn Scheme>, breath: f64) -> Simulation<D> {
    let sound = bodies::PLAIN.p_wave_modulus().sqrt();
    let mut simulation = bodies::block::<D>(if D == 3 { 2 } else { 4 }, shape.clone(), courant / sound);
    simulation.settings = bodies::settings(0.0);
    simulation.settings.grid_reset = GridReset::Never;
    simulation.settings.scheme = scheme;
    // A turn by 0.2 in a step at the most.
    let spin = 0.02;
    let velocity = Tensor::<f64, D>::from_fn(|i, k| match (i, k) {
        (0, 0) => breath,
        (1, 1) => -0.7 * breath,
        (0, 1) => -spin,
        (1, 0) => spin,
        _ => 0.0,
    });
    bodies::stir(&mut simulation, &(velocity * sound));
    simulation
}

fn energy<const D: usize, L: Law>(simulation: &Simulation<D, L>) -> f64 {
    simulation.particles.kinetic_energy() + simulation.strain_energy() + simulation.dissipated_by_laws()
}

/// The largest changes of `measured` over the steps, relative to the start.
fn changes<const D: usize, const N: usize, L: Law + 'static>(
    mut simulation: Simulation<D, L>,
    steps: u32,
    measured: impl Fn(&Simulation<D, L>) -> [f64; N],
) -> Result<[f64; N], StudyError> {
    let start = measured(&simulation);
    (0..steps).try_fold([0.0; N], |worst, _| {
        simulation.step()?;
        let now = measured(&simulation);
        Ok(std::array::from_fn(|k| worse(worst[k], (now[k] / start[k] - 1.0).abs())))
    })
}

fn of_plane<L: Law>(simulation: &Simulation<2, L>) -> [f64; 2] {
    [energy(simulation), angular_momentum(&simulation.particles)]
}

/// Energy and angular momentum over `steps` steps.
fn long(steps: u32) -> Report {
    let title = format!("a block that spins and rings, the grid kept, eps = 0: largest change in {steps} steps");
    let mut report = Report::new(&title, &["shape functions", "Courant number", "change of"]);
    let shapes = [("linear", Linear.into()), ("cubic", Bspline::Cubic.into()), ("LME 3", Lme::new(3.0, 1e-6).into())];
    for (name, shape) in shapes {
        for courant in [0.1, 1.0, 10.0] {
            let labels = [name, &courant.to_string()];
            // The other functions take minutes for 10⁴ steps.
            let steps = if name == "linear" { steps } else { steps.min(1000) };
            let labels = [&format!("{name}, {steps} steps"), labels[1]];
            let measured = changes(block::<2>(&shape, courant, Arc::new(EnergyMomentum), SMALL), steps, of_plane);
            push(&mut report, &labels, &["energy", "angular momentum"], measured, [Some(CONSERVED); 2]);
        }
    }
    let solid = block::<3>(&Linear.into(), 10.0, Arc::new(EnergyMomentum), SMALL);
    let measured = changes(solid, steps.min(300), |simulation| [energy(simulation)]);
    push(&mut report, &["linear, 3D", "10"], &["energy"], measured, [Some(CONSERVED)]);
    report
}

/// The energy of every law at a Courant number of 1; with the energy that the law says it dissipates.
fn laws() -> Result<Report, StudyError> {
    let title = "the same for every law, quadratic functions, Courant number 1, 100 steps";
    let mut report = Report::new(title, &["law", "grid", "change of"]);
    // A body of soil that rings comes to the tip of its cone, where it has no stiffness.
    let all = Material::examples(bodies::PLAIN).into_iter().filter(|(name, _)| *name != "Drucker-Prager");
    for (name, law) in all {
        let simulation = block::<2>(&Bspline::Quadratic.into(), 1.0, Arc::new(EnergyMomentum), LARGE);
        let measured = changes(simulation.with_laws(|_| law.clone()), 100, of_plane);
        let bounds = [(name != "viscoelastic").then_some(CONSERVED), Some(CONSERVED)];
        push(&mut report, &[&*short(name), "kept"], &["energy", "angular momentum"], measured, bounds);
        if name == "von Mises" {
            report.push(&["von Mises", "kept", "it dissipates, of the energy"], yielded(&law)?, Bound::AtLeast(0.01));
        }
    }
    let rubber = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(YOUNG_OF_RUBBER, 0.499)?));
    for (name, shape) in [("linear", Approximation::from(Linear)), ("cubic", Bspline::Cubic.into())] {
        let measured =
            changes(averaged(block::<2>(&shape, 1.0, Arc::new(EnergyMomentum), LARGE), &rubber), 100, of_plane);
        let label = format!("nearly incompressible, averaged, {name}");
        push(&mut report, &[&label, "kept"], &["energy", "angular momentum"], measured, [Some(CONSERVED); 2]);
    }
    let solid = averaged(block::<3>(&Linear.into(), 1.0, Arc::new(EnergyMomentum), LARGE), &rubber);
    let measured = changes(solid, 20, |simulation| [energy(simulation)]);
    push(&mut report, &["the same in 3D, 20 steps", "kept"], &["energy"], measured, [Some(CONSERVED)]);
    // Volumes that change by a fifth in a step, where Gauss's formula for the pressure of a cell has an error.
    let soft = Material::from(NeoHookean::ciarlet(bodies::PLAIN));
    let mut breathing = averaged(block::<2>(&Linear.into(), 2.0, Arc::new(EnergyMomentum), LARGE), &soft);
    bodies::stir(&mut breathing, &(Tensor::identity() * BREATH));
    let measured = changes(breathing, 50, |simulation| [energy(simulation)]);
    push(&mut report, &["a block that breathes, averaged, 50 steps", "kept"], &["energy"], measured, [Some(CONSERVED)]);
    report.note(
        "With the energy that laws with memory report as dissipated. A viscoelastic law reports it with an error of the order of the step.",
    );
    Ok(report)
}

/// Young's modulus of the nearly incompressible block: about the shear modulus of the other laws.
const YOUNG_OF_RUBBER: f64 = 3.0;

/// The simulation with this law, and one dilatation a cell.
fn averaged<const D: usize>(simulation: Simulation<D>, law: &Material) -> Simulation<D> {
    let mut simulation = simulation.with_laws(|_| law.clone());
    simulation.bodies[0].dilatation = Dilatation::MeanDilatation;
    simulation
}

/// The share of the energy that a law dissipates in 100 steps.
fn yielded(law: &Material) -> Result<f64, StudyError> {
    let simulation = block::<2>(&Bspline::Quadratic.into(), 1.0, Arc::new(EnergyMomentum), LARGE);
    let mut simulation = simulation.with_laws(|_| law.clone());
    let start = energy(&simulation);
    for _ in 0..100 {
        simulation.step()?;
    }
    Ok(simulation.dissipated_by_laws() / start)
}

/// What other schemes change, and the transfer alone: a grid that is reset in every step.
fn schemes() -> Report {
    let mut report = Report::new(
        "other schemes, and grid resets: linear functions, 100 steps",
        &["scheme", "grid, Courant number", "change of"],
    );
    let all: [(&str, Arc<dyn Scheme>); 3] = [
        ("Newmark", Arc::new(Newmark::default())),
        ("midpoint rule", Arc::new(GeneralizedAlpha { spectral_radius: 1.0 })),
        ("energy-momentum", Arc::new(EnergyMomentum)),
    ];
    for (name, scheme) in all {
        for (grid, courant, reset, lumping) in [
            ("kept, 1", 1.0, GridReset::Never, 0.0),
            ("kept, 3", 3.0, GridReset::Never, 0.0),
            ("reset in every step, lumped mass, 1", 1.0, GridReset::EveryStep, 1.0),
        ] {
            let mut simulation = block::<2>(&Linear.into(), courant, scheme.clone(), SMALL);
            simulation.settings.grid_reset = reset;
            simulation.settings.lumping = lumping;
            let keeps = scheme.balance(1.0).discrete_gradient && reset == GridReset::Never;
            push(
                &mut report,
                &[name, grid],
                &["energy", "angular momentum"],
                changes(simulation, 100, of_plane),
                [keeps.then_some(CONSERVED); 2],
            );
        }
    }
    report
}

/// The energy balance of `bounce.json`: a disc bounces off a floor with friction, in fixed and in adaptive steps.
fn floor(effort: Effort) -> Result<Report, StudyError> {
    let title = "a disc bounces off a floor with friction, the grid kept, eps = 0: error of the energy balance over the energy at the start";
    let mut report = Report::new(title, &["scheme", "steps", "error of"]);
    let schemes = [
        ("Newmark", "\"newmark\""),
        ("midpoint rule", r#"{"generalized_alpha": {"spectral_radius": 1}}"#),
        ("energy-momentum", "\"energy_momentum\""),
    ];
    // At short effort the longest steps alone.
    let count = if effort == Effort::Full { 3 } else { 1 };
    for (name, scheme) in schemes {
        for step in [0.005, 0.0025, 0.00125].into_iter().take(count) {
            let keys = [format!("time.step={step}")];
            let bound = (name == "energy-momentum").then_some(CONSERVED);
            push(&mut report, &[name, &format!("{step}")], &["energy balance"], bounce(scheme, &keys), [bound]);
        }
        if name != "midpoint rule" {
            for tolerance in [1e-2, 1e-3, 1e-4].into_iter().take(count) {
                let keys = ["time.step=0.01".to_owned(), format!("time.adaptive={{\"tolerance\": {tolerance}}}")];
                let bound = if name == "Newmark" { ADAPTIVE } else { CONSERVED };
                push(
                    &mut report,
                    &[name, &format!("adaptive, {tolerance:e}")],
                    &["energy balance"],
                    bounce(scheme, &keys),
                    [Some(bound)],
                );
            }
        }
    }
    report.note("The balance: kinetic, strain and contact energy and friction loss. The floor is a plane.");
    Ok(report)
}

/// The largest error of the energy balance of `bounce.json` with other keys, over the energy at the start.
fn bounce(scheme: &str, keys: &[String]) -> Result<[f64; 1], StudyError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let fixed = ["gravity=null", "time.lumping=0", "grid.reset=\"never\""].map(str::to_owned);
    let keys = fixed.iter().chain(keys).cloned().chain([format!("time.scheme={scheme}")]);
    let keys = keys.map(|key| key.parse()).collect::<Result<Vec<Override>, _>>()?;
    let mut simulation: Simulation<2> = read_file(&folder.join("bounce.json"), &keys)?.build(&folder)?;
    simulation.settings.newton.relative_tolerance = 1e-13;
    let balance =
        |of: &Simulation<2>| of.particles.kinetic_energy() + of.strain_energy() + of.contact_energy() + of.dissipated;
    let (start, mut worst) = (balance(&simulation), 0.0);
    while simulation.clock.time() < 0.3 {
        simulation.advance()?;
        worst = super::worse(worst, (balance(&simulation) / start - 1.0).abs());
    }
    Ok([worst])
}

/// A row for each measured quantity, judged if it has a bound.
fn push<const N: usize>(
    report: &mut Report,
    labels: &[&str; 2],
    quantities: &[&str; N],
    measured: Result<[f64; N], StudyError>,
    bounds: [Option<f64>; N],
) {
    match measured {
        Ok(values) => {
            for ((quantity, value), bound) in quantities.iter().zip(values).zip(bounds) {
                report.push(&[labels[0], labels[1], quantity], value, bound.map_or(Bound::Reported, Bound::AtMost));
            }
        }
        Err(error) => report.push_error(&[labels[0], labels[1], quantities[0]], error.as_ref()),
    }
}
