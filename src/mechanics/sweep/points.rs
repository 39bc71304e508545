//! The points where shape functions are evaluated.

use super::fields::Fields;
use crate::approximation::ApproximationError;
use crate::parallel::Processes;
use crate::tensor::Vector;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The points where shape functions are evaluated.
#[derive(Clone, Debug, Default)]
pub struct Points<'a, const D: usize> {
    /// x of all particles.
    pub positions: Cow<'a, [Vector<f64, D>]>,
    /// Ids of the particles. Without them the index in memory is the id.
    pub ids: Option<&'a [u32]>,
    /// The points on a loaded surface, by their index in memory. They take the
    /// [functions of a surface](crate::approximation::Separable::at_surface), evaluated at x and continued linearly along each axis by
    /// this vector.
    pub extrapolation: BTreeMap<u32, Vector<f64, D>>,
    /// The nodal fields of the particles.
    pub fields: Fields<'a>,
    /// The processes that share the passes over the particles.
    pub processes: Processes,
}

impl<'a, const D: usize> Points<'a, D> {
    /// The particles at `positions`, none of which is on a loaded surface.
    pub fn at(positions: &'a [Vector<f64, D>]) -> Self {
        Self { positions: positions.into(), ..Self::default() }
    }

    /// The id of a particle, for messages.
    pub(super) fn id(&self, particle: usize) -> usize {
        self.ids.map_or(particle, |ids| ids[particle] as usize)
    }
}

/// The shape functions of a particle could not be evaluated.
#[derive(Clone, Debug, thiserror::Error)]
#[error("particle {particle} has no shape functions")]
pub struct ShapeFunctionError {
    /// Id of the particle; its index in memory where no ids are given.
    pub particle: usize,
    /// The error of the shape functions.
    pub source: ApproximationError,
}
