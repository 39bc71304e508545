//! The lengths and speeds of a scene, from which spacing and time step follow.

use crate::material::p_wave_modulus;
use crate::problems::Problems;
use crate::scene::body::Body;
use crate::scene::grid::GridBox;
use crate::scene::shape::Shape;

/// Distance, in spacings, within which a face counts as on a node.
const ON_NODE: f64 = 1e-6;

/// Largest factor by which the number of cells along the shortest edge may exceed the required number.
const MAX_REFINEMENT: usize = 2;

/// Maximum number of cells along the shortest edge of the box.
const MOST_CELLS: f64 = 1e5;

const NO_BOX: &str = "the box of the grid has no extent, or too many cells";
const NO_BODY: &str = "there is no body";

/// The largest spacing that divides all edges of the box and puts at least `cells` cells across the smallest extent of every body. If a
/// spacing up to twice as fine also puts nodes on the faces of all bodies that are boxes, that one is taken. Or the reason why there is none.
pub(super) fn fitting(grid: &GridBox, bodies: &[Body], cells: f64) -> Result<f64, String> {
    let (origin, dimension) = (grid.origin(), grid.dimension());
    let sound = grid.size.iter().all(|&size| size > 0.0 && size.is_finite()) && origin.iter().all(|x| x.is_finite());
    if !sound || origin.len() != dimension || !(1..=3).contains(&dimension) {
        return Err(NO_BOX.to_owned());
    }
    let mut extent = f64::INFINITY;
    // Faces of bodies that are boxes, as distances from the lower corner of the grid.
    let mut faces: Vec<f64> = Vec::new();
    for body in bodies {
        let name = &body.name;
        let shape = body.shape.as_ref();
        let shape = shape.ok_or_else(|| format!("how large the body {name:?} is stands in its file of particles"))?;
        let no_extent = || format!("the body {name:?} has no extent inside the grid");
        let [min, max] = shape.check(&mut Problems::default(), "", dimension).ok_or_else(no_extent)?;
        for k in 0..dimension {
            let (low, high) = ((min[k] - origin[k]).max(0.0), (max[k] - origin[k]).min(grid.size[k]));
            if high <= low {
                return Err(no_extent());
            }
            extent = extent.min(high - low);
            if let Shape::Box { .. } = shape {
                faces.extend([low, high]);
            }
        }
    }
    if bodies.is_empty() {
        return Err(NO_BODY.to_owned());
    }
    let coarsest = extent / cells;
    let shortest = grid.size.iter().copied().fold(f64::INFINITY, f64::min);
    let fewest = (shortest / coarsest - ON_NODE).ceil().max(1.0);
    if fewest >= MOST_CELLS {
        return Err(NO_BOX.to_owned());
    }
    let fewest = fewest as usize;
    let divides = |h: f64| GridBox { spacing: h, ..grid.clone() }.cells().is_some();
    let on_node = |x: f64, h: f64| (x / h - (x / h).round()).abs() < ON_NODE;
    let spacings = (fewest..=MAX_REFINEMENT * fewest).map(|n| shortest / n as f64).filter(|&h| divides(h));
    let found = spacings.clone().find(|&h| faces.iter().all(|&x| on_node(x, h))).or(spacings.clone().next());
    let finest = coarsest / MAX_REFINEMENT as f64;
    found.ok_or_else(|| format!("no spacing between {finest:.4e} and {coarsest:.4e} divides every edge of the grid"))
}

/// The greatest speed of pressure waves in the undeformed bodies, c = √(M/ρ), M = Λ + 2G in isotropic solids.
pub(super) fn speed(bodies: &[Body]) -> Result<f64, String> {
    let mut greatest = None;
    for body in bodies {
        let speed = body.law().map_or(f64::NAN, |law| (p_wave_modulus(&law) / body.density).sqrt());
        if !(speed > 0.0 && speed.is_finite()) {
            return Err(format!("the constants or the density of the body {:?} give no speed of sound", body.name));
        }
        greatest = Some(speed.max(greatest.unwrap_or(0.0)));
    }
    greatest.ok_or(NO_BODY.to_owned())
}
