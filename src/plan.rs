//! The requirements of a scene: the terms in use and why, the number of unknowns, and the memory of each array.

mod arrays;
mod of_processes;
mod on_gpu;

pub use arrays::ArrayUse;
pub use of_processes::ProcessUse;
pub use on_gpu::DeviceUse;

use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::dilatation::Cells;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::loads::{Motion, Pressing, SurfaceLoad, SurfacePoint};
use crate::mechanics::reference::GridReset;
use crate::mechanics::sweep::{Connectivity, ShapeFunctionError};
use crate::mechanics::terms::{Reason, planned};
use crate::particles::Body;
use crate::simulation::{SharedNodes, Simulation};
use crate::solver::{Krylov, Preconditioning};
use crate::tensor::Vector;
use arrays::arrays;
use indicatif::BinaryBytes;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};

/// The points of a loaded surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceUse {
    /// The load.
    pub load: &'static str,
    /// The number of loaded points. They lie on the surface, or are particles of the body if the scene gives normal and area.
    pub points: usize,
    /// The reference area of all points together.
    pub area: f64,
    /// The areas of the sides: those whose outward normals lie along an axis, by the axis and its sign, and "oblique" for all others.
    pub sides: BTreeMap<String, f64>,
    /// The resultant force at the start, where the curve is 1.
    pub force: Vec<f64>,
}

impl SurfaceUse {
    /// One entry for each surface load of a simulation.
    ///
    /// ```
    /// use bfree::plan::SurfaceUse;
    ///
    /// let scene = bfree::scene::read_file("scenes/cantilever.json".as_ref(), &[])?;
    /// let surfaces = SurfaceUse::of(&scene.build::<2>("scenes".as_ref())?);
    /// // The end of a beam of height 1, four points for each ¼ of it.
    /// let [end] = surfaces.as_slice() else { return Err("one load".into()) };
    /// assert_eq!((end.load, end.points), ("traction", 16));
    /// assert!((end.area - 1.0).abs() < 1e-14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of<const D: usize, L, A>(simulation: &Simulation<D, L, A>) -> Vec<Self> {
        let describe = |load: &SurfaceLoad<D>| {
            let mut sides = BTreeMap::new();
            let mut force = Vector::<f64, D>::zeros();
            for SurfacePoint { normal, area, .. } in &load.points {
                *sides.entry(side(normal)).or_default() += area;
                force += match &load.pressing {
                    Pressing::Traction(traction) => traction * *area,
                    Pressing::Pressure(pressure) => normal * (-pressure * area),
                };
            }
            Self {
                load: match load.pressing {
                    Pressing::Traction(_) => "traction",
                    Pressing::Pressure(_) => "follower pressure",
                },
                points: load.points.len(),
                area: load.points.iter().map(|point| point.area).sum(),
                sides,
                force: force.iter().copied().collect(),
            }
        };
        simulation.loads.surface.iter().map(describe).collect()
    }
}

/// The side of a body with an outward unit normal: "right" for +x, "left" for −x, and so on.
fn side<const D: usize>(normal: &Vector<f64, D>) -> String {
    const SIDES: [[&str; 2]; 3] = [["left", "right"], ["bottom", "top"], ["back", "front"]];
    let k = normal.iamax();
    let is_along = normal[k].abs() > 1.0 - 1e-6;
    if is_along { SIDES[k.min(2)][usize::from(normal[k] > 0.0)].to_owned() } else { "oblique".to_owned() }
}

/// A run needs more memory than is available.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the run needs {} of memory at one time, and {} can be had: use a coarser grid, fewer particles per cell, or fewer Krylov \
     vectors (solver.krylov.method)", BinaryBytes(*needed), BinaryBytes(*memory)
)]
pub struct TooLarge {
    /// Bytes that the arrays of a step hold at one time.
    pub needed: u64,
    /// Bytes available.
    pub memory: u64,
}

