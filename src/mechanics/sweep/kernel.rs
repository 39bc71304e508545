//! Gather and scatter of one group of particles, sum-factorised.
//!
//! A group is up to eight particles that share one window of nodes, so that the nodes of a window are read and written
//! once for all of them.
//!
//! gather, a lane a particle:  u = Σ u_I N_I,  L = Σ u_I ⊗ ∇N_I, contracted along x, then y, then z;
//! scatter, a lane a row (y, z) of the window: f_I += σ ∇N_I + q N_I, summed over the particles in registers.

use super::lanes::{LANES, Lanes};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};

/// The widest tile along x that a kernel keeps in registers.
pub(super) const TILE: usize = 6;

/// A group's window of nodes and its weights.
pub(super) struct Window<'a> {
    /// Nodes along each axis; 1 along axes that do not exist.
    pub width: [usize; 3],
    /// Axis after axis: N of each node, then dN/dx of each node, a lane a particle.
    pub weights: &'a [[f64; LANES]],
    /// Particles: lanes from here on are empty, with weights zero.
    pub lanes: usize,
    /// Number of the first node in the box of the block.
    pub first: usize,
    /// Nodes from one row of the box to the next, and from one plane to the next.
    pub stride: [usize; 2],
}

impl Window<'_> {
    /// N of axis `k`, and behind it dN/dx.
    #[inline(always)]
    pub(super) fn axis(&self, k: usize) -> (&[[f64; LANES]], &[[f64; LANES]]) {
        let start: usize = 2 * self.width[..k].iter().sum::<usize>();
        self.weights[start..start + 2 * self.width[k]].split_at(self.width[k])
    }
}

/// The width of the next tile where `left` nodes are left along x: at most [`TILE`], and 1 only for a window of one node.
#[inline(always)]
fn tile(left: usize) -> usize {
    if left > TILE { TILE - 2 } else { left }
}

macro_rules! by_tile {
    ($tile:expr, $function:ident::<$($generic:tt),*>($($argument:expr),*)) => {
        match $tile {
            1 => $function::<$($generic,)* 1>($($argument),*),
            2 => $function::<$($generic,)* 2>($($argument),*),
            3 => $function::<$($generic,)* 3>($($argument),*),
            4 => $function::<$($generic,)* 4>($($argument),*),
            5 => $function::<$($generic,)* 5>($($argument),*),
            _ => $function::<$($generic,)* 6>($($argument),*),
        }
    };
}

/// u and L of a group: `value[c]`, `gradient[c][k]`.
#[derive(Clone, Copy)]
pub(super) struct Gathered<N, const D: usize> {
    pub value: [N; D],
    pub gradient: [[N; D]; D],
}

/// The same in memory, lane after lane.
pub(super) struct Stored<const D: usize> {
    pub value: [[f64; LANES]; D],
    pub gradient: [[[f64; LANES]; D]; D],
}

impl<const D: usize> Stored<D> {
    #[inline(always)]
    pub(super) fn of<S: Lanes>(s: S, from: &Gathered<S::N, D>) -> Self {
        let mut stored = Self { value: [[0.0; LANES]; D], gradient: [[[0.0; LANES]; D]; D] };
        for c in 0..D {
            s.store(from.value[c], &mut stored.value[c]);
            for k in 0..D {
                s.store(from.gradient[c][k], &mut stored.gradient[c][k]);
            }
        }
        stored
    }

    /// u and L of one particle.
    #[inline(always)]
    pub(super) fn of_lane<T: Real>(&self, lane: usize) -> (Vector<T, D>, Tensor<T, D>) {
        let value = Vector::from_fn(|i, _| T::lit(self.value[i][lane]));
        (value, Tensor::from_fn(|i, k| T::lit(self.gradient[i][k][lane])))
    }

