//! Checks that the products formed in a step fit into floating point. Norms square forces, and energies multiply moduli by volumes.

use super::BuildError;
use super::Scene;
use super::boundary::{Driving, Face};
use super::curve::Curve;
use super::load::Gravity;
use crate::material::p_wave_modulus;
use crate::mechanics::loads::Pressing;
use crate::mechanics::schemes::Alphas;
use crate::simulation::Simulation;
use crate::tensor::Vector;

/// The largest allowed force: norms sum its square over all nodes.
const LARGEST_FORCE: f64 = 1e120;

/// The smallest allowed value of the largest force that resists a motion. Newton's method reduces forces by a further factor of 1e-15, and
/// squares them.
const SMALLEST_RESISTANCE: f64 = 1e-120;

/// Refuses a simulation whose masses, volumes, forces or energies are not representable.
pub(super) fn check<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Result<(), BuildError> {
    let scales = Scales::of(simulation);
    for body in 0..simulation.bodies.len() {
        require(&format!("bodies[{body}]"), &scales.of_body(body))?;
    }
    if let Some(gravity) = &scene.gravity {
        require("gravity", &[Quantity::force("the weight of a particle", scales.weight(gravity))])?;
    }
    for (name, face) in scene.boundary.faces().into_iter().take(2 * D) {
        if let Some(motion) = face.and_then(Face::driving) {
            scales.check_motion(&format!("boundary.{name}"), motion)?;
        }
    }
    for (i, prescribed) in scene.prescribed.iter().enumerate() {
        prescribed.given().try_for_each(|motion| scales.check_motion(&format!("prescribed[{i}]"), motion))?;
    }
    check_surface_loads(scene, simulation)
}

/// The quantities from which the forces and energies of a step follow.
struct Scales<'a, const D: usize> {
    simulation: &'a Simulation<D>,
    /// Acceleration and velocity at the end of the step as functions of the motion.
    alphas: Alphas,
    /// The particles of each body.
    bodies: Vec<Extremes>,
}

impl<'a, const D: usize> Scales<'a, D> {
    fn of(simulation: &'a Simulation<D>) -> Self {
        let particles = &simulation.particles;
        let extremes = |body: usize| {
            let mut extremes = Extremes::default();
            for p in (0..particles.len()).filter(|&p| particles.body[p] as usize == body && particles.is_solid(p)) {
                let speed = particles.velocity.get(p).map_or(0.0, Vector::amax);
                extremes.add(particles.volume[p], particles.mass[p], speed);
            }
            extremes
        };
        Self {
            simulation,
            alphas: simulation.settings.scheme.end(simulation.clock.nominal()),
            bodies: (0..simulation.bodies.len()).map(extremes).collect(),
        }
    }

    fn of_body(&self, body: usize) -> [Quantity; 8] {
        let Extremes { smallest_volume, largest_volume, smallest_mass, largest_mass, largest_speed } =
            self.bodies[body];
        let h = self.simulation.grid.spacing;
        let modulus = p_wave_modulus(&self.simulation.bodies[body].law);
        let resistance = (self.alphas.a1 * smallest_mass * h).max(modulus * smallest_volume / h);
        [
            Quantity::normal("the smallest particle volume", smallest_volume),
            Quantity::normal("the smallest particle mass", smallest_mass),
            Quantity::force(
                "the force that moves a particle by a cell in one step, mass spacing / (beta step²),",
                self.alphas.a1 * largest_mass * h,
            ),
            Quantity::force(
                "the stiffness force of a particle, modulus volume / spacing,",
                modulus * largest_volume / h,
            ),
            Quantity::force("the energy of a particle, modulus volume,", modulus * largest_volume),
            Quantity::force(
                "the force that stops a particle in one step, mass speed / (beta step),",
                self.alphas.a2 * largest_mass * largest_speed,
            ),
            Quantity::force(
                "the kinetic energy of a particle, mass speed²,",
                largest_mass * largest_speed * largest_speed,
            ),
            Quantity {
                least: SMALLEST_RESISTANCE,
                ..Quantity::force(
                    "the smallest force that resists a motion by a cell (inertia or stiffness)",
                    resistance,
                )
            },
        ]
    }

