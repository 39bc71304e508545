//! The tangent as a sparse matrix, factorised by faer. It is for systems so small that the factor costs less than the iterations it saves.
//!
//! One product with the tangent gives the columns of all nodes of one colour, which share no row. About (2r + 1)^D D products give all
//! entries, with r the reach of a node. The entries contain every term of the product, with the accuracy of the product.

use super::{BlockJacobi, Neighbours, Preconditioner};
use crate::solver::{LinearOperator, Linearization};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use std::collections::{HashMap, HashSet};

/// One thread, so that the order of sums does not depend on the number of threads.
const PAR: Par = Par::Seq;

/// K⁻¹ = L⁻ᵀ L⁻¹ of the first tangent it is prepared with. Of an unsymmetric tangent only the lower half is used, and mirrored.
///
/// ```
/// use bfree::pooled::Pooled;
/// use bfree::solver::{Direct, LinearOperator, Linearization, Neighbours, Preconditioner};
///
/// /// −u″ on a line of nodes, h = 1, with u = 0 beyond both ends.
/// struct Laplacian(usize);
///
/// impl LinearOperator for Laplacian {
///     fn apply(&self, x: &[f64], y: &mut [f64]) {
///         let at = |i: Option<usize>| i.and_then(|i| x.get(i)).copied().unwrap_or(0.0);
///         (0..x.len()).for_each(|i| y[i] = 2.0 * x[i] - at(i.checked_sub(1)) - at(Some(i + 1)));
///     }
/// }
///
/// impl Linearization for Laplacian {
///     fn diagonal_blocks(&self) -> Pooled<f64> {
///         vec![2.0; self.0].into()
///     }
///
///     fn neighbours(&self) -> Option<Neighbours> {
///         let nodes = (0..self.0 as u32).map(|i| [i, 0, 0]).collect();
///         Some(Neighbours { nodes, reach: 1, leaders: Vec::new(), fixed: vec![false; self.0] })
///     }
/// }
///
/// // A load of one on every node gives u = i (n + 1 − i)/2.
/// let (laplacian, mut direct, mut u) = (Laplacian(1000), Direct::<1>::default(), vec![0.0; 1000]);
/// direct.prepare(&laplacian).apply(&vec![1.0; 1000], &mut u);
/// assert!(u.iter().zip(1..).all(|(u, i)| (u - 0.5 * f64::from(i * (1001 - i))).abs() < 1e-6));
/// ```
#[derive(Debug, Default)]
pub struct Direct<const D: usize> {
    factors: Option<Factors>,
    /// Block-Jacobi, for a tangent that is not positive definite or has no known sparsity pattern.
    blocks: BlockJacobi<D>,
}

/// L of K = L Lᵀ, with rows and columns in a fill-reducing order.
#[derive(Debug)]
struct Factors {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

/// The lower half of the tangent: the rows and values of each column.
fn lower<const D: usize>(tangent: &dyn LinearOperator, neighbours: &Neighbours) -> Vec<Vec<(usize, f64)>> {
    let Neighbours { nodes, fixed, .. } = neighbours;
    let sharing = sharing::<D>(neighbours);
    let size = D * nodes.len();
    let (mut columns, mut x, mut y) = (vec![Vec::new(); size], vec![0.0; size], vec![0.0; size]);
    for colour in colours(&sharing) {
        for k in 0..D {
            x.fill(0.0);
            colour.iter().filter(|&node| !fixed[node * D + k]).for_each(|node| x[node * D + k] = 1.0);
            tangent.apply(&x, &mut y);
            for (column, around) in colour.iter().map(|node| (node * D + k, &sharing[*node])) {
                let rows = around.iter().flat_map(|node| node * D..(node + 1) * D).filter(|&row| row >= column);
                // A zero on the diagonal belongs to a fixed value, which gets the identity's row.
                let value = |row: usize| if row == column && y[row] == 0.0 { 1.0 } else { y[row] };
                columns[column].extend(rows.map(|row| (row, value(row))).filter(|&(_, value)| value != 0.0));
            }
        }
    }
    columns
}

impl Factors {
    /// The Cholesky factor of the matrix with this lower half; `None` if the matrix is not positive definite.
    fn new(columns: &[Vec<(usize, f64)>]) -> Option<Self> {
        let (rows, entries): (Vec<usize>, Vec<f64>) = columns.iter().flatten().copied().unzip();
        let mut starts = vec![0];
        starts.extend(columns.iter().scan(0, |end, column| {
            *end += column.len();
            Some(*end)
        }));
        let pattern = SymbolicSparseColMatRef::new_checked(columns.len(), columns.len(), &starts, None, &rows);
        let order = SymmetricOrdering::Amd;
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, order, Default::default()).ok()?;
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(PAR, Default::default());
        let (mut values, mut memory) = (vec![0.0; symbolic.len_val()], MemBuffer::try_new(scratch).ok()?);
        let (matrix, memory) = (SparseColMatRef::new(pattern, &entries), MemStack::new(&mut memory));
        let (shift, settings) = (Default::default(), Default::default());
        symbolic.factorize_numeric_llt(&mut values, matrix, Side::Lower, shift, PAR, memory, settings).ok()?;
        Some(Self { symbolic, values })
    }
}

