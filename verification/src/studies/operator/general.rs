//! A law in the form a user writes it.

use bfree::material::{Law, Material, MaterialState};
use bfree::scalar::Real;
use bfree::tensor::{Tensor, Vector};

/// A law without its closed form: the linearisation uses ℂmat, block by block.
#[derive(Clone, Debug)]
pub(super) struct General(pub Material);

impl Law for General {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.0.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        self.0.stress(at)
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        self.0.elasticity(at, x)
    }

    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        self.0.tangent_density(at, v, b)
    }
}
