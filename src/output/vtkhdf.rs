//! All snapshots of a run in one file: VTK's `.vtkhdf`. The file is an unstructured grid with time steps, which VTK reads from 9.3 on. Where the
//! snapshots have the numbers of several bodies, each body is a block with such a grid. VTK reads blocks from 9.4 on.
//!
//! Format: "VTKHDF File Format", version 2.2, of the VTK documentation. The type of the blocks is `MultiBlockDataSet`. VTK 9.4 and 9.5 lose the
//! names in a `PartitionedDataSetCollection` and refuse names with a space there, and PyVista 0.49 does not read that type.
//!
//! Every snapshot of an array has room for the points of the largest snapshot. A snapshot with the same bits as the one before, such as the
//! mass, is not stored again.

use super::OutputError;
use super::files::write_atomically;
use super::hdf5::{Attribute, Chunked, Type, Writer, is_link, whole};
use super::pvd::{self, SERIES};
use super::vtu::{Array, Snapshot, TYPES, bytes};
use std::collections::BTreeMap;
use std::io::{Error, Result, Seek, Write};
use std::path::{Path, PathBuf};

/// The least number of rows in the chunks of all blocks. Larger chunks compress better. Smaller ones are read faster, because a reader that
/// asks for one time inflates whole chunks.
const CHUNK: usize = 1 << 13;

/// Writes `particles.vtkhdf` of the snapshots in the directory of a run, and a file of every other series beside it. `bodies` are the names
/// of the bodies, which become those of the blocks. Returns the files written, and for each the snapshots in it and those that are missing.
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
        let mut sizes = BTreeMap::new();
        for path in &files {
            for (body, points) in body_points(&Snapshot::read(path)?) {
                let most: &mut usize = sizes.entry(body).or_default();
                *most = points.len().max(*most);
            }
        }
        // Surfaces that may touch may have no points.
        if !sizes.is_empty() {
            let path = directory.join(format!("{series}.vtkhdf"));
            write_atomically(&path, |out| write(out, &sizes, &files, bodies))?;
            written.push((path, [files.len(), missing.len()]));
        }
    }
    if written.is_empty() { Err(OutputError::NoSnapshots(directory.to_owned())) } else { Ok(written) }
}

