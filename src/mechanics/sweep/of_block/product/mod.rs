//! Products with tangents in closed form.

pub(super) mod double;
pub(super) mod single;

use super::by_dimension;
use crate::material::ClosedTangent;
use crate::mechanics::sweep::block::Groups;
use crate::mechanics::sweep::closed::{Form, Numbers};
use crate::mechanics::sweep::kernel::{Both, OnlyGradient, gather, scatter};
use crate::mechanics::sweep::lanes::{Lanes, Number, WithLanes};

macro_rules! closed_product {
    ($name:ident, $terms:ident, $inertia:expr) => {
        struct $name<'a, const D: usize, X: Number<L>, const L: usize> {
            groups: &'a Groups<X, L>,
            nodal: &'a [X],
            buffer: &'a mut [X],
            frozen: &'a Numbers<X, L>,
        }

        impl<const D: usize, X: Number<L>, const L: usize> WithLanes<X, L> for $name<'_, D, X, L> {
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
closed_product!(ProductInertia, Both, true);
