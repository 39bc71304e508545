//! Filling a solid with particles.

use super::layout::{Points, between_middles};
use super::quadrature::THIN_PART;
use super::seeds::{Seed, Seeds};
use super::{EDGE, GridBox, Layout, Part, Shape};
use crate::grid::{Grid, indices};
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest number of particle positions that [`fill`] examines for one body.
pub(crate) const MAX_CANDIDATES: f64 = 134_217_728.0; // 2²⁷

/// The treatment of particles in the cells at the surface of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Each particle has the volume and the centroid of the part of its box in the shape. So volume, mass and first moments are those of
    /// the shape. Parts of less than a tenth of a box are joined to their neighbour. In Gauss layout, the particles of a cut cell are
    /// quadrature points found by moment fitting. These points integrate products of polynomials of the shape functions' degree p over the
    /// part of the cell in the shape. For linear, cubic and LME functions (LME: p = 3), a cut cell has up to (p + 1)^D points. For
    /// quadratic functions, each half, quarter or eighth of the cell has up to (p + 1)^D points. If moment fitting finds no points, and for
    /// shapes of triangles, each particle again stands for the part of its box, with boxes of half the size. A part that is itself a box
    /// has as many Gauss points as a whole cell. In Gauss layout, a loaded surface has two points for each side in half a cell, and four
    /// in 3D.
    #[default]
    Cut,
    /// The particles that lie in the shape, each with the volume of its whole box.
    Particles,
    /// The particles of all cells whose centre lies in the shape, each with the volume of its whole box.
    Cells,
}

/// The rules by which a solid is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filling {
    /// Particles along each axis of a cell, > 0.
    pub per_axis: u32,
    /// The positions of the particles in a whole cell.
    pub layout: Layout,
    /// The treatment of particles at the surface.
    pub rule: Fill,
    /// The polynomial degree of the shape functions along an axis. In cut cells, Gauss layout integrates products of polynomials of this
    /// degree. Functions of even degree, such as quadratic B-splines, have their knots in the middle of cells. Their Gauss points are those
    /// of the pieces between the middles of cells.
    pub degree: u32,
}

impl Default for Filling {
    fn default() -> Self {
        Self { per_axis: 0, layout: Layout::default(), rule: Fill::default(), degree: 1 }
    }
}

impl Filling {
    /// The number of boxes along an axis of a cut cell. Each box has one particle.
    fn boxes(self) -> u32 {
        match self.layout {
            Layout::Regular => self.per_axis,
            Layout::Gauss => 2 * self.per_axis,
        }
    }

    /// The number of pieces along an axis of a cell. Each piece has its own Gauss rule.
    fn pieces(self) -> u32 {
        if self.layout == Layout::Gauss && self.degree.is_multiple_of(2) { 2 } else { 1 }
    }

    /// The number of boxes along an axis of a cell. A surface has its own points in each box.
    pub(crate) fn boxes_at_surface(self) -> u32 {
        match self.layout {
            Layout::Regular => self.per_axis,
            Layout::Gauss => 2,
        }
    }
}

/// Parts of a box smaller than this share of it are joined to their neighbour.
const SLIVER: f64 = 0.1;

/// Parts below this fraction of a box are round-off. A box that lacks no more than this fraction is full.
const VOLUME_ROUND_OFF: f64 = 1e-9;

/// A shape that cannot be filled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The box around the shape holds more than 2²⁷ particle positions.
    #[error(
        "the box around the shape holds {candidates:e} particle positions; at most {MAX_CANDIDATES:e} are allowed: \
         use a coarser grid or fewer particles per cell"
    )]
    TooMany {
        /// Cells of the box times particles per cell.
        candidates: f64,
    },
    /// No position lies in the shape.
    #[error(
        "none of the {candidates} particle positions of the cells around the shape lies in it: \
         it is smaller than a cell, or outside the grid"
    )]
    Empty {
        /// Number of positions examined.
        candidates: u64,
    },
}

