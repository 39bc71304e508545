//! Solids inside a closed surface of triangles, as in STL and PLY files.

mod mesh;
mod rows;
mod sheet;
mod sound;
mod tree;

pub use sheet::Sheet;
pub use sound::SurfaceError;

use super::bounds::Bounds;
use super::{Face, Facet, Feature, GridBox, Part, Solid};
use crate::tensor::{Tensor, Vector};
use mesh::{Foot, Mesh, foot};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// The largest number of planes for the triangles near a point. If there are more, triangles with similar normals share one plane.
const PLANES: usize = 6;

/// Two triangles have similar normals if the cosine of the angle between the normals exceeds this.
const ALIKE: f64 = 0.9;

/// The solid inside a closed surface of triangles, in 3D.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface<const D: usize> {
    mesh: Arc<Mesh>,
}

impl<const D: usize> Surface<D> {
    /// The solid inside these triangles, each given by the numbers of its vertices. All triangles face outwards, or all face inwards; `D`
    /// must be 3.
    ///
    /// ```
    /// use bfree::shape::{Shape, Surface, SurfaceError};
    /// use bfree::tensor::Vector;
    ///
    /// // A tetrahedron at the corner of the axes.
    /// let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector::from).to_vec();
    /// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    /// let corner = Shape::from(Surface::<3>::new(vertices.clone(), triangles.clone())?);
    /// assert_eq!(corner.signed_distance(&Vector::from([0.125, 0.25, 0.25])), -0.125);
    /// assert_eq!(corner.normal(&Vector::from([0.25, 0.25, -1.0])), Vector::from([0.0, 0.0, -1.0]));
    /// // Without one of its sides there is no inside.
    /// let open = Surface::<3>::new(vertices, triangles[..3].to_vec());
    /// assert!(matches!(open, Err(SurfaceError::Open(..))));
    /// # Ok::<(), SurfaceError>(())
    /// ```
    ///
    /// # Errors
    /// The surface is open, faces both ways, crosses itself, lies in itself or encloses nothing. The error says where.
    pub fn new(vertices: Vec<Vector<f64, D>>, triangles: Vec<[u32; 3]>) -> Result<Self, SurfaceError> {
        if D != 3 {
            return Err(SurfaceError::Dimension(D));
        }
        let vertices = vertices.iter().map(|x| Vector3::from_fn(|k, _| x[k])).collect();
        Ok(Self { mesh: Arc::new(Mesh::new(vertices, triangles)?) })
    }

    /// This surface under another name of its dimension, if `E` is 3.
    pub(crate) fn in_dimension<const E: usize>(&self) -> Option<Surface<E>> {
        (E == 3).then(|| Surface { mesh: self.mesh.clone() })
    }

    /// This surface turned and scaled about a point, x ↦ c + s R (x − c).
    pub fn moved(&self, about: &Vector<f64, D>, rotation: &Tensor<f64, D>, factor: f64) -> Self {
        let (c, r) = (space(about), Matrix3::from_fn(|i, k| rotation[(i, k)]));
        let old = &self.mesh;
        let vertices: Vec<_> = old.vertices.iter().map(|x| c + r * (x - c) * factor).collect();
        let mesh = Mesh {
            tree: Mesh::tree(&vertices, &old.triangles),
            vertices,
            triangles: old.triangles.clone(),
            neighbours: old.neighbours.clone(),
            normals: old.normals.iter().map(|n| r * n).collect(),
            at_vertices: old.at_vertices.iter().map(|n| r * n).collect(),
        };
        Self { mesh: Arc::new(mesh) }
    }
}

fn space<const D: usize>(x: &Vector<f64, D>) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < D { x[k] } else { 0.0 })
}

fn plane<const D: usize>(x: Vector3<f64>) -> Vector<f64, D> {
    Vector::from_fn(|k, _| x[k])
}

/// Whether two planes near the centre of a ball are the same in it, up to round-off.
fn same<const D: usize>(one: &Face<D>, other: &Face<D>, radius: f64) -> bool {
    (one.1 - other.1).norm() <= 1e-9 && (one.0 - other.0).abs() <= 1e-9 * radius
}

impl<const D: usize> Solid<D> for Surface<D> {
    fn nearest(&self, x: &Vector<f64, D>) -> Face<D> {
        let (distance, normal, _) = self.mesh.nearest(&space(x));
        (distance, plane(normal))
    }

    fn feature(&self, x: &Vector<f64, D>) -> Feature<D> {
        let (distance, normal, nearest) = self.mesh.nearest(&space(x));
        let face = (distance, plane(normal));
        let Some((triangle, foot)) = nearest else { return Feature::plane(x, face) };
        let corners = self.mesh.corners(triangle);
        let corner = |i: usize| plane(corners[i % 3]);
        match foot {
            Foot::Inside => Feature::plane(x, face),
            Foot::Edge(i) => {
                Feature::edge(corner(i), plane((corners[(i + 1) % 3] - corners[i]).normalize()), distance.signum())
            }
            Foot::Vertex(i) => Feature::corner(corner(i), distance.signum()),
        }
    }

