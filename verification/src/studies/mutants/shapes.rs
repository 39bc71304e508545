//! Wrong shape functions: linear functions and splines with one fault.

use super::forecast::{ALL, PLANE_AND_SPACE, Red, judge as compare, red};
use crate::check_approximation;
use crate::report::Report;
use bfree::approximation::{ApproximationError, AxisWeights, Bspline, Linear, Separable, Validate};
use bfree::grid::Axis;

/// The fault of a shape function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    GradientSign,
    Unity,
    Consistency,
    FarNodeDropped,
    GhostsDropped,
}

/// A shape function with a fault.
#[derive(Clone)]
struct Wrong(Fault);

impl Validate for Wrong {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

impl Separable for Wrong {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        if self.0 == Fault::GhostsDropped {
            return without_ghosts(axis, x, out);
        }
        Linear.axis(axis, x, out)?;
        match self.0 {
            Fault::GradientSign => out.derivatives.iter_mut().for_each(|slope| *slope = -*slope),
            Fault::Unity => {
                out.values.iter_mut().chain(&mut out.derivatives).for_each(|x| *x *= 1.0 + 1e-6);
            }
            // N = 3s² − 2s³, a partition of unity with the right gradients that does not reproduce x.
            Fault::Consistency => {
                for (value, slope) in out.values.iter_mut().zip(&mut out.derivatives) {
                    *slope *= 6.0 * *value * (1.0 - *value);
                    let v = *value;
                    *value = v * v * (3.0 - 2.0 * v);
                }
            }
            // A node is left out if N = 0, whatever its gradient.
            Fault::FarNodeDropped => {
                if out.values.last() == Some(&0.0) {
                    out.values.pop();
                    out.derivatives.pop();
                } else if out.values.first() == Some(&0.0) {
                    out.first += 1;
                    out.values.remove(0);
                    out.derivatives.remove(0);
                }
            }
            Fault::GhostsDropped => {}
        }
        Ok(())
    }

    fn width(&self) -> usize {
        3
    }
}

/// Splines of a longer axis. The nodes beyond the walls are dropped instead of folded back.
fn without_ghosts(axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
    const BEYOND: u32 = 3;
    let origin = axis.origin - f64::from(BEYOND) * axis.spacing;
    let longer = Axis { origin, cells: axis.cells + 2 * BEYOND, ..*axis };
    let mut all = AxisWeights::default();
    Bspline::Quadratic.axis(&longer, x, &mut all)?;
    let listed = |k: usize| (all.first + k as u32).checked_sub(BEYOND).filter(|&node| node <= axis.cells);
    out.start((0..all.values.len()).find_map(listed).unwrap_or(0));
    for k in (0..all.values.len()).filter(|&k| listed(k).is_some()) {
        out.push(all.values[k], all.derivatives[k]);
    }
    Ok(())
}

const UNITY: &str = "sum N = 1";
const FIRST: &str = "sum N x_I = x";
const GRADIENT: &str = "sum grad N = 0";
const FIRST_GRADIENT: &str = "sum x_I grad N = I";
const DIFFERENCES: &str = "grad N against differences";
const OFF_WALL: &str = "N = 0 off the wall";

/// Positions with only nodal coordinates: N is 0 or 1, and differences would step over a kink.
const ON_NODES: &[&str] = &["on a node", "in a corner"];
/// In 1D faces are nodes, and walls corners.
const LINE: &[&str] = &["1"];
const ON_NODES_OF_A_LINE: &[&str] = &["on a face", "on a node", "on a wall", "in a corner"];
/// Positions without nodal coordinates.
const OFF_NODES: &[&str] = &["inside a cell", "near a wall"];
/// Positions off the walls. Faces and nodes are drawn from all, including those of the walls.
const OFF_WALLS: &[&str] = OFF_NODES;

const MUTANTS: &[(&str, Fault, &[Red])] = &[
    (
        "gradients with the other sign",
        Fault::GradientSign,
        &[
            red(FIRST_GRADIENT, ALL),
            red(DIFFERENCES, PLANE_AND_SPACE).except(ON_NODES),
            red(DIFFERENCES, LINE).except(ON_NODES_OF_A_LINE),
        ],
    ),
    ("no partition of unity, by 1e-6", Fault::Unity, &[red(UNITY, ALL), red(FIRST_GRADIENT, ALL)]),
    (
        "no first-order consistency",
        Fault::Consistency,
        &[
            red(FIRST, PLANE_AND_SPACE).except(ON_NODES),
            red(FIRST, LINE).except(ON_NODES_OF_A_LINE),
            red(FIRST_GRADIENT, ALL),
        ],
    ),
    (
        "nodes with N = 0 left out",
        Fault::FarNodeDropped,
        &[red(GRADIENT, ALL).except(OFF_NODES), red(FIRST_GRADIENT, ALL).except(OFF_NODES)],
    ),
    (
        "ghosts beyond a wall left out",
        Fault::GhostsDropped,
        &[
            red(UNITY, ALL),
            red(FIRST, ALL),
            red(GRADIENT, ALL),
            red(FIRST_GRADIENT, ALL),
            red(OFF_WALL, ALL).except(OFF_WALLS),
        ],
    ),
];

/// Checks every wrong shape function.
pub(super) fn judge(report: &mut Report) {
    for &(name, fault, forecast) in MUTANTS {
        compare(report, name, "check_approximation", &check_approximation(&Wrong(fault)), forecast);
    }
}
