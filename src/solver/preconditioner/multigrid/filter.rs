//! The finest smoother of cubic B-splines. Values at nodes are [1 4 1]/6 of their coefficients along each axis, so coefficients that
//! alternate from node to node hardly move the body. D⁻¹K is small for such patterns, and point smoothers damp them poorly. The filter Q Qᵀ
//! with Q ≈ Π_axes ([1 4 1]/6)⁻¹ amplifies them: M = D⁻¹ + D^{−½} Q Qᵀ D^{−½} takes the place of D⁻¹.

use super::form::LocalForm;
use crate::gpu::{self, Gpu};
use crate::lanes::{Lanes, WithLanes, widest};
use crate::parallel;
use crate::pooled::Pool;
use crate::tensor::{Tensor, Vector};

/// Steps of the Chebyshev iteration for ([1 4 1]/6)⁻¹.
const STEPS: usize = 3;
/// Bounds of the eigenvalues of [1 4 1]/6.
const SPECTRUM: [f64; 2] = [1.0 / 3.0, 1.0];

/// Nodes in one part of the work of a thread, if its lines are short.
const PART: usize = 512;

/// The place of a node that is no unknown.
const NONE: u32 = u32::MAX;

/// `(nodes, values)`: writes the values of some nodes.
type Fill<'a, const D: usize> = dyn Fn(&[u32], &mut [Vector<f64, D>]) + Sync + 'a;

/// The nodes in the order of the lines along one axis.
#[derive(Clone, Debug, Default)]
struct Lines {
    /// The nodes, line after line.
    nodes: Vec<u32>,
    /// Number of nodes in each line.
    lengths: Vec<u32>,
    /// The place of every node in `nodes`.
    places: Vec<u32>,
}

/// The filter D^{−½} Q Qᵀ D^{−½}.
#[derive(Clone, Debug, Default)]
pub(super) struct Filter {
    /// The lines along each axis.
    lines: [Lines; 3],
    /// (D unit)^{−½} of each unknown; 0 for values that are no unknowns.
    scale: Vec<f64>,
    unit: f64,
    pool: Pool,
}

impl Lines {
    /// The lines of neighbours along an axis. `nodes` are the indices of the nodes in the grid, or `None` for nodes that are no unknowns.
    fn along(axis: usize, nodes: &[Option<[u32; 3]>]) -> Self {
        let key = |at: &[u32; 3]| {
            let mut line = *at;
            line[axis] = 0;
            (line, at[axis])
        };
        let mut sorted: Vec<_> =
            nodes.iter().zip(0..).filter_map(|(at, node)| Some((key(at.as_ref()?), node))).collect();
        sorted.sort_unstable();
        let follow =
            |&((line, at), _): &(_, u32), &((next_line, next), _): &(_, u32)| line == next_line && at + 1 == next;
        let mut lines = Self { places: vec![NONE; nodes.len()], ..Self::default() };
        for line in sorted.chunk_by(follow) {
            lines.lengths.push(line.len() as u32);
            for &(_, node) in line {
                lines.places[node as usize] = lines.nodes.len() as u32;
                lines.nodes.push(node);
            }
        }
        lines
    }

    /// The neighbours before and behind each node.
    fn neighbours(&self) -> [Vec<u32>; 2] {
        let mut neighbours = [vec![NONE; self.places.len()], vec![NONE; self.places.len()]];
        let mut nodes = &self.nodes[..];
        for line in self.lengths.iter().filter_map(|&length| nodes.split_off(..length as usize)) {
            for pair in line.windows(2) {
                neighbours[0][pair[1] as usize] = pair[0];
                neighbours[1][pair[0] as usize] = pair[1];
            }
        }
        neighbours
    }

    /// Calls `fill` and then inverts `times` times, for parts of whole lines.
    fn invert<const D: usize>(&self, times: usize, x: &mut [Vector<f64, D>], fill: &Fill<'_, D>) {
        let (mut left, mut nodes, mut lengths) = (x, &self.nodes[..], &self.lengths[..]);
        let parts = std::iter::from_fn(|| {
            let mut count = 0;
            let enough = |&length: &u32| {
                let before = count;
                count += length as usize;
                before >= PART
            };
            let own = lengths.split_off(..lengths.iter().position(enough).unwrap_or(lengths.len()))?;
            let count = own.iter().map(|&length| length as usize).sum();
            (count > 0).then(|| Some((own, nodes.split_off(..count)?, left.split_off_mut(..count)?)))?
        });
        parallel::for_each(parts, &|(lengths, nodes, mut x): (&[u32], &[u32], &mut [Vector<f64, D>])| {
            fill(nodes, x);
            let mut scratch = Scratch::default();
            for &length in lengths {
                if let Some(line) = x.split_off_mut(..length as usize) {
                    let line = bytemuck::cast_slice_mut(line);
                    (0..times).for_each(|_| widest(Invert::<D> { x: line, scratch: &mut scratch }));
                }
            }
        });
    }
}

/// θ, σ and δ of the Chebyshev iteration.
fn coefficients() -> [f64; 3] {
    let [lower, upper] = SPECTRUM;
    let (theta, delta) = (0.5 * (upper + lower), 0.5 * (upper - lower));
    [theta, theta / delta, delta]
}

