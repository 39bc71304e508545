//! The loads of a scene: body forces, held faces and regions, loads on surfaces.

use super::boundary::{Driving, Face, Rotation, Table};
use super::filling::Means;
use super::load::{Loaded, Pressure, Stress, Traction};
use super::vector::vector;
use super::{BuildError, Scene};
use crate::grid::Grid;
use crate::mechanics::loads::ForceField;
use crate::mechanics::loads::{
    self, Curve, Gravity, Loads, Motion, Prescribed, Pressing, Selection, SurfaceLoad, SurfacePoint,
};
use crate::particles::Particles;
use crate::shape;
use crate::tensor::Vector;
use std::sync::Arc;

impl Scene {
    /// Builds all loads. Points of loaded surfaces become particles without mass.
    pub(super) fn loads<const D: usize>(
        &self,
        means: &Means<'_>,
        grid: &Grid<D>,
        particles: &mut Particles<D>,
    ) -> Result<Loads<D>, BuildError> {
        let mut loads = self.given_as_they_are();
        if let Some(gravity) = &self.gravity {
            let acceleration = vector(&gravity.acceleration);
            let curve_in_time = curve("gravity.curve", gravity.curve.as_ref())?;
            if let Some(profile) = &gravity.profile {
                let along = vector::<D>(&profile.along).normalize();
                let factor = curve("gravity.profile.factor", Some(&profile.factor))?;
                let field = move |_, x: &Vector<f64, D>, t| {
                    acceleration * (curve_in_time.value(t) * factor.value(along.dot(x)))
                };
                loads.field = Some(ForceField(Arc::new(field)));
            } else {
                loads.gravity = Some(Gravity { acceleration, curve: curve_in_time });
            }
        }
        for (k, (name, face)) in self.boundary.faces().into_iter().enumerate().take(2 * D) {
            let (Some(face), axis, upper) = (face, k / 2, k % 2 == 1) else { continue };
            let motion = face.motion::<D>(&format!("boundary.{name}"), axis)?;
            if motion.iter().any(Option::is_some) {
                loads.prescribed.push(Prescribed { name: name.into(), on: Selection::Face { axis, upper }, motion });
            }
        }
        for (i, prescribed) in self.prescribed.iter().enumerate() {
            let path = format!("prescribed[{i}]");
            let region = prescribed.region.built(&path)?;
            let mut motion = std::array::from_fn(|_| None);
            if let Some(driving) = prescribed.given().next() {
                motion = driving.motion(&path)?;
            }
            loads.prescribed.push(Prescribed { name: format!("region{i}"), on: Selection::Region(region), motion });
        }
        for (path, load) in self.surface_loads() {
            loads.surface.push(self.surface(&path, &load, means, grid, particles)?);
        }
        Ok(loads)
    }

    /// All loads on surfaces with their paths, tractions first.
    pub(super) fn surface_loads(&self) -> impl Iterator<Item = (String, Loaded<'_>)> {
        let tractions = self.tractions.iter().map(Traction::loaded).enumerate();
        let pressures = self.pressures.iter().map(Pressure::loaded).enumerate();
        tractions
            .map(|(i, load)| (format!("tractions[{i}]"), load))
            .chain(pressures.map(|(i, load)| (format!("pressures[{i}]"), load)))
    }

