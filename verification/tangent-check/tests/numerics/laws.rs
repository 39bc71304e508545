//! Laws with consistent tangents, written for these tests: stress and ∂stress/∂strain for a symmetric strain, internal variables fixed.

use crate::tensor::*;

/// Bulk and shear modulus of all laws.
pub const BULK: f64 = 170.0;
/// Shear modulus.
pub const SHEAR: f64 = 80.0;

/// A law S(E) with its tangent ∂S/∂E.
pub trait Law {
    /// S and ∂S/∂E.
    fn respond(&self, strain: &T2) -> (T2, T4);
}

fn elastic(bulk: f64, shear: f64) -> T4 {
    tensor4(|i, j, k, l| bulk * I[i][j] * I[k][l] + 2.0 * shear * deviatoric_identity(i, j, k, l))
}

fn elastic_stress(bulk: f64, shear: f64, strain: &T2) -> T2 {
    combine(bulk * trace(strain), &I, 2.0 * shear, &deviator(strain))
}

/// St. Venant–Kirchhoff: S = K tr E I + 2 G dev E.
pub struct StVenantKirchhoff;

impl Law for StVenantKirchhoff {
    fn respond(&self, strain: &T2) -> (T2, T4) {
        (elastic_stress(BULK, SHEAR, strain), elastic(BULK, SHEAR))
    }
}

/// Maxwell's element beside a spring, integrated exactly for a constant rate over the step.
pub struct Maxwell {
    /// Strain and overstress at the start of the step.
    pub strain_before: T2,
    /// The overstress.
    pub overstress: T2,
    /// Δt / τ.
    pub time: f64,
}

impl Law for Maxwell {
    fn respond(&self, strain: &T2) -> (T2, T4) {
        let shear = SHEAR * -(-self.time).exp_m1() / self.time;
        let change = deviator(&combine(1.0, strain, -1.0, &self.strain_before));
        let overstress = combine((-self.time).exp(), &self.overstress, 2.0 * shear, &change);
        let stress = combine(1.0, &elastic_stress(BULK, 0.3 * SHEAR, strain), 1.0, &overstress);
        let (spring, element) = (elastic(BULK, 0.3 * SHEAR), elastic(0.0, shear));
        (stress, tensor4(|i, j, k, l| spring[i][j][k][l] + element[i][j][k][l]))
    }
}

/// Ogden's law with two terms: W = Σ_p μ_p/α_p (Σ_a λ_a^α_p − α_p ln J) + Λ/2 ln² J.
pub struct Ogden;

const OGDEN: [(f64, f64); 2] = [(60.0, 2.6), (-15.0, -1.7)];
const LAMBDA: f64 = 110.0;

impl Law for Ogden {
    fn respond(&self, strain: &T2) -> (T2, T4) {
        // x_a = λ_a², s_a = (Σ_p μ_p (x_a^{α_p/2} − 1) + Λ ln J) / x_a
        let (x, n) = eigen(&combine(2.0, strain, 1.0, &I));
        let log_j = 0.5 * (x[0] * x[1] * x[2]).ln();
        let t = |a: usize| {
            OGDEN.iter().map(|(mu, alpha)| mu * (x[a].powf(0.5 * alpha) - 1.0)).sum::<f64>() + LAMBDA * log_j
        };
        let s: [f64; 3] = std::array::from_fn(|a| t(a) / x[a]);
        // 2 ∂s_a/∂x_b, and 2 (s_b − s_a)/(x_b − x_a) from divided differences without cancellation
        let slope = |a: usize, b: usize| {
            let own: f64 = OGDEN.iter().map(|(mu, alpha)| mu * 0.5 * alpha * x[a].powf(0.5 * alpha - 1.0)).sum();
            (if a == b { 2.0 * (own - s[a]) / x[a] } else { 0.0 }) + LAMBDA / (x[a] * x[b])
        };
        let secant = |a: usize, b: usize| {
            let gap = x[b] - x[a];
            let growth = (gap / x[a]).ln_1p();
            let quotient = |p: f64| x[a].powf(p) * if gap == 0.0 { p / x[a] } else { (p * growth).exp_m1() / gap };
            let constant: f64 = LAMBDA * log_j - OGDEN.iter().map(|(mu, _)| mu).sum::<f64>();
            2.0 * (OGDEN.iter().map(|(mu, alpha)| mu * quotient(0.5 * alpha - 1.0)).sum::<f64>()
                + constant * quotient(-1.0))
        };
        let stress = tensor(|i, j| (0..3).map(|a| s[a] * n[i][a] * n[j][a]).sum());
        let mut tangent = [[[[0.0; 3]; 3]; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                let (normal, shear) = (slope(a, b), if a == b { 0.0 } else { 0.5 * secant(a, b) });
                for (i, j, k, l) in quadruples() {
                    let mixed = n[k][a] * n[l][b] + n[k][b] * n[l][a];
                    tangent[i][j][k][l] +=
                        normal * n[i][a] * n[j][a] * n[k][b] * n[l][b] + shear * n[i][a] * n[j][b] * mixed;
                }
            }
        }
        (stress, tangent)
    }
}

