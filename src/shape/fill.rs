//! Filling a solid with particles.

use super::layout::between_middles;
use super::{EDGE, Layout, Shape};
use crate::grid::{Grid, indices};
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest number of particle positions that [`fill`] examines for one body.
pub const MAX_CANDIDATES: f64 = 134_217_728.0; // 2²⁷

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
    /// has as many Gauss points as a whole cell. In Gauss layout, a loaded surface has two points for each side in half a cell, and three
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

/// A new particle: its position and its volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed<const D: usize> {
    /// The position x.
    pub position: Vector<f64, D>,
    /// The initial volume V₀.
    pub volume: f64,
}

/// Parts of a box smaller than this share of it are joined to their neighbour.
const SLIVER: f64 = 0.1;

/// The limit in place of [`SLIVER`] for pieces with quadrature points. Joining changes second moments, so this limit is smaller.
pub(super) const THIN: f64 = 1e-3;

/// Parts below this fraction of a box are round-off. A box that lacks no more than this fraction is full.
const NOTHING: f64 = 1e-9;

/// A shape that cannot be filled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The box around the shape holds more particle positions than [`MAX_CANDIDATES`].
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
/// The shape needs more than [`MAX_CANDIDATES`] positions (found before anything is allocated), or no particle lies in the shape.
pub fn fill<const D: usize>(grid: &Grid<D>, shape: &Shape<D>, how: Filling) -> Result<Vec<Seed<D>>, FillError> {
    let h = grid.spacing;
    let (first, count) = around(grid, shape);
    let candidates = count.iter().map(|&n| n as f64 * f64::from(how.per_axis)).product::<f64>();
    if candidates > MAX_CANDIDATES {
        return Err(FillError::TooMany { candidates });
    }
    // The points along an axis, indexed by whether the cell below is full and whether the cell above is full.
    let between = how.pieces() > 1;
    let points = [[false, false], [true, false], [false, true], [true, true]]
        .map(|goes_on| if between { between_middles(how.per_axis, goes_on) } else { how.layout.points(how.per_axis) });
    // Each piece is measured as in the loop below: neighbouring cells must agree on which of them is full.
    let size: Vector<f64, D> = Vector::repeat(h / f64::from(how.pieces()));
    let integrated = |lower: Vector<f64, D>, degree: u32| shape.quadrature(&lower, &size, h, degree, how.per_axis);
    let is_full = |cell: [u64; D]| {
        let lowers = indices([u64::from(how.pieces()); D]).map(|i| {
            let within = |k: usize| i[k] as f64 / f64::from(how.pieces());
            Vector::from_fn(|k, _| grid.origin[k] + ((first[k] + cell[k]) as f64 + within(k)) * h)
        });
        let volume = |lower: Vector<f64, D>| match integrated(lower, 0) {
            Some(points) => points.iter().map(|point| point.volume).sum(),
            None => shape.part(&lower, &size, h).0,
        };
        lowers.map(volume).all(|volume| volume >= (1.0 - NOTHING) * size.product())
    };
    let full: Vec<bool> = if between { indices(count).map(is_full).collect() } else { Vec::new() };
    // The points of a full box in a cut cell: one particle, or the Gauss points.
    let (middle, gauss) = (Layout::Regular.points(1), how.layout.points(how.per_axis));
    let edges: Vector<f64, D> = Vector::repeat(h / f64::from(how.boxes()));
    let mut filling = Seeds { seeds: Vec::new(), cells: Vec::new(), slivers: Vec::new(), count };
    let mut rows = None;
    for (id, cell) in (0..).zip(indices(count)) {
        let corner: [f64; D] = std::array::from_fn(|k| (first[k] + cell[k]) as f64);
        let position = |within: Vector<f64, D>| Vector::from_fn(|k, _| grid.origin[k] + (corner[k] + within[k]) * h);
        let lowers = |n: u32| {
            indices([u64::from(n); D]).map(move |i| position(Vector::from_fn(|k, _| i[k] as f64 / f64::from(n))))
        };
        let one = |(volume, centroid): (f64, Vector<f64, D>)| vec![Seed { position: centroid, volume }];
        if how.rule == Fill::Cut && cell[0] == 0 {
            // The boxes of a row of cells, if the shape computes them all at once.
            let along = count[0] as usize * how.boxes() as usize;
            rows = lowers(how.boxes())
                .step_by(how.boxes() as usize)
                .map(|lower| shape.row(&lower, &edges, along))
                .collect::<Option<Vec<_>>>();
        }
        let mut parts = None;
        if let Some(rows) = &rows {
            let from = cell[0] as usize * how.boxes() as usize;
            let of_cell = rows.iter().flat_map(|row| row.iter().skip(from).take(how.boxes() as usize).copied());
            let of_cell: Vec<_> = of_cell.collect();
            if of_cell.iter().all(|part| part.0 <= 0.0) {
                continue;
            }
            let boxes = of_cell.into_iter().map(one).collect();
            parts = Some(Parts { boxes, along: how.boxes(), full: &middle, sliver: SLIVER });
        } else {
            let distance = shape.signed_distance(&position(Vector::repeat(0.5)));
            let across = 0.5 * h * (D as f64).sqrt();
            let all = match how.rule {
                Fill::Cells => distance <= EDGE * h,
                Fill::Particles => true,
                Fill::Cut => distance < across,
            };
            if !all {
                continue;
            }
            if how.rule == Fill::Cut && distance > -across {
                let all = (how.layout == Layout::Gauss)
                    .then(|| lowers(how.pieces()).map(|lower| integrated(lower, how.degree)).collect());
                parts = Some(match all.flatten() {
                    Some(boxes) => Parts { boxes, along: how.pieces(), full: &gauss, sliver: THIN },
                    None => {
                        let boxes = lowers(how.boxes()).map(|lower| one(shape.part(&lower, &edges, h)));
                        Parts { boxes: boxes.collect(), along: how.boxes(), full: &middle, sliver: SLIVER }
                    }
                });
            }
        }
        if how.rule == Fill::Cut {
            filling.cells.push((id, filling.seeds.len()));
        }
        if let Some(Parts { boxes: parts, along: n, full: in_full, sliver: little }) = parts {
            let size = h / f64::from(n);
            let share = |part: &[Seed<D>]| part.iter().map(|seed| seed.volume).sum::<f64>() / size.powi(D as i32);
            if parts.iter().any(|part| share(part) < 1.0 - NOTHING) {
                for (i, part) in indices([u64::from(n); D]).zip(parts) {
                    let share = share(&part);
                    if share > 1.0 - NOTHING {
                        for j in indices([in_full.len() as u64; D]) {
                            let along: [(f64, f64); D] = std::array::from_fn(|k| in_full[j[k] as usize]);
                            let within = Vector::from_fn(|k, _| (i[k] as f64 + along[k].0) / f64::from(n));
                            let volume = along.iter().map(|(_, weight)| weight * size).product();
                            filling.seeds.push(Seed { position: position(within), volume });
                        }
                    } else if share > NOTHING {
                        filling.add_part(id, part, share < little);
                    }
                }
                continue;
            }
        }
        let goes_on = |beside: Option<u64>| beside.and_then(|id| full.get(id as usize)).is_some_and(|&full| full);
        let mut stride = 1;
        let along: [&[(f64, f64)]; D] = std::array::from_fn(|k| {
            let below = (cell[k] > 0).then(|| id - stride);
            let above = (cell[k] + 1 < count[k]).then(|| id + stride);
            stride *= count[k];
            points[usize::from(goes_on(below)) + 2 * usize::from(goes_on(above))].as_slice()
        });
        for i in indices(along.map(|points| points.len() as u64)) {
            let x = position(Vector::from_fn(|k, _| along[k][i[k] as usize].0));
            if how.rule != Fill::Particles || shape.holds(&x, h) {
                let volume = (0..D).map(|k| along[k][i[k] as usize].1 * h).product();
                filling.seeds.push(Seed { position: x, volume });
            }
        }
    }
    let seeds = filling.joined();
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

/// The parts of a cell that may be cut.
struct Parts<'a, const D: usize> {
    /// The particles in each box of the cell.
    boxes: Vec<Vec<Seed<D>>>,
    /// The number of boxes along an axis.
    along: u32,
    /// Positions and weights along an axis of a full box.
    full: &'a [(f64, f64)],
    /// A part below this fraction of a box is a sliver.
    sliver: f64,
}

