//! Bodies: shape or particles, material, and initial velocity.

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
    /// The unique name by which loads and probes refer to the body.
    #[schemars(length(min = 1))]
    pub name: String,
    /// The region to fill with particles. A body has either `shape` or `particles`.
    pub shape: Option<Shape>,
    /// A file with the particles. A body has either `particles` or `shape`.
    pub particles: Option<ParticleFile>,
    /// The constitutive law.
    pub material: material::Parameters,
    /// The change of volume that enters the strain energy.
    #[serde(default)]
    pub volumetric: Dilatation,
    /// Mass per reference volume, > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// The initial velocity, uniform in the body. Default: the velocities of the particle file, or zeros.
    pub velocity: Option<Vec<f64>>,
    /// Particles per cell along each axis, 1 to 100; 2 gives the quarter points. Default 2.
    #[serde(default = "Body::default_particles_per_cell")]
    #[schemars(range(min = 1, max = 100))]
    pub particles_per_cell: u32,
    /// Positions of the particles in cells that the body fills. Default: `"regular"` if the grid is reset in every step, and with uGIMP
    /// functions; else `"gauss"`.
    pub layout: Option<Layout>,
    /// Treatment of the particles in cut cells, the cells that the surface of the shape cuts.
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
                match dimension {
                    1 => check_inside::<1>(shape, problems, &path, grid),
                    2 => check_inside::<2>(shape, problems, &path, grid),
                    _ => check_inside::<3>(shape, problems, &path, grid),
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

/// Refuses a shape that is empty or whose finite part reaches beyond the box: that part would be lost silently. Only infinite shapes are
/// clipped.
fn check_inside<const D: usize>(shape: &Shape, problems: &mut Problems, path: &str, grid: &GridBox) {
    let (Some(shape), Some(grid)) = (shape.checked::<D>(problems, path), grid.build::<D>()) else { return };
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
