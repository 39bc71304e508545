//! The state at tₙ: everything that a step takes from the previous step, and nothing else.

use super::container::Array;
use crate::clock::Reached;
use crate::mechanics::kept::Kept;
use crate::mechanics::loads::Loads;
use crate::mechanics::path::Path;
use crate::particles::Particles;
use crate::simulation::{Borne, Reaction, Simulation};
use crate::tensor::{Tensor, Vector};
use crc32fast::hash;
use std::borrow::Cow;

/// The name of an array and its numbers.
type NamedArray<'a> = (&'static str, Cow<'a, [f64]>);

/// The arrays of the state at tₙ, by name. The patterns name every field: a new field does not compile until somebody decides whether it is
/// stored. A new array is added here and in [`restore`].
pub(super) fn inherited<const D: usize, L, A>(simulation: &Simulation<D, L, A>) -> Vec<NamedArray<'_>> {
    let Simulation {
        grid: _,
        approximation: _,
        bodies: _,
        particles,
        loads,
        settings: _,
        clock: _,
        external_work,
        dissipated,
        path: Path { load, increment, speed, weight },
        kept,
        held,
        joined,
        borne,
        workspace: _,
    } = simulation;
    let Particles {
        position,
        velocity,
        acceleration,
        displacement_gradient,
        volume: _,
        mass: _,
        body: _,
        id,
        memory,
        remembered: _,
        dilatation,
    } = particles;
    let id: Vec<f64> = id.iter().map(|&id| f64::from(id)).collect();
    let held: Vec<f64> = (0..loads.prescribed.len()).map(|one| u8::from(held.contains(&one)).into()).collect();
    let mut arrays: Vec<NamedArray<'_>> = vec![
        ("id", id.into()),
        ("held", held.into()),
        (JOINED, joined.iter().flatten().map(|&body| f64::from(body)).collect()),
        ("position", bytemuck::cast_slice(position).into()),
        ("velocity", bytemuck::cast_slice(velocity).into()),
        ("acceleration", bytemuck::cast_slice(acceleration).into()),
        ("displacement_gradient", bytemuck::cast_slice(displacement_gradient).into()),
        ("memory", memory.as_slice().into()),
        ("dilatation", dilatation.as_slice().into()),
        ("external_work", std::slice::from_ref(external_work).into()),
        ("dissipated", std::slice::from_ref(dissipated).into()),
        ("path", vec![*load, *increment, *speed, *weight].into()),
    ];
    arrays.extend(kept.iter().flat_map(kept_arrays));
    arrays.extend(borne.iter().flat_map(borne_arrays));
    arrays
}

/// The arrays of a grid that is kept.
fn kept_arrays<const D: usize>(kept: &Kept<D>) -> Vec<NamedArray<'_>> {
    let Kept { position, displacement_gradient, dilatation, motion, rate, velocity, acceleration, unbalanced } = kept;
    let vectors = [position, motion, rate, velocity, acceleration, unbalanced];
    let vectors = vectors.map(|field| bytemuck::cast_slice(field).into());
    let mut arrays: Vec<NamedArray<'_>> = KEPT.into_iter().zip(vectors).collect();
    arrays.push((KEPT_GRADIENT, bytemuck::cast_slice(displacement_gradient).into()));
    arrays.push((KEPT_DILATATION, dilatation.as_slice().into()));
    arrays
}

/// The arrays of the last converged load step. Its loads are those of the scene.
fn borne_arrays<const D: usize>(borne: &Borne<D>) -> [NamedArray<'_>; 2] {
    let Borne { loads: _, reactions, together, asked } = borne;
    let forces = reactions.iter().flat_map(|one| one.force.iter().copied().chain([one.torque]));
    [
        (BORNE, std::iter::once(f64::from(u8::from(*together))).chain(forces).collect()),
        (BORNE_ASKED, bytemuck::cast_slice(asked).into()),
    ]
}

/// `Simulation::joined`: pairs of bonded bodies.
const JOINED: &str = "joined";

