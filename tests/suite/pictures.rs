//! Pictures of particles, pixel by pixel: bodies end at their surface, and obstacles in space hide what lies behind them.

use crate::support::{Failure, built, merged, output, solid};
use bfree::field::Field;
use bfree::output::plot::{Look, plot_run};
use bfree::output::{Outcome, OutputSettings, Recorder, Reference};
use bfree::shape::{Ball, Block, Shape, Similar, rotation};
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, identity};
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A picture and the place of its drawing.
struct Picture {
    size: [usize; 2],
    /// Red, green, blue and opacity.
    pixels: Vec<[u8; 4]>,
    /// The pixel of the grid's origin, and pixels per unit of length.
    corner: [f64; 2],
    scale: f64,
}

impl Picture {
    /// The particles of a run with a grid of this spacing, whose origin lies in the drawing.
    fn read(folder: &Path, spacing: f64) -> Result<Self, Failure> {
        let svg = std::fs::read_to_string(folder.join("particles.svg"))?;
        // The lines of the grid come first: the vertical ones from the left, then the horizontal ones from below.
        let mut lines: Vec<[f64; 4]> = Vec::new();
        for line in svg.split("<polyline points=\"").skip(1) {
            let text = line.split('"').next().unwrap_or_default();
            let numbers = text.split([' ', ',']).filter(|number| !number.is_empty()).map(str::parse);
            lines.extend(<[f64; 4]>::try_from(numbers.collect::<Result<Vec<f64>, _>>()?).ok());
        }
        let [first, second, ..] = lines[..] else { return Err("no grid".into()) };
        let below = lines.iter().find(|line| line[1] == line[3]).ok_or("no horizontal line")?;
        let mut reader = png::Decoder::new(BufReader::new(File::open(folder.join("particles.png"))?)).read_info()?;
        let mut bytes = vec![0; reader.output_buffer_size().ok_or("too large")?];
        let info = reader.next_frame(&mut bytes)?;
        assert_eq!(info.color_type, png::ColorType::Rgba);
        // A PNG has two pixels per unit of the SVG.
        Ok(Self {
            size: [info.width as usize, info.height as usize],
            pixels: bytes.as_chunks().0.to_vec(),
            corner: [2.0 * first[0], 2.0 * below[1]],
            scale: 2.0 * (second[0] - first[0]) / spacing,
        })
    }

    /// The position of the middle of a pixel.
    fn position(&self, column: usize, row: usize) -> Vector<f64, 2> {
        let [left, below] = self.corner;
        Vector::from([(column as f64 + 0.5 - left) / self.scale, (below - row as f64 - 0.5) / self.scale])
    }

    /// The share of coloured pixels, and the share of grey ones, in a square about a position.
    fn shares(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, below] = self.corner;
        let (column, row) = ((left + x * self.scale) as usize, (below - y * self.scale) as usize);
        let square = (row - 20..row + 20).flat_map(|row| (column - 20..column + 20).map(move |column| (column, row)));
        let pixels: Vec<[u8; 4]> = square.map(|(column, row)| self.pixels[column + self.size[0] * row]).collect();
        let share = |is: fn(&&[u8; 4]) -> bool| pixels.iter().filter(is).count() as f64 / pixels.len() as f64;
        [share(|pixel| is_coloured(**pixel)), share(|pixel| !is_coloured(**pixel) && pixel[0] < 245)]
    }
}

/// Whether a pixel shows a value. Lines, texts and obstacles are grey.
fn is_coloured(pixel: [u8; 4]) -> bool {
    let [red, green, blue, _] = pixel;
    red.max(green).max(blue) - red.min(green).min(blue) > 60
}

/// Draws the state of a simulation that began with `reference`.
fn drawn<const D: usize>(
    simulation: &Simulation<D>,
    reference: Reference<D>,
    view: Option<&str>,
    folder: &Path,
) -> Result<(), Failure> {
    let fields = vec![Field::VonMises];
    let settings = OutputSettings { snapshot_every: Some(1.0), fields, ..output(folder) };
    let recorder = Recorder::start(settings, simulation, reference)?;
    recorder.finish(simulation, &Map::new(), Outcome::Finished)?;
    let view = view.map(str::parse).transpose()?;
    plot_run(folder, &Look { view, ..Look::default() })?;
    Ok(())
}

/// A disc and an inclined block in a grid of 4 × 2.
fn disc_and_block(more: Value) -> Value {
    let block = json!({ "rotated": { "of": { "box": { "min": [2.8, 0.6], "max": [3.8, 1.4] } }, "about": [3.3, 1], "angle": 30 } });
    let disc = json!({ "ball": { "center": [0.9, 0.9], "radius": 0.8 } });
    let bodies = [merged(solid("disc", 1000, disc), more.clone()), merged(solid("block", 1000, block), more)];
    json!({ "grid": { "size": [4, 2], "spacing": 0.25 }, "time": { "step": 0.01, "end": 1 }, "bodies": bodies })
}

