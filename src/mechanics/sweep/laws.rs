//! Laws in vector lanes: the particles of a group side by side.
//!
//! The formulas are those of one particle, called in a loop over the lanes. The shipped laws are arithmetic alone, and the compiler
//! turns the loop into vector instructions, with the same bits; their loops are compiled here, once. Any other law keeps a plain loop.
//! Which loop a body takes is chosen once a pass over the particles.

use super::kernel::Rows;
use super::lanes::{LANES, Lanes, Number, WithLanes};
use crate::material::{ClosedTangent, FrozenTangent, Law, LawVisitor, Material, NonPositiveJacobian};
use crate::mechanics::point::{Carry, Inadmissible, freeze, internal};
use crate::particles::{Body, Particles};
use crate::tensor::Tensor;

/// The laws of all particles, and the states they begin the step with.
pub struct Laws<'a, const D: usize, L> {
    /// The particles.
    pub particles: &'a Particles<D>,
    /// Their laws.
    pub bodies: &'a [Body<L>],
}

/// The particles of a group, a lane each; zero in the lanes behind them.
struct States<'a> {
    /// u, and ∇u by rows.
    rows: &'a Rows,
    /// H_n by rows.
    h_n: [[f64; LANES]; 9],
    /// V₀
    volume: [f64; LANES],
}

impl<'a> States<'a> {
    fn of<const D: usize>(particles: &Particles<D>, group: &[u32], rows: &'a Rows) -> Self {
        let mut states = Self { rows, h_n: [[0.0; LANES]; 9], volume: [0.0; LANES] };
        for (lane, &p) in group.iter().enumerate().take(LANES) {
            let h_n = &particles.displacement_gradient[p as usize];
            for i in 0..D {
                for k in 0..D {
                    states.h_n[i * D + k][lane] = h_n[(i, k)];
                }
            }
            states.volume[lane] = particles.volume[p as usize];
        }
        states
    }

    /// ∇u, H_n and V₀ of one particle.
    #[inline(always)]
    fn of_lane<const D: usize>(&self, lane: usize) -> (Tensor<f64, D>, Tensor<f64, D>, f64) {
        let gradient = Tensor::from_fn(|i, k| self.rows[D + i * D + k][lane]);
        (gradient, Tensor::from_fn(|i, k| self.h_n[i * D + k][lane]), self.volume[lane])
    }
}

/// V₀ F S F_nᵀ by rows, then det F.
type Stresses = [[f64; LANES]; 10];

/// The row of det F.
const DET_F: usize = 9;

/// The rows of a tangent (A, B, κ, q, then b and c), space for that of the inertia, then det F and the form.
pub(super) type Tangents = [[f64; LANES]; 32];

/// The row of det F behind a tangent.
const TANGENT_DET_F: usize = 30;

/// The row that tells the form of a tangent.
const FORM: usize = 31;
/// No closed form.
const NOT_CLOSED: f64 = 0.0;
/// A closed form without b and c.
const SIMPLE: f64 = 1.0;
/// A closed form with b and c.
const BOTH: f64 = 2.0;

/// The loop over the lanes of one law, which fills `ROWS` rows.
type Evaluate<'l, const ROWS: usize> = dyn Fn(&States<'_>, &mut [[f64; LANES]; ROWS]) + Sync + 'l;

/// For each body the loop of its law.
struct Chosen<'a, const ROWS: usize> {
    body: &'a [u32],
    loops: Vec<Box<Evaluate<'a, ROWS>>>,
}

impl<const ROWS: usize> Chosen<'_, ROWS> {
    /// Evaluates the laws that are in the group, and keeps the lanes of their particles.
    fn evaluate(&self, group: &[u32], states: &States<'_>, out: &mut [[f64; LANES]; ROWS]) {
        if let [only] = self.loops.as_slice() {
            return only(states, out);
        }
        let body = |lane: usize| self.body[group[lane] as usize];
        self.loops[body(0) as usize](states, out);
        for lane in 1..group.len() {
            if (0..lane).any(|before| body(before) == body(lane)) {
                continue;
            }
            let mut other = [[0.0; LANES]; ROWS];
            self.loops[body(lane) as usize](states, &mut other);
            for same in (lane..group.len()).filter(|&same| body(same) == body(lane)) {
                for (out, other) in out.iter_mut().zip(&other) {
                    out[same] = other[same];
                }
            }
        }
    }
}

