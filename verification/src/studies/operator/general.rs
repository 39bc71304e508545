//! A law in the form a user writes it.

use bfree::material::{Elastic, Law, Material, Start};
use bfree::scalar::Real;
use bfree::tensor::{Deformation, Tensor, Vector};

/// A law without its closed form: the linearisation uses ℂmat, block by block.
#[derive(Clone, Debug)]
pub(super) struct General(pub Material);

impl Elastic for General {
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        self.0.energy(at, &Start::NONE)
    }

    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        self.0.stress(at, &Start::NONE)
    }

    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        self.0.elasticity(at, &Start::NONE, x)
    }

    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        self.0.tangent_density(at, &Start::NONE, v, b)
    }
}
