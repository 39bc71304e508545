//! Laws with planted mistakes. The mistakes are made by loops over indices or by definitions over dual numbers, not by conversions.

use super::dual::*;
use super::exact::{exact, unit_strain};
use super::shipped::{Flow, Formula, Inputs};
use tangent_check::convention::{Convention, Measure, Tensor, cauchy_stress, stress_vector};
use tangent_check::finding::Report;
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::{History, check_law, with_gradient};
use tangent_check::states::Path;
use tangent_check::tensor;

/// A law whose tangent has a mistake.
pub struct Planted<'a> {
    pub formula: &'a dyn Formula,
    pub convention: Convention,
    pub mistake: Mistake,
    /// F at the ends of steps. The tangent is computed for these, not for perturbed steps, to save time.
    pub asked: Vec<Tensor>,
}

/// A mistake in a tangent.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Mistake {
    None,
    /// Row r is that of component `order[r]`, and column likewise, where asked for.
    Order {
        order: [usize; 6],
        rows: bool,
        columns: bool,
    },
    /// The 9 components ij and ji exchanged.
    Indices {
        rows: bool,
        columns: bool,
    },
    Factors {
        rows: f64,
        columns: f64,
    },
    Block(f64),
    Transposed,
    Symmetrised,
    Rate(Measure),
    JacobianPower(i32),
    StepBefore,
    Elastic,
    /// In an infinitesimal step from the end of this one, forced to flow.
    Continuum,
    AtRest,
    Sign,
    Times(f64),
    /// A term a ⊗ b with a coefficient: I ⊗ I, σ ⊗ I, I ⊗ σ.
    Dyad {
        coefficient: f64,
        stress_left: bool,
        stress_right: bool,
    },
    /// dF S missing in ∂P/∂F.
    NoGeometric,
    /// The entries of a place are multiplied.
    Scaled(Place, f64),
    /// The entries below the diagonal are those above it.
    Copied,
    /// The block of normal by normal, or shear by shear, is transposed.
    BlockTransposed {
        shear: bool,
    },
    WholeNumbers,
    /// Q ℂ Qᵀ with Q = R or ΔR, or transposed.
    Turned {
        increment: bool,
        back: bool,
    },
    /// The term from one rate to another is too much.
    RateTerm(Measure, Measure),
    StartOfStep,
    // Outside of the list:
    DiagonalOnly,
    StateFactor,
    FingerTerm,
}

/// A place of a tangent.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Place {
    Entry,
    Row,
    Column,
    NormalShear,
    ShearNormal,
}

impl Place {
    fn holds(self, i: usize, j: usize) -> bool {
        match self {
            Self::Entry => (i, j) == (0, 1),
            Self::Row => i == 2,
            Self::Column => j == 3,
            Self::NormalShear => i < 3 && j >= 3,
            Self::ShearNormal => i >= 3 && j < 3,
        }
    }
}

/// The stress and the internal variables at the start of a step.
pub fn constants(step: &Step, convention: &Convention) -> (Tensor, Vec<f64>) {
    (cauchy_stress(convention, &step.stress, &step.gradient_before).unwrap(), step.state.clone())
}

/// The inputs of a step without derivatives.
pub fn plain(step: &Step, stress: &Tensor, state: &[f64]) -> Inputs {
    Inputs {
        gradient: constant(&step.gradient),
        gradient_before: constant(&step.gradient_before),
        strain_increment: constant(&step.strain_increment),
        rotation: constant(&step.rotation),
        length: step.length,
        stress: constant(stress),
        state: state.to_vec(),
    }
}

/// The right tangent.
pub fn right(formula: &dyn Formula, step: &Step, convention: &Convention, flow: Flow) -> Matrix {
    let (stress, state) = constants(step, convention);
    let state = &state[..formula.state_at_rest().len()];
    let alone = [Measure::CauchyByStrain, Measure::JaumannKirchhoff, Measure::JaumannCauchy];
    if !(formula.incremental() && alone.contains(&convention.measure)) {
        return exact_at(formula, step, convention, (&stress, state), flow);
    }
    let column = |k: usize| {
        let b = unit_strain(convention, k);
        let mut given = plain(step, &stress, state);
        given.strain_increment = dual(&step.strain_increment, &b);
        let (sigma, _) = formula.respond(&given, flow);
        let mut rate = slope(&sigma);
        if convention.measure == Measure::JaumannKirchhoff {
            rate = tensor::sum(&rate, tensor::trace(&b), &value(&sigma));
        }
        convention.stress.vector(&rate)
    };
    let columns: Vec<Vec<f64>> = (0..convention.strain.count()).map(column).collect();
    Matrix::from_columns(convention.stress.count(), &columns)
}

