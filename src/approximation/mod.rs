//! Shape functions N and ∇N. Each family has one file, with its functions and its keys in a scene ([`Listed`]). One list of the families
//! makes [`Approximation`] and [`Parameters`].
//!
//! Linear, GIMP, B-splines and the separable local max-ent functions (LME) are products of one-dimensional functions ([`Separable`]). These
//! families share one tensor product. LME on the paper's circle of nodes is not a product. Positions and spacing are in the user's unit of
//! length. N has no unit, and ∇N has the unit 1/length.
//!
//! ```
//! use bfree::approximation::{Approximation, Lme, Scratch, ShapeFunction, Support, Validate};
//! use bfree::grid::Grid;
//! use bfree::tensor::Vector;
//!
//! let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [12, 10] };
//! let shape = Approximation::from(Lme::new(3.0, 1e-6));
//! shape.validate(2)?;
//! let (mut scratch, mut support) = (Scratch::default(), Support::default());
//! shape.evaluate(&grid, &Vector::from([2.61, 2.27]), &mut scratch, &mut support)?;
//! assert_eq!(support.nodes.len(), 16);
//! # Ok::<(), bfree::approximation::ApproximationError>(())
//! ```

mod bspline;
mod error;
mod gimp;
mod interior;
mod kernel;
mod linear;
mod lme;
mod not_a_knot;
mod product;

pub use bspline::{Bspline, BsplineParameters};
pub use error::ApproximationError;
pub use gimp::Gimp;
pub use interior::Shipped;
pub(crate) use interior::{FURTHEST, Interior, InteriorVisitor, Lane, SETTLED};
pub use linear::Linear;
pub use lme::{Lme, LmeCircle, LmeParameters, LmeSupport, SMALLEST_TOLERANCE};
pub use not_a_knot::NotAKnotBspline;
pub use product::{AtSurface, AxisWeights, Separable};
pub(crate) use product::{Place, check, list};

use crate::aggregation::Pieces;
use crate::grid::Grid;
use crate::problems::Problems;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Validation of a family's parameters before any particle exists.
///
/// ```
/// use bfree::approximation::{Gimp, Lme, Validate};
///
/// assert_eq!(Lme::new(3.0, 1e-6).validate(3), Ok(()));
/// // A particle wider than its cell.
/// let refused = Gimp { half_width: 0.6 }.validate(2).unwrap_err();
/// assert!(refused.to_string().contains("0.6"), "{refused}");
/// ```
pub trait Validate {
    /// Checks the parameters of the family in `dimension` = 1, 2 or 3 dimensions.
    ///
    /// # Errors
    /// A parameter is out of range. The error names the parameter and its range.
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

/// Connectivity and shape-function values of a particle: all nodes with N ≠ 0 or ∇N ≠ 0. The buffer is reused.
///
/// ```
/// use bfree::approximation::Support;
///
/// // A shape function of one's own fills it: hats at x = 0.25 on a grid of spacing 1.
/// let mut support = Support::<1>::default();
/// support.clear();
/// for (node, value, slope) in [(0, 0.75, -1.0), (1, 0.25, 1.0)] {
///     support.push([node], value, [slope]);
/// }
/// assert_eq!(support.values.iter().sum::<f64>(), 1.0);
/// let field = |node: [u32; 1]| 5.0 + 2.0 * f64::from(node[0]);
/// let slope: f64 = support.nodes.iter().zip(&support.gradients).map(|(&node, grad)| field(node) * grad[0]).sum();
/// assert_eq!(slope, 2.0);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Support<const D: usize> {
    /// Index along each axis, the first axis running fastest.
    pub nodes: Vec<[u32; D]>,
    /// N of each node.
    pub values: Vec<f64>,
    /// ∇N of each node, in 1/length.
    pub gradients: Vec<[f64; D]>,
}

