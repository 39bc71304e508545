//! The kernels over one block of cells.
//!
//! What other files call is not generic, so that the kernels are compiled once, here, for every number, dimension and instruction
//! set, and not again by every crate and for every point function: what a particle does comes in by reference.

use super::block::Groups;
use super::closed::{Form, Numbers};
use super::diagonal::{Quadratic, pair, scatter_blocks};
use super::kernel::{Gathered, Rows, Signed, Terms, gather, load, scatter, store};
use super::lanes::{LANES, Lanes, Number, SINGLE_LANES, WithLanes};
use crate::material::ClosedTangent;
use crate::scalar::Real;

/// The groups of a block in double precision.
type Double = Groups<f64, LANES>;

/// The same in single precision.
type Single = Groups<f32, SINGLE_LANES>;

/// What is done at the particles of a group: puts q in the place of u and σ in that of L.
pub(super) type Point<'a> = dyn Fn(&[u32], &mut Rows) + Sync + 'a;

/// Calls a function of the dimension.
macro_rules! by_dimension {
    ($number:ty, $groups:expr, $work:ident { $($field:ident),* }) => {
        match $groups.dimension {
            1 => <$number>::widest($work::<1> { $($field),* }),
            2 => <$number>::widest($work::<2> { $($field),* }),
            _ => <$number>::widest($work::<3> { $($field),* }),
        }
    };
    ($number:ty, $lanes:ident, $groups:expr, $work:ident { $($field:ident),* }) => {
        match $groups.dimension {
            1 => <$number>::widest($work::<1, $number, $lanes> { $($field),* }),
            2 => <$number>::widest($work::<2, $number, $lanes> { $($field),* }),
            _ => <$number>::widest($work::<3, $number, $lanes> { $($field),* }),
        }
    };
}

/// u and L of every group.
pub(super) fn gather_all(groups: &Double, nodal: &[f64], rows: &mut [Rows]) {
    by_dimension!(f64, groups, GatherAll { groups, nodal, rows });
}

/// u of every group, in the first rows of each.
pub(super) fn gather_values(groups: &Double, nodal: &[f64], rows: &mut [Rows]) {
    by_dimension!(f64, groups, GatherValues { groups, nodal, rows });
}

/// Gathers, asks `point`, and scatters.
pub(super) fn each(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Each { groups, nodal, buffer, point });
}

/// As [`each`], with |N| and |∇N| in the scatter.
pub(super) fn magnitudes(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Magnitudes { groups, nodal, buffer, point });
}

/// As [`each`], for point functions of L alone that give σ alone.
pub(super) fn stresses(groups: &Double, nodal: &[f64], buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Stresses { groups, nodal, buffer, point });
}

/// Scatters q alone; nothing is gathered.
pub(super) fn spread(groups: &Double, buffer: &mut [f64], point: &Point<'_>) {
    by_dimension!(f64, groups, Spread { groups, buffer, point });
}

/// The product with tangents in closed form.
pub(super) fn product(groups: &Double, nodal: &[f64], buffer: &mut [f64], frozen: &Numbers<f64, LANES>) {
    product_of(groups, nodal, buffer, frozen);
}

/// The same in single precision.
pub(super) fn product_single(groups: &Single, nodal: &[f32], buffer: &mut [f32], frozen: &Numbers<f32, SINGLE_LANES>) {
    product_of(groups, nodal, buffer, frozen);
}

fn product_of<X: Number<L>, const L: usize>(
    groups: &Groups<X, L>,
    nodal: &[X],
    buffer: &mut [X],
    frozen: &Numbers<X, L>,
) {
    match frozen.form.inertia {
        false => by_dimension!(X, L, groups, Product { groups, nodal, buffer, frozen }),
        true => by_dimension!(X, L, groups, ProductInertia { groups, nodal, buffer, frozen }),
    }
}

/// The diagonal blocks of tangents in closed form.
pub(super) fn diagonal(groups: &Double, buffer: &mut [f64], frozen: &Numbers<f64, LANES>) {
    by_dimension!(f64, LANES, groups, Diagonal { groups, buffer, frozen });
}

/// The same in single precision.
pub(super) fn diagonal_single(groups: &Single, buffer: &mut [f32], frozen: &Numbers<f32, SINGLE_LANES>) {
    by_dimension!(f32, SINGLE_LANES, groups, Diagonal { groups, buffer, frozen });
}

/// The diagonal blocks of tangents that `quadratic` knows, group by group.
pub(super) fn quadratics(groups: &Double, buffer: &mut [f64], quadratic: &(dyn Fn(&[u32]) -> Quadratic + Sync)) {
    by_dimension!(f64, groups, Quadratics { groups, buffer, quadratic });
}

struct GatherAll<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    rows: &'a mut [Rows],
}