    /// Sets q and σ of one particle.
    #[inline(always)]
    pub(super) fn set_lane<T: Real>(&mut self, lane: usize, value: &Vector<T, D>, gradient: &Tensor<T, D>) {
        for i in 0..D {
            self.value[i][lane] = value[i].value();
            for k in 0..D {
                self.gradient[i][k][lane] = gradient[(i, k)].value();
            }
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Lanes>(&self, s: S) -> Gathered<S::N, D> {
        let zero = s.zero();
        let mut loaded = Gathered { value: [zero; D], gradient: [[zero; D]; D] };
        for c in 0..D {
            loaded.value[c] = s.load(&self.value[c]);
            for k in 0..D {
                loaded.gradient[c][k] = s.load(&self.gradient[c][k]);
            }
        }
        loaded
    }
}

/// u = Σ u_I N_I (if `VALUE`) and L = Σ u_I ⊗ ∇N_I of a group; `nodal` holds the box, component after component of each node.
#[inline(always)]
pub(super) fn gather<S: Lanes, const D: usize, const VALUE: bool>(
    s: S,
    window: &Window<'_>,
    nodal: &[f64],
) -> Gathered<S::N, D> {
    let zero = s.zero();
    let mut out = Gathered { value: [zero; D], gradient: [[zero; D]; D] };
    let mut start = 0;
    while start < window.width[0] {
        let tile = tile(window.width[0] - start);
        by_tile!(tile, gather_tile::<S, D, VALUE>(s, window, start, nodal, &mut out));
        start += tile;
    }
    out
}

/// What is known of a row of nodes, a plane of them, or all, contracted with N_x, N_y, N_z: Σ u N, and with one derivative.
type Sums<N, const D: usize, const K: usize> = [[N; D]; K];

/// (Σ_x u N_x, Σ_x u N_x') of the row that begins at the node `first`.
// Functions, not closures: a closure that is not inlined loses the wide instructions.
#[inline(always)]
fn row<S: Lanes, const D: usize, const W: usize>(
    s: S,
    weights: &[[S::N; W]; 2],
    nodal: &[f64],
    first: usize,
) -> Sums<S::N, D, 2> {
    let row = &nodal[first * D..(first + W) * D];
    let mut sums = [[s.zero(); D]; 2];
    for x in 0..W {
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
fn plane<S: Lanes, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    weights: &[[S::N; W]; 2],
    nodal: &[f64],
    first: usize,
) -> Sums<S::N, D, 3> {
    let (ny, dy) = window.axis(1);
    let mut sums = [[s.zero(); D]; 3];
    for y in 0..ny.len() {
        let [value, slope] = row::<S, D, W>(s, weights, nodal, first + y * window.stride[0]);
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
fn gather_tile<S: Lanes, const D: usize, const VALUE: bool, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    nodal: &[f64],
    out: &mut Gathered<S::N, D>,
) {
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + W], &dn[start..start + W]);
    let mut weights = [[s.zero(); W]; 2];
    for x in 0..W {
        (weights[0][x], weights[1][x]) = (s.load(&n[x]), s.load(&dn[x]));
    }
    let origin = window.first + start;
    if D == 1 {
        let [value, slope] = row::<S, D, W>(s, &weights, nodal, origin);
        out.value[0] = s.add(out.value[0], value[0]);
        out.gradient[0][0] = s.add(out.gradient[0][0], slope[0]);
    } else if D == 2 {
        let [value, x, y] = plane::<S, D, W>(s, window, &weights, nodal, origin);
        for c in 0..D {
            out.value[c] = s.add(out.value[c], value[c]);
            out.gradient[c][0] = s.add(out.gradient[c][0], x[c]);
            out.gradient[c][1] = s.add(out.gradient[c][1], y[c]);
        }
    } else {
        let (nz, dz) = window.axis(2);
        for z in 0..nz.len() {
            let [value, x, y] = plane::<S, D, W>(s, window, &weights, nodal, origin + z * window.stride[1]);
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
    /// |N_I| and |∇N_I| for N_I and ∇N_I.
    const MAGNITUDE: bool;
}

/// A weight, or its magnitude.
#[inline(always)]
fn weight<S: Lanes, M: Terms>(s: S, x: &[f64; LANES]) -> S::N {
    if M::MAGNITUDE { s.abs(s.load(x)) } else { s.load(x) }
}

/// The same in all lanes.
#[inline(always)]
fn broadcast<S: Lanes, M: Terms>(s: S, x: f64) -> S::N {
    s.splat(if M::MAGNITUDE { x.abs() } else { x })
}

/// f_I += σ ∇N_I + q N_I, with σ in the place of L and q in that of u, a lane a particle; `out` is the box as in [`gather`],
/// eight numbers longer than its nodes.
#[inline(always)]
pub(super) fn scatter<S: Lanes, M: Terms, const D: usize>(
    s: S,
    window: &Window<'_>,
    from: &Gathered<S::N, D>,
    out: &mut [f64],
) {
    let from = Stored::of(s, from);
    let rows = window.width[1] * window.width[2];
    for chunk in 0..rows.div_ceil(LANES) {
        let pairs = Pairs::<S, D>::new::<M>(s, window, chunk * LANES);
        let mut start = 0;
        while start < window.width[0] {
            let tile = tile(window.width[0] - start);
            by_tile!(tile, scatter_tile::<S, M, D>(s, window, start, &pairs, &from, out));
            start += tile;
        }
    }
}

/// Of eight rows (y, z) of a window: N_y N_z, N_y' N_z, N_y N_z', a lane a row, for each particle; and where the rows begin.
struct Pairs<S: Lanes, const D: usize> {
    products: [[S::N; LANES]; D],
    places: [usize; LANES],
    count: usize,
}

impl<S: Lanes, const D: usize> Pairs<S, D> {
    #[inline(always)]
    fn new<M: Terms>(s: S, window: &Window<'_>, start: usize) -> Self {
        let [_, wy, wz] = window.width;
        let count = (wy * wz - start).min(LANES);
        let mut products = [[s.zero(); LANES]; D];
        let mut places = [0; LANES];
        let (mut y, mut z) = (start % wy, start / wy);
        for lane in 0..count {
            places[lane] = window.first + y * window.stride[0] + z * window.stride[1];
            if D == 1 {
                products[0][lane] = s.splat(1.0);
            } else {
                let (n, dn) = window.axis(1);
                let (ny, dy) = (weight::<S, M>(s, &n[y]), weight::<S, M>(s, &dn[y]));
                if D == 2 {
                    (products[0][lane], products[D - 1][lane]) = (ny, dy);
                } else {
                    let (n, dn) = window.axis(2);
                    let (nz, dz) = (weight::<S, M>(s, &n[z]), weight::<S, M>(s, &dn[z]));
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
    fn add(&self, s: S, sums: &[S::N], at: usize, numbers: usize, out: &mut [f64]) {
        for (part, some) in sums.chunks(LANES).enumerate() {
            let mut rows = [s.zero(); LANES];
            rows[..some.len()].copy_from_slice(some);
            let rows = s.transpose(rows);
            for lane in 0..self.count {
                let place = (self.places[lane] + at) * numbers + part * LANES;
                if let Some(slot) = out[place..].first_chunk_mut::<LANES>() {
                    let sum = s.add(s.load(slot), rows[lane]);
                    s.store(sum, slot);
                }
            }
        }
    }
}

#[inline(always)]
fn scatter_tile<S: Lanes, M: Terms, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    pairs: &Pairs<S, D>,
    from: &Stored<D>,
    out: &mut [f64],
) {
    let zero = s.zero();
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + W], &dn[start..start + W]);
    let mut sums = [[zero; D]; W];
    for p in 0..window.lanes.min(LANES) {
        let (mut across, mut along) = ([zero; D], [zero; D]);
        for c in 0..D {
            // a = σ_y N_y' N_z + σ_z N_y N_z' + q N_y N_z,  b = σ_x N_y N_z
            if M::GRADIENT {
                for k in 1..D {
                    across[c] = s.mul_add(s.splat(from.gradient[c][k][p]), pairs.products[k][p], across[c]);
                }
                along[c] = s.mul(s.splat(from.gradient[c][0][p]), pairs.products[0][p]);
            }
            if M::VALUE {
                across[c] = s.mul_add(s.splat(from.value[c][p]), pairs.products[0][p], across[c]);
            }
        }
        for x in 0..W {
            let (nx, dx) = (broadcast::<S, M>(s, n[x][p]), broadcast::<S, M>(s, dn[x][p]));
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

/// Pairs (k, l) with k ≤ l of D axes.
const MOST_PAIRS: usize = 6;

/// The quadratic form of one group: B(∇N, ∇N) + m N² I, a lane a particle.
pub(super) struct Quadratic<const D: usize> {
    /// B(e_k, e_l) + B(e_l, e_k) for k < l, B(e_k, e_k) for k = l, by `pair`.
    pub bilinear: [[[[f64; LANES]; D]; D]; MOST_PAIRS],
    /// m
    pub mass: [f64; LANES],
}

impl<const D: usize> Quadratic<D> {
    pub(super) fn zero() -> Self {
        Self { bilinear: [[[[0.0; LANES]; D]; D]; MOST_PAIRS], mass: [0.0; LANES] }
    }
}

/// The number of the pair (k, l), k ≤ l.
pub(super) const fn pair(k: usize, l: usize) -> usize {
    k + l * (l + 1) / 2
}

/// B_I += B(∇N_I, ∇N_I) + m N_I² I, summed over the particles of a group; `out` is a box of D×D blocks by rows, eight numbers
/// longer than its nodes.
///
/// With ∇N = (N_x' P_x, N_x P_y, N_x P_z), P_x = N_y N_z, …, row i of the block is
/// N_x'² B_xx P_x P_x + N_x N_x' (B_xy P_x P_y + B_xz P_x P_z) + N_x² (B_yy P_y P_y + B_yz P_y P_z + B_zz P_z P_z + m P_x P_x e_i).
#[inline(always)]
pub(super) fn scatter_blocks<S: Lanes, const D: usize>(
    s: S,
    window: &Window<'_>,
    from: &Quadratic<D>,
    out: &mut [f64],
) {
    let rows = window.width[1] * window.width[2];
    for chunk in 0..rows.div_ceil(LANES) {
        let pairs = Pairs::<S, D>::new::<Signed>(s, window, chunk * LANES);
        let mut start = 0;
        while start < window.width[0] {
            let tile = tile(window.width[0] - start);
            by_tile!(tile, blocks_tile::<S, D>(s, window, start, &pairs, from, out));
            start += tile;
        }
    }
}

/// q N_I + σ ∇N_I
pub(super) struct Signed;

impl Terms for Signed {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = false;
}

#[inline(always)]
fn blocks_tile<S: Lanes, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    pairs: &Pairs<S, D>,
    from: &Quadratic<D>,
    out: &mut [f64],
) {
    let zero = s.zero();
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + W], &dn[start..start + W]);
    let mut sums = [[[zero; D]; D]; W];
    for i in 0..D {
        let mut row = [[zero; D]; W];
        for p in 0..window.lanes.min(LANES) {
            // By powers of N_x': 2, 1, 0.
            let mut powers = [[zero; D]; 3];
            for l in 0..D {
                for k in 0..=l {
                    let power = usize::from(k > 0) + usize::from(l > 0);
                    let product = s.mul(pairs.products[k][p], pairs.products[l][p]);
                    for j in 0..D {
                        let coefficient = s.splat(from.bilinear[pair(k, l)][i][j][p]);
                        powers[power][j] = s.mul_add(coefficient, product, powers[power][j]);
                    }
                }
            }
            let square = s.mul(pairs.products[0][p], pairs.products[0][p]);
            powers[2][i] = s.mul_add(s.splat(from.mass[p]), square, powers[2][i]);
            for x in 0..W {
                let (nx, dx) = (n[x][p], dn[x][p]);
                let (two, one, none) = (s.splat(dx * dx), s.splat(nx * dx), s.splat(nx * nx));
                for j in 0..D {
                    row[x][j] = s.mul_add(powers[0][j], two, row[x][j]);
                    if D > 1 {
                        row[x][j] = s.mul_add(powers[1][j], one, row[x][j]);
                    }
                    row[x][j] = s.mul_add(powers[2][j], none, row[x][j]);
                }
            }
        }
        for x in 0..W {
            sums[x][i] = row[x];
        }
    }
    pairs.add(s, sums.as_flattened().as_flattened(), start, D * D, out);
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, WithLanes, widest};
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
    struct ThereAndBack<'a>(&'a [[f64; LANES]], &'a [f64]);

    impl WithLanes for ThereAndBack<'_> {
        type Output = (Vec<f64>, Vec<f64>);

        #[inline(always)]
        fn run<S: Lanes>(self, s: S) -> Self::Output {
            let stride = [BOX[0], BOX[0] * BOX[1]];
            let window = Window { width: WIDTH, weights: self.0, lanes: PARTICLES, first: FIRST, stride };
            let at = gather::<S, 3, true>(s, &window, self.1);
            let mut out = vec![0.0; self.1.len() + LANES];
            scatter::<S, Signed, 3>(s, &window, &at, &mut out);
            let stored = Stored::of(s, &at);
            let gathered = stored.gradient.as_flattened().iter().chain(&stored.value).flatten().copied().collect();
            (gathered, out)
        }
    }

    #[test]
    fn all_instruction_sets_give_the_plain_sums() {
        let rows = 2 * WIDTH.iter().sum::<usize>();
        let weights: Vec<[f64; LANES]> = (0..rows)
            .map(|row| std::array::from_fn(|lane| if lane < PARTICLES { irregular(row * LANES + lane) } else { 0.0 }))
            .collect();
        let nodal: Vec<f64> = (0..3 * BOX.iter().product::<usize>()).map(irregular).collect();
        // The sums, written down: place, N and ∇N of every node of the window.
        let of = |k: usize, at: usize, lane: usize| {
            let start = 2 * WIDTH[..k].iter().sum::<usize>() + at;
            [weights[start][lane], weights[start + WIDTH[k]][lane]]
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
        let work = ThereAndBack(&weights, &nodal);
        let mut all = vec![work.run(Portable), widest(work)];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(pulp::x86::V4::try_new().map(|s| work.run(s)));
            all.extend(pulp::x86::V3::try_new().map(|s| work.run(s)));
        }
        for (at, out) in all {
            assert!(at.iter().zip(gathered.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-13));
            assert!(out.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-13));
        }
    }
}
