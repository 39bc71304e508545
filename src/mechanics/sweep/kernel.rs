//! Gather and scatter of one group of particles, sum-factorised.
//!
//! A group is up to eight particles that share one window of nodes, so that the nodes of a window are read and written
//! once for all of them.
//!
//! gather, a lane a particle:  u = Σ u_I N_I,  L = Σ u_I ⊗ ∇N_I, contracted along x, then y, then z;
//! scatter, a lane a row (y, z) of the window: f_I += σ ∇N_I + q N_I, summed over the particles in registers.

use super::lanes::{LANES, Lanes};

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

/// The widths of the tiles that make up a window of `width` nodes along x: at most [`TILE`] each, none of them 1 but for
/// a window of one node.
#[inline(always)]
fn tiles(width: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let left = width - start;
        let tile = if left > TILE { TILE - 2 } else { left };
        start += tile;
        (tile > 0).then_some((start - tile, tile))
    })
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
pub(super) struct Gathered<V, const D: usize> {
    pub value: [V; D],
    pub gradient: [[V; D]; D],
}

/// The same in memory, lane after lane.
pub(super) struct Stored<const D: usize> {
    pub value: [[f64; LANES]; D],
    pub gradient: [[[f64; LANES]; D]; D],
}

impl<const D: usize> Stored<D> {
    #[inline(always)]
    pub(super) fn of<S: Lanes>(s: S, from: &Gathered<S::V, D>) -> Self {
        let mut stored = Self { value: [[0.0; LANES]; D], gradient: [[[0.0; LANES]; D]; D] };
        for c in 0..D {
            s.store(from.value[c], &mut stored.value[c]);
            for k in 0..D {
                s.store(from.gradient[c][k], &mut stored.gradient[c][k]);
            }
        }
        stored
    }

    #[inline(always)]
    pub(super) fn load<S: Lanes>(&self, s: S) -> Gathered<S::V, D> {
        let zero = s.splat(0.0);
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
) -> Gathered<S::V, D> {
    let zero = s.splat(0.0);
    let mut out = Gathered { value: [zero; D], gradient: [[zero; D]; D] };
    for (start, tile) in tiles(window.width[0]) {
        by_tile!(tile, gather_tile::<S, D, VALUE>(s, window, start, nodal, &mut out));
    }
    out
}

#[inline(always)]
fn gather_tile<S: Lanes, const D: usize, const VALUE: bool, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    nodal: &[f64],
    out: &mut Gathered<S::V, D>,
) {
    let zero = s.splat(0.0);
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + W], &dn[start..start + W]);
    let (mut nx, mut dx) = ([zero; W], [zero; W]);
    for x in 0..W {
        (nx[x], dx[x]) = (s.load(&n[x]), s.load(&dn[x]));
    }
    // (Σ_x u N_x, Σ_x u N_x') of one row
    let row = |first: usize| {
        let row = &nodal[first * D..(first + W) * D];
        let (mut value, mut slope) = ([zero; D], [zero; D]);
        for x in 0..W {
            for c in 0..D {
                let u = s.splat(row[x * D + c]);
                value[c] = s.fma(u, nx[x], value[c]);
                slope[c] = s.fma(u, dx[x], slope[c]);
            }
        }
        (value, slope)
    };
    let origin = window.first + start;
    if D == 1 {
        let (value, slope) = row(origin);
        out.value[0] = s.add(out.value[0], value[0]);
        out.gradient[0][0] = s.add(out.gradient[0][0], slope[0]);
        return;
    }
    let (ny, dy) = window.axis(1);
    // (Σ N_x N_y, Σ N_x' N_y, Σ N_x N_y') of one plane
    let plane = |first: usize| {
        let mut sums = [[zero; D]; 3];
        for (y, (ny, dy)) in ny.iter().zip(dy).enumerate() {
            let (value, slope) = row(first + y * window.stride[0]);
            let (ny, dy) = (s.load(ny), s.load(dy));
            for c in 0..D {
                sums[0][c] = s.fma(value[c], ny, sums[0][c]);
                sums[1][c] = s.fma(slope[c], ny, sums[1][c]);
                sums[2][c] = s.fma(value[c], dy, sums[2][c]);
            }
        }
        sums
    };
    if D == 2 {
        let [value, x, y] = plane(origin);
        for c in 0..D {
            out.value[c] = s.add(out.value[c], value[c]);
            out.gradient[c][0] = s.add(out.gradient[c][0], x[c]);
            out.gradient[c][1] = s.add(out.gradient[c][1], y[c]);
        }
        return;
    }
    let (nz, dz) = window.axis(2);
    for (z, (nz, dz)) in nz.iter().zip(dz).enumerate() {
        let [value, x, y] = plane(origin + z * window.stride[1]);
        let (nz, dz) = (s.load(nz), s.load(dz));
        for c in 0..D {
            if VALUE {
                out.value[c] = s.fma(value[c], nz, out.value[c]);
            }
            out.gradient[c][0] = s.fma(x[c], nz, out.gradient[c][0]);
            out.gradient[c][1] = s.fma(y[c], nz, out.gradient[c][1]);
            out.gradient[c][2] = s.fma(value[c], dz, out.gradient[c][2]);
        }
    }
}

