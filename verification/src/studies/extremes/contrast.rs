//! ν = 0.4999999, stiffness contrast 1e10, density contrast 1e6: whole steps.

use super::bodies::{self, body, fill, gravity, normal, simulation, stir, sum_of_momenta};
use super::{Report, StudyError, rows, solvable, worse};
use bfree::approximation::{Approximation, Gimp, Linear, Lme};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Law, Material, MaterialState};
use bfree::mechanics::loads::{Curve, Motion};
use bfree::particles::Particles;
use bfree::simulation::{Simulation, StepError};
use bfree::tensor::{Tensor, Vector};

/// Round-off of a sum over the particles of a few nodes.
const ROUNDINGS: f64 = 64.0;

/// The step over the time of a wave: inertia is then below the last digit.
const QUASI_STATIC: f64 = 1e10;

pub(super) fn run() -> Result<Report, StudyError> {
    let mut report = rows("contrasts: errors relative to the exact answer, or to the sum of magnitudes");
    for poisson in [0.3, 0.49, 0.4999, 0.499_999_9] {
        // With these two families the particles integrate a uniform stress exactly.
        for (name, shape) in [("linear", Approximation::from(Linear)), ("gimp", Gimp::particles_per_axis(2).into())] {
            confined::<1>(poisson, name, &shape, &mut report)?;
            confined::<2>(poisson, name, &shape, &mut report)?;
            confined::<3>(poisson, name, &shape, &mut report)?;
        }
        for (name, shape) in [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into())] {
            vibrating::<2>(poisson, name, &shape, &mut report)?;
            vibrating::<3>(poisson, name, &shape, &mut report)?;
        }
    }
    for contrast in [1e2, 1e6, 1e10] {
        in_series(contrast, false, &mut report)?;
        in_series(contrast, true, &mut report)?;
    }
    for contrast in [1e2, 1e6] {
        for (name, shape) in [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into())] {
            falling::<1>(contrast, name, &shape, &mut report)?;
            falling::<2>(contrast, name, &shape, &mut report)?;
            colliding::<2>(contrast, name, &shape, &mut report)?;
        }
    }
    Ok(report)
}

/// A block that fills its box, pressed by one wall in one long step. H is uniform, and the force of the wall follows from the law.
fn confined<const D: usize>(
    poisson: f64,
    name: &str,
    shape: &Approximation,
    report: &mut Report,
) -> Result<(), StudyError> {
    const CELLS: u32 = 3;
    let lame = Lame::from_young_poisson(1.0, poisson)?;
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [CELLS; D] };
    let mut particles = Particles::default();
    fill(&mut particles, &grid, ([0; D], [CELLS; D]), 2, (0, 1.0));
    let dt = QUASI_STATIC / lame.shear.sqrt();
    let mut simulation = simulation(grid, shape.clone(), particles, vec![body(lame, 1.0)], dt);
    simulation.loads.prescribed = bodies::sliding();
    // A hundredth of the height.
    let (moving, strain) = (2 * D - 1, -0.01);
    let curve = Curve::new(vec![[0.0, 0.0], [dt, strain * f64::from(CELLS)]])?;
    simulation.loads.prescribed[moving] = normal(D - 1, true, Motion::Displacement(curve));
    let mut exact = Tensor::<f64, D>::zeros();
    exact[(D - 1, D - 1)] = strain;
    let at = MaterialState::new(exact);
    let piola = at.f * simulation.bodies[0].law.stress(&at);
    let force = piola[(D - 1, D - 1)] * f64::from(CELLS).powi(D as i32 - 1);
    let what = format!("confined compression, {name}, D = {D}");
    let case = format!("nu = {poisson}");
    let stepped = simulation.step();
    let reaction = stepped.as_ref().map(|report| (report.reactions[moving].force[D - 1] / force - 1.0).abs());
    let strains = simulation.particles.displacement_gradient.iter().map(|h| (h - exact).norm() / exact.norm());
    let strains = strains.fold(0.0, worse);
    // Only shear resists the round-off of the pressure, Λ eps |H|, so the error of H is Λ/G times larger.
    let bound = ROUNDINGS * f64::EPSILON * (1.0 + lame.lambda / lame.shear);
    match reaction {
        Ok(reaction) => {
            solvable(report, &what, &format!("{case}: H"), Ok::<_, StepError>(strains), bound);
            solvable(
                report,
                &what,
                &format!("{case}: reaction"),
                Ok::<_, StepError>(reaction),
                ROUNDINGS * f64::EPSILON,
            );
        }
        Err(_) => solvable(report, &what, &case, stepped.map(|_| f64::NAN), bound),
    }
    Ok(())
}

