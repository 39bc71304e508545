//! All snapshots of a run in one file: VTK's `.vtkhdf`, an unstructured grid with time steps, which ParaView and VTK read from 9.3 on.
//!
//! Format: "VTKHDF File Format", version 2.2, of the VTK documentation. Every snapshot of an array has room for the points of the largest
//! snapshot. A snapshot with the same bits as the one before, such as the mass, is not stored again.

use super::OutputError;
use super::files::write_atomically;
use super::hdf5::{Chunked, Type, Writer, is_link, whole};
use super::pvd::{self, SERIES};
use super::vtu::{Array, Snapshot, TYPES, bytes};
use std::io::{Error, Result, Seek, Write};
use std::path::{Path, PathBuf};

/// The least number of rows in a chunk. A chunk of numbers then fits into the cache of the HDF5 library, which has 1 MiB.
const CHUNK: usize = 1 << 15;

/// Writes `particles.vtkhdf` of the snapshots in the directory of a run, and a file of every other series beside it. `bodies` are the names
/// of the bodies. Returns the files written, and for each the snapshots in it and those that are missing.
///
/// # Errors
/// There are no snapshots, a snapshot is damaged or has other fields than the first, or the operating system refuses.
pub(crate) fn pack(
    directory: &Path,
    bodies: &[String],
) -> std::result::Result<Vec<(PathBuf, [usize; 2])>, OutputError> {
    let mut written = Vec::new();
    for series in SERIES {
        let (files, missing): (Vec<_>, Vec<_>) =
            pvd::listed(directory, series)?.into_iter().partition(|path| path.is_file());
        let counts = files.iter().map(|path| Ok(Snapshot::read(path)?.points.len()));
        let rows = counts.collect::<std::result::Result<Vec<_>, OutputError>>()?.into_iter().max();
        // Surfaces that may touch may have no points.
        if let Some(rows) = rows.filter(|rows| *rows > 0) {
            let path = directory.join(format!("{series}.vtkhdf"));
            write_atomically(&path, |out| write(out, rows, &files, bodies))?;
            written.push((path, [files.len(), missing.len()]));
        }
    }
    if written.is_empty() { Err(OutputError::NoSnapshots(directory.to_owned())) } else { Ok(written) }
}

/// An array at all times.
struct Column {
    name: String,
    chunks: Chunked,
    /// The row at which the values of each time begin.
    offsets: Vec<usize>,
    last: Vec<u8>,
}

impl Column {
    /// An empty column for snapshots with this number of `rows`.
    fn new(array: &Array, rows: usize) -> Self {
        let numbers = if array.is_index { Type::U32 } else { Type::F64 };
        let chunks = Chunked::new(numbers, rows * CHUNK.div_ceil(rows), array.components.len());
        Self { name: array.name.clone(), chunks, offsets: Vec::new(), last: Vec::new() }
    }