fn exact_at(formula: &dyn Formula, step: &Step, convention: &Convention, old: (&Tensor, &[f64]), flow: Flow) -> Matrix {
    struct Timed<'a>(&'a dyn Formula, f64, Flow);
    impl Formula for Timed<'_> {
        fn name(&self) -> &'static str {
            self.0.name()
        }
        fn respond(&self, inputs: &Inputs, _: Flow) -> (D3, Vec<f64>) {
            let timed = Inputs { length: self.1, state: inputs.state.clone(), ..*inputs };
            self.0.respond(&timed, self.2)
        }
    }
    exact(&Timed(formula, step.length, flow), convention, &step.gradient, &step.gradient_before, old)
}

/// The tangent of another rate; of a law of strain increments by loops, from that of the Jaumann rate of Kirchhoff's stress.
fn other_rate(formula: &dyn Formula, step: &Step, convention: &Convention, rate: Measure, sigma: &Tensor) -> Matrix {
    let other = Convention { measure: rate, ..convention.clone() };
    if !formula.incremental() {
        return right(formula, step, &other, Flow::Algorithmic);
    }
    let own = right(
        formula,
        step,
        &Convention { measure: Measure::JaumannKirchhoff, ..convention.clone() },
        Flow::Algorithmic,
    );
    let s = sigma;
    own.mapped(|row, column| {
        let (i, j) = convention.stress.pairs[row];
        let (k, l) = convention.strain.pairs[column];
        let d = |a: usize, b: usize| f64::from(u8::from(a == b));
        let lost = match rate {
            Measure::JaumannCauchy => s[i][j] * d(k, l),
            Measure::Truesdell => 0.5 * (d(i, k) * s[j][l] + d(i, l) * s[j][k] + d(j, k) * s[i][l] + d(j, l) * s[i][k]),
            Measure::GreenNaghdi => {
                let f = dual(&tensor::IDENTITY, &unit_strain(convention, column));
                let f = mul(&f, &constant(&step.gradient));
                let rotation = mul(&inv(&power(&mul(&f, &t(&f)), 0.5)), &f);
                let spin = tensor::product(&slope(&rotation), &tensor::transposed(&value(&rotation)));
                (0..3).map(|m| spin[i][m] * s[m][j] - s[i][m] * spin[m][j]).sum()
            }
            _ => 0.0,
        };
        own[(row, column)] - lost
    })
}

impl<'a> Planted<'a> {
    pub fn new(formula: &'a dyn Formula, mistake: Mistake, convention: &Convention) -> Self {
        Self { formula, convention: convention.clone(), mistake, asked: Vec::new() }
    }

    /// The check along paths.
    pub fn report(&mut self, paths: &[Path], seed: u64) -> Report {
        self.asked = paths.iter().flat_map(|path| path.gradients.clone()).collect();
        check_law(self, paths, seed)
    }

    /// Whether somebody looks at the tangent of this step.
    fn is_asked(&self, step: &Step) -> bool {
        let plain = || with_gradient(step, &step.gradient).map(|plain| plain.strain_increment);
        self.asked.contains(&step.gradient) && plain() == Some(step.strain_increment)
    }