/// A free block that vibrates without change of volume to first order.
fn vibrating<const D: usize>(
    poisson: f64,
    name: &str,
    shape: &Approximation,
    report: &mut Report,
) -> Result<(), StudyError> {
    let lame = Lame::from_young_poisson(1.0, poisson)?;
    let mut simulation = bodies::block::<D>(if D == 3 { 2 } else { 3 }, shape.clone(), 0.2 / lame.shear.sqrt());
    simulation.bodies = vec![body(lame, 1.0)];
    let mut a = Tensor::<f64, D>::zeros();
    (a[(0, 0)], a[(1, 1)]) = (0.02, -0.02);
    a *= lame.shear.sqrt();
    stir(&mut simulation, &a);
    let momentum = flight(&mut simulation, 5);
    let what = format!("free vibration, linear momentum, {name}, D = {D}");
    solvable(report, &what, &format!("nu = {poisson}"), momentum, bodies::MOMENTUM);
    Ok(())
}

/// The worst change of the linear momentum over Σ m |v|.
fn flight<const D: usize>(simulation: &mut Simulation<D>, steps: u32) -> Result<f64, StepError> {
    let (start, scale) = (simulation.particles.momentum(), sum_of_momenta(&simulation.particles));
    let mut worst = 0.0;
    for _ in 0..steps {
        simulation.step()?;
        worst = worse(worst, (simulation.particles.momentum() - start).norm() / scale);
    }
    Ok(worst)
}

/// Two bars of two cells each in series, one stiffer by the factor `contrast`. A wall at the end of the second bar presses them together.
fn in_series(contrast: f64, stiff_last: bool, report: &mut Report) -> Result<(), StudyError> {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [4] };
    let mut particles = Particles::<1>::default();
    let (soft, stiff) = (Lame::new(1.0, 1.0)?, Lame::new(contrast, contrast)?);
    let laws = if stiff_last { [soft, stiff] } else { [stiff, soft] };
    let bodies = laws.map(|lame| body(lame, 1.0));
    fill(&mut particles, &grid, ([0], [2]), 2, (0, 1.0));
    fill(&mut particles, &grid, ([2], [4]), 2, (1, 1.0));
    let mut simulation = simulation(grid, Linear.into(), particles, bodies.into(), QUASI_STATIC);
    let shortening = 0.1;
    let curve = Curve::new(vec![[0.0, 0.0], [QUASI_STATIC, -shortening]])?;
    simulation.loads.prescribed = vec![normal(0, false, Motion::Rest), normal(0, true, Motion::Displacement(curve))];
    let exact =
        series(&simulation.bodies[usize::from(!stiff_last)].law, &simulation.bodies[usize::from(stiff_last)].law, {
            -0.5 * shortening
        });
    let side = if stiff_last { "at the moving wall" } else { "at the resting wall" };
    let what = format!("bars in series, the stiff one {side}");
    let stepped = simulation.step();
    let error = |which: u32, exact: f64| {
        let particles = &simulation.particles;
        let own = (0..particles.len()).filter(|&p| particles.body[p] == which);
        own.fold(0.0, |worst, p| worse(worst, (particles.displacement_gradient[p][0] / exact - 1.0).abs()))
    };
    let (in_soft, in_stiff) = (error(u32::from(!stiff_last), exact.0), error(u32::from(stiff_last), exact.1));
    let case = format!("contrast {contrast:e}");
    match stepped {
        Ok(_) => {
            // A stiff bar moves as a whole by rounded nodal displacements: its strains of eps have the stress contrast × eps.
            let bound = ROUNDINGS * f64::EPSILON * if stiff_last { contrast } else { 1.0 };
            solvable(report, &what, &format!("{case}: soft"), Ok::<_, StepError>(in_soft), bound);
            solvable(report, &what, &format!("{case}: stiff"), Ok::<_, StepError>(in_stiff), bound);
        }
        Err(error) => solvable(report, &what, &case, Err(error), 0.0),
    }
    Ok(())
}

