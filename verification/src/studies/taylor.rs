//! Remainders of Taylor's expansion of Π and R along a line, on whole steps of every shipped scene.

use super::{Effort, Outcome, StudyError};
use crate::prepared::Prepared;
use crate::random::Random;
use crate::report::{Bound, Report};
use crate::shipped;
use bfree::mechanics::residual::Equilibrium;
use bfree::simulation::Simulation;
use bfree::material::Material;
use bfree::tensor::Vector;
use num_dual::Dual2_64;

pub(super) const ABOUT: &str = "slopes 2 and 3 of the remainders of the potential and of the residual, on steps of every scene";

/// Points s = 2⁰, 2⁻¹, …
const POINTS: i32 = 30;

/// A remainder counts if it is at least this many times its round-off.
const ABOVE_FLOOR: f64 = 200.0;

/// The slope is the median of this many local slopes, the last ones above the floor.
const LOCAL_SLOPES: usize = 5;

/// One steep rise and two gentle falls.
const SAWTOOTH: [f64; 3] = [0.0, 1.0, 0.5];

/// The largest distance of a slope from a whole number.
const TOLERANCE: f64 = 0.1;

/// Π(x + s u) and R(x + s u) minus their expansions at x, for shrinking s.
pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let steps = if *effort == Effort::Full { 40 } else { 2 };
    let mut report = Report::new("Taylor remainders: slope of log(remainder) over log(s)", &["scene", "remainder", "points"]);
    for name in shipped::names()? {
        let scene = shipped::scene(&name, &[] as &[&str])?;
        match scene.dimension() {
            1 => judge::<1>(&mut report, &name, scene.build(&shipped::folder())?, steps, scene.time.end)?,
            2 => judge::<2>(&mut report, &name, scene.build(&shipped::folder())?, steps, scene.time.end)?,
            _ => judge::<3>(&mut report, &name, scene.build(&shipped::folder())?, steps, scene.time.end)?,
        }
    }
    report.note(format!(
        "After {steps} steps of the scene, or three quarters of its time; x is the prescribed motion of the next step and a random deformation elsewhere. A slope is the median of the last {LOCAL_SLOPES} local ones whose remainders are {ABOVE_FLOOR} times their round-off, eps times the magnitude of the contributions; `points` are those above it.",
    ));
    report.note("Slope 2 of R - R(x) - s K u and slope 3 of Pi - ... - s^2/2 u.Ku hold only for the exact K; slope 3 of R uses its second derivative by dual numbers.");
    Ok(Outcome { reports: vec![report], ..Outcome::default() })
}

/// The four remainders.
const NAMES: [(&str, f64); 4] = [
    ("Pi - (Pi + s R.u)", 2.0),
    ("Pi - (Pi + s R.u + s^2/2 u.Ku)", 3.0),
    ("R - (R + s K u)", 2.0),
    ("R - (R + s K u + s^2/2 R''uu)", 3.0),
];

/// Adds the slopes of one scene to the report.
fn judge<const D: usize>(
    report: &mut Report,
    name: &str,
    mut simulation: Simulation<D>,
    steps: usize,
    end: f64,
) -> Result<(), StudyError> {
    // The last load of a scene may be the limit of its body, and the tested step starts on a reset grid; so the run ends earlier.
    for _ in 0..steps {
        if simulation.clock.time() > 0.75 * end {
            break;
        }
        simulation.advance()?;
    }
    simulation.forget();
    let prepared = Prepared::new(&simulation)?;
    let equilibrium = prepared.equilibrium(&simulation);
    let mut random = Random::new(3);
    let size = 0.02 * simulation.grid.spacing;
    // A random deformation of some percent, so that every term contributes.
    let mut x: Vec<Vector<f64, D>> = random.field::<D>(prepared.nodes.len()).iter().map(|x| x * size).collect();
    prepared.prescribe(&mut x);
    // A direction of similar size, a skew sawtooth. Stretches and compressions of equal shape would cancel in the third derivative of Π and
    // show the fourth.
    let sawtooth = |at: u32, random: &mut Random| SAWTOOTH[at as usize % SAWTOOTH.len()] + 0.2 * random.signed();
    let indices = prepared.nodes.positions(&simulation.grid);
    let mut u: Vec<Vector<f64, D>> =
        indices.map(|(index, _)| Vector::from_fn(|k, _| size * sawtooth(index[k], &mut random))).collect();
    equilibrium.clear_prescribed(&mut u);

    for ((title, order), points) in NAMES.iter().zip(remainders(&equilibrium, &x, &u)?) {
        if points.is_empty() {
            continue;
        }
        let above: Vec<f64> = points
            .iter()
            .take_while(|point| point.remainder > ABOVE_FLOOR * point.floor)
            .map(|point| point.remainder)
            .collect();
        let bound = Bound::Between(order - TOLERANCE, order + TOLERANCE);
        report.push(&[name, title, &above.len().to_string()], slope(&above).unwrap_or(f64::NAN), bound);
    }
    Ok(())
}

