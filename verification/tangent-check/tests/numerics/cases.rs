//! Seeded states of the laws, as functions of a perturbation in one column.

use crate::laws::*;
use crate::tensor::*;
use tangent_check::matrix::Matrix;

/// A state of a law.
pub struct Case {
    /// The law.
    pub law: &'static str,
    /// The distance to a kink, relative to the size of the elastic domain; `None` if it was not chosen.
    pub kink: Option<f64>,
    /// The response.
    pub value: Vec<f64>,
    /// The consistent tangent.
    pub claimed: Matrix,
    /// The response with column k perturbed by h.
    pub respond: Box<dyn Fn(usize, f64) -> Vec<f64>>,
}

/// The names of the consistent laws.
pub const LAWS: [&str; 10] = [
    "neo-Hookean, exp(h B) F",
    "neo-Hookean, P(F)",
    "St. Venant-Kirchhoff, P(F)",
    "Ogden, P(F)",
    "Maxwell, P(F)",
    "J2 Voce, small strain",
    "J2 Voce, P(F)",
    "Drucker-Prager, small strain",
    "Drucker-Prager, P(F)",
    "Drucker-Prager apex, small strain",
];

/// State number `number` of a law.
pub fn case(law: &'static str, number: usize) -> Case {
    let index = LAWS.iter().position(|name| *name == law).unwrap_or(LAWS.len());
    let mut random = Random(1 + 1000 * index as u64 + 7_000_003 * number as u64);
    // A third of the states of plastic laws lie next to a kink.
    let kink = number
        .is_multiple_of(3)
        .then(|| random.logarithmic(1e-12, 1e-2) * if number.is_multiple_of(2) { 1.0 } else { -1.0 });
    match law {
        "neo-Hookean, exp(h B) F" => kirchhoff(law, deformation(&mut random)),
        "neo-Hookean, P(F)" => neo_hookean(law, deformation(&mut random)),
        "St. Venant-Kirchhoff, P(F)" => piola(law, None, StVenantKirchhoff, deformation(&mut random)),
        "Ogden, P(F)" => piola(law, None, Ogden, deformation(&mut random)),
        "Maxwell, P(F)" => {
            let element = Maxwell {
                strain_before: combine(0.1, &random.symmetric(), 0.0, &I),
                overstress: combine(5.0, &random.unit_deviator(), 0.0, &I),
                time: random.logarithmic(1e-3, 10.0),
            };
            piola(law, None, element, deformation(&mut random))
        }
        "J2 Voce, small strain" | "J2 Voce, P(F)" => {
            let (yielding, strain) = voce(&mut random, kink, 0.0);
            driven(law, kink, yielding, &strain, &mut random)
        }
        _ => {
            let apex = law.contains("apex") || random.unit() < 0.3;
            let (cone, strain) = drucker_prager(&mut random, kink, apex);
            driven(law, kink, cone, &strain, &mut random)
        }
    }
}

fn driven(
    law: &'static str,
    kink: Option<f64>,
    material: impl Law + 'static,
    strain: &T2,
    random: &mut Random,
) -> Case {
    if law.contains("small") {
        return small_strain(law, kink, material, *strain);
    }
    // F = R U with U² = I + 2 E
    let stretch = isotropic(&combine(2.0, strain, 1.0, &I), f64::sqrt);
    piola(law, kink, material, product(&random.rotation(), &stretch))
}

/// A deformation from small to large strain, with a rotation.
fn deformation(random: &mut Random) -> T2 {
    let size = random.logarithmic(1e-3, 0.4);
    product(&random.rotation(), &combine(size, &random.symmetric(), 1.0, &I))
}

/// J2 plasticity after some plastic strain, with a strain inside or outside the elastic domain.
pub fn voce(random: &mut Random, kink: Option<f64>, tolerance: f64) -> (Voce, T2) {
    let alpha = random.between(0.0, 0.1);
    let law = Voce { plastic_strain: combine(alpha, &random.unit_deviator(), 0.0, &I), alpha, tolerance };
    let overload = kink.map_or_else(|| random.logarithmic(0.5, 30.0), |distance| 1.0 + distance);
    let length = overload * law.radius() / (2.0 * SHEAR);
    let elastic = combine(length, &random.unit_deviator(), random.between(-0.02, 0.02), &I);
    let strain = combine(1.0, &law.plastic_strain, 1.0, &elastic);
    (law, strain)
}

