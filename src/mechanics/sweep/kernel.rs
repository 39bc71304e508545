//! Gather and scatter of one group of particles, sum-factorised.
//!
//! A group is up to `L` particles, one for each lane, that share one window of nodes, so that the nodes of a window are read
//! and written once for all of them. `L` is 8 in double and 16 in single precision.
//!
//! gather, a lane a particle:  u = Σ u_I N_I,  L = Σ u_I ⊗ ∇N_I, contracted along x, then y, then z;
//! scatter, a lane a row (y, z) of the window: f_I += σ ∇N_I + q N_I, summed over the particles in registers.

use super::lanes::{LANES, Lanes};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use num_traits::{One, Zero};

/// The widest window along x of a group of neighbouring cells.
pub(super) const fn widest_window(lanes: usize) -> usize {
    if lanes == LANES { 6 } else { 8 }
}

/// The widest tile along x that a kernel keeps in registers; in single precision the entries of a row in 3D fill a vector.
const fn widest_tile(lanes: usize) -> usize {
    if lanes == LANES { 6 } else { 5 }
}

/// A group's window of nodes and its weights.
pub(super) struct Window<'a, X, const L: usize> {
    /// Nodes along each axis; 1 along axes that do not exist.
    pub width: [usize; 3],
    /// Axis after axis: N of each node, then dN/dx of each node, a lane a particle.
    pub weights: &'a [[X; L]],
    /// Particles: lanes from here on are empty, with weights zero.
    pub lanes: usize,
    /// Number of the first node in the box of the block.
    pub first: usize,
    /// Nodes from one row of the box to the next, and from one plane to the next.
    pub stride: [usize; 2],
}

impl<X, const L: usize> Window<'_, X, L> {
    /// N of axis `k`, and behind it dN/dx.
    #[inline(always)]
    pub(super) fn axis(&self, k: usize) -> (&[[X; L]], &[[X; L]]) {
        let start: usize = 2 * self.width[..k].iter().sum::<usize>();
        self.weights[start..start + 2 * self.width[k]].split_at(self.width[k])
    }
}

/// The width of the next tile where `left` nodes are left along x: 1 only for a window of one node.
#[inline(always)]
pub(super) fn tile<const L: usize>(left: usize) -> usize {
    let widest = widest_tile(L);
    if left <= widest { left } else { left.div_ceil(2).min(widest - 1) }
}

/// Calls a function of the width of a tile: compiled for every width, or once for all where the lanes are rare.
macro_rules! by_tile {
    ($tile:expr, $function:ident::<$lanes:ident, $($generic:tt),*>($($argument:expr),*)) => {
        match $tile {
            tile if $lanes::RARE => $function::<$lanes, $($generic,)* 6>($($argument,)* tile),
            1 => $function::<$lanes, $($generic,)* 1>($($argument,)* 1),
            2 => $function::<$lanes, $($generic,)* 2>($($argument,)* 2),
            3 => $function::<$lanes, $($generic,)* 3>($($argument,)* 3),
            4 => $function::<$lanes, $($generic,)* 4>($($argument,)* 4),
            5 => $function::<$lanes, $($generic,)* 5>($($argument,)* 5),
            _ => $function::<$lanes, $($generic,)* 6>($($argument,)* 6),
        }
    };
}

pub(super) use by_tile;

/// u and L of a group: `value[c]`, `gradient[c][k]`.
#[derive(Clone, Copy)]
pub(super) struct Gathered<N, const D: usize> {
    pub value: [N; D],
    pub gradient: [[N; D]; D],
}

/// u and L of a group in memory: the components of u, then those of L by rows, a lane a particle; the rest is not used.
pub(super) type Rows<X = f64, const L: usize = LANES> = [[X; L]; 12];

/// Writes u and L.
#[inline(always)]
pub(super) fn store<S: Lanes<L>, const D: usize, const L: usize>(
    s: S,
    from: &Gathered<S::N, D>,
    rows: &mut Rows<S::X, L>,
) {
    for c in 0..D {
        s.store(from.value[c], &mut rows[c]);
        for k in 0..D {
            s.store(from.gradient[c][k], &mut rows[D + c * D + k]);
        }
    }
}