/// A remainder, and its round-off.
#[derive(Clone, Copy, Debug)]
struct Point {
    remainder: f64,
    floor: f64,
}

/// The median of the last local slopes, log₂ of the ratio over a halving of s; `None` if there are too few slopes.
fn slope(remainders: &[f64]) -> Option<f64> {
    let mut local: Vec<f64> = remainders.windows(2).rev().take(LOCAL_SLOPES).map(|w| (w[0] / w[1]).log2()).collect();
    local.sort_by(f64::total_cmp);
    (local.len() >= 3).then(|| local[local.len() / 2])
}

/// The remainders of [`NAMES`]; those of Π are empty if there is no potential.
fn remainders<const D: usize>(
    equilibrium: &Equilibrium<'_, D, Material>,
    x: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
) -> Result<[Vec<Point>; 4], StudyError> {
    let free = |mut field: Vec<Vector<f64, D>>| {
        equilibrium.clear_prescribed(&mut field);
        field
    };
    let r = free(equilibrium.residual::<f64>(x)?);
    let mut k_u = vec![Vector::zeros(); x.len()];
    equilibrium.tangent(x)?.product(u, &mut k_u);
    // R(x + s u) = R + s R' + s²/2 R'': x + ε u with ε² kept.
    let seeded: Vec<_> = x.iter().zip(u).map(|(x, u)| x.zip_map(u, |x, u| Dual2_64::new(x, u, 0.0))).collect();
    let second = equilibrium.residual(&seeded)?.iter().map(|r| r.map(|x| x.v2)).collect();
    let second = free(second);
    let (r_u, u_k_u) = (dot(&r, u), dot(u, &k_u));
    let potential = equilibrium.potential::<f64>(x).transpose()?;

    let mut lists: [Vec<Point>; 4] = Default::default();
    for k in 0..POINTS {
        let s = 0.5_f64.powi(k);
        let moved: Vec<_> = x.iter().zip(u).map(|(x, u)| x + u * s).collect();
        if let (Some((at_x, _)), Some(moved)) = (potential, equilibrium.potential::<f64>(&moved)) {
            let (at_moved, magnitude) = moved?;
            let floor = f64::EPSILON * magnitude;
            let first = at_moved - at_x - s * r_u;
            lists[0].push(Point { remainder: first.abs(), floor });
            lists[1].push(Point { remainder: (first - 0.5 * s * s * u_k_u).abs(), floor });
        }
        let r_moved = free(equilibrium.residual::<f64>(&moved)?);
        let floor = f64::EPSILON * equilibrium.magnitude(&moved)?;
        let of = |factor: f64| {
            let all = r_moved.iter().zip(&r).zip(k_u.iter().zip(&second));
            all.map(|((moved, r), (k, second))| (moved - r - k * s - second * factor).norm_squared()).sum::<f64>().sqrt()
        };
        lists[2].push(Point { remainder: of(0.0), floor });
        lists[3].push(Point { remainder: of(0.5 * s * s), floor });
    }
    Ok(lists)
}

fn dot<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_cube_is_three_and_of_too_few_points_unknown() {
        let cube: Vec<f64> = (0..9).map(|k| 7.0 * 0.125_f64.powi(k)).collect();
        assert_eq!(slope(&cube), Some(3.0));
        assert_eq!(slope(&cube[..3]), None);
    }
}
