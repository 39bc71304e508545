//! Contact with obstacles and between bodies: the law at a point, the points that touch, and the motion of obstacles that move freely.
//! [`facing`](super::facing) finds the points that may touch another body.

mod free_obstacle;
mod law;
mod points;

pub(crate) use free_obstacle::{FreeBalance, FreeMotion, FreePoint};
pub(crate) use law::Response;
pub(crate) use points::{Carrier, ContactPoint, Surroundings, Touching, obstacle_points, pair_points, points_on};
