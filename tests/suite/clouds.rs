//! Contact of bodies whose particles come from a file: they touch as bodies with shapes do.

use crate::support::{Failure, advance, merged, run_to, solid, with};
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// The particles of a body, as a file.
fn file<const D: usize>(Simulation { particles, .. }: &Simulation<D>, body: u32) -> Result<String, Failure> {
    let mut text = format!("{},volume\n", ["x", "y", "z"][..D].join(","));
    for p in (0..particles.len()).filter(|&p| particles.body[p] == body && particles.is_solid(p)) {
        particles.position[p].iter().try_for_each(|x| write!(text, "{x},"))?;
        writeln!(text, "{}", particles.volume[p])?;
    }
    Ok(text)
}

/// Two simulations of a scene: as it is, and with all its bodies from files of their particles.
fn both<const D: usize>(scene: &Value) -> Result<[Simulation<D>; 2], Failure> {
    let folder = tempfile::tempdir()?;
    let drawn: Simulation<D> = build(scene, folder.path())?;
    let mut read = scene.clone();
    for (number, body) in read["bodies"].as_array_mut().into_iter().flatten().enumerate() {
        let name = format!("{number}.csv");
        std::fs::write(folder.path().join(&name), file(&drawn, number as u32)?)?;
        body["shape"] = Value::Null;
        body["particles"] = json!({ "file": name });
    }
    let read = build(&read, folder.path())?;
    Ok([drawn, read])
}

fn build<const D: usize>(scene: &Value, folder: &Path) -> Result<Simulation<D>, Failure> {
    Ok(scene::read(&scene.to_string(), &[])?.build(folder)?)
}

/// The message that refuses the scene with these files, by their names.
fn refused(scene: &Value, files: &Value) -> Result<String, Failure> {
    let folder = tempfile::tempdir()?;
    for (name, text) in files.as_object().into_iter().flatten() {
        std::fs::write(folder.path().join(name), text.as_str().unwrap_or_default())?;
    }
    Ok(build::<2>(scene, folder.path()).map(drop).unwrap_err().to_string())
}

/// A disc that is thrown onto a floor with friction.
fn thrown() -> Value {
    let disc = solid("disc", 1000, json!({ "ball": { "center": [0.7, 0.6], "radius": 0.5 } }));
    json!({
        "grid": { "size": [3, 1.5], "spacing": 0.1 },
        "time": { "step": 0.005, "end": 1 },
        "bodies": [merged(disc, json!({ "velocity": [2, -1] }))],
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0.05], "normal": [0, 1] } }, "friction": 0.2 }]
    })
}

#[test]
fn a_disc_from_a_file_bounces_and_spins_as_its_shape_does() -> Result<(), Failure> {
    let mut simulations: [Simulation<2>; 2] = both(&thrown())?;
    let mut ends = Vec::new();
    for simulation in &mut simulations {
        let mut first = None;
        while simulation.clock.time() < 0.4 {
            let step = simulation.advance()?;
            if step.touches() {
                first.get_or_insert(simulation.clock.time());
            }
        }
        let particles = &simulation.particles;
        let mass: f64 = particles.mass.iter().sum();
        let velocity = particles.momentum() / mass;
        let middle =
            (0..particles.len()).map(|p| particles.position[p] * particles.mass[p]).sum::<Vector<f64, 2>>() / mass;
        let spin = (0..particles.len())
            .map(|p| particles.mass[p] * (particles.position[p] - middle).perp(&particles.velocity[p]))
            .sum::<f64>()
            / (0.5 * mass * 0.25);
        ends.push((first.ok_or("no contact")?, velocity, spin));
    }
    let [(first, velocity, spin), (first_file, velocity_file, spin_file)] = ends[..] else {
        return Err("two runs".into());
    };
    assert!((first - first_file).abs() < 0.006, "{first} {first_file}");
    assert!((velocity - velocity_file).norm() < 0.005 * velocity.norm(), "{velocity} {velocity_file}");
    assert!((spin - spin_file).abs() < 0.05 * spin.abs(), "{spin} {spin_file}");
    Ok(())
}

#[test]
fn blocks_from_files_are_pressed_as_their_shapes_are() -> Result<(), Failure> {
    // Regular layout is a lattice; its sums are no Gauss quadrature, so that the stress is not uniform in either run.
    let block = |name, min: f64, max: f64| {
        let body = solid(name, 1000, json!({ "box": { "min": [0, min], "max": [2, max] } }));
        merged(body, json!({ "layout": "regular" }))
    };
    let scene = json!({
        "grid": { "size": [2, 2], "spacing": 0.25 },
        "time": { "scheme": "none", "step": 0.5, "end": 1 },
        "bodies": [block("lower", 0.0, 1.0), block("upper", 1.0, 2.0)],
        "boundary": { "left": "sliding", "right": "sliding", "bottom": "sliding",
                      "top": { "displacement": [[0, [null, 0]], [1, [null, -0.02]]] } },
        "contact": {}
    });
    let (mut means, mut spreads) = (Vec::new(), Vec::new());
    for simulation in &mut both::<2>(&scene)? {
        advance(simulation, 2)?;
        let particles = &simulation.particles;
        let solid = || (0..particles.len()).filter(|&p| particles.is_solid(p));
        let strain: Vec<f64> = solid().map(|p| particles.displacement_gradient[p][(1, 1)]).collect();
        let mean = strain.iter().sum::<f64>() / strain.len() as f64;
        means.push(mean);
        spreads.push(strain.iter().map(|one| (one - mean).abs()).fold(0.0, f64::max));
    }
    // Areas of 0.8 to 1.1 of the exact ones change the penalty, and hardly the stress.
    assert!((means[0] / means[1] - 1.0).abs() < 0.02, "{means:?}");
    assert!((spreads[0] / spreads[1] - 1.0).abs() < 0.05, "{spreads:?}");
    Ok(())
}

