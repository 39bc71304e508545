//! The linearised tangent in closed form, from a handful of numbers, for isotropic laws without internal variables.

use crate::scalar::{Arithmetic, Single};
use crate::tensor::{Tensor, Vector, identity, outer, scaled};

/// V₀ δP F_rᵀ = L B + κ (A:L) A − q A Lᵀ A + b L c, with L = Σ u ⊗ ∇_r N. B, b and c are symmetric.
///
/// `N` is a number, or a vector with one particle in each lane.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean};
/// use bfree::scalar::Single;
/// use bfree::tensor::{Tensor, identity};
///
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let at = MaterialState::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
/// let closed = law.closed(&identity(), &at, 1.0).ok_or("neo-Hooke has one")?;
/// // Column j of the block of e_k and e_l is the product with L = e_j ⊗ e_l, applied to e_k.
/// let (k, l, j) = (0, 1, 1);
/// let mut unit = [[0.0; 2]; 2];
/// unit[j][l] = 1.0;
/// let (product, block) = (closed.product(Single, &unit), closed.unit_block(Single, k, l));
/// for i in 0..2 {
///     assert!((product[i][k] - block[i][j]).abs() < 1e-15);
/// }
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
    pub both: Option<[[[N; D]; D]; 2]>,
}

impl<N: Copy, const D: usize> ClosedTangent<N, D> {
    /// V₀ δP F_rᵀ from L.
    #[inline(always)]
    pub fn product<A: Arithmetic<N = N>>(&self, with: A, l: &[[N; D]; D]) -> [[N; D]; D] {
        let (zero, a) = (with.zero(), &self.a);
        let mut contracted = zero;
        for i in 0..D {
            for k in 0..D {
                contracted = with.mul_add(a[i][k], l[i][k], contracted);
            }
        }
        let bulk = with.mul(self.bulk, contracted);
        let mut out = [[zero; D]; D];
        for i in 0..D {
            // q A Lᵀ, row i
            let mut q_a_lt = [zero; D];
            for k in 0..D {
                for j in 0..D {
                    q_a_lt[k] = with.mul_add(a[i][j], l[k][j], q_a_lt[k]);
                }
                q_a_lt[k] = with.mul(self.q, q_a_lt[k]);
            }
            for k in 0..D {
                let mut sum = with.mul(bulk, a[i][k]);
                for j in 0..D {
                    sum = with.mul_add(l[i][j], self.right[j][k], sum);
                    sum = with.mul_sub(q_a_lt[j], a[j][k], sum);
                    mutant!("laws: the closed product lacks q": { sum = with.mul_add(q_a_lt[j], a[j][k], sum); });
                }
                out[i][k] = sum;
            }
        }
        if let Some([b, c]) = &self.both {
            for i in 0..D {
                let mut b_l = [zero; D];
                for k in 0..D {
                    for j in 0..D {
                        b_l[k] = with.mul_add(b[i][j], l[j][k], b_l[k]);
                    }
                }
                for k in 0..D {
                    for j in 0..D {
                        out[i][k] = with.mul_add(b_l[j], c[j][k], out[i][k]);
                    }
                }
            }
        }
        out
    }

    /// The block of the unit gradients e_k and e_l: κ A e_k ⊗ A e_l − q A e_l ⊗ A e_k + B_kl I + c_kl b.
    #[inline(always)]
    pub fn unit_block<A: Arithmetic<N = N>>(&self, with: A, k: usize, l: usize) -> [[N; D]; D] {
        let a = &self.a;
        let mut block = [[with.zero(); D]; D];
        for i in 0..D {
            let (bulk_a, q_a) = (with.mul(self.bulk, a[i][k]), with.mul(self.q, a[i][l]));
            for j in 0..D {
                block[i][j] = with.mul_sub(q_a, a[j][k], with.mul(bulk_a, a[j][l]));
                if let Some([b, c]) = &self.both {
                    block[i][j] = with.mul_add(c[k][l], b[i][j], block[i][j]);
                }
            }
            block[i][i] = with.add(block[i][i], self.right[k][l]);
        }
        block
    }
}

/// A tensor by rows.
#[inline(always)]
pub(super) fn rows<const D: usize>(a: &Tensor<f64, D>) -> [[f64; D]; D] {
    a.transpose().data.0
}

/// A tensor from its rows.
#[inline(always)]
fn tensor<const D: usize>(a: &[[f64; D]; D]) -> Tensor<f64, D> {
    Tensor::from_fn(|i, k| a[i][k])
}

impl<const D: usize> ClosedTangent<f64, D> {
    /// V₀ δP F_rᵀ from L.
    ///
    /// Example: [`Law::closed`](super::Law::closed).
    pub fn apply(&self, l: &Tensor<f64, D>) -> Tensor<f64, D> {
        tensor(&self.product(Single, &rows(l)))
    }

    /// The block of two nodes with gradients ∇_r N_I and ∇_r N_J:
    /// κ g_I ⊗ g_J − q g_J ⊗ g_I + (∇N_I·B ∇N_J) I + (∇N_I·c ∇N_J) b,  g = A ∇_r N
    pub fn block(&self, grad_i: &Vector<f64, D>, grad_j: &Vector<f64, D>) -> Tensor<f64, D> {
        let a = tensor(&self.a);
        let (g_i, g_j) = (a * grad_i, a * grad_j);
        let block = scaled(&outer(&g_i, &g_j), self.bulk) - scaled(&outer(&g_j, &g_i), self.q)
            + scaled(&identity(), grad_i.dot(&(tensor(&self.right) * grad_j)));
        self.both.map_or(block, |[b, c]| block + scaled(&tensor(&b), grad_i.dot(&(tensor(&c) * grad_j))))
    }

    /// The geometric part L B alone, with B = V₀ F_r S F_rᵀ, if `geometric`; otherwise the rest.
    pub(crate) fn part(&self, b: &Tensor<f64, D>, geometric: bool) -> Self {
        if geometric {
            let nothing = [[0.0; D]; D];
            return Self { a: nothing, right: rows(b), bulk: 0.0, q: 0.0, both: self.both.map(|_| [nothing; 2]) };
        }
        Self { right: rows(&(tensor(&self.right) - b)), ..*self }
    }
}
