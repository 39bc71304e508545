//! All snapshots of a run in one file: VTK's `.vtkhdf`, an unstructured grid with time steps, which ParaView and VTK read from 9.3 on.
//!
//! Format: "VTKHDF File Format", version 2.2, of the VTK documentation. Every snapshot of an array has room for the points of the largest
//! snapshot. A snapshot with the same bits as the one before, such as the mass, is not stored again.

use super::OutputError;
use super::files::write_atomically;
use super::hdf5::{Attribute, Chunked, Type, Writer, whole};
use super::pvd::{self, SERIES};
use super::vtu::{Array, Background, Snapshot, TYPES, bytes};
use std::io::{Error, Result, Seek, Write};
use std::path::{Path, PathBuf};

/// The least number of rows in a chunk. A chunk of numbers then fits into the cache of the HDF5 library, which has 1 MiB.
const CHUNK: usize = 1 << 15;

/// Writes `particles.vtkhdf` of the snapshots in the directory of a run, and a file of every other series beside it. `bodies` are the names
/// of the bodies. Returns the files written, and the number of snapshots in each.
///
/// ```
/// use bfree::output::{OutputError, pack};
///
/// let folder = tempfile::tempdir()?;
/// assert!(matches!(pack(folder.path(), &[]), Err(OutputError::NoSnapshots(_))));
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// There are no snapshots, a snapshot is damaged or has other fields than the first, or the operating system refuses.
pub fn pack(directory: &Path, bodies: &[String]) -> std::result::Result<Vec<(PathBuf, usize)>, OutputError> {
    let mut written = Vec::new();
    for series in SERIES {
        let files = pvd::files(directory, series)?;
        let counts = files.iter().map(|path| Ok(Snapshot::read(path)?.points.len()));
        let rows = counts.collect::<std::result::Result<Vec<_>, OutputError>>()?.into_iter().max();
        // Surfaces that may touch may have no points.
        if let Some(rows) = rows.filter(|rows| *rows > 0) {
            let path = directory.join(format!("{series}.vtkhdf"));
            write_atomically(&path, |out| write(out, rows, &files, bodies))?;
            written.push((path, files.len()));
        }
    }
    if written.is_empty() { Err(OutputError::NoSnapshots(directory.to_owned())) } else { Ok(written) }
}

/// An array at all times.
struct Column {
    name: String,
    chunks: Chunked,
    /// The rows before its values at each time.
    offsets: Vec<usize>,
    last: Vec<u8>,
}

impl Column {
    /// A column for snapshots of so many `rows`.
    fn of(array: &Array, rows: usize) -> Self {
        let numbers = if array.is_index { Type::U32 } else { Type::F64 };
        let chunks = Chunked::new(numbers, rows * CHUNK.div_ceil(rows), array.components.len());
        Self { name: array.name.clone(), chunks, offsets: Vec::new(), last: Vec::new() }
    }

    fn add(&mut self, file: &mut Writer<impl Write + Seek>, array: &Array, rows: usize) -> Result<()> {
        let mut bytes = array.bytes();
        bytes.resize(rows * self.chunks.width(), 0);
        let before = self.offsets.last();
        let offset = before.map_or(0, |before| if bytes == self.last { *before } else { before + rows });
        if before != Some(&offset) {
            file.add(&mut self.chunks, &bytes)?;
            self.last = bytes;
        }
        self.offsets.push(offset);
        Ok(())
    }
}