fn quadruples() -> impl Iterator<Item = (usize, usize, usize, usize)> {
    (0..81).map(|m| (m / 27, m / 9 % 3, m / 3 % 3, m % 3))
}

/// J2 plasticity with Voce's hardening k(α) = σ₀ + h α + Q (1 − e^(−b α)), solved by a local Newton iteration.
pub struct Voce {
    /// The plastic strain at the start of the step.
    pub plastic_strain: T2,
    /// The equivalent plastic strain at the start of the step.
    pub alpha: f64,
    /// The iteration stops below this residual, over the radius; 0 for round-off.
    pub tolerance: f64,
}

impl Voce {
    const FIRST: f64 = 0.45;

    /// k(α) and k′(α).
    fn hardening(alpha: f64) -> (f64, f64) {
        let (q, b) = (0.265, 16.93);
        let decay = (-b * alpha).exp();
        (Self::FIRST + 0.13 * alpha + q * (1.0 - decay), 0.13 + q * b * decay)
    }

    /// The radius √⅔ k(α) of the elastic domain.
    pub fn radius(&self) -> f64 {
        (2.0_f64 / 3.0).sqrt() * Self::hardening(self.alpha).0
    }
}

impl Law for Voce {
    fn respond(&self, strain: &T2) -> (T2, T4) {
        let elastic_strain = combine(1.0, strain, -1.0, &self.plastic_strain);
        let trial = combine(2.0 * SHEAR, &deviator(&elastic_strain), 0.0, &I);
        let pressure = BULK * trace(&elastic_strain);
        let (size, radius) = (norm(&trial), self.radius());
        if size - radius <= self.tolerance * radius {
            return (combine(pressure, &I, 1.0, &trial), elastic(BULK, SHEAR));
        }
        // r(Δγ) = |s_trial| − 2 G Δγ − √⅔ k(α + √⅔ Δγ)
        let root = (2.0_f64 / 3.0).sqrt();
        let (mut gamma, mut best) = (0.0, f64::INFINITY);
        for _ in 0..50 {
            let (k, slope) = Self::hardening(self.alpha + root * gamma);
            let residual = size - 2.0 * SHEAR * gamma - root * k;
            if residual.abs() <= self.tolerance * radius || (self.tolerance == 0.0 && residual.abs() >= best) {
                break;
            }
            best = residual.abs();
            gamma += residual / (2.0 * SHEAR + 2.0 / 3.0 * slope);
        }
        let slope = Self::hardening(self.alpha + root * gamma).1;
        let theta = 1.0 - 2.0 * SHEAR * gamma / size;
        let theta_bar = 2.0 * SHEAR / (2.0 * SHEAR + 2.0 / 3.0 * slope) - (1.0 - theta);
        let n = combine(1.0 / size, &trial, 0.0, &I);
        let tangent = tensor4(|i, j, k, l| {
            BULK * I[i][j] * I[k][l]
                + 2.0 * SHEAR * (theta * deviatoric_identity(i, j, k, l) - theta_bar * n[i][j] * n[k][l])
        });
        (combine(pressure, &I, theta, &trial), tangent)
    }
}