/// The requirements of a run of a simulation, in its present state.
///
/// ```
/// use bfree::plan::Plan;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let plan = Plan::of(&scene.build::<2>("scenes".as_ref())?)?;
/// assert_eq!((plan.particles, plan.grid_nodes), (112, 31 * 11));
/// // Each active node has two unknowns, except on walls.
/// assert!(plan.active_nodes < 341 && plan.unknowns <= 2 * plan.active_nodes);
/// // A step reuses the arrays of the step before.
/// assert_eq!(plan.bytes(), plan.arrays.iter().map(|array| array.bytes).sum::<u64>());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Number of particles.
    pub particles: usize,
    /// Nodes of the whole grid.
    pub grid_nodes: u64,
    /// Nodes with N ≠ 0 or ∇N ≠ 0 for some particle.
    pub active_nodes: usize,
    /// Free degrees of freedom of the first step.
    pub unknowns: usize,
    /// When the grid is reset.
    pub grid_reset: GridReset,
    /// The method that solves the linear systems, and the reason.
    pub krylov: (Krylov, &'static str),
    /// The preconditioner of the linear systems, and the reason.
    pub preconditioner: (Preconditioning, &'static str),
    /// Terms of the residual and parts of the step: the name, whether it is computed, and the reason.
    pub terms: Vec<(&'static str, bool, String)>,
    /// The large arrays.
    pub arrays: Vec<ArrayUse>,
    /// The points and the area assumed for each loaded surface.
    pub surfaces: Vec<SurfaceUse>,
    /// Bodies that share nodes at the start, in words.
    pub shared_nodes: Vec<String>,
}

impl Plan {
    /// The plan of a simulation, from its shape functions at the present positions.
    ///
    /// # Errors
    /// A particle has no shape functions.
    pub fn of<const D: usize, L: Law, A: ShapeFunction>(
        simulation: &Simulation<D, L, A>,
    ) -> Result<Self, ShapeFunctionError> {
        let connectivity = simulation.new_connectivity(None)?;
        let nodes = connectivity.active();
        let prescribed = simulation.prescribed(nodes);
        let space = connectivity.space(prescribed.iter().map(PrescribedDof::place));
        let cells = mixed_cells(simulation, &connectivity);
        Ok(Self {
            dimension: D,
            particles: simulation.particles.solid_places().len(),
            grid_nodes: simulation.grid.node_count(),
            active_nodes: nodes.len(),
            unknowns: space.unknowns() + cells,
            grid_reset: simulation.settings.grid_reset,
            krylov: simulation.krylov(),
            preconditioner: simulation.preconditioner(),
            terms: terms(simulation, &connectivity, cells),
            arrays: arrays(simulation, &connectivity, cells),
            surfaces: SurfaceUse::of(simulation),
            shared_nodes: shared_nodes(simulation, &connectivity),
        })
    }

    /// Bytes of all arrays together. A step reuses the arrays of the step before.
    pub fn bytes(&self) -> u64 {
        self.arrays.iter().map(|array| array.bytes).sum()
    }

    /// Whether the arrays fit into `memory` bytes.
    ///
    /// ```
    /// use bfree::plan::Plan;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let plan = Plan::of(&scene.build::<2>("scenes".as_ref())?)?;
    /// assert_eq!(plan.check_fits(plan.bytes()), Ok(()));
    /// let short = plan.check_fits(plan.bytes() - 1).unwrap_err();
    /// assert_eq!(short.needed, short.memory + 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The arrays do not fit.
    pub fn check_fits(&self, memory: u64) -> Result<(), TooLarge> {
        let needed = self.bytes();
        if needed <= memory { Ok(()) } else { Err(TooLarge { needed, memory }) }
    }
}

/// The number of averaged cells whose dilatations are unknowns of their own.
fn mixed_cells<const D: usize, L: Law, A>(simulation: &Simulation<D, L, A>, connectivity: &Connectivity<D>) -> usize {
    let cells = || Cells::of(&simulation.particles, &simulation.bodies, connectivity);
    if simulation.is_mixed() { cells().map_or(0, |cells| cells.scales.len()) } else { 0 }
}

/// Bodies that share nodes, and how far apart they are.
fn shared_nodes<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &Simulation<D, L, A>,
    connectivity: &Connectivity<D>,
) -> Vec<String> {
    let said = |one: &SharedNodes| {
        let [a, b] = one.bodies.map(|body| &simulation.bodies[body as usize].name);
        let gap = one.gap.map_or_else(|| "more than 4".to_owned(), |gap| format!("{:.2}", gap.max(0.0)));
        format!(
            "{a:?} and {b:?} share nodes at the start, at a gap of {gap} spacings: they move as one there, and will not separate"
        )
    };
    simulation.shared_nodes(connectivity).iter().map(said).collect()
}

fn terms<const D: usize, L: Law, A>(
    simulation: &Simulation<D, L, A>,
    connectivity: &Connectivity<D>,
    cells: usize,
) -> Vec<Reason> {
    let loads = &simulation.loads;
    let settings = &simulation.settings;
    let scheme = &*settings.scheme;
    let smooths = scheme.has_inertia() && settings.smoothing.is_some();
    let moving = loads.prescribed.iter().flat_map(|one| &one.motion).flatten().any(|motion| *motion != Motion::Rest);
    let averages = simulation.bodies.iter().any(Body::averages);
    let aggregated = connectivity.extension().map_or("only with aggregation".into(), |extension| {
        format!("{} of {} active nodes follow well-supported ones", extension.len(), connectivity.nodes())
    });
    let choice_of_laws = match simulation.bodies.len() {
        1 => "only with several bodies; the law of the only one is looked up once in a pass over the particles".into(),
        count => format!("the law of each of {count} bodies is looked up once in a pass over the particles"),
    };
    let mut all = planned(loads, scheme, settings.lumping, averages, simulation.may_reset());
    all.extend([
        (
            "dilatation of cells",
            cells > 0,
            format!("{cells} cells have an unknown of their own: nearly incompressible, in long steps, not with energy_momentum"),
        ),
        ("aggregation", settings.aggregation, aggregated),
        ("smoothing", smooths, "only with a transfer other than flip".into()),
        ("choice of laws", simulation.bodies.len() > 1, choice_of_laws),
        ("third axis", D == 3, format!("grid.size has {D} components: so has every vector")),
        ("prescribed nodes", !loads.prescribed.is_empty(), format!("{} conditions", loads.prescribed.len())),
        ("work of moving walls", moving, "only where a prescribed motion does not rest".into()),
    ]);
    all
}

impl Display for Plan {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let kinematics = ["uniaxial strain", "plane strain", "three dimensions"][(self.dimension - 1).min(2)];
        writeln!(f, "dimension     {} ({kinematics})", self.dimension)?;
        writeln!(f, "particles     {}", self.particles)?;
        writeln!(f, "active nodes  {} of {}", self.active_nodes, self.grid_nodes)?;
        writeln!(f, "unknowns      {}", self.unknowns)?;
        writeln!(f, "grid          {}", self.grid_reset)?;
        let (method, why) = self.krylov;
        writeln!(f, "solver        {method}: {why}")?;
        let (preconditioner, why) = self.preconditioner;
        writeln!(f, "conditioned   {preconditioner}: {why}")?;
        writeln!(f, "terms")?;
        for (name, used, why) in &self.terms {
            writeln!(f, "  {} {name:<22} {why}", if *used { "on " } else { "off" })?;
        }
        for SurfaceUse { load, points, area, sides, force } in &self.surfaces {
            let sides: Vec<String> = sides.iter().map(|(side, area)| format!("{side} {area:.6}")).collect();
            let force: Vec<String> = force.iter().map(|one| format!("{one:.6}")).collect();
            let (sides, force) = (sides.join(", "), force.join(", "));
            writeln!(f, "  surface: {load} on {points} points, area {area:.6} in all ({sides}), resultant ({force})")?;
        }
        for bodies in &self.shared_nodes {
            writeln!(f, "contact       {bodies}")?;
        }
        write!(f, "memory        {} at most at one time", BinaryBytes(self.bytes()))?;
        for array in &self.arrays {
            write!(f, "\n  {:>10}  {}", BinaryBytes(array.bytes).to_string(), array.name)?;
        }
        Ok(())
    }
}