/// Drucker and Prager's law near the yield surface, or near the border between cone and apex.
fn drucker_prager(random: &mut Random, kink: Option<f64>, apex: bool) -> (DruckerPrager, T2) {
    let (eta, eta_bar, xi) = DruckerPrager::CONE;
    let alpha = random.between(0.0, 0.1);
    let law = DruckerPrager { plastic_strain: combine(0.02, &random.symmetric(), 0.0, &I), alpha };
    let (root_j2, pressure) = if apex {
        let gamma = random.logarithmic(1e-4, 3e-2);
        let pressure = xi / eta * DruckerPrager::cohesion(alpha + xi * gamma).0 + BULK * eta_bar * gamma;
        (SHEAR * gamma * kink.map_or_else(|| random.between(0.1, 2.0), |distance| 1.0 + distance), pressure)
    } else {
        let pressure = -random.logarithmic(0.01, 3.0);
        let surface = xi * DruckerPrager::cohesion(alpha).0 - eta * pressure;
        (surface * kink.map_or_else(|| random.logarithmic(0.5, 10.0), |distance| 1.0 + distance), pressure)
    };
    let length = root_j2 / (2.0_f64.sqrt() * SHEAR);
    let elastic = combine(length, &random.unit_deviator(), pressure / (3.0 * BULK), &I);
    let strain = combine(1.0, &law.plastic_strain, 1.0, &elastic);
    (law, strain)
}

/// σ(ε) with engineering shears: 6 × 6.
pub fn small_strain(law: &'static str, kink: Option<f64>, material: impl Law + 'static, strain: T2) -> Case {
    let (stress, tangent) = material.respond(&strain);
    let mut claimed = Matrix::zeros(6, 6);
    for (row, (i, j)) in PAIRS.into_iter().enumerate() {
        for (column, (k, l)) in PAIRS.into_iter().enumerate() {
            claimed[(row, column)] = tangent[i][j][k][l];
        }
    }
    let respond = move |column: usize, h: f64| {
        let (k, l) = PAIRS[column];
        let mut strain = strain;
        strain[k][l] += 0.5 * h;
        strain[l][k] += 0.5 * h;
        PAIRS.map(|(i, j)| material.respond(&strain).0[i][j]).to_vec()
    };
    Case { law, kink, value: PAIRS.map(|(i, j)| stress[i][j]).to_vec(), claimed, respond: Box::new(respond) }
}

/// P(F) = F S(E) and ∂P_iJ/∂F_kN = δ_ik S_NJ + F_iI C_IJMN F_kM: 9 × 9.
fn piola(law: &'static str, kink: Option<f64>, material: impl Law + 'static, f: T2) -> Case {
    let green = |f: &T2| combine(0.5, &product(&transpose(f), f), -0.5, &I);
    let (s, c) = material.respond(&green(&f));
    let mut claimed = Matrix::zeros(9, 9);
    for row in 0..9 {
        for column in 0..9 {
            let [(i, j), (k, n)] = [(row / 3, row % 3), (column / 3, column % 3)];
            let material: f64 = (0..9).map(|m| f[i][m / 3] * c[m / 3][j][m % 3][n] * f[k][m % 3]).sum();
            claimed[(row, column)] = I[i][k] * s[n][j] + material;
        }
    }
    let piola = move |f: &T2| product(f, &material.respond(&green(f)).0).concat();
    let value = piola(&f);
    let respond = move |column: usize, h: f64| {
        let mut f = f;
        f[column / 3][column % 3] += h;
        piola(&f)
    };
    Case { law, kink, value, claimed, respond: Box::new(respond) }
}

