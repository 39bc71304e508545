//! A tree of bounding boxes of triangles, to find the triangles near a point or a box.

use crate::shape::bounds::Bounds;
use nalgebra::Vector3;

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;

/// A node: two halves, or a leaf of triangles.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    bounds: Bounds<3>,
    halves: Vec<Node>,
    triangles: Vec<u32>,
}

/// The tree, and the bounds of each triangle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    root: Node,
    triangles: Vec<Bounds<3>>,
}

impl Tree {
    pub(crate) fn new(triangles: Vec<Bounds<3>>) -> Self {
        let mut all: Vec<u32> = (0..triangles.len() as u32).collect();
        Self { root: Node::new(&mut all, &triangles), triangles }
    }

    /// The bounds of a triangle.
    pub(crate) fn of(&self, triangle: usize) -> &Bounds<3> {
        &self.triangles[triangle]
    }

    /// Visits the triangles whose bounds meet a box.
    pub(crate) fn meeting(&self, bounds: &Bounds<3>, mut visit: impl FnMut(usize)) {
        let mut open = vec![&self.root];
        while let Some(node) = open.pop() {
            if node.bounds.meets(bounds) {
                open.extend(&node.halves);
                let triangles = node.triangles.iter().map(|&i| i as usize);
                triangles.filter(|&i| self.of(i).meets(bounds)).for_each(&mut visit);
            }
        }
    }

    /// The triangle with the smallest `squared_distance`, and the data that come with it. Among equals, the triangle with the lowest number
    /// wins.
    pub(crate) fn nearest<T>(
        &self,
        x: &Vector3<f64>,
        mut squared_distance: impl FnMut(usize) -> (f64, T),
    ) -> Option<(f64, usize, T)> {
        let mut best: Option<(f64, usize, T)> = None;
        let mut open = vec![(self.root.bounds.squared_distance(x), &self.root)];
        while let Some((squared, node)) = open.pop() {
            if best.as_ref().is_some_and(|best| squared > best.0) {
                continue;
            }
            let first_half = open.len();
            open.extend(node.halves.iter().map(|half| (half.bounds.squared_distance(x), half)));
            // The nearer half lies on top, so it is visited first.
            open[first_half..].sort_by(|a, b| b.0.total_cmp(&a.0));
            for i in node.triangles.iter().map(|&i| i as usize) {
                let (squared, with) = squared_distance(i);
                if best.as_ref().is_none_or(|best| (squared, i) < (best.0, best.1)) {
                    best = Some((squared, i, with));
                }
            }
        }
        best
    }
}

impl Node {
    /// The tree of a list, split at the median of the centres, across the longest side of its bounds.
    fn new(list: &mut [u32], triangles: &[Bounds<3>]) -> Self {
        let of = |i: u32| triangles[i as usize];
        let bounds = Bounds::around(list.iter().map(|&i| of(i)));
        if list.len() <= LEAF {
            return Self { bounds, halves: Vec::new(), triangles: list.to_vec() };
        }
        let axis = (bounds.1 - bounds.0).imax();
        let center = |i: u32| of(i).0[axis] + of(i).1[axis];
        let middle = list.len() / 2;
        list.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
        let (left, right) = list.split_at_mut(middle);
        Self { bounds, halves: vec![Self::new(left, triangles), Self::new(right, triangles)], triangles: Vec::new() }
    }
}