/// Reads u and L.
#[inline(always)]
pub(super) fn load<S: Lanes<L>, const D: usize, const L: usize>(s: S, rows: &Rows<S::X, L>) -> Gathered<S::N, D> {
    let mut loaded = Gathered { value: [s.zero(); D], gradient: [[s.zero(); D]; D] };
    for c in 0..D {
        loaded.value[c] = s.load(&rows[c]);
        for k in 0..D {
            loaded.gradient[c][k] = s.load(&rows[D + c * D + k]);
        }
    }
    loaded
}

/// u and L of one particle.
#[inline(always)]
pub(super) fn of_lane<T: Real, const D: usize>(rows: &Rows, lane: usize) -> (Vector<T, D>, Tensor<T, D>) {
    let value = Vector::from_fn(|i, _| T::lit(rows[i][lane]));
    (value, Tensor::from_fn(|i, k| T::lit(rows[D + i * D + k][lane])))
}

/// Sets q and σ of one particle.
#[inline(always)]
pub(super) fn set_lane<T: Real, const D: usize>(
    rows: &mut Rows,
    lane: usize,
    value: &Vector<T, D>,
    gradient: &Tensor<T, D>,
) {
    for i in 0..D {
        rows[i][lane] = value[i].value();
        for k in 0..D {
            rows[D + i * D + k][lane] = gradient[(i, k)].value();
        }
    }
}

/// u = Σ u_I N_I (if `VALUE`) and L = Σ u_I ⊗ ∇N_I of a group; `nodal` holds the box, component after component of each node.
#[inline(always)]
pub(super) fn gather<S: Lanes<L>, const D: usize, const L: usize, const VALUE: bool>(
    s: S,
    window: &Window<'_, S::X, L>,
    nodal: &[S::X],
) -> Gathered<S::N, D> {
    let zero = s.zero();
    let mut out = Gathered { value: [zero; D], gradient: [[zero; D]; D] };
    let mut start = 0;
    while start < window.width[0] {
        let tile = tile::<L>(window.width[0] - start);
        by_tile!(tile, gather_tile::<S, D, L, VALUE>(s, window, start, nodal, &mut out));
        start += tile;
    }
    out
}

/// What is known of a row of nodes, a plane of them, or all, contracted with N_x, N_y, N_z: Σ u N, and with one derivative.
type Sums<N, const D: usize, const K: usize> = [[N; D]; K];

/// (Σ_x u N_x, Σ_x u N_x') of the row that begins at the node `first`.
// Functions, not closures: a closure that is not inlined loses the wide instructions.
#[inline(always)]
fn row<S: Lanes<L>, const D: usize, const L: usize, const W: usize>(
    s: S,
    weights: &[[S::N; W]; 2],
    nodal: &[S::X],
    first: usize,
    width: usize,
) -> Sums<S::N, D, 2> {
    let row = &nodal[first * D..(first + width) * D];
    let mut sums = [[s.zero(); D]; 2];
    for x in 0..width.min(W) {
        for c in 0..D {
            let u = s.splat(row[x * D + c]);
            sums[0][c] = s.mul_add(u, weights[0][x], sums[0][c]);
            sums[1][c] = s.mul_add(u, weights[1][x], sums[1][c]);
        }
    }
    sums
}

