//! `history.csv`: energies, momentum and iterations of every step.

use super::csv::{Row, Table};
use super::files::Written;
use super::{OutputError, Reference};
use crate::approximation::ShapeFunction;
use crate::material::{DISSIPATED, Law, PLASTIC_STRAIN};
use crate::simulation::Simulation;
use std::path::PathBuf;

/// Axis names at the ends of column names.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// The energies of a simulation, in the user's unit (per unit of the missing dimensions).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energies {
    /// Σ ½ m v·v
    pub kinetic: f64,
    /// Σ V₀ W
    pub strain: f64,
    /// Work of gravity, tractions, pressure and moving walls since the start.
    pub external: f64,
    /// Kinetic and strain energy.
    pub total: f64,
    /// Energy dissipated since the start by damping, plastic flow and relaxation.
    pub dissipated: f64,
    /// The part of `dissipated` due to plastic flow and relaxation.
    pub by_laws: f64,
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
        let (kinetic, strain) = (simulation.particles.kinetic_energy(), simulation.strain_energy());
        let by_laws = simulation.dissipated_by_laws();
        let dissipated = simulation.dissipated + by_laws;
        let (external, total, initial) = (simulation.external_work, kinetic + strain, reference.energy);
        let balance = total + dissipated - initial - external;
        Self { kinetic, strain, external, dissipated, by_laws, initial, total, balance }
    }
}

/// Length of a step, its iterations, and its plastic flow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Δt; 0 for the initial state.
    pub dt: f64,
    /// Newton iterations.
    pub newton: usize,
    /// Krylov iterations of all linear systems in the step.
    pub krylov: usize,
    /// Volume fraction with plastic flow, among bodies with a plastic law.
    pub yielding: f64,
}

/// Writes `history.csv`.
///
/// ```
/// use bfree::output::{Reference, history::{Cost, History}};
///
/// let (folder, scene) = (tempfile::tempdir()?, bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?);
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let path = folder.path().join("history.csv");
/// let mut history = History::open(path.clone(), &simulation, None)?;
/// let energies = history.write(&simulation, &Reference::of(&simulation), Cost::default())?;
/// history.flush()?;
/// // The file gives back the same bits.
/// let text = std::fs::read_to_string(path)?;
/// let (names, row) = text.trim_end().split_once('\n').ok_or("two lines")?;
/// let column = names.split(',').position(|name| name == "kinetic").ok_or("a column")?;
/// assert_eq!(row.split(',').nth(column).ok_or("a value")?.parse::<f64>()?, energies.kinetic);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct History {
    pub(crate) table: Table,
    /// Whether there is inertia. In load steps, loads act at once, and an energy balance says nothing of their work.
    has_inertia: bool,
    dissipates: bool,
    follows_path: bool,
    yields: bool,
}

impl History {
    /// Creates the file with the columns of the simulation, or continues a file after its first `kept` bytes.
    ///
    /// # Errors
    /// The operating system refuses, or the file to be continued has other columns.
    pub fn open<const D: usize, L: Law, A>(
        path: PathBuf,
        simulation: &Simulation<D, L, A>,
        kept: Option<Written>,
    ) -> Result<Self, OutputError> {
        let has_inertia = simulation.settings.scheme.has_inertia();
        let dissipates = simulation.loads.damping.is_some() || simulation.has_internal_variable(DISSIPATED);
        let (follows_path, yields) =
            (simulation.settings.scheme.follows_path(), simulation.has_internal_variable(PLASTIC_STRAIN));
        let mut columns: Vec<String> = ["step", "time"].map(str::to_owned).into();
        columns.extend(follows_path.then(|| "load".into()));
        columns.extend(["dt", "kinetic", "strain", "external"].map(str::to_owned));
        columns.extend(dissipates.then(|| "dissipated".into()));
        columns.push("total".into());
        columns.extend(has_inertia.then(|| "balance".into()));
        columns.extend(AXES.iter().take(D).map(|axis| format!("momentum_{axis}")));
        columns.extend(["newton", "krylov"].map(str::to_owned));
        columns.extend(yields.then(|| "yielding".into()));
        Ok(Self { table: Table::open(path, &columns, kept)?, has_inertia, dissipates, follows_path, yields })
    }

    /// Appends the present state and returns its energies.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn write<const D: usize, L: Law, A: ShapeFunction>(
        &mut self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        cost: Cost,
    ) -> Result<Energies, OutputError> {
        let energies = Energies::of(simulation, reference);
        let mut row = Row::default();
        row.push(simulation.clock.steps());
        row.push(simulation.clock.time());
        row.extend(self.follows_path.then_some(simulation.path.load));
        row.push(cost.dt);
        row.extend([energies.kinetic, energies.strain, energies.external]);
        row.extend(self.dissipates.then_some(energies.dissipated));
        row.push(energies.total);
        row.extend(self.has_inertia.then_some(energies.balance));
        row.extend(simulation.particles.momentum().iter().copied());
        row.push(cost.newton);
        row.push(cost.krylov);
        row.extend(self.yields.then_some(cost.yielding));
        self.table.row(&row)?;
        Ok(energies)
    }

    /// Hands buffered rows to the operating system.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn flush(&mut self) -> Result<(), OutputError> {
        self.table.0.flush()
    }
}