    /// The planes of the triangles within `radius` of `x`, if there are few. Otherwise triangles with similar normals share one plane
    /// through their middle.
    fn add_planes(&self, x: &Vector<f64, D>, radius: f64, planes: &mut Vec<Face<D>>) -> f64 {
        let (mesh, x, reach) = (&self.mesh, space(x), Vector3::repeat(radius));
        let mut near = mesh.meeting(&Bounds(x - reach, x + reach));
        near.retain(|&i| mesh.normals[i] != Vector3::zeros() && (foot(mesh.corners(i), &x).0 - x).norm() < radius);
        let height = |i: usize, from: &Vector3<f64>| mesh.normals[i].dot(&(from - mesh.corners(i)[0]));
        let mut single: Vec<Face<D>> = Vec::new();
        for &i in &near {
            let face = (height(i, &x), plane(mesh.normals[i]));
            if single.len() <= PLANES && !single.iter().any(|other| same(other, &face, radius)) {
                single.push(face);
            }
        }
        if single.len() <= PLANES {
            planes.extend(single);
            return 0.0;
        }
        let mut departure: f64 = 0.0;
        while let Some(&first) = near.first() {
            let alike = |i: &usize| mesh.normals[*i].dot(&mesh.normals[first]) > ALIKE;
            let group: Vec<usize> = near.iter().copied().filter(alike).collect();
            near.retain(|i| !alike(i));
            let sum: Vector3<f64> = group.iter().map(|&i| mesh.normals[i]).sum();
            let Some(normal) = sum.try_normalize(0.0) else { continue };
            let corners =
                group.iter().flat_map(|&i| rows::clipped(mesh.corners(i).map(|corner| corner - x).to_vec(), &reach, 0));
            let heights: Vec<f64> = corners.map(|corner| normal.dot(&corner)).collect();
            let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
            let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            planes.push((-0.5 * (low + high), plane(normal)));
            departure = departure.max(0.5 * (high - low));
        }
        departure
    }

    fn reach(&self, n: &Vector<f64, D>) -> f64 {
        let n = space(n);
        self.mesh.vertices.iter().map(|x| n.dot(x)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The triangles, clipped to the box.
    fn facets(&self, of: &GridBox<D>, planes: &[Face<D>]) -> Option<Vec<Facet<D>>> {
        let (mesh, half, round_off) = (&self.mesh, space(&of.edges) * 0.5, of.round_off());
        let (center, reach) = (space(&of.lower) + half, half.add_scalar(round_off));
        // A corner lies in a face of this box if it does so in the box beyond, whatever round-off: no triangle is left to neither.
        let snapped = |x: f64, half: f64| if (x.abs() - half).abs() <= round_off { half.copysign(x) } else { x };
        let mut facets = Vec::new();
        for i in mesh.meeting(&Bounds(center - reach, center + reach)) {
            let corners = mesh.corners(i).map(|corner| (corner - center).zip_map(&half, snapped)).to_vec();
            // A triangle in a face of the box belongs to the box on the inner side of that triangle.
            let outside = |k: usize, sign: f64| {
                sign * mesh.normals[i][k] < 0.0 && corners.iter().all(|corner| sign * corner[k] >= half[k])
            };
            if (0..3).any(|k| outside(k, 1.0) || outside(k, -1.0)) {
                continue;
            }
            let mut polygons = vec![rows::clipped(corners, &half, 0)];
            for (distance, normal) in planes {
                let normal = space(normal);
                let halves = polygons.iter().map(|polygon| rows::split(polygon, |x| distance + normal.dot(x)));
                let halves = halves.flat_map(|(below, above)| [below, above]);
                polygons = halves.filter(|polygon| !polygon.is_empty()).collect();
            }
            for polygon in polygons {
                let fan = polygon.iter().skip(1).zip(polygon.iter().skip(2)).map(|(b, c)| [polygon[0], *b, *c]);
                for [a, b, c] in fan {
                    let area = 0.5 * (b - a).cross(&(c - a)).norm();
                    if area > 0.0 {
                        let corners = [a, b, c].map(|corner| plane(center + corner));
                        facets.push(Facet::flat(&corners, plane(mesh.normals[i]), area));
                    }
                }
            }
        }
        Some(facets)
    }

    fn row(&self, first: &GridBox<D>, count: usize) -> Option<Vec<Part<D>>> {
        let first = GridBox { lower: space(&first.lower), edges: space(&first.edges), spacing: first.spacing };
        let row = self.mesh.row(&first, count);
        Some(row.into_iter().map(|(volume, centroid)| (volume, plane(centroid))).collect())
    }
}
