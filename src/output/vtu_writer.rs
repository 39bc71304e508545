//! The writer of snapshots, see [`super::vtu`]. It computes and compresses the data block by block, so no array is in memory whole.

use super::OutputError;
use super::files::write_atomically;
use super::history::AXES;
use super::vtu::{Array, Background, Snapshot, TYPES, compressed, to_bytes};
use crate::parallel;
use flate2::Compression;
use std::io::{Error, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

/// The most bytes of an uncompressed block, which has whole rows.
const BLOCK: usize = 1 << 16;

/// Blocks that are in memory at the same time.
const AT_ONCE: usize = 64;

/// Characters reserved for an offset and its quotation mark. Spaces fill the rest, because meshio compares the text of an offset.
const ROOM: usize = 16;

/// The content of a file besides its points and their arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    pub time: f64,
    pub background: Background,
    /// See [`Snapshot::corners`].
    pub corners: usize,
}

/// `(rows, out)`: appends the bytes of some rows of a column.
type Fill<'a> = dyn Fn(Range<usize>, &mut Vec<u8>) -> Result<(), OutputError> + 'a;

/// A column of a file: an array whose bytes are computed when they are written.
pub(super) struct Column<'a> {
    vtk_type: &'static str,
    name: &'a str,
    components: &'a [String],
    rows: usize,
    /// Bytes of a row.
    width: usize,
    fill: Box<Fill<'a>>,
}

impl<'a> Column<'a> {
    /// A column of so many rows of numbers. `fill(rows, out)` appends all components of some rows. With `is_index`, all of them are whole.
    pub(super) fn new(
        (name, components, is_index): (&'a str, &'a [String], bool),
        rows: usize,
        fill: impl Fn(Range<usize>, &mut Vec<f64>) -> Result<(), OutputError> + 'a,
    ) -> Self {
        let (vtk_type, size) = if is_index { ("UInt32", size_of::<u32>()) } else { ("Float64", size_of::<f64>()) };
        let fill = move |rows: Range<usize>, out: &mut Vec<u8>| {
            let mut values = Vec::with_capacity(rows.len() * components.len());
            fill(rows, &mut values)?;
            out.extend(to_bytes(&values, is_index));
            Ok(())
        };
        Self { vtk_type, name, components, rows, width: components.len() * size, fill: Box::new(fill) }
    }

    /// A column that describes cells.
    fn of_cells(
        (vtk_type, name, width): (&'static str, &'a str, usize),
        rows: usize,
        fill: impl Fn(Range<usize>, &mut Vec<u8>) + 'a,
    ) -> Self {
        let fill = move |rows: Range<usize>, out: &mut Vec<u8>| {
            fill(rows, out);
            Ok(())
        };
        Self { vtk_type, name, components: &[], rows, width, fill: Box::new(fill) }
    }

