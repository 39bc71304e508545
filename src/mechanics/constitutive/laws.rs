//! Material laws in vector lanes: the particles of a group side by side.
//!
//! The formulas are those of one particle, called in a loop over the lanes. The shipped laws are arithmetic alone, so the compiler turns
//! their loops into vector instructions with the same bits. These loops are compiled once, here. Any other law keeps a plain loop.
//! The loop of each body is chosen once a pass over the particles.

use super::discrete_gradient::DiscreteGradient;
use super::point::{self, Part};
use super::tangents::{Form, general};
use crate::lanes::{LANES, Lanes, WithLanes, widest};
use crate::material::{ClosedTangent, Law, LawVisitor, Material, MaterialState, NonPositiveJacobian};
use crate::mechanics::kinematics::Inadmissible;
use crate::mechanics::sweep::{At, Group, Number};
use crate::particles::{Body, Particles};
use crate::scalar::Real;
use crate::tensor::{Tensor, identity};
use std::any::Any;

/// The laws of all particles, and their states: F at the last grid reset, internal variables at t_n.
#[derive(Clone, Copy)]
pub struct Laws<'a, const D: usize, L> {
    /// The particles.
    pub particles: &'a Particles<D>,
    /// The bodies with their laws.
    pub bodies: &'a [Body<L>],
    /// Δt
    pub dt: f64,
    /// Whether the stress is the mean stress of the step, and the deformation that halfway.
    pub discrete_gradient: bool,
}

/// A tensor by rows, a lane a particle. The first D·D entries are used.
type Rows<T> = [[T; LANES]; 9];

/// The rows of a closed tangent, the longest form that vector lanes write.
type ClosedRows = [[f64; LANES]; Form::ClosedWithFactors.rows(3)];

/// The states of the particles of a group, a lane each. Empty lanes hold zeros.
struct States<'a, T> {
    /// ∇u
    gradient: Rows<T>,
    h_r: Rows<f64>,
    /// V₀
    volume: [f64; LANES],
    /// Δt
    dt: f64,
    /// The internal variables of each particle at t_n.
    internal: [&'a [f64]; LANES],
    /// H_n of each particle by rows, for the mean stress of the step.
    start: Option<[[f64; 9]; LANES]>,
}

impl<'a, T: Real> States<'a, T> {
    fn of<const D: usize>(particles: &'a Particles<D>, dt: f64, group: &[u32], at: &[[T; LANES]]) -> Self {
        let mut gradient = [[T::zero(); LANES]; 9];
        gradient[..D * D].copy_from_slice(at);
        // Empty lanes take the internal variables of the first particle.
        let internal = [particles.state(group[0] as usize, dt).internal; LANES];
        let mut states = Self { gradient, h_r: [[0.0; LANES]; 9], volume: [0.0; LANES], dt, internal, start: None };
        let reference = particles.reference();
        for (lane, &p) in group.iter().enumerate().take(LANES) {
            states.internal[lane] = particles.state(p as usize, dt).internal;
            let h_r = reference.displacement_gradient(p as usize);
            for i in 0..D {
                for k in 0..D {
                    states.h_r[i * D + k][lane] = h_r[(i, k)];
                }
            }
            states.volume[lane] = particles.volume[p as usize];
        }
        states
    }

    /// The same states, with H_n.
    fn with_start<const D: usize>(mut self, particles: &Particles<D>, group: &[u32]) -> Self {
        let mut start = [[0.0; 9]; LANES];
        for (rows, &p) in start.iter_mut().zip(group) {
            let h = &particles.displacement_gradient[particles.local_index(p as usize)];
            rows[..D * D].copy_from_slice(h.transpose().as_slice());
        }
        self.start = Some(start);
        self
    }

    /// The law whose stress is the mean stress of the step, of one particle. If the body `averages` its dilatation, the law lacks U(J).
    fn mean<'s, L>(&'s self, law: &'s L, averages: bool, lane: usize) -> DiscreteGradient<'s, L> {
        const AT_REST: [f64; 9] = [0.0; 9];
        DiscreteGradient { law, averages, start: self.start.as_ref().map_or(&AT_REST, |start| &start[lane]) }
    }

