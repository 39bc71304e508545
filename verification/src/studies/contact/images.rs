//! Random scenes of bodies that meet each other and a floor, and their images: mirrored, turned, shifted by cells, and with the bodies in another
//! order. The images move alike, as far as rounding allows.

use super::{Effort, StudyError, built};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use rayon::prelude::*;
use serde_json::{Value, json};

const SIZE: f64 = 5.0;
const SPACING: f64 = 0.25;
const STEPS: usize = 30;

type Point = [f64; 2];

/// A body: the vertices of a polygon, or the centre of a ball and its radius.
struct Body {
    outline: Vec<Point>,
    radius: Option<f64>,
    velocity: Point,
    young: f64,
}

/// A random scene.
struct Scene {
    bodies: Vec<Body>,
    friction: f64,
    gravity: f64,
}

/// An image of a scene.
struct Image {
    name: &'static str,
    /// The image of a vector, and the image of the middle of the box.
    map: fn(Point) -> Point,
    shift: Point,
    /// The order of the bodies.
    order: [usize; 3],
}

const SAME: [usize; 3] = [0, 1, 2];

const IMAGES: [Image; 5] = [
    Image { name: "mirrored", map: |[x, y]| [-x, y], shift: [0.0; 2], order: SAME },
    Image { name: "turned", map: |[x, y]| [-y, x], shift: [0.0; 2], order: SAME },
    Image { name: "transposed", map: |[x, y]| [y, x], shift: [0.0; 2], order: SAME },
    Image { name: "shifted", map: |x| x, shift: [2.0 * SPACING, SPACING], order: SAME },
    Image { name: "other order", map: |x| x, shift: [0.0; 2], order: [2, 0, 1] },
];

const IDENTITY: Image = Image { name: "the scene", map: |x| x, shift: [0.0; 2], order: SAME };

/// Three bodies around the middle of the box, that move towards it.
fn scene(random: &mut Random) -> Scene {
    let first = random.between(0.0, 6.0);
    let body = |i: usize| {
        let angle = first + 2.1 * i as f64 + random.between(-0.2, 0.2);
        let radius = random.between(0.35, 0.5);
        let center = [angle.cos(), angle.sin()].map(|one| 0.75 * one);
        let turn = random.between(0.0, 6.0);
        let sides = 3 + (random.between(0.0, 3.0) as usize);
        let vertex = |k: usize| {
            let at = turn + std::f64::consts::TAU * k as f64 / sides as f64;
            [center[0] + radius * at.cos(), center[1] + radius * at.sin()]
        };
        let is_round = random.signed() > 0.0;
        Body {
            outline: if is_round { vec![center] } else { (0..sides).map(vertex).collect() },
            radius: is_round.then_some(radius),
            velocity: center.map(|one| -4.0 * one + random.between(-0.5, 0.5)),
            young: 10_f64.powf(random.between(3.0, 4.0)),
        }
    };
    let bodies = (0..3).map(body).collect();
    Scene {
        bodies,
        friction: if random.signed() > 0.0 { 0.0 } else { random.between(0.1, 0.6) },
        gravity: random.between(0.0, 10.0),
    }
}

impl Image {
    fn at(&self, x: Point) -> Point {
        let mapped = (self.map)(x);
        [0, 1].map(|k| 0.5 * SIZE + mapped[k] + self.shift[k])
    }