/// The last converged load step: whether bodies moved nodes together (`Borne::together`), then the reactions.
const BORNE: &str = "borne";

/// Particle positions at which the last load step evaluated a field of forces.
const BORNE_ASKED: &str = "borne_asked";

/// Prefixes of arrays that may be absent or vary in length.
const VARYING: [&str; 3] = ["kept_", JOINED, BORNE];

/// Vectors of a grid that is not reset: x of the particles in the reference configuration, then φ, its rate, v, a and R₀ of the nodes.
const KEPT: [&str; 6] =
    ["kept_position", "kept_motion", "kept_rate", "kept_velocity", "kept_acceleration", "kept_unbalanced"];

/// H of the particles in the reference configuration.
const KEPT_GRADIENT: &str = "kept_displacement_gradient";

/// θ − 1 of the particles in the reference configuration.
const KEPT_DILATATION: &str = "kept_dilatation";

/// The kept grid, if there is one. Its number of nodes cannot be checked here, because only a step knows it.
///
/// # Errors
/// An array does not fit the number of particles, or nodal fields differ in length.
fn kept<const D: usize>(arrays: &[Array], particles: usize) -> Result<Option<Kept<D>>, String> {
    let of = |name: &str| arrays.iter().find(|array| array.name == name).map(|array| array.values.as_slice());
    let vectors = |name: &str| -> Vec<Vector<f64, D>> {
        of(name).unwrap_or_default().chunks_exact(D).map(Vector::from_column_slice).collect()
    };
    let Some(gradient) = of(KEPT_GRADIENT) else { return Ok(None) };
    let displacement_gradient: Vec<_> = gradient.chunks_exact(D * D).map(Tensor::from_column_slice).collect();
    let dilatation = of(KEPT_DILATATION).unwrap_or_default().to_vec();
    let [position, motion, rate, velocity, acceleration, unbalanced] = KEPT.map(vectors);
    let fits = [position.len(), displacement_gradient.len()] == [particles; 2]
        && (dilatation.is_empty() || dilatation.len() == particles)
        && rate.len() == motion.len()
        && [velocity.len(), acceleration.len(), unbalanced.len()]
            .into_iter()
            .all(|length| length == 0 || length == motion.len());
    let kept = Kept { position, displacement_gradient, dilatation, motion, rate, velocity, acceleration, unbalanced };
    if fits { Ok(Some(kept)) } else { Err("a grid that was kept, of other particles or nodes".into()) }
}

/// The last converged load step, without its loads.
///
/// # Errors
/// An array does not fit the number of particles or of prescribed conditions.
fn borne<const D: usize>(
    numbers: &[f64],
    asked: &[f64],
    particles: usize,
    conditions: usize,
) -> Result<Option<Borne<D>>, String> {
    let Some((together, reactions)) = numbers.split_first() else { return Ok(None) };
    if reactions.len() != conditions * (D + 1) || ![0, particles * D].contains(&asked.len()) {
        return Err("what the last step balanced, of other particles or conditions".into());
    }
    let reaction = |one: &[f64]| Reaction { force: Vector::from_column_slice(&one[..D]), torque: one[D] };
    Ok(Some(Borne {
        loads: Loads::default(),
        reactions: reactions.chunks_exact(D + 1).map(reaction).collect(),
        together: *together > 0.0,
        asked: asked.chunks_exact(D).map(Vector::from_column_slice).collect(),
    }))
}

/// The present places of the particles, in the order of `ids`. `None` if `ids` belong to other particles.
fn order(present: &[u32], ids: &[f64]) -> Option<Vec<u32>> {
    let mut places = vec![None; present.len()];
    for (place, &id) in present.iter().enumerate() {
        *places.get_mut(id as usize)? = Some(place as u32);
    }
    // `take` refuses a second particle with the same id.
    ids.iter().map(|&id| places.get_mut(id as usize)?.take()).collect()
}