fn write(out: impl Write + Seek, rows: usize, snapshots: &[PathBuf], bodies: &[String]) -> Result<()> {
    let mut file = Writer::new(out)?;
    let (mut columns, mut times, mut parts, mut last) = (Vec::new(), Vec::new(), Parts::default(), None);
    for path in snapshots {
        let Snapshot { time, background, points, mut arrays, corners } = Snapshot::read(path).map_err(Error::other)?;
        // The last array is the positions.
        arrays.push(Array { components: vec![String::new(); 3], ..Array::scalar("Points", points.concat(), false) });
        if times.is_empty() {
            columns = arrays.iter().map(|array| Column::of(array, rows)).collect::<Vec<_>>();
        }
        let is_same = |(column, array): (&Column, &Array)| {
            let width = Column::of(array, rows).chunks.width();
            column.name == array.name && column.chunks.width() == width && !array.name.contains('/')
        };
        if columns.len() != arrays.len() || !columns.iter().zip(&arrays).all(is_same) {
            let what =
                "has other fields than the first snapshot, or one with a / in its name, which HDF5 does not allow";
            return Err(Error::other(OutputError::content(path, what)));
        }
        times.push(time);
        parts.add(points.len());
        for (column, array) in columns.iter_mut().zip(&arrays) {
            column.add(&mut file, array, rows)?;
        }
        last = Some((background, corners.clamp(1, TYPES.len().min(rows))));
    }
    let (background, corners) = last.ok_or_else(|| Error::other("there is no snapshot"))?;
    let fields = field_data(&mut file, background, bodies)?;
    columns.iter_mut().try_for_each(|column| file.flush(&mut column.chunks))?;
    let root = root(&mut file, [rows, corners], (&times, &parts), &columns, &fields)?;
    let root = file.group(&[("VTKHDF", root)], &[])?;
    file.finish(root)
}

/// The numbers of points at all times. Times with the same number share a part of the grid.
#[derive(Default)]
struct Parts {
    counts: Vec<usize>,
    /// The part of each time.
    of_times: Vec<usize>,
}

impl Parts {
    fn add(&mut self, count: usize) {
        if self.counts.last() != Some(&count) {
            self.counts.push(count);
        }
        self.of_times.push(self.counts.len() - 1);
    }
}

/// The group of a grid with time steps. The cells of a part are the first of those of `rows` points, with so many `corners` each.
fn root(
    file: &mut Writer<impl Write + Seek>,
    [rows, corners]: [usize; 2],
    (times, parts): (&[f64], &Parts),
    columns: &[Column],
    fields: &[Field],
) -> Result<u64> {
    let cells = rows / corners;
    let count = parts.counts.len();
    let mut topology = |numbers, rows: usize, count: usize, bytes: &[u8]| -> Result<Chunked> {
        let mut chunks = Chunked::new(numbers, rows, 1);
        (0..count).try_for_each(|_| file.add(&mut chunks, bytes))?;
        Ok(chunks)
    };
    let connectivity = topology(Type::I64, rows, 1, &whole(0..rows))?;
    // Readers take the ends of a part's cells, one more than cells, from where the cells begin, plus the number of the part.
    let ends = topology(Type::I64, cells + 1, count, &whole((0..=cells).map(|cell| cell * corners)))?;
    let types = topology(Type::U8, cells, count, &vec![TYPES[corners - 1]; cells])?;
    // Warp By Vector takes this array. The attribute is of version 2.6, and earlier readers ignore it.
    let vectors = [Attribute { name: "Attribute", numbers: Type::Text(7), dims: &[], bytes: b"Vectors".to_vec() }];
    let mut data = Vec::new();
    for column in columns {
        let attributes = if column.name == "displacement" { &vectors[..] } else { &[] };
        data.push((column.name.as_str(), file.chunked(&column.chunks, attributes)?));
    }
    let (_, positions) = data.pop().ok_or_else(|| Error::other("no points"))?;
    let mut numbers = |divisor: usize| {
        file.whole(Type::I64, &[count as u64], &whole(parts.counts.iter().map(|count| count / divisor)))
    };
    let (points, cell_counts) = (numbers(1)?, numbers(corners)?);
    let steps = steps(file, times, (&parts.of_times, cells), columns, fields)?;
    let links = [
        ("NumberOfPoints", points),
        ("NumberOfCells", cell_counts),
        ("NumberOfConnectivityIds", points),
        ("Points", positions),
        ("Connectivity", file.chunked(&connectivity, &[])?),
        ("Offsets", file.chunked(&ends, &[])?),
        ("Types", file.chunked(&types, &[])?),
        ("PointData", file.group(&data, &[])?),
        ("FieldData", file.group(&fields.iter().map(|&(name, _, field)| (name, field)).collect::<Vec<_>>(), &[])?),
        ("Steps", steps),
    ];
    let kind = "UnstructuredGrid";
    let attributes = [
        Attribute { name: "Version", numbers: Type::I64, dims: &[2], bytes: whole([2, 2]) },
        Attribute { name: "Type", numbers: Type::Text(kind.len() as u32), dims: &[], bytes: kind.into() },
    ];
    file.group(&links, &attributes)
}