/// The strains of a soft and a stiff bar that have the same nominal stress and together the strain `sum`.
fn series(soft: &Material, stiff: &Material, sum: f64) -> (f64, f64) {
    let nominal = |law: &Material, strain: f64| {
        let at = MaterialState::new(Tensor::<f64, 1>::from_element(strain));
        (at.f * law.stress(&at))[0]
    };
    let rest = MaterialState::new(Tensor::<f64, 1>::zeros());
    let modulus = |law: &Material| law.elasticity(&rest, &Tensor::from_element(1.0))[0];
    let slope = modulus(soft) + modulus(stiff);
    let mut in_stiff = 0.0;
    // The iteration contracts by the relative change of the moduli, a few tenths.
    for _ in 0..200 {
        in_stiff += (nominal(soft, sum - in_stiff) - nominal(stiff, in_stiff)) / slope;
    }
    (sum - in_stiff, in_stiff)
}

/// Two blocks that share nodes; the right one is denser by the factor `contrast`.
fn pair<const D: usize>(contrast: f64, shape: &Approximation, dt: f64) -> Simulation<D> {
    let mut simulation = bodies::block::<D>(4, shape.clone(), dt);
    let grid = simulation.grid;
    let mut particles = Particles::default();
    let split = |from: u32, to: u32| {
        let mut ends = ([4; D], [8; D]);
        (ends.0[0], ends.1[0]) = (from, to);
        ends
    };
    fill(&mut particles, &grid, split(4, 6), 2, (0, 1.0));
    fill(&mut particles, &grid, split(6, 8), 2, (1, contrast));
    simulation.particles = particles;
    simulation.bodies = [1.0, contrast].map(|density| body(bodies::PLAIN, density)).into();
    simulation
}

/// Both blocks fall together, for any masses.
fn falling<const D: usize>(
    contrast: f64,
    name: &str,
    shape: &Approximation,
    report: &mut Report,
) -> Result<(), StudyError> {
    let mut simulation = pair::<D>(contrast, shape, 0.1);
    let g: Vector<f64, D> = Vector::from_fn(|k, _| -0.1 - 0.1 * k as f64);
    simulation.loads.gravity = Some(gravity(g));
    simulation.set_initial_acceleration()?;
    let what = format!("a light and a heavy block fall as one, {name}, D = {D}");
    let case = format!("contrast {contrast:e}");
    let fallen = (0..10).try_for_each(|_| simulation.step().map(|_| ()));
    let speed = g * simulation.clock.time();
    let velocity = simulation.particles.velocity.iter().map(|v| (v - speed).norm() / speed.norm()).fold(0.0, worse);
    let strain = simulation.particles.displacement_gradient.iter().map(Tensor::norm).fold(0.0, worse);
    // Newton's method stops at a few eps of the heavy body's forces, which may act on a node of the light body.
    let bound = ROUNDINGS * f64::EPSILON * contrast;
    solvable(report, &what, &format!("{case}: velocity"), fallen.map(|()| velocity), bound);
    solvable(report, &what, &format!("{case}: strain"), Ok::<_, StepError>(strain), bound);
    Ok(())
}

/// The heavy block collides with the light one, which is at rest.
fn colliding<const D: usize>(
    contrast: f64,
    name: &str,
    shape: &Approximation,
    report: &mut Report,
) -> Result<(), StudyError> {
    let mut simulation = pair::<D>(contrast, shape, 0.2);
    simulation.clock = Clock::new(0.2, 10);
    for p in 0..simulation.particles.len() {
        if simulation.particles.body[p] == 1 {
            simulation.particles.velocity[p][0] = -0.1;
        }
    }
    let what = format!("a heavy block runs into a light one, linear momentum, {name}, D = {D}");
    solvable(report, &what, &format!("contrast {contrast:e}"), flight(&mut simulation, 10), bodies::MOMENTUM);
    Ok(())
}