impl<const D: usize, L: Law> Laws<'_, D, L> {
    /// What puts σ = V₀ F S F_nᵀ in the place of ∇u, a group at a time, for one pass; its error is the smallest particle of the group
    /// with det F ≤ 0.
    pub(super) fn stresses(&self) -> impl Fn(&[u32], &mut Rows) -> Result<(), Inadmissible> + Sync {
        let chosen = self.chosen(|law| match law.shipped() {
            Some(material) => shipped_stresses(material, D),
            None => Box::new(|states, out| *out = stresses_of::<L, D>(law, states)),
        });
        move |group, rows| {
            let mut stresses: Stresses = [[0.0; LANES]; 10];
            chosen.evaluate(group, &States::of(self.particles, group, rows), &mut stresses);
            judge(&self.particles.id, group, &stresses[DET_F])?;
            rows[D..D + D * D].copy_from_slice(&stresses[..D * D]);
            Ok(())
        }
    }

    /// What computes the tangents at ∇u times `factor` in closed form, a group at a time, for one pass; with `both` their b and c are
    /// there, zero where a law has none. Its error is the smallest particle of the group with det F ≤ 0, or `None` in its place where a
    /// tangent has not that form.
    pub(super) fn tangents(
        &self,
        both: bool,
        factor: f64,
    ) -> impl Fn(&[u32], &Rows, &mut Tangents) -> Result<(), Option<Inadmissible>> + Sync {
        let chosen = self.chosen(|law| match law.shipped() {
            Some(material) => shipped_tangents(material, D, factor),
            None => Box::new(move |states, out| *out = tangents_of::<L, D>(law, states, factor)),
        });
        move |group, rows, tangents| {
            chosen.evaluate(group, &States::of(self.particles, group, rows), tangents);
            judge(&self.particles.id, group, &tangents[TANGENT_DET_F]).map_err(Some)?;
            let fits = |&form: &f64| form == SIMPLE || (both && form == BOTH);
            if tangents[FORM][..group.len()].iter().all(fits) { Ok(()) } else { Err(None) }
        }
    }

    /// `choose` of the law of every body.
    fn chosen<'s, const ROWS: usize>(&'s self, choose: impl Fn(&'s L) -> Box<Evaluate<'s, ROWS>>) -> Chosen<'s, ROWS> {
        Chosen { body: &self.particles.body, loops: self.bodies.iter().map(|body| choose(&body.law)).collect() }
    }
}

/// The particle of a group with the smallest id whose det F is none of a body.
fn judge(ids: &[u32], group: &[u32], det_f: &[f64; LANES]) -> Result<(), Inadmissible> {
    let check = |(&p, &det_f): (&u32, &f64)| {
        let error = NonPositiveJacobian::check(det_f).err();
        error.map(|source| Inadmissible { particle: ids[p as usize] as usize, source })
    };
    match group.iter().zip(det_f).filter_map(check).min_by_key(|error| error.particle) {
        Some(first) => Err(first),
        None => Ok(()),
    }
}

/// V₀ F S F_nᵀ and det F of every lane.
#[inline(always)]
fn stresses_of<L: Law, const D: usize>(law: &L, states: &States<'_>) -> Stresses {
    let mut out = [[0.0; LANES]; 10];
    for lane in 0..LANES {
        let (gradient, h_n, volume) = states.of_lane::<D>(lane);
        let (stress, det_f) = internal(law, &gradient, &h_n, volume, Carry::ALL);
        for i in 0..D {
            for k in 0..D {
                out[i * D + k][lane] = stress[(i, k)];
            }
        }
        out[DET_F][lane] = det_f;
    }
    out
}

/// The tangents of every lane times `factor`.
#[inline(always)]
fn tangents_of<L: Law, const D: usize>(law: &L, states: &States<'_>, factor: f64) -> Tangents {
    let mut out = [[0.0; LANES]; 32];
    for lane in 0..LANES {
        let (gradient, h_n, volume) = states.of_lane::<D>(lane);
        let (frozen, det_f) = freeze(law, &gradient, &h_n, volume);
        out[TANGENT_DET_F][lane] = det_f;
        out[FORM][lane] = match frozen.closed() {
            Some(form) => {
                write(&form, factor, &mut out, lane);
                if form.both.is_some() { BOTH } else { SIMPLE }
            }
            None => NOT_CLOSED,
        };
    }
    out
}

