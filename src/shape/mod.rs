//! Solid geometry by signed distances, and filling with particles. Each family of solids has one file, and one list names all families.

mod ball;
mod block;
mod bounds;
mod cloud;
mod combined;
mod cone;
mod cut;
mod feature;
mod fill;
mod grid_box;
mod half_space;
mod layout;
mod moments;
mod outline;
mod pixels;
mod polygon;
mod quadrature;
mod seeds;
mod similar;
mod surface;

#[cfg(test)]
mod tests;

pub use ball::Ball;
pub use block::Block;
pub(crate) use cloud::{Cloud, CloudPoint, NoSurface, cloud_surface};
pub use combined::{Combination, Difference};
pub use cone::Cone;
pub use cut::Facet;
pub(crate) use feature::Feature;
pub(crate) use fill::around;
pub use fill::{Fill, FillError, Filling, fill};
pub use grid_box::GridBox;
pub use half_space::HalfSpace;
pub use layout::Layout;
pub use pixels::{Mask, Pixels};
pub use polygon::{Polygon, PolygonError};
pub use seeds::Seed;
pub use similar::{Similar, rotation};
pub use surface::{Sheet, Surface, SurfaceError};

use crate::tensor::Vector;

/// Tolerance for comparisons of lengths, relative to the spacing: it covers round-off.
pub(crate) const EDGE: f64 = 1e-9;

/// The depth of surface points below the surface, relative to the spacing. So the points lie in the cell of the body in spite of round-off.
pub(crate) const SURFACE_DEPTH: f64 = 1e-6;

/// A piece of surface: its signed distance d, negative inside, and its outward unit normal n = ∇d.
type Face<const D: usize> = (f64, Vector<f64, D>);

/// The volume and the centroid of the part of a box in a solid.
type Part<const D: usize> = (f64, Vector<f64, D>);

/// The geometry that every solid provides.
trait Solid<const D: usize> {
    /// The surface nearest to `x`.
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D>;

    /// The part of the surface nearest to `x`.
    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        Feature::plane(x, self.nearest(x))
    }

    /// Adds the planes that approximate the surface within `radius` of `x`, each by its distance from `x` and its normal. Returns the
    /// largest distance there between the surface and the planes.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64;

    /// The extent in the direction `n`, a vector of any length: the largest n·x in the solid, or an upper bound.
    fn reach(&self, n: &Vector<f64, D>) -> f64;

    /// The only part whose surface comes within `radius` of `x`, and whether this solid is the outside of the part there.
    fn alone(&self, _x: &Vector<f64, D>, _radius: f64) -> Option<(&Shape<D>, bool)> {
        None
    }

    /// The facets of the surface in a box; `None` for a solid whose surface is approximated by planes.
    fn facets(&self, _of: &GridBox<D>, _planes: &[Face<D>]) -> Option<Vec<Facet<D>>> {
        None
    }

    /// The parts of the solid in `count` equal boxes next to each other along the first axis. `None` for a solid that planes cut.
    fn row(&self, _first: &GridBox<D>, _count: usize) -> Option<Vec<Part<D>>> {
        None
    }
}

