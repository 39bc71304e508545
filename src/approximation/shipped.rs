//! The list of families that vector lanes can evaluate.

use super::bspline::{Bspline, Cubic, Quadratic};
use super::gimp::Gimp;
use super::interior::{FURTHEST, InteriorVisitor};
use super::kernel::Kernel;
use super::linear::Linear;
use super::lme::Lme;

/// A shipped family, which vector lanes can evaluate.
#[derive(Clone, Copy, Debug)]
pub enum Shipped<'a> {
    /// See [`Linear`].
    Linear,
    /// See [`Gimp`].
    Gimp(&'a Gimp),
    /// See [`Bspline`].
    Bspline(Bspline),
    /// See [`Lme`].
    Lme(&'a Lme),
}

impl Shipped<'_> {
    /// The distance beyond which functions vanish, in units of the spacing; at most [`FURTHEST`] + 1. The functions of the cell's own nodes
    /// may reach further.
    pub(crate) fn radius(&self) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Gimp(gimp) => gimp.radius(),
            Self::Bspline(Bspline::Quadratic) => Quadratic.radius(),
            Self::Bspline(Bspline::Cubic) => Cubic.radius(),
            Self::Lme(lme) => lme.radius(),
        }
    }

    /// The distance from a node of a cell to the edges of supports in the cell, in units of the spacing; 0 for functions that do not end
    /// inside a cell, or that are cut off where they are small.
    pub(crate) fn edge(&self) -> f64 {
        match self {
            Self::Gimp(_) | Self::Bspline(_) => self.radius().fract(),
            Self::Linear | Self::Lme(_) => 0.0,
        }
    }

    /// Calls `visitor` with the concrete type of the functions, so that a loop over particles has no branch on the family.
    pub(crate) fn with(&self, visitor: impl InteriorVisitor) {
        match self {
            Self::Linear => visitor.visit::<0>(&Linear),
            Self::Gimp(gimp) => visitor.visit::<1>(*gimp),
            Self::Bspline(Bspline::Quadratic) => visitor.visit::<1>(&Quadratic),
            Self::Bspline(Bspline::Cubic) => visitor.visit::<1>(&Cubic),
            Self::Lme(lme) if lme.radius() <= 2.0 => visitor.visit::<1>(*lme),
            Self::Lme(lme) if lme.radius() <= 3.0 => visitor.visit::<2>(*lme),
            Self::Lme(lme) if lme.radius() <= 4.0 => visitor.visit::<3>(*lme),
            Self::Lme(lme) => visitor.visit::<FURTHEST>(*lme),
        }
    }
}
