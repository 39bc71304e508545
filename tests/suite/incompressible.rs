//! Nearly incompressible bodies: the mixed form gives the answer of the displacement form, in iterations that depend neither on ν nor on h.

use crate::support::{Failure, advance, run_to, scene};
use bfree::plan::Plan;
use bfree::simulation::{Simulation, StepReport};
use bfree::solver::Preconditioning;
use std::num::NonZeroU64;

const CUBIC: &str = r#"{"bspline":{"degree":3}}"#;

/// Cook's membrane of G = 422.5 kPa under its whole load.
fn membrane(poisson: f64, spacing: f64, approximation: &str, more: &[&str]) -> Result<Simulation<2>, Failure> {
    let given = [
        format!("grid={{\"size\":[60,84],\"spacing\":{spacing}}}"),
        format!("bodies.0.material.neo_hookean={{\"young\":{},\"poisson\":{poisson}}}", 0.845 * (1.0 + poisson)),
        format!("approximation={approximation}"),
        r#"bodies.0.volumetric="mean_dilatation""#.to_owned(),
        "time.step=1".to_owned(),
        "output={}".to_owned(),
    ];
    let given: Vec<&str> = given.iter().map(String::as_str).chain(more.iter().copied()).collect();
    scene("cook.json", &given)
}

fn counts<const D: usize>(step: &StepReport<D>) -> (usize, usize) {
    (step.newton.history.iterations.len(), step.newton.history.counts.krylov_iterations)
}

/// The largest distance of two sets of positions, relative to the largest displacement.
fn apart<const D: usize>(a: &Simulation<D>, b: &Simulation<D>, start: &Simulation<D>) -> f64 {
    let [a, b, start] = [a, b, start].map(|of| of.particles.by_id().position);
    let most = |pairs: &mut dyn Iterator<Item = f64>| pairs.fold(0.0, f64::max);
    let moved = most(&mut a.iter().zip(&start).map(|(a, start)| (a - start).norm()));
    most(&mut a.iter().zip(&b).map(|(a, b)| (a - b).norm())) / moved
}

/// Up to κ/G of half a million, the whole load in one step. The bounds are a tenth above what is measured; the displacement form takes thousands of
/// iterations and fails.
#[test]
fn iterations_depend_neither_on_the_bulk_modulus_nor_on_the_grid() -> Result<(), Failure> {
    for (approximation, most) in [("\"linear\"", 73), (CUBIC, 120)] {
        let mut all = Vec::new();
        for spacing in [4.0, 2.0] {
            for poisson in [0.49, 0.4999, 0.499999] {
                let step = membrane(poisson, spacing, approximation, &[])?.advance()?;
                assert!(step.failed.is_empty(), "{approximation} {poisson}");
                all.push(counts(&step));
            }
        }
        let (newton, krylov): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        assert!(newton.iter().all(|&n| n <= 8), "{approximation}: {newton:?}");
        // Flat in κ from 5000 G on.
        assert!(krylov.chunks(3).all(|of| of[2].abs_diff(of[1]) * 20 <= of[1]), "{approximation}: {krylov:?}");
        assert!(krylov.iter().all(|&k| k <= most), "{approximation}: {krylov:?}");
    }
    Ok(())
}

/// Lamé's ring at ν = 0.4999 in one load step: the largest error of κ(θ − 1) over the pressure, Newton's iterations, and the most iterations
/// of GMRES in one of them. The mean stress is 2 A (1 + ν)/3 everywhere, with A = p a²/(b² − a²).
fn ring(approximation: &str, spacing: f64) -> Result<(f64, usize, usize), Failure> {
    let (pressure, mean, bulk) = (2.0, 1.6, 2500.0 / (3.0 * (1.0 - 2.0 * 0.4999)));
    let given = [
        format!("approximation={approximation}"),
        format!("grid.spacing={spacing}"),
        "bodies.0.material.neo_hookean.poisson=0.4999".to_owned(),
        r#"bodies.0.volumetric="mean_dilatation""#.to_owned(),
        "time.step=1".to_owned(),
    ];
    let mut simulation: Simulation<2> = scene("ring.json", &given.each_ref().map(String::as_str))?;
    let newton = simulation.advance()?.newton.history.iterations;
    let particles = &simulation.particles;
    let solid = (0..particles.len()).filter(|&p| particles.is_solid(p));
    let error = solid.map(|p| (bulk * particles.dilatation[p] - mean).abs() / pressure).fold(0.0, f64::max);
    Ok((error, newton.len(), newton.iter().map(|one| one.krylov.iterations).max().unwrap_or(0)))
}

