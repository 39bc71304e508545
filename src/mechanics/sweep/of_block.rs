//! The kernels over one block of cells.
//!
//! These functions are not generic, so that the kernels are compiled once, here, for every dimension and instruction set, and
//! not again for every point function: what a particle does comes in by reference.

use super::block::Block;
use super::closed::{Form, Numbers};
use super::kernel::{Quadratic, Rows, Signed, Terms, gather, load, pair, scatter, scatter_blocks, store};
use super::lanes::{LANES, Lanes, WithLanes, widest};
use crate::material::ClosedTangent;

/// What is done at the particles of a group: puts q in the place of u and σ in that of L.
pub(super) type Point<'a> = dyn Fn(&[u32], &mut Rows) + Sync + 'a;

/// Calls a function of the dimension.
macro_rules! by_dimension {
    ($block:expr, $work:ident { $($field:ident),* }) => {
        match $block.dimension {
            1 => widest($work::<1> { $($field),* }),
            2 => widest($work::<2> { $($field),* }),
            _ => widest($work::<3> { $($field),* }),
        }
    };
}

/// u and L of every group.
pub(super) fn gather_all(block: &Block, nodal: &[f64], rows: &mut [Rows]) {
    by_dimension!(block, GatherAll { block, nodal, rows });
}

/// Gathers, asks `point`, and scatters.
pub(super) fn each(block: &Block, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(block, Each { block, nodal, buffer, point });
}

/// As [`each`], with |N| and |∇N| in the scatter.
pub(super) fn magnitudes(block: &Block, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(block, Magnitudes { block, nodal, buffer, point });
}

/// Scatters q alone; nothing is gathered.
pub(super) fn spread(block: &Block, buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(block, Spread { block, buffer, point });
}

/// The product with tangents in closed form.
pub(super) fn product(block: &Block, nodal: &[f64], buffer: &mut [f64], frozen: &Numbers) {
    match (frozen.form.both, frozen.form.inertia) {
        (false, false) => by_dimension!(block, Product { block, nodal, buffer, frozen }),
        (false, true) => by_dimension!(block, ProductInertia { block, nodal, buffer, frozen }),
        (true, false) => by_dimension!(block, ProductBoth { block, nodal, buffer, frozen }),
        (true, true) => by_dimension!(block, ProductBothInertia { block, nodal, buffer, frozen }),
    }
}

/// The diagonal blocks of tangents in closed form.
pub(super) fn diagonal(block: &Block, buffer: &mut [f64], frozen: &Numbers) {
    by_dimension!(block, Diagonal { block, buffer, frozen });
}

/// The diagonal blocks of tangents that `quadratic` knows, group by group.
pub(super) fn quadratics(block: &Block, buffer: &mut [f64], quadratic: &(dyn Fn(&[u32]) -> Quadratic + Sync)) {
    by_dimension!(block, Quadratics { block, buffer, quadratic });
}

struct GatherAll<'a, const D: usize> {
    block: &'a Block,
    nodal: &'a [f64],
    rows: &'a mut [Rows],
}

impl<const D: usize> WithLanes for GatherAll<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        for (group, rows) in self.rows.iter_mut().enumerate() {
            store(s, &gather::<S, D, true>(s, &self.block.window(group), self.nodal), rows);
        }
    }
}

/// |q| |N_I| + |σ| |∇N_I|, the magnitudes of q and σ being those of the point function.
struct Absolute;

impl Terms for Absolute {
    const VALUE: bool = true;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = true;
}

/// q N_I
struct OnlyValue;

impl Terms for OnlyValue {
    const VALUE: bool = true;
    const GRADIENT: bool = false;
    const MAGNITUDE: bool = false;
}

/// σ ∇N_I
struct OnlyGradient;

impl Terms for OnlyGradient {
    const VALUE: bool = false;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = false;
}

