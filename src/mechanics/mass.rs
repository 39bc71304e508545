//! The mass operator M̃ = (1−ε) M + ε lumped(M), with M_IJ = Σ_p m N_I N_J (eq. 42): product, projection, diagonal.

use crate::mechanics::sweep::{At, Connectivity, Group, Mode, Weights};
use crate::parallel::{self, PART};
use crate::particles::Particles;
use crate::pooled::Pooled;
use crate::solver::{ConjugateGradientSettings, LinearError, System};
use crate::space::Space;
use crate::tensor::Vector;
use std::borrow::Cow;

/// Below this fraction of the largest particle mass, a node's velocity and acceleration are zero.
const LIGHT: f64 = 1e-14;

/// Relative residual of the projection with a consistent mass.
const PROJECTION_TOLERANCE: f64 = 1e-12;

/// Two fields at the nodes.
type TwoFields<const D: usize> = [Pooled<Vector<f64, D>>; 2];

/// M̃ on the active nodes.
#[derive(Clone, Copy, Debug)]
pub struct Mass<'a, const D: usize> {
    /// The particles.
    pub particles: &'a Particles<D>,
    /// The shape functions of the particles.
    pub connectivity: &'a Connectivity<D>,
    /// The lumped mass of every active node.
    pub lumped: &'a [f64],
    /// ε
    pub lumping: f64,
}

/// Σ_p m N_I at every active node.
pub fn lumped<const D: usize>(particles: &Particles<D>, connectivity: &Connectivity<D>) -> Pooled<f64> {
    let mut mass = connectivity.field();
    connectivity.spread(bytemuck::cast_slice_mut(&mut mass), |p| Vector::from([particles.mass[p]]));
    mass
}

/// Whether a nodal mass is too small for a projected velocity. Δφ of such a light node comes from the stiffness.
pub(super) fn is_light<const D: usize>(particles: &Particles<D>) -> impl Fn(f64) -> bool + use<D> {
    let largest = |mass: &[f64]| mass.iter().fold(0.0, |max: f64, &m| max.max(m));
    let light = LIGHT * largest(&parallel::collect(particles.mass.chunks(PART), &largest));
    mutant!("mass: nodes without mass have a velocity": light = 0.0);
    move |mass| mass < light
}

