//! Loads and prescribed motion: gravity and its curve, tractions, follower pressure, moving walls.

use crate::grid::Grid;
use crate::mechanics::terms::{ForceField, Rayleigh};
use crate::nodes::Nodes;
use crate::shape::Shape;
use crate::tensor::Vector;
use std::collections::HashSet;

/// A piecewise-linear function of time, constant before its first and after its last point.
///
/// ```
/// use bfree::mechanics::loads::Curve;
///
/// // Gravity that ramps up over 1 s: the velocity it gives is the integral of its value, which is that of its slope.
/// let ramp = Curve::new(vec![[0.0, 0.0], [1.0, 9.81]])?;
/// assert_eq!((ramp.slope(0.5), ramp.slope(2.0)), (9.81, 0.0));
/// assert_eq!(ramp.value(0.5), 0.5 * ramp.slope(0.5));
/// assert_eq!(ramp.integral(0.0, 1.0) + ramp.integral(1.0, 3.0), ramp.integral(0.0, 3.0));
/// // From then on, as if it had always been there, half a second later.
/// assert_eq!(ramp.integral(0.0, 3.0), Curve::constant(9.81).integral(0.5, 3.0));
/// # Ok::<(), bfree::mechanics::loads::CurveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    points: Vec<[f64; 2]>,
}

/// Why a list of points is no curve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CurveError {
    /// No points.
    #[error("a curve needs at least one point [time, value]")]
    Empty,
    /// Time must grow strictly.
    #[error("point {index}: time {time} does not come after {previous}; times must increase")]
    Order {
        /// The offending point.
        index: usize,
        /// Its time.
        time: f64,
        /// The time before it.
        previous: f64,
    },
    /// NaN or infinite.
    #[error("point {index} is not finite")]
    NotFinite {
        /// The offending point.
        index: usize,
    },
}

impl Curve {
    /// From points `[time, value]` with strictly increasing times.
    ///
    /// # Errors
    /// No points, times out of order, or numbers that are not finite.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self, CurveError> {
        if points.is_empty() {
            return Err(CurveError::Empty);
        }
        for (index, point) in points.iter().enumerate() {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(CurveError::NotFinite { index });
            }
            if index > 0 && point[0] <= points[index - 1][0] {
                return Err(CurveError::Order { index, time: point[0], previous: points[index - 1][0] });
            }
        }
        Ok(Self { points })
    }

    /// The constant function.
    pub fn constant(value: f64) -> Self {
        Self { points: vec![[0.0, value]] }
    }

    /// The piece `[a, b]` that holds `t`, if `t` lies between the first and the last point.
    fn piece(&self, t: f64) -> Option<([f64; 2], [f64; 2])> {
        let after = self.points.partition_point(|point| point[0] <= t);
        (after > 0 && after < self.points.len()).then(|| (self.points[after - 1], self.points[after]))
    }

    /// The value at time `t`.
    ///
    /// ```
    /// use bfree::mechanics::loads::Curve;
    ///
    /// let ramp = Curve::new(vec![[0.0, 0.0], [2.0, 1.0]])?;
    /// assert_eq!((ramp.value(-1.0), ramp.value(1.0), ramp.value(9.0)), (0.0, 0.5, 1.0));
    /// assert_eq!((ramp.slope(1.0), ramp.slope(9.0)), (0.5, 0.0));
    /// assert_eq!(ramp.integral(0.0, 3.0), 2.0);
    /// assert!(Curve::new(vec![[1.0, 0.0], [1.0, 1.0]]).is_err());
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn value(&self, t: f64) -> f64 {
        match self.piece(t) {
            Some((a, b)) => a[1] + (b[1] - a[1]) * ((t - a[0]) / (b[0] - a[0])),
            None if t < self.points[0][0] => self.points[0][1],
            None => self.points[self.points.len() - 1][1],
        }
    }

    /// The slope at time `t`; at a kink, that of the piece after it.
    pub fn slope(&self, t: f64) -> f64 {
        self.piece(t).map_or(0.0, |(a, b)| (b[1] - a[1]) / (b[0] - a[0]))
    }

    /// ∫ value dt from `from` to `to`, exactly, kinks included.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        let kinks = self.points.iter().map(|point| point[0]).filter(|&t| t > from && t < to);
        let mut sum = 0.0;
        let mut start = from;
        for end in kinks.chain(std::iter::once(to)) {
            sum += 0.5 * (self.value(start) + self.value(end)) * (end - start);
            start = end;
        }
        sum
    }
}

