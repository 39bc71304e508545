//! The residual as a list of terms, one file each.
//!
//! A term acts at nodes, or at particles in the one pass that all terms share. A term gives
//!
//! - its value, for every number type;
//! - its energy, if it has a potential;
//! - the size that its round-off is relative to;
//! - its tangent, linearised at one φ, as data (`mechanics::linearized`).
//!
//! [`Equilibrium`](super::residual::Equilibrium) sums the terms of the list. Plans and checks go through the same list.

mod contact;
mod damping;
mod dead_load;
mod dilatation_of_step;
mod inertia;
mod mean_dilatation;
mod planned;
mod pressure;
mod stress;
mod term;

pub(crate) use contact::{ContactForce, penalties};
pub(crate) use planned::{Reason, planned};
pub(crate) use term::{AtPoints, Sum};
pub use term::{Piece, Role, Step};

use damping::Damping;
use dead_load::DeadLoad;
use dilatation_of_step::DilatationOfStep;
use inertia::Inertia;
use mean_dilatation::MeanDilatation;
use pressure::Pressure;
use stress::Stress;
use term::Term;

use crate::material::Law;
use crate::mechanics::constitutive::Part;
use crate::mechanics::dilatation::Cells;
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::linearized::{CellLayout, Linearized};
use crate::mechanics::sweep::{Mode, Number};
use crate::mechanics::trial::Trial;
use crate::tensor::Vector;

