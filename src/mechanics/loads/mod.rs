//! Loads and prescribed motion: gravity and its curve, tractions, follower pressure, moving walls.

mod at_surface;
mod contacts;
mod curve;
mod force_field;
mod motion_step;
mod obstacle;
mod pose;
mod prescribed;
mod rayleigh;
pub(crate) mod rigid_body;
mod rotation;

pub(crate) use at_surface::at_surface_points;
pub(crate) use contacts::{Added, PointInContact};
pub use contacts::{BodyContact, Candidate, Contacts, Pair, Share};
pub use curve::{Curve, CurveError, Sine};
pub use force_field::{Field, ForceField};
pub use motion_step::MotionStep;
pub use obstacle::{ContactConstants, Obstacle};
pub use pose::Pose;
pub(crate) use prescribed::prescribed_dofs;
pub use prescribed::{Motion, Prescribed, PrescribedDof, Reaction, Selection};
pub use rayleigh::Rayleigh;
pub use rigid_body::RigidBody;
pub use rotation::Rotation;

use crate::tensor::Vector;
use std::collections::HashSet;

/// Gravity, b(t) = curve(t) · acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct Gravity<const D: usize> {
    /// The acceleration at a factor of 1.
    pub acceleration: Vector<f64, D>,
    /// The factor in time.
    pub curve: Curve,
}

impl<const D: usize> Gravity<D> {
    /// b(t)
    pub(crate) fn at(&self, t: f64) -> Vector<f64, D> {
        self.acceleration * self.curve.value(t)
    }
}

/// A particle that represents a piece of surface: a surface point without volume, or a particle of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// The index of the particle in memory.
    pub particle: usize,
    /// Outward normal N in the reference configuration, the mean of unit normals over A.
    pub normal: Vector<f64, D>,
    /// Reference area A of the piece. A piece that has stretched keeps its area when it is halved.
    pub area: f64,
    /// How often the piece was halved since the start, along each of its edges.
    pub halved: [u8; 2],
}

impl<const D: usize> SurfacePoint<D> {
    /// A piece that was never halved.
    pub fn new(particle: usize, normal: Vector<f64, D>, area: f64) -> Self {
        Self { particle, normal, area, halved: [0; 2] }
    }

    /// The reference area of the halved piece.
    pub(crate) fn halved_area(&self) -> f64 {
        self.area * 0.5_f64.powi(i32::from(self.halved[0]) + i32::from(self.halved[1]))
    }

    /// The D − 1 edges of the piece in the reference configuration: a square of the area A that was halved along its edges.
    pub(crate) fn edges(&self) -> Vec<Vector<f64, D>> {
        let edge = self.area.powf(1.0 / (D.max(2) - 1) as f64);
        let normal = self.normal.try_normalize(0.0).unwrap_or(self.normal);
        let mut edges: Vec<Vector<f64, D>> = Vec::new();
        // The axes that are nearest to the plane give the directions, so that a turned scene has turned edges.
        let mut axes: Vec<usize> = (0..D).collect();
        axes.sort_by(|&one, &other| normal[one].abs().total_cmp(&normal[other].abs()));
        for k in axes.into_iter().take(D - 1) {
            let axis = Vector::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
            let across = edges.iter().fold(axis - normal * normal[k], |x, edge| x - edge * edge.dot(&x));
            edges.push(across.try_normalize(0.0).unwrap_or(across));
        }
        let length = |k: usize| edge * 0.5_f64.powi(i32::from(self.halved[k]));
        edges.iter().enumerate().map(|(k, direction)| direction * length(k)).collect()
    }
}

/// The kind and the value of a load on a surface.
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
    /// Prescribed motion. If two conditions hold the same component of a node, the later condition wins.
    pub prescribed: Vec<Prescribed<D>>,
    /// A body force that varies in space, given in code.
    pub field: Option<ForceField<D>>,
    /// Damping, if any.
    pub damping: Option<Rayleigh>,
    /// Contact with obstacles and between bodies.
    pub contacts: Contacts<D>,
}

/// p A N of a particle under follower pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressurePoint<const D: usize> {
    /// The index of the particle in memory.
    pub particle: usize,
    /// p A N
    pub force: Vector<f64, D>,
}

impl<const D: usize> Loads<D> {
    /// The number of particles with loads of a kind.
    pub(crate) fn loaded(&self, kind: impl Fn(&Pressing<D>) -> bool) -> usize {
        let of_kind = self.surface.iter().filter(|load| kind(&load.pressing));
        of_kind.flat_map(|load| &load.points).map(|point| point.particle).collect::<HashSet<_>>().len()
    }

    /// All points of surfaces that carry loads or may touch something.
    pub(crate) fn points_mut(&mut self) -> impl Iterator<Item = &mut SurfacePoint<D>> {
        self.surface.iter_mut().flat_map(|load| &mut load.points).chain(&mut self.contacts.points)
    }

    /// p A N of every particle under follower pressure at time `t`.
    ///
    /// ```
    /// use bfree::mechanics::loads::{Curve, Loads, Pressing, SurfaceLoad, SurfacePoint};
    /// use bfree::tensor::Vector;
    ///
    /// // On a closed surface, Σ p A N = 0: here the four sides of a square, under p = 3 that doubles by t = 1.
    /// let sides = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    /// let side = |(particle, normal)| SurfacePoint::new(particle, Vector::from(normal), 0.5);
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