/// The nodes with which each node may share an entry, ascending. They are the nodes within reach of the node and of its followers, and the
/// nodes that these nodes follow.
fn sharing<const D: usize>(neighbours: &Neighbours) -> Vec<Vec<usize>> {
    let Neighbours { nodes, reach, leaders, .. } = neighbours;
    let numbers: HashMap<[u32; 3], usize> = nodes.iter().enumerate().map(|(number, &at)| (at, number)).collect();
    let mut sharing: Vec<Vec<usize>> = nodes.iter().map(|&at| around::<D>(at, *reach, &numbers)).collect();
    let direct = sharing.clone();
    for (outer, of_outer) in leaders.iter().enumerate() {
        of_outer.iter().for_each(|&leader| sharing[leader].extend(&direct[outer]));
    }
    for around in &mut sharing {
        let followed: Vec<usize> = around.iter().filter_map(|&node| leaders.get(node)).flatten().copied().collect();
        around.extend(followed);
        around.sort_unstable();
        around.dedup();
    }
    sharing
}

/// The nodes of each colour. Two nodes of one colour share no row.
fn colours(sharing: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut colours: Vec<Vec<usize>> = Vec::new();
    let mut of_row = vec![HashSet::new(); sharing.len()];
    for (node, rows) in sharing.iter().enumerate() {
        let free = |colour: &usize| rows.iter().all(|&row| !of_row[row].contains(colour));
        let colour = (0..colours.len()).find(free).unwrap_or(colours.len());
        if colour == colours.len() {
            colours.push(Vec::new());
        }
        colours[colour].push(node);
        rows.iter().for_each(|&row| _ = of_row[row].insert(colour));
    }
    colours
}

/// The nodes within reach of a place.
fn around<const D: usize>(at: [u32; 3], reach: u32, numbers: &HashMap<[u32; 3], usize>) -> Vec<usize> {
    let range = |k: usize| if k < D { at[k].saturating_sub(reach)..=at[k] + reach } else { at[k]..=at[k] };
    let all = range(2).flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
    all.filter_map(|at| numbers.get(&at).copied()).collect()
}

impl LinearOperator for Factors {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, PAR));
        let memory = MemStack::new(&mut memory);
        let right = MatMut::from_column_major_slice_mut(z, r.len(), 1);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, right, PAR, memory);
    }
}

impl<const D: usize> Direct<D> {
    /// Bytes of the factor; `None` if there is none.
    pub fn bytes(&self) -> Option<usize> {
        self.factors.as_ref().map(|factors| size_of_val(factors.values.as_slice()))
    }
}