macro_rules! each_particle {
    ($name:ident, $terms:ident) => {
        struct $name<'a, const D: usize> {
            block: &'a Block,
            nodal: &'a [f64],
            buffer: &'a mut [f64],
            point: &'a Point<'a>,
        }

        impl<const D: usize> WithLanes for $name<'_, D> {
            type Output = ();

            #[inline(always)]
            fn run<S: Lanes>(self, s: S) {
                let mut rows = [[0.0; LANES]; 12];
                for group in 0..self.block.groups() {
                    let window = self.block.window(group);
                    store(s, &gather::<S, D, true>(s, &window, self.nodal), &mut rows);
                    (self.point)(self.block.particles(group), &mut rows);
                    scatter::<S, $terms, D>(s, &window, &load(s, &rows), self.buffer);
                }
            }
        }
    };
}

each_particle!(Each, Signed);
each_particle!(Magnitudes, Absolute);

struct Spread<'a, const D: usize> {
    block: &'a Block,
    buffer: &'a mut [f64],
    point: &'a Point<'a>,
}

impl<const D: usize> WithLanes for Spread<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let mut rows = [[0.0; LANES]; 12];
        for group in 0..self.block.groups() {
            (self.point)(self.block.particles(group), &mut rows);
            scatter::<S, OnlyValue, D>(s, &self.block.window(group), &load(s, &rows), self.buffer);
        }
    }
}

macro_rules! closed_product {
    ($name:ident, $terms:ident, $both:expr, $inertia:expr) => {
        struct $name<'a, const D: usize> {
            block: &'a Block,
            nodal: &'a [f64],
            buffer: &'a mut [f64],
            frozen: &'a Numbers,
        }

        impl<const D: usize> WithLanes for $name<'_, D> {
            type Output = ();

            #[inline(always)]
            fn run<S: Lanes>(self, s: S) {
                const FORM: Form = Form { both: $both, inertia: $inertia };
                let count = FORM.rows(D);
                for group in 0..self.block.groups() {
                    let window = self.block.window(group);
                    let mut at = gather::<S, D, { $inertia }>(s, &window, self.nodal);
                    let numbers = self.frozen.of_group(self.block.first_group + group, count);
                    let tangent: ClosedTangent<S::N, D> = FORM.read(s, numbers);
                    at.gradient = tangent.product(s, &at.gradient);
                    if $inertia {
                        let weight = s.load(&numbers[count - 1]);
                        for value in &mut at.value {
                            *value = s.mul(weight, *value);
                        }
                    }
                    scatter::<S, $terms, D>(s, &window, &at, self.buffer);
                }
            }
        }
    };
}

closed_product!(Product, OnlyGradient, false, false);
closed_product!(ProductInertia, Signed, false, true);
closed_product!(ProductBoth, OnlyGradient, true, false);
closed_product!(ProductBothInertia, Signed, true, true);

struct Diagonal<'a, const D: usize> {
    block: &'a Block,
    buffer: &'a mut [f64],
    frozen: &'a Numbers,
}

impl<const D: usize> WithLanes for Diagonal<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let form = self.frozen.form;
        let count = form.rows(D);
        let mut quadratic = Quadratic::zero();
        for group in 0..self.block.groups() {
            let numbers = self.frozen.of_group(self.block.first_group + group, count);
            let tangent: ClosedTangent<S::N, D> = form.read(s, numbers);
            for l in 0..D {
                for k in 0..=l {
                    let (one, other) = (tangent.unit_block(s, k, l), tangent.unit_block(s, l, k));
                    for i in 0..D {
                        for j in 0..D {
                            let sum = if k < l { s.add(one[i][j], other[i][j]) } else { one[i][j] };
                            s.store(sum, &mut quadratic.bilinear[pair(k, l)][i][j]);
                        }
                    }
                }
            }
            if form.inertia {
                quadratic.mass = numbers[count - 1];
            }
            scatter_blocks::<S, D>(s, &self.block.window(group), &quadratic, self.buffer);
        }
    }
}

struct Quadratics<'a, const D: usize> {
    block: &'a Block,
    buffer: &'a mut [f64],
    quadratic: &'a (dyn Fn(&[u32]) -> Quadratic + Sync),
}

impl<const D: usize> WithLanes for Quadratics<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        for group in 0..self.block.groups() {
            let quadratic = (self.quadratic)(self.block.particles(group));
            scatter_blocks::<S, D>(s, &self.block.window(group), &quadratic, self.buffer);
        }
    }
}