/// An array that is the same at all times: its name, its length and its address.
type Field = (&'static str, usize, u64);

/// What is the same at all times: the background grid, as in a `.vtu`, and the names of the bodies.
fn field_data(file: &mut Writer<impl Write + Seek>, background: Background, bodies: &[String]) -> Result<Vec<Field>> {
    let Background { dimension, origin, spacing, cells } = background;
    let u32s = |numbers: &[u32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut fields = vec![
        ("grid_dimension", 1, file.whole(Type::U32, &[1], &u32s(&[dimension]))?),
        ("grid_origin", 3, file.whole(Type::F64, &[3], &bytes(&origin))?),
        ("grid_spacing", 1, file.whole(Type::F64, &[1], &bytes(&[spacing]))?),
        ("grid_cells", 3, file.whole(Type::U32, &[3], &u32s(&cells))?),
    ];
    if !bodies.is_empty() {
        fields.push(("body_names", bodies.len(), file.texts(bodies)?));
    }
    Ok(fields)
}

/// The group of the times: for each time and array, the row at which the values begin.
fn steps(
    file: &mut Writer<impl Write + Seek>,
    times: &[f64],
    (parts, cells): (&[usize], usize),
    columns: &[Column],
    fields: &[Field],
) -> Result<u64> {
    let count = times.len() as u64;
    let none = whole(times.iter().map(|_| 0));
    let (zeros, zero_rows) = (file.whole(Type::I64, &[count], &none)?, file.whole(Type::I64, &[count, 1], &none)?);
    let ones = file.whole(Type::I64, &[count], &whole(times.iter().map(|_| 1)))?;
    let (mut starts, mut sizes) = (Vec::new(), Vec::new());
    for &(name, length, _) in fields {
        // One component, and so many values.
        sizes.push((name, file.whole(Type::I64, &[count, 2], &whole(times.iter().flat_map(|_| [1, length])))?));
        starts.push((name, zeros));
    }
    let mut offsets = Vec::new();
    for column in columns {
        offsets.push((column.name.as_str(), file.whole(Type::I64, &[count], &whole(column.offsets.iter().copied()))?));
    }
    let (_, points) = offsets.pop().ok_or_else(|| Error::other("no points"))?;
    let links = [
        ("Values", file.whole(Type::F64, &[count], &bytes(times))?),
        ("NumberOfParts", ones),
        ("PartOffsets", file.whole(Type::I64, &[count], &whole(parts.iter().copied()))?),
        ("PointOffsets", points),
        ("CellOffsets", file.whole(Type::I64, &[count, 1], &whole(parts.iter().map(|part| part * cells)))?),
        ("ConnectivityIdOffsets", zero_rows),
        ("PointDataOffsets", file.group(&offsets, &[])?),
        ("FieldDataOffsets", file.group(&starts, &[])?),
        ("FieldDataSizes", file.group(&sizes, &[])?),
    ];
    let bytes = whole([times.len()]);
    file.group(&links, &[Attribute { name: "NSteps", numbers: Type::I64, dims: &[], bytes }])
}
