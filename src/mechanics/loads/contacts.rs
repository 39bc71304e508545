//! The contacts of the bodies: with rigid obstacles, and with each other.

use super::{Obstacle, SurfacePoint};
use crate::tensor::Vector;

/// The surfaces of the bodies, and the contacts that they may have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts<const D: usize> {
    /// The points of the surfaces.
    pub points: Vec<SurfacePoint<D>>,
    /// The rigid obstacles.
    pub obstacles: Vec<Obstacle<D>>,
    /// Contact between bodies; `None` if bodies stick to each other where they share nodes.
    pub between: Option<BodyContact<D>>,
}

/// Contact between bodies of different nodal fields. Every point of a surface that faces another body is pushed out of it, and slides on it
/// with Coulomb friction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyContact<const D: usize> {
    /// The penalty stiffness (pressure per depth) in units of min(Λ + 2G, 4G)/h of the softer body, > 0.
    pub stiffness: f64,
    /// The coefficient of friction μ, ≥ 0.
    pub friction: f64,
    /// The pairs of bodies of different fields.
    pub pairs: Vec<Pair>,
    /// The energy stored in the contact at t_n.
    pub energy: f64,
    /// The elastic slip of every point of [`Contacts::points`] at t_n. Empty without friction.
    pub slips: Vec<Vector<f64, D>>,
    /// The points that may touch another body in the coming step. A step finds them anew.
    pub facing: Vec<Facing<D>>,
}

/// Two bodies that may touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The numbers of the bodies, the lower one first.
    pub bodies: [u32; 2],
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

/// A point of a surface that faces another body. The surface of the other body counts as a plane in a step, and moves with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Facing<const D: usize> {
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// The number of the pair in [`BodyContact::pairs`].
    pub pair: usize,
    /// Whether the point belongs to the first body of the pair.
    pub is_first: bool,
    /// The outward normal of the other body at t_n.
    pub normal: Vector<f64, D>,
    /// The position of the point at t_n relative to the place on the other body that carries its projection at t_{n+1}.
    pub start: Vector<f64, D>,
    /// The points of the other surface that carry the projection.
    pub partners: Vec<Partner<D>>,
}

/// A point of the other surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partner<const D: usize> {
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// Its share; all shares of a projection sum to 1.
    pub share: f64,
    /// The projection less this point, in the configuration of the last grid reset.
    pub offset: Vector<f64, D>,
}

impl<const D: usize> Contacts<D> {
    /// Whether bodies may touch anything.
    pub fn exist(&self) -> bool {
        !self.obstacles.is_empty() || self.between.is_some()
    }

    /// Whether an obstacle moves freely.
    pub fn has_free_obstacle(&self) -> bool {
        self.obstacles.iter().any(|obstacle| obstacle.free.is_some())
    }

    /// The points of the surfaces of obstacles that must not meet: the numbers of the obstacle and of the other one, and the point in the
    /// frame of the first. One of the two moves freely.
    pub(crate) fn apart(&self) -> impl Iterator<Item = ([usize; 2], &Vector<f64, D>)> {
        let all = self.obstacles.iter().enumerate();
        all.flat_map(move |(one, obstacle)| {
            let others = self.obstacles.iter().enumerate();
            let others = others
                .filter(move |(other, second)| *other != one && (obstacle.free.is_some() || second.free.is_some()));
            others.flat_map(move |(other, _)| obstacle.surface.iter().map(move |point| ([one, other], point)))
        })
    }

    /// Whether friction acts anywhere.
    pub fn have_friction(&self) -> bool {
        let between = self.between.iter().map(|between| between.friction);
        self.obstacles.iter().map(|obstacle| obstacle.friction).chain(between).any(|friction| friction > 0.0)
    }

    /// The energy dissipated by friction since the start.
    pub fn friction_loss(&self) -> f64 {
        let pairs = self.between.iter().flat_map(|between| &between.pairs).map(|pair| pair.friction_loss);
        self.obstacles.iter().map(|obstacle| obstacle.friction_loss).chain(pairs).sum()
    }

    /// Puts the anchors of friction to the points of surfaces at `positions` at time `t`, and the slip between bodies to zero.
    pub(crate) fn anchor(&mut self, positions: &[Vector<f64, D>], t: f64) {
        for obstacle in self.obstacles.iter_mut().filter(|obstacle| obstacle.friction > 0.0) {
            let pose = obstacle.pose(t);
            obstacle.anchors = self.points.iter().map(|point| pose.to_frame(&positions[point.particle])).collect();
        }
        if let Some(between) = self.between.as_mut().filter(|between| between.friction > 0.0) {
            between.slips = vec![Vector::zeros(); self.points.len()];
        }
    }
}

impl<const D: usize> BodyContact<D> {
    /// Contact between bodies with these nodal fields.
    pub fn new(stiffness: f64, friction: f64, fields: &[u32]) -> Self {
        let bodies = || 0..fields.len();
        let all = bodies().flat_map(|one| (one + 1..fields.len()).map(move |other| [one, other]));
        let apart = all.filter(|&[one, other]| fields[one] != fields[other]);
        let pairs = apart.map(|pair| Pair { bodies: pair.map(|body| body as u32), friction_loss: 0.0 }).collect();
        Self { stiffness, friction, pairs, ..Self::default() }
    }
}
