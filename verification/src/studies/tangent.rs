//! Every piece of the tangent against dual numbers, by the solver's product: every law × every shape function × both transfers × D = 1,
//! 2, 3 × every regime.

use super::{Effort, Outcome, StudyError, short};
use crate::check::regime::Regime;
use crate::check::tangent::{POTENTIAL, PRESSURE_ASYMMETRY, SYMMETRY, measure};
use crate::device;
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Energy, FromEnergy, Lame, LameError, Law, Material};
use bfree::mechanics::loads::Rayleigh;
use bfree::mechanics::loads::{
    Curve, Gravity, Loads, Motion, Prescribed, Pressing, Selection, SurfaceLoad, SurfacePoint,
};
use bfree::mechanics::sweep::Connectivity;
use bfree::particles::{Body, Dilatation, Particles};
use bfree::scalar::Real;
use bfree::simulation::{Settings, Simulation};
use bfree::tensor::{Deformation, Tensor, Vector, contract, determinant, trace};

pub(super) const ABOUT: &str =
    "every term of the tangent against dual numbers, for every law, shape function, dimension, regime";

pub(super) const YOUNG: f64 = 1000.0;
pub(super) const SPACING: f64 = 0.5;

/// Murnaghan's solid, given by its energy alone:
/// W = Λ/2 (tr E)² + G E:E + l/3 (tr E)³ + m tr E E:E + n det E.
#[derive(Clone, Copy, Debug)]
struct Murnaghan {
    lame: Lame,
}

impl Energy for Murnaghan {
    fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
        let Lame { lambda, shear } = self.lame;
        let (t, ee) = (trace(e), contract(e, e));
        let third =
            t * t * t * T::lit(0.3 * shear) + t * ee * T::lit(0.2 * shear) + determinant(e) * T::lit(0.7 * shear);
        t * t * T::lit(0.5 * lambda) + ee * T::lit(shear) + third
    }
}

/// All families, under the names of this report. LME has one width, since the formulas are the same for all.
fn shapes() -> Vec<(&'static str, Approximation)> {
    let named = |(name, shape)| {
        let name = match name {
            "quadratic" => "bspline2",
            "cubic" => "bspline3",
            "lme 1.8" => "lme",
            "lme circle 1.8" => "lme circle",
            "lme 0.8" | "lme 3" | "lme circle 3" | "not-a-knot quadratic" | "not-a-knot cubic" => return None,
            other => other,
        };
        Some((name, shape))
    };
    Approximation::examples().into_iter().filter_map(named).collect()
}

/// Pieces and the whole product of K against dual numbers; symmetry if there is a potential.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let columns = ["quantity", "law", "D", "regime", "shape function"];
    let mut report = Report::new(
        "tangent: |K u - dual(R) u| / |K u|, worst shape function of each place, bound min(64 eps k(F)^2, 1e-10)",
        &columns,
    )
    .as_matrix(&[0, 2, 1], 3, 4);
    let shipped = Material::examples(Lame::from_young_poisson(YOUNG, 0.3)?);
    let seeds = if *effort == Effort::Full { 1..=8 } else { 1..=1 };
    for seed in seeds {
        for (i, (name, _)) in shipped.iter().enumerate() {
            dimensions(&short(name), |lame| Material::examples(lame).swap_remove(i).1, seed, &mut report)?;
        }
        dimensions("Murnaghan (W)", |lame| FromEnergy(Murnaghan { lame }), seed, &mut report)?;
    }
    report.note("k(F) = |F| |1/F| / 3 of the 3x3 F, the largest of all particles. In 1D there is no rotation ('-').");
    report.note("Follower pressure: on part of the surface only (open), so u.Kw differs from w.Ku in 2D and 3D; in 1D cof F = 1 and its tangent is zero.");
    report.note(
        "Pieces are frozen alone and applied by the solver's product, in vector lanes and ('plain') one particle after \
         the other.",
    );
    report.note(
        "Whole product: relative to its largest piece, as in the check of a run. Diagonal blocks: relative to the sum of the sizes of their parts. \
         Parts cancel where J is large.",
    );
    report.note(
        "eps = 0.3, so that the lumped and the consistent mass both act; a wall holds one component of some nodes.",
    );
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

fn dimensions<L: Law + Clone>(
    name: &str,
    law: impl Fn(Lame) -> L,
    seed: u64,
    report: &mut Report,
) -> Result<(), StudyError> {
    dimension::<1, L>(name, &law, seed, report)?;
    dimension::<2, L>(name, &law, seed, report)?;
    dimension::<3, L>(name, &law, seed, report)
}

