//! One run of the bar, and its measured results.

use crate::riemann::{PSystem, Riemann, State};
use crate::shipped;
use crate::start::velocity_by_masses;
use crate::studies::StudyError;
use bfree::material::Lame;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;

const DENSITY: f64 = 2600.0;
const POISSON: f64 = 0.3;
/// The time of the comparison of profiles.
const END: f64 = 3e-3;
/// The initial position of the jump.
const MIDDLE: f64 = 50.0;

/// A jump of velocity in a bar of a given stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    pub young: f64,
    pub left: f64,
    pub right: f64,
}

impl Jump {
    /// The jump of the paper.
    pub const PAPER: Self = Self { young: 1e10, left: 10.0, right: 0.0 };

    /// A jump of the given size in the stiffer bar: positive is compressive, negative expansive.
    pub const fn of(size: f64) -> Self {
        if size > 0.0 {
            Self { young: 5e10, left: size, right: 0.0 }
        } else {
            Self { young: 5e10, left: 0.0, right: -size }
        }
    }

    pub fn size(&self) -> f64 {
        (self.left - self.right).abs()
    }

    pub fn name(&self) -> String {
        format!("{} m/s, E = {:e} Pa", self.left - self.right, self.young)
    }

    pub fn lame(&self) -> Result<Lame, StudyError> {
        Ok(Lame::from_young_poisson(self.young, POISSON)?)
    }

    pub fn exact(&self) -> Result<Riemann, StudyError> {
        let lame = self.lame()?;
        let system = PSystem { modulus: 0.5 * lame.lambda + lame.shear, density: DENSITY };
        let side = |velocity| State { stretch: 1.0, velocity };
        Ok(system.solve(side(self.left), side(self.right))?)
    }

    /// √(E/ρ) · 1.02, the speed in the paper's Courant number.
    fn courant_speed(&self) -> f64 {
        (self.young / DENSITY).sqrt() / 0.9806
    }
}

/// The settings of a particle run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    pub name: &'static str,
    /// The shape functions, in the form of a scene.
    pub shape: &'static str,
    pub particles_per_cell: u32,
    pub lumping: f64,
    /// Newmark's γ; β = (γ + ½)²/4.
    pub gamma: f64,
    pub transfer: Transfer,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    Flip,
    /// a of κ = a c/h, with the speed of sound c.
    Limited(f64),
}

impl Transfer {
    /// The transfer in the form of a scene.
    fn json(self, speed: f64, h: f64) -> String {
        match self {
            Self::Flip => r#""flip""#.to_owned(),
            Self::Limited(a) => format!(r#"{{"limited":{{"rate":{}}}}}"#, a * speed / h),
        }
    }
}

impl Method {
    /// The paper's scheme with the given shape functions.
    pub const fn paper(name: &'static str, shape: &'static str) -> Self {
        Self { name, shape, particles_per_cell: 4, lumping: 0.8, gamma: 0.5, transfer: Transfer::Flip }
    }

    /// The settings that `scenes/riemann_jump.json` recommends.
    pub const RECOMMENDED: Self = Self {
        name: "recommended",
        shape: r#"{"lme":{"gamma":1.4}}"#,
        particles_per_cell: 4,
        lumping: 0.02,
        gamma: 0.5,
        transfer: Transfer::Limited(0.8),
    };

    /// The recommended settings without smoothing.
    pub const UNDISSIPATED: Self =
        Self { name: "recommended, undissipated", transfer: Transfer::Flip, ..Self::RECOMMENDED };
}

/// Discretisation in space and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mesh {
    pub h: f64,
    pub courant: f64,
}

/// The measured results of a profile at 3 ms.
#[derive(Clone, Debug)]
pub struct Measured {
    /// (Σ V₀ (v_p − v)²)^½ over the particles.
    pub particles: f64,
    /// (Σ h (v_I − v)²)^½ over the nodes.
    pub nodes: f64,
    /// Largest excess over the two states that bound a front, in parts of the jump.
    pub overshoot: f64,
    /// Largest |v − v*| between the fronts, in parts of the jump.
    pub plateau: f64,
    /// The distance from 10 % to 90 % of the front to the right, in metres.
    pub width: f64,
    /// (X, v)
    pub profile: Vec<(f64, f64)>,
}

/// The length at each end of the bar that the error measurement omits.
const ENDS: f64 = 0.5;

/// Half the length of the bar: the way of the waves, and room beyond it for all of their fronts.
fn half_length(exact: &Riemann) -> f64 {
    exact.waves[1].edges().1 * END + 2.5 + ENDS
}

fn steps(jump: &Jump, mesh: &Mesh) -> u64 {
    (END * jump.courant_speed() / (mesh.courant * mesh.h)).round() as u64
}

