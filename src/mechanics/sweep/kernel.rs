//! Sum-factorised gather and scatter of one group of particles, for C components a node.
//!
//! A group is up to eight particles that share one window of nodes. Its nodes are read and written once for all these particles.
//!
//! - Gather, one particle a lane: u = Σ u_I N_I,  L = Σ u_I ⊗ ∇N_I, contracted along x, then y, then z.
//! - Scatter, one row (y, z) of the window a lane: f_I += σ ∇N_I + q N_I, summed over the particles in registers.

use super::Mode;
use super::group::Window;
use crate::lanes::{In, LANES, Lane, Lanes, WithLanes, in_dimension};

/// The widest tile of nodes along x that a kernel sums at a time. A group of neighbouring cells has no wider window along x.
pub(super) const WIDEST_TILE: usize = 6;

/// The width of the next tile if `left` nodes remain along x. It is 1 only for a window of one node.
#[inline(always)]
pub(super) fn tile(left: usize) -> usize {
    if left <= WIDEST_TILE { left } else { left.div_ceil(2).min(WIDEST_TILE - 1) }
}

/// Calls a function for every tile of a window. `start` is the first node of the tile, and the last argument its width. The function is
/// compiled for every width, but once for all widths where the lanes are [rare](Lanes::RARE).
macro_rules! each_tile {
    ($window:ident, $start:ident => $function:ident::<$lanes:ident, $($generic:tt),*>($($argument:expr),*)) => {
        let mut $start = 0;
        while $start < $window.width[0] {
            let tile = tile($window.width[0] - $start);
            match tile {
                tile if $lanes::RARE => $function::<$lanes, $($generic,)* 6>($($argument,)* tile),
                1 => $function::<$lanes, $($generic,)* 1>($($argument,)* 1),
                2 => $function::<$lanes, $($generic,)* 2>($($argument,)* 2),
                3 => $function::<$lanes, $($generic,)* 3>($($argument,)* 3),
                4 => $function::<$lanes, $($generic,)* 4>($($argument,)* 4),
                5 => $function::<$lanes, $($generic,)* 5>($($argument,)* 5),
                _ => $function::<$lanes, $($generic,)* 6>($($argument,)* 6),
            }
            $start += tile;
        }
    };
}

pub(super) use each_tile;

/// Fills `value` and `gradient`, C and C·D rows, from the box `nodal`, which holds the C components of node after node.
pub struct Gather<'a> {
    pub window: Window<'a>,
    pub nodal: &'a [f64],
    pub mode: Mode,
    pub value: &'a mut [[f64; LANES]],
    pub gradient: &'a mut [[f64; LANES]],
}

impl<const C: usize, const D: usize> WithLanes for In<Gather<'_>, C, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let Gather { window, nodal, mode, value, gradient } = self.0;
        let mut out = Gathered { value: [s.splat(0.0); C], gradient: [[s.splat(0.0); D]; C] };
        each_tile!(window, start => gather_tile::<S, C, D>(s, &window, start, nodal, mode.value, &mut out));
        // Loops, not closures: a closure that is not inlined loses the wide instructions.
        if mode.value {
            for (c, row) in value.iter_mut().enumerate().take(C) {
                s.store(out.value[c], row);
            }
        }
        if mode.gradient {
            let slopes = out.gradient.as_flattened();
            for (k, row) in gradient.iter_mut().enumerate().take(C * D) {
                s.store(slopes[k], row);
            }
        }
    }
}

/// u and L of a group, in registers.
struct Gathered<N, const C: usize, const D: usize> {
    value: [N; C],
    gradient: [[N; D]; C],
}

/// The contraction of a row or plane of nodes with N: Σ u N, then the sums with one N replaced by its derivative.
type Sums<N, const C: usize, const K: usize> = [[N; C]; K];

/// (Σ_x u N_x, Σ_x u N_x') of the row that begins at the node `first`.
// Functions, not closures: a closure that is not inlined loses the wide instructions.
#[inline(always)]
fn row<S: Lanes, const C: usize, const W: usize>(
    s: S,
    weights: &[[S::N; W]; 2],
    nodal: &[f64],
    first: usize,
    width: usize,
) -> Sums<S::N, C, 2> {
    let row = &nodal[first * C..(first + width) * C];
    let mut sums = [[s.splat(0.0); C]; 2];
    for x in 0..width.min(W) {
        for c in 0..C {
            let u = s.splat(row[x * C + c]);
            mutant!("sweep: component 0 gathered for all": u = s.splat(row[x * C]));
            sums[0][c] = sums[0][c].add_product(u, weights[0][x]);
            sums[1][c] = sums[1][c].add_product(u, weights[1][x]);
        }
    }
    sums
}

