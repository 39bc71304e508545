//! The loads of a scene: body forces, held faces and regions, loads on surfaces.

use super::boundary::{Driving, Face, Rotation, Table};
use super::build_error::vector;
use super::filling::Means;
use super::load::Loaded;
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
            let acceleration = vector("gravity.acceleration", &gravity.acceleration)?;
            let curve_in_time = curve("gravity.curve", gravity.curve.as_ref())?;
            if let Some(profile) = &gravity.profile {
                let along = vector::<D>("gravity.profile.along", &profile.along)?.normalize();
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
            let region = prescribed.region.build::<D>().ok_or_else(|| BuildError::dimension::<D>(&path))?;
            let mut motion = std::array::from_fn(|_| None);
            if let Some(driving) = prescribed.given().next() {
                motion = driving.motion(&path)?;
            }
            loads.prescribed.push(Prescribed { name: format!("region{i}"), on: Selection::Region(region), motion });
        }
        for (i, traction) in self.tractions.iter().enumerate() {
            let path = format!("tractions[{i}]");
            let pressing = Pressing::Traction(vector(&format!("{path}.traction"), &traction.traction)?);
            loads.surface.push(self.surface(&path, pressing, &traction.loaded(), means, grid, particles)?);
        }
        for (i, pressure) in self.pressures.iter().enumerate() {
            let pressing = Pressing::Pressure(pressure.pressure);
            let path = format!("pressures[{i}]");
            loads.surface.push(self.surface(&path, pressing, &pressure.loaded(), means, grid, particles)?);
        }
        Ok(loads)
    }

    /// The points of a loaded surface. With the key `surface`, these are particles of the body; otherwise, new points on the surface of the
    /// shape.
    fn surface<const D: usize>(
        &self,
        path: &str,
        pressing: Pressing<D>,
        on: &Loaded<'_>,
        means: &Means<'_>,
        grid: &Grid<D>,
        particles: &mut Particles<D>,
    ) -> Result<SurfaceLoad<D>, BuildError> {
        let curve = curve(&format!("{path}.curve"), on.curve.as_ref())?;
        let built = |region: &super::shape::Shape| region.build::<D>().ok_or_else(|| BuildError::dimension::<D>(path));
        let region = on.region.as_ref().map(built).transpose()?;
        let Some((number, body)) = self.bodies.iter().enumerate().find(|(_, body)| body.name == on.body) else {
            return Err(BuildError::dimension::<D>(path));
        };
        let shape = body.shape.as_ref().and_then(|shape| shape.build::<D>());
        let points = match (&on.surface, &shape) {
            (Some(given), _) => {
                let normal = vector::<D>(&format!("{path}.surface.normal"), &given.normal)?.normalize();
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
                let velocity = body.velocity.as_ref().map(|v| vector::<D>(path, v)).transpose()?;
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
            return Err(BuildError::NoSurface { path: path.into(), body: on.body.into() });
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
            Some(axis) => vector::<3>(path, axis)?.into(),
            None => [0.0, 0.0, 1.0],
        };
        Ok(loads::Rotation::new(vector(path, &self.center)?, axis, curve(path, Some(&self.angle))?))
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
                *motion =
                    Some(kind(Curve::new(points).map_err(|source| BuildError::Curve { path: path.into(), source })?));
            }
        }
        Ok(motion)
    }
}

/// The factor of a load in time; 1 without a curve.
fn curve(path: &str, given: Option<&super::curve::Curve>) -> Result<Curve, BuildError> {
    match given {
        Some(curve) => Curve::new(curve.0.clone()).map_err(|source| BuildError::Curve { path: path.into(), source }),
        None => Ok(Curve::constant(1.0)),
    }
}
