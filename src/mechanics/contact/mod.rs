//! Contact with obstacles and between bodies: the law at a point, the search for points that may touch another body, the points that touch, and the
//! motion of obstacles that move freely.

mod free_obstacle;
mod law;
mod points;
mod search;

pub(crate) use free_obstacle::{FreeBalance, FreeMotion, FreePoint};
pub(crate) use law::contact_modulus;
pub(crate) use points::{Carrier, ContactPoint, Surroundings, Touching, obstacle_points, pair_points, points_on};
pub(crate) use search::{FASTEST, Path, candidates, paths, swallowed};