/// (Σ u N_x N_y, Σ u N_x' N_y, Σ u N_x N_y') of the plane that begins at the node `first`.
#[inline(always)]
fn plane<S: Lanes, const C: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    weights: &[[S::N; W]; 2],
    nodal: &[f64],
    first: usize,
    width: usize,
) -> Sums<S::N, C, 3> {
    let (ny, dy) = window.axis(1);
    let mut sums = [[s.splat(0.0); C]; 3];
    for y in 0..ny.len() {
        let [value, slope] = row::<S, C, W>(s, weights, nodal, first + y * window.stride[0], width);
        let (ny, dy) = (s.load(&ny[y]), s.load(&dy[y]));
        for c in 0..C {
            sums[0][c] = sums[0][c].add_product(value[c], ny);
            sums[1][c] = sums[1][c].add_product(slope[c], ny);
            sums[2][c] = sums[2][c].add_product(value[c], dy);
        }
    }
    sums
}

#[inline(always)]
fn gather_tile<S: Lanes, const C: usize, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    nodal: &[f64],
    with_value: bool,
    out: &mut Gathered<S::N, C, D>,
    width: usize,
) {
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut weights = [[s.splat(0.0); W]; 2];
    for x in 0..width.min(W) {
        (weights[0][x], weights[1][x]) = (s.load(&n[x]), s.load(&dn[x]));
    }
    let origin = window.first + start;
    if D == 1 {
        let [value, slope] = row::<S, C, W>(s, &weights, nodal, origin, width);
        for c in 0..C {
            out.value[c] = out.value[c] + value[c];
            out.gradient[c][0] = out.gradient[c][0] + slope[c];
        }
    } else if D == 2 {
        let [value, x, y] = plane::<S, C, W>(s, window, &weights, nodal, origin, width);
        for c in 0..C {
            out.value[c] = out.value[c] + value[c];
            out.gradient[c][0] = out.gradient[c][0] + x[c];
            out.gradient[c][1] = out.gradient[c][1] + y[c];
        }
    } else {
        let (nz, dz) = window.axis(2);
        for z in 0..nz.len() {
            let [value, x, y] = plane::<S, C, W>(s, window, &weights, nodal, origin + z * window.stride[1], width);
            let (nz, dz) = (s.load(&nz[z]), s.load(&dz[z]));
            if with_value {
                for c in 0..C {
                    out.value[c] = out.value[c].add_product(value[c], nz);
                }
            }
            for c in 0..C {
                out.gradient[c][0] = out.gradient[c][0].add_product(x[c], nz);
                out.gradient[c][1] = out.gradient[c][1].add_product(y[c], nz);
                out.gradient[c][2] = out.gradient[c][2].add_product(value[c], dz);
            }
        }
    }
}

/// f_I += σ ∇N_I + q N_I. `value` is q in C rows, and `gradient` is σ in C·D rows, a lane a particle. `out` is a box with the layout of
/// [`Gather::nodal`], one vector of lanes longer than its nodes need.
pub struct Scatter<'a> {
    pub window: Window<'a>,
    pub mode: Mode,
    pub value: &'a [[f64; LANES]],
    pub gradient: &'a [[f64; LANES]],
    pub out: &'a mut [f64],
}

impl<const C: usize, const D: usize> WithLanes for In<Scatter<'_>, C, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let Scatter { window, mode, value, gradient, out } = self.0;
        // Fixed lengths, so that no index is checked.
        let (Some(value), Some(gradient)) = (value.first_chunk(), gradient.as_chunks().0.first_chunk()) else { return };
        for row in (0..window.width[1] * window.width[2]).step_by(S::ROWS) {
            let pairs = Pairs::<S, D>::new(s, &window, row);
            each_tile!(window, start => scatter_tile::<S, C, D>(s, &window, start, &pairs, mode, value, gradient, out));
        }
    }
}

