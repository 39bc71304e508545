//! Large strain between walls: a square or a cube whose walls are at rest, and near which the displacement is curved.

use super::Motion;
use bfree::scalar::Real;
use bfree::tensor::Vector;
use std::f64::consts::{E, PI};

/// u_i = A t Π_k w(X_k), w(x) = sin(πx) eˣ, in the unit square or cube; of u₂ the mirror image, x ↦ 1 − x.
///
/// u = 0 on all walls, and u″ there is as large as inside: a shape function that bends wrongly at a wall shows. Without inertia t is a
/// factor of the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// A, a length.
    pub amplitude: f64,
}

impl Block {
    /// J between 1 − c and 1 + c at t = 1, in `D` dimensions, for c = `change`: it is 1 ± A |w′(1)| max wᴰ⁻¹ where the others' w is largest.
    pub fn with_change<const D: usize>(change: f64) -> Self {
        let largest = PI / PI.hypot(1.0) * (1.0 - PI.atan() / PI).exp();
        Self { amplitude: change / (PI * E * largest.powi(D as i32 - 1)) }
    }
}

impl<const D: usize> Motion<D> for Block {
    fn displacement<T: Real>(&self, x: &Vector<T, D>, t: T) -> Vector<T, D> {
        let product = |mirrored: bool| {
            x.iter().fold(T::lit(self.amplitude) * t, |product, &x| {
                let x = if mirrored { T::one() - x } else { x };
                product * (T::lit(PI) * x).sin() * x.exp()
            })
        };
        Vector::from_fn(|i, _| product(i == 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manufactured::state;
    use bfree::tensor::Deformation;

    /// The least and the largest J on a lattice of places, and the largest displacement at walls.
    fn extremes<const D: usize>(parts: usize) -> (f64, f64, f64) {
        let block = Block::with_change::<D>(0.7);
        let places = (0..(parts + 1).pow(D as u32)).map(|code| {
            Vector::<f64, D>::from_fn(|k, _| (code / (parts + 1).pow(k as u32) % (parts + 1)) as f64 / parts as f64)
        });
        places.fold((f64::INFINITY, 0.0, 0.0), |(low, high, at_walls), x| {
            let state = state(&block, &x, 1.0);
            let jacobian = Deformation::new(state.displacement_gradient).jacobian;
            let moved = if x.iter().any(|&x| x == 0.0 || x == 1.0) { (state.position - x).amax() } else { 0.0 };
            (jacobian.min(low), jacobian.max(high), moved.max(at_walls))
        })
    }

    #[test]
    fn it_is_compressed_to_a_third_and_stretched_by_most_of_it_with_walls_at_rest() {
        for (low, high, at_walls) in [extremes::<2>(60), extremes::<3>(30)] {
            assert!((0.2999..0.31).contains(&low) && (1.69..1.7001).contains(&high), "{low} {high}");
            assert!(at_walls < 1e-16, "{at_walls:e}");
        }
    }
}
