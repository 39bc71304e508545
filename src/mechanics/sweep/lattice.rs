//! The nodal fields of the active nodes, and the lattice in which these fields lie side by side.

use super::connectivity::Connectivity;

/// The distance between neighbouring fields in a [lattice](Connectivity::in_lattice), in cells. It is even on coarser grids of multigrid, down to
/// one cell.
pub(crate) fn stride(cells: u32) -> u64 {
    8 * (u64::from(cells) + 1).next_power_of_two()
}

impl<const D: usize> Connectivity<D> {
    /// The number of nodal fields.
    pub(crate) fn field_count(&self) -> u32 {
        self.fields.iter().max().map_or(1, |last| last + 1)
    }

    /// The nodal field of a body.
    pub(crate) fn field_of(&self, body: u32) -> u32 {
        self.fields.get(body as usize).copied().unwrap_or(0)
    }

    /// The nodal field of an active node.
    pub(crate) fn field_of_node(&self, node: usize) -> u32 {
        if self.fields.is_empty() { 0 } else { self.grid.field(self.nodes.id(node)) }
    }

    /// The active nodes of a nodal field, by number.
    pub(crate) fn nodes_of(&self, field: u32) -> std::ops::Range<usize> {
        let before = |field: u32| self.nodes.before(u64::from(field) * self.grid.numbers_of_field());
        if self.fields.is_empty() { 0..self.nodes() } else { before(field)..before(field + 1) }
    }

    /// The index of a node or a cell of a field in a lattice in which the fields lie side by side along the last axis. They lie so far
    /// apart that functions of coarser grids reach one field only.
    pub(crate) fn in_lattice(&self, field: u32, index: [u32; D]) -> [u32; 3] {
        let shift = if field == 0 { 0 } else { field * stride(self.grid.cells[D - 1]) as u32 };
        std::array::from_fn(|k| index.get(k).map_or(0, |at| at + if k + 1 == D { shift } else { 0 }))
    }

    /// The cells of the lattice along each axis; 0 along axes that do not exist.
    pub(crate) fn lattice_cells(&self) -> [u32; 3] {
        let mut cells = std::array::from_fn(|k| self.grid.cells.get(k).copied().unwrap_or(0));
        if self.field_count() > 1 {
            cells[D - 1] = self.field_count() * stride(self.grid.cells[D - 1]) as u32;
        }
        cells
    }

    /// The indices of all active nodes in the lattice.
    pub(crate) fn lattice_nodes(&self) -> Vec<[u32; 3]> {
        self.nodes.ids().map(|id| self.in_lattice(self.grid.field(id), self.grid.index(id))).collect()
    }
}