/// The products N_y N_z, N_y' N_z, N_y N_z' of each particle, a lane a row (y, z) of the window. The rows are as many as fill a register.
/// `places` is where the rows begin in the box.
pub(super) struct Pairs<S: Lanes, const D: usize> {
    pub(super) products: [[S::Rows; LANES]; D],
    places: [usize; LANES],
    count: usize,
}

impl<S: Lanes, const D: usize> Pairs<S, D> {
    #[inline(always)]
    pub(super) fn new(s: S, window: &Window<'_>, start: usize) -> Self {
        let [_, wy, wz] = window.width;
        let count = (wy * wz - start).min(S::ROWS);
        let mut products = [[s.splat(0.0); LANES]; D];
        let mut places = [0; LANES];
        let (mut y, mut z) = (start % wy, start / wy);
        for lane in 0..count {
            places[lane] = window.first + y * window.stride[0] + z * window.stride[1];
            mutant!("sweep: a plane of the scatter one node early": { places[lane] -= z; });
            let at = [0, y, z];
            let mut product = [s.splat(1.0); D];
            for axis in 1..D {
                let (n, dn) = window.axis(axis);
                let (n, dn) = (s.load(&n[at[axis]]), s.load(&dn[at[axis]]));
                for k in 0..D {
                    product[k] = product[k] * if k == axis { dn } else { n };
                }
            }
            for k in 0..D {
                products[k][lane] = product[k];
            }
            y += 1;
            if y == wy {
                (y, z) = (0, z + 1);
            }
        }
        let mut columns = [[s.splat_rows(0.0); LANES]; D];
        for k in 0..D {
            columns[k] = s.columns(&products[k]);
        }
        Self { products: columns, places, count }
    }

    /// Adds `sums` to the rows of the box, from the node `at` of each row on. `sums` are the entries of a row in order, `numbers` for each
    /// node, and hold a row in each lane.
    #[inline(always)]
    pub(super) fn add(&self, s: S, sums: &[S::Rows], at: usize, numbers: usize, out: &mut [f64]) {
        let mut places = self.places;
        for place in &mut places {
            *place = (*place + at) * numbers;
        }
        s.add_up(sums, &places[..self.count], out);
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments)] // what a window, its rows and its particles are
fn scatter_tile<S: Lanes, const C: usize, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    pairs: &Pairs<S, D>,
    mode: Mode,
    value: &[[f64; LANES]; C],
    gradient: &[[[f64; LANES]; D]; C],
    out: &mut [f64],
    width: usize,
) {
    let zero = s.splat_rows(0.0);
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut sums = [[zero; C]; W];
    let sums = &mut sums[..width.min(W)];
    for p in 0..window.lanes.min(LANES) {
        mutant!("sweep: the last lane of a full group is not scattered": { if p + 1 == LANES { continue; } });
        // across = σ_y N_y' N_z + σ_z N_y N_z' + q N_y N_z,  along = σ_x N_y N_z. The mode is tested outside the inner loops.
        let (mut across, mut along) = ([zero; C], [zero; C]);
        if mode.gradient {
            for c in 0..C {
                for k in 1..D {
                    across[c] = across[c].add_product(s.splat_rows(gradient[c][k][p]), pairs.products[k][p]);
                }
                along[c] = s.splat_rows(gradient[c][0][p]) * pairs.products[0][p];
            }
        }
        if mode.value {
            for c in 0..C {
                across[c] = across[c].add_product(s.splat_rows(value[c][p]), pairs.products[0][p]);
            }
        }
        if !mode.gradient {
            for x in 0..sums.len() {
                let nx = s.splat_rows(n[x][p]);
                for c in 0..C {
                    sums[x][c] = sums[x][c].add_product(across[c], nx);
                }
            }
            continue;
        }
        for x in 0..sums.len() {
            let (nx, dx) = (s.splat_rows(n[x][p]), s.splat_rows(dn[x][p]));
            mutant!("sweep: stresses along x scattered by N for its slope": dx = nx);
            for c in 0..C {
                sums[x][c] = sums[x][c].add_product(across[c], nx);
                sums[x][c] = sums[x][c].add_product(along[c], dx);
            }
        }
    }
    pairs.add(s, sums.as_flattened(), start, C, out);
}

/// Gathers values and gradients from a box with `components` numbers a node: 1, or as many as there are axes.
pub(super) fn gather(components: usize, work: Gather<'_>) {
    in_dimension!(work.window.dimension, components, work);
}

