//! What a step inherits from the one before: all of it, and nothing else.

use super::container::Array;
use crate::clock::Reached;
use crate::particles::Particles;
use crate::simulation::Simulation;
use crc32fast::hash;
use std::borrow::Cow;

/// The arrays a step inherits, by name. A field of the simulation that is added later does not compile here until somebody has
/// decided on which side it belongs; a new array has its place in [`inherited`] and in [`restore`].
pub(super) fn inherited<const D: usize, L, A>(simulation: &Simulation<D, L, A>) -> [(&'static str, Cow<'_, [f64]>); 8] {
    let Simulation {
        grid: _,
        approximation: _,
        bodies: _,
        particles,
        loads: _,
        settings: _,
        clock: _,
        external_work,
        dissipated,
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
    } = particles;
    let id: Vec<f64> = id.iter().map(|&id| f64::from(id)).collect();
    [
        ("id", id.into()),
        ("position", bytemuck::cast_slice(position).into()),
        ("velocity", bytemuck::cast_slice(velocity).into()),
        ("acceleration", bytemuck::cast_slice(acceleration).into()),
        ("displacement_gradient", bytemuck::cast_slice(displacement_gradient).into()),
        ("memory", memory.as_slice().into()),
        ("external_work", std::slice::from_ref(external_work).into()),
        ("dissipated", std::slice::from_ref(dissipated).into()),
    ]
}

/// The order in which particles lie in `ids`, by their present places; `None` if they are not the same particles.
fn order(present: &[u32], ids: &[f64]) -> Option<Vec<u32>> {
    let mut places = vec![None; present.len()];
    for (place, &id) in present.iter().enumerate() {
        *places.get_mut(id as usize)? = Some(place as u32);
    }
    // Each one once.
    ids.iter().map(|&id| places.get_mut(id as usize)?.take()).collect()
}

/// Puts a simulation into the state of `arrays` and `reached`, all or nothing.
///
/// # Errors
/// The array that is absent or of another length, or the clock.
pub(super) fn restore<const D: usize, L, A>(
    simulation: &mut Simulation<D, L, A>,
    reached: Reached,
    arrays: &[Array],
) -> Result<(), String> {
    for (name, values) in inherited(simulation) {
        let found = arrays.iter().find(|array| array.name == name).ok_or_else(|| format!("no array {name}"))?;
        if found.values.len() != values.len() {
            return Err(format!("{} numbers of {name} instead of {}", found.values.len(), values.len()));
        }
    }
    let ids =
        arrays.iter().filter(|array| array.name == "id").flat_map(|array| &array.values).copied().collect::<Vec<_>>();
    let order = order(&simulation.particles.id, &ids).ok_or("ids that are not those of the particles")?;
    simulation.clock = simulation.clock.at(reached).ok_or("a time that the clock cannot show")?;
    // What no array holds goes where it was, too.
    simulation.rearrange(&order);
    let particles = &mut simulation.particles;
    for Array { name, values } in arrays {
        let into: &mut [f64] = match name.as_str() {
            "position" => bytemuck::cast_slice_mut(&mut particles.position),
            "velocity" => bytemuck::cast_slice_mut(&mut particles.velocity),
            "acceleration" => bytemuck::cast_slice_mut(&mut particles.acceleration),
            "displacement_gradient" => bytemuck::cast_slice_mut(&mut particles.displacement_gradient),
            "memory" => &mut particles.memory,
            "dissipated" => std::slice::from_mut(&mut simulation.dissipated),
            "external_work" => std::slice::from_mut(&mut simulation.external_work),
            _ => continue,
        };
        into.copy_from_slice(values);
    }
    Ok(())
}

/// Checksums of the particles at the start of a run: they may come from files that have changed since.
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
