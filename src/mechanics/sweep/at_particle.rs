//! The results of a pass at the particles.

use crate::parallel::Message;
use nalgebra::SMatrix;
use num_dual::Dual64;

/// A result at one particle.
pub trait AtParticle: Copy + Send + Message {
    /// A value that fills an array before the results are written.
    fn blank() -> Self;
}

impl AtParticle for f64 {
    fn blank() -> Self {
        0.0
    }
}

impl AtParticle for Dual64 {
    fn blank() -> Self {
        Self::from_re(0.0)
    }
}

impl AtParticle for bool {
    fn blank() -> Self {
        false
    }
}

impl<T: nalgebra::Scalar + num_traits::Zero + Copy + Send + Message, const R: usize, const C: usize> AtParticle
    for SMatrix<T, R, C>
{
    fn blank() -> Self {
        Self::repeat(T::zero())
    }
}

impl<A: AtParticle, const N: usize> AtParticle for [A; N] {
    fn blank() -> Self {
        [A::blank(); N]
    }
}

impl<A: AtParticle, B: AtParticle> AtParticle for (A, B) {
    fn blank() -> Self {
        (A::blank(), B::blank())
    }
}

impl AtParticle for () {
    fn blank() -> Self {}
}
