//! Prescribed motion: the nodes, and their motion.

use super::curve::Curve;
use super::motion_step::MotionStep;
use super::rotation::Rotation;
use crate::grid::Grid;
use crate::parallel;
use crate::shape::Shape;
use crate::space::Nodes;
use crate::tensor::Vector;

/// The prescribed motion g(t) of one component.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion<const D: usize> {
    /// At rest.
    Rest,
    /// g(t) given.
    Displacement(Curve),
    /// ġ(t) given.
    Velocity(Curve),
    /// A rotation of all components.
    Rotation(Rotation<D>),
}

/// The reaction of a condition at t_{n+1}, plus impulse / Δt. A wall gives this impulse to nodes that do not move with it yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction<const D: usize> {
    /// The force Σ r_I.
    pub force: Vector<f64, D>,
    /// The moment about the axis of a rotation; 0 for other conditions.
    pub torque: f64,
}

impl<const D: usize> Reaction<D> {
    /// No reaction.
    pub(crate) const NONE: Self =
        Self { force: Vector::from_array_storage(nalgebra::ArrayStorage([[0.0; D]])), torque: 0.0 };

    /// The resultant of several reactions.
    pub(crate) fn sum(of: &[Self]) -> Self {
        Self { force: of.iter().map(|one| one.force).sum(), torque: of.iter().map(|one| one.torque).sum() }
    }
}

impl<const D: usize> Motion<D> {
    /// The motion of component `i` of a node over the step from `t` to `t + dt`. The node is at `x` at the start.
    pub(crate) fn over(&self, t: f64, dt: f64, x: &Vector<f64, D>, i: usize) -> MotionStep {
        match self {
            Self::Rest => MotionStep::default(),
            Self::Displacement(g) => {
                let [velocity_start, velocity_end] = g.slopes(t, dt);
                let increment = g.value(t + dt) - g.value(t);
                MotionStep { increment, velocity_start, velocity_end, ..MotionStep::default() }
            }
            Self::Velocity(g) => {
                let [acceleration_start, acceleration_end] = g.slopes(t, dt);
                let (velocity_start, velocity_end) = (g.value(t), g.value(t + dt));
                let increment = g.integral(t, t + dt);
                MotionStep { increment, velocity_start, acceleration_start, velocity_end, acceleration_end }
            }
            Self::Rotation(rotation) => rotation.over(t, dt, x, i),
        }
    }
}

/// The nodes that a prescribed motion holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Selection<const D: usize> {
    /// A face of the box: the lower or the upper one along an axis.
    Face {
        /// The axis.
        axis: usize,
        /// Whether the face is the upper one.
        upper: bool,
    },
    /// The nodes inside a region.
    Region(Shape<D>),
}

impl<const D: usize> Prescribed<D> {
    /// The rotation, if the motion is one.
    pub(crate) fn rotation(&self) -> Option<&Rotation<D>> {
        self.motion.iter().flatten().find_map(|motion| match motion {
            Motion::Rotation(rotation) => Some(rotation),
            _ => None,
        })
    }
}

impl<const D: usize> Selection<D> {
    pub(crate) fn holds(&self, grid: &Grid<D>, index: [u32; D], position: &Vector<f64, D>) -> bool {
        match self {
            Self::Face { axis, upper } => index[*axis] == if *upper { grid.cells[*axis] } else { 0 },
            Self::Region(shape) => shape.holds(position, grid.spacing),
        }
    }
}

/// Motion prescribed on some nodes; a component without motion stays free.
#[derive(Clone, Debug, PartialEq)]
pub struct Prescribed<const D: usize> {
    /// Name, for output.
    pub name: String,
    /// The nodes.
    pub on: Selection<D>,
    /// The motion of each component.
    pub motion: [Option<Motion<D>>; D],
}

/// A prescribed degree of freedom of this step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrescribedDof {
    /// Active node.
    pub node: usize,
    /// Component.
    pub component: usize,
    /// The index in [`Loads::prescribed`](super::Loads::prescribed) of the condition that holds it.
    pub owner: usize,
    /// Whether the owner moves (a curve) or rests.
    pub moving: bool,
    /// Its motion over the step.
    pub step: MotionStep,
}

impl PrescribedDof {
    /// The node and the component.
    pub(crate) fn place(&self) -> (usize, usize) {
        (self.node, self.component)
    }
}

/// The degrees of freedom prescribed in the step from `t` to `t + dt`, by node and component. `moved` is the nodal motion since the last
/// grid reset. Right after a reset there is no such motion, and `moved` is empty.
pub(crate) fn prescribed_dofs<const D: usize>(
    prescribed: &[Prescribed<D>],
    grid: &Grid<D>,
    nodes: &Nodes,
    moved: &[Vector<f64, D>],
    t: f64,
    dt: f64,
) -> Vec<PrescribedDof> {
    if prescribed.is_empty() {
        return Vec::new();
    }
    let of_node = |(node, id): (usize, u64)| {
        let index = grid.index(id);
        let position = grid.position(index);
        let x = position + moved.get(node).copied().unwrap_or_else(Vector::zeros);
        let mut holders = [None; D];
        for (owner, one) in prescribed.iter().enumerate().filter(|(_, one)| one.on.holds(grid, index, &position)) {
            for (component, motion) in one.motion.iter().enumerate() {
                if let Some(motion) = motion {
                    let (step, moving) = (motion.over(t, dt, &x, component), *motion != Motion::Rest);
                    holders[component] = Some(PrescribedDof { node, component, owner, moving, step });
                }
            }
        }
        holders.into_iter().flatten()
    };
    parallel::collect(nodes.parts(), &|(first, ids)| (first..).zip(ids).flat_map(of_node).collect::<Vec<_>>()).concat()
}

