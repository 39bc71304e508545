//! The residual as a list of terms, one file each.
//!
//! A term acts at nodes, or at particles in the one pass that all terms share. A term gives
//!
//! - its value, for every number type;
//! - its energy, if it has a potential;
//! - the size that its round-off is relative to;
//! - its tangent, linearised at one Δφ: product and diagonal blocks.
//!
//! [`Equilibrium`](super::residual::Equilibrium) sums the terms of the list. Plans and checks go through the same list.

mod body_force;
mod carried_over;
mod damping;
mod inertia;
mod mean_dilatation;
mod pressure;
mod stress;
mod traction;

pub use body_force::BodyForce;
pub use carried_over::CarriedOver;
pub use damping::Damping;
pub use inertia::Inertia;
pub use mean_dilatation::MeanDilatation;
pub(crate) use mean_dilatation::linearized_rows;
pub use pressure::Pressure;
pub use stress::Stress;
pub use traction::Traction;

use crate::material::Law;
use crate::mechanics::constitutive::{Inadmissible, Part};
use crate::mechanics::loads::Loads;
use crate::mechanics::mass::Mass;
use crate::mechanics::schemes::{Alphas, Scheme};
use crate::mechanics::sweep::{At, Group, Mode, Number, Quadratic, Supports};
use crate::mechanics::transfer::Nodal;
use crate::mechanics::unknowns::Function;
use crate::particles::{Body, Particles};
use crate::tensor::{Tensor, Vector};

/// The data that all terms of a step are built from.
#[derive(Debug)]
pub struct Step<'a, const D: usize, L> {
    /// The particles at the last converged step.
    pub particles: &'a Particles<D>,
    /// The bodies.
    pub bodies: &'a [Body<L>],
    /// The loads on the bodies.
    pub loads: &'a Loads<D>,
    /// Shape functions, evaluated at the last grid reset.
    pub supports: &'a Supports<D>,
    /// State at the nodes.
    pub nodal: &'a Nodal<D>,
    /// The relations of a and v to Δφ.
    pub alphas: Alphas,
    /// ε, the lumped share of the mass.
    pub lumping: f64,
    /// The time at which the loads are evaluated.
    pub time: f64,
    /// Δt
    pub dt: f64,
}

impl<const D: usize, L> Clone for Step<'_, D, L> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<const D: usize, L> Copy for Step<'_, D, L> {}

impl<'a, const D: usize, L> Step<'a, D, L> {
    /// The mass operator.
    pub fn mass(&self) -> Mass<'a, D> {
        let Self { particles, supports, nodal, lumping, .. } = *self;
        Mass { particles, supports, lumped: &nodal.mass, lumping }
    }
}

/// The contribution of a term at the particles of a group: adds q and σ to the last argument. The function is chosen once per pass.
pub type AtPoints<'a, T, const D: usize> =
    Box<dyn Fn(Group<'_>, &At<T, D, D>, &mut At<T, D, D>) -> Result<(), Inadmissible> + Sync + 'a>;

/// The contribution of a linearised term to the product, like [`AtPoints`]. A linearised term always exists, so there is no error.
pub(crate) type ProductAtPoints<'a, const D: usize> =
    Box<dyn Fn(Group<'_>, &At<f64, D, D>, &mut At<f64, D, D>) + Sync + 'a>;

/// The effective shape functions of all unknowns at a particle, by node.
pub(crate) type FunctionsAt<'a, const D: usize> = dyn Fn(usize) -> Vec<(usize, Function<D>)> + 'a;

/// Adds the quadratic form of a linearised tangent at the particles of a group.
pub(crate) type BlocksAtPoints<'a> = Box<dyn Fn(Group<'_>, &mut Quadratic) + Sync + 'a>;

/// A sum, and the sum of the magnitudes of its contributions.
pub type Sum<T> = (T, f64);

/// The data of a simulation before its first step, from which a term makes its plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Given<'a, const D: usize> {
    pub loads: &'a Loads<D>,
    pub scheme: &'a dyn Scheme,
    /// ε
    pub lumping: f64,
    /// Whether a body has mean dilatation.
    pub averages: bool,
    /// Whether the grid may be reset.
    pub may_reset: bool,
}