/// The new particles, cell by cell.
struct Seeds<const D: usize> {
    seeds: Vec<Seed<D>>,
    /// The cells that have seeds, in order, and the first seed of each cell.
    cells: Vec<(u64, usize)>,
    /// The slivers: the cell and the number of each seed.
    slivers: Vec<(u64, usize)>,
    /// Cells along each axis.
    count: [u64; D],
}

impl<const D: usize> Seeds<D> {
    /// Adds the seeds of a part of a cell. A sliver becomes a single seed.
    fn add_part(&mut self, cell: u64, part: Vec<Seed<D>>, sliver: bool) {
        if !sliver {
            self.seeds.extend(part);
            return;
        }
        let volume = part.iter().map(|seed| seed.volume).sum();
        let moment: Vector<f64, D> = part.iter().map(|seed| seed.position * seed.volume).sum();
        self.slivers.push((cell, self.seeds.len()));
        self.seeds.push(Seed { position: moment / volume, volume });
    }

    /// Joins each sliver to the nearest seed that is not a sliver, in its cell or in a neighbouring cell. Volume and first moments are
    /// kept. The positions before any joining decide which seed is nearest, so the order of cells has no influence.
    fn joined(mut self) -> Vec<Seed<D>> {
        let mut gone = vec![false; if self.slivers.is_empty() { 0 } else { self.seeds.len() }];
        self.slivers.iter().for_each(|&(_, sliver)| gone[sliver] = true);
        let nearest = |&(cell, sliver): &(u64, usize)| {
            let far = |i: usize| (self.seeds[i].position - self.seeds[sliver].position).norm_squared();
            let near = self.beside(cell).filter(|&i| !gone[i]).min_by(|&a, &b| far(a).total_cmp(&far(b)));
            (sliver, near)
        };
        let joins: Vec<(usize, Option<usize>)> = self.slivers.iter().map(nearest).collect();
        for (sliver, near) in joins {
            let Some(near) = near else {
                gone[sliver] = false;
                continue;
            };
            let small = self.seeds[sliver];
            let Seed { position, volume } = &mut self.seeds[near];
            let sum = *volume + small.volume;
            *position = (*position * *volume + small.position * small.volume) / sum;
            *volume = sum;
        }
        let mut gone = gone.into_iter();
        self.seeds.retain(|_| !gone.next().unwrap_or(false));
        self.seeds
    }

    /// The seeds of a cell and of the cells that share a face with it.
    fn beside(&self, cell: u64) -> impl Iterator<Item = usize> {
        let (mut near, mut stride) = (vec![cell], 1);
        for &n in &self.count {
            let index = cell / stride % n;
            near.extend((index > 0).then(|| cell - stride));
            near.extend((index + 1 < n).then(|| cell + stride));
            stride *= n;
        }
        near.into_iter().flat_map(|cell| {
            let after = self.cells.partition_point(|one| one.0 < cell);
            let start = self.cells.get(after).filter(|one| one.0 == cell).map(|one| one.1);
            let end = self.cells.get(after + 1).map_or(self.seeds.len(), |one| one.1);
            start.into_iter().flat_map(move |start| start..end)
        })
    }
}
