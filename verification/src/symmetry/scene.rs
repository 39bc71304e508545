//! A small scene in two dimensions, as numbers that can be transformed, and as JSON.

use serde_json::{Value, json};

/// The names of the faces of the box, in the order of their numbers: twice the axis, plus one at the upper end.
pub const FACES: [&str; 6] = ["left", "right", "bottom", "top", "back", "front"];

/// The units of length, time and density; the numbers of a scene are multiples of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    pub length: f64,
    pub time: f64,
    pub density: f64,
}

impl Units {
    pub const ONE: Self = Self { length: 1.0, time: 1.0, density: 1.0 };

    pub fn velocity(self) -> f64 {
        self.length / self.time
    }

    pub fn stress(self) -> f64 {
        self.density * self.velocity() * self.velocity()
    }

    /// The force, per depth in two dimensions.
    pub fn force(self, dimension: i32) -> f64 {
        self.stress() * self.length.powi(dimension - 1)
    }

    pub fn energy(self, dimension: i32) -> f64 {
        self.stress() * self.length.powi(dimension)
    }
}

/// A body's shape, or a region.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    Box { min: [f64; 2], max: [f64; 2] },
    Ball { center: [f64; 2], radius: f64 },
    Polygon(Vec<[f64; 2]>),
}

/// A law, with moduli near 1000.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    NeoHookean,
    Logarithmic,
    StVenantKirchhoff,
    MooneyRivlin,
    /// Fibres along this direction.
    Fibres([f64; 2]),
    Viscoelastic,
    VonMises,
    DruckerPrager,
}

/// The condition at a face of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    Sliding,
    Fixed,
    /// A displacement that grows from the start to the end of the run.
    Moves([f64; 2]),
}

/// A load on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    pub region: Form,
    pub pressing: Pressing,
    /// Outward normal and area of each particle that carries the load.
    pub carried: ([f64; 2], f64),
}

/// A traction or a follower pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pressing {
    Traction([f64; 2]),
    Pressure(f64),
}

/// A time scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    Newmark,
    GeneralizedAlpha,
    LoadSteps,
}

/// A scene.
#[derive(Clone, Debug)]
pub struct Scene {
    pub units: Units,
    pub origin: [f64; 2],
    pub cells: [u32; 2],
    pub spacing: f64,
    /// The shape functions in the form of a scene.
    pub family: Value,
    pub layout: &'static str,
    pub fill: &'static str,
    pub renewed: Value,
    pub bodies: Vec<Form>,
    pub law: Law,
    pub averaged: bool,
    pub velocity: [f64; 2],
    /// Left, right, bottom, top.
    pub faces: [Option<Hold>; 4],
    pub gravity: Option<[f64; 2]>,
    pub load: Option<Load>,
    pub scheme: Scheme,
    pub step: f64,
    pub steps: u32,
    pub lumping: f64,
    pub wall_update: &'static str,
    /// The rate at which velocities relax to those of the nodes.
    pub blend: Option<f64>,
    /// Rayleigh's constants, of mass and of stiffness.
    pub damping: Option<[f64; 2]>,
    /// Whether nodes with little mass follow others.
    pub aggregation: bool,
    /// The tolerance of each linear system.
    pub forcing: f64,
    /// Whether the scene is a slab of one cell between sliding faces in three dimensions.
    pub slab: bool,
}

impl Form {
    /// The shape as JSON; in a slab with this thickness, if there is one.
    fn json(&self, length: f64, thickness: Option<f64>) -> Value {
        let point = |x: [f64; 2], z: f64| {
            let plane = x.map(|x| x * length);
            thickness.map_or_else(|| json!(plane), |_| json!([plane[0], plane[1], z * length]))
        };
        match self {
            Self::Box { min, max } => {
                json!({ "box": { "min": point(*min, 0.0), "max": point(*max, thickness.unwrap_or(0.0)) } })
            }
            Self::Ball { center, radius } => {
                json!({ "ball": { "center": point(*center, 0.0), "radius": radius * length } })
            }
            Self::Polygon(corners) => json!({ "polygon": corners.iter().map(|x| point(*x, 0.0)).collect::<Vec<_>>() }),
        }
    }
}

impl Law {
    fn json(self, units: Units) -> Value {
        let stress = units.stress();
        let elastic = json!({ "young": 1000.0 * stress, "poisson": 0.3 });
        match self {
            Self::NeoHookean => json!({ "neo_hookean": elastic }),
            Self::Logarithmic => json!({ "neo_hookean_logarithmic": elastic }),
            Self::StVenantKirchhoff => json!({ "st_venant_kirchhoff": elastic }),
            Self::MooneyRivlin => {
                json!({ "mooney_rivlin": { "c1": 150.0 * stress, "c2": 40.0 * stress, "bulk": 800.0 * stress } })
            }
            Self::Fibres(direction) => json!({ "fibre_reinforced": {
                "base": { "neo_hookean": elastic }, "modulus": 200.0 * stress, "exponent": 2.0,
                "direction": [direction[0], direction[1], 0.0] } }),
            Self::Viscoelastic => json!({ "viscoelastic": {
                "base": { "neo_hookean": elastic },
                "branches": [{ "shear": 200.0 * stress, "relaxation_time": 0.02 * units.time }] } }),
            Self::VonMises => json!({ "von_mises": {
                "elastic": elastic, "yield_stress": { "initial": 8.0 * stress, "linear": 40.0 * stress } } }),
            Self::DruckerPrager => json!({ "drucker_prager": {
                "elastic": elastic, "friction": 25.0, "dilatancy": 5.0,
                "cohesion": { "initial": 6.0 * stress, "linear": 30.0 * stress } } }),
        }
    }

