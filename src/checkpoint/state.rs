//! The state at tₙ: everything that a step takes from the previous step, and nothing else.

use super::container::Arrays;
use crate::clock::Reached;
use crate::mechanics::loads::{Added, Contacts, Loads, Obstacle, PointInContact, Reaction, RigidBody, SurfacePoint};
use crate::mechanics::path::Path;
use crate::mechanics::reference::LastEquilibrium;
use crate::mechanics::transfer::Nodal;
use crate::particles::{Configuration, Particles};
use crate::pooled::{Element, Pool, Pooled};
use crate::simulation::{History, Simulation};
use crate::tensor::Vector;
use bytemuck::Pod;
use crc32fast::hash;
use std::borrow::Cow;

/// The name of an array and its numbers.
type NamedArray<'a> = (&'static str, Cow<'a, [f64]>);

/// Prefixes of arrays that may be absent or vary in length.
const VARYING: [&str; 7] =
    ["reference_", "grid_", "bonded", "equilibrium", "slips", "added_points", "points_in_contact"];

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
        history,
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
        variable_count: _,
        dilatation,
        reference,
        outlines: _,
        parts: _,
    } = particles;
    let mut arrays = of_history(history, loads.prescribed.len());
    arrays.extend([
        ("id", id.iter().map(|&id| f64::from(id)).collect()),
        ("position", numbers(position)),
        ("velocity", numbers(velocity)),
        ("acceleration", numbers(acceleration)),
        ("displacement_gradient", numbers(displacement_gradient)),
        ("memory", numbers(memory)),
        ("dilatation", numbers(dilatation)),
        ("external_work", std::slice::from_ref(external_work).into()),
        ("dissipated", std::slice::from_ref(dissipated).into()),
        ("path", vec![*load, *increment, *speed, *weight].into()),
        ("contacts", contact_state(&loads.contacts).into()),
    ]);
    if loads.contacts.exist() {
        arrays.extend([
            ("slips", slips(&loads.contacts).into()),
            ("added_points", loads.contacts.added.iter().flat_map(row).collect()),
            ("points_in_contact", loads.contacts.touching.iter().flat_map(touching_row).collect()),
        ]);
    }
    if let Some(Configuration { position, displacement_gradient, dilatation }) = reference {
        arrays.extend([
            ("reference_position", numbers(position)),
            ("reference_displacement_gradient", numbers(displacement_gradient)),
            ("reference_dilatation", numbers(dilatation)),
        ]);
    }
    arrays
}

/// The arrays of the history, in a scene with `conditions` prescribed conditions.
fn of_history<const D: usize>(history: &History<D>, conditions: usize) -> Vec<NamedArray<'_>> {
    let History { grid, rate, constrained, bonded, equilibrium } = history;
    // Whether each prescribed condition has held bodies since the first step.
    let constrained = (0..conditions).map(|one| f64::from(u8::from(constrained.contains(&one))));
    let mut arrays: Vec<NamedArray<'_>> = vec![
        ("constrained", constrained.collect()),
        ("bonded", bonded.iter().flatten().map(|&body| f64::from(body)).collect()),
    ];
    if let Some(Nodal { mass: _, iterations: _, motion, velocity, acceleration, out_of_balance }) = grid {
        arrays.extend([
            ("grid_motion", numbers(motion)),
            ("grid_rate", numbers(rate)),
            ("grid_velocity", numbers(velocity)),
            ("grid_acceleration", numbers(acceleration)),
            ("grid_out_of_balance", numbers(out_of_balance)),
        ]);
    }
    // The loads of the last equilibrium are those of the scene.
    if let Some(LastEquilibrium { loads: _, reactions, touching, field_positions }) = equilibrium {
        let forces = reactions.iter().flat_map(|one| one.force.iter().copied().chain([one.torque]));
        arrays.extend([
            ("equilibrium", std::iter::once(f64::from(u8::from(*touching))).chain(forces).collect()),
            ("equilibrium_field_positions", numbers(field_positions)),
        ]);
    }
    arrays
}