/// Fills `shape` with particles, `per_axis` along each axis of a cell.
///
/// The grid clips the shape. Only cells that overlap the bounding box of the shape are visited. The first axis runs fastest, over the cells
/// and within a cell.
///
/// ```
/// use bfree::grid::Grid;
/// use bfree::shape::{Ball, Block, Fill, Filling, Layout, fill};
/// use bfree::tensor::Vector;
///
/// let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: 0.5, cells: [4, 4] };
/// let square = Block { min: Vector::from([0.5, 0.5]), max: Vector::from([1.5, 1.5]) }.into();
/// let regular = Filling { per_axis: 2, ..Filling::default() };
/// let seeds = fill(&grid, &square, regular)?;
/// assert_eq!((seeds.len(), seeds[0].position, seeds[0].volume), (16, Vector::from([0.625, 0.625]), 0.0625));
/// // The volume is that of the shape wherever its surface is.
/// let disc = Ball { center: Vector::from([1.0, 1.0]), radius: 0.9 }.into();
/// let volume = |rule| fill(&grid, &disc, Filling { rule, ..regular }).map(|seeds| seeds.iter().map(|seed| seed.volume).sum::<f64>());
/// let exact = std::f64::consts::PI * 0.81;
/// assert!((volume(Fill::Cut)? / exact - 1.0).abs() < 1e-3 && (volume(Fill::Particles)? / exact - 1.0).abs() > 0.05);
/// # Ok::<(), bfree::shape::FillError>(())
/// ```
///
/// # Errors
/// The shape needs more than 2²⁷ positions (found before anything is allocated), or no particle lies in the shape.
pub fn fill<const D: usize>(grid: &Grid<D>, shape: &Shape<D>, how: Filling) -> Result<Vec<Seed<D>>, FillError> {
    let (first, count) = around(grid, shape);
    let candidates = count.iter().map(|&n| n as f64 * f64::from(how.per_axis)).product::<f64>();
    if candidates > MAX_CANDIDATES {
        return Err(FillError::TooMany { candidates });
    }
    let filler = Filler::new(grid, shape, how, first, count);
    let mut seeds = Seeds::new(count);
    let mut row = None;
    for (id, cell) in (0..).zip(indices(count)) {
        if how.rule == Fill::Cut && cell[0] == 0 {
            row = filler.row(cell);
        }
        match filler.content(cell, row.as_deref()) {
            Content::Nothing => {}
            Content::Whole => filler.fill_whole(id, cell, &mut seeds),
            Content::Parts(parts) => filler.fill_parts(id, cell, parts, &mut seeds),
        }
    }
    let seeds = seeds.joined();
    if seeds.is_empty() { Err(FillError::Empty { candidates: candidates as u64 }) } else { Ok(seeds) }
}

/// The first cell around a shape, and the number of cells along each axis, clipped to the grid.
pub(crate) fn around<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> ([u64; D], [u64; D]) {
    let h = grid.spacing;
    let (min, max) = shape.bounding_box();
    let (mut first, mut count) = ([0_u64; D], [0_u64; D]);
    for k in 0..D {
        // A margin of one cell, so that round-off at a cell face loses nothing; `as` saturates at 0 and at infinity.
        let lower = ((min[k] - grid.origin[k]) / h).floor() - 1.0;
        let upper = ((max[k] - grid.origin[k]) / h).ceil() + 1.0;
        first[k] = lower.max(0.0) as u64;
        count[k] = (upper.min(f64::from(grid.cells[k])) as u64).saturating_sub(first[k]);
    }
    (first, count)
}

/// The cells around a shape, and the rules by which they are filled.
struct Filler<'a, const D: usize> {
    grid: &'a Grid<D>,
    shape: &'a Shape<D>,
    how: Filling,
    /// The first cell.
    first: [u64; D],
    /// Cells along each axis.
    count: [u64; D],
    /// The points along an axis of a whole cell. The index is 1 if the cell below is full, plus 2 if the cell above is full.
    points: [Points; 4],
    /// Whether each cell is full; empty if the points of a cell do not depend on its neighbours.
    full: Vec<bool>,
    /// The points along an axis of a box with Gauss points.
    gauss: Points,
}

/// The content of a cell.
enum Content<'a, const D: usize> {
    Nothing,
    Whole,
    Parts(Parts<'a, D>),
}