/// (Σ u N_x N_y, Σ u N_x' N_y, Σ u N_x N_y') of the plane that begins at the node `first`.
#[inline(always)]
fn plane<S: Lanes<L>, const D: usize, const L: usize, const W: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    weights: &[[S::N; W]; 2],
    nodal: &[S::X],
    first: usize,
    width: usize,
) -> Sums<S::N, D, 3> {
    let (ny, dy) = window.axis(1);
    let mut sums = [[s.zero(); D]; 3];
    for y in 0..ny.len() {
        let [value, slope] = row::<S, D, L, W>(s, weights, nodal, first + y * window.stride[0], width);
        let (ny, dy) = (s.load(&ny[y]), s.load(&dy[y]));
        for c in 0..D {
            sums[0][c] = s.mul_add(value[c], ny, sums[0][c]);
            sums[1][c] = s.mul_add(slope[c], ny, sums[1][c]);
            sums[2][c] = s.mul_add(value[c], dy, sums[2][c]);
        }
    }
    sums
}

#[inline(always)]
fn gather_tile<S: Lanes<L>, const D: usize, const L: usize, const VALUE: bool, const W: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    start: usize,
    nodal: &[S::X],
    out: &mut Gathered<S::N, D>,
    width: usize,
) {
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut weights = [[s.zero(); W]; 2];
    for x in 0..width.min(W) {
        (weights[0][x], weights[1][x]) = (s.load(&n[x]), s.load(&dn[x]));
    }
    let origin = window.first + start;
    if D == 1 {
        let [value, slope] = row::<S, D, L, W>(s, &weights, nodal, origin, width);
        out.value[0] = s.add(out.value[0], value[0]);
        out.gradient[0][0] = s.add(out.gradient[0][0], slope[0]);
    } else if D == 2 {
        let [value, x, y] = plane::<S, D, L, W>(s, window, &weights, nodal, origin, width);
        for c in 0..D {
            out.value[c] = s.add(out.value[c], value[c]);
            out.gradient[c][0] = s.add(out.gradient[c][0], x[c]);
            out.gradient[c][1] = s.add(out.gradient[c][1], y[c]);
        }
    } else {
        let (nz, dz) = window.axis(2);
        for z in 0..nz.len() {
            let [value, x, y] = plane::<S, D, L, W>(s, window, &weights, nodal, origin + z * window.stride[1], width);
            let (nz, dz) = (s.load(&nz[z]), s.load(&dz[z]));
            for c in 0..D {
                if VALUE {
                    out.value[c] = s.mul_add(value[c], nz, out.value[c]);
                }
                out.gradient[c][0] = s.mul_add(x[c], nz, out.gradient[c][0]);
                out.gradient[c][1] = s.mul_add(y[c], nz, out.gradient[c][1]);
                out.gradient[c][2] = s.mul_add(value[c], dz, out.gradient[c][2]);
            }
        }
    }
}

/// Which terms a scatter has.
pub(super) trait Terms {
    /// q N_I
    const VALUE: bool;
    /// σ ∇N_I
    const GRADIENT: bool;
}

/// q N_I + σ ∇N_I
pub(super) struct Both;

impl Terms for Both {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
}

/// q N_I
pub(super) struct OnlyValue;

impl Terms for OnlyValue {
    const VALUE: bool = true;
    const GRADIENT: bool = false;
}

/// σ ∇N_I
pub(super) struct OnlyGradient;

impl Terms for OnlyGradient {
    const VALUE: bool = false;
    const GRADIENT: bool = true;
}

/// f_I += σ ∇N_I + q N_I, with σ in the place of L and q in that of u, a lane a particle; `out` is the box as in [`gather`],
/// a vector longer than its nodes.
#[inline(always)]
pub(super) fn scatter<S: Lanes<L>, M: Terms, const D: usize, const L: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    from: &Gathered<S::N, D>,
    out: &mut [S::X],
) {
    let mut rows = [[S::X::zero(); L]; 12];
    store(s, from, &mut rows);
    let from = rows;
    let rows = window.width[1] * window.width[2];
    for chunk in 0..rows.div_ceil(L) {
        let pairs = Pairs::<S, D, L>::new(s, window, chunk * L);
        let mut start = 0;
        while start < window.width[0] {
            let tile = tile::<L>(window.width[0] - start);
            by_tile!(tile, scatter_tile::<S, M, D, L>(s, window, start, &pairs, &from, out));
            start += tile;
        }
    }
}