    fn wrong(&self, step: &Step, sigma: &Tensor) -> Matrix {
        let convention = &self.convention;
        let own = right(self.formula, step, convention, Flow::Algorithmic);
        let c = |row: usize, column: usize| own[(row, column)];
        let shear = |side: &[(usize, usize)], k: usize| side[k].0 != side[k].1;
        let [rows, columns] = [&convention.stress.pairs, &convention.strain.pairs];
        let jacobian = tensor::determinant(&step.gradient);
        let swapped =
            |side: &[(usize, usize)], k: usize| side.iter().position(|p| *p == (side[k].1, side[k].0)).unwrap();
        match self.mistake {
            Mistake::None | Mistake::StepBefore => own,
            Mistake::Order { order, rows, columns } => {
                own.mapped(|i, j| c(if rows { order[i] } else { i }, if columns { order[j] } else { j }))
            }
            Mistake::Indices { rows: r, columns: k } => {
                own.mapped(|i, j| c(if r { swapped(rows, i) } else { i }, if k { swapped(columns, j) } else { j }))
            }
            Mistake::Factors { rows: r, columns: k } => own.mapped(|i, j| {
                c(i, j) * if shear(rows, i) { r } else { 1.0 } * if shear(columns, j) { k } else { 1.0 }
            }),
            Mistake::Block(x) => {
                own.mapped(|i, j| if shear(rows, i) && shear(columns, j) { x * c(i, j) } else { c(i, j) })
            }
            Mistake::Transposed => own.mapped(|i, j| c(j, i)),
            Mistake::Symmetrised => own.mapped(|i, j| 0.5 * (c(i, j) + c(j, i))),
            Mistake::Rate(rate) => other_rate(self.formula, step, convention, rate, sigma),
            Mistake::JacobianPower(n) => own.mapped(|i, j| jacobian.powi(n) * c(i, j)),
            Mistake::Elastic => right(self.formula, step, convention, Flow::Frozen),
            Mistake::Continuum => self.continuum(step, sigma),
            Mistake::AtRest => right(self.formula, &self.rest(), convention, Flow::Frozen),
            Mistake::Sign => own.mapped(|i, j| -c(i, j)),
            Mistake::Times(x) => own.mapped(|i, j| x * c(i, j)),
            Mistake::Dyad { coefficient, stress_left, stress_right } => {
                let left = |(i, j): (usize, usize)| if stress_left { sigma[i][j] } else { f64::from(u8::from(i == j)) };
                let right =
                    |(i, j): (usize, usize)| if stress_right { sigma[i][j] } else { f64::from(u8::from(i == j)) };
                own.mapped(|i, j| c(i, j) + coefficient * left(rows[i]) * right(columns[j]))
            }
            Mistake::NoGeometric => {
                let f = tensor::inverse(&step.gradient).unwrap();
                let s = tensor::scaled(jacobian, &tensor::product3(&f, sigma, &tensor::transposed(&f)));
                // ∂(F S)_iJ/∂F_kL without ∂S: δ_ik S_LJ.
                own.mapped(
                    |i, j| {
                        if rows[i].0 == columns[j].0 { c(i, j) - s[columns[j].1][rows[i].1] } else { c(i, j) }
                    },
                )
            }
            Mistake::DiagonalOnly => own.mapped(|i, j| if i == j { c(i, j) } else { 0.0 }),
            Mistake::StateFactor => own.mapped(|i, j| jacobian.powf(0.3) * c(i, j)),
            Mistake::FingerTerm => {
                let b = tensor::product(&step.gradient, &tensor::transposed(&step.gradient));
                let at = |(i, j): (usize, usize)| b[i][j];
                own.mapped(|i, j| c(i, j) + 0.2 * at(rows[i]) * at(columns[j]))
            }
            _ => self.wrong_in_part(step, sigma, &own),
        }
    }

