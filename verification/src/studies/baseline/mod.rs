//! The tangent as a matrix, B-free and in Voigt's notation, against the matrix-free product.

mod statics;

use super::{Effort, Outcome, StudyError};
use crate::baseline::{BFree, BlockMatrix, Pattern, Voigt, assemble};
use crate::prepared::Prepared;
use crate::random::Random;
use crate::report::{Bound, Report};
use crate::settling;
use crate::table::Table;
use bfree::approximation::{Approximation, Linear, Lme};
use bfree::clock::Clock;
use bfree::material::{Law, Material, MaterialState};
use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::tangent::frozen_bytes;
use bfree::simulation::Simulation;
use bfree::pooled::Pool;
use bfree::solver::{BlockJacobi, GmresSettings, gmres};
use bfree::tensor::{Tensor, Vector, identity};
use std::hint::black_box;
use std::time::Instant;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "the tangent assembled B-free and by Voigt's BtDB, beside the matrix-free product";

/// The error of sums of at most some hundred products of size one.
const ENTRIES: f64 = 1e-13;

/// The largest number of assembled blocks: 2.4 GB in 3D.
const MOST_BLOCKS: usize = 30_000_000;

/// A relative residual within the reach of GMRES.
const SOLVE: f64 = 1e-10;

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut study = Study {
        report: Report::new("the same tangent three ways", &["quantity", "case"]),
        table: Table::new(
            "the tangent of one step (bytes and seconds; times are the best of several)",
            [
                "case", "law", "particles", "unknowns", "blocks", "MB free", "MB matrix", "ratio", "s pattern", "s B-free", "s Voigt",
                "s freeze", "s K u free", "s K u matrix", "products to pay",
            ],
        ),
        solves: Table::new(
            "one linear solve, relative residual 1e-10",
            ["case", "GMRES products", "s GMRES, matrix-free", "s GMRES, matrix"],
        ),
    };
    // One law of each formula: the laws with another volumetric part cost the same.
    let mut laws = Material::examples(settling::lame()?);
    laws.retain(|(name, _)| *name != "neo-Hookean, logarithmic");
    let shapes = [("linear", Approximation::from(Linear)), ("lme 3", Lme::new(3.0, 1e-6).into())];
    for (law_name, law) in &laws {
        let law_name = law_name.trim_end_matches(", Ciarlet");
        // The seconds depend on whether a tangent has a closed form, and on little else of the law: one law of each kind has large blocks.
        let large = *effort == Effort::Full && matches!(law, Material::NeoHookean(_) | Material::Ogden(_));
        let (plane, space) = if large { (64, 10) } else { (16, 4) };
        // Blocks of a law without a closed form need one product each. LME has 4·10⁵ of them in 3D, which take up to three minutes and show
        // no more than linear functions.
        let is_closed = law.closed::<3>(&identity(), &MaterialState::new(Tensor::zeros()), 1.0).is_some();
        for (name, shape) in shapes.iter().take(if is_closed { 2 } else { 1 }) {
            study.case::<2>(name, shape, law, law_name, plane)?;
            study.case::<3>(name, shape, law, law_name, space)?;
        }
    }
    let mut remarks = vec![
        "MB free: shape functions and frozen point tangents, all that the matrix-free product reads; MB matrix: blocks and pattern.".into(),
        "s freeze is what the matrix-free tangent costs instead of the assembly, its preconditioner's blocks included.".into(),
    ];
    remarks.push(
        "Products to pay: how many products of one tangent it takes until the faster product of the matrix has paid for its assembly \
         (a Newton iteration takes about ten to sixty)."
            .into(),
    );
    if !cfg!(feature = "direct") {
        remarks.push("The sparse direct solves need `--features direct` (faer takes a minute to build).".into());
    }
    let (statics, systems) = statics::run(*effort)?;
    let (reports, tables) = (vec![study.report, statics], vec![study.table, study.solves, systems]);
    Ok(Outcome { reports, tables, remarks, ..Outcome::default() })
}

struct Study {
    report: Report,
    table: Table,
    solves: Table,
}

