//! The contacts of a scene: its obstacles, and the surfaces of its bodies.

use super::BuildError;
use super::body::Body;
use super::boundary::Face;
use super::filling::Builder;
use super::free::surface;
use super::load::{Loaded, Stress};
use crate::mechanics::contact::{Path, paths};
use crate::mechanics::loads::{BodyContact, Contacts, Obstacle, SurfacePoint};
use crate::mechanics::sweep::stride;
use crate::shape::{self, Cloud, CloudPoint, SURFACE_DEPTH};
use crate::tensor::Vector;

/// The largest depth of a body in an obstacle at the start, in grid spacings. Surface points of curved bodies lie on planes that leave the
/// surface by less.
const DEEPEST_START: f64 = 0.02;

/// A point of a surface is a joint if this far outside it, in spacings, there is a body from a file that is joined to its own.
const OUTSIDE: f64 = 0.25;

/// The region of a body.
enum Region<const D: usize> {
    Shape(shape::Shape<D>),
    /// That of particles from a file.
    Cloud(Cloud<D>),
}

impl<const D: usize> Region<D> {
    fn holds(&self, x: &Vector<f64, D>) -> bool {
        match self {
            Self::Shape(shape) => shape.signed_distance(x) < 0.0,
            Self::Cloud(cloud) => cloud.holds(x),
        }
    }
}

