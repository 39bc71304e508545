//! Volume and centroid inside a closed surface, box by box along a row: exact up to round-off.
//!
//! A line along the row leaves the solid at a triangle that faces forwards, and enters the solid at a triangle that faces back. So the
//! length of the line in the solid and in [x₀, x₁] is Σ ± (clamp(x, x₀, x₁) − x₀). The volume is the integral of this length over the
//! section of the row: ∫ clamp(x) − x₀ over the projections of the triangles. Each triangle counts with the sign of its side.

use super::mesh::Mesh;
use crate::shape::bounds::Bounds;
use crate::shape::{GridBox, Part};
use nalgebra::Vector3;

/// ∫ 1, ξ, y, z over a volume, ξ from the beginning of a box, y and z from the middle of the section.
type Moments = [f64; 4];

/// A clipped triangle.
type Polygon = Vec<Vector3<f64>>;

/// Cuts a convex polygon where a linear function is 0, into a part below and a part above. A polygon in the cut is below.
pub(crate) fn split(polygon: &[Vector3<f64>], f: impl Fn(&Vector3<f64>) -> f64) -> (Polygon, Polygon) {
    let values: Vec<f64> = polygon.iter().map(f).collect();
    if values.iter().all(|&value| value <= 0.0) {
        return (polygon.to_vec(), Polygon::new());
    }
    if values.iter().all(|&value| value >= 0.0) {
        return (Polygon::new(), polygon.to_vec());
    }
    let (mut below, mut above) = (Polygon::new(), Polygon::new());
    for (i, a) in polygon.iter().enumerate() {
        let next = (i + 1) % polygon.len();
        let (here, there) = (values[i], values[next]);
        if here <= 0.0 {
            below.push(*a);
        }
        if here >= 0.0 {
            above.push(*a);
        }
        if here * there < 0.0 {
            let cut = a + (polygon[next] - a) * (here / (here - there));
            below.push(cut);
            above.push(cut);
        }
    }
    (below, above)
}

/// The part of a polygon in −r_k ≤ x_k ≤ r_k, along the axes from `first` on.
pub(crate) fn clipped(mut polygon: Polygon, r: &Vector3<f64>, first: usize) -> Polygon {
    for k in first..3 {
        polygon = split(&polygon, |x| -r[k] - x[k]).0;
        polygon = split(&polygon, |x| x[k] - r[k]).0;
    }
    polygon
}

fn add(sums: &mut Moments, other: &Moments) {
    sums.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
}

/// ∫ f, f²/2, y f, z f over the projection of a polygon along the row, for linear f.
fn integrals(polygon: &[Vector3<f64>], f: impl Fn(&Vector3<f64>) -> f64) -> Moments {
    let mut sums = [0.0; 4];
    let Some((a, rest)) = polygon.split_first() else { return sums };
    for pair in rest.windows(2) {
        let (b, c) = (&pair[0], &pair[1]);
        let twice_area = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1]);
        let corners = [a, b, c];
        let values = corners.map(&f);
        let sum: f64 = values.iter().sum();
        // ∫ f g = A/12 (Σf Σg + Σ f g) of linear f and g
        let product = |g: [f64; 3]| {
            let both: f64 = values.iter().zip(&g).map(|(f, g)| f * g).sum();
            twice_area / 24.0 * (sum * g.iter().sum::<f64>() + both)
        };
        let [of_y, of_z] = [1, 2].map(|k| product(corners.map(|x| x[k])));
        add(&mut sums, &[twice_area / 6.0 * sum, 0.5 * product(values), of_y, of_z]);
    }
    sums
}

impl Mesh {
    /// The parts of the solid in `count` equal boxes next to each other along the first axis.
    pub(crate) fn row(&self, first_box: &GridBox<3>, count: usize) -> Vec<Part<3>> {
        let GridBox { lower, edges, .. } = first_box;
        let h = edges[0];
        let middle = Vector3::new(lower[0], lower[1] + 0.5 * edges[1], lower[2] + 0.5 * edges[2]);
        let mut parts = vec![[0.0; 4]; count];
        // Integrals over the triangles in each box k. For these triangles, all boxes before k count with their whole length.
        let mut beyond = vec![[0.0; 4]; count + 1];
        let mut upper = lower + edges;
        upper[0] = f64::INFINITY;
        for triangle in self.meeting(&Bounds(*lower, upper)) {
            let mut polygon = clipped(self.corners(triangle).map(|x| x - middle).to_vec(), &(edges * 0.5), 1);
            let Some(first) = polygon.iter().map(|x| x[0]).reduce(f64::min) else { continue };
            // The cast saturates at 0.
            let mut k = ((first / h).floor() as usize).min(count);
            (_, polygon) = split(&polygon, |x| x[0]);
            while k < count && !polygon.is_empty() {
                let from = k as f64 * h;
                let (part, rest) = split(&polygon, |x| x[0] - (from + h));
                add(&mut parts[k], &integrals(&part, |x| x[0] - from));
                add(&mut beyond[k], &integrals(&part, |_| 1.0));
                polygon = rest;
                k += 1;
            }
            add(&mut beyond[count], &integrals(&polygon, |_| 1.0));
        }
        let mut ahead = [0.0; 4];
        for k in (0..count).rev() {
            add(&mut ahead, &beyond[k + 1]);
            add(&mut parts[k], &[h * ahead[0], 0.5 * h * h * ahead[0], h * ahead[2], h * ahead[3]]);
        }
        let part = |(k, [volume, x, y, z]): (usize, [f64; 4])| {
            let from = middle + Vector3::new(k as f64 * h, 0.0, 0.0);
            (volume.max(0.0), if volume > 0.0 { from + Vector3::new(x, y, z) / volume } else { from })
        };
        parts.into_iter().enumerate().map(part).collect()
    }
}