/// A term of any type.
pub(crate) enum AnyTerm<'a, const D: usize, L> {
    Inertia(Inertia<'a, D>),
    Stress(Stress<'a, D, L>),
    MeanDilatation(MeanDilatation<'a, D, L>),
    DilatationOfStep(DilatationOfStep<'a, D, L>),
    Damping(Damping<'a, D, L>),
    DeadLoad(DeadLoad<D>),
    Pressure(Pressure<'a, D>),
    ContactForce(ContactForce<'a, D, L>),
}

/// The value of an expression for a term of any type. A term has methods that are generic over the number type, so it cannot be `dyn`.
macro_rules! of_term {
    ($any:expr, $term:ident => $value:expr) => {
        match $any {
            AnyTerm::Inertia($term) => $value,
            AnyTerm::Stress($term) => $value,
            AnyTerm::MeanDilatation($term) => $value,
            AnyTerm::DilatationOfStep($term) => $value,
            AnyTerm::Damping($term) => $value,
            AnyTerm::DeadLoad($term) => $value,
            AnyTerm::Pressure($term) => $value,
            AnyTerm::ContactForce($term) => $value,
        }
    };
}

/// Numbers per particle in the linearised tangent of mean dilatation, also of the mean stress of a step.
pub(crate) const fn dilatation_rows(dimension: usize, discrete_gradient: bool) -> usize {
    if discrete_gradient { CellLayout::of_step(dimension).count } else { CellLayout::of_potential(dimension).count }
}

/// The terms of one step.
pub struct Terms<'a, const D: usize, L>(Vec<AnyTerm<'a, D, L>>);

impl<'a, const D: usize, L: Law> Terms<'a, D, L> {
    /// The terms that act in a step.
    pub(crate) fn of(step: &Step<'a, D, L>) -> Self {
        let terms = [
            Inertia::of(step).map(AnyTerm::Inertia),
            Some(AnyTerm::Stress(Stress::of(step))),
            MeanDilatation::of(step).map(AnyTerm::MeanDilatation),
            DilatationOfStep::of(step).map(AnyTerm::DilatationOfStep),
            Damping::of(step).map(AnyTerm::Damping),
            DeadLoad::body_force(step).map(AnyTerm::DeadLoad),
            DeadLoad::traction(step).map(AnyTerm::DeadLoad),
            DeadLoad::out_of_balance(step).map(AnyTerm::DeadLoad),
            Pressure::of(step).map(AnyTerm::Pressure),
            ContactForce::of(step).map(AnyTerm::ContactForce),
        ];
        Self(terms.into_iter().flatten().collect())
    }

    /// The terms in use, whole and by the parts that can be linearised alone.
    pub fn pieces(&self) -> Vec<Piece> {
        let mut pieces = Vec::new();
        for any in &self.0 {
            let (term, role, parts) = of_term!(any, one => (one.name(), one.role(), one.parts()));
            pieces.push(Piece { term, role, part: Part::Whole, name: term });
            pieces.extend(parts.iter().map(|&(part, name)| Piece { term, role, part, name }));
        }
        pieces
    }

    /// The terms that `picked` selects by name and role.
    fn picked(&self, picked: impl Fn(&str, Role) -> bool) -> impl Iterator<Item = &AnyTerm<'a, D, L>> {
        self.0.iter().filter(move |any| of_term!(any, term => picked(term.name(), term.role())))
    }

    /// Adds the contributions at the nodes of all terms that `picked` selects.
    pub(crate) fn add_at_nodes<T: Number>(
        &self,
        picked: impl Fn(&str, Role) -> bool,
        phi: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
    ) {
        self.picked(picked).for_each(|any| of_term!(any, term => term.add_at_nodes(phi, out)));
    }

    /// The contributions at the particles of all terms that `picked` selects.
    pub(crate) fn at_points<T: Number>(
        &self,
        picked: impl Fn(&str, Role) -> bool,
        part: Part,
        at: Trial<'_, T, D>,
    ) -> Vec<(Mode, AtPoints<'_, T, D>)> {
        self.picked(picked).filter_map(|any| of_term!(any, term => term.at_points(part, at))).collect()
    }

    /// Adds the contributions at the particles, or their magnitudes, of all terms that `picked` selects, if these terms run on the device.
    /// Returns whether the contributions were added. Otherwise `out` is unchanged.
    pub(crate) fn add_on_device(
        &self,
        picked: impl Fn(&str, Role) -> bool,
        magnitudes: bool,
        phi: &[f64],
        out: &mut [f64],
    ) -> bool {
        let (mut inertia, mut stress) = (None, None);
        for any in self.picked(picked) {
            match any {
                AnyTerm::Inertia(one) => inertia = Some(one),
                AnyTerm::Stress(one) => stress = Some(one),
                AnyTerm::MeanDilatation(_) | AnyTerm::DilatationOfStep(_) => return false,
                // These act at nodes.
                AnyTerm::Damping(_) | AnyTerm::DeadLoad(_) | AnyTerm::Pressure(_) | AnyTerm::ContactForce(_) => {}
            }
        }
        let inertia = inertia.filter(|_| !magnitudes);
        stress.is_some_and(|stress| stress.add_on_device(inertia, magnitudes, phi, out))
    }

    /// The sum of all energies; `None` if a term has no potential.
    pub(crate) fn energy<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let (mut sum, mut magnitude) = (T::zero(), 0.0);
        for any in &self.0 {
            match of_term!(any, term => term.energy(phi))? {
                Ok((value, size)) => {
                    sum += value;
                    magnitude += size;
                }
                Err(error) => return Some(Err(error)),
            }
        }
        Some(Ok((sum, magnitude)))
    }

    pub(crate) fn add_magnitudes_at_nodes(&self, phi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        self.0.iter().for_each(|any| of_term!(any, term => term.add_magnitudes_at_nodes(phi, out)));
    }

    pub(crate) fn add_sensitivity(
        &self,
        phi: &[Vector<f64, D>],
        out: &mut [Vector<f64, D>],
    ) -> Result<(), Inadmissible> {
        self.0.iter().try_for_each(|any| of_term!(any, term => term.add_sensitivity(phi, out)))
    }

    /// The cells with mean dilatation; `None` if there are none.
    pub(crate) fn averaged_cells(&self) -> Option<&Cells> {
        self.mean_dilatation().map(MeanDilatation::cells)
    }

    /// The residuals of the cells in the mixed form, if `picked` selects mean dilatation.
    pub(crate) fn cell_residuals<T: Number>(&self, picked: impl Fn(&str, Role) -> bool, at: Trial<'_, T, D>) -> Vec<T> {
        let mean = self.mean_dilatation().filter(|mean| picked(mean.name(), mean.role()));
        mean.map_or_else(Vec::new, |mean| mean.residuals(at))
    }

    /// The magnitudes of the contributions to the residuals of the cells.
    pub(crate) fn cell_magnitudes(&self) -> Vec<f64> {
        self.mean_dilatation().into_iter().flat_map(MeanDilatation::magnitudes).collect()
    }

    fn mean_dilatation(&self) -> Option<&MeanDilatation<'a, D, L>> {
        self.0.iter().find_map(|any| match any {
            AnyTerm::MeanDilatation(mean) => Some(mean),
            _ => None,
        })
    }

    /// Linearises all terms, or one piece.
    pub(crate) fn linearize(&self, piece: Option<Piece>, at: Trial<'_, f64, D>) -> Result<Linearized<D>, Inadmissible> {
        let part = piece.map_or(Part::Whole, |piece| piece.part);
        let mut linearized = Linearized::default();
        for any in self.picked(|name, _| piece.is_none_or(|piece| piece.term == name)) {
            of_term!(any, term => term.linearize(at, part, &mut linearized))?;
        }
        Ok(linearized)
    }
}