impl Study {
    fn case<const D: usize>(
        &mut self,
        shape_name: &str,
        shape: &Approximation,
        law: &Material,
        law_name: &str,
        cells: u32,
    ) -> Result<(), StudyError> {
        let case = format!("{D}D {shape_name} {cells}^{D}, {law_name}");
        let simulation = strained_block::<D>(shape.clone(), law.clone(), cells)?;
        let prepared = Prepared::new(&simulation)?;
        let equilibrium = prepared.equilibrium(&simulation);
        let count = prepared.nodes.len();
        let mut random = Random::new(11);
        let mut dphi: Vec<Vector<f64, D>> = random.field(count).iter().map(|x: &Vector<f64, D>| x * 0.01).collect();
        prepared.prescribe(&mut dphi);

        let (pattern, pattern_seconds) = timed(|| Pattern::new(&prepared.supports, count, MOST_BLOCKS))?;
        let (b_free, b_free_seconds) = timed(|| assemble(&equilibrium, &dphi, &pattern, &BFree))?;
        let (voigt, voigt_seconds) = timed(|| assemble(&equilibrium, &dphi, &pattern, &Voigt))?;
        self.report.push(&["entries, B-free - Voigt", &case], b_free.difference(&voigt), Bound::AtMost(ENTRIES));
        drop(voigt);

        let (tangent, freeze_seconds) = timed(|| equilibrium.tangent(&dphi))?;
        let mut u: Vec<Vector<f64, D>> = random.field(count);
        equilibrium.clear_prescribed(&mut u);
        let mut by_matrix = vec![Vector::zeros(); count];
        let mut free = by_matrix.clone();
        let matrix_seconds = best(|| b_free.product(black_box(&u), &mut by_matrix));
        let free_seconds = best(|| tangent.product(black_box(&u), &mut free));
        equilibrium.clear_prescribed(&mut by_matrix);
        let difference = distance(&by_matrix, &free) / norm(&free);
        self.report.push(&["product, matrix - matrix-free", &case], difference, Bound::AtMost(ENTRIES));

        let frozen = frozen_bytes(&simulation.particles, &simulation.bodies, &prepared.supports);
        let bytes = [prepared.supports.bytes() + frozen, b_free.bytes()].map(|bytes| bytes as f64);
        let spent = pattern_seconds + b_free_seconds - freeze_seconds;
        let saved = free_seconds - matrix_seconds;
        let counts = [simulation.particles.len(), D * count, pattern.len()].map(|count| count.to_string());
        let megabytes = bytes.map(|bytes| format!("{:.2}", bytes / 1e6));
        let seconds = [pattern_seconds, b_free_seconds, voigt_seconds, freeze_seconds, free_seconds, matrix_seconds];
        let mut row = vec![format!("{D}D {shape_name}"), law_name.into()];
        row.extend(counts.into_iter().chain(megabytes));
        row.push(format!("{:.1}", bytes[1] / bytes[0]));
        row.extend(seconds.map(|s| format!("{s:.5}")));
        row.push(if saved > 0.0 { format!("{:.0}", (spent / saved).max(0.0)) } else { "never".into() });
        self.table.push(row);
        if matches!(law, Material::NeoHookean(_)) {
            self.solve(&case, &equilibrium, &dphi, &b_free)?;
        }
        Ok(())
    }

    /// K x = −R by GMRES with both products.
    fn solve<const D: usize>(
        &mut self,
        case: &str,
        equilibrium: &Equilibrium<'_, D, Material>,
        dphi: &[Vector<f64, D>],
        matrix: &BlockMatrix<'_, D>,
    ) -> Result<(), StudyError> {
        let mut right = equilibrium.residual::<f64>(dphi)?;
        equilibrium.clear_prescribed(&mut right);
        let right: &[f64] = bytemuck::cast_slice(&right);
        let (tangent, mut blocks, pool) = (equilibrium.tangent(dphi)?, BlockJacobi::<D>::default(), Pool::default());
        blocks.take(&tangent);
        let settings = GmresSettings { relative_tolerance: SOLVE, max_iterations: 4000, restart: 100 };
        let mut x = vec![0.0; right.len()];
        let (report, free_seconds) = timed(|| gmres(&tangent, &blocks, right, &mut x, &settings, &pool))?;
        self.report.push(&["GMRES, relative residual", case], report.relative_residual, Bound::AtMost(SOLVE));
        x.fill(0.0);
        let held = Held { matrix, equilibrium };
        let (_, matrix_seconds) = timed(|| gmres(&held, &blocks, right, &mut x, &settings, &pool))?;
        let seconds = [free_seconds, matrix_seconds].map(|s| format!("{s:.4}"));
        self.solves.push([case.into(), report.products.to_string()].into_iter().chain(seconds));
        Ok(())
    }
}

/// The matrix on the free degrees of freedom.
struct Held<'a, const D: usize> {
    matrix: &'a BlockMatrix<'a, D>,
    equilibrium: &'a Equilibrium<'a, D, Material>,
}

impl<const D: usize> bfree::solver::LinearOperator for Held<'_, D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let y: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(y);
        self.matrix.product(bytemuck::cast_slice(x), y);
        self.equilibrium.clear_prescribed(y);
    }
}

/// A result and the seconds it took.
fn timed<T, E>(run: impl FnOnce() -> Result<T, E>) -> Result<(T, f64), E> {
    let start = Instant::now();
    Ok((run()?, start.elapsed().as_secs_f64()))
}

/// The shortest of five runs, after one warm-up run.
fn best(mut run: impl FnMut()) -> f64 {
    run();
    (0..5).fold(f64::INFINITY, |best: f64, _| {
        let start = Instant::now();
        run();
        best.min(start.elapsed().as_secs_f64())
    })
}

fn norm<const D: usize>(a: &[Vector<f64, D>]) -> f64 {
    a.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}

fn distance<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
}

/// The settling block. Every particle is strained by some tenths and has a random velocity. Half of the mass is consistent. The Courant
/// number is about 5, so that inertia and stiffness both count.
fn strained_block<const D: usize>(
    approximation: Approximation,
    law: Material,
    cells: u32,
) -> Result<Simulation<D>, StudyError> {
    let mut simulation = settling::block::<D>(approximation, Some(law), cells, 0.1, 0.5)?;
    let (mut random, particles) = (Random::new(5), &mut simulation.particles);
    for (v, h) in particles.velocity.iter_mut().zip(&mut particles.displacement_gradient) {
        *v = random.vector() * 0.1;
        *h = Tensor::from_fn(|_, _| 0.15 * random.signed());
    }
    simulation.clock = Clock::new(5.0 * simulation.clock.step(), 0);
    Ok(simulation)
}
