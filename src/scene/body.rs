//! Bodies: where they are, what they are made of, how they move at the start.

use super::grid::GridBox;
use super::shape::Shape;
use crate::material::{self, Law};
use crate::particles::Dilatation;
use crate::problems::{Number, Problems};
use crate::shape::{EDGE, Fill, Layout};
use crate::tensor::{Deformation, Tensor};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A deformable body.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// The name by which loads and probes refer to it; no two bodies share one.
    #[schemars(length(min = 1))]
    pub name: String,
    /// The region to fill with particles. Either this or `particles` is given.
    pub shape: Option<Shape>,
    /// A file with the particles. Either this or `shape` is given.
    pub particles: Option<ParticleFile>,
    /// The law.
    pub material: material::Parameters,
    /// What change of volume the energy sees.
    #[serde(default)]
    pub volumetric: Dilatation,
    /// Mass per reference volume, > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// The velocity at the start, the same everywhere. Default: zeros, or what the particle file says.
    pub velocity: Option<Vec<f64>>,
    /// Particles per cell along each axis, 1 to 100; 2 gives the quarter points. Default 2.
    #[serde(default = "Body::default_particles_per_cell")]
    #[schemars(range(min = 1, max = 100))]
    pub particles_per_cell: u32,
    /// Where particles are in cells that the body fills. Default: `"gauss"` on a grid that is kept, `"regular"` on one that is made anew
    /// every step and with uGIMP functions.
    pub layout: Option<Layout>,
    /// What becomes of particles in cells that the surface of the shape cuts.
    #[serde(default)]
    pub fill: Fill,
}

/// Particles from a file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParticleFile {
    /// Path of a CSV file with the header `x[,y[,z]],volume[,vx[,vy[,vz]]]`, relative to the scene's folder.
    #[schemars(length(min = 1))]
    pub file: PathBuf,
}

impl Body {
    fn default_particles_per_cell() -> u32 {
        2
    }

    pub(super) fn check(&self, problems: &mut Problems, path: &str, grid: &GridBox) {
        let dimension = grid.dimension();
        problems.require(
            !self.name.is_empty(),
            &format!("{path}.name"),
            "an empty name",
            "must have at least one letter",
        );
        problems.require(
            !self.name.contains(char::is_control),
            &format!("{path}.name"),
            format_args!("{:?}", self.name),
            "must be of letters that can be printed",
        );
        match (&self.shape, &self.particles) {
            (Some(shape), None) => {
                let path = format!("{path}.shape");
                if shape.check(problems, &path, dimension) {
                    match dimension {
                        1 => check_inside::<1>(shape, problems, &path, grid),
                        2 => check_inside::<2>(shape, problems, &path, grid),
                        _ => check_inside::<3>(shape, problems, &path, grid),
                    }
                }
            }
            (None, Some(particles)) => {
                let empty = particles.file.as_os_str().is_empty();
                problems.require(!empty, &format!("{path}.particles.file"), "an empty path", "must name a CSV file");
            }
            (Some(_), Some(_)) => problems.refuse(path, "both shape and particles", "must have exactly one of the two"),
            (None, None) => problems.refuse(path, "neither shape nor particles", "must have exactly one of the two"),
        }
        let law = self.material.law(problems, &format!("{path}.material"));
        if let Some(law) = law.filter(|_| self.volumetric == Dilatation::MeanDilatation) {
            problems.require(
                law.volumetric(&Deformation::<f64, 1>::new(Tensor::zeros())).is_some(),
                &format!("{path}.volumetric"),
                "\"mean_dilatation\"",
                "must be of a law whose energy has a part that depends on the volume alone, which this one has not",
            );
        }
        problems.positive(&format!("{path}.density"), self.density);
        if let Some(velocity) = &self.velocity {
            problems.vector(&format!("{path}.velocity"), velocity, dimension);
        }
        problems.whole(&format!("{path}.particles_per_cell"), self.particles_per_cell, 1, 100);
    }
}

/// A body may be cut by the box only where its shape is infinite: a part beyond it would be lost in silence.
fn check_inside<const D: usize>(shape: &Shape, problems: &mut Problems, path: &str, grid: &GridBox) {
    let (Some(grid), Some(shape)) = (grid.build::<D>(), shape.build::<D>()) else { return };
    let (min, max) = shape.bounding_box();
    if (0..D).any(|k| max[k] < min[k]) {
        problems.refuse(
            path,
            "an empty shape",
            "must hold something: its parts do not meet, or nothing is left of them",
        );
        return;
    }
    let slack = EDGE * grid.spacing;
    for k in 0..D {
        let (lower, upper) = (grid.origin[k], grid.origin[k] + f64::from(grid.cells[k]) * grid.spacing);
        let beyond = (min[k].is_finite() && min[k] < lower - slack) || (max[k].is_finite() && max[k] > upper + slack);
        let apart = max[k] <= lower || min[k] >= upper;
        let axis = ["x", "y", "z"][k.min(2)];
        problems.require(
            !beyond && !apart,
            path,
            format_args!("a shape from {axis} = {} to {}", Number(min[k]), Number(max[k])),
            format_args!("must lie in the grid, from {axis} = {} to {}", Number(lower), Number(upper)),
        );
    }
}
