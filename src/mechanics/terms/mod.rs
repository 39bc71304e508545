//! The residual as a list of terms, a file each.
//!
//! A term acts at particles, in the one pass over them that all terms share, or at nodes. It gives its value, for every number; its energy,
//! if it has a potential; what round-off in it is relative to; and its tangent, frozen at one Δφ: product and diagonal blocks. What is in
//! the list is summed by [`Equilibrium`](super::residual::Equilibrium), and planned and checked without being named anywhere else.

mod body_force;
mod carried_over;
mod damping;
mod inertia;
mod mean_dilatation;
mod pressure;
mod stress;
mod traction;

pub use body_force::{BodyForce, ForceField};
pub use carried_over::CarriedOver;
pub use damping::{Damping, Rayleigh};
pub use inertia::Inertia;
pub use mean_dilatation::MeanDilatation;
pub(crate) use mean_dilatation::frozen_rows;
pub use pressure::Pressure;
pub use stress::Stress;
pub use traction::Traction;

use crate::material::Law;
use crate::mechanics::loads::Loads;
use crate::mechanics::mass::Mass;
use crate::mechanics::point::{Inadmissible, Part};
use crate::mechanics::schemes::{Alphas, Scheme};
use crate::mechanics::sweep::{At, Flow, Group, Laned, Number, Quadratic, Supports};
use crate::mechanics::transfer::Nodal;
use crate::mechanics::unknowns::Function;
use crate::particles::{Body, Particles};
use crate::tensor::{Deformation, Tensor, Vector};

/// What all terms of a step are made from.
#[derive(Debug)]
pub struct Step<'a, const D: usize, L> {
    /// The particles at the last converged step.
    pub particles: &'a Particles<D>,
    /// The bodies.
    pub bodies: &'a [Body<L>],
    /// What acts on them.
    pub loads: &'a Loads<D>,
    /// Shape functions at x_n.
    pub supports: &'a Supports<D>,
    /// State at the nodes.
    pub nodal: &'a Nodal<D>,
    /// How a and v follow from Δφ.
    pub alphas: Alphas,
    /// ε
    pub lumping: f64,
    /// When loads act.
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

impl<const D: usize, L: Law> Step<'_, D, L> {
    /// Λ + 2G of a body at rest, the stiffness of its first particle in uniaxial strain; 0 if it has none.
    pub fn modulus(&self, body: usize) -> f64 {
        let at_rest = Deformation::new(Tensor::<f64, D>::zeros());
        let along_x = Tensor::from_fn(|i, k| if (i, k) == (0, 0) { 1.0 } else { 0.0 });
        let first = self.particles.body.iter().position(|&of| of as usize == body);
        first.map_or(0.0, |p| {
            let start = self.particles.start(p, self.dt);
            self.bodies[body].law.elasticity(&at_rest, &start, &along_x)[(0, 0)].abs()
        })
    }
}

impl<'a, const D: usize, L> Step<'a, D, L> {
    /// The mass operator.
    pub fn mass(&self) -> Mass<'a, D> {
        let Self { particles, supports, nodal, lumping, .. } = *self;
        Mass { particles, supports, lumped: &nodal.mass, lumping }
    }

    /// The law of a particle.
    #[inline(always)]
    pub fn law(&self, p: usize) -> &'a L {
        &self.bodies[self.particles.body[p] as usize].law
    }
}

/// What a term does at the particles of a group, chosen once a pass: adds q and σ to the last argument.
pub type AtPoints<'a, T, const D: usize> =
    Box<dyn Fn(Group<'_>, &At<T, D, D>, &mut At<T, D, D>) -> Result<(), Inadmissible> + Sync + 'a>;

/// As [`AtPoints`], of a frozen tangent, which always exists.
pub type ProductAtPoints<'a, X, const D: usize> = Box<dyn Fn(Group<'_>, &At<X, D, D>, &mut At<X, D, D>) + Sync + 'a>;

/// The functions of all unknowns at a particle, by node.
pub(crate) type FunctionsAt<'a, const D: usize> = dyn Fn(usize) -> Vec<(usize, Function<D>)> + 'a;

/// Adds the quadratic form of a frozen tangent at the particles of a group.
pub type BlocksAtPoints<'a> = Box<dyn Fn(Group<'_>, &mut Quadratic) + Sync + 'a>;

/// The units of a tangent in single precision, which has none: K/s, with gradients in units of 1/h; 1 in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// s, a power of two near the largest entries of K.
    pub scale: f64,
    /// h
    pub length: f64,
}

impl Unit {
    /// Of double precision.
    pub const ONE: Self = Self { scale: 1.0, length: 1.0 };
}

/// A sum with the magnitude of its contributions.
pub type Sum<T> = (T, f64);

/// What a simulation gives a term, before any step: what a plan is made from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Given<'a, const D: usize> {
    pub loads: &'a Loads<D>,
    pub scheme: &'a dyn Scheme,
    /// ε
    pub lumping: f64,
    /// Whether a body averages its change of volume.
    pub averages: bool,
    /// Whether a grid may be made anew.
    pub renews: bool,
}

