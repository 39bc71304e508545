//! The nodes of a particle.

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
