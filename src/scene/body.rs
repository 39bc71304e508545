//! Bodies: where they are, what they are made of, how they move at the start.

use super::check::{Number, Problems};
use super::grid::GridBox;
use super::shape::Shape;
use crate::material::{Lame, LameError};
use crate::shape as geometry;
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
    /// The hyperelastic law.
    pub material: Material,
    /// Mass per reference volume, > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// The velocity at the start, the same everywhere. Default: zeros, or what the particle file says.
    pub velocity: Option<Vec<f64>>,
    /// Particles per cell along each axis, 1 to 100; 2 gives the quarter points. Default 2.
    #[serde(default = "Body::default_particles_per_cell")]
    #[schemars(range(min = 1, max = 100))]
    pub particles_per_cell: u32,
    /// Which of the regular positions become particles.
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

/// Which of the regular positions become particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those that lie in the shape.
    #[default]
    Particles,
    /// Those of all cells whose centre lies in the shape.
    Cells,
}

impl From<Fill> for geometry::Fill {
    fn from(fill: Fill) -> Self {
        match fill {
            Fill::Particles => Self::Particles,
            Fill::Cells => Self::Cells,
        }
    }
}

/// A hyperelastic law with its constants.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Material {
    /// Neo-Hookean with Ciarlet's volumetric energy Λ/4 (J² − 1) − Λ/2 ln J: the paper's law.
    NeoHookean(Constants),
    /// Neo-Hookean with the volumetric energy Λ/2 (ln J)².
    NeoHookeanLogarithmic(Constants),
    /// St. Venant–Kirchhoff: linear in the Green–Lagrange strain; not for strong compression.
    StVenantKirchhoff(Constants),
}

impl Material {
    /// The constants, whichever the law.
    ///
    /// ```
    /// use bfree::scene::body::Material;
    ///
    /// // The same constants for two laws that differ at large strain only.
    /// let material = |law: &str| serde_json::from_str::<Material>(&format!(r#"{{"{law}": {{"young": 100, "poisson": 0.3}}}}"#));
    /// let (ciarlet, logarithmic) = (material("neo_hookean")?, material("neo_hookean_logarithmic")?);
    /// assert_ne!(ciarlet, logarithmic);
    /// assert_eq!(ciarlet.constants(), logarithmic.constants());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn constants(&self) -> &Constants {
        let (Self::NeoHookean(constants) | Self::NeoHookeanLogarithmic(constants) | Self::StVenantKirchhoff(constants)) =
            self;
        constants
    }

    fn key(&self) -> &'static str {
        match self {
            Self::NeoHookean(_) => "neo_hookean",
            Self::NeoHookeanLogarithmic(_) => "neo_hookean_logarithmic",
            Self::StVenantKirchhoff(_) => "st_venant_kirchhoff",
        }
    }
}

/// The constants of an isotropic law: exactly one of the pairs `lambda` and `shear`, `young` and `poisson`, `bulk` and
/// `shear`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Constants {
    /// Lamé's Λ (stress), > −2/3 `shear`.
    pub lambda: Option<f64>,
    /// The shear modulus G (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub shear: Option<f64>,
    /// Young's modulus E (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub young: Option<f64>,
    /// Poisson's ratio ν (no unit), −1 < ν < 0.5.
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson: Option<f64>,
    /// The bulk modulus K = Λ + 2/3 G (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk: Option<f64>,
}

