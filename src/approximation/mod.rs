//! Shape functions N and ∇N. Each family has one file. [`Approximation`] is the list of the families, [`Parameters`] the list of their keys
//! in a scene.
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
mod list;
mod lme;
mod product;
mod shape_function;
mod support;

pub use bspline::{Bspline, BsplineParameters, NotAKnotBspline};
pub use error::{ApproximationError, Validate};
pub use gimp::Gimp;
pub use interior::InLanes;
pub(crate) use interior::{FURTHEST, InCells, Rows, SETTLED};
pub use linear::Linear;
pub(crate) use list::Cells;
pub use list::{Approximation, Parameters};
pub use lme::{Lme, LmeCircle, LmeParameters, LmeSupport};
pub use product::{AtSurface, AxisWeights, Separable};
pub(crate) use product::{Place, check, list};
pub use shape_function::{Scratch, ShapeFunction};
pub use support::Support;