impl<const D: usize> Preconditioner for Direct<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        if self.factors.is_none() && self.blocks.len() == 0 {
            let columns = tangent.neighbours().map(|neighbours| lower::<D>(tangent, &neighbours));
            self.factors = columns.and_then(|columns| Factors::new(&columns));
            if self.factors.is_none() {
                self.blocks.take(tangent);
            }
        }
        match &self.factors {
            Some(factors) => Box::new(factors),
            None => Box::new(&self.blocks),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pooled::Pooled;
    use crate::solver::direct_bytes;
    use crate::solver::testing::{Dense, distance, irregular};
    use crate::tensor::{Tensor, Vector};

    /// Nodes on a square lattice. Each node pulls at its neighbours in both components and sits on a spring. The first node is fixed.
    struct Net {
        side: u32,
        spring: f64,
    }

    impl Net {
        fn neighbours(&self) -> Neighbours {
            let nodes: Vec<_> = (0..self.side.pow(2)).map(|i| [i % self.side + 3, i / self.side, 0]).collect();
            let fixed = (0..2 * nodes.len()).map(|unknown| unknown < 2).collect();
            Neighbours { nodes, reach: 1, leaders: Vec::new(), fixed }
        }

        fn block(&self) -> Tensor<f64, 2> {
            Tensor::<f64, 2>::new(8.0 + self.spring, 0.5, 0.5, 9.0 + self.spring)
        }
    }

    impl LinearOperator for Net {
        fn apply(&self, x: &[f64], y: &mut [f64]) {
            let Neighbours { nodes, .. } = self.neighbours();
            let (x, y): (&[Vector<f64, 2>], &mut [Vector<f64, 2>]) =
                (bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
            for (i, y) in y.iter_mut().enumerate() {
                let beside = |j: &usize| *j != i && (0..2).all(|k| nodes[i][k].abs_diff(nodes[*j][k]) <= 1);
                let others: Vector<f64, 2> = (0..nodes.len()).filter(beside).map(|j| x[j]).sum();
                *y = self.block() * x[i] - others;
            }
            y[0].fill(0.0);
        }
    }

    impl Linearization for Net {
        fn diagonal_blocks(&self) -> Pooled<f64> {
            Pooled::from(vec![self.block(); self.side.pow(2) as usize]).into_numbers()
        }

        fn neighbours(&self) -> Option<Neighbours> {
            Some(self.neighbours())
        }
    }

    #[test]
    fn every_entry_is_found_and_what_is_prescribed_left_alone() {
        let net = Net { side: 12, spring: 0.1 };
        let mut r = irregular(2 * 144);
        r[..2].fill(0.0);
        let (mut direct, mut z, mut back) = (Direct::<2>::default(), vec![0.0; r.len()], vec![0.0; r.len()]);
        direct.prepare(&net).apply(&r, &mut z);
        net.apply(&z, &mut back);
        assert!(z[..2] == [0.0; 2] && distance(&back, &r) < 1e-13, "{}", distance(&back, &r));
        let (held, planned) = (direct.bytes().unwrap(), direct_bytes(144, 2, 1));
        assert!((held..20 * held).contains(&planned), "{planned} for {held}");
    }

    #[test]
    fn the_factor_of_the_first_tangent_is_kept() {
        let (first, second) = (Net { side: 5, spring: 0.1 }, Net { side: 5, spring: 10.0 });
        let (r, mut direct, mut z, mut again) = (irregular(50), Direct::<2>::default(), vec![0.0; 50], vec![0.0; 50]);
        direct.prepare(&first).apply(&r, &mut z);
        direct.prepare(&second).apply(&r, &mut again);
        assert_eq!(z, again);
    }

    #[test]
    fn diagonal_blocks_stand_in_where_there_is_no_factor() {
        // One operator is not definite, the other has no known sparsity pattern.
        let (net, dense) = (Net { side: 5, spring: -7.0 }, Dense::from_fn(3, |i, k| if i == k { 4.0 } else { 0.0 }));
        let (mut direct, mut z) = (Direct::<2>::default(), vec![0.0; 50]);
        direct.prepare(&net).apply(&vec![1.0; 50], &mut z);
        assert!(direct.bytes().is_none() && (net.block() * Vector::from([z[8], z[9]])).add_scalar(-1.0).norm() < 1e-14);
        let (mut direct, mut z) = (Direct::<1>::default(), [0.0; 3]);
        direct.prepare(&dense).apply(&[1.0; 3], &mut z);
        assert_eq!(z, [0.25; 3]);
    }
}