    /// The XML element, up to the digits of the offset of the data.
    fn tag(&self) -> String {
        let Self { vtk_type, name, components, .. } = self;
        let mut tag = format!(r#"<DataArray type="{vtk_type}" Name="{name}""#);
        // Without NumberOfComponents, readers give a scalar as a plain list.
        if components.len() > 1 {
            tag += &format!(r#" NumberOfComponents="{}""#, components.len());
        }
        for (k, component) in components.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
            tag += &format!(r#" ComponentName{k}="{component}""#);
        }
        tag + r#" format="appended" offset=""#
    }

    /// Writes the data: `[blocks, block size, size of the last block if smaller, compressed sizes …]` and the compressed blocks. At most
    /// [`AT_ONCE`] blocks are in memory at a time.
    fn write(&self, file: &mut (impl Write + Seek)) -> std::io::Result<()> {
        let rows = BLOCK / self.width;
        let blocks = self.rows.div_ceil(rows);
        let words = [blocks, rows * self.width, self.rows % rows * self.width];
        let table = |sizes: Vec<usize>| -> Vec<u8> {
            words.into_iter().chain(sizes).flat_map(|word| (word as u64).to_le_bytes()).collect()
        };
        let start = file.stream_position()?;
        file.write_all(&table(vec![0; blocks]))?;
        let mut sizes = Vec::new();
        for first in (0..self.rows).step_by(rows * AT_ONCE) {
            let mut bytes = Vec::new();
            (self.fill)(first..self.rows.min(first + rows * AT_ONCE), &mut bytes).map_err(Error::other)?;
            let blocks = bytes.chunks(rows * self.width);
            for block in parallel::collect(blocks, &|block| compressed(block, Compression::fast())) {
                sizes.push(block.len());
                file.write_all(&block)?;
            }
        }
        let end = file.stream_position()?;
        file.seek(SeekFrom::Start(start))?;
        file.write_all(&table(sizes))?;
        file.seek(SeekFrom::Start(end)).map(drop)
    }
}

/// An array of field data, as text.
fn field(vtk_type: &str, name: &str, numbers: &[impl std::fmt::Debug]) -> String {
    let text: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    let (count, text) = (numbers.len(), text.join(" "));
    format!(
        "<DataArray type=\"{vtk_type}\" Name=\"{name}\" NumberOfTuples=\"{count}\" format=\"ascii\">{text}</DataArray>\n"
    )
}

impl Snapshot {
    /// Writes the file, all or nothing.
    ///
    /// # Errors
    /// The operating system refuses.
    pub(crate) fn write(&self, path: &Path) -> Result<(), OutputError> {
        fn copied(values: &[f64], width: usize) -> impl Fn(Range<usize>, &mut Vec<f64>) -> Result<(), OutputError> {
            move |rows, out| {
                out.extend(&values[rows.start * width..rows.end * width]);
                Ok(())
            }
        }
        let count = self.points.len();
        let arrays = self.arrays.iter().map(|Array { name, components, values, is_index }| {
            Column::new((name, components, *is_index), count, copied(values, components.len()))
        });
        let head = Head { time: self.time, background: self.background, corners: self.corners };
        head.write(path, arrays.collect(), count, copied(self.points.as_flattened(), 3))
    }
}

impl Head {
    /// Writes a file with these arrays and so many points, all or nothing.
    ///
    /// # Errors
    /// A value cannot be computed, or the operating system refuses.
    pub(super) fn write(
        &self,
        path: &Path,
        arrays: Vec<Column<'_>>,
        count: usize,
        points: impl Fn(Range<usize>, &mut Vec<f64>) -> Result<(), OutputError>,
    ) -> Result<(), OutputError> {
        let corners = self.corners.clamp(1, TYPES.len());
        let (cells, axes) = (count / corners, AXES.map(str::to_owned));
        let numbers = |of: Range<usize>, step: usize| of.flat_map(move |k| ((k * step) as i64).to_le_bytes());
        let cells_of = [
            Column::of_cells(("Int64", "connectivity", 8), count, |rows, out| out.extend(numbers(rows, 1))),
            Column::of_cells(("Int64", "offsets", 8), cells, |rows, out| {
                out.extend(numbers(rows.start + 1..rows.end + 1, corners));
            }),
            Column::of_cells(("UInt8", "types", 1), cells, |rows, out| {
                out.resize(out.len() + rows.len(), TYPES[corners - 1]);
            }),
        ];
        let points = [Column::new(("Points", &axes, false), count, points)];
        write_atomically(path, |file| {
            let piece = format!("<Piece NumberOfPoints=\"{count}\" NumberOfCells=\"{cells}\">\n<PointData>\n");
            file.write_all((self.xml() + &piece).as_bytes())?;
            let sections = [
                (&arrays[..], "</PointData>\n<Points>\n"),
                (&points, "</Points>\n<Cells>\n"),
                (&cells_of, "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_"),
            ];
            // The offset of each column, as digits, and its place.
            let mut offsets = Vec::new();
            for (columns, end) in sections {
                for column in columns {
                    file.write_all(column.tag().as_bytes())?;
                    offsets.push((file.stream_position()?, 0));
                    writeln!(file, "{:ROOM$}/>", "")?;
                }
                file.write_all(end.as_bytes())?;
            }
            let data = file.stream_position()?;
            for ((_, offset), column) in offsets.iter_mut().zip(sections.iter().flat_map(|(columns, _)| *columns)) {
                *offset = file.stream_position()? - data;
                column.write(file)?;
            }
            file.write_all(b"\n</AppendedData>\n</VTKFile>\n")?;
            for (place, offset) in offsets {
                file.seek(SeekFrom::Start(place))?;
                write!(file, "{offset}\"")?;
            }
            Ok(())
        })
    }

    /// The XML before the points.
    fn xml(&self) -> String {
        let Background { dimension, origin, spacing, cells } = &self.background;
        [
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n<FieldData>\n",
            &field("Float64", "TimeValue", &[self.time]),
            &field("UInt32", "grid_dimension", &[dimension]),
            &field("Float64", "grid_origin", origin),
            &field("Float64", "grid_spacing", &[spacing]),
            &field("UInt32", "grid_cells", cells),
            "</FieldData>\n",
        ]
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::super::vtu::bytes;
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    /// The layout is compared with the description of the format and not with our reader. The offset leads to a header of UInt64. The
    /// header holds the block count, the block size, the size of a partial last block (0 if it is whole) and the compressed sizes.
    #[test]
    fn the_layout_is_that_of_vtk() -> Result<(), Box<dyn std::error::Error>> {
        let (rows, names) = (2 * (BLOCK / 24) + 5, AXES.map(str::to_owned));
        let number = |k: usize| (k % 251) as f64;
        let column = Column::new(("v", &names, false), rows, |rows, out| {
            out.extend((3 * rows.start..3 * rows.end).map(number));
            Ok(())
        });
        let mut file = std::io::Cursor::new(b"before".to_vec());
        file.seek(SeekFrom::End(0))?;
        column.write(&mut file)?;
        let (position, data) = (file.position() as usize, &file.into_inner()[6..]);
        let words: Vec<u64> = data.as_chunks().0.iter().take(6).map(|&word| u64::from_le_bytes(word)).collect();
        assert_eq!(words[..3], [3, BLOCK as u64 / 24 * 24, 5 * 24]);
        assert_eq!((words[3..].iter().sum::<u64>() as usize, position), (data.len() - 6 * 8, data.len() + 6));
        let mut first = Vec::new();
        ZlibDecoder::new(&data[48..][..words[3] as usize]).read_to_end(&mut first)?;
        assert_eq!(first, bytes(&(0..BLOCK / 24 * 3).map(number).collect::<Vec<_>>()));
        assert!(
            column
                .tag()
                .starts_with("<DataArray type=\"Float64\" Name=\"v\" NumberOfComponents=\"3\" ComponentName0=\"x\"")
        );
        Ok(())
    }
}