    /// The name and the bytes of a row, which all snapshots must share.
    fn kind(&self) -> (&str, usize) {
        (&self.name, self.chunks.width())
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

/// The snapshots of a series.
#[derive(Default)]
struct Series {
    /// The points of the largest snapshot.
    rows: usize,
    /// The points of a cell.
    corners: usize,
    times: Vec<f64>,
    /// The part of the grid at each time, and the points of each part. Snapshots with as many points as the one before share its part.
    parts: Vec<usize>,
    counts: Vec<usize>,
    /// The arrays; the last is the positions.
    columns: Vec<Column>,
}

impl Series {
    fn add(&mut self, file: &mut Writer<impl Write + Seek>, path: &Path) -> Result<()> {
        let Snapshot { time, points, mut arrays, corners, .. } = Snapshot::read(path).map_err(Error::other)?;
        arrays.push(Array { components: vec![String::new(); 3], ..Array::scalar("Points", points.concat(), false) });
        let columns: Vec<_> = arrays.iter().map(|array| Column::new(array, self.rows)).collect();
        if self.times.is_empty() {
            self.columns = arrays.iter().map(|array| Column::new(array, self.rows)).collect();
        }
        let is_same = columns.iter().map(Column::kind).eq(self.columns.iter().map(Column::kind));
        if !is_same || !columns.iter().all(|column| is_link(&column.name)) {
            let what = "has other fields than the first snapshot, or a name with /, which HDF5 does not allow";
            return Err(Error::other(OutputError::content(path, what)));
        }
        self.corners = corners.clamp(1, TYPES.len().min(self.rows));
        self.times.push(time);
        if self.counts.last() != Some(&points.len()) {
            self.counts.push(points.len());
        }
        self.parts.push(self.counts.len() - 1);
        self.columns.iter_mut().zip(&arrays).try_for_each(|(column, array)| column.add(file, array, self.rows))
    }
}

fn write(out: impl Write + Seek, rows: usize, snapshots: &[PathBuf], bodies: &[String]) -> Result<()> {
    let (mut file, mut series) = (Writer::new(out)?, Series { rows, ..Series::default() });
    snapshots.iter().try_for_each(|path| series.add(&mut file, path))?;
    series.columns.iter_mut().try_for_each(|column| file.flush(&mut column.chunks))?;
    let bodies = bodies.iter().map(String::as_str).enumerate().filter(|(_, name)| is_link(name)).collect::<Vec<_>>();
    let root = root(&mut file, &series, &bodies)?;
    let root = file.group(&[("VTKHDF", root)], &[])?;
    file.finish(root)
}

/// The group of a grid with time steps. The field data are the bodies with their numbers. They are no list of texts, of which VTK 9.3 takes
/// the first only.
fn root(file: &mut Writer<impl Write + Seek>, series: &Series, bodies: &[(usize, &str)]) -> Result<u64> {
    let Series { rows, corners, ref counts, ref columns, .. } = *series;
    let (cells, parts) = (rows / corners, counts.len());
    let mut topology = |numbers, rows: usize, parts: usize, bytes: &[u8]| -> Result<Chunked> {
        let mut chunks = Chunked::new(numbers, rows, 1);
        (0..parts).try_for_each(|_| file.add(&mut chunks, bytes))?;
        Ok(chunks)
    };
    // The cells of a part are the first of those of the largest snapshot.
    let connectivity = topology(Type::I64, rows, 1, &whole(0..rows))?;
    let ends = topology(Type::I64, cells + 1, parts, &whole((0..=cells).map(|cell| cell * corners)))?;
    let types = topology(Type::U8, cells, parts, &vec![TYPES[corners - 1]; cells])?;
    // Warp By Vector takes this array. The attribute is of version 2.6, and earlier readers ignore it.
    let vectors = [("Attribute", Type::Text(7), vec![], b"Vectors".to_vec())];
    let (mut data, mut numbers) = (Vec::new(), Vec::new());
    for column in columns {
        let attributes = if column.name == "displacement" { &vectors[..] } else { &[] };
        data.push((column.name.as_str(), file.chunked(&column.chunks, attributes)?));
    }
    let (_, positions) = data.pop().ok_or_else(|| Error::other("no positions"))?;
    for &(number, name) in bodies {
        numbers.push((name, file.whole(&[1], [number])?));
    }
    let extent = [parts as u64];
    let points = file.whole(&extent, counts.iter().copied())?;
    let links = [
        ("NumberOfPoints", points),
        ("NumberOfCells", file.whole(&extent, counts.iter().map(|count| count / corners))?),
        ("NumberOfConnectivityIds", points),
        ("Points", positions),
        ("Connectivity", file.chunked(&connectivity, &[])?),
        ("Offsets", file.chunked(&ends, &[])?),
        ("Types", file.chunked(&types, &[])?),
        ("PointData", file.group(&data, &[])?),
        ("FieldData", file.group(&numbers, &[])?),
        ("Steps", steps(file, series, cells, bodies)?),
    ];
    let kind = "UnstructuredGrid";
    let version = ("Version", Type::I64, vec![2], whole([2, 2]));
    file.group(&links, &[version, ("Type", Type::Text(kind.len() as u32), vec![], kind.into())])
}

/// The group of the times: for each time and array, the row at which the values begin.
fn steps(file: &mut Writer<impl Write + Seek>, series: &Series, cells: usize, bodies: &[(usize, &str)]) -> Result<u64> {
    let Series { times, parts, columns, .. } = series;
    let (count, mut offsets) = (times.len() as u64, Vec::new());
    for column in columns {
        offsets.push((column.name.as_str(), file.whole(&[count], column.offsets.iter().copied())?));
    }
    let (_, points) = offsets.pop().ok_or_else(|| Error::other("no positions"))?;
    let zeros = file.whole(&[count], vec![0; times.len()])?;
    let fields: Vec<_> = bodies.iter().map(|(_, name)| (*name, zeros)).collect();
    let links = [
        ("Values", file.values(Type::F64, &[count], &bytes(times))?),
        ("NumberOfParts", file.whole(&[count], vec![1; times.len()])?),
        ("PartOffsets", file.whole(&[count], parts.iter().copied())?),
        ("PointOffsets", points),
        // Readers add the number of earlier parts to this offset: every part has one more end than cells.
        ("CellOffsets", file.whole(&[count, 1], parts.iter().map(|part| part * cells))?),
        ("ConnectivityIdOffsets", file.whole(&[count, 1], vec![0; times.len()])?),
        ("PointDataOffsets", file.group(&offsets, &[])?),
        ("FieldDataOffsets", file.group(&fields, &[])?),
    ];
    file.group(&links, &[("NSteps", Type::I64, vec![], whole([times.len()]))])
}
