//! The tangent of contact and friction against dual numbers: every kind of surface, at rest and turned, for points that stick, that slip and
//! that are pressed with no friction.

use crate::check::regime::Regime;
use crate::check::tangent::measure;
use crate::random::Random;
use crate::report::Report;
use crate::studies::StudyError;
use crate::studies::tangent::{SPACING, cloud};
use bfree::approximation::{Approximation, Bspline};
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{
    BodyContact, Candidate, ContactConstants, Curve, Motion, Obstacle, RigidBody, Rotation, Share,
};
use bfree::shape::{Ball, Block, Cone, HalfSpace, Shape};
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};

/// A state of friction: its name, μ, and the distance of anchors from their points in spacings. Points are 0.05 spacings deep, so that the
/// largest elastic slip is 0.02 spacings.
const STATES: [(&str, f64, f64); 3] = [("no friction", 0.0, 0.0), ("stick", 0.4, 2e-3), ("slip", 0.4, 0.1)];

/// Obstacles around the point `x`, so that it lies in them: a plane, a ball, a hole, an edge and a corner, and a cylinder.
fn shapes<const D: usize>(x: &Vector<f64, D>) -> Vec<(&'static str, Shape<D>)> {
    let last = Vector::<f64, D>::from_fn(|k, _| if k == D - 1 { 1.0 } else { 0.3 });
    let depth = 0.05 * SPACING;
    let outside = x + last / last.norm() * (1.0 - depth);
    let hole = Ball { center: x - last / last.norm() * (1.0 + depth), radius: 1.0 };
    let everything = Block { min: x.add_scalar(-9.0), max: x.add_scalar(9.0) };
    let mut shapes = vec![
        ("plane", HalfSpace { point: x - last * depth, normal: -last }.into()),
        ("ball", Ball { center: outside, radius: 1.0 }.into()),
        ("hole", bfree::shape::Difference { of: Box::new(everything.into()), minus: Box::new(hole.into()) }.into()),
    ];
    if D == 3 {
        let across = Vector::from_fn(|k, _| if k == 0 { 1.0 } else { 0.0 });
        let cone = Cone::new([outside - across * 2.0, outside + across * 2.0], [0.8, 1.4]);
        shapes.extend(cone.map(|cone| ("cone", cone.into())));
    }
    shapes
}

fn dimension<const D: usize>(report: &mut Report) -> Result<(), StudyError> {
    let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(1000.0, 0.3)?));
    let mut random = Random::new(3);
    let approximation = Approximation::from(Bspline::Cubic);
    let mut simulation: Simulation<D> = cloud(law, approximation, Regime::Moderate, &mut random)?;
    simulation.loads.contacts.points = std::mem::take(&mut simulation.loads.surface).remove(0).points;
    let points = simulation.loads.contacts.points.clone();
    let middle = simulation.particles.position[points[points.len() / 2].particle];
    for (name, friction, slip) in STATES.into_iter().take(if D == 1 { 1 } else { STATES.len() }) {
        simulation.loads.contacts.between = Some(between(&simulation, friction, slip, &mut random));
        push(report, &simulation, ["another body", name, "at rest"], slip, &mut random)?;
    }
    simulation.loads.contacts.between = None;
    for (shape, solid) in shapes(&middle) {
        for way in ["at rest", "turned", "free"] {
            let turned = way == "turned";
            if D == 1 && turned {
                continue;
            }
            // In 1D there is no direction to slip.
            for (name, friction, slip) in STATES.into_iter().take(if D == 1 { 1 } else { STATES.len() }) {
                let motion = std::array::from_fn(|_| turned.then(|| turning(middle)));
                let mut obstacle =
                    Obstacle::new("obstacle", solid.clone(), motion, ContactConstants { stiffness: 1.0, friction });
                if way == "free" {
                    obstacle.free = Some(free(&simulation, middle, &mut random));
                }
                let pose = obstacle.pose(simulation.clock.step());
                let near = |at: usize| pose.to_frame(&simulation.particles.position[at]);
                obstacle.anchors =
                    points.iter().map(|point| near(point.particle) + random.vector() * (slip * SPACING)).collect();
                simulation.loads.contacts.obstacles = vec![obstacle];
                push(report, &simulation, [shape, name, way], slip, &mut random)?;
            }
        }
    }
    Ok(())
}