impl<const D: usize> WithLanes<f64, LANES> for GatherAll<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        for (group, rows) in self.rows.iter_mut().enumerate() {
            store(s, &gather::<S, D, LANES, true>(s, &self.groups.window(group), self.nodal), rows);
        }
    }
}

struct GatherValues<'a, const D: usize> {
    groups: &'a Double,
    nodal: &'a [f64],
    rows: &'a mut [Rows],
}

impl<const D: usize> WithLanes<f64, LANES> for GatherValues<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        for (group, rows) in self.rows.iter_mut().enumerate() {
            // L is not stored, and so not computed.
            let Gathered { value, .. } = gather::<S, D, LANES, true>(s, &self.groups.window(group), self.nodal);
            for (value, row) in value.into_iter().zip(rows) {
                s.store(value, row);
            }
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
    ($name:ident, $terms:ident, $value:expr) => {
        struct $name<'a, const D: usize> {
            groups: &'a Double,
            nodal: &'a [f64],
            buffer: &'a mut [f64],
            point: &'a Point<'a>,
        }

        impl<const D: usize> WithLanes<f64, LANES> for $name<'_, D> {
            type Output = ();

            #[inline(always)]
            fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
                let mut rows = [[0.0; LANES]; 12];
                for group in 0..self.groups.len() {
                    let window = self.groups.window(group);
                    store(s, &gather::<S, D, LANES, $value>(s, &window, self.nodal), &mut rows);
                    (self.point)(self.groups.particles(group), &mut rows);
                    scatter::<S, $terms, D, LANES>(s, &window, &load(s, &rows), self.buffer);
                }
            }
        }
    };
}

each_particle!(Each, Signed, true);
each_particle!(Magnitudes, Absolute, true);
each_particle!(Stresses, OnlyGradient, false);

struct Spread<'a, const D: usize> {
    groups: &'a Double,
    buffer: &'a mut [f64],
    point: &'a Point<'a>,
}

impl<const D: usize> WithLanes<f64, LANES> for Spread<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        let mut rows = [[0.0; LANES]; 12];
        for group in 0..self.groups.len() {
            (self.point)(self.groups.particles(group), &mut rows);
            scatter::<S, OnlyValue, D, LANES>(s, &self.groups.window(group), &load(s, &rows), self.buffer);
        }
    }
}

macro_rules! closed_product {
    ($name:ident, $terms:ident, $inertia:expr) => {
        struct $name<'a, const D: usize, X, const L: usize> {
            groups: &'a Groups<X, L>,
            nodal: &'a [X],
            buffer: &'a mut [X],
            frozen: &'a Numbers<X, L>,
        }

        impl<const D: usize, X: Real, const L: usize> WithLanes<X, L> for $name<'_, D, X, L> {
            type Output = ();

            #[inline(always)]
            fn run<S: Lanes<L, X = X>>(self, s: S) {
                let form = Form { both: self.frozen.form.both, inertia: $inertia };
                let count = form.rows(D);
                for group in 0..self.groups.len() {
                    let window = self.groups.window(group);
                    let mut at = gather::<S, D, L, { $inertia }>(s, &window, self.nodal);
                    let numbers = self.frozen.of_group(self.groups.first + group, count);
                    let tangent: ClosedTangent<S::N, D> = form.read(s, numbers);
                    at.gradient = tangent.product(s, &at.gradient);
                    if $inertia {
                        let weight = s.load(&numbers[count - 1]);
                        for value in &mut at.value {
                            *value = s.mul(weight, *value);
                        }
                    }
                    scatter::<S, $terms, D, L>(s, &window, &at, self.buffer);
                }
            }
        }
    };
}

closed_product!(Product, OnlyGradient, false);
closed_product!(ProductInertia, Signed, true);

struct Diagonal<'a, const D: usize, X, const L: usize> {
    groups: &'a Groups<X, L>,
    buffer: &'a mut [X],
    frozen: &'a Numbers<X, L>,
}

impl<const D: usize, X: Real, const L: usize> WithLanes<X, L> for Diagonal<'_, D, X, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<L, X = X>>(self, s: S) {
        let form = self.frozen.form;
        let count = form.rows(D);
        let mut quadratic = Quadratic::<X, L>::zero();
        for group in 0..self.groups.len() {
            let numbers = self.frozen.of_group(self.groups.first + group, count);
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
            scatter_blocks::<S, D, L>(s, &self.groups.window(group), &quadratic, self.buffer);
        }
    }
}

struct Quadratics<'a, const D: usize> {
    groups: &'a Double,
    buffer: &'a mut [f64],
    quadratic: &'a (dyn Fn(&[u32]) -> Quadratic + Sync),
}

impl<const D: usize> WithLanes<f64, LANES> for Quadratics<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, s: S) {
        for group in 0..self.groups.len() {
            let quadratic = (self.quadratic)(self.groups.particles(group));
            scatter_blocks::<S, D, LANES>(s, &self.groups.window(group), &quadratic, self.buffer);
        }
    }
}