/// `(name, used, why)`: whether a term, or a part of a term, is used, and the reason.
pub(crate) type Reason = (&'static str, bool, String);

/// The sum of energies, and the sum of their magnitudes.
fn summed<T: Number>(energies: impl IntoIterator<Item = T>) -> Sum<T> {
    energies.into_iter().fold((T::zero(), 0.0), |(sum, size), energy| (sum + energy, size + energy.value().abs()))
}

/// The result of linearising a term; `None` for a dead load.
pub(crate) type LinearizedTerm<'a, const D: usize> = Result<Option<Box<dyn Linearized<D> + 'a>>, Inadmissible>;

/// A term of the residual R(Δφ).
pub(crate) trait Term<const D: usize>: Sync {
    /// The name of the term in checks, plans and reports.
    const NAME: &'static str;
    /// The parts of its tangent that can be linearised alone, with their names.
    const PARTS: &'static [(Part, &'static str)] = &[];
    /// Where its work goes.
    const ROLE: Role = Role::Stores;

    /// The entries of the term in a plan.
    fn planned(given: Given<'_, D>) -> Vec<Reason>;

    /// Adds the contribution at the nodes.
    fn add_at_nodes<T: Number>(&self, _dphi: &[Vector<T, D>], _out: &mut [Vector<T, D>]) {}

    /// The contribution at the particles at Δφ. Its [`Mode`] says which of u and L it reads, and which of q and σ it writes. Only the
    /// occurrences of Δφ in `part` carry derivatives.
    fn at_points<T: Number>(&self, _part: Part, _dphi: &[Vector<T, D>]) -> Option<(Mode, AtPoints<'_, T, D>)> {
        None
    }

    /// The potential whose gradient is this term; `None` if there is none.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>>;

    /// Adds the magnitudes of the contributions of [`Self::add_at_nodes`].
    fn add_magnitudes_at_nodes(&self, _dphi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) {}

    /// Adds the change of the residual when Δφ and the state are rounded, in units of eps.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn add_sensitivity(&self, _dphi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        Ok(())
    }

    /// Linearises the term at Δφ; `None` for a dead load.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn linearize(&self, _dphi: &[Vector<f64, D>], _part: Part) -> LinearizedTerm<'_, D> {
        Ok(None)
    }
}

/// A term linearised at one Δφ: the data that its product needs, and no more.
pub(crate) trait Linearized<const D: usize>: Sync {
    /// Adds the contribution to the product at the nodes.
    fn add_product_at_nodes(&self, _u: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) {}

    /// The contribution to the product with `u` at the particles, with its [`Mode`]. `u` is `None` where multigrid asks with unit
    /// gradients, which come from no nodal field. A term that couples particles then leaves the coupling out.
    fn product_at_points(&self, _u: Option<&[Vector<f64, D>]>) -> Option<(Mode, ProductAtPoints<'_, D>)> {
        None
    }

    /// Adds the contribution of the nodes to the diagonal blocks.
    fn add_blocks_at_nodes(&self, _blocks: &mut [Tensor<f64, D>]) {}

    /// Adds the contribution to the diagonal blocks that needs the effective shape functions of single particles.
    fn add_blocks_of_functions(&self, _functions: &FunctionsAt<'_, D>, _blocks: &mut [Tensor<f64, D>]) {}

    /// The contribution to the diagonal blocks at the particles.
    fn blocks_at_points(&self) -> Option<BlocksAtPoints<'_>> {
        None
    }

    /// The reach of the tangent's entries along an axis, beyond that of the shape functions; in nodes.
    fn reach(&self) -> u32 {
        0
    }
}

/// Where the work of a term goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The work goes into kinetic or strain energy, and back.
    Stores,
    /// The work is external.
    Loads,
    /// The work is dissipated.
    Dissipates,
}

/// A term, or a part of one, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Piece {
    /// The term.
    pub term: &'static str,
    /// The part.
    pub part: Part,
    /// The name of the piece.
    pub name: &'static str,
}