/// The parts of a cut cell.
struct Parts<'a, const D: usize> {
    /// The number of boxes along an axis.
    along: u32,
    /// The filled fraction of each box, and the particles in it.
    boxes: Vec<(f64, Vec<Seed<D>>)>,
    /// Positions and weights along an axis of a full box.
    full: &'a [(f64, f64)],
    /// A part below this fraction of a box is a sliver.
    sliver: f64,
}

impl<'a, const D: usize> Filler<'a, D> {
    fn new(grid: &'a Grid<D>, shape: &'a Shape<D>, how: Filling, first: [u64; D], count: [u64; D]) -> Self {
        let between = how.pieces() > 1;
        let gauss = how.layout.points(how.per_axis);
        let points = [[false, false], [true, false], [false, true], [true, true]]
            .map(|is_full| if between { between_middles(how.per_axis, is_full) } else { gauss.clone() });
        let mut filler = Self { grid, shape, how, first, count, points, full: Vec::new(), gauss };
        if between {
            filler.full = indices(count).map(|cell| filler.is_full(cell)).collect();
        }
        filler
    }

    /// A position in a cell, given in units of the spacing from the lower corner.
    fn position(&self, cell: [u64; D], within: Vector<f64, D>) -> Vector<f64, D> {
        let corner: [f64; D] = std::array::from_fn(|k| (self.first[k] + cell[k]) as f64);
        Vector::from_fn(|k, _| self.grid.origin[k] + (corner[k] + within[k]) * self.grid.spacing)
    }

    /// The boxes of a cell, `n` along each axis.
    fn boxes(&self, cell: [u64; D], n: u32) -> impl Iterator<Item = GridBox<D>> {
        let (spacing, n_f) = (self.grid.spacing, f64::from(n));
        indices([u64::from(n); D]).map(move |i| {
            let lower = self.position(cell, Vector::from_fn(|k, _| i[k] as f64 / n_f));
            GridBox { lower, edges: Vector::repeat(spacing / n_f), spacing }
        })
    }

    /// Whether the shape contains a cell. Each piece is measured as in [`Self::parts`]: neighbouring cells must agree on which of them is
    /// full.
    fn is_full(&self, cell: [u64; D]) -> bool {
        self.boxes(cell, self.how.pieces()).all(|piece| {
            let volume = match self.shape.quadrature(&piece, 0, self.how.per_axis) {
                Some(points) => points.iter().map(|point| point.volume).sum(),
                None => self.shape.part(&piece).0,
            };
            volume >= (1.0 - VOLUME_ROUND_OFF) * piece.edges.product()
        })
    }

    /// The parts of the boxes of a row of cells, if the shape computes them all at once. The boxes are in rows along the first axis.
    fn row(&self, first: [u64; D]) -> Option<Vec<Vec<Part<D>>>> {
        let boxes = self.how.boxes() as usize;
        let starts = self.boxes(first, self.how.boxes()).step_by(boxes);
        starts.map(|start| self.shape.solid().row(&start, self.count[0] as usize * boxes)).collect()
    }