    /// ∇u, F of the last grid reset with the internal variables at t_n, and V₀ of one particle.
    #[inline(always)]
    fn of_lane<const D: usize>(&self, lane: usize) -> (Tensor<T, D>, MaterialState<'_, f64, D>, f64) {
        let gradient = Tensor::from_fn(|i, k| self.gradient[i * D + k][lane]);
        let h_r = Tensor::from_fn(|i, k| self.h_r[i * D + k][lane]);
        (gradient, MaterialState::new(h_r).in_step(self.dt, self.internal[lane]), self.volume[lane])
    }
}

/// The evaluation of one law in all lanes. It fills rows and det F.
type Evaluation<'l, T> = dyn Fn(&States<'_, T>, &mut [[T; LANES]], &mut [f64; LANES]) + Sync + 'l;

impl<const D: usize, L: Law> Laws<'_, D, L> {
    /// The point function that adds σ = V₀ F S F_rᵀ at ∇u, for one pass. Only the F of `part` carry derivatives.
    pub(crate) fn stresses<T: Number>(
        &self,
        part: Part,
    ) -> impl Fn(Group<'_>, &At<T, D, D>, &mut At<T, D, D>) -> Result<(), Inadmissible> + Sync {
        // The loops of shipped laws are compiled for plain numbers. `downcast` finds out whether T is the plain number.
        let in_lanes = |law: &L| {
            let shipped: Box<dyn Any> = Box::new(shipped(material(law)?, D, None));
            shipped.downcast::<Box<Evaluation<'static, T>>>().ok()
        };
        let of_body = self.evaluations(|law, averages| match in_lanes(law) {
            _ if self.discrete_gradient => Box::new(move |states, out, det_f| {
                stresses_of::<T, D>(
                    |lane, at, g, v| point::internal(&states.mean(law, averages, lane), at, g, v, part),
                    states,
                    out,
                    det_f,
                );
            }),
            Some(shipped) => *shipped,
            None => Box::new(move |states, out, det_f| {
                stresses_of::<T, D>(|_, at, g, v| point::internal(law, at, g, v, part), states, out, det_f);
            }),
        });
        move |group, at, sums| {
            let mut stresses = [[[T::zero(); LANES]; D]; D];
            self.evaluate(&of_body, group, at, stresses.as_flattened_mut())?;
            for (sums, rows) in sums.gradient.as_flattened_mut().iter_mut().zip(stresses.as_flattened()) {
                sums.iter_mut().zip(rows).for_each(|(sum, &x)| *sum += x);
            }
            Ok(())
        }
    }

    /// The smallest form that holds the tangents of all laws. It does not depend on the state.
    pub(crate) fn form(&self) -> Form {
        let all =
            self.bodies.iter().map(|body| if self.discrete_gradient { Form::General } else { form::<L, D>(&body.law) });
        all.max().unwrap_or(Form::Closed)
    }

    /// The point function that linearises the laws at ∇u and fills the rows of their tangents, for one pass.
    pub(crate) fn tangents(
        &self,
        part: Part,
        form: Form,
    ) -> impl Fn(Group<'_>, &At<f64, D, D>, &mut [[f64; LANES]]) -> Result<(), Inadmissible> + Sync {
        let discrete_gradient = self.discrete_gradient;
        let of_body = self.evaluations(move |law, averages| match material(law) {
            _ if discrete_gradient => Box::new(move |states, out, det_f| {
                tangents_of::<D>(
                    |lane, at, g, v| point::linearize(&states.mean(law, averages, lane), at, g, v, part),
                    states,
                    form,
                    out,
                    det_f,
                );
            }),
            Some(material) if part == Part::Whole && form != Form::General => shipped(material, D, Some(form)),
            _ => Box::new(move |states, out, det_f| {
                tangents_of::<D>(|_, at, g, v| point::linearize(law, at, g, v, part), states, form, out, det_f);
            }),
        });
        move |group, at, rows| self.evaluate(&of_body, group, at, rows)
    }

    /// The evaluations that `choose` picks for each body, from its law and whether it averages its dilatation.
    fn evaluations<'s, T>(
        &'s self,
        choose: impl Fn(&'s L, bool) -> Box<Evaluation<'s, T>>,
    ) -> Vec<Box<Evaluation<'s, T>>> {
        self.bodies.iter().map(|body| choose(&body.law, body.averages())).collect()
    }

    /// Evaluates every law that occurs in the group for all lanes, and keeps the lanes of its own particles.
    ///
    /// # Errors
    /// The particle with the smallest id among those with det F ≤ 0.
    fn evaluate<T: Real>(
        &self,
        of_body: &[Box<Evaluation<'_, T>>],
        group: Group<'_>,
        at: &At<T, D, D>,
        out: &mut [[T; LANES]],
    ) -> Result<(), Inadmissible> {
        let (group, mut det_f) = (group.particles, [1.0; LANES]);
        let mut states = States::of(self.particles, self.dt, group, at.gradient.as_flattened());
        if self.discrete_gradient {
            states = states.with_start(self.particles, group);
        }
        let body = |lane: usize| self.particles.body[group[lane] as usize];
        of_body[body(0) as usize](&states, out, &mut det_f);
        for lane in 1..group.len() {
            if (0..lane).any(|before| body(before) == body(lane)) {
                continue;
            }
            let (mut other, mut other_det_f) = (vec![[T::zero(); LANES]; out.len()], [1.0; LANES]);
            of_body[body(lane) as usize](&states, &mut other, &mut other_det_f);
            mutant!("sweep: a second body in a group takes the law of the first": { of_body[body(0) as usize](&states, &mut other, &mut other_det_f); });
            for same in (lane..group.len()).filter(|&same| body(same) == body(lane)) {
                det_f[same] = other_det_f[same];
                out.iter_mut().zip(&other).for_each(|(out, other)| out[same] = other[same]);
            }
        }
        let check = |(&p, &det_f): (&u32, &f64)| {
            let error = NonPositiveJacobian::check(det_f).err();
            error.map(|source| Inadmissible { particle: self.particles.id[p as usize] as usize, source })
        };
        let first = group.iter().zip(&det_f).filter_map(check).min_by_key(|error| error.particle);
        first.map_or(Ok(()), Err)
    }
}