impl Constants {
    /// Λ and G; `None` unless exactly one pair is given.
    ///
    /// ```
    /// use bfree::scene::body::Constants;
    ///
    /// // The same solid by two pairs: E = 2.5, ν = ¼ is Λ = G = 1. Half of each pair is none.
    /// let lame = |text| serde_json::from_str::<Constants>(text).map(|constants| constants.lame());
    /// let by_young = lame(r#"{"young": 2.5, "poisson": 0.25}"#)?.ok_or("a pair")??;
    /// assert_eq!(by_young, lame(r#"{"lambda": 1, "shear": 1}"#)?.ok_or("a pair")??);
    /// assert!(lame(r#"{"young": 2.5, "shear": 1}"#)?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Constants that no stable solid has.
    pub fn lame(&self) -> Option<Result<Lame, LameError>> {
        match (self.lambda, self.shear, self.young, self.poisson, self.bulk) {
            (Some(lambda), Some(shear), None, None, None) => Some(Lame::new(lambda, shear)),
            (None, None, Some(young), Some(poisson), None) => Some(Lame::from_young_poisson(young, poisson)),
            (None, Some(shear), None, None, Some(bulk)) => Some(Lame::from_bulk_shear(bulk, shear)),
            _ => None,
        }
    }

    fn given(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("lambda", self.lambda),
            ("shear", self.shear),
            ("young", self.young),
            ("poisson", self.poisson),
            ("bulk", self.bulk),
        ]
        .into_iter()
        .filter_map(|(key, value)| Some((key, value?)))
    }

    fn check(&self, problems: &mut Problems, path: &str) {
        let mut ok = true;
        for (key, value) in self.given() {
            ok &= problems.number(&format!("{path}.{key}"), value);
        }
        let Some(lame) = self.lame() else {
            let given: Vec<&str> = self.given().map(|(key, _)| key).collect();
            let found = if given.is_empty() { "nothing".to_owned() } else { given.join(" with ") };
            let allowed = "must be exactly one of the pairs lambda and shear, young and poisson, bulk and shear";
            problems.refuse(path, found, allowed);
            return;
        };
        let (key, value, allowed) = match lame {
            _ if !ok => return,
            Ok(lame) => {
                let finite = lame.lambda.is_finite() && lame.shear.is_finite();
                problems.require(finite, path, "a solid with infinite moduli", "the moduli must be finite");
                return;
            }
            Err(LameError::Shear(shear)) => match self.young {
                Some(young) => {
                    ("young", young, "the shear modulus young / (2 (1 + poisson)) must be finite and > 0".to_owned())
                }
                None => ("shear", shear, "must be finite and > 0".to_owned()),
            },
            Err(LameError::Bulk(bulk)) => match (self.lambda, self.shear, self.poisson) {
                (Some(lambda), Some(shear), _) => {
                    ("lambda", lambda, format!("must be greater than -2/3 shear = {}", Number(-2.0 / 3.0 * shear)))
                }
                (_, _, Some(poisson)) => (
                    "poisson",
                    poisson,
                    "the bulk modulus young / (3 (1 - 2 poisson)) must be finite and > 0".to_owned(),
                ),
                _ => ("bulk", bulk, "must be finite and > 0".to_owned()),
            },
            Err(LameError::Young(young)) => ("young", young, "must be finite and > 0".to_owned()),
            Err(LameError::Poisson(poisson)) => ("poisson", poisson, "must be > -1 and < 0.5".to_owned()),
        };
        problems.refuse(&format!("{path}.{key}"), Number(value), allowed);
    }
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
        let law = format!("{path}.material.{}", self.material.key());
        self.material.constants().check(problems, &law);
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
    let slack = 1e-9 * grid.spacing;
    for k in 0..D {
        let (lower, upper) = (grid.origin[k], grid.origin[k] + f64::from(grid.cells[k]) * grid.spacing);
        let beyond = (min[k].is_finite() && min[k] < lower - slack) || (max[k].is_finite() && max[k] > upper + slack);
        let apart = max[k] <= lower || min[k] >= upper || max[k] < min[k];
        let axis = ["x", "y", "z"][k.min(2)];
        problems.require(
            !beyond && !apart,
            path,
            format_args!("a shape from {axis} = {} to {}", Number(min[k]), Number(max[k])),
            format_args!("must lie in the grid, from {axis} = {} to {}", Number(lower), Number(upper)),
        );
    }
}