    /// The mass of the heaviest particle.
    fn heaviest(&self) -> f64 {
        self.bodies.iter().fold(0.0, |heaviest: f64, body| heaviest.max(body.largest_mass))
    }

    /// The largest weight of a particle.
    fn weight(&self, gravity: &Gravity) -> f64 {
        let largest = gravity.acceleration.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let profile = gravity.profile.as_ref().map(|profile| &profile.factor);
        self.heaviest() * largest * largest_factor(gravity.curve.as_ref()) * largest_factor(profile)
    }

    /// Refuses a motion for which a particle needs too large a force.
    fn check_motion(&self, path: &str, motion: Driving<'_>) -> Result<(), BuildError> {
        let grid = &self.simulation.grid;
        let acceleration = match motion {
            Driving::Displacement(table) => self.alphas.a1 * table.largest(),
            Driving::Velocity(table) => self.alphas.a2 * table.largest(),
            Driving::Rotation(rotation) => {
                let across = grid.spacing * grid.cells.iter().map(|&n| f64::from(n)).sum::<f64>();
                self.alphas.a2 * rotation.fastest() * across
            }
        };
        let force = Quantity::force("the force that moves a particle so in one step", self.heaviest() * acceleration);
        require(path, &[force])
    }
}

/// Refuses a surface load with too large a force on a point.
fn check_surface_loads<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Result<(), BuildError> {
    let curves = scene.tractions.iter().map(|load| &load.curve).chain(scene.pressures.iter().map(|load| &load.curve));
    for ((k, load), curve) in simulation.loads.surface.iter().enumerate().zip(curves) {
        let (path, stress) = match load.pressing {
            Pressing::Traction(traction) => (format!("tractions[{k}]"), traction.amax()),
            Pressing::Pressure(pressure) => (format!("pressures[{}]", k - scene.tractions.len()), pressure.abs()),
        };
        let area = load.points.iter().fold(0.0, |most: f64, point| most.max(point.area));
        let force = stress * area * largest_factor(curve.as_ref());
        require(&path, &[Quantity::force("the force on a particle", force)])?;
    }
    Ok(())
}

/// The extreme values of the particles of a body.
#[derive(Clone, Copy)]
struct Extremes {
    smallest_volume: f64,
    largest_volume: f64,
    smallest_mass: f64,
    largest_mass: f64,
    largest_speed: f64,
}

impl Default for Extremes {
    fn default() -> Self {
        Self {
            smallest_volume: f64::INFINITY,
            largest_volume: 0.0,
            smallest_mass: f64::INFINITY,
            largest_mass: 0.0,
            largest_speed: 0.0,
        }
    }
}

impl Extremes {
    fn add(&mut self, volume: f64, mass: f64, speed: f64) {
        self.smallest_volume = self.smallest_volume.min(volume);
        self.largest_volume = self.largest_volume.max(volume);
        self.smallest_mass = self.smallest_mass.min(mass);
        self.largest_mass = self.largest_mass.max(mass);
        self.largest_speed = self.largest_speed.max(speed);
    }
}

/// The largest magnitude of the factors of a curve; 1 without a curve.
fn largest_factor(curve: Option<&Curve>) -> f64 {
    curve.map_or(1.0, |curve| curve.0.iter().fold(0.0, |most: f64, row| most.max(row[1].abs())))
}

/// A quantity and its allowed range.
struct Quantity {
    name: &'static str,
    value: f64,
    least: f64,
    most: f64,
}

impl Quantity {
    /// A force or an energy.
    fn force(name: &'static str, value: f64) -> Self {
        Self { name, value, least: 0.0, most: LARGEST_FORCE }
    }

    /// A positive number with all its digits.
    fn normal(name: &'static str, value: f64) -> Self {
        Self { name, value, least: f64::MIN_POSITIVE, most: f64::MAX }
    }
}

fn require(path: &str, quantities: &[Quantity]) -> Result<(), BuildError> {
    for &Quantity { name, value, least, most } in quantities {
        if !(least..=most).contains(&value) {
            return Err(BuildError::Scale { path: path.to_owned(), what: name, value, least, most });
        }
    }
    Ok(())
}
