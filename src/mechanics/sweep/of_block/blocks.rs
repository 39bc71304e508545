//! The diagonal blocks of tangents.

use super::{Double, Single, by_dimension};
use crate::material::ClosedTangent;
use crate::mechanics::sweep::block::Groups;
use crate::mechanics::sweep::closed::Numbers;
use crate::mechanics::sweep::diagonal::{Quadratic, pair, scatter_blocks};
use crate::mechanics::sweep::kernel::Window;
use crate::mechanics::sweep::lanes::{LANES, Lanes, Number, SINGLE_LANES, WithLanes};
use crate::scalar::Real;

/// The diagonal blocks of tangents in closed form.
pub(in crate::mechanics::sweep) fn diagonal(groups: &Double, buffer: &mut [f64], frozen: &Numbers<f64, LANES>) {
    let mut quadratic = Quadratic::zero();
    for group in 0..groups.len() {
        let into = &mut quadratic;
        by_dimension!(f64, groups, OfClosed::<f64, LANES> { groups, group, frozen, into });
        add(groups, group, &quadratic, buffer);
    }
}

/// The same in single precision.
pub(in crate::mechanics::sweep) fn diagonal_single(
    groups: &Single,
    buffer: &mut [f32],
    frozen: &Numbers<f32, SINGLE_LANES>,
) {
    let mut quadratic = Quadratic::zero();
    for group in 0..groups.len() {
        let into = &mut quadratic;
        by_dimension!(f32, groups, OfClosed::<f32, SINGLE_LANES> { groups, group, frozen, into });
        let (window, from, buffer) = (groups.window(group), &quadratic, &mut *buffer);
        by_dimension!(f32, groups, Add::<f32, SINGLE_LANES> { window, from, buffer });
    }
}

/// The diagonal blocks of tangents that `quadratic` knows, group by group.
pub(in crate::mechanics::sweep) fn quadratics(
    groups: &Double,
    buffer: &mut [f64],
    quadratic: &(dyn Fn(&[u32]) -> Quadratic + Sync),
) {
    for group in 0..groups.len() {
        add(groups, group, &quadratic(groups.particles(group)), buffer);
    }
}

/// Adds the blocks of a group.
fn add(groups: &Double, group: usize, from: &Quadratic, buffer: &mut [f64]) {
    let window = groups.window(group);
    by_dimension!(f64, groups, Add::<f64, LANES> { window, from, buffer });
}

/// Writes the quadratic form of a tangent in closed form.
struct OfClosed<'a, const D: usize, X: Number<L>, const L: usize> {
    groups: &'a Groups<X, L>,
    group: usize,
    frozen: &'a Numbers<X, L>,
    into: &'a mut Quadratic<X, L>,
}

impl<const D: usize, X: Number<L>, const L: usize> WithLanes<X, L> for OfClosed<'_, D, X, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<L, X = X>>(self, s: S) {
        let form = self.frozen.form;
        let count = form.rows(D);
        let numbers = self.frozen.of_group(self.groups.first + self.group, count);
        let tangent: ClosedTangent<S::N, D> = form.read(s, numbers);
        for l in 0..D {
            for k in 0..=l {
                let (one, other) = (tangent.unit_block(s, k, l), tangent.unit_block(s, l, k));
                for i in 0..D {
                    for j in 0..D {
                        let sum = if k < l { s.add(one[i][j], other[i][j]) } else { one[i][j] };
                        s.store(sum, &mut self.into.bilinear[pair(k, l)][i][j]);
                    }
                }
            }
        }
        if form.inertia {
            self.into.mass = numbers[count - 1];
        }
    }
}

/// Adds the blocks of a quadratic form.
struct Add<'a, const D: usize, X, const L: usize> {
    window: Window<'a, X, L>,
    from: &'a Quadratic<X, L>,
    buffer: &'a mut [X],
}

impl<const D: usize, X: Real, const L: usize> WithLanes<X, L> for Add<'_, D, X, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<L, X = X>>(self, s: S) {
        scatter_blocks::<S, D, L>(s, &self.window, self.from, self.buffer);
    }
}