    /// The content of a cell. `row` has the boxes of its row of cells, if the shape computes them all at once.
    fn content(&self, cell: [u64; D], row: Option<&[Vec<Part<D>>]>) -> Content<'_, D> {
        if let Some(row) = row {
            let boxes = self.how.boxes() as usize;
            let of_cell = row.iter().flat_map(|row| &row[cell[0] as usize * boxes..][..boxes]);
            let is_empty = of_cell.clone().all(|part| part.0 <= 0.0);
            return if is_empty { Content::Nothing } else { self.with_one_particle(of_cell.copied()) };
        }
        let h = self.grid.spacing;
        let distance = self.shape.signed_distance(&self.position(cell, Vector::repeat(0.5)));
        let half_diagonal = 0.5 * h * (D as f64).sqrt();
        match self.how.rule {
            Fill::Particles => Content::Whole,
            Fill::Cells if distance <= EDGE * h => Content::Whole,
            Fill::Cut if distance <= -half_diagonal => Content::Whole,
            Fill::Cut if distance < half_diagonal => self.parts(cell),
            Fill::Cells | Fill::Cut => Content::Nothing,
        }
    }

    /// The content of a cell at the surface: quadrature points in Gauss layout, if there are any, or one particle in each box.
    fn parts(&self, cell: [u64; D]) -> Content<'_, D> {
        if self.how.layout == Layout::Gauss {
            let points = |piece| self.shape.quadrature(&piece, self.how.degree, self.how.per_axis);
            let boxes: Option<Vec<_>> = self.boxes(cell, self.how.pieces()).map(points).collect();
            if let Some(boxes) = boxes {
                return self.unless_whole(self.how.pieces(), boxes.into_iter(), &self.gauss, THIN_PART);
            }
        }
        self.with_one_particle(self.boxes(cell, self.how.boxes()).map(|of| self.shape.part(&of)))
    }

    /// The content of a cell with one particle in each box.
    fn with_one_particle(&self, boxes: impl Iterator<Item = Part<D>>) -> Content<'_, D> {
        let seeds = boxes.map(|(volume, position)| vec![Seed { position, volume }]);
        self.unless_whole(self.how.boxes(), seeds, &[(0.5, 1.0)], SLIVER)
    }

    /// The parts of a cell, or a whole cell if all its boxes are full.
    fn unless_whole<'b>(
        &self,
        along: u32,
        boxes: impl Iterator<Item = Vec<Seed<D>>>,
        full: &'b [(f64, f64)],
        sliver: f64,
    ) -> Content<'b, D> {
        let box_volume = (self.grid.spacing / f64::from(along)).powi(D as i32);
        let share = |part: &[Seed<D>]| part.iter().map(|seed| seed.volume).sum::<f64>() / box_volume;
        let boxes: Vec<_> = boxes.map(|part| (share(&part), part)).collect();
        let is_cut = boxes.iter().any(|(share, _)| *share < 1.0 - VOLUME_ROUND_OFF);
        if is_cut { Content::Parts(Parts { along, boxes, full, sliver }) } else { Content::Whole }
    }

    /// Adds the particles of a whole cell.
    fn fill_whole(&self, id: u64, cell: [u64; D], seeds: &mut Seeds<D>) {
        seeds.begin_cell(id);
        let is_full = |beside: Option<u64>| beside.and_then(|id| self.full.get(id as usize)).is_some_and(|&full| full);
        let mut stride = 1;
        let along = std::array::from_fn(|k| {
            let below = (cell[k] > 0).then(|| id - stride);
            let above = (cell[k] + 1 < self.count[k]).then(|| id + stride);
            stride *= self.count[k];
            self.points[usize::from(is_full(below)) + 2 * usize::from(is_full(above))].as_slice()
        });
        self.fill_box(cell, [0; D], 1, along, seeds);
    }

    /// Adds the particles of a cut cell.
    fn fill_parts(&self, id: u64, cell: [u64; D], parts: Parts<'_, D>, seeds: &mut Seeds<D>) {
        seeds.begin_cell(id);
        for (i, (share, part)) in indices([u64::from(parts.along); D]).zip(parts.boxes) {
            if share > 1.0 - VOLUME_ROUND_OFF {
                self.fill_box(cell, i, parts.along, [parts.full; D], seeds);
            } else if share > VOLUME_ROUND_OFF {
                mutant!("solids: slivers are left alone": { seeds.add_part(id, part, false); continue; });
                seeds.add_part(id, part, share < parts.sliver);
            }
        }
    }

    /// Adds the particles of box `i` of a cell with `n` boxes along each axis, at the points of a rule along each axis.
    fn fill_box(&self, cell: [u64; D], i: [u64; D], n: u32, rules: [&[(f64, f64)]; D], seeds: &mut Seeds<D>) {
        let (h, n) = (self.grid.spacing, f64::from(n));
        for j in indices(rules.map(|points| points.len() as u64)) {
            let along: [(f64, f64); D] = std::array::from_fn(|k| rules[k][j[k] as usize]);
            let position = self.position(cell, Vector::from_fn(|k, _| (i[k] as f64 + along[k].0) / n));
            if self.how.rule != Fill::Particles || self.shape.holds(&position, h) {
                seeds.add(Seed { position, volume: along.iter().map(|(_, weight)| weight * (h / n)).product() });
            }
        }
    }
}
