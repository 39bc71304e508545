//! The passes over all particles: the particle-to-grid and grid-to-particle transfers that the rest of the program calls.

use super::connectivity::{Implementation, dispatch};
use super::group::At;
use super::tiled::Tiled;
use super::{Connectivity, Each, Group, Mode, Number, Quadratic, Weights};
use crate::lanes::LANES;
use crate::parallel::{self, First, Message};
use crate::pooled::{Element, Pool, Pooled};
use crate::tensor::{Tensor, Vector};

impl<const D: usize> Connectivity<D> {
    /// `f_I += Σ_p q N_I + σ ∇_r N_I` for C components: 1 or D. `point(group, u and L, q and σ)` adds to q and σ, which begin with
    /// zero. Without a field u and L are unspecified.
    pub fn sweep<T: Number, const C: usize>(
        &self,
        field: Option<&[Vector<T, C>]>,
        mode: Mode,
        out: &mut [Vector<T, C>],
        point: impl Fn(Group<'_>, &At<T, C, D>, &mut At<T, C, D>) + Sync,
    ) {
        const { assert!(C == 1 || C == D) };
        self.pass();
        let point = |group: Group<'_>, fields: &[At<f64, C, D>], sums: &mut [At<f64, C, D>]| {
            T::at(fields, sums, |at, sums| point(group, at, sums));
        };
        let field = field.map(T::flat);
        T::add_flat(out, |out| {
            dispatch!(self, one => one.sweep::<C>(T::FIELDS, field.as_deref(), mode, out, &point));
        });
    }