/// A cell that the ring hardly fills has no pressure of its own. The table of the manual:
/// `BFREE_RING=0.25,0.125,0.0625 cargo test --release --test suite incompressible::the_pressure -- --nocapture`
#[test]
fn the_pressure_at_a_hole_is_right_in_hardly_filled_cells_too() -> Result<(), Failure> {
    const QUADRATIC: &str = r#"{"bspline":{"degree":2}}"#;
    for (approximation, most) in [("\"linear\"", 0.2), (QUADRATIC, 0.05), (CUBIC, 0.05)] {
        let (error, ..) = ring(approximation, 0.125)?;
        assert!(error < most, "{approximation}: {error}");
    }
    for spacing in std::env::var("BFREE_RING").iter().flat_map(|spacings| spacings.split(',')) {
        for approximation in ["\"linear\"", QUADRATIC, CUBIC, r#"{"lme":{"gamma":3}}"#] {
            let (error, newton, most) = ring(approximation, spacing.parse()?)?;
            println!("{approximation}, h = {spacing}: error {error:.2e} p, Newton {newton}, GMRES at most {most}");
        }
    }
    Ok(())
}

/// In load steps, and in steps of inertia at a large Courant number.
#[test]
fn the_mixed_form_gives_the_answer_of_the_displacement_form() -> Result<(), Failure> {
    let tight = "solver.newton.tolerance=1e-11";
    let dynamic = [
        r#"time={"step":0.05,"end":0.1,"scheme":{"generalized_alpha":{"spectral_radius":0.8}}}"#,
        "bodies.0.density=1e-6",
        "grid.reset=\"every_step\"",
    ];
    for (poisson, more) in [(0.49, &["time.step=0.5"][..]), (0.4999, &["time.step=0.125"]), (0.49, &dynamic)] {
        let more = [&[tight], more].concat();
        let start = membrane(poisson, 6.0, "\"linear\"", &more)?;
        let [mut mixed, mut motions] = [start.clone(), start.clone()];
        motions.settings.preconditioner = Preconditioning::BlockJacobi;
        for simulation in [&mut mixed, &mut motions] {
            advance(simulation, 2)?;
        }
        assert!(Plan::of(&start)?.krylov.1.contains("averaged cells"), "{}", Plan::of(&start)?);
        assert!(Plan::of(&motions)?.unknowns < Plan::of(&mixed)?.unknowns);
        let apart = apart(&mixed, &motions, &start);
        assert!(apart < 1e-10, "ν = {poisson}: {apart:e}");
    }
    Ok(())
}

/// Courant numbers of 8, 16 and 39: diagonal blocks are the fastest up to about 30, and the mixed form above. A scene that asks for multigrid has the
/// mixed form from 10 on.
#[test]
fn the_mixed_form_is_chosen_in_long_steps_alone() -> Result<(), Failure> {
    for (step, chosen, asked) in [(0.01, false, false), (0.02, false, true), (0.05, true, true)] {
        let time = format!(r#"time={{"step":{step},"end":1}}"#);
        let mut simulation = membrane(0.49, 6.0, "\"linear\"", &[&time, "bodies.0.density=1e-6"])?;
        let mixed = |of: &Simulation<2>| of.krylov().1.contains("averaged cells");
        assert_eq!(mixed(&simulation), chosen, "{step}");
        assert_eq!(simulation.preconditioner().0 == Preconditioning::Multigrid, chosen, "{step}");
        simulation.settings.preconditioner = Preconditioning::Multigrid;
        assert_eq!(mixed(&simulation), asked, "{step}");
    }
    Ok(())
}

/// Every law with a volumetric part, by dual numbers through the product that GMRES applies, at the end of the first steps.
#[test]
fn the_product_of_the_mixed_form_is_the_derivative_of_its_residuals() -> Result<(), Failure> {
    let every = NonZeroU64::new(1);
    for law in [
        r#"{"neo_hookean":{"bulk":500,"shear":1}}"#,
        r#"{"neo_hookean_logarithmic":{"bulk":500,"shear":1}}"#,
        r#"{"mooney_rivlin":{"c1":0.3,"c2":0.2,"bulk":500}}"#,
        r#"{"ogden":{"terms":[{"modulus":1.2,"exponent":1.5},{"modulus":-0.1,"exponent":-2}],"bulk":500}}"#,
        r#"{"von_mises":{"elastic":{"bulk":500,"shear":1},"yield_stress":{"initial":0.15,"linear":0.5}}}"#,
    ] {
        let given = [&format!("bodies.0.material={law}"), "tractions.0.traction=[0,0.02]", "time.step=0.25"];
        let mut plane = membrane(0.49, 6.0, CUBIC, &given).map_err(|error| format!("{law}: {error}"))?;
        plane.settings.check_tangent = every;
        advance(&mut plane, 2)?;
        let given = [
            &format!("bodies.0.material={law}"),
            "gravity.acceleration=[0.05,0,-0.1]",
            "grid.spacing=0.25",
            r#"bodies.0.volumetric="mean_dilatation""#,
        ];
        let mut block = scene::<3>("block_static.json", &given)?;
        block.settings.check_tangent = every;
        assert!(Plan::of(&block)?.terms.iter().any(|(name, used, _)| *name == "dilatation of cells" && *used));
        run_to(&mut block, 1.0)?;
    }
    Ok(())
}