/// Declares [`Terms`] from the list of all terms.
macro_rules! terms {
    ($($field:ident: $term:ty),* $(,)?) => {
        /// The terms of one step. Terms that a scene does not need are `None`.
        pub struct Terms<'a, const D: usize, L> {
            $(#[doc = concat!("See [`", stringify!($term), "`].")] pub $field: Option<$term>),*
        }

        impl<'a, const D: usize, L: Law> Terms<'a, D, L> {
            /// The terms that act in a step.
            pub(crate) fn of(step: &Step<'a, D, L>) -> Self {
                Self { $($field: <$term>::of(step)),* }
            }

            /// The entries of all terms in a plan.
            pub(crate) fn planned(given: Given<'_, D>) -> Vec<Reason> {
                [$(<$term as Term<D>>::planned(given)),*].concat()
            }

            /// The terms in use, whole and by the parts that can be linearised alone.
            pub fn pieces(&self) -> Vec<Piece> {
                let mut pieces = Vec::new();
                $(if self.$field.is_some() {
                    let (term, parts) = (<$term as Term<D>>::NAME, <$term as Term<D>>::PARTS);
                    pieces.push(Piece { term, part: Part::Whole, name: term });
                    pieces.extend(parts.iter().map(|&(part, name)| Piece { term, part, name }));
                })*
                pieces
            }

            /// Whether a piece is a load.
            pub(crate) fn is_load(&self, piece: Piece) -> bool {
                $(if piece.term == <$term as Term<D>>::NAME {
                    return <$term as Term<D>>::ROLE == Role::Loads;
                })*
                false
            }

            /// Adds the contributions at the nodes of all terms that `picked` selects.
            pub(crate) fn add_at_nodes<T: Number>(
                &self,
                picked: impl Fn(&str, Role) -> bool,
                dphi: &[Vector<T, D>],
                out: &mut [Vector<T, D>],
            ) {
                $(if let Some(term) = self.$field.as_ref().filter(|_| picked(<$term as Term<D>>::NAME, <$term as Term<D>>::ROLE)) {
                    term.add_at_nodes(dphi, out);
                })*
            }

            /// The contributions at the particles of all terms that `picked` selects.
            pub(crate) fn at_points<T: Number>(
                &self,
                picked: impl Fn(&str, Role) -> bool,
                part: Part,
                dphi: &[Vector<T, D>],
            ) -> Vec<(Mode, AtPoints<'_, T, D>)> {
                let mut all = Vec::new();
                $(if let Some(term) = self.$field.as_ref().filter(|_| picked(<$term as Term<D>>::NAME, <$term as Term<D>>::ROLE)) {
                    all.extend(term.at_points(part, dphi));
                })*
                all
            }

            /// The sum of all energies; `None` if a term has no potential.
            pub(crate) fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
                let (mut sum, mut magnitude) = (T::zero(), 0.0);
                $(if let Some(term) = &self.$field {
                    match term.energy(dphi)? {
                        Ok((value, size)) => {
                            sum += value;
                            magnitude += size;
                        }
                        Err(error) => return Some(Err(error)),
                    }
                })*
                Some(Ok((sum, magnitude)))
            }

            pub(crate) fn add_magnitudes_at_nodes(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
                $(if let Some(term) = &self.$field {
                    term.add_magnitudes_at_nodes(dphi, out);
                })*
            }

            pub(crate) fn add_sensitivity(
                &self,
                dphi: &[Vector<f64, D>],
                out: &mut [Vector<f64, D>],
            ) -> Result<(), Inadmissible> {
                $(if let Some(term) = &self.$field {
                    term.add_sensitivity(dphi, out)?;
                })*
                Ok(())
            }

            /// Linearises all terms, or one piece.
            pub(crate) fn linearize(
                &self,
                piece: Option<Piece>,
                dphi: &[Vector<f64, D>],
            ) -> Result<Vec<Box<dyn Linearized<D> + '_>>, Inadmissible> {
                let mut all = Vec::new();
                $(if let Some(term) = self.$field.as_ref().filter(|_| piece.is_none_or(|piece| piece.term == <$term as Term<D>>::NAME)) {
                    all.extend(term.linearize(dphi, piece.map_or(Part::Whole, |piece| piece.part))?);
                })*
                Ok(all)
            }
        }
    };
}

terms! {
    inertia: Inertia<'a, D>,
    stress: Stress<'a, D, L>,
    mean_dilatation: MeanDilatation<'a, D, L>,
    damping: Damping<'a, D, L>,
    body_force: BodyForce<D>,
    traction: Traction<D>,
    carried_over: CarriedOver<'a, D>,
    pressure: Pressure<'a, D>,
}

/// Implements [`Term`] for a dead load f on the nodes: the term −f, with the energy −f·Δφ and no tangent. The last argument is its
/// [`Role`].
macro_rules! dead_load {
    ($load:ty, $name:literal, $role:ident) => {
        impl<const D: usize> Term<D> for $load {
            const NAME: &'static str = $name;
            const ROLE: Role = Role::$role;

            fn planned(given: Given<'_, D>) -> Vec<Reason> {
                Self::reasons(given)
            }

            fn add_at_nodes<T: Number>(&self, _: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
                out.iter_mut().zip(self.0.iter()).for_each(|(out, force)| *out -= force.map(T::lit));
            }

            fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
                let energy = |(force, dphi): (&Vector<f64, D>, &Vector<T, D>)| -force.map(T::lit).dot(dphi);
                Some(Ok(super::summed(self.0.iter().zip(dphi).map(energy))))
            }

            fn add_magnitudes_at_nodes(&self, _: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
                out.iter_mut().zip(self.0.iter()).for_each(|(out, force)| *out += force.abs());
            }
        }
    };
}

use dead_load;
