//! 3×3 tensors for the laws of these tests.

/// A 3×3 tensor.
pub type T2 = [[f64; 3]; 3];

/// A tensor of fourth order.
pub type T4 = [[[[f64; 3]; 3]; 3]; 3];

/// The identity.
pub const I: T2 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The index pairs of a symmetric tensor, in Abaqus' order.
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// The tensor with the entries `entry(i, j)`.
pub fn tensor(entry: impl Fn(usize, usize) -> f64) -> T2 {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The fourth-order tensor with the entries `entry(i, j, k, l)`.
pub fn tensor4(entry: impl Fn(usize, usize, usize, usize) -> f64) -> T4 {
    std::array::from_fn(|i| std::array::from_fn(|j| tensor(|k, l| entry(i, j, k, l))))
}

/// A B.
pub fn product(a: &T2, b: &T2) -> T2 {
    tensor(|i, j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
}

/// Aᵀ.
pub fn transpose(a: &T2) -> T2 {
    tensor(|i, j| a[j][i])
}

/// tr A.
pub fn trace(a: &T2) -> f64 {
    a[0][0] + a[1][1] + a[2][2]
}

/// A − ⅓ tr A I.
pub fn deviator(a: &T2) -> T2 {
    let mean = trace(a) / 3.0;
    tensor(|i, j| a[i][j] - mean * I[i][j])
}

/// |A| = √(A:A).
pub fn norm(a: &T2) -> f64 {
    a.iter().flatten().map(|entry| entry * entry).sum::<f64>().sqrt()
}

/// a A + b B.
pub fn combine(a: f64, x: &T2, b: f64, y: &T2) -> T2 {
    tensor(|i, j| a * x[i][j] + b * y[i][j])
}

/// det A.
pub fn determinant(a: &T2) -> f64 {
    let minor = |i: usize, j: usize| a[1][i] * a[2][j] - a[1][j] * a[2][i];
    a[0][0] * minor(1, 2) - a[0][1] * minor(0, 2) + a[0][2] * minor(0, 1)
}

/// A⁻¹.
pub fn inverse(a: &T2) -> T2 {
    let determinant = determinant(a);
    tensor(|i, j| {
        let [r, s] = [(j + 1) % 3, (j + 2) % 3];
        let [p, q] = [(i + 1) % 3, (i + 2) % 3];
        (a[r][p] * a[s][q] - a[r][q] * a[s][p]) / determinant
    })
}

/// Half of δ_ik δ_jl + δ_il δ_jk: the identity on symmetric tensors.
pub fn symmetric_identity(i: usize, j: usize, k: usize, l: usize) -> f64 {
    0.5 * (I[i][k] * I[j][l] + I[i][l] * I[j][k])
}

/// The same less ⅓ δ_ij δ_kl: the projection on deviators.
pub fn deviatoric_identity(i: usize, j: usize, k: usize, l: usize) -> f64 {
    symmetric_identity(i, j, k, l) - I[i][j] * I[k][l] / 3.0
}

/// The eigenvalues of a symmetric tensor and its eigenvectors in columns, by Jacobi's rotations.
pub fn eigen(a: &T2) -> ([f64; 3], T2) {
    let mut a = *a;
    let mut vectors = I;
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let cosine = 1.0 / t.hypot(1.0);
            let sine = t * cosine;
            let mut rotation = I;
            (rotation[p][p], rotation[q][q], rotation[p][q], rotation[q][p]) = (cosine, cosine, sine, -sine);
            a = product(&transpose(&rotation), &product(&a, &rotation));
            (a[p][q], a[q][p]) = (0.0, 0.0);
            vectors = product(&vectors, &rotation);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], vectors)
}

/// The symmetric tensor Σ g(λ_a) N_a ⊗ N_a.
pub fn isotropic(a: &T2, g: impl Fn(f64) -> f64) -> T2 {
    let (values, n) = eigen(a);
    tensor(|i, j| (0..3).map(|k| g(values[k]) * n[i][k] * n[j][k]).sum())
}

/// Random numbers: SplitMix64.
pub struct Random(pub u64);

impl Random {
    /// A number in (0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A number between `low` and `high`, evenly in the logarithm.
    pub fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// A symmetric tensor with entries in (−1, 1).
    pub fn symmetric(&mut self) -> T2 {
        let a = self.any();
        combine(0.5, &a, 0.5, &transpose(&a))
    }

    /// A deviator of length 1.
    pub fn unit_deviator(&mut self) -> T2 {
        let a = deviator(&self.symmetric());
        combine(1.0 / norm(&a), &a, 0.0, &a)
    }

    /// A tensor with entries in (−1, 1).
    pub fn any(&mut self) -> T2 {
        let mut a = I;
        for entry in a.iter_mut().flatten() {
            *entry = self.between(-1.0, 1.0);
        }
        a
    }

    /// A rotation, from Cayley's transform (I − A)⁻¹(I + A).
    pub fn rotation(&mut self) -> T2 {
        let a = self.any();
        let skew = combine(1.0, &a, -1.0, &transpose(&a));
        product(&inverse(&combine(1.0, &I, -1.0, &skew)), &combine(1.0, &I, 1.0, &skew))
    }
}