/// Measures the tangent at a random motion that keeps the state of friction.
fn push<const D: usize>(
    report: &mut Report,
    simulation: &Simulation<D>,
    [what, state, way]: [&str; 3],
    slip: f64,
    random: &mut Random,
) -> Result<(), StudyError> {
    let coming = simulation.next_step()?;
    let size = if slip < 0.1 { 1e-4 } else { 1e-2 };
    let mut dphi: Vec<Vector<f64, D>> =
        random.field(coming.nodes().len()).iter().map(|x| x * (size * SPACING)).collect();
    coming.prescribe(&mut dphi);
    let equilibrium = coming.equilibrium();
    for measured in measure(&equilibrium, &dphi, random)? {
        let of_contact = ["contact", "whole product", "diagonal blocks"];
        if of_contact.contains(&measured.quantity.as_str()) {
            let labels = [&measured.quantity, what, &D.to_string(), state, way];
            report.push(&labels, measured.value, measured.bound);
        }
    }
    Ok(())
}

/// Every point faces the points after and before it, which carry a place at a depth of 0.05 spacings below it.
fn between<const D: usize>(
    simulation: &Simulation<D>,
    friction: f64,
    slip: f64,
    random: &mut Random,
) -> BodyContact<D> {
    let points = &simulation.loads.contacts.points;
    let x = |number: usize| simulation.particles.position[points[number].particle];
    let mut between = BodyContact::new(ContactConstants { stiffness: 1.0, friction }, &[0, 1]);
    for number in 0..points.len() {
        let normal = random.vector::<D>().normalize();
        let start = normal * (-0.05 * SPACING);
        let [after, before] = [(number + 1) % points.len(), (number + points.len() - 1) % points.len()];
        let of_before = Share { number: before, share: 0.6, offset: random.vector() * (0.2 * SPACING) };
        let rest = x(number) - start - (x(before) + of_before.offset) * of_before.share;
        let of_after = Share { number: after, share: 0.4, offset: rest / 0.4 - x(after) };
        let slip = random.vector() * (slip * SPACING);
        let (part, edges, closest) = (0.8, [0.3, 0.6], vec![of_after, of_before]);
        between.candidates.push(Candidate {
            number,
            pair: 0,
            part,
            edges,
            is_first: true,
            normal,
            start,
            slip,
            closest,
        });
    }
    between
}

/// A rigid body that turns about `center`, in the midst of a turn. Its mass resists as much as all points of contact.
fn free<const D: usize>(simulation: &Simulation<D>, center: Vector<f64, D>, random: &mut Random) -> RigidBody<D> {
    let area: f64 = simulation.loads.contacts.points.iter().map(|point| point.area).sum();
    let stiffness = bfree::material::p_wave_modulus(&simulation.bodies[0].law) / simulation.grid.spacing;
    let mass = area * stiffness / simulation.settings.scheme.end(simulation.clock.step()).a1;
    let inertia = Tensor::<f64, 3>::new(3.0, 0.4, 0.1, 0.4, 2.0, -0.2, 0.1, -0.2, 1.0) * (mass * SPACING * SPACING);
    let spin = if D == 1 { Vector::zeros() } else { random.vector::<3>() };
    let spin = if D == 2 { Vector::from([0.0, 0.0, spin[2]]) } else { spin };
    let mut body = RigidBody::new(mass, inertia, center, random.vector() * 0.1, spin);
    if let Some(turned) = bfree::shape::rotation::<3>(20.0, Some(&Vector::from([0.0, 0.0, 1.0]))).filter(|_| D > 1) {
        body.rotation = turned;
    }
    body
}

/// A turn by a third of a radian in the first step.
fn turning<const D: usize>(center: Vector<f64, D>) -> Motion<D> {
    let angle = Curve::new(vec![[0.0, 0.0], [1e-3, 1.0 / 3.0]]).unwrap_or_else(|_| Curve::constant(0.0));
    Motion::Rotation(Rotation::new(center, [0.2, -0.3, 1.0], angle))
}

pub(super) fn reports() -> Result<Vec<Report>, StudyError> {
    let columns = ["quantity", "obstacle", "D", "state", "motion"];
    let mut report =
        Report::new("tangent of contact: |K u - dual(R) u| / |K u|, bound min(64 eps k(F)^2, 1e-10)", &columns);
    dimension::<1>(&mut report)?;
    dimension::<2>(&mut report)?;
    dimension::<3>(&mut report)?;
    report.note("'hole' is the inside of a hole in a solid. The cone has the curvature of its side in 3D.");
    Ok(vec![report])
}
