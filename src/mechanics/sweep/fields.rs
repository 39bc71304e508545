//! Nodal fields: bodies of different fields share no unknowns, so that they can part.
//!
//! Every field has all nodes of the grid. Only nodes with N ≠ 0 or ∇N ≠ 0 at a particle of the field are active, so that several fields
//! cost something only where they overlap.

use crate::particles::Body;

/// The nodal field of each particle. By default all particles have one field.
#[derive(Clone, Debug, Default)]
pub struct Fields<'a> {
    /// The body of each particle; may be empty if all bodies have field 0.
    pub body: &'a [u32],
    /// The field of each body; empty if all bodies have field 0.
    pub of_body: Vec<u32>,
}

impl<'a> Fields<'a> {
    /// The fields of `bodies`, with the body of each particle.
    pub(crate) fn of<L>(bodies: &[Body<L>], body: &'a [u32]) -> Self {
        let of_body: Vec<u32> = bodies.iter().map(|body| body.field).collect();
        if of_body.iter().all(|field| *field == 0) { Self::default() } else { Self { body, of_body } }
    }

    /// The field of a particle.
    #[inline]
    pub(super) fn field(&self, particle: usize) -> u32 {
        if self.of_body.is_empty() { 0 } else { self.of_body[self.body[particle] as usize] }
    }
}
