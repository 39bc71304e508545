//! A tree of bounding boxes of triangles, to find the triangles near a point or a box.

use nalgebra::Vector3;

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;

/// An axis-parallel box, by its lower and its upper corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds(pub Vector3<f64>, pub Vector3<f64>);

impl Bounds {
    pub fn of(points: impl Iterator<Item = Vector3<f64>>) -> Self {
        let nothing = Self(Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        points.fold(nothing, |all, x| Self(all.0.inf(&x), all.1.sup(&x)))
    }

    fn and(self, other: Self) -> Self {
        Self(self.0.inf(&other.0), self.1.sup(&other.1))
    }

    pub fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.0[k] <= other.1[k] && other.0[k] <= self.1[k])
    }

    /// The squared distance of a point from the box, 0 inside.
    pub fn squared_distance(&self, x: &Vector3<f64>) -> f64 {
        (x - x.sup(&self.0).inf(&self.1)).norm_squared()
    }
}

/// A node: its two halves, or triangles.
#[derive(Clone, Debug, PartialEq)]
enum Node {
    Halves(Box<[(Bounds, Node); 2]>),
    Leaf(Vec<u32>),
}

/// The tree, and the bounds of each triangle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    bounds: Bounds,
    root: Node,
    triangles: Vec<Bounds>,
}

impl Tree {
    pub fn new(triangles: Vec<Bounds>) -> Self {
        let mut all: Vec<u32> = (0..triangles.len() as u32).collect();
        let (bounds, root) = grown(&mut all, &triangles);
        Self { bounds, root, triangles }
    }

    /// The bounds of a triangle.
    pub fn of(&self, triangle: usize) -> &Bounds {
        &self.triangles[triangle]
    }

    /// Visits the triangles whose bounds meet a box.
    pub fn meeting(&self, bounds: &Bounds, mut visit: impl FnMut(usize)) {
        let mut open = vec![(&self.bounds, &self.root)];
        while let Some((around, node)) = open.pop() {
            match node {
                _ if !around.meets(bounds) => {}
                Node::Halves(halves) => open.extend(halves.iter().map(|half| (&half.0, &half.1))),
                Node::Leaf(list) => {
                    list.iter().filter(|&&i| self.of(i as usize).meets(bounds)).for_each(|&i| visit(i as usize));
                }
            }
        }
    }

    /// The triangle with the smallest `squared_distance`, and the data that come with it. Among equals, the triangle with the lowest number
    /// wins.
    pub fn nearest<T>(
        &self,
        x: &Vector3<f64>,
        mut squared_distance: impl FnMut(usize) -> (f64, T),
    ) -> Option<(f64, usize, T)> {
        let mut best: Option<(f64, usize, T)> = None;
        let mut open = vec![(self.bounds.squared_distance(x), &self.root)];
        while let Some((squared, node)) = open.pop() {
            if best.as_ref().is_some_and(|best| squared > best.0) {
                continue;
            }
            match node {
                Node::Halves(halves) => {
                    let mut both = [0, 1].map(|i| (halves[i].0.squared_distance(x), &halves[i].1));
                    // The nearer half lies on top, so it is visited first.
                    both.sort_by(|a, b| b.0.total_cmp(&a.0));
                    open.extend(both);
                }
                Node::Leaf(list) => {
                    for &i in list {
                        let (squared, with) = squared_distance(i as usize);
                        let nearer = |best: &(f64, usize, T)| (squared, i as usize) < (best.0, best.1);
                        if best.as_ref().is_none_or(nearer) {
                            best = Some((squared, i as usize, with));
                        }
                    }
                }
            }
        }
        best
    }
}

/// Splits a list at the median of the centres, across the longest side of its bounds.
fn grown(list: &mut [u32], triangles: &[Bounds]) -> (Bounds, Node) {
    let of = |i: u32| triangles[i as usize];
    let bounds = list.iter().fold(Bounds::of(std::iter::empty()), |all, &i| all.and(of(i)));
    if list.len() <= LEAF {
        return (bounds, Node::Leaf(list.to_vec()));
    }
    let axis = (bounds.1 - bounds.0).imax();
    let center = |i: u32| of(i).0[axis] + of(i).1[axis];
    let middle = list.len() / 2;
    list.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
    let (left, right) = list.split_at_mut(middle);
    (bounds, Node::Halves(Box::new([grown(left, triangles), grown(right, triangles)])))
}