    /// Calls `fill(group, L, rows)` for every group of this process. Each of them has `count` rows.
    pub(crate) fn fill_rows(
        &self,
        field: &[Vector<f64, D>],
        count: usize,
        rows: &mut [[f64; LANES]],
        fill: impl Fn(Group<'_>, &At<f64, D, D>, &mut [[f64; LANES]]) + Sync,
    ) {
        let fill = |group: Group<'_>, at: &[At<f64, D, D>], rows: &mut [[f64; LANES]]| fill(group, &at[0], rows);
        self.results(Each::Group(count), &[Mode::GRADIENT], Some(bytemuck::cast_slice(field)), rows, fill);
    }

    /// [`Self::fill_rows`] for the groups of all processes.
    pub(crate) fn fill_all_rows(
        &self,
        field: &[Vector<f64, D>],
        count: usize,
        rows: &mut [[f64; LANES]],
        fill: impl Fn(Group<'_>, &At<f64, D, D>, &mut [[f64; LANES]]) + Sync,
    ) {
        let own = self.own_groups();
        self.fill_rows(field, count, &mut rows[own.start * count..own.end * count], fill);
        if let Some(tiled) = self.tiled() {
            tiled.share_numbers(Each::Group(count * LANES), rows.as_flattened_mut());
        }
    }

    /// `evaluate(group)` of all groups, in the order of their numbers.
    pub(crate) fn map_groups<R: Clone + Send + Message>(&self, evaluate: impl Fn(Group<'_>) -> R + Sync) -> Vec<R> {
        let mut results = vec![R::blank(); self.groups()];
        let evaluate = |group: Group<'_>, _: &[At<f64, D, D>], results: &mut [R]| results[0] = evaluate(group);
        let own = &mut results[self.own_groups()];
        dispatch!(self, one => one.results(Each::Group(1), &[], None, &evaluate, own));
        if let Some(tiled) = self.tiled() {
            tiled.share_results(Each::Group(1), &mut results);
        }
        results
    }

    /// `out_I +=` Σ_p B_p(∇_r N_I, ∇_r N_I) + m_p N_I² I, the nodal diagonal blocks of quadratic forms. `quadratic` fills in the form of
    /// each group.
    pub(crate) fn blocks(&self, out: &mut [Tensor<f64, D>], quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync)) {
        self.pass();
        dispatch!(self, one => one.blocks(out, quadratic));
    }

    /// `out_I += Σ_p σ_p ∇_r N_I + q_p N_I` with `(q_p, σ_p) = point(p, u_p, ∇u_p)`, u_p = Σ u_I N_I and
    /// ∇u_p = Σ u_I ⊗ ∇_r N_I. The scatter has the given weights in place of N and ∇_r N.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, residual::Inadmissible, sweep::{Connectivity, Weights}};
    /// use bfree::tensor::{Tensor, Vector, contract};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid) = (&simulation.particles, &simulation.grid);
    /// let (connectivity, nodes) = Connectivity::new(&simulation.approximation, grid, &particles.position)?;
    /// // Virtual work: Σ_I f_I·w_I = Σ_p (σ_p : ∇w_p + q_p·w_p), for forces f and any w.
    /// let (u, w) = (direction::<2>(nodes.len(), 1), direction::<2>(nodes.len(), 2));
    /// let state = |u: Vector<f64, 2>, gradient: Tensor<f64, 2>| (u * 3.0, gradient * 2.0);
    /// let mut force = vec![Vector::zeros(); nodes.len()];
    /// connectivity.assemble(&u, Weights::Signed, &mut force, |_, u, gradient| Ok::<_, Inadmissible>(state(u, gradient)))?;
    /// let at_nodes: f64 = force.iter().zip(&w).map(|(f, w)| f.dot(w)).sum();
    /// let states = connectivity.interpolate(&u, |_, u, gradient| Ok::<_, Inadmissible>(state(u, gradient)))?;
    /// let work = connectivity.interpolate(&w, |p, w, gradient| {
    ///     let (q, sigma) = states[p];
    ///     Ok::<_, Inadmissible>(contract(&sigma, &gradient) + q.dot(&w))
    /// })?;
    /// assert!((at_nodes - work.iter().sum::<f64>()).abs() < 1e-10);
    ///
    /// // A uniform pressure acts on the rim of a body. Inside, the forces of the particles around a node cancel, but their sizes do not.
    /// let pressure = |_: usize, _: Vector<f64, 2>, _: Tensor<f64, 2>| Ok::<_, Inadmissible>((Vector::zeros(), Tensor::identity()));
    /// let (mut force, mut size) = (vec![Vector::zeros(); nodes.len()], vec![Vector::zeros(); nodes.len()]);
    /// connectivity.assemble(&u, Weights::Signed, &mut force, pressure)?;
    /// connectivity.assemble(&u, Weights::Magnitude, &mut size, pressure)?;
    /// assert!(force.iter().zip(&size).all(|(f, size)| f.norm() <= size.norm() * (1.0 + 1e-15)));
    /// let inside = nodes.number(grid.id([5, 5])).ok_or("in the middle of the disc")?;
    /// assert!(force[inside].norm() < 1e-3 * size[inside].norm());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The error of the first particle in memory whose `point` fails.
    pub fn assemble<T: Number, E: Send + Message>(
        &self,
        field: &[Vector<T, D>],
        weights: Weights,
        out: &mut [Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<(Vector<T, D>, Tensor<T, D>), E> + Sync,
    ) -> Result<(), E> {
        let failure = First::none();
        self.sweep(Some(field), Mode { weights, ..Mode::BOTH }, out, |group, at, sums| {
            for (lane, &p) in group.particles.iter().enumerate() {
                let (value, gradient) = at.lane(lane);
                match point(p as usize, value, gradient) {
                    Ok((q, sigma)) => {
                        for c in 0..D {
                            sums.value[c][lane] += q[c];
                            (0..D).for_each(|k| sums.gradient[c][k][lane] += sigma[(c, k)]);
                        }
                    }
                    Err(error) => failure.keep(p as usize, error),
                }
            }
        });
        failure.check(self.processes())
    }

    /// `out_I += Σ_p value(p) N_I`, for C components: 1 or D.
    pub(crate) fn spread<const C: usize>(
        &self,
        out: &mut [Vector<f64, C>],
        value: impl Fn(usize) -> Vector<f64, C> + Sync,
    ) {
        self.spread_with(Weights::Signed, out, value);
    }

    /// [`Self::spread`] with the given weights in place of N.
    pub(crate) fn spread_with<const C: usize>(
        &self,
        weights: Weights,
        out: &mut [Vector<f64, C>],
        value: impl Fn(usize) -> Vector<f64, C> + Sync,
    ) {
        if weights == Weights::Signed && self.spread_on_device(out, &value) {
            return self.pass();
        }
        self.sweep(None, Mode { weights, ..Mode::VALUE }, out, |group, _, sums| {
            for (lane, &p) in group.particles.iter().enumerate() {
                let value = value(p as usize);
                (0..C).for_each(|c| sums.value[c][lane] = value[c]);
            }
        });
    }

    /// Σ u_I N_I at every particle.
    ///
    /// Example: [`Connectivity`].
    pub fn values<const C: usize>(&self, field: &[Vector<f64, C>]) -> Pooled<Vector<f64, C>>
    where
        Vector<f64, C>: Element,
    {
        const { assert!(C == 1 || C == D) };
        self.gathered(false, &[field], false).of_vectors()
    }

    /// [`Self::values`] at the [own particles](Self::own_particles) of this process.
    pub(crate) fn own_values(&self, field: &[Vector<f64, D>]) -> Pooled<Vector<f64, D>> {
        self.gathered(true, &[field], false).of_vectors()
    }

    /// Of each of the [own particles](Self::own_particles) of this process the numbers of Σ u_I N_I, of Σ u_I ⊗ ∇_r N_I by columns, and the
    /// values of `more` fields.
    pub(crate) fn own_motions(&self, u: &[Vector<f64, D>], more: &[&[Vector<f64, D>]]) -> Pooled<f64> {
        self.gathered(true, &[&[u], more].concat(), true)
    }

    /// The values of nodal fields at all particles, or at the [own particles](Self::own_particles) of this process; behind those of the first
    /// field its gradient by columns, if `gradient`.
    fn gathered<const C: usize>(&self, own_alone: bool, fields: &[&[Vector<f64, C>]], gradient: bool) -> Pooled<f64> {
        let count = C * fields.len() + if gradient { C * D } else { 0 };
        let fill = |results: &mut [f64]| {
            if self.gather_on_device(fields, gradient, results) {
                return self.pass();
            }
            let mut modes = vec![Mode::VALUE; fields.len()];
            modes[0].gradient = gradient;
            let evaluate = |group: Group<'_>, at: &[At<f64, C, D>], results: &mut [f64]| {
                for (lane, results) in results.chunks_mut(count).take(group.particles.len()).enumerate() {
                    let values = |at: &At<f64, C, D>| at.value.map(|row| row[lane]);
                    let (first, more) = results.split_at_mut(count - C * (fields.len() - 1));
                    first[..C].copy_from_slice(&values(&at[0]));
                    first[C..].iter_mut().enumerate().for_each(|(k, x)| *x = at[0].gradient[k % C][k / C][lane]);
                    more.chunks_mut(C).zip(&at[1..]).for_each(|(more, at)| more.copy_from_slice(&values(at)));
                }
            };
            let together = if fields.len() > 1 { side_by_side(fields, self.pool()) } else { Pooled::default() };
            let fields: &[f64] = if let [field] = fields { bytemuck::cast_slice(field) } else { &together };
            self.results(Each::Particle(count), &modes, Some(fields), results, evaluate);
        };
        let own = self.own_places();
        // If particles do not lie in the order of the passes, every process needs all of them.
        if own_alone && self.is_memory_order() {
            let mut results = self.pool().unspecified(own.len() * count);
            fill(&mut results);
            return results;
        }
        let mut results = self.pool().unspecified(self.particles() * count);
        fill(&mut results[own.start * count..own.end * count]);
        let each = Each::Particle(count);
        self.in_memory_order(count, &mut results, |tiled, results| tiled.share_numbers(each, results));
        results
    }

    /// `point(p, u_p, ∇u_p)` of every particle.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid) = (&simulation.particles, &simulation.grid);
    /// let (connectivity, nodes) = bfree::mechanics::sweep::Connectivity::new(&simulation.approximation, grid, &particles.position)?;
    /// // A rotation about the origin, u = ω × x, has no divergence.
    /// let rotation: Vec<_> = nodes.positions(grid).map(|(_, x)| bfree::tensor::Vector::from([-x[1], x[0]])).collect();
    /// let divergence = connectivity.evaluate(&rotation, |_, _, gradient| gradient.trace());
    /// assert_eq!(divergence.len(), particles.len());
    /// assert!(divergence.iter().all(|one| one.abs() < 1e-12));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn evaluate<T: Number, R: Copy + Send + Message>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> R + Sync,
    ) -> Vec<R> {
        let point = |p: usize, fields: &[At<f64, D, D>], lane: usize| {
            let value = Vector::from_fn(|c, _| T::from_fields(|i| fields[i].value[c][lane]));
            let gradient = Tensor::from_fn(|c, k| T::from_fields(|i| fields[i].gradient[c][k][lane]));
            point(p, value, gradient)
        };
        let evaluate = |group: Group<'_>, at: &[At<f64, D, D>], results: &mut [R]| {
            for (lane, (&p, result)) in group.particles.iter().zip(results).enumerate() {
                *result = point(p as usize, at, lane);
            }
        };
        let (each, modes) = (Each::Particle(1), vec![Mode::BOTH; T::FIELDS]);
        let mut results = vec![R::blank(); self.particles()];
        self.results(each, &modes, Some(&T::flat(field)), &mut results[self.own_places()], evaluate);
        self.in_memory_order(1, &mut results, |tiled, results| tiled.share_results(each, results));
        results
    }