/// The points of each body. If the snapshot has no numbers of bodies, all points belong to one.
fn body_points(snapshot: &Snapshot) -> BTreeMap<usize, Vec<usize>> {
    let numbers = snapshot.arrays.iter().find(|array| array.name == "body");
    let mut points = BTreeMap::<_, Vec<_>>::new();
    for point in 0..snapshot.points.len() {
        let body = numbers.and_then(|numbers| numbers.values.get(point)).map_or(0, |body| *body as usize);
        points.entry(body).or_default().push(point);
    }
    points
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
    /// An empty column with chunks of this number of rows.
    fn new(array: &Array, chunk: usize) -> Self {
        let numbers = if array.is_index { Type::U32 } else { Type::F64 };
        let chunks = Chunked::new(numbers, chunk, array.components.len());
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

/// The snapshots of a body, or of all bodies.
#[derive(Default)]
struct Series {
    /// The points of the largest snapshot.
    rows: usize,
    /// The rows of a chunk, which are those of whole snapshots.
    chunk: usize,
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
    /// Adds some `points` of the snapshot at `path`.
    fn add(
        &mut self,
        file: &mut Writer<impl Write + Seek>,
        path: &Path,
        snapshot: &Snapshot,
        points: &[usize],
    ) -> Result<()> {
        let arrays: Vec<_> = snapshot.arrays.iter().map(|array| array.select(points)).collect();
        let columns: Vec<_> = arrays.iter().map(|array| Column::new(array, self.chunk)).collect();
        if self.times.is_empty() {
            self.columns = arrays.iter().map(|array| Column::new(array, self.chunk)).collect();
        }
        let is_same = columns.iter().map(Column::kind).eq(self.columns.iter().map(Column::kind));
        if !is_same || !columns.iter().all(|column| is_link(&column.name)) {
            let what = "has other fields than the first snapshot, or a name with /, which HDF5 does not allow";
            return Err(Error::other(OutputError::content(path, what)));
        }
        // A snapshot without points does not tell the points of a cell.
        self.corners = snapshot.corners.clamp(1, TYPES.len().min(self.rows)).max(self.corners);
        self.times.push(snapshot.time);
        if self.counts.last() != Some(&points.len()) {
            self.counts.push(points.len());
        }
        self.parts.push(self.counts.len() - 1);
        self.columns.iter_mut().zip(&arrays).try_for_each(|(column, array)| column.add(file, array, self.rows))
    }

    /// Writes the chunks that are left, and returns those of the cells: connectivity, ends and types.
    fn finish(&mut self, file: &mut Writer<impl Write + Seek>) -> Result<[Chunked; 3]> {
        self.columns.iter_mut().try_for_each(|column| file.flush(&mut column.chunks))?;
        let Self { rows, corners, .. } = *self;
        let (cells, parts) = (rows / corners, self.counts.len());
        let mut topology = |numbers, rows: usize, parts: usize, bytes: &[u8]| -> Result<Chunked> {
            let mut chunks = Chunked::new(numbers, rows, 1);
            (0..parts).try_for_each(|_| file.add(&mut chunks, bytes))?;
            Ok(chunks)
        };
        // The cells of a part are the first of those of the largest snapshot.
        Ok([
            topology(Type::I64, rows, 1, &whole(0..rows))?,
            topology(Type::I64, cells + 1, parts, &whole((0..=cells).map(|cell| cell * corners)))?,
            topology(Type::U8, cells, parts, &vec![TYPES[corners - 1]; cells])?,
        ])
    }
}

/// Writes the file. `sizes` has the largest number of points of each body.
fn write(
    out: impl Write + Seek,
    sizes: &BTreeMap<usize, usize>,
    snapshots: &[PathBuf],
    names: &[String],
) -> Result<()> {
    let mut file = Writer::new(out)?;
    let chunk = |rows| rows * CHUNK.div_ceil(rows * sizes.len());
    let series = |rows| Series { rows, chunk: chunk(rows), ..Series::default() };
    let mut blocks: BTreeMap<_, _> = sizes.iter().map(|(body, rows)| (*body, series(*rows))).collect();
    for path in snapshots {
        let mut snapshot = Snapshot::read(path).map_err(Error::other)?;
        let points = body_points(&snapshot);
        let positions = Array::scalar("Points", snapshot.points.concat(), false);
        snapshot.arrays.push(Array { components: vec![String::new(); 3], ..positions });
        for (body, series) in &mut blocks {
            series.add(&mut file, path, &snapshot, points.get(body).map_or(&[], Vec::as_slice))?;
        }
    }
    // All chunks come before the first group, see `Writer::flush`.
    let cells = blocks.values_mut().map(|series| series.finish(&mut file)).collect::<Result<Vec<_>>>()?;
    let mut grids = Vec::new();
    for ((body, series), cells) in blocks.iter().zip(&cells) {
        grids.push((body.to_string(), grid(&mut file, series, cells)?));
    }
    let root = if let [(_, grid)] = grids[..] { grid } else { multi_block(&mut file, grids, names)? };
    let root = file.group(&[("VTKHDF", root)], &[])?;
    file.finish(root)
}

/// The attributes of a group that is a data set of this type.
fn data_set(kind: &str) -> [Attribute<'_>; 2] {
    let version = ("Version", Type::I64, vec![2], whole([2, 2]));
    [version, ("Type", Type::Text(kind.len() as u32), vec![], kind.into())]
}

/// The group of the `grids` of several bodies, given by the numbers of the bodies and the addresses. Readers find the names in `Assembly`.
fn multi_block(file: &mut Writer<impl Write + Seek>, mut grids: Vec<(String, u64)>, names: &[String]) -> Result<u64> {
    let mut links: Vec<(String, String)> = Vec::new();
    for (body, _) in &grids {
        let name = body.parse().ok().and_then(|body: usize| names.get(body)).filter(|name| is_link(name));
        let mut name = name.cloned().unwrap_or_else(|| format!("body {body}"));
        while links.iter().any(|(earlier, _)| *earlier == name) {
            name.push('\'');
        }
        links.push((name, format!("/VTKHDF/{body}")));
    }
    grids.push(("Assembly".to_owned(), file.soft_links(&links)?));
    file.group(&grids, &data_set("MultiBlockDataSet"))
}

/// The group of a grid with time steps.
fn grid(file: &mut Writer<impl Write + Seek>, series: &Series, cells: &[Chunked; 3]) -> Result<u64> {
    let Series { corners, ref counts, ref columns, .. } = *series;
    // Warp By Vector takes this array. The attribute is of version 2.6, and earlier readers ignore it.
    let vectors = [("Attribute", Type::Text(7), vec![], b"Vectors".to_vec())];
    let mut data = Vec::new();
    for column in columns {
        let attributes = if column.name == "displacement" { &vectors[..] } else { &[] };
        data.push((column.name.as_str(), file.chunked(&column.chunks, attributes)?));
    }
    let (_, positions) = data.pop().ok_or_else(|| Error::other("no positions"))?;
    let extent = [counts.len() as u64];
    let points = file.whole(&extent, counts.iter().copied())?;
    let [connectivity, ends, types] = cells;
    let links = [
        ("NumberOfPoints", points),
        ("NumberOfCells", file.whole(&extent, counts.iter().map(|count| count / corners))?),
        ("NumberOfConnectivityIds", points),
        ("Points", positions),
        ("Connectivity", file.chunked(connectivity, &[])?),
        ("Offsets", file.chunked(ends, &[])?),
        ("Types", file.chunked(types, &[])?),
        ("PointData", file.group(&data, &[])?),
        ("Steps", steps(file, series)?),
    ];
    file.group(&links, &data_set("UnstructuredGrid"))
}

/// The group of the times: for each time and array, the row at which the values begin.
fn steps(file: &mut Writer<impl Write + Seek>, series: &Series) -> Result<u64> {
    let Series { times, parts, columns, .. } = series;
    let cells = series.rows / series.corners;
    let (count, mut offsets) = (times.len() as u64, Vec::new());
    for column in columns {
        offsets.push((column.name.as_str(), file.whole(&[count], column.offsets.iter().copied())?));
    }
    let (_, points) = offsets.pop().ok_or_else(|| Error::other("no positions"))?;
    let links = [
        ("Values", file.values(Type::F64, &[count], &bytes(times))?),
        ("NumberOfParts", file.whole(&[count], vec![1; times.len()])?),
        ("PartOffsets", file.whole(&[count], parts.iter().copied())?),
        ("PointOffsets", points),
        // Readers add the number of earlier parts to this offset: every part has one more end than cells.
        ("CellOffsets", file.whole(&[count, 1], parts.iter().map(|part| part * cells))?),
        ("ConnectivityIdOffsets", file.whole(&[count, 1], vec![0; times.len()])?),
        ("PointDataOffsets", file.group(&offsets, &[])?),
    ];
    file.group(&links, &[("NSteps", Type::I64, vec![], whole([times.len()]))])
}

#[cfg(test)]
mod tests {
    use super::super::vtu::Background;
    use super::*;

    /// Packs snapshots of particles, given by the bodies of the points at each time.
    fn packed(times: &[&[f64]], names: &[&str]) -> std::result::Result<Vec<u8>, Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let mut entries = String::new();
        for (time, bodies) in times.iter().enumerate() {
            let background = Background { dimension: 1, origin: [0.0; 3], spacing: 1.0, cells: [1, 0, 0] };
            let arrays = vec![Array::scalar("body", bodies.to_vec(), true)];
            let points = (0..bodies.len()).map(|point| [point as f64, time as f64, 0.0]).collect();
            let (time, name) = (time as f64, format!("{time}.vtu"));
            Snapshot { time, background, points, arrays, corners: 1 }.write(&folder.path().join(&name))?;
            entries += &pvd::entry(time, &name);
        }
        pvd::write(&pvd::file(folder.path(), SERIES[0]), &entries)?;
        pack(folder.path(), &names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())?;
        Ok(std::fs::read(folder.path().join("particles.vtkhdf"))?)
    }

    fn count(file: &[u8], text: &str) -> usize {
        file.windows(text.len()).filter(|window| *window == text.as_bytes()).count()
    }

    #[test]
    fn a_folder_without_snapshots_is_an_error() -> std::result::Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        assert!(matches!(pack(folder.path(), &[]), Err(OutputError::NoSnapshots(_))));
        Ok(())
    }

    /// `.ci/read_back.py` reads the blocks by the HDF5 library and by VTK.
    #[test]
    fn each_of_several_bodies_is_a_block() -> std::result::Result<(), Box<dyn std::error::Error>> {
        let one = packed(&[&[0.0], &[0.0, 0.0]], &["one body"])?;
        assert_eq!(["UnstructuredGrid", "MultiBlockDataSet", "one body"].map(|text| count(&one, text)), [1, 0, 0]);
        // A body may have no points at some times, or at all.
        let three = packed(&[&[0.0, 2.0], &[], &[2.0, 2.0, 2.0]], &["first one", "second", "third"])?;
        let texts = ["UnstructuredGrid", "MultiBlockDataSet", "first one", "second", "third", "/VTKHDF/0", "/VTKHDF/2"];
        assert_eq!(texts.map(|text| count(&three, text)), [2, 1, 1, 0, 1, 1, 1]);
        Ok(())
    }

    #[test]
    fn names_that_hdf5_does_not_allow_are_replaced() -> std::result::Result<(), Box<dyn std::error::Error>> {
        let bodies: Vec<f64> = (0..7).map(f64::from).collect();
        let file = packed(&[&bodies], &["a/b", ".", "", "x", "x", "a\0b"])?;
        let names = ["body 0", "body 1", "body 2", "x'", "body 5", "body 6", "a/b"];
        assert_eq!(names.map(|name| count(&file, name)), [1, 1, 1, 1, 1, 1, 0]);
        Ok(())
    }
}