/// The prescribed motion g(t) of one component.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// At rest.
    Rest,
    /// g(t) given.
    Displacement(Curve),
    /// ġ(t) given.
    Velocity(Curve),
}

/// What a step needs to know of a prescribed component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionStep {
    /// g(t_{n+1}) − g(t_n)
    pub increment: f64,
    /// ġ, g̈ at the start of the step (from the right, where the curve has a kink).
    pub velocity_start: f64,
    /// See [`Self::velocity_start`].
    pub acceleration_start: f64,
    /// ġ, g̈ at the end of the step (from the left, where the curve has a kink).
    pub velocity_end: f64,
    /// See [`Self::velocity_end`].
    pub acceleration_end: f64,
}

impl Motion {
    /// The motion over the step from `t` to `t + dt`.
    ///
    /// ```
    /// use bfree::mechanics::loads::{Curve, Motion};
    ///
    /// // A wall that is set in motion: ġ = 4t up to t = 1, then 4. Over a step before and one behind the kink:
    /// let wall = Motion::Velocity(Curve::new(vec![[0.0, 0.0], [1.0, 4.0]])?);
    /// let (before, behind) = (wall.over(0.5, 0.5), wall.over(1.0, 0.5));
    /// assert_eq!((before.increment, behind.increment), (0.5 * 4.0 * (1.0 - 0.25), 4.0 * 0.5));
    /// // The acceleration at t = 1 is 4 from the left and 0 from the right; the velocity is continuous.
    /// assert_eq!((before.acceleration_end, behind.acceleration_start), (4.0, 0.0));
    /// assert_eq!(before.velocity_end, behind.velocity_start);
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn over(&self, t: f64, dt: f64) -> MotionStep {
        // One-sided derivatives: looked up a little inside the step, so that a kink that round-off puts a hair
        // beyond t_n or before t_{n+1} does not bring in the neighbouring piece.
        let (inside_start, inside_end) = (t + 1e-6 * dt, t + (1.0 - 1e-6) * dt);
        match self {
            Self::Rest => MotionStep::default(),
            Self::Displacement(g) => MotionStep {
                increment: g.value(t + dt) - g.value(t),
                velocity_start: g.slope(inside_start),
                velocity_end: g.slope(inside_end),
                ..MotionStep::default()
            },
            Self::Velocity(g) => MotionStep {
                increment: g.integral(t, t + dt),
                velocity_start: g.value(t),
                acceleration_start: g.slope(inside_start),
                velocity_end: g.value(t + dt),
                acceleration_end: g.slope(inside_end),
            },
        }
    }
}

/// Which nodes a prescribed motion holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Selection<const D: usize> {
    /// A face of the box: the lower or the upper one along an axis.
    Face {
        /// The axis.
        axis: usize,
        /// The face at the upper end.
        upper: bool,
    },
    /// The nodes inside a region.
    Region(Shape<D>),
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
    pub motion: [Option<Motion>; D],
}

/// Gravity, b(t) = curve(t) · acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct Gravity<const D: usize> {
    /// The acceleration at a factor of 1.
    pub acceleration: Vector<f64, D>,
    /// The factor in time.
    pub curve: Curve,
}

/// A particle that stands for a piece of surface: one of its own, without volume, or one of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// The place of the particle in memory.
    pub particle: usize,
    /// Outward normal N in the reference configuration, the mean of unit normals over A.
    pub normal: Vector<f64, D>,
    /// Reference area A it stands for.
    pub area: f64,
}

/// What acts on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pressing<const D: usize> {
    /// Nominal traction T (force per reference area), a dead load.
    Traction(Vector<f64, D>),
    /// Follower pressure p: T = −p J F⁻ᵀ N.
    Pressure(f64),
}

/// A load on surface particles, times a curve in time.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceLoad<const D: usize> {
    /// Traction or pressure.
    pub pressing: Pressing<D>,
    /// The factor in time.
    pub curve: Curve,
    /// The loaded particles.
    pub points: Vec<SurfacePoint<D>>,
}

/// All loads of a simulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads<const D: usize> {
    /// Gravity, if any.
    pub gravity: Option<Gravity<D>>,
    /// Loads on surface particles.
    pub surface: Vec<SurfaceLoad<D>>,
    /// Prescribed motion; where two hold the same component of a node, the later one wins.
    pub prescribed: Vec<Prescribed<D>>,
    /// A body force that varies in space, given in code.
    pub field: Option<ForceField<D>>,
    /// Damping, if any.
    pub damping: Option<Rayleigh>,
}