    fn of(&self, scene: &Scene) -> Value {
        let body = |&i: &usize| {
            let Body { outline, radius, velocity, young } = &scene.bodies[i];
            let at: Vec<Point> = outline.iter().map(|&x| self.at(x)).collect();
            let shape = radius.map_or_else(
                || json!({ "polygon": at }),
                |radius| json!({ "ball": { "center": at[0], "radius": radius } }),
            );
            json!({ "name": format!("body {i}"), "density": 1, "velocity": (self.map)(*velocity), "shape": shape,
                    "material": { "neo_hookean": { "young": young, "poisson": 0.3 } } })
        };
        json!({
            "grid": { "size": [SIZE, SIZE], "spacing": SPACING },
            "time": { "step": 0.01, "end": 1 },
            "solver": { "newton": { "tolerance": 1e-12 }, "krylov": { "forcing": { "fixed": 1e-10 } } },
            "bodies": self.order.iter().map(body).collect::<Vec<_>>(),
            "gravity": { "acceleration": (self.map)([0.0, -scene.gravity]) },
            "contact": { "friction": scene.friction },
            "obstacles": [{ "name": "floor", "friction": scene.friction,
                            "shape": { "half_space": { "point": self.at([0.0, -1.5]), "normal": (self.map)([0.0, 1.0]) } } }]
        })
    }
}

/// The end of a scene.
struct End {
    /// The momentum of every body, in the order of the scene.
    momenta: Vec<Point>,
    /// The difference of the dissipated energy from the sum of the friction losses over obstacles and pairs, relative to it.
    books: f64,
}

/// Runs an image of a scene; `None` if a step is refused.
fn end(image: &Image, scene: &Scene) -> Result<Option<End>, StudyError> {
    let mut simulation: Simulation<2> = built(&image.of(scene))?;
    for _ in 0..STEPS {
        if simulation.advance().is_err() {
            return Ok(None);
        }
    }
    let particles = &simulation.particles;
    let of = |body: usize| {
        let own = (0..particles.len()).filter(|&p| particles.body[p] as usize == body);
        let sum: Vector<f64, 2> = own.map(|p| particles.velocity[p] * particles.mass[p]).sum();
        [sum[0], sum[1]]
    };
    let place = |body: usize| image.order.iter().position(|&one| one == body).unwrap_or(body);
    let (dissipated, losses) = (simulation.dissipated, simulation.loads.contacts.friction_loss());
    let books = if dissipated == losses { 0.0 } else { (dissipated - losses).abs() / dissipated };
    Ok(Some(End { momenta: (0..scene.bodies.len()).map(|body| of(place(body))).collect(), books }))
}

pub(super) fn report(effort: &Effort) -> Result<Report, StudyError> {
    let count = if *effort == Effort::Full { 12 } else { 1 };
    let title =
        "random scenes with contact and their images: largest difference of a momentum, over the largest momentum";
    let mut report = Report::new(title, &["seed", "image"]);
    let run = |seed: u64| {
        let scene = scene(&mut Random::new(seed));
        let others = IMAGES.iter().map(|image| end(image, &scene));
        Ok::<_, StudyError>((seed, end(&IDENTITY, &scene)?, others.collect::<Result<Vec<_>, _>>()?))
    };
    for (seed, first, others) in (1..=count).into_par_iter().map(run).collect::<Result<Vec<_>, _>>()? {
        for (image, other) in IMAGES.iter().zip(others) {
            let labels = [&seed.to_string(), image.name];
            let (Some(one), Some(other)) = (&first, &other) else {
                // A refused step is refused in every image.
                report.push(&labels, f64::from(u8::from(first.is_some() != other.is_some())), Bound::AtMost(0.0));
                continue;
            };
            // The sum over steps and that over contacts differ by their order.
            report.push(&[&seed.to_string(), &format!("{}: books", image.name)], other.books, Bound::AtMost(1e-12));
            let (one, other) = (&one.momenta, &other.momenta);
            let norm = |[x, y]: Point| x.hypot(y);
            let scale = one.iter().map(|&p| norm(p)).fold(0.0, f64::max);
            let apart = one.iter().zip(other).map(|(&one, other)| {
                let mapped = (image.map)(one);
                norm([mapped[0] - other[0], mapped[1] - other[1]])
            });
            report.push(&labels, apart.fold(0.0, f64::max) / scale, Bound::AtMost(1e-7));
        }
    }
    report.note(
        "Bound: the tolerance of Newton's method, 1e-12, times the growth of a difference in 30 steps with impacts.",
    );
    report.note("Books: the dissipated energy less the friction losses of all obstacles and pairs, relative to it.");
    Ok(report)
}