    /// The points of a loaded surface. With the key `surface`, these are particles of the body; otherwise, new points on the surface of the
    /// shape.
    fn surface<const D: usize>(
        &self,
        path: &str,
        on: &Loaded<'_>,
        means: &Means<'_>,
        grid: &Grid<D>,
        particles: &mut Particles<D>,
    ) -> Result<SurfaceLoad<D>, BuildError> {
        let curve = curve(&format!("{path}.curve"), on.curve.as_ref())?;
        let pressing = match on.stress {
            Stress::Traction(traction) => Pressing::Traction(vector(traction)),
            Stress::Pressure(pressure) => Pressing::Pressure(pressure),
        };
        let region = on.region.as_ref().map(|region| region.built(path)).transpose()?;
        let mut bodies = self.bodies.iter().enumerate();
        let Some((number, body)) = bodies.find(|(_, body)| body.name == on.body) else {
            return Err(nothing_loaded(path, on.body));
        };
        let shape = body.shape.as_ref().and_then(|shape| shape.build::<D>());
        let points = match (&on.surface, &shape) {
            (Some(given), _) => {
                let normal = vector::<D>(&given.normal).normalize();
                let spacing = grid.spacing / f64::from(body.particles_per_cell);
                let loaded = |&p: &usize| {
                    let x = &particles.position[p];
                    let depth = shape.as_ref().map_or(0.0, |shape| shape.signed_distance(x));
                    particles.is_solid(p)
                        && particles.body[p] as usize == number
                        && shape::is_above(depth, spacing)
                        && region.as_ref().is_none_or(|region| region.holds(x, grid.spacing))
                };
                let point = |particle| SurfacePoint { particle, normal, area: given.area };
                (0..particles.len()).filter(loaded).map(point).collect()
            }
            (None, Some(shape)) => {
                let facets = self.facets(body, shape, region.as_ref(), grid);
                means.make_room(path, particles, facets.len())?;
                let velocity = body.velocity.as_ref().map(|v| vector::<D>(v));
                let mut points = Vec::new();
                for facet in facets {
                    points.push(SurfacePoint { particle: particles.len(), normal: facet.normal, area: facet.area });
                    // Each point lies inside the surface by a tolerance, in a cell that holds the body.
                    let x = facet.position - facet.normal * (shape::SURFACE_DEPTH * grid.spacing);
                    if self.time.scheme().has_inertia() {
                        particles.push(x, velocity.unwrap_or_else(Vector::zeros), 0.0, 0.0, number as u32);
                    } else {
                        particles.push_without_inertia(x, 0.0, 0.0, number as u32);
                    }
                }
                points
            }
            (None, None) => Vec::new(),
        };
        if points.is_empty() {
            return Err(nothing_loaded(path, on.body));
        }
        Ok(SurfaceLoad { pressing, curve, points })
    }
}

impl Face {
    /// The motion of each component on a face normal to `axis`.
    fn motion<const D: usize>(&self, path: &str, axis: usize) -> Result<[Option<Motion<D>>; D], BuildError> {
        if let Some(driving) = self.driving() {
            return driving.motion(path);
        }
        let held = |holds: &dyn Fn(usize) -> bool| std::array::from_fn(|i| holds(i).then_some(Motion::Rest));
        Ok(match self {
            Self::Sliding => held(&|i| i == axis),
            Self::Fixed => held(&|_| true),
            Self::Held(components) => held(&|i| components.get(i) == Some(&true)),
            Self::Free | Self::Displacement(_) | Self::Velocity(_) | Self::Rotation(_) => held(&|_| false),
        })
    }
}

impl Driving<'_> {
    /// The motion of each component.
    fn motion<const D: usize>(self, path: &str) -> Result<[Option<Motion<D>>; D], BuildError> {
        let path = format!("{path}.{}", self.key());
        match self {
            Self::Displacement(table) => table.motion(&path, Motion::Displacement),
            Self::Velocity(table) => table.motion(&path, Motion::Velocity),
            Self::Rotation(rotation) => {
                let motion = Motion::Rotation(rotation.built(&path)?);
                Ok(std::array::from_fn(|_| Some(motion.clone())))
            }
        }
    }
}

impl Rotation {
    fn built<const D: usize>(&self, path: &str) -> Result<loads::Rotation<D>, BuildError> {
        let axis = match &self.axis {
            Some(axis) => vector::<3>(axis).into(),
            None => [0.0, 0.0, 1.0],
        };
        Ok(loads::Rotation::new(vector(&self.center), axis, curve(path, Some(&self.angle))?))
    }
}

impl Table {
    /// One curve per prescribed component.
    fn motion<const D: usize>(
        &self,
        path: &str,
        kind: impl Fn(Curve) -> Motion<D>,
    ) -> Result<[Option<Motion<D>>; D], BuildError> {
        let mut motion = std::array::from_fn(|_| None);
        for (i, motion) in motion.iter_mut().enumerate() {
            let points: Vec<[f64; 2]> = self.0.iter().filter_map(|row| Some([row.0, (*row.1.get(i)?)?])).collect();
            if !points.is_empty() {
                *motion = Some(kind(Curve::new(points).map_err(|source| BuildError::at(path, source))?));
            }
        }
        Ok(motion)
    }
}

/// The factor of a load in time; 1 without a curve.
fn curve(path: &str, given: Option<&super::curve::Curve>) -> Result<Curve, BuildError> {
    match given {
        Some(curve) => Curve::new(curve.0.clone()).map_err(|source| BuildError::at(path, source)),
        None => Ok(Curve::constant(1.0)),
    }
}

fn nothing_loaded(path: &str, body: &str) -> BuildError {
    let what = format!("nothing of the surface of body {body:?} is loaded; enlarge the region or remove the load");
    BuildError::at(path, what)
}
