//! The rows of every step in `history.csv`, with energies, momentum and iterations, in `reactions.csv`, `obstacles.csv` and `contacts.csv`.

use super::Reference;
use super::csv::{Row, cell, text};
use super::fields::padded;
use crate::approximation::ShapeFunction;
use crate::material::{DISSIPATED, Law, PLASTIC_STRAIN};
use crate::mechanics::loads::{Loads, Reaction, RigidBody};
use crate::simulation::{ContactForces, Simulation, Sums};
use crate::tensor::Vector;
use nalgebra::Rotation3;

/// Axis names at the ends of column names.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// The energies of a simulation, in the user's unit (per unit of the missing dimensions).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Σ ½ m v·v
    pub kinetic: f64,
    /// Σ V₀ W
    pub strain: f64,
    /// Work of gravity, tractions, pressure, moving walls and moving obstacles since the start.
    pub external: f64,
    /// The energy stored in contact.
    pub contact: f64,
    /// Kinetic, strain and contact energy.
    pub total: f64,
    /// Energy dissipated since the start by damping, friction, plastic flow and relaxation.
    pub dissipated: f64,
    /// The part of `dissipated` due to plastic flow and relaxation.
    pub by_laws: f64,
    /// The part of `dissipated` due to friction of contact.
    pub friction: f64,
    /// total₀ + dissipated₀ − external₀ when the reference was taken, see [`Reference::energy`].
    pub initial: f64,
    /// total + dissipated − initial − external: energy that the time integration and the transfers have gained (> 0) or lost.
    pub balance: f64,
}

impl Energies {
    /// The energies of the present state.
    ///
    /// ```
    /// use bfree::output::{Reference, history::Energies};
    ///
    /// let falling = "gravity={\"acceleration\": [0, -1]}".parse()?;
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[falling])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let reference = Reference::of(&simulation);
    /// for _ in 0..3 {
    ///     simulation.step()?;
    /// }
    /// // The work of gravity has become kinetic energy, ½ M (g t)².
    /// let energies = Energies::of(&simulation, &reference);
    /// let (mass, t) = (simulation.particles.mass.iter().sum::<f64>(), simulation.clock.time());
    /// assert!((energies.external / (0.5 * mass * t * t) - 1.0).abs() < 1e-10);
    /// assert!(energies.balance.abs() < 1e-10 * energies.total);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of<const D: usize, L: Law, A: ShapeFunction>(
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
    ) -> Self {
        Self::with(simulation, reference, &simulation.sums_here())
    }

    /// The energies of the present state, whose sums over all particles are known.
    pub(crate) fn with<const D: usize, L: Law, A: ShapeFunction>(
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        sums: &Sums<D>,
    ) -> Self {
        let Sums { kinetic, strain, by_laws, .. } = *sums;
        let dissipated = simulation.dissipated + by_laws;
        let friction = simulation.loads.contacts.friction_loss();
        let contact = simulation.contact_energy();
        let (external, total, initial) = (simulation.external_work, kinetic + strain + contact, reference.energy);
        let balance = total + dissipated - initial - external;
        Self { kinetic, strain, external, contact, dissipated, by_laws, friction, initial, total, balance }
    }
}

/// Length of a step, its iterations, and its plastic flow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cost {
    /// Δt; 0 for the initial state.
    pub dt: f64,
    /// Newton iterations.
    pub newton: usize,
    /// Krylov iterations of all linear systems in the step.
    pub krylov: usize,
    /// Volume fraction with plastic flow, among bodies with a plastic law.
    pub yielding: f64,
}

/// The row of the present state in `history.csv`. Columns without meaning in a run are left out. In load steps, loads act at once, and an
/// energy balance says nothing of their work.
pub(crate) fn row<const D: usize, L: Law, A>(
    simulation: &Simulation<D, L, A>,
    energies: &Energies,
    momentum: &Vector<f64, D>,
    cost: Cost,
) -> Row {
    let Energies { kinetic, strain, external, contact, dissipated, friction, total, balance, .. } = *energies;
    let scheme = &simulation.settings.scheme;
    let contacts = &simulation.loads.contacts;
    let dissipates =
        simulation.loads.damping.is_some() || contacts.have_friction() || simulation.has_internal_variable(DISSIPATED);
    let momentum = padded(momentum);
    let columns = [
        (true, "step", cell(simulation.clock.steps())),
        (true, "time", cell(simulation.clock.time())),
        (scheme.follows_path(), "load", cell(simulation.path.load)),
        (true, "dt", cell(cost.dt)),
        (true, "kinetic", cell(kinetic)),
        (true, "strain", cell(strain)),
        (true, "external", cell(external)),
        (contacts.exist(), "contact", cell(contact)),
        (dissipates, "dissipated", cell(dissipated)),
        (contacts.have_friction(), "friction", cell(friction)),
        (true, "total", cell(total)),
        (scheme.has_inertia(), "balance", cell(balance)),
        (true, "momentum_x", cell(momentum[0])),
        (D > 1, "momentum_y", cell(momentum[1])),
        (D > 2, "momentum_z", cell(momentum[2])),
        (true, "newton", cell(cost.newton)),
        (true, "krylov", cell(cost.krylov)),
        (simulation.has_internal_variable(PLASTIC_STRAIN), "yielding", cell(cost.yielding)),
    ];
    columns.into_iter().filter(|(is_there, ..)| *is_there).map(|(_, name, cell)| (name.to_owned(), cell)).collect()
}

