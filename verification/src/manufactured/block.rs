//! Large strain between walls: a square or a cube whose walls are at rest.

use super::Motion;
use bfree::scalar::Real;
use bfree::tensor::Vector;
use std::f64::consts::{E, PI};

/// u_i = A t Π_k w(X_k), w(x) = sin(πx) e^{sx}, in the unit square or cube; u₂ takes the mirror image, x ↦ 1 − x. u = 0 on all walls.
/// Without inertia t is a factor of the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// A, a length.
    pub amplitude: f64,
    /// s; for s = 0, u is odd about every wall.
    pub skew: f64,
}

impl Block {
    /// u″ at the walls is as large as inside, so a shape function with wrong curvature there shows. J is between 1 − c and 1 + c at t = 1,
    /// in `D` dimensions, for c = `change`. It takes both values at a wall: it is 1 ± A |w′(1)| max wᴰ⁻¹ there.
    pub fn curved_at_walls<const D: usize>(change: f64) -> Self {
        let largest = PI / PI.hypot(1.0) * (1.0 - PI.atan() / PI).exp();
        Self { amplitude: change / (PI * E * largest.powi(D as i32 - 1)), skew: 1.0 }
    }

    /// u″ = 0 at the walls, which hides the behaviour of the shape functions there. J has the same range; it takes the extreme values
    /// inside, where all cos² πx are 1/D.
    pub fn straight_at_walls<const D: usize>(change: f64) -> Self {
        let others = D as f64 - 1.0;
        let slope = PI * (others + 1.0).sqrt() * (others / (others + 1.0)).powf(0.5 * others);
        Self { amplitude: change / slope, skew: 0.0 }
    }
}

impl<const D: usize> Motion<D> for Block {
    fn displacement<T: Real>(&self, x: &Vector<T, D>, t: T) -> Vector<T, D> {
        let product = |mirrored: bool| {
            x.iter().fold(T::lit(self.amplitude) * t, |product, &x| {
                let x = if mirrored { T::one() - x } else { x };
                product * (T::lit(PI) * x).sin() * (T::lit(self.skew) * x).exp()
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

    /// The least and the largest J on a lattice of points, and the largest displacement at walls.
    fn extremes<const D: usize>(block: Block, parts: usize) -> (f64, f64, f64) {
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
        for (low, high, at_walls) in [
            extremes::<2>(Block::curved_at_walls::<2>(0.7), 60),
            extremes::<3>(Block::curved_at_walls::<3>(0.7), 30),
            extremes::<2>(Block::straight_at_walls::<2>(0.7), 60),
            extremes::<3>(Block::straight_at_walls::<3>(0.7), 30),
        ] {
            assert!((0.2999..0.31).contains(&low) && (1.69..1.7001).contains(&high), "{low} {high}");
            assert!(at_walls < 1e-15, "{at_walls:e}");
        }
    }
}