/// p A N of a particle under follower pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressurePoint<const D: usize> {
    /// The place of the particle in memory.
    pub particle: usize,
    /// p A N
    pub force: Vector<f64, D>,
}

impl<const D: usize> Loads<D> {
    /// How many particles carry loads of a kind.
    pub(crate) fn loaded(&self, kind: impl Fn(&Pressing<D>) -> bool) -> usize {
        let of_kind = self.surface.iter().filter(|load| kind(&load.pressing));
        of_kind.flat_map(|load| &load.points).map(|point| point.particle).collect::<HashSet<_>>().len()
    }

    /// p A N of every particle under follower pressure at time `t`.
    ///
    /// ```
    /// use bfree::mechanics::loads::{Curve, Loads, Pressing, SurfaceLoad, SurfacePoint};
    /// use bfree::tensor::Vector;
    ///
    /// // On a closed surface, Σ p A N = 0: here the four sides of a square, under p = 3 that doubles by t = 1.
    /// let sides = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    /// let side = |(particle, normal)| SurfacePoint { particle, normal: Vector::from(normal), area: 0.5 };
    /// let points = sides.into_iter().enumerate().map(side).collect();
    /// let curve = Curve::new(vec![[0.0, 1.0], [1.0, 2.0]])?;
    /// let loads = Loads { surface: vec![SurfaceLoad { pressing: Pressing::Pressure(3.0), curve, points }], ..Loads::default() };
    /// let pressures = loads.pressures(1.0);
    /// assert_eq!(pressures[0].force, Vector::from([2.0 * 3.0 * 0.5, 0.0]));
    /// assert_eq!(pressures.iter().map(|point| point.force).sum::<Vector<f64, 2>>().norm(), 0.0);
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn pressures(&self, t: f64) -> Vec<PressurePoint<D>> {
        let mut points = Vec::new();
        for load in &self.surface {
            if let Pressing::Pressure(pressure) = load.pressing {
                let pressure = pressure * load.curve.value(t);
                points.extend(load.points.iter().map(|point| PressurePoint {
                    particle: point.particle,
                    force: point.normal * (pressure * point.area),
                }));
            }
        }
        points
    }
}

/// A prescribed degree of freedom of this step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrescribedDof {
    /// Active node.
    pub node: usize,
    /// Component.
    pub component: usize,
    /// Which of [`Loads::prescribed`] holds it.
    pub owner: usize,
    /// Whether the owner moves (a curve) or rests.
    pub moving: bool,
    /// Its motion over the step.
    pub step: MotionStep,
}