/// Drucker and Prager's law with apex, without association, and with saturating cohesion; after de Souza Neto, Perić and Owen.
pub struct DruckerPrager {
    /// The plastic strain at the start of the step.
    pub plastic_strain: T2,
    /// The equivalent plastic strain at the start of the step.
    pub alpha: f64,
}

impl DruckerPrager {
    /// Friction η, dilatancy η̄ and ξ.
    pub const CONE: (f64, f64, f64) = (0.6, 0.35, 0.9);

    /// c(α) and c′(α).
    pub fn cohesion(alpha: f64) -> (f64, f64) {
        let (q, b) = (0.2, 11.0);
        let decay = (-b * alpha).exp();
        (0.3 + 0.05 * alpha + q * (1.0 - decay), 0.05 + q * b * decay)
    }

    /// The root of a decreasing, convex function that is positive at 0, by Newton's method to round-off.
    fn root(function: impl Fn(f64) -> (f64, f64)) -> f64 {
        let (mut x, mut best) = (0.0, f64::INFINITY);
        for _ in 0..60 {
            let (value, slope) = function(x);
            if value.abs() >= best || value == 0.0 {
                break;
            }
            best = value.abs();
            x -= value / slope;
        }
        x
    }
}

impl Law for DruckerPrager {
    fn respond(&self, strain: &T2) -> (T2, T4) {
        let (eta, eta_bar, xi) = Self::CONE;
        let elastic_strain = combine(1.0, strain, -1.0, &self.plastic_strain);
        let direction = deviator(&elastic_strain);
        let (length, pressure) = (norm(&direction), BULK * trace(&elastic_strain));
        let root_j2 = 2.0_f64.sqrt() * SHEAR * length;
        if root_j2 + eta * pressure - xi * Self::cohesion(self.alpha).0 <= 0.0 {
            return (elastic_stress(BULK, SHEAR, &elastic_strain), elastic(BULK, SHEAR));
        }
        // √J₂ − G Δγ + η (p − K η̄ Δγ) − ξ c(α + ξ Δγ) = 0
        let gamma = Self::root(|gamma| {
            let (c, slope) = Self::cohesion(self.alpha + xi * gamma);
            let stiffness = SHEAR + BULK * eta * eta_bar;
            (root_j2 + eta * pressure - stiffness * gamma - xi * c, -stiffness - xi * xi * slope)
        });
        if root_j2 - SHEAR * gamma >= 0.0 {
            let slope = Self::cohesion(self.alpha + xi * gamma).1;
            let a = 1.0 / (SHEAR + BULK * eta * eta_bar + xi * xi * slope);
            let share = gamma / (2.0_f64.sqrt() * length);
            let d = combine(1.0 / length, &direction, 0.0, &I);
            let tangent = tensor4(|i, j, k, l| {
                2.0 * SHEAR * (1.0 - share) * deviatoric_identity(i, j, k, l)
                    + 2.0 * SHEAR * (share - SHEAR * a) * d[i][j] * d[k][l]
                    - 2.0_f64.sqrt() * SHEAR * a * BULK * (eta * d[i][j] * I[k][l] + eta_bar * I[i][j] * d[k][l])
                    + BULK * (1.0 - BULK * eta * eta_bar * a) * I[i][j] * I[k][l]
            });
            let stress = combine(pressure - BULK * eta_bar * gamma, &I, 2.0 * SHEAR * (1.0 - share), &direction);
            return (stress, tangent);
        }
        // ξ/η c(α + ξ/η̄ Δε_v) − (p − K Δε_v) = 0
        let (along, across) = (xi / eta_bar, xi / eta);
        let volume = Self::root(|volume| {
            let (c, slope) = Self::cohesion(self.alpha + along * volume);
            (pressure - BULK * volume - across * c, -BULK - across * along * slope)
        });
        let slope = Self::cohesion(self.alpha + along * volume).1;
        let stiffness = BULK * (1.0 - BULK / (BULK + along * across * slope));
        (combine(pressure - BULK * volume, &I, 0.0, &I), tensor4(|i, j, k, l| stiffness * I[i][j] * I[k][l]))
    }
}
