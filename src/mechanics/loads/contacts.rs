//! The contacts of the bodies: with rigid obstacles, and with each other.

use super::{ContactConstants, Obstacle, SurfacePoint};
use crate::tensor::Vector;
use std::collections::BTreeMap;

/// The surfaces of the bodies, and the contacts that they may have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts<const D: usize> {
    /// The points of the surfaces.
    pub points: Vec<SurfacePoint<D>>,
    /// The points that were added since the start, in their order.
    pub(crate) added: Vec<Added<D>>,
    /// The points that touch at the end of the last step.
    pub(crate) touching: Vec<PointInContact<D>>,
    /// The rigid obstacles.
    pub obstacles: Vec<Obstacle<D>>,
    /// Contact between bodies; `None` if bodies stick to each other where they share nodes.
    pub between: Option<BodyContact<D>>,
}

/// Contact between bodies of different nodal fields. Every point of a surface that enters another body is pushed out of it, and slides on it
/// with Coulomb friction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyContact<const D: usize> {
    /// The constants of the law of contact.
    pub constants: ContactConstants,
    /// The pairs of bodies of different fields.
    pub pairs: Vec<Pair>,
    /// The energy stored in the contact at t_n.
    pub energy: f64,
    /// The elastic slips at t_n, by point and pair. Points without an elastic slip are left out.
    pub slips: BTreeMap<[usize; 2], Vector<f64, D>>,
    /// The points that may touch another body in the coming step. A step finds them at its start.
    pub candidates: Vec<Candidate<D>>,
}

/// A point that was added to a surface since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Added<const D: usize> {
    /// The half of a piece of surface that had stretched: the number of its point, and the edge that was halved.
    Half { number: usize, axis: usize },
    /// A particle where the surface has opened: its id, the reference normal and the reference area.
    Bare { id: u32, normal: Vector<f64, D>, area: f64 },
}

/// A point of a surface that touches an obstacle or another body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointInContact<const D: usize> {
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// The pressure, per reference area.
    pub pressure: f64,
    /// The traction on the body of the point, in space and per reference area.
    pub traction: Vector<f64, D>,
    /// The gap, < 0.
    pub gap: f64,
}

/// Two bodies that may touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The numbers of the bodies, the lower one first.
    pub bodies: [u32; 2],
    /// The energy dissipated by friction since the start.
    pub friction_loss: f64,
}

/// A point of a surface that may touch another body. The surface of the other body counts as a plane in a step, through its closest point,
/// and moves with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate<const D: usize> {
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// The number of the pair in [`BodyContact::pairs`].
    pub pair: usize,
    /// The part of the area of the point that sees the other surface, from 0 to 1. It is below 1 where the surfaces make an angle of more than
    /// 60°.
    pub part: f64,
    /// How near the point, and the closest point, are to a convex edge of their body, from 0 to 1.
    pub edges: [f64; 2],
    /// Whether the point belongs to the first body of the pair.
    pub is_first: bool,
    /// The outward normal of the other body at t_n.
    pub normal: Vector<f64, D>,
    /// The position of the point at t_n, relative to the material that carries the closest point at t_{n+1}.
    pub start: Vector<f64, D>,
    /// The elastic slip at t_n, along the plane.
    pub slip: Vector<f64, D>,
    /// The points of the other surface that carry the closest point. Their shares sum to 1.
    pub closest: Vec<Share<D>>,
}

/// A part of the closest point on another surface, that a point of the surface carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share<const D: usize> {
    /// The number of the point in [`Contacts::points`].
    pub number: usize,
    /// Its share.
    pub share: f64,
    /// The closest point less this point, in the configuration of the last grid reset.
    pub offset: Vector<f64, D>,
}

impl<const D: usize> Contacts<D> {
    /// Whether bodies may touch anything.
    pub(crate) fn exist(&self) -> bool {
        !self.obstacles.is_empty() || self.between.is_some()
    }

    /// Whether an obstacle moves freely.
    pub(crate) fn has_free_obstacle(&self) -> bool {
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
    pub(crate) fn have_friction(&self) -> bool {
        let between = self.between.iter().map(|between| &between.constants);
        self.obstacles.iter().map(|obstacle| &obstacle.constants).chain(between).any(ContactConstants::has_friction)
    }

    /// The energy dissipated by friction since the start.
    pub fn friction_loss(&self) -> f64 {
        let pairs = self.between.iter().flat_map(|between| &between.pairs).map(|pair| pair.friction_loss);
        self.obstacles.iter().map(|obstacle| obstacle.friction_loss).chain(pairs).sum()
    }

    /// Halves the piece of surface around a point, for a new point with the index `particle`.
    pub(crate) fn halve(&mut self, number: usize, axis: usize, particle: usize) {
        let point = &mut self.points[number];
        point.halved[axis] = point.halved[axis].saturating_add(1);
        let half = SurfacePoint { particle, ..*point };
        self.points.push(half);
        self.added.push(Added::Half { number, axis });
    }

    /// Makes the particle with an id and an index a point of the surface.
    pub(crate) fn cover(&mut self, id: u32, point: SurfacePoint<D>) {
        self.points.push(point);
        self.added.push(Added::Bare { id, normal: point.normal, area: point.area });
    }

    /// Puts the anchors of friction to the points of surfaces at `positions` at time `t`, and the slip between bodies to zero.
    pub(crate) fn anchor(&mut self, positions: &[Vector<f64, D>], t: f64) {
        for obstacle in &mut self.obstacles {
            obstacle.anchors = obstacle.anchors_at(&obstacle.pose(t), &self.points, positions);
        }
        if let Some(between) = &mut self.between {
            between.slips.clear();
        }
    }
}

impl<const D: usize> BodyContact<D> {
    /// Contact between bodies with these nodal fields.
    pub fn new(constants: ContactConstants, fields: &[u32]) -> Self {
        let bodies = || 0..fields.len();
        let all = bodies().flat_map(|one| (one + 1..fields.len()).map(move |other| [one, other]));
        let apart = all.filter(|&[one, other]| fields[one] != fields[other]);
        let pairs = apart.map(|pair| Pair { bodies: pair.map(|body| body as u32), friction_loss: 0.0 }).collect();
        Self { constants, pairs, ..Self::default() }
    }

    /// The elastic slip of a point on the other body of a pair at t_n.
    pub(crate) fn slip(&self, number: usize, pair: usize) -> Vector<f64, D> {
        self.slips.get(&[number, pair]).copied().unwrap_or_else(Vector::zeros)
    }
}