/// Work, friction loss, anchors and free motion of every obstacle; stored energy and friction losses between bodies.
fn contact_state<const D: usize>(contacts: &Contacts<D>) -> Vec<f64> {
    let of = |one: &Obstacle<D>| {
        let losses = [one.work, one.friction_loss].into_iter().chain(one.anchors.iter().flatten().copied());
        losses.chain(one.free.iter().flat_map(RigidBody::state)).collect::<Vec<_>>()
    };
    let mut all: Vec<f64> = contacts.obstacles.iter().flat_map(of).collect();
    if let Some(between) = &contacts.between {
        all.push(between.energy);
        all.extend(between.pairs.iter().map(|pair| pair.friction_loss));
    }
    all
}

/// A point that was added to a surface: the halved piece and its edge, or the particle, its area and normal.
fn row<const D: usize>(added: &Added<D>) -> Vec<f64> {
    let (key, axis, area, normal) = match *added {
        Added::Half { number, axis } => (number as f64, axis as f64, 0.0, Vector::zeros()),
        Added::Bare { id, normal, area } => (f64::from(id), 0.0, area, normal),
    };
    [key, axis, area].into_iter().chain(normal.iter().copied()).collect()
}

/// A point in contact: its number, pressure, gap and traction.
fn touching_row<const D: usize>(point: &PointInContact<D>) -> Vec<f64> {
    let PointInContact { number, pressure, gap, traction } = point;
    [*number as f64, *pressure, *gap].into_iter().chain(traction.iter().copied()).collect()
}

/// The elastic slips between bodies: point, pair and slip, one after the other.
fn slips<const D: usize>(contacts: &Contacts<D>) -> Vec<f64> {
    let slips = contacts.between.iter().flat_map(|between| &between.slips);
    slips.flat_map(|(key, slip)| key.map(|number| number as f64).into_iter().chain(slip.iter().copied())).collect()
}

/// Sets what [`contact_state`], [`slips`] and [`touching_row`] return. The length of `contacts` fits.
fn set_contact_state<const D: usize>(contacts: &mut Contacts<D>, arrays: &Arrays) {
    let points = contacts.points.len();
    let touching = values::<f64>(arrays, "points_in_contact");
    let touching = touching.chunks_exact(3 + D).filter(|row| (row[0] as usize) < points);
    contacts.touching = touching
        .map(|row| PointInContact {
            number: row[0] as usize,
            pressure: row[1],
            gap: row[2],
            traction: Vector::from_column_slice(&row[3..]),
        })
        .collect();
    let (mut numbers, slips) = (arrays["contacts"].as_slice(), values::<f64>(arrays, "slips"));
    for one in &mut contacts.obstacles {
        let [work, friction_loss, rest @ ..] = numbers else { return };
        (one.work, one.friction_loss) = (*work, *friction_loss);
        let anchors: &mut [f64] = bytemuck::cast_slice_mut(&mut one.anchors);
        let (own, others) = rest.split_at(anchors.len().min(rest.len()));
        anchors.copy_from_slice(own);
        numbers = one.free.as_mut().map_or(others, |body| body.set_state(others));
    }
    if let (Some(between), [energy, rest @ ..]) = (&mut contacts.between, numbers) {
        between.energy = *energy;
        between.pairs.iter_mut().zip(rest).for_each(|(pair, loss)| pair.friction_loss = *loss);
        let slip = |one: &[f64]| ([one[0] as usize, one[1] as usize], Vector::from_column_slice(&one[2..]));
        between.slips = slips.chunks_exact(2 + D).map(slip).collect();
    }
}

fn numbers<T: Pod>(values: &[T]) -> Cow<'_, [f64]> {
    bytemuck::cast_slice(values).into()
}

/// The values of an array; none if there is no such array.
fn values<T: Pod>(arrays: &Arrays, name: &str) -> Vec<T> {
    let numbers = arrays.get(name).map_or(&[][..], Vec::as_slice);
    bytemuck::try_cast_slice(numbers).map(<[T]>::to_vec).unwrap_or_default()
}

