//! The lists of families: [`Approximation`], the functions, and [`Parameters`], their keys in a scene.

use super::bspline::{Bspline, BsplineParameters, NotAKnotBspline};
use super::error::{ApproximationError, Validate};
use super::gimp::Gimp;
use super::linear::Linear;
use super::lme::{Lme, LmeCircle, LmeParameters, LmeSupport};
use super::product::Separable;
use super::shape_function::{Scratch, ShapeFunction};
use super::support::Support;
use crate::grid::Grid;
use crate::problems::Problems;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Makes the type that contains every family from the list of families.
macro_rules! approximations {
    ($($(#[$sentence:meta])+ $family:ident;)*) => {
        /// Any of the shipped shape functions.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Approximation {
            $($(#[$sentence])+ $family($family)),*
        }

        impl Validate for Approximation {
            fn validate(&self, dimension: usize) -> Result<(), ApproximationError> {
                match self { $(Self::$family(family) => family.validate(dimension)),* }
            }
        }

        impl ShapeFunction for Approximation {
            const IN_SCENES: bool = true;

            #[inline]
            fn evaluate<const D: usize>(
                &self, grid: &Grid<D>, x: &Vector<f64, D>, scratch: &mut Scratch, out: &mut Support<D>,
            ) -> Result<(), ApproximationError> {
                match self { $(Self::$family(family) => family.evaluate(grid, x, scratch, out)),* }
            }

            fn separable(&self) -> Option<&dyn Separable> {
                match self { $(Self::$family(family) => family.separable()),* }
            }
        }

        $(impl From<$family> for Approximation {
            fn from(family: $family) -> Self {
                Self::$family(family)
            }
        })*
    };
}

// CONTRIBUTING.md lists the other places that a shipped family touches.
approximations! {
    /// Products of hat functions.
    Linear;
    /// Products of one-dimensional uGIMP functions.
    Gimp;
    /// Products of B-splines centred on the nodes, whose second derivative is zero at walls.
    Bspline;
    /// Products of B-splines centred on the nodes, which may curve at walls.
    NotAKnotBspline;
    /// Local maximum entropy functions on a box of nodes.
    Lme;
    /// Local maximum entropy functions on a circle of nodes.
    LmeCircle;
}

impl Approximation {
    /// Named members of every family, for tests and studies. The widest max-ent functions, with γ̂ = 0.8, are on the box alone.
    pub fn examples() -> Vec<(&'static str, Self)> {
        vec![
            ("linear", Linear.into()),
            ("gimp", Gimp::particles_per_axis(2).into()),
            ("quadratic", Bspline::Quadratic.into()),
            ("cubic", Bspline::Cubic.into()),
            ("not-a-knot quadratic", NotAKnotBspline(Bspline::Quadratic).into()),
            ("not-a-knot cubic", NotAKnotBspline(Bspline::Cubic).into()),
            ("lme 0.8", Lme::new(0.8, 1e-6).into()),
            ("lme 1.8", Lme::new(1.8, 1e-6).into()),
            ("lme 3", Lme::new(3.0, 1e-6).into()),
            ("lme circle 1.8", LmeCircle::new(1.8, 1e-6).into()),
            ("lme circle 3", LmeCircle::new(3.0, 1e-6).into()),
        ]
    }
}

/// The family of shape functions between particles and nodes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Approximation")]
#[serde(rename_all = "snake_case")]
pub enum Parameters {
    /// Products of hat functions. Simple and rough: forces jump when a particle crosses a cell face.
    Linear,
    /// Products of one-dimensional uGIMP functions. The half-width of a particle follows from `particles_per_cell`, which must be equal for
    /// all bodies.
    Gimp,
    /// Products of B-splines centred on the nodes. The splines may curve at walls if all particles are Gauss points on a grid that is not
    /// reset. In addition, no mass may be lumped (load steps, or `time.lumping` = 0). Otherwise the second derivative is zero at walls.
    Bspline(BsplineParameters),
    /// Local maximum entropy functions.
    Lme(LmeParameters),
}

/// The data of a scene on which shape functions depend, besides their own parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cells {
    /// The number of dimensions D.
    pub dimension: usize,
    /// Particles along each axis of a cell.
    pub particles_per_axis: u32,
    /// Whether the particles are Gauss points, so that sums over particles are integrals, and no mass is lumped.
    pub integrated: bool,
}

impl Parameters {
    /// The key of the family.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Gimp => "gimp",
            Self::Bspline(_) => "bspline",
            Self::Lme(_) => "lme",
        }
    }

    /// Whether all bodies must have particles of one width.
    pub(crate) fn one_half_width(&self) -> bool {
        *self == Self::Gimp
    }

    /// Makes the functions. If keys below `path` are wrong, the result is `None` and `problems` lists them.
    pub(crate) fn functions(&self, cells: Cells, problems: &mut Problems, path: &str) -> Option<Approximation> {
        let path = format!("{path}.{}", self.key());
        Some(match self {
            Self::Linear => Linear.into(),
            Self::Gimp => Gimp::particles_per_axis(cells.particles_per_axis).into(),
            Self::Bspline(given) => match given.spline(problems, &path)? {
                spline if cells.integrated => NotAKnotBspline(spline).into(),
                spline => spline.into(),
            },
            Self::Lme(given) if !given.check(cells.dimension, problems, &path) => return None,
            Self::Lme(LmeParameters { gamma, tolerance, support }) => match support {
                LmeSupport::Separable => Lme::new(*gamma, *tolerance).into(),
                LmeSupport::Circle => LmeCircle::new(*gamma, *tolerance).into(),
            },
        })
    }

    /// The polynomial degree of the functions along an axis. Local maximum-entropy functions have the degree of a comparable polynomial.
    pub(crate) fn degree(&self) -> u32 {
        match self {
            Self::Linear | Self::Gimp => 1,
            Self::Bspline(given) => given.degree,
            Self::Lme(_) => 3,
        }
    }

    /// The smallest and the largest distance between the surfaces of two bodies, in grid spacings, at which their interaction begins. The
    /// test `contact` measures both distances. `None` for functions that were not measured.
    ///
    /// ```
    /// let cubic = bfree::approximation::Parameters::default();
    /// assert_eq!(cubic.contact_distance(), Some([1.7, 2.4]));
    /// ```
    pub fn contact_distance(&self) -> Option<[f64; 2]> {
        match self {
            Self::Linear => Some([0.4, 1.4]),
            Self::Gimp => Some([0.8, 1.7]),
            Self::Bspline(given) if given.degree == 2 => Some([1.2, 2.0]),
            Self::Bspline(_) => Some([1.7, 2.4]),
            Self::Lme(given) if given.gamma == 3.0 => Some([0.7, 1.6]),
            Self::Lme(given) if given.gamma == 1.4 => Some([1.9, 2.4]),
            Self::Lme(_) => None,
        }
    }
}

/// Cubic B-splines: of the measured shape functions, no other has both a smaller error and less work (study `tradeoff`).
impl Default for Parameters {
    fn default() -> Self {
        Self::Bspline(BsplineParameters::default())
    }
}