/// Sets a simulation to the state of `arrays` and `reached`, all or nothing.
///
/// # Errors
/// An array is absent or has another length, the ids belong to other particles, or the clock cannot show the time.
pub(super) fn restore<const D: usize, L, A>(
    simulation: &mut Simulation<D, L, A>,
    reached: Reached,
    arrays: &[Array],
) -> Result<(), String> {
    let varies = |name: &str| VARYING.iter().any(|start| name.starts_with(start));
    for (name, values) in inherited(simulation).into_iter().filter(|(name, _)| !varies(name)) {
        let found = arrays.iter().find(|array| array.name == name).ok_or_else(|| format!("no array {name}"))?;
        if found.values.len() != values.len() {
            return Err(format!("{} numbers of {name} instead of {}", found.values.len(), values.len()));
        }
    }
    let ids =
        arrays.iter().filter(|array| array.name == "id").flat_map(|array| &array.values).copied().collect::<Vec<_>>();
    let order = order(&simulation.particles.id, &ids).ok_or("ids that are not those of the particles")?;
    let kept = kept(arrays, simulation.particles.len())?;
    let of = |name: &str| arrays.iter().find(|array| array.name == name).map_or(&[][..], |array| &array.values);
    let borne = borne(of(BORNE), of(BORNE_ASKED), simulation.particles.len(), simulation.loads.prescribed.len())?;
    simulation.clock = simulation.clock.at(reached).ok_or("a time that the clock cannot show")?;
    // Particle data without an array is rearranged, too.
    simulation.kept = None;
    simulation.rearrange(&order);
    simulation.kept = kept;
    simulation.borne = borne;
    // `borne` has the order of the checkpoint, which is now the order of the particles. Its loads come from the simulation, which has just
    // been rearranged.
    simulation.borne.iter_mut().for_each(|borne| borne.loads.clone_from(&simulation.loads));
    simulation.joined = of(JOINED).chunks_exact(2).map(|pair| [pair[0] as u32, pair[1] as u32]).collect();
    let held = arrays.iter().filter(|array| array.name == "held").flat_map(|array| &array.values);
    simulation.held = held.enumerate().filter(|(_, held)| **held > 0.0).map(|(one, _)| one).collect();
    let path = &mut simulation.path;
    let mut numbers = arrays.iter().filter(|array| array.name == "path").flat_map(|array| &array.values);
    for number in [&mut path.load, &mut path.increment, &mut path.speed, &mut path.weight] {
        numbers.next().iter().for_each(|&&value| *number = value);
    }
    let particles = &mut simulation.particles;
    for Array { name, values } in arrays {
        let into: &mut [f64] = match name.as_str() {
            "position" => bytemuck::cast_slice_mut(&mut particles.position),
            "velocity" => bytemuck::cast_slice_mut(&mut particles.velocity),
            "acceleration" => bytemuck::cast_slice_mut(&mut particles.acceleration),
            "displacement_gradient" => bytemuck::cast_slice_mut(&mut particles.displacement_gradient),
            "memory" => &mut particles.memory,
            "dilatation" => &mut particles.dilatation,
            "dissipated" => std::slice::from_mut(&mut simulation.dissipated),
            "external_work" => std::slice::from_mut(&mut simulation.external_work),
            _ => continue,
        };
        into.copy_from_slice(values);
    }
    Ok(())
}

/// Checksums of the particles at the start of a run. A file of particles may have changed since.
pub(super) fn fingerprint<const D: usize>(particles: &Particles<D>) -> Vec<(String, u32)> {
    let Particles { position, velocity, volume, mass, body, .. } = particles;
    [
        ("position", hash(bytemuck::cast_slice(position))),
        ("velocity", hash(bytemuck::cast_slice(velocity))),
        ("volume", hash(bytemuck::cast_slice(volume))),
        ("mass", hash(bytemuck::cast_slice(mass))),
        ("body", hash(bytemuck::cast_slice(body))),
    ]
    .map(|(name, sum)| (name.to_owned(), sum))
    .into()
}