/// The reference configuration, if there is one.
///
/// # Errors
/// An array does not fit the number of particles.
fn reference<const D: usize>(arrays: &Arrays, particles: usize) -> Result<Option<Configuration<D>>, String> {
    let reference = Configuration::<D> {
        position: values(arrays, "reference_position"),
        displacement_gradient: values(arrays, "reference_displacement_gradient"),
        dilatation: values(arrays, "reference_dilatation"),
    };
    let Configuration { position, displacement_gradient, dilatation } = &reference;
    if displacement_gradient.is_empty() {
        return Ok(None);
    }
    let fits =
        [position.len(), displacement_gradient.len()] == [particles; 2] && [0, particles].contains(&dilatation.len());
    if fits { Ok(Some(reference)) } else { Err("a reference configuration of other particles".into()) }
}

/// A nodal state, and Δφ/Δt.
type Nodes<const D: usize> = (Nodal<D>, Pooled<Vector<f64, D>>);

/// The state of the nodes of a grid that is not reset, if there is one, and Δφ/Δt. The number of nodes cannot be checked here, because only
/// a step knows it.
///
/// # Errors
/// The nodal fields differ in length. Velocities and accelerations are absent with inertia, or there without it.
fn grid<const D: usize>(arrays: &Arrays, has_inertia: bool) -> Result<Option<Nodes<D>>, String> {
    fn field<T: Element>(arrays: &Arrays, name: &str) -> Pooled<T> {
        Pool::default().collect(values(arrays, name))
    }
    let nodal = Nodal::<D> {
        motion: field(arrays, "grid_motion"),
        velocity: field(arrays, "grid_velocity"),
        acceleration: field(arrays, "grid_acceleration"),
        out_of_balance: field(arrays, "grid_out_of_balance"),
        ..Nodal::default()
    };
    let rate: Pooled<Vector<f64, D>> = field(arrays, "grid_rate");
    let nodes = nodal.motion.len();
    if nodes == 0 {
        return Ok(None);
    }
    let moving = if has_inertia { nodes } else { 0 };
    let lengths = [rate.len(), nodal.velocity.len(), nodal.acceleration.len()];
    if lengths == [nodes, moving, moving] && [0, nodes].contains(&nodal.out_of_balance.len()) {
        Ok(Some((nodal, rate)))
    } else {
        Err("nodal fields of different lengths".into())
    }
}