/// Whether a term, or a part of it, is there, and why: `(name, used, why)`.
pub(crate) type Reason = (&'static str, bool, String);
/// The sum of energies.
fn summed<T: Number>(energies: impl IntoIterator<Item = T>) -> Sum<T> {
    energies.into_iter().fold((T::zero(), 0.0), |(sum, size), energy| (sum + energy, size + energy.value().abs()))
}

/// What freezing a term comes to.
pub(crate) type Freezing<'a, X, const D: usize> = Result<Option<Box<dyn Frozen<X, D> + 'a>>, Inadmissible>;

/// A term of the residual R(Δφ).
pub(crate) trait Term<const D: usize>: Sync {
    /// As checks, plans and reports call it.
    const NAME: &'static str;
    /// The parts of its tangent that can be frozen alone, as they are called.
    const PARTS: &'static [(Part, &'static str)] = &[];
    /// Where its work goes.
    const ROLE: Role = Role::Stores;

    /// What a plan says of it.
    fn planned(given: Given<'_, D>) -> Vec<Reason>;

    /// Adds what acts at the nodes.
    fn add_at_nodes<T: Number>(&self, _dphi: &[Vector<T, D>], _out: &mut [Vector<T, D>]) {}

    /// What acts at the particles at Δφ, and what of u and L it reads and of q and σ it writes. Only the occurrences of Δφ in `part` carry derivatives.
    fn at_points<T: Number>(&self, _part: Part, _dphi: &[Vector<T, D>]) -> Option<(Flow, AtPoints<'_, T, D>)> {
        None
    }

    /// The potential whose gradient it is, if it has one.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>>;

    /// Adds the magnitudes of what [`Self::add_at_nodes`] sums up.
    fn add_magnitudes_at_nodes(&self, _dphi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) {}

    /// Adds what rounding Δφ and the state changes in the residual, in units of eps.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn add_sensitivity(&self, _dphi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        Ok(())
    }

    /// Its tangent frozen at Δφ; `None` of a dead load.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn freeze<X: Laned>(&self, _dphi: &[Vector<f64, D>], _part: Part, _unit: Unit) -> Freezing<'_, X, D> {
        Ok(None)
    }
}

/// The tangent of a term, frozen: what its product needs, and no more.
pub(crate) trait Frozen<X, const D: usize>: Sync {
    /// Adds what acts at the nodes.
    fn add_product_at_nodes(&self, _u: &[Vector<X, D>], _out: &mut [Vector<X, D>]) {}

    /// What acts at the particles in the product with `u`, and what it reads and writes; without `u`, where gradients are the same at all
    /// particles of a cell.
    fn product_at_points(&self, _u: Option<&[Vector<X, D>]>) -> Option<(Flow, ProductAtPoints<'_, X, D>)> {
        None
    }

    /// Adds to the diagonal blocks what nodes have for themselves.
    fn add_blocks_at_nodes(&self, _blocks: &mut [Tensor<f64, D>]) {}

    /// Adds to the diagonal blocks what is known by the functions of single particles.
    fn add_blocks_of_functions(&self, _functions: &FunctionsAt<'_, D>, _blocks: &mut [Tensor<f64, D>]) {}

    /// What adds to the diagonal blocks at the particles.
    fn blocks_at_points(&self) -> Option<BlocksAtPoints<'_>> {
        None
    }

    /// How many nodes further along an axis than shape functions its entries reach.
    fn reach(&self) -> u32 {
        0
    }
}

/// Where the work of a term goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Into kinetic or strain energy, and back.
    Stores,
    /// It comes from without.
    Loads,
    /// It is lost.
    Dissipates,
}

/// A term, or a part of one, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Piece {
    /// The term.
    pub term: &'static str,
    /// The part.
    pub part: Part,
    /// As it is called.
    pub name: &'static str,
}

/// Declares the list.
macro_rules! terms {
    ($($field:ident: $term:ty),* $(,)?) => {
        /// The terms of one step; those that a scene does not require are not there.
        pub struct Terms<'a, const D: usize, L> {
            $(#[doc = concat!("See [`", stringify!($term), "`].")] pub $field: Option<$term>),*
        }

        impl<'a, const D: usize, L: Law> Terms<'a, D, L> {
            /// The terms that act in a step.
            pub(crate) fn of(step: &Step<'a, D, L>) -> Self {
                Self { $($field: <$term>::of(step)),* }
            }

            /// What a plan says of all terms that there are.
            pub(crate) fn planned(given: Given<'_, D>) -> Vec<Reason> {
                [$(<$term as Term<D>>::planned(given)),*].concat()
            }

            /// The terms that are there, whole and by the parts that can be frozen alone.
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

            /// Adds what acts at the nodes, of all terms that `picked` takes.
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

            /// What acts at the particles, of all terms that `picked` takes.
            pub(crate) fn at_points<T: Number>(
                &self,
                picked: impl Fn(&str, Role) -> bool,
                part: Part,
                dphi: &[Vector<T, D>],
            ) -> Vec<(Flow, AtPoints<'_, T, D>)> {
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

            /// The tangents of all terms, or of one piece of them.
            pub(crate) fn freeze<X: Laned>(
                &self,
                piece: Option<Piece>,
                dphi: &[Vector<f64, D>],
                unit: Unit,
            ) -> Result<Vec<Box<dyn Frozen<X, D> + '_>>, Inadmissible> {
                let mut all = Vec::new();
                $(if let Some(term) = self.$field.as_ref().filter(|_| piece.is_none_or(|piece| piece.term == <$term as Term<D>>::NAME)) {
                    all.extend(term.freeze(dphi, piece.map_or(Part::Whole, |piece| piece.part), unit)?);
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

/// A dead load is a term by the force f that it puts on the nodes: −f, with the energy −f·Δφ and no tangent. The last word says where its
/// work goes.
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
