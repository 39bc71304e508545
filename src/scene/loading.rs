//! The loads of a scene: body forces, held faces and regions, loads on surfaces.

use super::boundary::{Along, Face, GivenMotion, Table};
use super::filling::Builder;
use super::load::{Loaded, Pressure, Stress, Traction};
use super::vector::vector;
use super::{BuildError, Scene};
use crate::mechanics::loads::{
    Curve, CurveError, ForceField, Gravity, Loads, Motion, Prescribed, Pressing, Rotation, Selection, SurfaceLoad,
    SurfacePoint,
};
use crate::shape;
use crate::tensor::Vector;
use std::sync::Arc;

impl Scene {
    /// All loads on surfaces with their paths, tractions first.
    pub(super) fn surface_loads(&self) -> impl Iterator<Item = (String, Loaded<'_>)> {
        let tractions = self.tractions.iter().map(Traction::loaded).enumerate();
        let pressures = self.pressures.iter().map(Pressure::loaded).enumerate();
        tractions
            .map(|(i, load)| (format!("tractions[{i}]"), load))
            .chain(pressures.map(|(i, load)| (format!("pressures[{i}]"), load)))
    }
}

impl<const D: usize> Builder<'_, D> {
    /// Builds all loads. Points of loaded surfaces become particles without mass.
    pub(crate) fn loads(&mut self) -> Result<Loads<D>, BuildError> {
        let scene = self.scene;
        let mut loads = Loads { damping: scene.damping, ..Loads::default() };
        if let Some(gravity) = &scene.gravity {
            let (acceleration, curve) = (vector(&gravity.acceleration), factor(gravity.curve.as_ref())?);
            if let Some(profile) = &gravity.profile {
                let along = vector::<D>(&profile.along).normalize();
                let factor = factor(Some(&profile.factor))?;
                let field =
                    move |_, x: &Vector<f64, D>, t| acceleration * (curve.value(t) * factor.value(along.dot(x)));
                loads.field = Some(ForceField(Arc::new(field)));
            } else {
                loads.gravity = Some(Gravity { acceleration, curve });
            }
        }
        for (k, (name, face)) in scene.boundary.faces().into_iter().enumerate().take(2 * D) {
            let (axis, upper) = (k / 2, k % 2 == 1);
            let motion = face.unwrap_or(&Face::Free).motion::<D>(axis)?;
            if motion.iter().any(Option::is_some) {
                loads.prescribed.push(Prescribed { name: name.into(), on: Selection::Face { axis, upper }, motion });
            }
        }
        for (i, prescribed) in scene.prescribed.iter().enumerate() {
            let region = prescribed.region.of_nodes(&format!("prescribed[{i}].region"), &self.grid)?;
            // A checked scene gives one motion, and a region has no normal.
            let given = prescribed.given();
            let motion = given.first().map_or_else(|| Face::Free.motion(0), |given| given.motion())?;
            loads.prescribed.push(Prescribed { name: format!("region{i}"), on: Selection::Region(region), motion });
        }
        for (path, load) in scene.surface_loads() {
            let points = self.points(&path, &load)?;
            if points.is_empty() {
                let body = load.body;
                let what = "is loaded; enlarge the region or remove the load";
                return Err(BuildError::at(path, format!("nothing of the surface of body {body:?} {what}")));
            }
            let pressing = match load.stress {
                Stress::Traction(traction) => Pressing::Traction(vector(traction)),
                Stress::Pressure(pressure) => Pressing::Pressure(pressure),
            };
            loads.surface.push(SurfaceLoad { pressing, curve: factor(load.curve.as_ref())?, points });
        }
        let gravity = loads.gravity.as_ref().map_or_else(Vector::zeros, |gravity| gravity.at(0.0));
        loads.contacts = self.contacts(&gravity)?;
        Ok(loads)
    }

    /// The points of a loaded surface. With the key `surface`, these are particles of the body; otherwise, new points on the surface of the
    /// shape.
    pub(super) fn points(&mut self, path: &str, on: &Loaded<'_>) -> Result<Vec<SurfacePoint<D>>, BuildError> {
        let mut bodies = self.scene.bodies.iter().enumerate();
        let Some((number, body)) = bodies.find(|(_, body)| body.name == on.body) else { return Ok(Vec::new()) };
        let region = on.region.as_ref().map(|region| region.built(path)).transpose()?;
        let shape = body.shape.as_ref().and_then(|shape| shape.build::<D>());
        let h = self.grid.spacing;
        if let Some(given) = on.surface {
            let (particles, normal) = (&self.particles, vector::<D>(&given.normal).normalize());
            let spacing = h / f64::from(body.particles_per_cell);
            let loaded = |&p: &usize| {
                let x = &particles.position[p];
                let depth = shape.as_ref().map_or(0.0, |shape| shape.signed_distance(x));
                particles.is_solid(p)
                    && particles.body[p] as usize == number
                    && shape::is_above(depth, spacing)
                    && region.as_ref().is_none_or(|region| region.holds(x, h))
            };
            let point = |particle| SurfacePoint::new(particle, normal, given.area);
            return Ok((0..particles.len()).filter(loaded).map(point).collect());
        }
        let Some(shape) = &shape else { return Ok(Vec::new()) };
        let facets = self.facets(body, shape, region.as_ref())?;
        self.make_room(path, facets.len())?;
        let velocity = body.velocity.as_ref().map_or_else(Vector::zeros, |v| vector(v));
        let mut points = Vec::new();
        for facet in facets {
            points.push(SurfacePoint::new(self.particles.len(), facet.normal, facet.area));
            // Each point lies inside the surface by a tolerance, in a cell that holds the body.
            let x = facet.position - facet.normal * (shape::SURFACE_DEPTH * h);
            self.push(x, velocity, 0.0, 0.0, number);
        }
        Ok(points)
    }
}

