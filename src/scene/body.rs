//! Bodies: shape or particles, material, and initial velocity.

use super::default_number;
use super::grid::GridBox;
use super::shape::Shape;
use crate::material::{self, Law, Material};
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
    #[serde(default = "default_number::<2>")]
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
    /// The law, if its constants are allowed.
    pub(super) fn law(&self) -> Option<Material> {
        self.material.law(&mut Problems::default(), "")
    }

    pub(super) fn check(&self, problems: &mut Problems, path: &str, grid: &GridBox) {
        let dimension = grid.dimension();
        let name = format!("{path}.name");
        problems.require(!self.name.is_empty(), &name, "an empty name", "must have at least one letter");
        let printed = !self.name.contains(char::is_control);
        problems.require(printed, &name, format_args!("{:?}", self.name), "must be of letters that can be printed");
        match (&self.shape, &self.particles) {
            (Some(shape), None) => {
                check_inside(shape, problems, &format!("{path}.shape"), grid);
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
            let has_part = law.volumetric(&Deformation::<f64, 1>::new(Tensor::zeros())).is_some();
            let allowed =
                "must be of a law whose energy has a part that depends on the volume alone, which this one has not";
            problems.require(has_part, &format!("{path}.volumetric"), "\"mean_dilatation\"", allowed);
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
fn check_inside(shape: &Shape, problems: &mut Problems, path: &str, grid: &GridBox) {
    let bounds = shape.check_solid(problems, path, grid.dimension());
    let (Some([min, max]), Some(cells)) = (bounds, grid.cells()) else { return };
    if min.iter().zip(&max).any(|(min, max)| max < min) {
        let allowed = "must hold something: its parts do not meet, or nothing is left of them";
        return problems.refuse(path, "an empty shape", allowed);
    }
    let (slack, origin) = (EDGE * grid.spacing, grid.origin());
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate().take(grid.dimension()) {
        let (min, max) = (min[k], max[k]);
        let (lower, upper) = (origin[k], origin[k] + f64::from(cells[k]) * grid.spacing);
        let beyond = (min.is_finite() && min < lower - slack) || (max.is_finite() && max > upper + slack);
        let apart = max <= lower || min >= upper;
        let found = format!("a shape from {axis} = {} to {}", Number(min), Number(max));
        let allowed = format!("must lie in the grid, from {axis} = {} to {}", Number(lower), Number(upper));
        problems.require(!beyond && !apart, path, found, allowed);
    }
}