#[cfg(test)]
mod tests {
    use super::super::CurveError;
    use super::*;

    #[test]
    fn a_velocity_curve_is_integrated_through_its_kinks() -> Result<(), CurveError> {
        let ramp = Curve::new(vec![[0.0, 0.0], [1.0, 2.0], [3.0, 2.0]])?;
        // triangle ½·1·2 up to t = 1, then the constant 2
        assert_eq!(ramp.integral(0.0, 2.5), 1.0 + 3.0);
        let step = Motion::<1>::Velocity(ramp).over(0.5, 1.0, &Vector::zeros(), 0);
        assert_eq!(step.increment, 0.5 * (1.0 + 2.0) * 0.5 + 1.0);
        assert_eq!((step.velocity_start, step.velocity_end), (1.0, 2.0));
        assert_eq!((step.acceleration_start, step.acceleration_end), (2.0, 0.0));
        Ok(())
    }

    #[test]
    fn a_kink_at_the_end_of_a_step_belongs_to_the_step_before_it() -> Result<(), CurveError> {
        let stop = Motion::<1>::Displacement(Curve::new(vec![[0.0, 0.0], [1.0, 3.0], [2.0, 3.0]])?);
        let step = stop.over(0.9, 0.1, &Vector::zeros(), 0);
        assert!((step.increment - 0.3).abs() < 1e-15);
        assert_eq!((step.velocity_start, step.velocity_end), (3.0, 3.0));
        Ok(())
    }

    #[test]
    fn a_kink_at_the_start_of_a_step_belongs_to_the_step_after_it() -> Result<(), CurveError> {
        let stop = Motion::<1>::Displacement(Curve::new(vec![[0.0, 0.0], [1.0, 3.0], [2.0, 3.0]])?);
        let over = |t, dt| stop.over(t, dt, &Vector::zeros(), 0);
        // Slopes a thousand steps away are not used, however short the step.
        for dt in [0.1, 1e-7] {
            let (before, after) = (over(1.0 - dt, dt), over(1.0, dt));
            assert_eq!((before.velocity_start, before.velocity_end), (3.0, 3.0));
            assert_eq!((after.velocity_start, after.velocity_end), (0.0, 0.0));
            let far = over(1.0 - 1000.0 * dt, dt);
            assert_eq!(far.velocity_start, if dt < 0.01 { 3.0 } else { 0.0 });
        }
        Ok(())
    }

    #[test]
    fn a_wall_that_is_set_in_motion_has_an_acceleration_on_each_side_of_the_kink() -> Result<(), CurveError> {
        // ġ = 4t up to t = 1, then 4. Over a step before and one behind the kink:
        let (wall, x) = (Motion::<1>::Velocity(Curve::new(vec![[0.0, 0.0], [1.0, 4.0]])?), Vector::zeros());
        let (before, behind) = (wall.over(0.5, 0.5, &x, 0), wall.over(1.0, 0.5, &x, 0));
        assert_eq!((before.increment, behind.increment), (0.5 * 4.0 * (1.0 - 0.25), 4.0 * 0.5));
        assert_eq!((before.acceleration_end, behind.acceleration_start), (4.0, 0.0));
        assert_eq!(before.velocity_end, behind.velocity_start);
        Ok(())
    }

    #[test]
    fn a_node_in_a_corner_is_held_by_floor_and_wall() {
        // A floor on which bodies slide, and a wall at the left that pushes with velocity 2.
        let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 1.0, cells: [4, 4] };
        let face = |axis| Selection::Face { axis, upper: false };
        let pushing = Some(Motion::Velocity(Curve::constant(2.0)));
        let floor = Prescribed { name: "floor".into(), on: face(1), motion: [None, Some(Motion::Rest)] };
        let wall = Prescribed { name: "wall".into(), on: face(0), motion: [pushing, None] };
        // The nodes of the cell in the corner: two on the floor, two at the wall, one of them in both pairs.
        let nodes = Nodes::new([[0, 0], [1, 0], [0, 1], [1, 1]].map(|index| grid.id(index)).into());
        let dofs = prescribed_dofs(&[floor, wall], &grid, &nodes, &[], 0.0, 0.5);
        let held: Vec<_> = dofs.iter().map(|dof| (dof.node, dof.component, dof.step.increment)).collect();
        assert_eq!(held, [(0, 0, 1.0), (0, 1, 0.0), (1, 1, 0.0), (2, 0, 1.0)]);
    }
}