/// The last converged load step under the loads of the scene, if the checkpoint has it.
///
/// # Errors
/// An array does not fit the number of particles or of prescribed conditions.
fn equilibrium<const D: usize>(
    arrays: &Arrays,
    (particles, fields): (usize, usize),
    loads: &Loads<D>,
) -> Result<Option<LastEquilibrium<D>>, String> {
    let numbers: Vec<f64> = values(arrays, "equilibrium");
    let Some((touching, forces)) = numbers.split_first() else { return Ok(None) };
    let positions: Vec<Vector<f64, D>> = values(arrays, "equilibrium_field_positions");
    // Points that were added to surfaces after the step have no position there.
    let positions_fit =
        if loads.field.is_some() { (1..=particles).contains(&positions.len()) } else { positions.is_empty() };
    if forces.len() != loads.prescribed.len() * fields * (D + 1) || !positions_fit {
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
    arrays: &Arrays,
) -> Result<(), String> {
    let (count, contacts) = (simulation.particles.len(), simulation.loads.contacts.clone());
    let restored = refine(simulation, arrays).and_then(|()| restore_refined(simulation, reached, arrays));
    if restored.is_err() {
        simulation.particles.truncate(count);
        simulation.loads.contacts = contacts;
    }
    restored
}

/// Adds the points that were added to surfaces since the start.
///
/// # Errors
/// A piece of surface or a particle that does not exist.
fn refine<const D: usize, L, A>(simulation: &mut Simulation<D, L, A>, arrays: &Arrays) -> Result<(), String> {
    let Simulation { particles, loads, .. } = simulation;
    mutant!("checkpoint: surfaces are those of the start": { return Ok(()); });
    for row in values::<f64>(arrays, "added_points").chunks_exact(3 + D) {
        let (key, area, normal) = (row[0] as usize, row[2], Vector::from_column_slice(&row[3..]));
        if area > 0.0 {
            let particle = particles.place(key).ok_or("a point of a surface that is no particle")?;
            loads.contacts.cover(key as u32, SurfacePoint::new(particle, normal, area));
        } else {
            let point = loads.contacts.points.get(key).filter(|_| row[1] < 2.0);
            let new = particles.push_copy(point.ok_or("a piece of surface that is not in the scene")?.particle);
            loads.contacts.halve(key, row[1] as usize, new);
        }
        for obstacle in loads.contacts.obstacles.iter_mut().filter(|obstacle| !obstacle.anchors.is_empty()) {
            obstacle.anchors.push(Vector::zeros());
        }
    }
    Ok(())
}

/// Sets a simulation whose surfaces are refined.
fn restore_refined<const D: usize, L, A>(
    simulation: &mut Simulation<D, L, A>,
    reached: Reached,
    arrays: &Arrays,
) -> Result<(), String> {
    let varies = |name: &str| VARYING.iter().any(|start| name.starts_with(start));
    for (name, values) in inherited(simulation).into_iter().filter(|(name, _)| !varies(name)) {
        let found = arrays.get(name).ok_or_else(|| format!("no array {name}"))?;
        if found.len() != values.len() {
            return Err(format!("{} numbers of {name} instead of {}", found.len(), values.len()));
        }
    }
    let order = order(&simulation.particles.id, &arrays["id"]).ok_or("ids that are not those of the particles")?;
    let count = simulation.particles.len();
    let has_inertia = simulation.settings.scheme.has_inertia();
    let (reference, grid) = (reference(arrays, count)?, grid(arrays, has_inertia)?);
    if reference.is_some() != grid.is_some() {
        return Err("a reference configuration without nodal fields, or the reverse".into());
    }
    let clock = simulation.clock.at(reached).ok_or("a time that the clock cannot show")?;
    let mut loads = simulation.loads.clone();
    set_contact_state(&mut loads.contacts, arrays);
    mutant!("checkpoint: the anchors of friction are forgotten": loads = simulation.loads.clone());
    let fields = simulation.bodies.iter().map(|body| body.field as usize + 1).max().unwrap_or(1);
    let equilibrium = equilibrium(arrays, (count, fields), &loads)?;
    (simulation.clock, simulation.loads) = (clock, loads);
    simulation.forget();
    simulation.history.equilibrium = equilibrium;
    // Particle data without an array is rearranged, too.
    simulation.rearrange(&order);
    simulation.particles.reference = reference;
    if let Some((nodal, rate)) = grid {
        (simulation.history.grid, simulation.history.rate) = (Some(nodal), rate);
    }
    mutant!("checkpoint: a restart resets the grid": { (simulation.history.grid, simulation.particles.reference) = (None, None); simulation.history.rate = Pooled::default(); });
    let pairs = values::<[f64; 2]>(arrays, "bonded");
    mutant!("checkpoint: bonded bodies are forgotten": pairs = Vec::<[f64; 2]>::new());
    simulation.history.bonded = pairs.iter().map(|pair| pair.map(|body| body as u32)).collect();
    let constrained = arrays["constrained"].iter().enumerate();
    simulation.history.constrained = constrained.filter(|(_, flag)| **flag > 0.0).map(|(one, _)| one).collect();
    let Simulation { particles, external_work, dissipated, path, .. } = simulation;
    let fields: [(&str, &mut [f64]); 8] = [
        ("position", bytemuck::cast_slice_mut(&mut particles.position)),
        ("velocity", bytemuck::cast_slice_mut(&mut particles.velocity)),
        ("acceleration", bytemuck::cast_slice_mut(&mut particles.acceleration)),
        ("displacement_gradient", bytemuck::cast_slice_mut(&mut particles.displacement_gradient)),
        ("memory", &mut particles.memory),
        ("dilatation", &mut particles.dilatation),
        ("external_work", std::slice::from_mut(external_work)),
        ("dissipated", std::slice::from_mut(dissipated)),
    ];
    for (name, field) in fields {
        mutant!("checkpoint: accelerations are not restored": { if name == "acceleration" { continue; } });
        field.copy_from_slice(&arrays[name]);
    }
    mutant!("checkpoint: the length of the step along a path is forgotten": { return Ok(()); });
    if let [load, increment, speed, weight] = arrays["path"][..] {
        *path = Path { load, increment, speed, weight };
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