macro_rules! shapes {
    ($($(#[$about:meta])* $name:ident;)*) => {
        /// A solid of `D` dimensions. All lengths are in the user's unit.
        ///
        /// The signed distance d is negative inside. It is the Euclidean distance, except for combinations. For a combination, d is the min
        /// or max of the parts' distances. This d has the right sign and the right zero set. A positive d never exceeds the Euclidean
        /// distance.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Shape<const D: usize> {
            $($(#[$about])* $name($name<D>),)*
        }

        impl<const D: usize> Shape<D> {
            fn solid(&self) -> &dyn Solid<D> {
                match self {
                    $(Self::$name(solid) => solid,)*
                }
            }
        }

        $(impl<const D: usize> From<$name<D>> for Shape<D> {
            fn from(solid: $name<D>) -> Self {
                Self::$name(solid)
            }
        })*
    };
}

shapes! {
    /// An axis-parallel box.
    Block;
    /// An interval, a disc or a ball.
    Ball;
    /// All points behind a plane.
    HalfSpace;
    /// A polygon of the plane.
    Polygon;
    /// A cylinder or a cone.
    Cone;
    /// The union of the parts, or their intersection.
    Combination;
    /// The points that lie in one solid and not in another.
    Difference;
    /// A solid turned and scaled.
    Similar;
    /// The inside of a closed surface of triangles.
    Surface;
    /// Triangles or segments that enclose nothing.
    Sheet;
    /// Pixels of a picture, voxels of a scan.
    Pixels;
}

impl<const D: usize> Shape<D> {
    /// Whether `x` lies in the solid, its surface included.
    pub(crate) fn contains(&self, x: &Vector<f64, D>) -> bool {
        self.signed_distance(x) <= 0.0
    }

    /// Whether `x`, a node or a particle of a grid of this spacing, lies in the solid. A tolerance admits points that round-off moves off
    /// the surface.
    pub(crate) fn holds(&self, x: &Vector<f64, D>, spacing: f64) -> bool {
        self.signed_distance(x) <= EDGE * spacing
    }

    /// The signed distance d of `x` from the surface, negative inside; +∞ for an empty union, −∞ for an empty intersection.
    ///
    /// ```
    /// use bfree::shape::{Ball, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// let disc = Shape::from(Ball { center: Vector::from([0.0, 0.0]), radius: 5.0 });
    /// assert_eq!(disc.signed_distance(&Vector::from([3.0, 4.0])), 0.0);
    /// assert_eq!(disc.signed_distance(&Vector::from([6.0, 8.0])), 5.0);
    /// assert_eq!(disc.normal(&Vector::from([6.0, 8.0])), Vector::from([0.6, 0.8]));
    /// ```
    pub fn signed_distance(&self, x: &Vector<f64, D>) -> f64 {
        self.distance_and_normal(x).0
    }

    /// The outward unit normal ∇d of the surface nearest to `x`; at a hole the normal points into the hole.
    ///
    /// Where ∇d does not exist (the centre of a ball, points equally near to two faces) the result is the normal of one of the nearest
    /// surfaces.
    ///
    /// ```
    /// use bfree::shape::{Ball, Block, Difference, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// let hole = Ball { center: Vector::from([0.0, 0.0]), radius: 1.0 };
    /// let plate = Block { min: Vector::from([-2.0, -2.0]), max: Vector::from([2.0, 2.0]) };
    /// let plate = Shape::from(Difference { of: Box::new(plate.into()), minus: Box::new(hole.into()) });
    /// assert_eq!(plate.normal(&Vector::from([0.0, 1.9])), Vector::from([0.0, 1.0]));
    /// assert_eq!(plate.normal(&Vector::from([0.0, 1.1])), Vector::from([0.0, -1.0]));
    /// ```
    pub fn normal(&self, x: &Vector<f64, D>) -> Vector<f64, D> {
        self.distance_and_normal(x).1
    }

    /// The signed distance d and the normal ∇d.
    ///
    /// ```
    /// use bfree::shape::{Ball, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // x − d ∇d is the nearest point of the surface.
    /// let disc = Shape::from(Ball { center: Vector::from([1.0, 0.0]), radius: 5.0 });
    /// let x = Vector::from([4.0, 4.0]);
    /// let (d, n) = disc.distance_and_normal(&(x + Vector::from([3.0, 4.0])));
    /// assert_eq!((d, n), (5.0, Vector::from([0.6, 0.8])));
    /// assert_eq!(disc.signed_distance(&x), 0.0);
    /// ```
    pub fn distance_and_normal(&self, x: &Vector<f64, D>) -> (f64, Vector<f64, D>) {
        self.solid().nearest(x)
    }

    /// The part of the surface nearest to `x`, as a smooth function around `x`.
    pub(crate) fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        self.solid().feature(x)
    }

    /// A box `(min, max)` that contains the solid: infinite for half-spaces, and with `min > max` for an empty solid.
    ///
    /// The box is tight, with two exceptions: half-spaces with an oblique plane, and differences and intersections, which get an upper
    /// bound.
    ///
    /// ```
    /// use bfree::shape::{Ball, HalfSpace, Shape};
    /// use bfree::tensor::Vector;
    ///
    /// // The lower half of a disc; for an intersection the bound is that of the planes and balls in it.
    /// let disc = Ball { center: Vector::from([0.0, 0.0]), radius: 1.0 };
    /// let below = HalfSpace { point: Vector::from([0.0, 0.0]), normal: Vector::from([0.0, 3.0]) };
    /// let half = Shape::intersection(vec![disc.into(), below.into()]);
    /// assert_eq!(half.bounding_box(), (Vector::from([-1.0, -1.0]), Vector::from([1.0, 0.0])));
    /// ```
    pub fn bounding_box(&self) -> (Vector<f64, D>, Vector<f64, D>) {
        let solid = self.solid();
        let min = Vector::from_fn(|k, _| 0.0 - solid.reach(&axis(k, -1.0)));
        (min, Vector::from_fn(|k, _| solid.reach(&axis(k, 1.0))))
    }
}

/// Whether a point at this signed distance lies above the surface, or less than `depth` below it.
pub(crate) fn is_above(distance: f64, depth: f64) -> bool {
    distance > -depth * (1.0 - EDGE)
}

/// ± e_k
fn axis<const D: usize>(k: usize, sign: f64) -> Vector<f64, D> {
    Vector::from_fn(|i, _| if i == k { sign } else { 0.0 })
}