impl<const D: usize> Support<D> {
    /// Empties the list and keeps its memory.
    #[inline]
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.values.clear();
        self.gradients.clear();
    }

    /// Appends a node.
    #[inline]
    pub fn push(&mut self, node: [u32; D], value: f64, gradient: [f64; D]) {
        self.nodes.push(node);
        self.values.push(value);
        self.gradients.push(gradient);
    }
}

/// Work arrays of a shape function; each thread has its own.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    axes: [AxisWeights; 3],
}

/// N and ∇N at a point, in `D` = 1, 2 or 3 dimensions.
///
/// ```
/// use bfree::approximation::{AxisWeights, LmeCircle, Lme, Scratch, ShapeFunction, Support};
/// use bfree::grid::Grid;
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [12, 10] };
/// let (x, mut scratch, mut support) = (Vector::from([2.61, 2.27]), Scratch::default(), Support::default());
/// let lme = Lme::new(3.0, 1e-6);
/// lme.evaluate(&grid, &x, &mut scratch, &mut support)?;
/// // Σ N = 1, Σ N x_I = x, Σ ∇N = 0
/// let entries = || support.nodes.iter().zip(&support.values).zip(&support.gradients);
/// assert!((support.values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
/// let place: Vector<f64, 2> = entries().map(|((&node, &n), _)| grid.position(node) * n).sum();
/// assert!((place - x).norm() < 1e-13);
/// assert!(entries().map(|(_, &grad)| Vector::from(grad)).sum::<Vector<f64, 2>>().norm() < 1e-12);
/// // It is a product of functions of x and of y; on the paper's circle of nodes it is not.
/// let product = lme.separable().ok_or("a product")?;
/// let mut along_x = AxisWeights::default();
/// product.axis(&grid.axis(0), x[0], &mut along_x)?;
/// assert!(along_x.values.len() <= product.width());
/// assert!(LmeCircle::new(3.0, 1e-6).separable().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait ShapeFunction: Validate + Send + Sync {
    /// Fills `out` with the nodes that have N ≠ 0 or ∇N ≠ 0 at `x`. After an error the content of `out` means nothing.
    ///
    /// # Errors
    /// `x` is outside the box of the grid, or not a number. [`Validate::validate`] refuses the parameters, and they matter at `x`.
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError>;

    /// The one-dimensional functions of a product; `None` if the functions are not a product.
    fn separable(&self) -> Option<&dyn Separable>;

    /// The polynomial pieces by which outer nodes at the boundary of a body follow inner nodes.
    fn pieces(&self) -> Pieces {
        self.separable().map_or(Pieces::LINEAR, Separable::pieces)
    }
}

impl<S: Separable> ShapeFunction for S {
    #[inline]
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError> {
        product::inside(grid, x)?;
        for k in 0..D {
            product::list(self, &grid.axis(k), x[k], &mut scratch.axes[k])?;
        }
        product::product(&scratch.axes, out);
        Ok(())
    }

    fn separable(&self) -> Option<&dyn Separable> {
        Some(self)
    }
}

/// The parts of a listed family besides its functions: its keys, constructor and examples.
pub trait Listed: ShapeFunction {
    /// The keys of the family in a scene; `()` if it has only its name. The doc comments of the fields are the manual.
    type Parameters;

    /// Whether the functions depend on the width of particles. If so, all bodies must have particles of one width.
    const ONE_HALF_WIDTH: bool = false;

    /// Makes the functions. If keys below `path` are wrong, the result is `None` and `problems` lists them.
    fn build(given: &Self::Parameters, cells: Cells, problems: &mut Problems, path: &str) -> Option<Approximation>;

    /// Named members of the family, for tests and studies.
    fn examples() -> Vec<(&'static str, Approximation)>;
}

/// The data of a scene on which shape functions depend, besides their own parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// The number of dimensions D.
    pub dimension: usize,
    /// Particles along each axis of a cell.
    pub particles_per_axis: u32,
    /// Whether the particles are Gauss points, so that sums over particles are integrals, and no mass is lumped.
    pub integrated: bool,
}

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