#[test]
fn discs_from_files_meet_and_part_with_momentum() -> Result<(), Failure> {
    let disc = |name: &str, x: f64, speed: f64| {
        let shape = json!({ "ball": { "center": [x, 1.5], "radius": 1 } });
        merged(solid(name, 1000, shape), json!({ "velocity": [speed, 0], "layout": "regular" }))
    };
    let scene = json!({
        "grid": { "size": [6, 3], "spacing": 0.25 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [disc("one", 1.9, 1.0), disc("two", 4.1, -1.0)],
        "contact": {}
    });
    let mut rebounds = Vec::new();
    for simulation in &mut both::<2>(&scene)? {
        run_to(simulation, 0.6)?;
        let particles = &simulation.particles;
        let own = |body: u32| (0..particles.len()).filter(move |&p| particles.body[p] == body);
        let momentum = |body| own(body).map(|p| particles.velocity[p][0] * particles.mass[p]).sum::<f64>();
        let mass: f64 = own(0).map(|p| particles.mass[p]).sum();
        assert!(particles.momentum().norm() < 1e-12 * mass, "{}", particles.momentum());
        rebounds.push(momentum(0) / mass);
    }
    // A staircase of particles meets another one with more ringing than two circles do.
    assert!((rebounds[0] / rebounds[1] - 1.0).abs() < 0.06 && rebounds[1] < -0.9, "{rebounds:?}");
    Ok(())
}

#[test]
fn files_without_a_surface_or_in_each_other_are_refused() -> Result<(), Failure> {
    let rows = |from: f64, layers: usize| {
        let mut text = "x,y,volume\n".to_owned();
        for i in 0..10 * layers {
            let (x, y) = (0.5 + 0.1 * (i % 10) as f64, from + 0.1 * (i / 10) as f64);
            text += &format!("{x},{y},0.01\n");
        }
        text
    };
    let body = |name: &str| {
        json!({ "name": name, "particles": { "file": format!("{name}.csv") }, "density": 1,
        "material": { "neo_hookean": { "young": 1000, "poisson": 0.3 } } })
    };
    let scene = json!({
        "grid": { "size": [2, 2], "spacing": 0.2 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [body("one"), body("two")],
        "contact": {}
    });
    let said = |one: String, two: String| refused(&scene, &json!({ "one.csv": one, "two.csv": two }));
    let cases = [
        (rows(0.55, 3), rows(1.55, 1), ["bodies[1].particles: ", "single layer", "[0.5, 1.55]"]),
        (rows(0.55, 3), rows(0.65, 3), ["\"one\" starts in body \"two\"", "between its particles", "contact.groups"]),
        (
            rows(0.55, 3),
            rows(0.83, 3),
            ["\"one\" and \"two\" start in each other", "overlap by 0.100 grid", "half their edge"],
        ),
    ];
    for (one, two, words) in cases {
        let error = said(one, two)?;
        assert!(words.iter().all(|word| error.contains(word)), "{words:?}: {error}");
    }
    // A pin between the particles, and particles that are large beside the grid.
    let pin = json!([{ "name": "pin", "shape": { "ball": { "center": [1, 0.7], "radius": 0.02 } } }]);
    let alone = with(scene, &[("/bodies", json!([body("one")])), ("/contact", Value::Null), ("/obstacles", pin)]);
    let error = refused(&alone, &json!({ "one.csv": rows(0.55, 4) }))?;
    assert!(error.contains("\"pin\" starts inside body \"one\""), "{error}");
    let floor = json!([{ "name": "floor", "shape": { "half_space": { "point": [0, 0.3], "normal": [0, 1] } } }]);
    let coarse = with(alone, &[("/obstacles", floor), ("/grid/spacing", json!(0.05))]);
    let error = refused(&coarse, &json!({ "one.csv": rows(0.55, 4) }))?;
    assert!(error.contains("has an edge of 2.00 grid spacings") && error.contains("at most 1.5"), "{error}");
    Ok(())
}

#[test]
fn the_joint_of_a_file_and_a_shape_is_no_surface() -> Result<(), Failure> {
    let block = |name: &str, from: f64| {
        let body = solid(name, 1000, json!({ "box": { "min": [from, 1], "max": [from + 0.5, 1.5] } }));
        merged(body, json!({ "layout": "regular" }))
    };
    let scene = json!({
        "grid": { "size": [2, 2], "spacing": 0.1 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [block("left", 0.5), block("right", 1.0)],
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0.5], "normal": [0, 1] } } }]
    });
    let [_, files] = both::<2>(&scene)?;
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("left.csv"), file(&files, 0)?)?;
    let mixed =
        with(scene, &[("/bodies/0/shape", Value::Null), ("/bodies/0/particles", json!({ "file": "left.csv" }))]);
    let mixed: Simulation<2> = build(&mixed, folder.path())?;
    for simulation in [files, mixed] {
        let points = &simulation.loads.contacts.points;
        let joint = points.iter().filter(|point| {
            let x = simulation.particles.position[point.particle];
            (x[0] - 1.0).abs() < 0.06 && (1.1..1.4).contains(&x[1])
        });
        assert_eq!(joint.count(), 0);
    }
    Ok(())
}
