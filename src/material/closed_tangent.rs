//! The linearised tangent in closed form, from a handful of numbers, for isotropic laws without internal variables.

use crate::lanes::Lane;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, identity, outer, scaled};

/// V₀ δP F_rᵀ = L B + κ (A:L) A − q A Lᵀ A + b L c, with L = Σ u ⊗ ∇_r N. B, b and c are symmetric.
///
/// `N` is a number, or a vector with one particle in each lane.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean};
/// use bfree::tensor::{Tensor, Vector, identity};
///
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let at = MaterialState::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
/// let closed = law.closed(&identity(), &at, 1.0).ok_or("neo-Hooke has one")?;
/// // Column j of the block of e_k and e_l is the product with L = e_j ⊗ e_l, applied to e_k.
/// let [e_k, e_l, e_j] = [Vector::from([1.0, 0.0]), Vector::from([0.0, 1.0]), Vector::from([0.0, 1.0])];
/// let (product, block) = (closed.apply(&(e_j * e_l.transpose())), closed.block(&e_k, &e_l));
/// assert!((product * e_k - block * e_j).norm() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ClosedTangent<N, const D: usize> {
    /// A: ΔF⁻ᵀ for the neo-Hookean solids, F F_rᵀ for the St. Venant–Kirchhoff solid.
    pub a: [[N; D]; D],
    /// B, times V₀.
    pub right: [[N; D]; D],
    /// κ, times V₀.
    pub bulk: N,
    /// q, times V₀.
    pub q: N,
    /// b and V₀ c, for laws with this term. A law has it at every state, or at none.
    pub factors: Option<[[[N; D]; D]; 2]>,
}

impl<N, const D: usize> ClosedTangent<N, D> {
    /// V₀ δP F_rᵀ from L.
    #[inline(always)]
    pub(crate) fn product(&self, l: &[[N; D]; D]) -> [[N; D]; D]
    where
        N: Lane,
    {
        let (zero, a) = (self.q.constant(0.0), &self.a);
        let mut contracted = zero;
        for i in 0..D {
            for k in 0..D {
                contracted = contracted.add_product(a[i][k], l[i][k]);
            }
        }
        let bulk = self.bulk * contracted;
        let mut out = [[zero; D]; D];
        for i in 0..D {
            // q A Lᵀ, row i
            let mut q_a_lt = [zero; D];
            for k in 0..D {
                for j in 0..D {
                    q_a_lt[k] = q_a_lt[k].add_product(a[i][j], l[k][j]);
                }
                q_a_lt[k] = self.q * q_a_lt[k];
            }
            for k in 0..D {
                let mut sum = bulk * a[i][k];
                for j in 0..D {
                    sum = sum.add_product(l[i][j], self.right[j][k]);
                    sum = sum.sub_product(q_a_lt[j], a[j][k]);
                    mutant!("laws: the closed product lacks q": { sum = sum.add_product(q_a_lt[j], a[j][k]); });
                }
                out[i][k] = sum;
            }
        }
        if let Some([b, c]) = &self.factors {
            for i in 0..D {
                let mut b_l = [zero; D];
                for k in 0..D {
                    for j in 0..D {
                        b_l[k] = b_l[k].add_product(b[i][j], l[j][k]);
                    }
                }
                for k in 0..D {
                    for j in 0..D {
                        out[i][k] = out[i][k].add_product(b_l[j], c[j][k]);
                    }
                }
            }
        }
        out
    }

    /// The block of the unit gradients e_k and e_l: κ A e_k ⊗ A e_l − q A e_l ⊗ A e_k + B_kl I + c_kl b.
    #[inline(always)]
    pub(crate) fn unit_block(&self, k: usize, l: usize) -> [[N; D]; D]
    where
        N: Lane,
    {
        let a = &self.a;
        let mut block = [[self.q.constant(0.0); D]; D];
        for i in 0..D {
            let (bulk_a, q_a) = (self.bulk * a[i][k], self.q * a[i][l]);
            for j in 0..D {
                block[i][j] = (bulk_a * a[j][l]).sub_product(q_a, a[j][k]);
                if let Some([b, c]) = &self.factors {
                    block[i][j] = block[i][j].add_product(c[k][l], b[i][j]);
                }
            }
            block[i][i] = block[i][i] + self.right[k][l];
        }
        block
    }
}

/// A tensor by rows.
#[inline(always)]
pub(super) fn rows<T: Real, const D: usize>(a: &Tensor<T, D>) -> [[T; D]; D] {
    a.transpose().data.0
}

/// A tensor from its rows.
#[inline(always)]
pub(super) fn tensor<const D: usize>(a: &[[f64; D]; D]) -> Tensor<f64, D> {
    Tensor::from_fn(|i, k| a[i][k])
}

impl<const D: usize> ClosedTangent<f64, D> {
    /// V₀ δP F_rᵀ from L.
    ///
    /// Example: [`Law::closed`](super::Law::closed).
    pub fn apply(&self, l: &Tensor<f64, D>) -> Tensor<f64, D> {
        tensor(&self.product(&rows(l)))
    }

    /// The block of two nodes with gradients ∇_r N_I and ∇_r N_J:
    /// κ g_I ⊗ g_J − q g_J ⊗ g_I + (∇N_I·B ∇N_J) I + (∇N_I·c ∇N_J) b,  g = A ∇_r N
    pub fn block(&self, grad_i: &Vector<f64, D>, grad_j: &Vector<f64, D>) -> Tensor<f64, D> {
        let a = tensor(&self.a);
        let (g_i, g_j) = (a * grad_i, a * grad_j);
        let block = scaled(&outer(&g_i, &g_j), self.bulk) - scaled(&outer(&g_j, &g_i), self.q)
            + scaled(&identity(), grad_i.dot(&(tensor(&self.right) * grad_j)));
        self.factors.map_or(block, |[b, c]| block + scaled(&tensor(&b), grad_i.dot(&(tensor(&c) * grad_j))))
    }

    /// The geometric part L B alone, with B = V₀ F_r S F_rᵀ, if `geometric`; otherwise the rest.
    pub(crate) fn part(&self, b: &Tensor<f64, D>, geometric: bool) -> Self {
        if geometric {
            let nothing = [[0.0; D]; D];
            return Self { a: nothing, right: rows(b), bulk: 0.0, q: 0.0, factors: self.factors.map(|_| [nothing; 2]) };
        }
        Self { right: rows(&(tensor(&self.right) - b)), ..*self }
    }
}