/// The degrees of freedom prescribed in the step from `t` to `t + dt`, by node and component.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::mechanics::loads::{Curve, Motion, Prescribed, Selection, prescribed_dofs};
/// use bfree::nodes::Nodes;
/// use bfree::tensor::Vector;
///
/// // A floor on which bodies slide, and a wall at the left that pushes with velocity 2.
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 1.0, cells: [4, 4] };
/// let face = |axis| Selection::Face { axis, upper: false };
/// let pushing = Some(Motion::Velocity(Curve::constant(2.0)));
/// let floor = Prescribed { name: "floor".into(), on: face(1), motion: [None, Some(Motion::Rest)] };
/// let wall = Prescribed { name: "wall".into(), on: face(0), motion: [pushing, None] };
/// // The nodes of the cell in the corner: two on the floor, two at the wall, one of them the same.
/// let nodes = Nodes::new([[[0, 0], [1, 0], [0, 1], [1, 1]].map(|index| grid.id(index))].iter().map(|ids| ids.as_slice()));
/// let dofs = prescribed_dofs(&[floor, wall], &grid, &nodes, 0.0, 0.5);
/// let held: Vec<_> = dofs.iter().map(|dof| (dof.node, dof.component, dof.step.increment)).collect();
/// assert_eq!(held, [(0, 0, 1.0), (0, 1, 0.0), (1, 1, 0.0), (2, 0, 1.0)]);
/// ```
pub fn prescribed_dofs<const D: usize>(
    prescribed: &[Prescribed<D>],
    grid: &Grid<D>,
    nodes: &Nodes,
    t: f64,
    dt: f64,
) -> Vec<PrescribedDof> {
    let steps: Vec<[Option<MotionStep>; D]> = prescribed
        .iter()
        .map(|one| std::array::from_fn(|i| one.motion[i].as_ref().map(|motion| motion.over(t, dt))))
        .collect();
    let mut dofs = Vec::new();
    for (node, (index, position)) in nodes.positions(grid).enumerate() {
        let mut holders = [None; D];
        for (owner, one) in prescribed.iter().enumerate() {
            if one.on.holds(grid, index, &position) {
                for i in 0..D {
                    if let Some(step) = steps[owner][i] {
                        let moving = one.motion[i] != Some(Motion::Rest);
                        holders[i] = Some(PrescribedDof { node, component: i, owner, moving, step });
                    }
                }
            }
        }
        dofs.extend(holders.into_iter().flatten());
    }
    dofs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_velocity_curve_is_integrated_through_its_kinks() -> Result<(), CurveError> {
        let ramp = Curve::new(vec![[0.0, 0.0], [1.0, 2.0], [3.0, 2.0]])?;
        // triangle ½·1·2 up to t = 1, then the constant 2
        assert_eq!(ramp.integral(0.0, 2.5), 1.0 + 3.0);
        let step = Motion::Velocity(ramp).over(0.5, 1.0);
        assert_eq!(step.increment, 0.5 * (1.0 + 2.0) * 0.5 + 1.0);
        assert_eq!((step.velocity_start, step.velocity_end), (1.0, 2.0));
        assert_eq!((step.acceleration_start, step.acceleration_end), (2.0, 0.0));
        Ok(())
    }

    #[test]
    fn a_curve_that_goes_back_in_time_is_refused() {
        let back = Curve::new(vec![[0.0, 0.0], [1.0, 2.0], [0.5, 2.0]]);
        assert_eq!(back, Err(CurveError::Order { index: 2, time: 0.5, previous: 1.0 }));
        assert_eq!(Curve::new(vec![]), Err(CurveError::Empty));
        assert_eq!(Curve::new(vec![[0.0, f64::NAN]]), Err(CurveError::NotFinite { index: 0 }));
    }

    #[test]
    fn a_kink_at_the_end_of_a_step_belongs_to_the_step_before_it() -> Result<(), CurveError> {
        let step = Motion::Displacement(Curve::new(vec![[0.0, 0.0], [1.0, 3.0], [2.0, 3.0]])?).over(0.9, 0.1);
        assert!((step.increment - 0.3).abs() < 1e-15);
        assert_eq!((step.velocity_start, step.velocity_end), (3.0, 3.0));
        Ok(())
    }

    #[test]
    fn a_curve_is_constant_before_and_after_and_linear_between() -> Result<(), CurveError> {
        let curve = Curve::new(vec![[2.0, 5.0], [6.0, 3.0], [6.5, -1.0]])?;
        let values = [-1.0, 2.0, 3.0, 5.0, 6.0, 6.125, 6.5, 9.0].map(|t| curve.value(t));
        assert_eq!(values, [5.0, 5.0, 4.5, 3.5, 3.0, 2.0, -1.0, -1.0]);
        let slopes = [1.0, 2.0, 5.0, 6.0, 6.25, 6.5, 7.0].map(|t| curve.slope(t));
        assert_eq!(slopes, [0.0, -0.5, -0.5, -8.0, -8.0, 0.0, 0.0]);
        // 5·2 before the first point, trapezia between, −1·½ after the last.
        assert_eq!(curve.integral(0.0, 7.0), 10.0 + 16.0 + 0.5 - 0.5);
        assert_eq!(curve.integral(0.0, 7.0), curve.integral(0.0, 6.25) + curve.integral(6.25, 7.0));
        Ok(())
    }

    #[test]
    fn a_kink_at_the_start_of_a_step_belongs_to_the_step_after_it() -> Result<(), CurveError> {
        let stop = Motion::Displacement(Curve::new(vec![[0.0, 0.0], [1.0, 3.0], [2.0, 3.0]])?);
        // However short the step, what is a thousand steps away is not looked at.
        for dt in [0.1, 1e-7] {
            let (before, after) = (stop.over(1.0 - dt, dt), stop.over(1.0, dt));
            assert_eq!((before.velocity_start, before.velocity_end), (3.0, 3.0));
            assert_eq!((after.velocity_start, after.velocity_end), (0.0, 0.0));
            let far = stop.over(1.0 - 1000.0 * dt, dt);
            assert_eq!(far.velocity_start, if dt < 0.01 { 3.0 } else { 0.0 });
        }
        Ok(())
    }
}