impl<const D: usize> Builder<'_, D> {
    /// The contacts, and points on the whole surface of every body, if there are contacts. Where bodies of one nodal field are joined, there is no
    /// surface.
    pub(super) fn contacts(&mut self, gravity: &Vector<f64, D>) -> Result<Contacts<D>, BuildError> {
        let (scene, stiffness) = (self.scene, self.scene.contact_stiffness());
        let mut contacts = Contacts::default();
        for (i, one) in scene.obstacles.iter().enumerate() {
            let path = format!("obstacles[{i}]");
            let (shape, given) = (one.shape.built(&path)?, one.given());
            let motion = given.first().map_or_else(|| Face::Fixed.motion(0), |given| given.motion())?;
            let free = one.free.as_ref().map(|free| free.build(&path, &shape, gravity)).transpose()?;
            let obstacle = Obstacle::new(one.name.clone(), shape, motion, one.constants(stiffness));
            contacts.obstacles.push(Obstacle { free, ..obstacle });
        }
        if contacts.has_free_obstacle() {
            contacts.obstacles.iter_mut().for_each(|one| one.surface = surface(&one.shape));
        }
        if let Some(contact) = &scene.contact {
            let fields = scene.nodal_fields();
            let count = fields.iter().max().map_or(1, |last| u64::from(last + 1));
            let cells = self.grid.cells[D - 1];
            if count * stride(cells) > u64::from(u32::MAX) {
                let what = format!("{count} groups of bodies are too many for {cells} cells along the last axis");
                return Err(BuildError::at("contact", what));
            }
            contacts.between = Some(BodyContact::new(contact.constants(stiffness), &fields));
        }
        if !contacts.exist() {
            return Ok(contacts);
        }
        for (i, body) in scene.bodies.iter().enumerate() {
            let whole =
                Loaded { body: &body.name, region: &None, stress: Stress::Pressure(0.0), curve: &None, surface: &None };
            let points = if body.shape.is_some() {
                self.points(&format!("bodies[{i}]"), &whole)?
            } else {
                self.cloud_points(i)?
            };
            contacts.points.extend(points);
        }
        let (fields, regions) = (scene.nodal_fields(), self.regions());
        let is_joint = |point: &SurfacePoint<D>| {
            let (own, x) = (self.particles.body[point.particle] as usize, &self.particles.position[point.particle]);
            let mut others = (0..regions.len()).filter(|&other| other != own && fields[other] == fields[own]);
            let within = 2.0 * SURFACE_DEPTH * self.grid.spacing;
            let outside = x + point.normal * (OUTSIDE * self.grid.spacing);
            others.any(|other| match &regions[other] {
                Region::Shape(shape) => shape.signed_distance(x) <= within,
                Region::Cloud(cloud) => cloud.holds(&outside),
            })
        };
        mutant!("contact: joints of a group are surfaces": { return Ok(contacts); });
        contacts.points.retain(|point| !is_joint(point));
        Ok(contacts)
    }

    /// New points on the surface of a body from a file.
    fn cloud_points(&mut self, number: usize) -> Result<Vec<SurfacePoint<D>>, BuildError> {
        let surface = self.cloud(number)?;
        self.make_room(&format!("bodies[{number}].particles"), surface.len())?;
        let mut points = Vec::new();
        for CloudPoint { particle, position, normal, area } in surface {
            points.push(SurfacePoint::new(self.particles.len(), normal, area));
            let velocity = self.particles.velocity.get(particle).copied().unwrap_or_else(Vector::zeros);
            // The particles of a file may lie nearer to the box than half their edge.
            let depth = SURFACE_DEPTH * self.grid.spacing;
            let [lower, upper] = [self.grid.origin, self.grid.position(self.grid.cells)];
            let below = position - normal * depth;
            let x = Vector::from_fn(|k, _| below[k].clamp(lower[k] + depth, upper[k] - depth));
            self.push(x, velocity, 0.0, 0.0, number);
        }
        Ok(points)
    }

    /// The body around the middle of a bounded obstacle, which may lie between particles.
    fn around(&self, regions: &[Region<D>], obstacle: &shape::Shape<D>) -> Option<&str> {
        let (min, max) = obstacle.bounding_box();
        let middle = Some((min + max) * 0.5).filter(|x| x.iter().all(|x| x.is_finite()))?;
        if obstacle.signed_distance(&middle) > 0.0 {
            return None;
        }
        let mut bodies = self.scene.bodies.iter().zip(regions);
        bodies.find(|(_, region)| region.holds(&middle)).map(|(body, _)| body.name.as_str())
    }

    /// The region of each body.
    fn regions(&self) -> Vec<Region<D>> {
        let particles = &self.particles;
        let region = |(number, body): (usize, &Body)| {
            let own = |&p: &usize| particles.body[p] as usize == number && particles.is_solid(p);
            let solid = (0..particles.len()).filter(own).map(|p| (particles.position[p], particles.volume[p]));
            let shape = body.shape.as_ref().and_then(super::shape::Shape::build::<D>);
            shape.map_or_else(|| Region::Cloud(Cloud::new(solid.collect())), Region::Shape)
        };
        self.scene.bodies.iter().enumerate().map(region).collect()
    }

    /// Refuses bodies that start in an obstacle, and a free obstacle and another one that start in each other.
    pub(crate) fn refuse_overlap(&self, contacts: &Contacts<D>) -> Result<(), BuildError> {
        let obstacles = &contacts.obstacles;
        let inside = |([_, other], x): &([usize; 2], &Vector<f64, D>)| obstacles[*other].shape.signed_distance(x) < 0.0;
        if let Some(([one, other], x)) = contacts.apart().find(inside) {
            let names = [one, other].map(|number| &obstacles[number].name);
            let what = format!(
                "the obstacle {:?} starts in the obstacle {:?} at {:?}, and one of them moves freely; move one of the two",
                names[0],
                names[1],
                x.as_slice()
            );
            return Err(BuildError::at(format!("obstacles[{one}]"), what));
        }
        if obstacles.is_empty() {
            return Ok(());
        }
        let (particles, regions, h) = (&self.particles, self.regions(), self.grid.spacing);
        for (i, obstacle) in obstacles.iter().enumerate() {
            let depth = |p: usize| -obstacle.shape.signed_distance(&particles.position[p]);
            let deepest = (0..particles.len()).max_by(|&a, &b| depth(a).total_cmp(&depth(b)));
            if let Some(p) = deepest.filter(|&p| depth(p) > DEEPEST_START * h) {
                let body = &self.scene.bodies[particles.body[p] as usize].name;
                let (x, depth) = (particles.position[p].as_slice(), depth(p) / h);
                let what = format!(
                    "body {body:?} starts in the obstacle {:?}: its point at {x:?} is {depth:.3} grid spacings deep, and {DEEPEST_START} \
                     is allowed; move one of the two",
                    obstacle.name
                );
                return Err(BuildError::at(format!("obstacles[{i}]"), what));
            }
            if let Some(body) = self.around(&regions, &obstacle.shape) {
                let what = format!("obstacle {:?} starts inside body {body:?}; move one of the two", obstacle.name);
                return Err(BuildError::at(format!("obstacles[{i}]"), what));
            }
        }
        Ok(())
    }

    /// Refuses bodies that start in each other, where they may touch.
    pub(crate) fn refuse_overlapping_bodies(&self, contacts: &Contacts<D>) -> Result<(), BuildError> {
        let Some(between) = &contacts.between else { return Ok(()) };
        let regions = self.regions();
        for pair in &between.pairs {
            let [one, other] = pair.bodies;
            for (inner, outer) in [(one, other), (other, one)] {
                if let Some((p, how)) = self.inside(inner, &regions[outer as usize]) {
                    let [inner, outer] = [inner, outer].map(|body| &self.scene.bodies[body as usize].name);
                    let what = format!(
                        "body {inner:?} starts in body {outer:?}: its point at {:?} is {how}; move one of the two, or put both in one group of \
                         contact.groups",
                        self.particles.position[p].as_slice()
                    );
                    return Err(BuildError::at("contact", what));
                }
            }
        }
        self.refuse_touching_clouds(contacts, between)
    }

    /// A particle of the body `inner` that lies in the region of another body, and its depth in words.
    fn inside(&self, inner: u32, outer: &Region<D>) -> Option<(usize, String)> {
        let (particles, h) = (&self.particles, self.grid.spacing);
        let mut own = (0..particles.len()).filter(|&p| particles.body[p] == inner);
        match outer {
            Region::Cloud(cloud) => {
                let p = own.find(|&p| particles.is_solid(p) && cloud.holds(&particles.position[p]))?;
                Some((p, "between its particles".to_owned()))
            }
            Region::Shape(shape) => {
                let depth = |p: usize| -shape.signed_distance(&particles.position[p]);
                let deepest = own.max_by(|&a, &b| depth(a).total_cmp(&depth(b)))?;
                let words = format!("{:.3} grid spacings deep, and {DEEPEST_START} is allowed", depth(deepest) / h);
                (depth(deepest) > DEEPEST_START * h).then_some((deepest, words))
            }
        }
    }

    /// Refuses a body from a file whose surface starts in another surface.
    fn refuse_touching_clouds(&self, contacts: &Contacts<D>, between: &BodyContact<D>) -> Result<(), BuildError> {
        let (bodies, particles, h) = (&self.scene.bodies, &self.particles, self.grid.spacing);
        let positions: Vec<_> = contacts.points.iter().map(|point| particles.position[point.particle]).collect();
        let of = |pair: usize| between.pairs[pair].bodies.map(|body| &bodies[body as usize]);
        let touches =
            |one: &Path| one.depth[1] > DEEPEST_START * h && of(one.pair).iter().any(|body| body.shape.is_none());
        let paths = paths(contacts, between, particles, &self.grid, |number| [positions[number]; 2]);
        let deepest = paths.into_iter().filter(touches).max_by(|one, other| one.depth[1].total_cmp(&other.depth[1]));
        let Some(Path { number, pair, depth: [_, depth], .. }) = deepest else { return Ok(()) };
        let [one, other] = of(pair).map(|body| &body.name);
        let what = format!(
            "bodies {one:?} and {other:?} start in each other: their surfaces overlap by {:.3} grid spacings at {:?}, and {DEEPEST_START} \
             is allowed; the surface of particles from a file lies half their edge outside them; move one of the two, or put both in one \
             group of contact.groups",
            depth / h,
            positions[number].as_slice()
        );
        Err(BuildError::at("contact", what))
    }
}