/// The row of a step that ended at `time` in `reactions.csv`. Every prescribed condition has one column per axis, such as `name_x`. A rotation also has the
/// column `name_torque`.
pub(crate) fn reactions<const D: usize>(time: f64, loads: &Loads<D>, reactions: &[Reaction<D>]) -> Row {
    let mut row = vec![("time".to_owned(), cell(time))];
    for (condition, reaction) in loads.prescribed.iter().zip(reactions) {
        let name = &condition.name;
        row.extend(by_axis(name, &reaction.force));
        row.extend(condition.rotation().map(|_| (format!("{name}_torque"), cell(reaction.torque))));
    }
    row
}

/// The row of a step that ended at `time` in `obstacles.csv`. Columns begin with the name of the obstacle: the force and the moment on the
/// obstacle, the area of contact, the largest depth, and the work and the friction loss since the start.
pub(crate) fn obstacles<const D: usize>(time: f64, loads: &Loads<D>, contacts: &[ContactForces<D>]) -> Row {
    let mut row = vec![("time".to_owned(), cell(time))];
    for (obstacle, contact) in loads.contacts.obstacles.iter().zip(contacts) {
        add_contact(&mut row, &format!("{}_", obstacle.name), contact);
        row.push((format!("{}_work", obstacle.name), cell(contact.work)));
        if obstacle.has_friction() {
            row.push((format!("{}_friction_loss", obstacle.name), cell(contact.friction_loss)));
        }
        if let Some(body) = &obstacle.free {
            add_free(&mut row, &obstacle.name, body);
        }
    }
    row
}

/// Adds the centre of mass of a free obstacle, its rotation vector (axis times angle), its velocity, its angular velocity, and its kinetic
/// energy.
fn add_free<const D: usize>(row: &mut Row, name: &str, body: &RigidBody<D>) {
    let turned = Rotation3::from_matrix_unchecked(body.rotation).scaled_axis();
    row.extend(by_axis(&format!("{name}_position"), &body.position));
    row.extend(by_axis(&format!("{name}_velocity"), body.velocity.iter().take(D)));
    row.extend(axial::<D>(&format!("{name}_angle"), &turned));
    row.extend(axial::<D>(&format!("{name}_spin"), &body.spin()));
    row.push((format!("{name}_kinetic"), cell(body.kinetic_energy())));
}

/// A cell for each component of a vector.
fn by_axis<'a>(name: &str, vector: impl IntoIterator<Item = &'a f64>) -> Row {
    AXES.iter().zip(vector).map(|(axis, x)| (format!("{name}_{axis}"), cell(x))).collect()
}

/// The cells of a moment or a rotation: none in 1D, one in the plane, and one for each axis in space.
fn axial<'a, const D: usize>(name: &str, vector: impl IntoIterator<Item = &'a f64>) -> Row {
    match D {
        1 => Row::new(),
        2 => vector.into_iter().skip(2).map(|x| (name.to_owned(), cell(x))).collect(),
        _ => by_axis(name, vector),
    }
}

/// The row of a pair of bodies in `contacts.csv`, for a step that ended at `time`: the force and the moment on the second body, the area, the
/// largest depth, and the friction loss since the start.
pub(crate) fn pair<const D: usize>(time: f64, names: [&str; 2], contact: &ContactForces<D>) -> Row {
    let mut row = vec![("time".to_owned(), cell(time))];
    row.extend(["first", "second"].into_iter().zip(names).map(|(which, name)| (which.to_owned(), text(name))));
    add_contact(&mut row, "", contact);
    row.push(("friction_loss".to_owned(), cell(contact.friction_loss)));
    row
}

/// Adds force, moment, area and depth of a contact.
fn add_contact<const D: usize>(row: &mut Row, prefix: &str, contact: &ContactForces<D>) {
    row.extend(AXES.iter().zip(&contact.force).map(|(axis, force)| (format!("{prefix}{axis}"), cell(force))));
    row.extend(axial::<D>(&format!("{prefix}moment"), &contact.moment));
    row.push((format!("{prefix}area"), cell(contact.area)));
    row.push((format!("{prefix}depth"), cell(contact.depth)));
}