    /// Calls `evaluate(group, u and L of every field, results)` for every group of this process. There is a mode for each field.
    fn results<R: Send, const C: usize>(
        &self,
        each: Each,
        modes: &[Mode],
        field: Option<&[f64]>,
        results: &mut [R],
        evaluate: impl Fn(Group<'_>, &[At<f64, C, D>], &mut [R]) + Sync,
    ) {
        self.pass();
        dispatch!(self, one => one.results(each, modes, field, &evaluate, results));
    }

    /// Takes the results of other processes by `share`, and moves all results, so many for each particle, to the order of the particles in memory.
    fn in_memory_order<R: Copy>(&self, count: usize, results: &mut [R], share: impl FnOnce(&Tiled<D>, &mut [R])) {
        if let Some(tiled) = self.tiled() {
            share(tiled, results);
            tiled.to_memory_order(count, results);
        }
    }

    /// `point(p, u_p, ∇u_p)` of every particle, in the order of the particles in memory.
    ///
    /// Example: [`Self::assemble`].
    ///
    /// # Errors
    /// The error of the first particle in memory whose `point` fails.
    pub fn interpolate<T: Number, R: Copy + Send + Message, E: Send + Message>(
        &self,
        field: &[Vector<T, D>],
        point: impl Fn(usize, Vector<T, D>, Tensor<T, D>) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, E> {
        let failure = First::none();
        let results = self.evaluate(field, |p, value, gradient| {
            point(p, value, gradient).unwrap_or_else(|error| {
                failure.keep(p, error);
                R::blank()
            })
        });
        failure.check(self.processes())?;
        Ok(results)
    }
}

/// Nodal fields side by side: node after node, field after field.
fn side_by_side<const C: usize>(fields: &[&[Vector<f64, C>]], pool: &Pool) -> Pooled<f64> {
    let mut numbers = pool.unspecified(fields.iter().map(|field| field.len() * C).sum());
    parallel::rows(&mut numbers, fields.len() * C, |node, numbers| {
        numbers.chunks_mut(C).zip(fields).for_each(|(numbers, field)| numbers.copy_from_slice(field[node].as_slice()));
    });
    numbers
}