    /// Whether its energy has a purely volumetric part.
    pub fn has_volumetric_part(self) -> bool {
        !matches!(self, Self::StVenantKirchhoff | Self::DruckerPrager)
    }
}

impl Scene {
    pub fn dimension(&self) -> i32 {
        if self.slab { 3 } else { 2 }
    }

    /// The scene in the form a user writes.
    pub fn json(&self) -> Value {
        let units = self.units;
        let in_space = |x: [f64; 2], unit: f64| {
            let plane = x.map(|x| x * unit);
            if self.slab { json!([plane[0], plane[1], 0.0]) } else { json!(plane) }
        };
        let thickness = self.slab.then_some(self.spacing);
        let edges = self.cells.map(|cells| f64::from(cells) * self.spacing * units.length);
        let size = if self.slab { json!([edges[0], edges[1], self.spacing * units.length]) } else { json!(edges) };
        let inertia = self.scheme != Scheme::LoadSteps;
        let bodies = self.bodies.iter().enumerate().map(|(number, form)| {
            let mut body = json!({
                "name": name(number), "shape": form.json(units.length, thickness), "material": self.law.json(units),
                "density": units.density, "layout": self.layout, "fill": self.fill,
                "volumetric": if self.averaged { "mean_dilatation" } else { "pointwise" },
            });
            if inertia {
                body["velocity"] = in_space(self.velocity, units.velocity());
            }
            body
        });
        let mut scene = json!({
            "grid": { "origin": in_space(self.origin, units.length), "size": size,
                      "spacing": self.spacing * units.length, "reset": self.renewed },
            "approximation": self.family,
            "bodies": bodies.collect::<Vec<_>>(),
            "boundary": self.boundary(&in_space),
            "solver": { "newton": { "tolerance": 1e-14, "max_iterations": 50 }, "krylov": { "forcing": { "fixed": self.forcing } } },
            "time": self.time(), "aggregation": self.aggregation,
        });
        let duration = f64::from(self.steps) * self.step * units.time;
        let ramp = json!([[0, 0.5], [duration, 1]]);
        if let Some(gravity) = self.gravity {
            let acceleration = in_space(gravity, units.velocity() / units.time);
            scene["gravity"] = json!({ "acceleration": acceleration, "curve": ramp });
        }
        self.write_load(&mut scene, &ramp, thickness, &in_space);
        if let (Some(rate), true) = (self.blend, inertia) {
            scene["transfer"] = json!({ "blend": { "rate": rate / units.time, "order": 2 } });
        }
        if let (Some([mass, stiffness]), true) = (self.damping, inertia) {
            scene["damping"] = json!({ "mass": mass / units.time, "stiffness": stiffness * units.time });
        }
        scene
    }

    fn time(&self) -> Value {
        let step = self.step * self.units.time;
        let mut time = json!({ "step": step, "end": f64::from(self.steps) * step, "max_halvings": 0 });
        time["scheme"] = match self.scheme {
            Scheme::Newmark => json!("newmark"),
            Scheme::GeneralizedAlpha => json!({ "generalized_alpha": { "spectral_radius": 0.6 } }),
            Scheme::LoadSteps => json!("none"),
        };
        if self.scheme != Scheme::LoadSteps {
            time["lumping"] = json!(self.lumping);
            time["wall_update"] = json!(self.wall_update);
        }
        time
    }

    fn boundary(&self, in_space: &dyn Fn([f64; 2], f64) -> Value) -> Value {
        let duration = f64::from(self.steps) * self.step * self.units.time;
        let mut boundary = json!({});
        for (face, hold) in FACES.iter().zip(self.faces) {
            boundary[*face] = match hold {
                None => json!("free"),
                Some(Hold::Sliding) => json!("sliding"),
                Some(Hold::Fixed) => json!("fixed"),
                Some(Hold::Moves(by)) => json!({ "displacement": [
                    [0, in_space([0.0; 2], 1.0)], [duration, in_space(by, self.units.length)]] }),
            };
        }
        if self.slab {
            (boundary["back"], boundary["front"]) = (json!("sliding"), json!("sliding"));
        }
        boundary
    }

    fn write_load(
        &self,
        scene: &mut Value,
        ramp: &Value,
        thickness: Option<f64>,
        in_space: &dyn Fn([f64; 2], f64) -> Value,
    ) {
        let Some(load) = &self.load else { return };
        let units = self.units;
        // In a slab, two layers of particles share its depth.
        let depth = thickness.map_or(1.0, |thickness| 0.5 * thickness * units.length);
        let loads = (0..self.bodies.len()).map(|number| {
            let region = load.region.json(units.length, thickness);
            let mut one = json!({ "body": name(number), "region": region, "curve": ramp });
            match load.pressing {
                Pressing::Traction(traction) => one["traction"] = in_space(traction, units.stress()),
                Pressing::Pressure(pressure) => one["pressure"] = json!(pressure * units.stress()),
            }
            let (normal, area) = load.carried;
            one["surface"] = json!({ "normal": in_space(normal, 1.0), "area": area * units.length * depth });
            one
        });
        let key = if matches!(load.pressing, Pressing::Traction(_)) { "tractions" } else { "pressures" };
        scene[key] = Value::Array(loads.collect());
    }
}

fn name(number: usize) -> String {
    format!("body {number}")
}
