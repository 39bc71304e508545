//! `probes.csv`: fields at chosen particles or points against time.

use super::csv::{Row, cell};
use super::rows::collected;
use super::{OutputError, Reference};
use crate::field::Field;
use crate::material::Law;
use crate::particles::Particles;
use crate::simulation::Simulation;
use crate::tensor::Vector;

/// The particle or point that a probe reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place<const D: usize> {
    /// The particle with this id, which the probe follows.
    Particle(usize),
    /// A material point at `offset` d from a particle in the reference configuration. The point lies at x_p + F d, to first order in d.
    /// Fields other than position and displacement are those of the particle.
    Carried {
        /// Id of the particle.
        particle: usize,
        /// d
        offset: Vector<f64, D>,
    },
    /// The particle nearest to a fixed point, searched anew each time. Among equally near particles, the smallest id counts. No field is
    /// interpolated.
    Nearest {
        /// The point.
        point: Vector<f64, D>,
        /// Only particles of this body are searched.
        body: Option<u32>,
        /// Largest distance of the particle from the point. If the particle is farther away, the values are NaN.
        within: f64,
    },
}

/// A field at a particle or point.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe<const D: usize> {
    /// Name. Columns are `name`, or `name_x`, … for the components of a vector, `name_xx`, … for a tensor.
    pub name: String,
    /// The field.
    pub field: Field,
    /// The index of the only component that is written, in a column `name`; all components without it.
    pub component: Option<usize>,
    /// The particle or point.
    pub place: Place<D>,
}

impl<const D: usize> Probe<D> {
    /// Id of the particle that is read now; `None` if no particle is near enough.
    fn particle(&self, particles: &Particles<D>) -> Result<Option<usize>, OutputError> {
        let name = self.name.clone();
        match self.place {
            Place::Particle(particle) | Place::Carried { particle, .. } if particle >= particles.len() => {
                Err(OutputError::ProbeParticle { name, particle, particles: particles.len() })
            }
            Place::Particle(particle) | Place::Carried { particle, .. } => Ok(Some(particle)),
            Place::Nearest { point, body, within } => {
                let none = || OutputError::ProbePoint { name, point: point.iter().copied().collect() };
                let (particle, distance) = nearest(particles, &point, body).ok_or_else(none)?;
                Ok((distance <= within).then_some(particle))
            }
        }
    }

    /// The offset d of a carried point whose place is read.
    fn offset(&self) -> Option<Vector<f64, D>> {
        let Place::Carried { offset, .. } = self.place else { return None };
        matches!(self.field, Field::Position | Field::Displacement).then_some(offset)
    }

    /// The length of [`Self::state_at`].
    pub(super) fn state_len(&self) -> usize {
        let components = self.field.kind().components().len();
        if self.field.needs_state() { components } else { self.offset().map_or(0, |_| D) }
    }

    /// The values that the probe takes from the state of a particle of this process: those of the field, or H d of a carried point.
    pub(super) fn state_at<L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        place: usize,
    ) -> Result<Vec<f64>, OutputError> {
        let (particles, mut values) = (&simulation.particles, Vec::new());
        if self.field.needs_state() {
            self.field.append_at_all(simulation, &Reference::unknown(), &[place as u32], &mut values)?;
        } else if let Some(offset) = self.offset() {
            values.extend(&(particles.displacement_gradient[particles.local_index(place)] * offset));
        }
        Ok(values)
    }

    /// [`Self::state_at`] in process 0, from the process that has the particle; nothing in the others.
    pub(super) fn exchanged<L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        place: usize,
    ) -> Result<Option<Vec<f64>>, OutputError> {
        let (processes, parts) = (&simulation.settings.processes, &simulation.particles.parts);
        let mut lengths = vec![0; processes.count()];
        lengths[parts.owner(place)] = self.state_len();
        let is_own = parts.is_own(processes, place);
        collected(processes, &lengths, if is_own { self.state_at(simulation, place) } else { Ok(Vec::new()) })
    }
}

/// The first number of a question for a probe. The number of the probe and the place of its particle follow.
pub(super) const PROBE: u64 = u64::MAX - 1;

/// Id and distance of the particle nearest to `point`, among the particles of `body` if it is given. Among equally near particles, the
/// smallest id counts.
///
/// ```
/// use bfree::output::nearest;
/// use bfree::tensor::Vector;
///
/// // The disc's centre is a node; the four particles around it are equally near, and the first of them is taken.
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let particles = scene.build::<2>("scenes".as_ref())?.particles;
/// let (id, distance) = nearest(&particles, &Vector::from([2.5, 2.5]), None).ok_or("particles")?;
/// assert_eq!(distance, 0.125 * 2_f64.sqrt());
/// assert_eq!(particles.by_id().position[id], Vector::from([2.375, 2.375]));
/// assert_eq!(nearest(&particles, &Vector::from([2.5, 2.5]), Some(1)), None); // no such body
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn nearest<const D: usize>(
    particles: &Particles<D>,
    point: &Vector<f64, D>,
    body: Option<u32>,
) -> Option<(usize, f64)> {
    let candidates = particles.id.iter().zip(&particles.position).zip(&particles.body);
    candidates
        .filter(|(_, of)| body.is_none_or(|body| body == **of))
        .map(|((&id, x), _)| (id as usize, (x - point).norm_squared()))
        .filter(|(_, distance)| distance.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
        .map(|(id, square)| (id, square.sqrt()))
}

/// The values of a probe, given by its number, at a particle. Those of a carried point are F d beside those of the particle in the position, H d in
/// the displacement.
fn values<const D: usize, L: Law, A>(
    number: usize,
    (probes, particle): (&[Probe<D>], usize),
    simulation: &Simulation<D, L, A>,
    reference: &Reference<D>,
) -> Result<Vec<f64>, OutputError> {
    let (probe, particles) = (&probes[number], &simulation.particles);
    probe.field.check(simulation)?;
    let count = particles.len();
    let place = particles.place(particle).ok_or(OutputError::NoParticle { particle, particles: count })?;
    let state = if probe.state_len() == 0 || particles.are_all_here() {
        probe.state_at(simulation, place)?
    } else {
        simulation.settings.processes.each([PROBE, number as u64, place as u64]);
        probe.exchanged(simulation, place)?.unwrap_or_default()
    };
    if probe.field.needs_state() {
        return Ok(state);
    }
    let mut values = Vec::new();
    probe.field.append(simulation, reference, particle, &mut values)?;
    let offset = probe.offset().filter(|_| probe.field == Field::Position).unwrap_or_else(Vector::zeros);
    values.iter_mut().zip(&offset).zip(state).for_each(|((value, offset), moved)| *value += offset + moved);
    Ok(values)
}

/// The present row of `probes.csv`.
pub(crate) fn row<const D: usize, L: Law, A>(
    probes: &[Probe<D>],
    simulation: &Simulation<D, L, A>,
    reference: &Reference<D>,
) -> Result<Row, OutputError> {
    reference.check(simulation)?;
    let mut row = vec![("time".to_owned(), cell(simulation.clock.time()))];
    for (number, probe) in probes.iter().enumerate() {
        let values = match probe.particle(&simulation.particles)? {
            Some(particle) => values(number, (probes, particle), simulation, reference)?,
            None => vec![f64::NAN; probe.field.kind().components().len()],
        };
        let cells = values.into_iter().map(cell);
        match probe.component {
            Some(component) => row.extend(cells.skip(component).take(1).map(|cell| (probe.name.clone(), cell))),
            None => row.extend(probe.field.columns(&probe.name, D).into_iter().zip(cells)),
        }
    }
    Ok(row)
}