/// Of `L` rows (y, z) of a window: N_y N_z, N_y' N_z, N_y N_z', a lane a row, for each particle; and where the rows begin.
pub(super) struct Pairs<S: Lanes<L>, const D: usize, const L: usize> {
    pub(super) products: [[S::N; L]; D],
    places: [usize; L],
    count: usize,
}

impl<S: Lanes<L>, const D: usize, const L: usize> Pairs<S, D, L> {
    #[inline(always)]
    pub(super) fn new(s: S, window: &Window<'_, S::X, L>, start: usize) -> Self {
        let [_, wy, wz] = window.width;
        let count = (wy * wz - start).min(L);
        let mut products = [[s.zero(); L]; D];
        let mut places = [0; L];
        let (mut y, mut z) = (start % wy, start / wy);
        for lane in 0..count {
            places[lane] = window.first + y * window.stride[0] + z * window.stride[1];
            if D == 1 {
                products[0][lane] = s.splat(S::X::one());
            } else {
                let (n, dn) = window.axis(1);
                let (ny, dy) = (s.load(&n[y]), s.load(&dn[y]));
                if D == 2 {
                    (products[0][lane], products[D - 1][lane]) = (ny, dy);
                } else {
                    let (n, dn) = window.axis(2);
                    let (nz, dz) = (s.load(&n[z]), s.load(&dn[z]));
                    products[0][lane] = s.mul(ny, nz);
                    products[1 % D][lane] = s.mul(dy, nz);
                    products[2 % D][lane] = s.mul(ny, dz);
                }
            }
            y += 1;
            if y == wy {
                (y, z) = (0, z + 1);
            }
        }
        for rows in &mut products {
            *rows = s.transpose(*rows);
        }
        Self { products, places, count }
    }

    /// Adds `sums`, `at` the first entry of each row: from a lane a row to a row after the other. `sums` are the entries of a
    /// row in their order.
    #[inline(always)]
    pub(super) fn add(&self, s: S, sums: &[S::N], at: usize, numbers: usize, out: &mut [S::X]) {
        for (part, some) in sums.chunks(L).enumerate() {
            let mut rows = [s.zero(); L];
            rows[..some.len()].copy_from_slice(some);
            let rows = s.transpose(rows);
            for lane in 0..self.count {
                let place = (self.places[lane] + at) * numbers + part * L;
                if let Some(slot) = out[place..].first_chunk_mut::<L>() {
                    let sum = s.add(s.load(slot), rows[lane]);
                    s.store(sum, slot);
                }
            }
        }
    }
}