/// f_I += σ ∇N_I + q N_I (q only if `VALUE`), σ in the place of L and q in that of u; `out` is the box as in
/// [`gather`], eight numbers longer than its nodes.
#[inline(always)]
pub(super) fn scatter<S: Lanes, const D: usize, const VALUE: bool>(
    s: S,
    window: &Window<'_>,
    from: &Gathered<S::V, D>,
    out: &mut [f64],
) {
    let from = Stored::of(s, from);
    let rows = window.width[1] * window.width[2];
    for chunk in 0..rows.div_ceil(LANES) {
        let pairs = Pairs::<S, D>::new(s, window, chunk * LANES);
        for (start, tile) in tiles(window.width[0]) {
            by_tile!(tile, scatter_tile::<S, D, VALUE>(s, window, start, &pairs, &from, out));
        }
    }
}

/// Of eight rows (y, z) of a window: N_y N_z, N_y' N_z, N_y N_z', a lane a row, for each particle; and where the rows begin.
struct Pairs<S: Lanes, const D: usize> {
    products: [[S::V; LANES]; D],
    places: [usize; LANES],
    count: usize,
}

impl<S: Lanes, const D: usize> Pairs<S, D> {
    #[inline(always)]
    fn new(s: S, window: &Window<'_>, start: usize) -> Self {
        let (zero, one) = (s.splat(0.0), s.splat(1.0));
        let [_, wy, wz] = window.width;
        let count = (wy * wz - start).min(LANES);
        let mut products = [[zero; LANES]; D];
        let mut places = [0; LANES];
        let (mut y, mut z) = (start % wy, start / wy);
        for lane in 0..count {
            places[lane] = window.first + y * window.stride[0] + z * window.stride[1];
            let pair = |k: usize, at: usize| {
                let (n, dn) = window.axis(k);
                (s.load(&n[at]), s.load(&dn[at]))
            };
            let (ny, dy) = if D > 1 { pair(1, y) } else { (one, zero) };
            if D < 3 {
                products[0][lane] = ny;
                if D == 2 {
                    products[D - 1][lane] = dy;
                }
            } else {
                let (nz, dz) = pair(2, z);
                products[0][lane] = s.mul(ny, nz);
                products[1][lane] = s.mul(dy, nz);
                products[2 % D][lane] = s.mul(ny, dz);
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
}

#[inline(always)]
fn scatter_tile<S: Lanes, const D: usize, const VALUE: bool, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    pairs: &Pairs<S, D>,
    from: &Stored<D>,
    out: &mut [f64],
) {
    let zero = s.splat(0.0);
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + W], &dn[start..start + W]);
    let mut sums = [[zero; D]; W];
    for p in 0..window.lanes.min(LANES) {
        let (mut across, mut along) = ([zero; D], [zero; D]);
        for c in 0..D {
            // a = σ_y N_y' N_z + σ_z N_y N_z' + q N_y N_z,  b = σ_x N_y N_z
            for k in 1..D {
                across[c] = s.fma(s.splat(from.gradient[c][k][p]), pairs.products[k][p], across[c]);
            }
            if VALUE {
                across[c] = s.fma(s.splat(from.value[c][p]), pairs.products[0][p], across[c]);
            }
            along[c] = s.mul(s.splat(from.gradient[c][0][p]), pairs.products[0][p]);
        }
        for x in 0..W {
            let (nx, dx) = (s.splat(n[x][p]), s.splat(dn[x][p]));
            for c in 0..D {
                sums[x][c] = s.fma(across[c], nx, sums[x][c]);
                sums[x][c] = s.fma(along[c], dx, sums[x][c]);
            }
        }
    }
    // From a lane a row to a row after the other.
    for part in 0..(W * D).div_ceil(LANES) {
        let mut rows = [zero; LANES];
        for (i, row) in rows.iter_mut().enumerate() {
            let at = part * LANES + i;
            if at < W * D {
                *row = sums[at / D][at % D];
            }
        }
        let rows = s.transpose(rows);
        for lane in 0..pairs.count {
            let place = (pairs.places[lane] + start) * D + part * LANES;
            if let Some(slot) = out[place..].first_chunk_mut::<LANES>() {
                let sum = s.add(s.load(slot), rows[lane]);
                s.store(sum, slot);
            }
        }
    }
}
