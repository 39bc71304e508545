//! A block that settles under gravity: 2ᴰ jittered particles per cell, Courant number 1 by √((Λ+2G)/ρ).

use crate::random::Random;
use crate::studies::StudyError;
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Loads, Motion, Prescribed, Selection};
use bfree::particles::{Body, Particles};
use bfree::simulation::{Settings, Simulation};
use bfree::solver::{Forcing, Krylov, NewtonSettings};
use bfree::tensor::Vector;

/// E = 1000, ν = 0.3, ρ = 1, h = 1.
pub(crate) fn lame() -> Result<Lame, StudyError> {
    Ok(Lame::from_young_poisson(1000.0, 0.3)?)
}

/// `cells`ᴰ cells on a sliding floor; `jitter` is the largest displacement of a particle along an axis, in cells.
pub(crate) fn block<const D: usize>(
    approximation: Approximation,
    law: Option<Material>,
    cells: u32,
    jitter: f64,
    lumping: f64,
) -> Result<Simulation<D>, StudyError> {
    let lame = lame()?;
    let mut random = Random::new(3);
    let mut particles = Particles::default();
    let side = 2 * cells as usize;
    let volume = 0.5_f64.powi(D as i32);
    for k in 0..side.pow(D as u32) {
        let place = Vector::<f64, D>::from_fn(|i, _| ((k / side.pow(i as u32)) % side) as f64 * 0.5 + 0.25);
        // Two empty cells around the block, none below it.
        let offset = Vector::<f64, D>::from_fn(|i, _| if i == D - 1 { 0.0 } else { 2.0 });
        particles.push(place + offset + random.vector() * jitter, Vector::zeros(), volume, volume, 0);
    }
    let mut motion = std::array::from_fn(|_| None);
    motion[D - 1] = Some(Motion::Rest);
    let floor = Prescribed { name: "floor".into(), on: Selection::Face { axis: D - 1, upper: false }, motion };
    let acceleration = Vector::from_fn(|i, _| if i == D - 1 { -0.05 } else { 0.0 });
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [cells + 4; D] };
    let bodies = vec![Body {
        name: "block".into(),
        law: law.unwrap_or_else(|| NeoHookean::ciarlet(lame).into()),
        density: 1.0,
        dilatation: Default::default(),
        field: 0,
    }];
    Ok(Simulation {
        loads: Loads {
            gravity: Some(Gravity { acceleration, curve: Curve::constant(1.0) }),
            prescribed: vec![floor],
            ..Loads::default()
        },
        settings: Settings {
            lumping,
            newton: NewtonSettings {
                relative_tolerance: 1e-8,
                forcing: Forcing::EisenstatWalker,
                krylov: Krylov::Gmres { restart: 20 },
                ..NewtonSettings::default()
            },
            ..Settings::default()
        },
        ..Simulation::new(
            grid,
            approximation,
            bodies,
            particles,
            Clock::new(1.0 / (lame.lambda + 2.0 * lame.shear).sqrt(), 0),
        )
    })
}
