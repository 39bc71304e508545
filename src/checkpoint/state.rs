//! The state at tₙ: everything that a step takes from the previous step, and nothing else.

use super::container::Array;
use crate::clock::Reached;
use crate::mechanics::loads::{Loads, Reaction};
use crate::mechanics::path::Path;
use crate::mechanics::reference::{GridState, LastEquilibrium};
use crate::particles::{Configuration, Particles};
use crate::simulation::{History, Simulation};
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
        history: History { grid, constrained, bonded, equilibrium },
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
        reference,
    } = particles;
    let id: Vec<f64> = id.iter().map(|&id| f64::from(id)).collect();
    let conditions = 0..loads.prescribed.len();
    let constrained: Vec<f64> = conditions.map(|one| u8::from(constrained.contains(&one)).into()).collect();
    let mut arrays: Vec<NamedArray<'_>> = vec![
        ("id", id.into()),
        (CONSTRAINED, constrained.into()),
        (BONDED, bonded.iter().flatten().map(|&body| f64::from(body)).collect()),
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
    arrays.extend(reference.iter().flat_map(reference_arrays));
    arrays.extend(grid.iter().flat_map(grid_arrays));
    arrays.extend(equilibrium.iter().flat_map(equilibrium_arrays));
    arrays
}

/// The arrays of the reference configuration.
fn reference_arrays<const D: usize>(reference: &Configuration<D>) -> [NamedArray<'_>; 3] {
    let Configuration { position, displacement_gradient, dilatation } = reference;
    [
        (REFERENCE_POSITION, bytemuck::cast_slice(position).into()),
        (REFERENCE_GRADIENT, bytemuck::cast_slice(displacement_gradient).into()),
        (REFERENCE_DILATATION, dilatation.as_slice().into()),
    ]
}

/// The arrays of a grid that is not reset.
fn grid_arrays<const D: usize>(grid: &GridState<D>) -> impl Iterator<Item = NamedArray<'_>> {
    let GridState { motion, rate, velocity, acceleration, out_of_balance } = grid;
    let fields = [motion, rate, velocity, acceleration, out_of_balance];
    GRID.into_iter().zip(fields.map(|field| bytemuck::cast_slice(field).into()))
}

/// The arrays of the last converged load step. Its loads are those of the scene.
fn equilibrium_arrays<const D: usize>(equilibrium: &LastEquilibrium<D>) -> [NamedArray<'_>; 2] {
    let LastEquilibrium { loads: _, reactions, touching, field_positions } = equilibrium;
    let forces = reactions.iter().flat_map(|one| one.force.iter().copied().chain([one.torque]));
    [
        (EQUILIBRIUM, std::iter::once(f64::from(u8::from(*touching))).chain(forces).collect()),
        (FIELD_POSITIONS, bytemuck::cast_slice(field_positions).into()),
    ]
}

/// Whether each prescribed condition has held bodies since the first step.
const CONSTRAINED: &str = "constrained";

/// Pairs of bonded bodies.
const BONDED: &str = "bonded";

/// x, H and θ − 1 of the particles in the reference configuration, if the grid is not reset.
const REFERENCE_POSITION: &str = "reference_position";
const REFERENCE_GRADIENT: &str = "reference_displacement_gradient";
const REFERENCE_DILATATION: &str = "reference_dilatation";

/// The fields of [`GridState`].
const GRID: [&str; 5] = ["grid_motion", "grid_rate", "grid_velocity", "grid_acceleration", "grid_out_of_balance"];

/// The last load step: whether bodies touched, then the reactions.
const EQUILIBRIUM: &str = "equilibrium";

/// The positions at which the last load step evaluated a force field, by particle id.
const FIELD_POSITIONS: &str = "equilibrium_field_positions";

/// Prefixes of arrays that may be absent or vary in length.
const VARYING: [&str; 4] = ["reference_", "grid_", BONDED, EQUILIBRIUM];

/// The numbers of an array; none if there is no such array.
fn numbers<'a>(arrays: &'a [Array], name: &str) -> &'a [f64] {
    arrays.iter().find(|array| array.name == name).map_or(&[], |array| &array.values)
}

fn vectors<const D: usize>(numbers: &[f64]) -> Vec<Vector<f64, D>> {
    numbers.chunks_exact(D).map(Vector::from_column_slice).collect()
}

