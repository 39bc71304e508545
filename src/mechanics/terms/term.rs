//! A term of the residual, its linearisation, and the data that terms are built from.

use crate::mechanics::constitutive::{Inadmissible, Part};
use crate::mechanics::dilatation::Scale;
use crate::mechanics::loads::{Loads, Pose};
use crate::mechanics::mass::Mass;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{At, Group, Mode, Number, Quadratic, Supports};
use crate::mechanics::transfer::Nodal;
use crate::mechanics::trial::Trial;
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
    /// The poses of all obstacles where they are known. Otherwise, free obstacles move so that forces on them are in balance.
    pub poses: Option<&'a [Pose<D>]>,
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

/// The direction of a product with a linearised term.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Along<'x, const D: usize> {
    /// A nodal field. If given, changes of the pressures of averaged cells take the place of those that the field causes.
    Field(&'x [Vector<f64, D>], Option<&'x [f64]>),
    /// The same gradient at all particles.
    Gradient(&'x Tensor<f64, D>),
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

/// The sum of energies, and the sum of their magnitudes.
pub(super) fn summed<T: Number>(energies: impl IntoIterator<Item = T>) -> Sum<T> {
    energies.into_iter().fold((T::zero(), 0.0), |(sum, size), energy| (sum + energy, size + energy.value().abs()))
}

/// The linearisation of a term: its addends; none for a dead load.
pub(crate) type LinearizedTerm<'a, const D: usize> = Result<Vec<Box<dyn Linearized<D> + 'a>>, Inadmissible>;

/// A term of the residual R(Δφ).
pub(crate) trait Term<const D: usize>: Sync {
    /// The name of the term in checks and reports.
    fn name(&self) -> &'static str;

    /// The parts of its tangent that can be linearised alone, with their names.
    fn parts(&self) -> &'static [(Part, &'static str)] {
        &[]
    }

    /// Where its work goes.
    fn role(&self) -> Role {
        Role::Stores
    }

    /// Adds the contribution at the nodes.
    fn add_at_nodes<T: Number>(&self, _dphi: &[Vector<T, D>], _out: &mut [Vector<T, D>]) {}

    /// The contribution at the particles. Its [`Mode`] says which of u and L it reads, and which of q and σ it writes. Only the
    /// occurrences of Δφ in `part` carry derivatives.
    fn at_points<T: Number>(&self, _part: Part, _at: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
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

    /// Linearises the term.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn linearize(&self, _at: Trial<'_, f64, D>, _part: Part) -> LinearizedTerm<'_, D> {
        Ok(Vec::new())
    }
}

/// A term linearised at one Δφ: the data that its product needs, and no more.
pub(crate) trait Linearized<const D: usize>: Sync {
    /// Adds the contribution to the product at the nodes.
    fn add_product_at_nodes(&self, _u: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) {}

    /// The contribution to a product at the particles, with its [`Mode`].
    fn product_at_points(&self, _along: Along<'_, D>) -> Option<(Mode, ProductAtPoints<'_, D>)> {
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

    /// The averaged cells whose dilatation is an unknown of its own.
    fn mixed(&self) -> Option<&dyn MixedCells<D>> {
        None
    }
}

/// The linearised equations of averaged cells whose dilatation is an unknown of its own.
pub(crate) trait MixedCells<const D: usize>: Sync {
    /// B u, the changes of the cells' volumes.
    fn volume_changes(&self, u: &[Vector<f64, D>]) -> Vec<f64>;

    /// B_c M B_cᵀ of every cell, for a block-diagonal M.
    fn softness(&self, functions: &FunctionsAt<'_, D>, inverse: &[Tensor<f64, D>]) -> Vec<f64>;

    /// The cells in their order.
    fn cells(&self) -> &[MixedCell<D>];
}

/// A cell at one trial state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MixedCell<const D: usize> {
    /// The nodal field of the cell.
    pub field: u32,
    /// The index of the cell in the grid.
    pub index: [u32; D],
    /// The centroid of the particles.
    pub centroid: Vector<f64, D>,
    /// v
    pub volume: f64,
    /// ∂v/∂(∇u)
    pub pull: Tensor<f64, D>,
    /// k = ∂π/∂v
    pub stiffness: f64,
    /// γ
    pub augmented: f64,
    /// The units of the unknown and of its residual.
    pub scale: Scale,
    /// V_c
    pub reference_volume: f64,
}

/// Where the work of a term goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
    /// Where the work of the term goes.
    pub role: Role,
    /// The part.
    pub part: Part,
    /// The name of the piece.
    pub name: &'static str,
}