/// Working memory of one thread: the residual along a line, and the direction with a zero node before and behind the line.
#[derive(Default)]
struct Scratch {
    r: Vec<f64>,
    p: Vec<f64>,
}

/// x ← q(B) x with B = [1 4 1]/6 along a line of nodes with D components, and the polynomial q ≈ 1/B.
struct Invert<'a, const D: usize> {
    x: &'a mut [f64],
    scratch: &'a mut Scratch,
}

impl<const D: usize> WithLanes for Invert<'_, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, _: S) {
        let Self { x, scratch: Scratch { r, p } } = self;
        let [theta, sigma, delta] = coefficients();
        let (mut rho, count) = (1.0 / sigma, x.len());
        r.clear();
        r.extend_from_slice(x);
        x.iter_mut().for_each(|x| *x /= theta);
        p.clear();
        p.resize(count + 2 * D, 0.0);
        p[D..D + count].copy_from_slice(x);
        for _ in 1..STEPS {
            // r −= B p
            let neighbours = p[..count].iter().zip(&p[2 * D..]);
            for ((r, p), (before, behind)) in r.iter_mut().zip(&p[D..]).zip(neighbours) {
                // The sum of the neighbours begins with zero, as on a device, so that both have the same bits.
                *r -= (p * 4.0 + (0.0 + before + behind)) / 6.0;
            }
            let next = 1.0 / (2.0 * sigma - rho);
            for ((x, p), r) in x.iter_mut().zip(&mut p[D..]).zip(&*r) {
                *p = *p * (next * rho) + r * (2.0 * next / delta);
                *x += *p;
            }
            rho = next;
        }
    }
}

impl Filter {
    /// The filter for the nodes of a form, with the inverse diagonal blocks of the tangent.
    pub(crate) fn new<const D: usize>(form: &LocalForm, inverses: &[Tensor<f64, D>]) -> Self {
        let fixed = form.fixed();
        let is_unknown = |node: usize| (0..D).any(|i| !fixed[node * D + i]);
        let unknowns: Vec<_> =
            form.nodes.iter().enumerate().map(|(node, &at)| is_unknown(node).then_some(at)).collect();
        let diagonal = |k: usize| if fixed[k] { 0.0 } else { inverses[k / D][(k % D, k % D)] };
        let largest = (0..fixed.len()).map(diagonal).fold(0.0, f64::max);
        // A power of two, so that units by powers of two do not change the bits of the roots.
        let unit = if largest > 0.0 { largest.log2().floor().exp2() } else { 1.0 };
        let root = |k: usize| (diagonal(k) / unit).sqrt();
        let usable = |scale: f64| if scale.is_finite() { scale } else { 0.0 };
        Self {
            lines: std::array::from_fn(|axis| if axis < D { Lines::along(axis, &unknowns) } else { Lines::default() }),
            scale: (0..fixed.len()).map(|k| usable(root(k))).collect(),
            unit,
            pool: Pool::default(),
        }
    }

    /// A copy on a device.
    pub(crate) fn on_device(&self, gpu: &Gpu, dimension: usize) -> gpu::Filter {
        let neighbours: Vec<_> = self.lines[..dimension].iter().map(Lines::neighbours).collect();
        let [theta, sigma, delta] = coefficients();
        let mut rho = 1.0 / sigma;
        let step = |_| {
            let next = 1.0 / (2.0 * sigma - rho);
            let step = [next * rho, 2.0 * next / delta];
            rho = next;
            step
        };
        let steps = (1..STEPS).map(step).collect();
        gpu::Filter::new(gpu, &neighbours, &self.scale, self.unit, (theta, steps))
    }

    /// z += D^{−½} Q Qᵀ D^{−½} r
    ///
    /// Values are taken to the lines along each axis in turn: the last one first for Qᵀ, and back for Q.
    pub(crate) fn add<const D: usize>(&self, r: &[f64], z: &mut [f64]) {
        mutant!("multigrid: cubic splines have no filter": { return; });
        let (r, scale): (&[Vector<f64, D>], &[Vector<f64, D>]) =
            (bytemuck::cast_slice(r), bytemuck::cast_slice(&self.scale));
        let unknowns = self.lines[0].nodes.len();
        let [mut x, mut before] = [(); 2].map(|()| self.pool.unspecified::<Vector<f64, D>>(unknowns));
        self.lines[D - 1].invert(if D == 1 { 2 } else { 1 }, &mut x, &|nodes, x| {
            for (x, &node) in x.iter_mut().zip(nodes) {
                *x = r[node as usize].component_mul(&scale[node as usize]);
            }
        });
        let mut last = D - 1;
        for axis in (0..D - 1).rev().chain(1..D) {
            std::mem::swap(&mut x, &mut before);
            let places = &self.lines[last].places;
            // Q and Qᵀ follow each other along the first axis.
            self.lines[axis].invert(if axis == 0 { 2 } else { 1 }, &mut x, &|nodes, x| {
                x.iter_mut().zip(nodes).for_each(|(x, &node)| *x = before[places[node as usize] as usize]);
            });
            last = axis;
        }
        let places = &self.lines[last].places;
        let z: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(z);
        parallel::each(z, |node, z| {
            if places[node] != NONE {
                *z += x[places[node] as usize].component_mul(&scale[node]) * self.unit;
            }
        });
    }
}
