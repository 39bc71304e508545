//! The list of families, which makes [`Approximation`] and [`Parameters`].

use super::bspline::{Bspline, BsplineParameters, NotAKnotBspline};
use super::error::{ApproximationError, Validate};
use super::gimp::Gimp;
use super::linear::Linear;
use super::listed::{Cells, Listed};
use super::lme::{Lme, LmeCircle, LmeParameters};
use super::product::Separable;
use super::shape_function::{Scratch, ShapeFunction};
use super::support::Support;
use crate::grid::Grid;
use crate::problems::Problems;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Makes the types that contain every family from the list of families.
macro_rules! approximations {
    ($($(#[$sentence:meta])+ $key:literal => $family:ident $(($given:ident: $parameters:ty))? $(or $other:ident)?;)*) => {
        /// Any of the shipped shape functions.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Approximation {
            $($(#[$sentence])+ $family($family), $(#[doc = concat!("See [`", stringify!($other), "`].")] $other($other),)?)*
        }

        /// The family of shape functions between particles and nodes.
        #[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
        #[schemars(rename = "Approximation")]
        pub enum Parameters {
            $($(#[$sentence])+ #[serde(rename = $key)] $family $(($parameters))?),*
        }

        impl Parameters {
            /// The key of the family.
            pub(crate) fn key(&self) -> &'static str {
                match self { $(Self::$family { .. } => $key),* }
            }

            /// Whether all bodies must have particles of one width.
            pub(crate) fn one_half_width(&self) -> bool {
                match self { $(Self::$family { .. } => $family::ONE_HALF_WIDTH),* }
            }

            /// Makes the functions. If keys below `path` are wrong, the result is `None` and `problems` lists them.
            ///
            /// ```
            /// use bfree::approximation::{Gimp, Cells, Parameters};
            /// use bfree::scene::Problems;
            ///
            /// let written: Parameters = serde_json::from_str(r#""gimp""#)?;
            /// let cells = Cells { dimension: 2, particles_per_axis: 2, integrated: false };
            /// let functions = written.functions(cells, &mut Problems::default(), "approximation");
            /// assert_eq!(functions, Some(Gimp { half_width: 0.25 }.into()));
            /// # Ok::<(), Box<dyn std::error::Error>>(())
            /// ```
            pub fn functions(&self, cells: Cells, problems: &mut Problems, path: &str) -> Option<Approximation> {
                match self {
                    $(Self::$family $(($given))? => {
                        $family::build(&($(*$given)?), cells, problems, &format!("{path}.{}", $key))
                    })*
                }
            }
        }

        impl Approximation {
            /// Named members of every family, for tests and studies.
            pub fn examples() -> Vec<(&'static str, Self)> {
                [$($family::examples()),*].concat()
            }
        }

        approximations!(@ $($family $($other)?)*);
    };
    (@ $($family:ident)*) => {
        impl Validate for Approximation {
            fn validate(&self, dimension: usize) -> Result<(), ApproximationError> {
                match self { $(Self::$family(family) => family.validate(dimension)),* }
            }
        }

        impl ShapeFunction for Approximation {
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

// The list of families. Each entry has the sentence of the manual, the key in scenes, the type, and a second type that the key may select.
// CONTRIBUTING.md lists the other places that a shipped family touches.
approximations! {
    /// Products of hat functions. Simple and rough: forces jump when a particle crosses a cell face.
    "linear" => Linear;
    /// Products of one-dimensional uGIMP functions. The half-width of a particle follows from `particles_per_cell`, which must be equal for
    /// all bodies.
    "gimp" => Gimp;
    /// Products of B-splines centred on the nodes. The splines may curve at walls if all particles are Gauss points on a grid that is not
    /// reset. In addition, no mass may be lumped (load steps, or `time.lumping` = 0). Otherwise the second derivative is zero at walls.
    "bspline" => Bspline(given: BsplineParameters) or NotAKnotBspline;
    /// Local maximum entropy functions.
    "lme" => Lme(given: LmeParameters) or LmeCircle;
}

impl Parameters {
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
