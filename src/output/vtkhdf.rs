//! All snapshots of a run in one file: VTK's `.vtkhdf`, an unstructured grid with time steps, which ParaView and VTK read from 9.3 on.
//!
//! Format: "VTKHDF File Format", version 2.2, of the VTK documentation. Every snapshot of an array is one chunk. A snapshot with the same bits
//! as the one before, such as the mass, is not stored again.

use super::OutputError;
use super::files::write_atomically;
use super::hdf5::{Attribute, Chunked, Type, Writer, whole};
use super::pvd::{self, SERIES};
use super::vtu::{Array, Background, Snapshot, TYPES, bytes};
use std::io::{Error, Result, Seek, Write};
use std::path::{Path, PathBuf};

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
/// There are no snapshots, a snapshot is damaged or has other points or fields than the first, or the operating system refuses.
pub fn pack(directory: &Path, bodies: &[String]) -> std::result::Result<Vec<(PathBuf, usize)>, OutputError> {
    let mut written = Vec::new();
    for series in SERIES {
        let files = pvd::files(directory, series)?;
        let first = files.first().map(|path| Snapshot::read(path)).transpose()?;
        if let Some(first) = first.filter(|first| !first.points.is_empty()) {
            let path = directory.join(format!("{series}.vtkhdf"));
            write_atomically(&path, |out| write(out, &first, &files, bodies))?;
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
    fn of(array: &Array, rows: usize) -> Self {
        let shape = [rows, array.components.len()].into_iter().take(array.components.len().min(2));
        let numbers = if array.is_index { Type::U32 } else { Type::F64 };
        let chunks = Chunked::new(numbers, shape.map(|extent| extent as u64).collect());
        Self { name: array.name.clone(), chunks, offsets: Vec::new(), last: Vec::new() }
    }

    fn add(&mut self, file: &mut Writer<impl Write + Seek>, bytes: Vec<u8>, rows: usize) -> Result<()> {
        if self.chunks.len() == 0 || bytes != self.last {
            file.add(&mut self.chunks, &bytes)?;
            self.last = bytes;
        }
        self.offsets.push((self.chunks.len() - 1) * rows);
        Ok(())
    }
}

/// The arrays of a snapshot; the last is the positions.
fn arrays(snapshot: &Snapshot) -> Vec<Array> {
    let points = Array::scalar("Points", snapshot.points.concat(), false);
    snapshot.arrays.iter().cloned().chain([Array { components: vec![String::new(); 3], ..points }]).collect()
}

fn write(out: impl Write + Seek, first: &Snapshot, snapshots: &[PathBuf], bodies: &[String]) -> Result<()> {
    let rows = first.points.len();
    let (mut file, mut times) = (Writer::new(out)?, Vec::new());
    let mut columns: Vec<Column> = arrays(first).iter().map(|array| Column::of(array, rows)).collect();
    if let Some(wrong) = columns.iter().find(|column| column.name.contains('/')) {
        return Err(Error::other(format!("HDF5 allows no / in a name, and a field is called {:?}", wrong.name)));
    }
    for path in snapshots {
        let snapshot = Snapshot::read(path).map_err(Error::other)?;
        let arrays = arrays(&snapshot);
        let names = columns.iter().map(|column| &column.name);
        let is_same = snapshot.corners == first.corners && snapshot.points.len() == rows;
        if !is_same || !names.eq(arrays.iter().map(|array| &array.name)) {
            let what = "has other points or fields than the first snapshot, and one file has the same at all times";
            return Err(Error::other(OutputError::content(path, what)));
        }
        times.push(snapshot.time);
        for (column, array) in columns.iter_mut().zip(&arrays) {
            column.add(&mut file, array.bytes(), rows)?;
        }
    }
    let root = root(&mut file, first, &times, &columns, bodies)?;
    let root = file.group(&[("VTKHDF", root)], &[])?;
    file.finish(root)
}

/// The group of a grid with time steps. All cells are there at all times.
fn root(
    file: &mut Writer<impl Write + Seek>,
    first: &Snapshot,
    times: &[f64],
    columns: &[Column],
    bodies: &[String],
) -> Result<u64> {
    let (points, corners) = (first.points.len(), first.corners.clamp(1, TYPES.len()));
    let cells = points / corners;
    let mut data = Vec::new();
    for column in columns {
        // With these, Warp By Vector and arrows take the displacement.
        let vectors = b"Vectors".to_vec();
        let vectors = Attribute { name: "Attribute", numbers: Type::Text(7), dims: &[], bytes: vectors };
        let attributes = if column.name == "displacement" { &[vectors][..] } else { &[] };
        data.push((column.name.as_str(), file.chunked(&column.chunks, attributes)?));
    }
    let (_, positions) = data.pop().ok_or_else(|| Error::other("no points"))?;
    let mut topology = |numbers, rows: usize, bytes: &[u8]| {
        let mut chunks = Chunked::new(numbers, vec![rows as u64]);
        file.add(&mut chunks, bytes)?;
        file.chunked(&chunks, &[])
    };
    let connectivity = topology(Type::I64, points, &whole(0..points))?;
    let ends = topology(Type::I64, cells + 1, &whole((0..=cells).map(|cell| cell * corners)))?;
    let types = topology(Type::U8, cells, &vec![TYPES[corners - 1]; cells])?;
    let fields = field_data(file, first, bodies)?;
    let links = [
        ("NumberOfPoints", file.whole(Type::I64, &[1], &whole([points]))?),
        ("NumberOfCells", file.whole(Type::I64, &[1], &whole([cells]))?),
        ("NumberOfConnectivityIds", file.whole(Type::I64, &[1], &whole([points]))?),
        ("Points", positions),
        ("Connectivity", connectivity),
        ("Offsets", ends),
        ("Types", types),
        ("PointData", file.group(&data, &[])?),
        ("FieldData", fields),
        ("Steps", steps(file, times, columns)?),
    ];
    let kind = "UnstructuredGrid";
    let attributes = [
        Attribute { name: "Version", numbers: Type::I64, dims: &[2], bytes: whole([2, 2]) },
        Attribute { name: "Type", numbers: Type::Text(kind.len() as u32), dims: &[], bytes: kind.into() },
    ];
    file.group(&links, &attributes)
}

/// The group of what is the same at all times: the background grid, as in a `.vtu`, and the names of the bodies.
fn field_data(file: &mut Writer<impl Write + Seek>, first: &Snapshot, bodies: &[String]) -> Result<u64> {
    let Background { dimension, origin, spacing, cells } = first.background;
    let u32s = |numbers: &[u32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut links = vec![
        ("grid_dimension", file.whole(Type::U32, &[1], &u32s(&[dimension]))?),
        ("grid_origin", file.whole(Type::F64, &[3], &bytes(&origin))?),
        ("grid_spacing", file.whole(Type::F64, &[1], &bytes(&[spacing]))?),
        ("grid_cells", file.whole(Type::U32, &[3], &u32s(&cells))?),
    ];
    if let Some(longest) = bodies.iter().map(String::len).max() {
        let mut texts = Vec::new();
        bodies.iter().enumerate().for_each(|(k, name)| {
            texts.extend(name.as_bytes());
            texts.resize((k + 1) * longest, 0);
        });
        links.push(("body_names", file.whole(Type::Text(longest as u32), &[bodies.len() as u64], &texts)?));
    }
    file.group(&links, &[])
}

/// The group of the times: for each time and array, the row at which the values begin.
fn steps(file: &mut Writer<impl Write + Seek>, times: &[f64], columns: &[Column]) -> Result<u64> {
    let count = times.len() as u64;
    let zeros = file.whole(Type::I64, &[count], &whole(times.iter().map(|_| 0)))?;
    let topologies = file.whole(Type::I64, &[count, 1], &whole(times.iter().map(|_| 0)))?;
    let ones = file.whole(Type::I64, &[count], &whole(times.iter().map(|_| 1)))?;
    let mut offsets = Vec::new();
    for column in columns {
        offsets.push((column.name.as_str(), file.whole(Type::I64, &[count], &whole(column.offsets.iter().copied()))?));
    }
    let Some((_, points)) = offsets.pop() else { return Err(Error::other("no points")) };
    let links = [
        ("Values", file.whole(Type::F64, &[count], &bytes(times))?),
        ("NumberOfParts", ones),
        ("PartOffsets", zeros),
        ("PointOffsets", points),
        ("CellOffsets", topologies),
        ("ConnectivityIdOffsets", topologies),
        ("PointDataOffsets", file.group(&offsets, &[])?),
    ];
    let bytes = whole([times.len()]);
    file.group(&links, &[Attribute { name: "NSteps", numbers: Type::I64, dims: &[], bytes }])
}