impl<const D: usize> Mass<'_, D> {
    /// (1−ε) m of a particle.
    #[inline(always)]
    pub(crate) fn consistent(&self, p: usize) -> f64 {
        (1.0 - self.lumping) * self.particles.mass[p]
    }

    /// `out += factor M̃ u`
    pub(crate) fn add_product(&self, factor: f64, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        self.add_lumped(factor, u, out);
        if self.lumping < 1.0 {
            mutant!("mass: the product takes ε for 1 − ε": factor = factor * self.lumping / (1.0 - self.lumping));
            self.connectivity.sweep(Some(u), Mode::VALUE, out, |group, at, sums| {
                self.add_consistent(factor, group, at, sums);
            });
        }
    }

    /// `out += factor ε m u` at the nodes
    pub(crate) fn add_lumped(&self, factor: f64, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let factor = factor * self.lumping;
        parallel::each(out, |node, out| *out += u[node] * (factor * self.lumped[node]));
    }

    /// `q += factor (1−ε) m u` at the particles of a group
    #[inline(always)]
    pub(crate) fn add_consistent(&self, factor: f64, group: Group<'_>, at: &At<f64, D, D>, sums: &mut At<f64, D, D>) {
        for (lane, &p) in group.particles.iter().enumerate() {
            let weight = factor * self.consistent(p as usize);
            (0..D).for_each(|c| sums.value[c][lane] += weight * at.value[c][lane]);
        }
    }

    /// Solves M̃ w = Σ_p m u_p N_I for two fields `u` of the particles of this process; at light nodes w = 0. Also returns the number of
    /// iterations, 0 for a lumped mass.
    ///
    /// # Errors
    /// The sums overflow.
    pub(crate) fn project(&self, fields: [&[Vector<f64, D>]; 2]) -> Result<(TwoFields<D>, usize), LinearError> {
        let space = self.connectivity.space([]);
        let lumped = restricted(&space, self.lumped);
        let right = |field: &[Vector<f64, D>]| {
            let mut out: Pooled<Vector<f64, D>> = self.connectivity.field();
            self.connectivity.spread(&mut out, |p| field[self.particles.local_index(p)] * self.particles.mass[p]);
            space.followers().restrict(&mut out);
            out
        };
        let (mut nodal, mut iterations) = (fields.map(right), 0);
        let inverse_diagonal = (self.lumping < 1.0).then(|| self.inverse_diagonal(&space));
        let is_light = is_light(self.particles);
        for field in &mut nodal {
            match &inverse_diagonal {
                Some(inverse_diagonal) => iterations += self.solve(&space, inverse_diagonal, field)?,
                None => parallel::zip(field, &lumped, |w, m| *w /= *m),
            }
            parallel::zip(field, &lumped, |w, m| {
                if is_light(*m) {
                    *w = Vector::zeros();
                }
            });
            space.followers().extend(field);
        }
        Ok((nodal, iterations))
    }

    /// 1/M̃_II; zero at nodes without mass and at outer nodes.
    fn inverse_diagonal(&self, space: &Space<D>) -> Pooled<f64> {
        let mut diagonal = self.connectivity.pool().made(self.lumped.len(), |node| self.lumping * self.lumped[node]);
        self.connectivity.spread_with(Weights::Square, bytemuck::cast_slice_mut(&mut diagonal), |p| {
            Vector::from([(1.0 - self.lumping) * self.particles.mass[p]])
        });
        for (outer, _, leaders) in space.followers().rows() {
            let own = std::mem::replace(&mut diagonal[outer], 0.0);
            leaders.for_each(|(leader, weight)| diagonal[leader] += weight * weight * own);
        }
        // The smallest positive numbers have no finite inverse.
        let inverse = |d: f64| if d > 0.0 && d.recip().is_finite() { d.recip() } else { 0.0 };
        parallel::each(&mut diagonal, |_, d| *d = inverse(*d));
        diagonal
    }

    /// Solves by conjugate gradients from zero. If M̃ is singular, this gives the solution of least norm.
    fn solve(
        &self,
        space: &Space<D>,
        inverse_diagonal: &[f64],
        field: &mut [Vector<f64, D>],
    ) -> Result<usize, LinearError> {
        let right = self.connectivity.pool().copy_of(field);
        let settings = ConjugateGradientSettings {
            relative_tolerance: PROJECTION_TOLERANCE,
            max_iterations: 10 * right.len() + 100,
        };
        let (right, solution) = (bytemuck::cast_slice(&right), bytemuck::cast_slice_mut(field));
        let vectors = self.connectivity.pool();
        // Eᵀ M̃ E
        let operator = |x: &[f64], y: &mut [f64]| {
            let (x, y): (&[Vector<f64, D>], &mut [Vector<f64, D>]) =
                (bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
            let extended = space.extended_in_pool(x);
            parallel::fill(y, Vector::zeros());
            self.add_product(1.0, extended.as_deref().unwrap_or(x), y);
            space.followers().restrict(y);
        };
        let inverse = |r: &[f64], z: &mut [f64]| {
            parallel::each(z, |k, z| *z = r[k] * inverse_diagonal[k / D]);
        };
        let system = System { vectors, operator: &operator, inverse: &inverse };
        Ok(settings.solve(&system, right, solution)?.iterations)
    }
}

/// Eᵀ m of nodal masses; zero at outer nodes.
pub(super) fn restricted<'a, const D: usize>(space: &Space<D>, mass: &'a [f64]) -> Cow<'a, [f64]> {
    let mut mass = Cow::Borrowed(mass);
    for (outer, _, leaders) in space.followers().rows() {
        let mass = mass.to_mut();
        let own = std::mem::replace(&mut mass[outer], 0.0);
        leaders.for_each(|(leader, weight)| mass[leader] += weight * own);
    }
    mass
}