/// The shipped law that `law` is.
fn material<L: Law>(law: &L) -> Option<&Material> {
    law.shipped()?.downcast_ref()
}

/// The form of the tangents of a law.
fn form<L: Law, const D: usize>(law: &L) -> Form {
    match law.closed(&identity::<f64, D>(), &MaterialState::new(Tensor::zeros()), 1.0) {
        None => Form::General,
        Some(closed) if closed.factors.is_some() => Form::ClosedWithFactors,
        Some(_) => Form::Closed,
    }
}

/// σ and det F of every lane. `stress` gives them from the lane, F of the last grid reset, ∇u and V₀.
#[inline(always)]
fn stresses_of<T: Real, const D: usize>(
    stress: impl Fn(usize, &MaterialState<f64, D>, &Tensor<T, D>, f64) -> (Tensor<T, D>, f64),
    states: &States<'_, T>,
    out: &mut [[T; LANES]],
    det_f: &mut [f64; LANES],
) {
    // Fixed lengths, so that no index is checked and the loop becomes vector instructions.
    let mut rows: Rows<T> = [[T::zero(); LANES]; 9];
    for lane in 0..LANES {
        let (gradient, at_r, volume) = states.of_lane::<D>(lane);
        let (stress, det) = stress(lane, &at_r, &gradient, volume);
        for i in 0..D {
            for k in 0..D {
                rows[i * D + k][lane] = stress[(i, k)];
            }
        }
        det_f[lane] = det;
    }
    out.copy_from_slice(&rows[..D * D]);
}