/// The reference configuration, if there is one.
///
/// # Errors
/// An array does not fit the number of particles.
fn reference<const D: usize>(arrays: &[Array], particles: usize) -> Result<Option<Configuration<D>>, String> {
    let gradient = numbers(arrays, REFERENCE_GRADIENT);
    if gradient.is_empty() {
        return Ok(None);
    }
    let displacement_gradient: Vec<_> = gradient.chunks_exact(D * D).map(Tensor::from_column_slice).collect();
    let position = vectors(numbers(arrays, REFERENCE_POSITION));
    let dilatation = numbers(arrays, REFERENCE_DILATATION).to_vec();
    let fits =
        [position.len(), displacement_gradient.len()] == [particles; 2] && [0, particles].contains(&dilatation.len());
    let reference = Configuration { position, displacement_gradient, dilatation };
    if fits { Ok(Some(reference)) } else { Err("a reference configuration of other particles".into()) }
}

/// The nodal state of a grid that is not reset, if there is one. Its number of nodes cannot be checked here, because only a step knows it.
///
/// # Errors
/// The nodal fields differ in length.
fn grid_state<const D: usize>(arrays: &[Array]) -> Result<Option<GridState<D>>, String> {
    let [motion, rate, velocity, acceleration, out_of_balance] = GRID.map(|name| vectors(numbers(arrays, name)));
    if motion.is_empty() {
        return Ok(None);
    }
    let optional = [&velocity, &acceleration, &out_of_balance];
    let fits = rate.len() == motion.len() && optional.iter().all(|field| [0, motion.len()].contains(&field.len()));
    let state = GridState { motion, rate, velocity, acceleration, out_of_balance };
    if fits { Ok(Some(state)) } else { Err("nodal fields of different lengths".into()) }
}

/// The last converged load step under the loads of the scene, if the checkpoint has it.
///
/// # Errors
/// An array does not fit the number of particles or of prescribed conditions.
fn equilibrium<const D: usize>(
    arrays: &[Array],
    particles: usize,
    loads: &Loads<D>,
) -> Result<Option<LastEquilibrium<D>>, String> {
    let Some((touching, forces)) = numbers(arrays, EQUILIBRIUM).split_first() else { return Ok(None) };
    let positions = vectors(numbers(arrays, FIELD_POSITIONS));
    let expected = if loads.field.is_some() { particles } else { 0 };
    if forces.len() != loads.prescribed.len() * (D + 1) || positions.len() != expected {
        return Err("the last equilibrium of other particles or conditions".into());
    }
    let reaction = |one: &[f64]| Reaction { force: Vector::from_column_slice(&one[..D]), torque: one[D] };
    let reactions = forces.chunks_exact(D + 1).map(reaction).collect();
    Ok(Some(LastEquilibrium::new(loads, reactions, *touching > 0.0, positions.into())))
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
    let count = simulation.particles.len();
    let (reference, grid) = (reference(arrays, count)?, grid_state(arrays)?);
    if reference.is_some() != grid.is_some() {
        return Err("a reference configuration without nodal fields, or the reverse".into());
    }
    // Particle data without an array is rearranged, too.
    let clock = simulation.clock.at(reached).ok_or("a time that the clock cannot show")?;
    let equilibrium = equilibrium(arrays, count, &simulation.loads)?;
    simulation.clock = clock;
    simulation.forget();
    simulation.history.equilibrium = equilibrium;
    simulation.rearrange(&order);
    simulation.particles.reference = reference;
    simulation.history.grid = grid;
    mutant!("checkpoint: a restart resets the grid": { (simulation.history.grid, simulation.particles.reference) = (None, None); });
    let pairs = numbers(arrays, BONDED).chunks_exact(2);
    mutant!("checkpoint: bonded bodies are forgotten": pairs = numbers(arrays, "").chunks_exact(2));
    simulation.history.bonded = pairs.map(|pair| [pair[0] as u32, pair[1] as u32]).collect();
    let constrained = numbers(arrays, CONSTRAINED).iter().enumerate();
    simulation.history.constrained = constrained.filter(|(_, flag)| **flag > 0.0).map(|(one, _)| one).collect();
    let path = &mut simulation.path;
    let stored = [&mut path.load, &mut path.increment, &mut path.speed, &mut path.weight];
    for (number, &value) in stored.into_iter().zip(numbers(arrays, "path")) {
        mutant!("checkpoint: the length of the step along a path is forgotten": { continue; });
        *number = value;
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
        mutant!("checkpoint: accelerations are not restored": { if name == "acceleration" { continue; } });
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