fn dimension<const D: usize, L: Law + Clone>(
    name: &str,
    law: &impl Fn(Lame) -> L,
    seed: u64,
    report: &mut Report,
) -> Result<(), StudyError> {
    for regime in Regime::GENERAL.into_iter().chain([Regime::Isochoric]).filter(|regime| regime.exists(D)) {
        let poisson = if regime == Regime::Isochoric { 0.499_999 } else { 0.3 };
        let law = law(Lame::from_young_poisson(YOUNG, poisson)?);
        for (shape, approximation) in shapes() {
            let mut random = Random::new(seed);
            let mut simulation = cloud::<D, L>(law.clone(), approximation.clone(), regime, &mut random)?;
            for (pressed, averaged) in [(true, false), (false, false), (false, true)] {
                if !pressed {
                    simulation.loads.surface.clear();
                }
                if averaged && !average(&mut simulation, &mut random) {
                    continue;
                }
                let mut ways = vec![(shape.to_owned(), simulation.next_step()?)];
                if ways[0].1.connectivity().is_tiled() {
                    let (plain, _) =
                        Connectivity::plain(&approximation, &simulation.grid, &simulation.particles.position)?;
                    ways.push((format!("{shape}, plain"), simulation.next_step()?.with_connectivity(plain)));
                }
                for (way, coming) in &ways {
                    let equilibrium = coming.equilibrium();
                    let size = regime.increment() * SPACING;
                    let mut dphi: Vec<Vector<f64, D>> =
                        random.field(coming.nodes().len()).iter().map(|x| x * size).collect();
                    coming.prescribe(&mut dphi);
                    for measured in measure(&equilibrium, &dphi, &mut random)? {
                        // The other quantities do not depend on the pressure or the mean dilatation, so they are not listed twice.
                        let of_all = |name: &&str| measured.quantity.starts_with(name);
                        let here: &[&str] = match averaged {
                            false => &[SYMMETRY, POTENTIAL],
                            true => &[SYMMETRY, POTENTIAL, MEAN, "damping", "whole product", "diagonal blocks"],
                        };
                        if !pressed && !here.iter().any(&of_all) {
                            continue;
                        }
                        // In 1D every deformation is a change of volume, so the term is the difference of two nearly equal terms. Its
                        // round-off is judged in the whole product.
                        if D == 1 && of_all(&MEAN) {
                            continue;
                        }
                        let asymmetric = measured.quantity == PRESSURE_ASYMMETRY;
                        let bound = if asymmetric { Bound::AtLeast(1e-3) } else { measured.bound };
                        let with_mean = averaged && !of_all(&MEAN);
                        let quantity = measured.quantity.clone() + if with_mean { WITH_MEAN } else { "" };
                        let labels: [&str; 5] = [&quantity, name, &D.to_string(), regime.name(), way];
                        report.push(&labels, measured.value, bound);
                    }
                }
            }
        }
    }
    Ok(())
}

/// The name of the mean-dilatation term in the residual.
const MEAN: &str = "mean dilatation";

/// The suffix of the name of a quantity of a body with the mean dilatation.
const WITH_MEAN: &str = ", mean dilatation";

/// Gives the body the mean dilatation of cells, as after a grid reset; returns `false` if its law has no volumetric part.
pub(super) fn average<const D: usize, L: Law>(simulation: &mut Simulation<D, L>, random: &mut Random) -> bool {
    let [body] = simulation.bodies.as_mut_slice() else { return false };
    body.dilatation = Dilatation::MeanDilatation;
    simulation.particles.dilatation = (0..simulation.particles.len()).map(|_| 0.1 * random.signed()).collect();
    body.law.volumetric(&Deformation::<f64, 1>::new(Tensor::zeros())).is_some()
}

/// Jittered particles of one body, two along each axis of some cells at a wall. They are randomly deformed and damped, under gravity and
/// under pressure on part of their surface. Speeds and step make inertia as large as stiffness.
pub(super) fn cloud<const D: usize, L: Law>(
    law: L,
    approximation: Approximation,
    regime: Regime,
    random: &mut Random,
) -> Result<Simulation<D, L>, LameError> {
    let density = 1.0;
    let dt = SPACING / (Lame::from_young_poisson(YOUNG, 0.3)?.p_wave_modulus() / density).sqrt();
    let speed = regime.increment() * SPACING / dt;
    let per_axis: usize = if D == 3 { 4 } else { 6 };
    let distance = 0.5 * SPACING;
    let mut particles = Particles::<D>::default();
    let mut points = Vec::new();
    for p in 0..per_axis.pow(D as u32) {
        let index: [usize; D] = std::array::from_fn(|k| p / per_axis.pow(k as u32) % per_axis);
        let position = Vector::from_fn(|k, _| (index[k] as f64 + 0.5 + 0.3 * random.signed()) * distance);
        let volume = distance.powi(D as i32) * random.between(0.7, 1.3);
        particles.push(position, random.vector() * speed, volume, density * volume, 0);
        particles.acceleration[p] = random.vector() * (speed / dt);
        particles.displacement_gradient[p] = regime.displacement_gradient(random);
        if index[D - 1] == per_axis - 1 {
            let normal = Vector::from_fn(|k, _| if k == D - 1 { 1.0 } else { 0.0 });
            points.push(SurfacePoint::new(p, normal, distance.powi(D as i32 - 1)));
        }
    }
    let mut motion = std::array::from_fn(|_| None);
    motion[0] = Some(Motion::Rest);
    let grid = Grid { origin: Vector::zeros(), spacing: SPACING, cells: [6; D] };
    let bodies = vec![Body { name: "cloud".into(), law, density, dilatation: Default::default(), field: 0 }];
    Ok(Simulation {
        loads: Loads {
            gravity: Some(Gravity { acceleration: random.vector() * (speed / dt), curve: Curve::constant(1.0) }),
            surface: vec![SurfaceLoad {
                pressing: Pressing::Pressure(0.1 * YOUNG),
                curve: Curve::constant(1.0),
                points,
            }],
            prescribed: vec![Prescribed { name: "wall".into(), on: Selection::Face { axis: 0, upper: false }, motion }],
            damping: Some(Rayleigh { mass: 0.4 / dt, stiffness: 0.3 * dt }),
            ..Loads::default()
        }, // Not a half, where ε and 1 − ε are the same.
        settings: Settings { lumping: 0.3, gpu: device::used(), ..Settings::default() },
        ..Simulation::new(grid, approximation, bodies, particles, Clock::new(dt, 0))
    })
}