/// P = G (F − F⁻ᵀ) + Λ ln J F⁻ᵀ: 9 × 9.
fn neo_hookean(law: &'static str, f: T2) -> Case {
    let lambda = BULK - 2.0 / 3.0 * SHEAR;
    let piola = move |f: &T2| {
        let inverse = inverse(f);
        let factor = lambda * determinant(f).ln() - SHEAR;
        tensor(|i, j| SHEAR * f[i][j] + factor * inverse[j][i]).concat()
    };
    let (inverse, factor) = (inverse(&f), SHEAR - lambda * determinant(&f).ln());
    let mut claimed = Matrix::zeros(9, 9);
    for row in 0..9 {
        for column in 0..9 {
            let [(i, j), (k, l)] = [(row / 3, row % 3), (column / 3, column % 3)];
            claimed[(row, column)] = SHEAR * I[i][k] * I[j][l]
                + factor * inverse[j][k] * inverse[l][i]
                + lambda * inverse[j][i] * inverse[l][k];
        }
    }
    let respond = move |column: usize, h: f64| {
        let mut f = f;
        f[column / 3][column % 3] += h;
        piola(&f)
    };
    Case { law, kink: None, value: piola(&f), claimed, respond: Box::new(respond) }
}

/// exp(h B) F for B = ½ (e_k ⊗ e_l + e_l ⊗ e_k).
pub fn stretched(f: &T2, column: usize, h: f64) -> T2 {
    let (k, l) = PAIRS[column];
    let mut exponential = I;
    if k == l {
        exponential[k][k] = h.exp();
    } else {
        let half = 0.5 * h;
        (exponential[k][k], exponential[l][l]) = (half.cosh(), half.cosh());
        (exponential[k][l], exponential[l][k]) = (half.sinh(), half.sinh());
    }
    product(&exponential, f)
}

/// τ = G (b − I) + Λ ln J I along exp(h B) F: dτ = c:B + B τ + τ B, 6 × 6.
fn kirchhoff(law: &'static str, f: T2) -> Case {
    let lambda = BULK - 2.0 / 3.0 * SHEAR;
    let tau = move |f: &T2| {
        let b = product(f, &transpose(f));
        combine(SHEAR, &b, lambda * determinant(f).ln() - SHEAR, &I)
    };
    let (value, shear) = (tau(&f), SHEAR - lambda * determinant(&f).ln());
    let mut claimed = Matrix::zeros(6, 6);
    for (column, (k, l)) in PAIRS.into_iter().enumerate() {
        let b = tensor(|i, j| symmetric_identity(i, j, k, l));
        let [left, right] = [product(&b, &value), product(&value, &b)];
        for (row, (i, j)) in PAIRS.into_iter().enumerate() {
            claimed[(row, column)] = lambda * I[i][j] * I[k][l] + 2.0 * shear * b[i][j] + left[i][j] + right[i][j];
        }
    }
    let respond = move |column: usize, h: f64| {
        let tau = tau(&stretched(&f, column, h));
        PAIRS.map(|(i, j)| tau[i][j]).to_vec()
    };
    Case { law, kink: None, value: PAIRS.map(|(i, j)| value[i][j]).to_vec(), claimed, respond: Box::new(respond) }
}

/// The same law computed in single precision. Its claimed tangent is computed in double precision.
pub fn single(number: usize) -> Case {
    let f = deformation(&mut Random(5 + 31 * number as u64));
    let case = kirchhoff("single precision", f);
    let tau = move |f: &T2| {
        let f: Vec<f32> = f.concat().into_iter().map(|entry| entry as f32).collect();
        let b = |i: usize, j: usize| (0..3).map(|k| f[3 * i + k] * f[3 * j + k]).sum::<f32>();
        let minor = |i: usize, j: usize| f[3 + i] * f[6 + j] - f[3 + j] * f[6 + i];
        let log_j = (f[0] * minor(1, 2) - f[1] * minor(0, 2) + f[2] * minor(0, 1)).ln();
        let volume = (BULK - 2.0 / 3.0 * SHEAR) as f32 * log_j - SHEAR as f32;
        PAIRS.map(|(i, j)| f64::from(SHEAR as f32 * b(i, j) + if i == j { volume } else { 0.0 })).to_vec()
    };
    Case { value: tau(&f), respond: Box::new(move |column, h| tau(&stretched(&f, column, h))), ..case }
}