impl Face {
    /// The motion of each component, on a face normal to `axis`.
    pub(super) fn motion<const D: usize>(&self, axis: usize) -> Result<[Option<Motion<D>>; D], CurveError> {
        if let Some(given) = self.given() {
            return given.motion();
        }
        let holds = |i: usize| match self {
            Self::Sliding => i == axis,
            Self::Fixed => true,
            Self::Held(components) => components.get(i) == Some(&true),
            _ => false,
        };
        Ok(std::array::from_fn(|i| holds(i).then_some(Motion::Rest)))
    }
}

impl GivenMotion<'_> {
    /// The motion of each component.
    pub(super) fn motion<const D: usize>(self) -> Result<[Option<Motion<D>>; D], CurveError> {
        match self {
            Self::Displacement(table) => table.motion(Motion::Displacement),
            Self::Velocity(table) => table.motion(Motion::Velocity),
            Self::Rotation(rotation) => {
                let axis = rotation.axis.as_ref().map_or([0.0, 0.0, 1.0], |axis| vector::<3>(axis).into());
                let motion = Rotation::new(vector(&rotation.center), axis, factor(Some(&rotation.angle))?);
                Ok(std::array::from_fn(|_| Some(Motion::Rotation(motion.clone()))))
            }
        }
    }
}

impl Table {
    /// One curve per prescribed component.
    fn motion<const D: usize>(&self, kind: fn(Curve) -> Motion<D>) -> Result<[Option<Motion<D>>; D], CurveError> {
        let mut motion = std::array::from_fn(|_| None);
        for (i, motion) in motion.iter_mut().enumerate() {
            let curve = match self {
                Self::Rows(rows) => {
                    let points: Vec<[f64; 2]> =
                        rows.iter().filter_map(|row| Some([row.0, (*row.1.get(i)?)?])).collect();
                    if points.is_empty() { None } else { Some(Curve::new(points)?) }
                }
                Self::Along(Along { direction, curve }) => {
                    let size = direction.get(i).copied().flatten();
                    size.map(|size| Ok::<_, CurveError>(curve.curve()?.times(size))).transpose()?
                }
            };
            *motion = curve.map(kind);
        }
        Ok(motion)
    }
}

/// A factor in time or space; 1 without a curve.
fn factor(given: Option<&super::curve::Curve>) -> Result<Curve, CurveError> {
    given.map_or_else(|| Ok(Curve::constant(1.0)), super::curve::Curve::curve)
}
