//! Rigid obstacles that bodies touch: their shape, their motion, and the state of their friction.

use super::prescribed::Motion;
use super::{Pose, RigidBody, SurfacePoint};
use crate::grid::Grid;
use crate::shape::Shape;
use crate::tensor::{Vector, identity};

/// The constants of the law of contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactConstants {
    /// The penalty stiffness (pressure per depth) in units of min(Λ + 2G, 4G)/h of the body, or of the softer one of two, > 0.
    pub stiffness: f64,
    /// The coefficient of friction μ, ≥ 0.
    pub friction: f64,
}

impl ContactConstants {
    /// Whether friction acts.
    pub(crate) fn has_friction(&self) -> bool {
        self.friction > 0.0
    }

    /// The constants with the stiffness times a factor.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self { stiffness: self.stiffness * factor, ..*self }
    }
}

/// A rigid obstacle. Bodies touch it without adhesion, with Coulomb friction.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle<const D: usize> {
    /// Name, for output.
    pub name: String,
    /// The shape at t = 0.
    pub shape: Shape<D>,
    /// The motion of each component; a component without motion rests.
    pub motion: [Option<Motion<D>>; D],
    /// The mass and the state of an obstacle that moves freely; `None` if its motion is prescribed.
    pub free: Option<RigidBody<D>>,
    /// Points of the surface, in the frame of the obstacle, where obstacles move freely. There obstacles must not meet.
    pub surface: Vec<Vector<f64, D>>,
    /// The constants of the law of contact.
    pub constants: ContactConstants,
    /// The anchors of friction at t_n, one for each of [`Contacts::points`](super::Contacts::points), in the frame of the obstacle. The elastic slip of a point is
    /// its distance from its anchor along the surface. Empty without friction.
    pub anchors: Vec<Vector<f64, D>>,
    /// The work of the moving obstacle on the bodies since the start.
    pub work: f64,
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

impl<const D: usize> Obstacle<D> {
    /// The rigid motion up to time `t`. A free obstacle has its pose at t_n.
    ///
    /// ```
    /// use bfree::mechanics::loads::{ContactConstants, Curve, Motion, Obstacle, Rotation};
    /// use bfree::shape::Ball;
    /// use bfree::tensor::Vector;
    ///
    /// // A disc that turns about the point (1, 0), by a quarter until t = 1.
    /// let quarter = Curve::new(vec![[0.0, 0.0], [1.0, std::f64::consts::FRAC_PI_2]])?;
    /// let turn = Motion::Rotation(Rotation::new(Vector::from([1.0, 0.0]), [0.0, 0.0, 1.0], quarter));
    /// let disc = Ball { center: Vector::from([3.0, 0.0]), radius: 1.0 }.into();
    /// let obstacle = Obstacle::new("disc", disc, [Some(turn.clone()), Some(turn)], ContactConstants::default());
    /// let pose = obstacle.pose(1.0);
    /// let center = pose.rotation * Vector::from([3.0, 0.0]) + pose.shift;
    /// assert!((center - Vector::from([1.0, 2.0])).norm() < 1e-15);
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn pose(&self, t: f64) -> Pose<D> {
        let moved = |x: &Vector<f64, D>| {
            let of = |i: usize| self.motion[i].as_ref().map_or(0.0, |motion| motion.over(0.0, t, x, i).increment);
            Vector::<f64, D>::from_fn(|i, _| of(i))
        };
        if let Some(body) = &self.free {
            return body.pose(&Vector::zeros());
        }
        mutant!("obstacle: it rests": { return Pose { rotation: identity(), shift: Vector::zeros() }; });
        let shift = moved(&Vector::zeros());
        let mut rotation = identity::<f64, D>();
        for k in 0..D {
            let unit = Vector::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
            rotation.set_column(k, &(unit + moved(&unit) - shift));
        }
        Pose { rotation, shift }
    }

    /// An obstacle that has not been touched yet.
    pub fn new(
        name: impl Into<String>,
        shape: Shape<D>,
        motion: [Option<Motion<D>>; D],
        constants: ContactConstants,
    ) -> Self {
        let name = name.into();
        let (surface, anchors) = (Vec::new(), Vec::new());
        let (work, friction_loss) = (0.0, 0.0);
        Self { name, shape, motion, free: None, surface, constants, anchors, work, friction_loss }
    }

    /// Whether friction acts on the obstacle.
    pub(crate) fn has_friction(&self) -> bool {
        self.constants.has_friction()
    }

    /// The anchors of points that touch nothing: their positions, in the frame of an obstacle at `pose`. Empty without friction.
    pub(crate) fn anchors_at(
        &self,
        pose: &Pose<D>,
        points: &[SurfacePoint<D>],
        positions: &[Vector<f64, D>],
    ) -> Vec<Vector<f64, D>> {
        let anchored = if self.has_friction() { points } else { &[] };
        anchored.iter().map(|point| pose.to_frame(&positions[point.particle])).collect()
    }

    /// Whether a free obstacle lies outside the grid: a ball about its centre of mass that holds its bounding box.
    pub(crate) fn has_left(&self, grid: &Grid<D>) -> bool {
        let Some(body) = &self.free else { return false };
        let ((min, max), end) = (self.shape.bounding_box(), grid.position(grid.cells));
        let radius = (max - body.center).sup(&(body.center - min)).norm();
        (0..D).any(|k| body.position[k] + radius < grid.origin[k] || body.position[k] - radius > end[k])
    }

    /// Whether the obstacle moves at any time.
    pub(crate) fn moves(&self) -> bool {
        self.free.is_some() || self.motion.iter().flatten().any(|motion| *motion != Motion::Rest)
    }
}