#[inline(always)]
fn scatter_tile<S: Lanes<L>, M: Terms, const D: usize, const L: usize, const W: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    start: usize,
    pairs: &Pairs<S, D, L>,
    from: &Rows<S::X, L>,
    out: &mut [S::X],
    width: usize,
) {
    let zero = s.zero();
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut sums = [[zero; D]; W];
    let sums = &mut sums[..width.min(W)];
    for p in 0..window.lanes.min(L) {
        let (mut across, mut along) = ([zero; D], [zero; D]);
        for c in 0..D {
            // a = σ_y N_y' N_z + σ_z N_y N_z' + q N_y N_z,  b = σ_x N_y N_z
            if M::GRADIENT {
                for k in 1..D {
                    across[c] = s.mul_add(s.splat(from[D + c * D + k][p]), pairs.products[k][p], across[c]);
                }
                along[c] = s.mul(s.splat(from[D + c * D][p]), pairs.products[0][p]);
            }
            if M::VALUE {
                across[c] = s.mul_add(s.splat(from[c][p]), pairs.products[0][p], across[c]);
            }
        }
        for x in 0..sums.len() {
            let (nx, dx) = (s.splat(n[x][p]), s.splat(dn[x][p]));
            for c in 0..D {
                sums[x][c] = s.mul_add(across[c], nx, sums[x][c]);
                if M::GRADIENT {
                    sums[x][c] = s.mul_add(along[c], dx, sums[x][c]);
                }
            }
        }
    }
    pairs.add(s, sums.as_flattened(), start, D, out);
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Number, Portable, PortableSingle, SINGLE_LANES, WithLanes};
    use super::*;

    const WIDTH: [usize; 3] = [7, 3, 5];
    const BOX: [usize; 3] = [9, 4, 6];
    const PARTICLES: usize = 5;
    const FIRST: usize = 1 + BOX[0];

    fn irregular(i: usize) -> f64 {
        ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    /// Gathers and scatters what was gathered.
    #[derive(Clone, Copy)]
    struct ThereAndBack<'a, X, const L: usize>(&'a [[X; L]], &'a [X]);

    impl<X: Real, const L: usize> WithLanes<X, L> for ThereAndBack<'_, X, L> {
        type Output = (Vec<X>, Vec<X>);

        #[inline(always)]
        fn run<S: Lanes<L, X = X>>(self, s: S) -> Self::Output {
            let stride = [BOX[0], BOX[0] * BOX[1]];
            let window = Window { width: WIDTH, weights: self.0, lanes: PARTICLES, first: FIRST, stride };
            let at = gather::<S, 3, L, true>(s, &window, self.1);
            let mut out = vec![X::zero(); self.1.len() + L];
            scatter::<S, Both, 3, L>(s, &window, &at, &mut out);
            let mut rows = [[X::zero(); L]; 12];
            store(s, &at, &mut rows);
            let gathered = rows[3..].iter().chain(&rows[..3]).flatten().copied().collect();
            (gathered, out)
        }
    }

    /// Weights, nodal values, and the results of these sums written down: place, N and ∇N of every node of the window.
    #[allow(clippy::type_complexity)]
    fn problem<X: Real, const L: usize>() -> (Vec<[X; L]>, Vec<X>, Vec<f64>, Vec<f64>) {
        let rows = 2 * WIDTH.iter().sum::<usize>();
        let weight = |row: usize, lane: usize| if lane < PARTICLES { irregular(row * 8 + lane) } else { 0.0 };
        let weights = (0..rows).map(|row| std::array::from_fn(|lane| X::lit(weight(row, lane)))).collect();
        let nodal: Vec<f64> = (0..3 * BOX.iter().product::<usize>()).map(irregular).collect();
        let of = |k: usize, at: usize, lane: usize| {
            let start = 2 * WIDTH[..k].iter().sum::<usize>() + at;
            [weight(start, lane), weight(start + WIDTH[k], lane)]
        };
        let mut expected = vec![0.0; nodal.len()];
        let mut gathered = vec![[0.0; L]; 12];
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
        (weights, nodal.iter().map(|&x| X::lit(x)).collect(), gathered.into_iter().flatten().collect(), expected)
    }

    fn judge<X: Real>(found: Vec<(Vec<X>, Vec<X>)>, gathered: &[f64], scattered: &[f64], tolerance: f64) {
        let close = |a: &[X], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a.value() - b).abs() < tolerance);
        for (at, out) in found {
            assert!(close(&at, gathered) && close(&out, scattered));
        }
    }

    #[test]
    fn all_instruction_sets_give_the_plain_sums() {
        let (weights, nodal, gathered, scattered) = problem::<f64, LANES>();
        let work = ThereAndBack(&weights, &nodal);
        judge(vec![work.run(Portable), f64::widest(work)], &gathered, &scattered, 1e-13);
        #[cfg(target_arch = "x86_64")]
        if let Some(s) = pulp::x86::V3::try_new() {
            judge(vec![work.run(s)], &gathered, &scattered, 1e-13);
        }
    }

    #[test]
    fn so_they_do_in_single_precision() {
        let (weights, nodal, gathered, scattered) = problem::<f32, SINGLE_LANES>();
        let work = ThereAndBack(&weights, &nodal);
        judge(vec![work.run(PortableSingle), f32::widest(work)], &gathered, &scattered, 1e-4);
    }
}