/// Writes A, the upper triangle of B column by column, κ, q, and those of b and c: the tangent times `factor`.
#[inline(always)]
fn write<const D: usize>(form: &ClosedTangent<f64, D>, factor: f64, out: &mut Tangents, lane: usize) {
    let symmetric = D * (D + 1) / 2;
    let scalars = D * D + symmetric;
    for i in 0..D {
        for k in 0..D {
            out[i * D + k][lane] = form.a[i][k];
        }
    }
    write_upper(&form.right, factor, out, D * D, lane);
    out[scalars][lane] = form.bulk * factor;
    out[scalars + 1][lane] = form.q * factor;
    if let Some([b, c]) = &form.both {
        write_upper(b, 1.0, out, scalars + 2, lane);
        write_upper(c, factor, out, scalars + 2 + symmetric, lane);
    }
}

#[inline(always)]
fn write_upper<const D: usize>(a: &[[f64; D]; D], factor: f64, out: &mut Tangents, first: usize, lane: usize) {
    for k in 0..D {
        for i in 0..D {
            if i <= k {
                out[first + k * (k + 1) / 2 + i][lane] = a[i][k] * factor;
            }
        }
    }
}

/// A loop over the lanes with a law, in `D` dimensions.
struct InLanes<'l, L, W, const D: usize>(&'l L, W);

/// Not generic, so that it is compiled here and not by every crate that uses it.
#[inline(never)]
fn shipped_stresses(law: &Material, dimension: usize) -> Box<Evaluate<'static, 10>> {
    law.with(ChooseStresses { dimension })
}

/// As [`shipped_stresses`].
#[inline(never)]
fn shipped_tangents(law: &Material, dimension: usize, factor: f64) -> Box<Evaluate<'static, 32>> {
    law.with(ChooseTangents { dimension, factor })
}

struct ChooseStresses {
    dimension: usize,
}

impl LawVisitor for ChooseStresses {
    type Output = Box<Evaluate<'static, 10>>;

    fn visit<L: Law + 'static>(self, law: L) -> Self::Output {
        fn in_dimension<L: Law + 'static, const D: usize>(law: L) -> Box<Evaluate<'static, 10>> {
            Box::new(move |states, stresses| f64::widest(InLanes::<_, _, D>(&law, StressesOf { states, stresses })))
        }
        match self.dimension {
            1 => in_dimension::<L, 1>(law),
            2 => in_dimension::<L, 2>(law),
            _ => in_dimension::<L, 3>(law),
        }
    }
}

struct ChooseTangents {
    dimension: usize,
    factor: f64,
}

impl LawVisitor for ChooseTangents {
    type Output = Box<Evaluate<'static, 32>>;

    fn visit<L: Law + 'static>(self, law: L) -> Self::Output {
        fn in_dimension<L: Law + 'static, const D: usize>(law: L, factor: f64) -> Box<Evaluate<'static, 32>> {
            Box::new(move |states, tangents| {
                f64::widest(InLanes::<_, _, D>(&law, TangentsOf { states, factor, tangents }))
            })
        }
        match self.dimension {
            1 => in_dimension::<L, 1>(law, self.factor),
            2 => in_dimension::<L, 2>(law, self.factor),
            _ => in_dimension::<L, 3>(law, self.factor),
        }
    }
}

struct StressesOf<'a> {
    states: &'a States<'a>,
    stresses: &'a mut Stresses,
}

impl<L: Law, const D: usize> WithLanes<f64, LANES> for InLanes<'_, L, StressesOf<'_>, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, _: S) {
        *self.1.stresses = stresses_of::<L, D>(self.0, self.1.states);
    }
}

struct TangentsOf<'a> {
    states: &'a States<'a>,
    factor: f64,
    tangents: &'a mut Tangents,
}

impl<L: Law, const D: usize> WithLanes<f64, LANES> for InLanes<'_, L, TangentsOf<'_>, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes<LANES, X = f64>>(self, _: S) {
        *self.1.tangents = tangents_of::<L, D>(self.0, self.1.states, self.1.factor);
    }
}
