//! Probes of a scene and their particles.

use crate::output::{Place, Probe, nearest};
use crate::scene::{self, Scene, output::At};
use crate::simulation::Simulation;
use crate::tensor::Vector;
use serde_json::{Value, json};
use std::fmt::{Display, Formatter};

/// A probe of the scene, and the particle nearest to its point at the start.
pub(super) struct Bound<const D: usize> {
    pub probe: Probe<D>,
    particle: usize,
    /// Distance of the particle from the point given in the scene.
    distance: f64,
    /// Particle spacing of the particle's body.
    spacing: f64,
}

impl<const D: usize> Bound<D> {
    /// A warning if the nearest particle is farther away than the particle spacing.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.distance > self.spacing).then(|| {
            let consequence = match self.probe.place {
                Place::Particle(_) | Place::Carried { .. } => "it is followed all the same",
                Place::Nearest { .. } => "values are NaN while none is within one grid spacing",
            };
            format!(
                "probe {:?}: the nearest particle, {}, is {:.3e} away, more than the particle spacing {:.3e}; {consequence}",
                self.probe.name, self.particle, self.distance, self.spacing
            )
        })
    }

    /// The entry of the probe in the report.
    pub(crate) fn report(&self) -> Value {
        json!({"name": self.probe.name, "particle": self.particle, "distance": self.distance, "warning": self.warning()})
    }
}

impl<const D: usize> Display for Bound<D> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { probe: Probe { name, field, place, .. }, particle, distance, .. } = self;
        let kept = match place {
            Place::Particle(_) => "follows",
            Place::Carried { .. } => "carried by",
            Place::Nearest { .. } => "fixed in space, first sees",
        };
        write!(f, "{name}: {}, {kept} particle {particle}, {distance:.3e} from the place given", field.name())
    }
}

/// The probes of a scene, each with the particle nearest to it at the start.
pub(crate) fn bound_probes<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Vec<Bound<D>> {
    let particles = &simulation.particles;
    let bind = |probe: &scene::output::Probe| {
        let body = |name: &String| simulation.bodies.iter().position(|body| body.name == *name).map(|body| body as u32);
        let body = probe.body.as_ref().and_then(body);
        let (At::Particle(x) | At::BodyPoint(x) | At::Point(x)) = &probe.at;
        let point = Vector::<f64, D>::from_iterator(x.iter().copied());
        let (particle, distance) = nearest(particles, &point, body)?;
        let place = match &probe.at {
            At::Particle(_) => Place::Particle(particle),
            At::BodyPoint(_) => {
                Place::Carried { particle, offset: point - particles.position[particles.place(particle)?] }
            }
            At::Point(_) => Place::Nearest { point, body, within: simulation.grid.spacing },
        };
        let per_cell = scene.bodies.get(particles.body[particles.place(particle)?] as usize)?.particles_per_cell;
        let spacing = simulation.grid.spacing / f64::from(per_cell);
        let (name, field, component) = (probe.name.clone(), probe.field.clone(), probe.component());
        let probe = Probe { name, field, component, place };
        Some(Bound { probe, particle, distance, spacing })
    };
    scene.output.probes.iter().filter_map(bind).collect()
}
