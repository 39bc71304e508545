//! A term of the residual, and the data that terms are built from.

use crate::mechanics::constitutive::Part;
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::linearized::Linearized;
use crate::mechanics::loads::{Loads, Pose};
use crate::mechanics::mass::Mass;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{At, Connectivity, Group, Mode, Number};
use crate::mechanics::transfer::Nodal;
use crate::mechanics::trial::Trial;
use crate::particles::{Body, Particles};
use crate::tensor::Vector;

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
    pub connectivity: &'a Connectivity<D>,
    /// State at the nodes.
    pub nodal: &'a Nodal<D>,
    /// The relations of a and v to φ.
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
    pub(crate) fn mass(&self) -> Mass<'a, D> {
        let Self { particles, connectivity, nodal, lumping, .. } = *self;
        Mass { particles, connectivity, lumped: &nodal.mass, lumping }
    }
}

/// The contribution of a term at the particles of a group: adds q and σ to the last argument. The function is chosen once per pass.
pub type AtPoints<'a, T, const D: usize> =
    Box<dyn Fn(Group<'_>, &At<T, D, D>, &mut At<T, D, D>) -> Result<(), Inadmissible> + Sync + 'a>;

/// A sum, and the sum of the magnitudes of its contributions.
pub type Sum<T> = (T, f64);

/// The sum of energies, and the sum of their magnitudes.
pub(super) fn summed<T: Number>(energies: impl IntoIterator<Item = T>) -> Sum<T> {
    energies.into_iter().fold((T::zero(), 0.0), |(sum, size), energy| (sum + energy, size + energy.value().abs()))
}

/// A term of the residual R(φ).
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
    fn add_at_nodes<T: Number>(&self, _phi: &[Vector<T, D>], _out: &mut [Vector<T, D>]) {}

    /// The contribution at the particles. Its [`Mode`] says which of u and L it reads, and which of q and σ it writes. Only the
    /// occurrences of φ in `part` carry derivatives.
    fn at_points<T: Number>(&self, _part: Part, _at: Trial<'_, T, D>) -> Option<(Mode, AtPoints<'_, T, D>)> {
        None
    }

    /// The potential whose gradient is this term; `None` if there is none.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>>;

    /// Adds the magnitudes of the contributions of [`Self::add_at_nodes`].
    fn add_magnitudes_at_nodes(&self, _phi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) {}

    /// Adds the change of the residual when φ and the state are rounded, in units of eps.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn add_sensitivity(&self, _phi: &[Vector<f64, D>], _out: &mut [Vector<f64, D>]) -> Result<(), Inadmissible> {
        Ok(())
    }

    /// Linearises the term: adds its arrays to `into`. A dead load adds nothing.
    ///
    /// # Errors
    /// det F ≤ 0 somewhere.
    fn linearize(&self, _at: Trial<'_, f64, D>, _part: Part, _into: &mut Linearized<D>) -> Result<(), Inadmissible> {
        Ok(())
    }
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