/// Runs particles up to 3 ms.
pub fn run(method: &Method, jump: &Jump, mesh: &Mesh) -> Result<Measured, StudyError> {
    let exact = jump.exact()?;
    let (h, count) = (mesh.h, (half_length(&exact) / mesh.h).round());
    let (inner, outer) = (count * h, (count + (4.0 / h).round()) * h);
    let lame = jump.lame()?;
    let speed = (lame.p_wave_modulus() / DENSITY).sqrt();
    let steps = steps(jump, mesh);
    let transfer = method.transfer.json(speed, h);
    let beta = 0.25 * (method.gamma + 0.5).powi(2);
    let overrides = [
        format!(r#"grid={{"origin":[{}],"size":[{}],"spacing":{h}}}"#, MIDDLE - outer, 2.0 * outer),
        format!("bodies.0.shape.box.min=[{}]", MIDDLE - inner),
        format!("bodies.0.shape.box.max=[{}]", MIDDLE + inner),
        format!("bodies.0.material.neo_hookean.young={}", jump.young),
        format!("bodies.0.particles_per_cell={}", method.particles_per_cell),
        format!("approximation={}", method.shape),
        format!("time.step={}", END / steps as f64),
        format!("time.gamma={}", method.gamma),
        format!("time.beta={beta}"),
        format!("time.lumping={}", method.lumping),
        format!("transfer={transfer}"),
        "solver.newton.tolerance=1e-8".to_owned(),
        r#"solver.krylov.forcing="eisenstat_walker""#.to_owned(),
    ];
    let mut simulation: Simulation<1> = shipped::simulation("riemann", &overrides)?;
    start_with(&mut simulation, jump)?;
    let reference: Vec<f64> = simulation.particles.position.iter().map(|x| x[0]).collect();
    for _ in 0..steps {
        simulation.advance()?;
    }

    // The nodal profile: the projected velocity at the projected X.
    let particles = simulation.particles.by_id();
    let mut carrier = particles.clone();
    carrier.acceleration = reference.iter().map(|&x| Vector::from([x])).collect();
    let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &carrier.position)?;
    let lumped = Nodal::project(&carrier, &connectivity, 1.0)?;
    let effective = Nodal::project(&particles, &connectivity, method.lumping)?;
    let at_nodes = lumped.acceleration.iter().zip(&effective.velocity).map(|(x, v)| (x[0], h, v[0]));
    let inside = |x: f64| (x - MIDDLE).abs() < inner - ENDS;
    let nodal = distance(&exact, at_nodes.filter(|node| inside(node.0)));

    let profile: Vec<(f64, f64)> =
        reference.iter().zip(&particles.velocity).filter(|at| inside(*at.0)).map(|(&x, v)| (x, v[0])).collect();
    let volume = particles.volume.first().copied().unwrap_or(0.0);
    Ok(measure(jump, &exact, profile, volume, nodal))
}

/// The jump at X = 50 m.
fn start_with(simulation: &mut Simulation<1>, jump: &Jump) -> Result<(), StudyError> {
    let side = |x: f64| if x <= MIDDLE { jump.left } else { jump.right };
    Ok(velocity_by_masses(simulation, |x| x.map(side))?)
}

/// (Σ w (v − v_exact)²)^½ over points (X, w, v).
fn distance(exact: &Riemann, points: impl Iterator<Item = (f64, f64, f64)>) -> f64 {
    points.map(|(x, w, v)| w * (v - exact.at((x - MIDDLE) / END).velocity).powi(2)).sum::<f64>().sqrt()
}

fn measure(jump: &Jump, exact: &Riemann, profile: Vec<(f64, f64)>, volume: f64, nodes: f64) -> Measured {
    let [left, star, right] = exact.states.map(|state| state.velocity);
    let (mut overshoot, mut plateau): (f64, f64) = (0.0, 0.0);
    let inner_edge = exact.waves[1].edges().0 * END;
    for &(x, v) in &profile {
        let outer = if x < MIDDLE { left } else { right };
        let excess = (v - outer.max(star)).max(outer.min(star) - v);
        overshoot = overshoot.max(excess / jump.size());
        if (x - MIDDLE).abs() < 0.85 * inner_edge {
            plateau = plateau.max((v - star).abs() / jump.size());
        }
    }
    // The outermost position at which the front to the right crosses a level.
    let crossing = |level: f64| {
        let part = |v: f64| (v - right) / (star - right);
        let pairs = profile.windows(2).rev();
        let found = pairs.into_iter().find(|pair| part(pair[0].1) >= level && part(pair[1].1) < level);
        found.map_or(f64::NAN, |pair| {
            let share = (part(pair[0].1) - level) / (part(pair[0].1) - part(pair[1].1));
            pair[0].0 + share * (pair[1].0 - pair[0].0)
        })
    };
    let width = crossing(0.1) - crossing(0.9);
    let particles = distance(exact, profile.iter().map(|&(x, v)| (x, volume, v)));
    Measured { particles, nodes, overshoot, plateau, width, profile }
}
