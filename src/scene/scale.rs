//! Checks that the products formed in a step fit into floating point. Norms square forces, and energies multiply moduli by volumes.

use super::BuildError;
use super::Scene;
use super::boundary::{Driving, Face};
use super::load::Curve;
use crate::material::p_wave_modulus;
use crate::mechanics::loads::Pressing;
use crate::simulation::Simulation;
use crate::tensor::Vector;

/// The largest allowed force: norms sum its square over all nodes.
const MOST: f64 = 1e120;

/// The smallest allowed value of the largest force that resists a motion. Newton's method reduces forces by a further factor of 1e-15, and
/// squares them.
const LEAST: f64 = 1e-120;

/// A quantity: name, value, smallest and largest allowed value.
type Quantity = (&'static str, f64, f64, f64);

/// Refuses a simulation whose masses, volumes, forces or energies are not representable.
pub(super) fn check<const D: usize>(scene: &Scene, simulation: &Simulation<D>) -> Result<(), BuildError> {
    let alphas = simulation.settings.scheme.end(simulation.clock.nominal());
    let (particles, h) = (&simulation.particles, simulation.grid.spacing);
    let mut heaviest: f64 = 0.0;
    for (i, body) in simulation.bodies.iter().enumerate() {
        let mut extremes = Extremes::default();
        for p in (0..particles.len()).filter(|&p| particles.body[p] as usize == i && particles.is_solid(p)) {
            let speed = particles.velocity.get(p).map_or(0.0, Vector::amax);
            extremes.add(particles.volume[p], particles.mass[p], speed);
        }
        let Extremes { volume, mass, speed } = extremes;
        heaviest = heaviest.max(mass.1);
        let modulus = p_wave_modulus(&body.law);
        let normal = (f64::MIN_POSITIVE, f64::MAX);
        let resistance = (alphas.a1 * mass.0 * h).max(modulus * volume.0 / h);
        let quantities: [Quantity; 8] = [
            ("the smallest particle volume", volume.0, normal.0, normal.1),
            ("the smallest particle mass", mass.0, normal.0, normal.1),
            (
                "the force that moves a particle by a cell in one step, mass spacing / (beta step²),",
                alphas.a1 * mass.1 * h,
                0.0,
                MOST,
            ),
            ("the stiffness force of a particle, modulus volume / spacing,", modulus * volume.1 / h, 0.0, MOST),
            ("the energy of a particle, modulus volume,", modulus * volume.1, 0.0, MOST),
            (
                "the force that stops a particle in one step, mass speed / (beta step),",
                alphas.a2 * mass.1 * speed,
                0.0,
                MOST,
            ),
            ("the kinetic energy of a particle, mass speed²,", mass.1 * speed * speed, 0.0, MOST),
            ("the smallest force that resists a motion by a cell (inertia or stiffness)", resistance, LEAST, MOST),
        ];
        require(&format!("bodies[{i}]"), &quantities)?;
    }
    if let Some(gravity) = &scene.gravity {
        let largest = gravity.acceleration.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let profile = gravity.profile.as_ref().map(|profile| &profile.factor);
        let weight = heaviest * largest * factor(gravity.curve.as_ref()) * factor(profile);
        require("gravity", &[("the weight of a particle", weight, 0.0, MOST)])?;
    }
    let across = simulation.grid.spacing * simulation.grid.cells.iter().map(|&n| f64::from(n)).sum::<f64>();
    let driven = |path: &str, driving: Driving<'_>| {
        let motion = match driving {
            Driving::Displacement(table) => alphas.a1 * table.largest(),
            Driving::Velocity(table) => alphas.a2 * table.largest(),
            Driving::Rotation(rotation) => alphas.a2 * rotation.fastest() * across,
        };
        require(path, &[("the force that moves a particle so in one step", heaviest * motion, 0.0, MOST)])
    };
    for (name, face) in scene.boundary.faces().into_iter().take(2 * D) {
        if let Some(driving) = face.and_then(Face::driving) {
            driven(&format!("boundary.{name}"), driving)?;
        }
    }
    for (i, motion) in scene.prescribed.iter().enumerate() {
        motion.given().try_for_each(|driving| driven(&format!("prescribed[{i}]"), driving))?;
    }
    let curves = scene.tractions.iter().map(|load| &load.curve).chain(scene.pressures.iter().map(|load| &load.curve));
    for ((k, load), curve) in simulation.loads.surface.iter().enumerate().zip(curves) {
        let (path, stress) = match load.pressing {
            Pressing::Traction(traction) => (format!("tractions[{k}]"), traction.amax()),
            Pressing::Pressure(pressure) => (format!("pressures[{}]", k - scene.tractions.len()), pressure.abs()),
        };
        let area = load.points.iter().fold(0.0, |most: f64, point| most.max(point.area));
        require(&path, &[("the force on a particle", stress * area * factor(curve.as_ref()), 0.0, MOST)])?;
    }
    Ok(())
}

/// The smallest and largest particle volume and mass, and the largest speed.
struct Extremes {
    volume: (f64, f64),
    mass: (f64, f64),
    speed: f64,
}

impl Default for Extremes {
    fn default() -> Self {
        Self { volume: (f64::INFINITY, 0.0), mass: (f64::INFINITY, 0.0), speed: 0.0 }
    }
}

impl Extremes {
    fn add(&mut self, volume: f64, mass: f64, speed: f64) {
        let widened = |(least, most): (f64, f64), x: f64| (least.min(x), most.max(x));
        (self.volume, self.mass, self.speed) =
            (widened(self.volume, volume), widened(self.mass, mass), self.speed.max(speed));
    }
}

/// The largest magnitude of the factors of a curve; 1 without a curve.
fn factor(curve: Option<&Curve>) -> f64 {
    curve.map_or(1.0, |curve| curve.0.iter().fold(0.0, |most: f64, row| most.max(row[1].abs())))
}

fn require(path: &str, quantities: &[Quantity]) -> Result<(), BuildError> {
    for &(what, value, least, most) in quantities {
        if !(least..=most).contains(&value) {
            return Err(BuildError::Scale { path: path.to_owned(), what, value, least, most });
        }
    }
    Ok(())
}