/// Scatters values and gradients into a box.
pub(super) fn scatter(components: usize, work: Scatter<'_>) {
    in_dimension!(work.window.dimension, components, work);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{PORTABLE, Registers, widest};
    use crate::mechanics::sweep::At;

    const WIDTH: [usize; 3] = [7, 3, 5];
    const BOX: [usize; 3] = [9, 4, 6];
    const PARTICLES: usize = 5;
    const FIRST: usize = 1 + BOX[0];

    fn irregular(i: usize) -> f64 {
        ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    /// Gathers a field, and scatters the gathered values and gradients.
    struct ThereAndBack<'a>(&'a [[f64; LANES]], &'a [f64], &'a mut Vec<(Vec<f64>, Vec<f64>)>);

    impl WithLanes for ThereAndBack<'_> {
        #[inline(always)]
        fn run<S: Lanes>(self, s: S) {
            let stride = [BOX[0], BOX[0] * BOX[1]];
            let window = Window { dimension: 3, width: WIDTH, weights: self.0, lanes: PARTICLES, first: FIRST, stride };
            let (mode, mut at) = (Mode::BOTH, At::<f64, 3, 3>::zero());
            let At { value, gradient } = &mut at;
            let gradient = gradient.as_flattened_mut();
            In::<_, 3, 3>(Gather { window, nodal: self.1, mode, value, gradient }).run(s);
            let mut out = vec![0.0; self.1.len() + LANES];
            let (value, gradient) = (at.value.as_slice(), at.gradient.as_flattened());
            In::<_, 3, 3>(Scatter { window, mode, value, gradient, out: &mut out }).run(s);
            self.2.push((gradient.iter().chain(value).flatten().copied().collect(), out));
        }
    }

    /// Weights, nodal values, and the expected results, from plain sums over place, N and ∇N of every node of the window.
    #[allow(clippy::type_complexity)]
    fn problem() -> (Vec<[f64; LANES]>, Vec<f64>, Vec<f64>, Vec<f64>) {
        let rows = 2 * WIDTH.iter().sum::<usize>();
        let weight = |row: usize, lane: usize| if lane < PARTICLES { irregular(row * 8 + lane) } else { 0.0 };
        let weights = (0..rows).map(|row| std::array::from_fn(|lane| weight(row, lane))).collect();
        let nodal: Vec<f64> = (0..3 * BOX.iter().product::<usize>()).map(irregular).collect();
        let of = |k: usize, at: usize, lane: usize| {
            let start = 2 * WIDTH[..k].iter().sum::<usize>() + at;
            [weight(start, lane), weight(start + WIDTH[k], lane)]
        };
        let mut expected = vec![0.0; nodal.len()];
        let mut gathered = vec![[0.0; LANES]; 12];
        for scattering in [false, true] {
            for lane in 0..PARTICLES {
                for (x, y, z) in
                    (0..WIDTH[0]).flat_map(|x| (0..WIDTH[1]).flat_map(move |y| (0..WIDTH[2]).map(move |z| (x, y, z))))
                {
                    let w = [of(0, x, lane), of(1, y, lane), of(2, z, lane)];
                    let place = FIRST + x + BOX[0] * (y + BOX[1] * z);
                    let factor = |k: usize| (0..3).map(|m| w[m][usize::from(m == k)]).product::<f64>();
                    for c in 0..3 {
                        for k in 0..4 {
                            let row = if k < 3 { 3 * c + k } else { 9 + c };
                            if scattering {
                                expected[3 * place + c] += gathered[row][lane] * factor(k);
                            } else {
                                gathered[row][lane] += nodal[3 * place + c] * factor(k);
                            }
                        }
                    }
                }
            }
        }
        (weights, nodal, gathered.into_iter().flatten().collect(), expected)
    }

    #[test]
    fn all_instruction_sets_give_the_plain_sums() {
        let (weights, nodal, gathered, scattered) = problem();
        let mut found = Vec::new();
        ThereAndBack(&weights, &nodal, &mut found).run(PORTABLE);
        widest(ThereAndBack(&weights, &nodal, &mut found));
        #[cfg(target_arch = "x86_64")]
        if let Some(s) = pulp::x86::V3::try_new() {
            ThereAndBack(&weights, &nodal, &mut found).run(Registers::<_, 2, 1>(s));
        }
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13);
        for (at, out) in found {
            assert!(close(&at, &gathered) && close(&out, &scattered));
        }
    }
}