    /// Mistakes in a part of the tangent, or in its place or time.
    fn wrong_in_part(&self, step: &Step, sigma: &Tensor, own: &Matrix) -> Matrix {
        let convention = &self.convention;
        let c = |row: usize, column: usize| own[(row, column)];
        let shear = |k: usize| convention.stress.pairs[k].0 != convention.stress.pairs[k].1;
        match self.mistake {
            Mistake::Scaled(place, factor) => own.mapped(|i, j| c(i, j) * if place.holds(i, j) { factor } else { 1.0 }),
            Mistake::Copied => own.mapped(|i, j| c(i.min(j), i.max(j))),
            Mistake::BlockTransposed { shear: kind } => {
                own.mapped(|i, j| if shear(i) == kind && shear(j) == kind { c(j, i) } else { c(i, j) })
            }
            Mistake::WholeNumbers => own.mapped(|i, j| c(i, j).trunc()),
            Mistake::Turned { increment, back } => {
                let rotation = if increment { step.rotation } else { tensor::polar(&step.gradient).unwrap().0 };
                self.turned(own, &if back { tensor::transposed(&rotation) } else { rotation })
            }
            Mistake::RateTerm(from, to) => {
                let [from, to] = [from, to].map(|rate| other_rate(self.formula, step, convention, rate, sigma));
                own.mapped(|i, j| c(i, j) + to[(i, j)] - from[(i, j)])
            }
            Mistake::StartOfStep => {
                let start = Step {
                    gradient: step.gradient_before,
                    strain_increment: tensor::ZERO,
                    rotation: tensor::IDENTITY,
                    length: 1e-10,
                    ..step.clone()
                };
                right(self.formula, &start, convention, Flow::Frozen)
            }
            _ => own.clone(),
        }
    }

    /// Q ℂ Qᵀ by four loops over indices.
    fn turned(&self, own: &Matrix, q: &Tensor) -> Matrix {
        let place = |i: usize, j: usize| {
            let pairs = &self.convention.stress.pairs;
            pairs.iter().position(|pair| *pair == (i, j) || *pair == (j, i)).unwrap()
        };
        own.mapped(|row, column| {
            let [(i, j), (k, l)] = [self.convention.stress.pairs[row], self.convention.strain.pairs[column]];
            let quadruples = (0..81).map(|n| (n / 27, n / 9 % 3, n / 3 % 3, n % 3));
            quadruples.map(|(a, b, c, d)| q[i][a] * q[j][b] * q[k][c] * q[l][d] * own[(place(a, b), place(c, d))]).sum()
        })
    }

    /// A step of no deformation at rest.
    fn rest(&self) -> Step {
        Step { length: 1e-10, ..History::at_rest(self).step_to(&tensor::IDENTITY, 1.0).unwrap() }
    }

    /// The tangent of a tiny step that goes on in the direction of this one.
    fn continuum(&self, step: &Step, sigma: &Tensor) -> Matrix {
        let (stress, state) = constants(step, &self.convention);
        let known = self.formula.state_at_rest().len();
        let (_, new) = self.formula.respond(&plain(step, &stress, &state[..known]), Flow::Algorithmic);
        if new.last() == state.get(known.wrapping_sub(1)) {
            return right(self.formula, step, &self.convention, Flow::Algorithmic);
        }
        // The least strain that flows surely, along the stress.
        let push = tensor::scaled(1e-13 / tensor::norm(sigma), sigma);
        let next = Step {
            stress: stress_vector(&self.convention, sigma, &step.gradient).unwrap(),
            state: new,
            gradient_before: step.gradient,
            length: 1e-10,
            ..step.clone()
        };
        let next = with_gradient(&next, &tensor::product(&tensor::exponential(&push), &step.gradient));
        right(self.formula, next.as_ref().unwrap_or(step), &self.convention, Flow::Algorithmic)
    }
}

impl Law for Planted<'_> {
    fn name(&self) -> String {
        self.formula.name().to_string()
    }

    fn convention(&self) -> Convention {
        self.convention.clone()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        let mut state = self.formula.state_at_rest();
        if self.mistake == Mistake::StepBefore {
            state.extend(vec![0.0; self.convention.stress.count() * self.convention.strain.count()]);
        }
        state
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let (stress, state) = constants(step, &self.convention);
        let known = self.formula.state_at_rest().len();
        let given = plain(step, &stress, &state[..known]);
        let (sigma, mut new) = self.formula.respond(&given, Flow::Algorithmic);
        let sigma = value(&sigma);
        let stress = stress_vector(&self.convention, &sigma, &step.gradient).map_err(|e| CallFailed(e.0))?;
        let zeros = Matrix::zeros(self.convention.stress.count(), self.convention.strain.count());
        let mut tangent = if self.is_asked(step) { self.wrong(step, &sigma) } else { zeros };
        if self.mistake == Mistake::StepBefore {
            new.extend(&tangent.entries);
            tangent.entries = state[known..].to_vec();
        }
        Ok(Response { stress, tangent, state: new })
    }
}