/// The pixels that are coloured farther than `apart` pixels outside the bodies, and those that are not coloured as far inside.
fn wrong(
    picture: &Picture,
    bodies: &Shape<2>,
    before: impl Fn(Vector<f64, 2>) -> Vector<f64, 2>,
    apart: f64,
) -> [usize; 2] {
    let mut wrong = [0; 2];
    for (k, &pixel) in picture.pixels.iter().enumerate() {
        let x = picture.position(k % picture.size[0], k / picture.size[0]);
        if !(0.0..4.0).contains(&x[0]) || !(0.0..2.0).contains(&x[1]) {
            continue;
        }
        let distance = bodies.signed_distance(&before(x)) * picture.scale;
        wrong[0] += usize::from(distance > apart && is_coloured(pixel));
        wrong[1] += usize::from(distance < -apart && !is_coloured(pixel));
    }
    wrong
}

#[test]
fn bodies_end_at_their_surface_deformed_or_not() -> Result<(), Failure> {
    let block = Block { min: Vector::from([2.8, 0.6]), max: Vector::from([3.8, 1.4]) };
    let turned = Similar {
        of: Box::new(block.into()),
        about: Vector::from([3.3, 1.0]),
        rotation: rotation(30.0, None).ok_or("plane")?,
        factor: 1.0,
    };
    let bodies = Shape::union(vec![Ball { center: Vector::from([0.9, 0.9]), radius: 0.8 }.into(), turned.into()]);
    // A deformation about the middle of the grid keeps the particles in the drawing.
    let (middle, deformed) = (Vector::from([2.0, 1.0]), Tensor::from([[0.02, 0.03], [-0.05, -0.04]]));
    for h in [Tensor::zeros(), deformed] {
        let folder = tempfile::tempdir()?;
        let mut simulation: Simulation<2> = built(&disc_and_block(json!({})))?;
        let reference = Reference::of(&simulation);
        let f = identity::<f64, 2>() + h;
        simulation.particles.position.iter_mut().for_each(|x| *x = middle + f * (*x - middle));
        simulation.particles.displacement_gradient.fill(h);
        drawn(&simulation, reference, None, folder.path())?;
        let picture = Picture::read(folder.path(), 0.25)?;
        let back = f.try_inverse().ok_or("no inverse")?;
        let wrong = wrong(&picture, &bodies, |x| middle + back * (x - middle), 2.0);
        assert_eq!(wrong, [0, 0], "{h}");
        assert!(folder.path().join("bodies.pvd").is_file());
    }
    Ok(())
}

#[test]
fn bodies_that_do_not_cut_their_cells_have_no_outline() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let simulation: Simulation<2> = built(&disc_and_block(json!({ "fill": "cells" })))?;
    drawn(&simulation, Reference::of(&simulation), None, folder.path())?;
    assert!(!folder.path().join("bodies.pvd").exists());
    let svg = std::fs::read_to_string(folder.path().join("particles.svg"))?;
    assert!(svg.contains("<polygon") && !svg.contains("clip-path"));
    Ok(())
}

#[test]
fn obstacles_in_space_hide_what_lies_behind_them() -> Result<(), Failure> {
    let ball = |name: &str, x: f64, z: f64| json!({ "name": name, "shape": { "ball": { "center": [x, 1, z], "radius": 0.3 } } });
    let scene = json!({
        "grid": { "size": [4, 2, 4], "spacing": 0.25 },
        "time": { "step": 0.01, "end": 1 },
        "bodies": [solid("slab", 1000, json!({ "box": { "min": [0, 0.1, 1.5], "max": [4, 1.75, 2] } }))],
        "obstacles": [ball("before", 1.0, 2.4), ball("behind", 3.0, 1.1), { "name": "floor", "shape": { "half_space": { "point": [0, 0.05, 0], "normal": [0, 1, 0] } } }]
    });
    let folder = tempfile::tempdir()?;
    let simulation: Simulation<3> = built(&scene)?;
    // The eye is at large z.
    drawn(&simulation, Reference::of(&simulation), Some("xy"), folder.path())?;
    let picture = Picture::read(folder.path(), 0.25)?;
    // The discs of particles have grey rims.
    let (before, behind, slab) = (picture.shares([1.0, 1.0]), picture.shares([3.0, 1.0]), picture.shares([2.0, 1.0]));
    assert!(before[1] > 0.95, "the ball before the slab: {before:?}");
    assert!(behind[0] > 0.5 && slab[0] > 0.5, "the ball behind the slab: {behind:?}, the slab: {slab:?}");
    // From above, the floor lies behind the slab, and both balls are seen beside it.
    drawn(&simulation, Reference::of(&simulation), Some("0,60"), folder.path())?;
    let svg = std::fs::read_to_string(folder.path().join("particles.svg"))?;
    let (before, after) = svg.split_once("<g opacity").ok_or("no obstacles")?;
    assert!(after.split_once("</g>").is_some_and(|(facets, _)| facets.matches("<polygon").count() > 100));
    // The first ball hides some particles, the floor none.
    let hidden = before.matches("<circle").count();
    assert!(hidden > 0 && hidden < svg.matches("<circle").count() / 4, "{hidden} particles are hidden");
    Ok(())
}
