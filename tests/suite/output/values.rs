//! The values of fields, against values by hand, and the particles that they belong to.

use super::{LAMBDA, SHEAR, falling, single};
use crate::support::Failure;
use bfree::field::Field;
use bfree::mechanics::loads::{Curve, Gravity};
use bfree::output::{OutputError, Reference, nearest};
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector};

fn at_particle<const D: usize>(simulation: &Simulation<D>, field: Field) -> Result<Vec<f64>, OutputError> {
    field.values(simulation, &Reference::of(simulation))
}

fn assert_close(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() <= 1e-14 * wanted.abs().max(1.0), "{found} instead of {wanted}");
    }
}

/// Particles are sorted in memory as they move. Fields are those of their ids.
#[test]
fn fields_follow_their_particles_through_sorting() -> Result<(), Failure> {
    let mut simulation = crate::support::scene::<2>("rebound.json", &["bodies.0.velocity=[2, 0.1]"])?;
    simulation.loads.gravity = Some(Gravity { acceleration: Vector::from([0.0, 0.3]), curve: Curve::constant(1.0) });
    simulation.set_velocity_on_nodes(|x| Vector::from([2.0 - 0.3 * (x[1] - 2.5), 0.1 + 0.3 * (x[0] - 2.5)]))?;
    let (reference, start, order) =
        (Reference::of(&simulation), simulation.particles.by_id(), simulation.particles.id.clone());
    crate::support::advance(&mut simulation, 30)?;
    let particles = &simulation.particles;
    let is_sorted_by_id = particles.id.iter().zip(0..).all(|(id, place)| *id == place);
    assert!(particles.id != order && !is_sorted_by_id, "nothing was sorted");
    for place in 0..particles.len() {
        let id = particles.id[place] as usize;
        let moved = particles.position[place] - start.position[id];
        let h = particles.displacement_gradient[place];
        let cases = [
            (Field::Position, particles.position[place].as_slice().to_vec()),
            (Field::Displacement, moved.as_slice().to_vec()),
            (Field::Velocity, particles.velocity[place].as_slice().to_vec()),
            (Field::Mass, vec![particles.mass[place]]),
            (Field::DeformationGradient, vec![1.0 + h[(0, 0)], h[(0, 1)]]),
        ];
        for (field, wanted) in cases {
            let values = field.values(&simulation, &reference)?;
            let width = values.len() / particles.len();
            assert_eq!(values[width * id..][..wanted.len()], wanted, "{field:?} of particle {id}");
        }
    }
    Ok(())
}

/// F = diag(λ, 1, 1): J = λ, σ_xx = (Λ/2 (λ² − 1) + G (λ² − 1)) / λ, and Λ/2 (λ² − 1) / λ across, in plane or not.
fn uniaxial<const D: usize>() -> Result<(), Failure> {
    let stretch: f64 = 1.3;
    let mut h = Tensor::<f64, D>::zeros();
    h[(0, 0)] = stretch - 1.0;
    let simulation = single(h)?;
    let across = LAMBDA / 2.0 * (stretch * stretch - 1.0) / stretch;
    let along = across + SHEAR * (stretch * stretch - 1.0) / stretch;
    assert_close(&at_particle(&simulation, Field::Stress)?, &[along, across, across, 0.0, 0.0, 0.0]);
    assert_close(&at_particle(&simulation, Field::PrincipalStress)?, &[along, across, across]);
    assert_close(&at_particle(&simulation, Field::Pressure)?, &[-(along + 2.0 * across) / 3.0]);
    assert_close(&at_particle(&simulation, Field::VonMises)?, &[along - across]);
    assert_close(&at_particle(&simulation, Field::Jacobian)?, &[stretch]);
    let strain = (stretch * stretch - 1.0) / 2.0;
    assert_close(&at_particle(&simulation, Field::Strain)?, &[strain, 0.0, 0.0, 0.0, 0.0, 0.0]);
    Ok(())
}

#[test]
fn stresses_in_uniaxial_strain_are_those_by_hand_in_every_dimension() -> Result<(), Failure> {
    uniaxial::<1>()?;
    uniaxial::<2>()?;
    uniaxial::<3>()
}

/// F = I + k e_x ⊗ e_y: J = 1 and σ = G (F Fᵀ − I), which tells the order of the components.
#[test]
fn stresses_in_simple_shear_are_those_by_hand() -> Result<(), Failure> {
    let k = 0.7;
    let mut h = Tensor::<f64, 3>::zeros();
    h[(0, 1)] = k;
    let simulation = single(h)?;
    assert_close(&at_particle(&simulation, Field::Stress)?, &[SHEAR * k * k, 0.0, 0.0, SHEAR * k, 0.0, 0.0]);
    // σ² − G k² σ − G² k² = 0 in the plane, and 0 across.
    let [mean, radius] = [0.5 * k * k, k * (1.0 + 0.25 * k * k).sqrt()].map(|x| SHEAR * x);
    assert_close(&at_particle(&simulation, Field::PrincipalStress)?, &[mean + radius, 0.0, mean - radius]);
    let gradient = [1.0, k, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    assert_close(&at_particle(&simulation, Field::DeformationGradient)?, &gradient);
    // E = ½ (FᵀF − I), not ½ (FFᵀ − I)
    assert_close(&at_particle(&simulation, Field::Strain)?, &[0.0, k * k / 2.0, 0.0, k / 2.0, 0.0, 0.0]);
    Ok(())
}

#[test]
fn particles_are_asked_for_by_id_wherever_they_lie() -> Result<(), Failure> {
    let start = falling()?;
    let (reference, mut moved) = (Reference::of(&start), start.clone());
    moved.rearrange(&(0..64).rev().collect::<Vec<_>>());
    for id in [0, 17, 63] {
        let mut position = Vec::new();
        Field::Position.append(&moved, &reference, id, &mut position)?;
        let x = start.particles.position[id];
        assert_eq!(position, [x[0], x[1], 0.0]);
        assert_eq!(nearest(&moved.particles, &x, None), Some((id, 0.0)));
    }
    let missing = Field::Position.append(&moved, &reference, 64, &mut Vec::new());
    assert!(matches!(missing, Err(OutputError::NoParticle { particle: 64, particles: 64 })), "{missing:?}");
    let other = Reference::of(&single::<2>(Tensor::zeros())?);
    let other = Field::Displacement.append(&moved, &other, 3, &mut Vec::new());
    assert!(matches!(other, Err(OutputError::Reference { reference: 1, particles: 64 })), "{other:?}");
    Ok(())
}

#[test]
fn the_nearest_particle_is_looked_for_in_its_body() -> Result<(), Failure> {
    let mut particles = falling()?.particles;
    particles.body[0] = 1;
    let far = Vector::from([1.0, 1.0]);
    let distance = |p: usize| (particles.position[p] - far).norm();
    assert_eq!(nearest(&particles, &far, None), Some((63, distance(63))));
    assert_eq!(nearest(&particles, &far, Some(1)), Some((0, distance(0))));
    assert_eq!(nearest(&particles, &far, Some(2)), None);
    Ok(())
}