/// The tangents of every lane, stored in `form`. `linearize` gives them, and det F, like [`stresses_of`].
#[inline(always)]
fn tangents_of<const D: usize>(
    linearize: impl Fn(usize, &MaterialState<f64, D>, &Tensor<f64, D>, f64) -> (point::LocalTangent<D>, f64),
    states: &States<'_, f64>,
    form: Form,
    out: &mut [[f64; LANES]],
    det_f: &mut [f64; LANES],
) {
    let mut rows: ClosedRows = [[0.0; LANES]; Form::ClosedWithFactors.rows(3)];
    for lane in 0..LANES {
        let (gradient, at_r, volume) = states.of_lane::<D>(lane);
        let (tangent, det) = linearize(lane, &at_r, &gradient, volume);
        det_f[lane] = det;
        match (tangent, form) {
            (point::LocalTangent::Closed(closed), Form::Closed | Form::ClosedWithFactors) => {
                write(&closed, form, &mut rows, lane);
            }
            (tangent, _) => {
                for k in 0..D {
                    for l in 0..D {
                        let block = match &tangent {
                            point::LocalTangent::Closed(closed) => closed.unit_block(k, l),
                            point::LocalTangent::General(blocks) => blocks[k][l],
                        };
                        for i in 0..D {
                            for j in 0..D {
                                out[general::<D>(k, l, i, j)][lane] = block[i][j];
                            }
                        }
                    }
                }
            }
        }
    }
    if form != Form::General {
        out.copy_from_slice(&rows[..form.rows(D)]);
    }
}

/// Writes A, B, κ, q, b and c of the tangent. Of B, b and c it writes the upper triangle, column by column.
#[inline(always)]
fn write<const D: usize>(closed: &ClosedTangent<f64, D>, form: Form, out: &mut ClosedRows, lane: usize) {
    let symmetric = D * (D + 1) / 2;
    let scalars = D * D + symmetric;
    for i in 0..D {
        for k in 0..D {
            out[i * D + k][lane] = closed.a[i][k];
        }
    }
    write_upper(&closed.right, out, D * D, lane);
    out[scalars][lane] = closed.bulk;
    out[scalars + 1][lane] = closed.q;
    if let (Some([b, c]), Form::ClosedWithFactors) = (&closed.factors, form) {
        write_upper(b, out, scalars + 2, lane);
        write_upper(c, out, scalars + 2 + symmetric, lane);
    }
}

#[inline(always)]
fn write_upper<const D: usize>(a: &[[f64; D]; D], out: &mut ClosedRows, first: usize, lane: usize) {
    for k in 0..D {
        for i in 0..D {
            if i <= k {
                out[first + k * (k + 1) / 2 + i][lane] = a[i][k];
            }
        }
    }
}

/// The evaluation of a shipped law, in vector lanes: its tangent in a form, or without a form its stress. The function is not generic, so it
/// is compiled here and not by every crate that uses it.
#[inline(never)]
fn shipped(law: &Material, dimension: usize, form: Option<Form>) -> Box<Evaluation<'static, f64>> {
    match dimension {
        1 => law.with(InLanes::<1>(form)),
        2 => law.with(InLanes::<2>(form)),
        _ => law.with(InLanes::<3>(form)),
    }
}

/// Makes the evaluation of a law in D dimensions.
struct InLanes<const D: usize>(Option<Form>);

impl<const D: usize> LawVisitor for InLanes<D> {
    type Output = Box<Evaluation<'static, f64>>;

    fn visit<L: Law + 'static>(self, law: L) -> Self::Output {
        Box::new(move |states, out, det_f| {
            widest(Evaluate::<L, D> { law: &law, form: self.0, states, out, det_f });
        })
    }
}

struct Evaluate<'a, L, const D: usize> {
    law: &'a L,
    form: Option<Form>,
    states: &'a States<'a, f64>,
    out: &'a mut [[f64; LANES]],
    det_f: &'a mut [f64; LANES],
}

impl<L: Law, const D: usize> WithLanes for Evaluate<'_, L, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, _: S) {
        let Self { law, form, states, out, det_f } = self;
        match form {
            None => {
                stresses_of::<f64, D>(|_, at, g, v| point::internal(law, at, g, v, Part::Whole), states, out, det_f);
            }
            Some(form) => {
                tangents_of::<D>(|_, at, g, v| point::linearize(law, at, g, v, Part::Whole), states, form, out, det_f);
            }
        }
    }
}
