//! Snapshots as VTK's `.vtu`: an unstructured grid of vertices, segments or triangles, arrays appended raw in zlib blocks, little endian.
//!
//! Format: "VTK File Formats" of the VTK documentation. ParaView, pyvista and meshio read the files. [`Snapshot::read`] gives the numbers
//! that were written, bit for bit.

use super::OutputError;
use crate::field::column;
use flate2::Compression;
use flate2::read::{ZlibDecoder, ZlibEncoder};
use std::io::Read;
use std::path::Path;

/// VTK's types of cells with one point, two and three: vertex, line and triangle.
pub(super) const TYPES: [u8; 3] = [1, 3, 5];

/// An array with one tuple for each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Name of the array.
    pub name: String,
    /// Names of the components; one empty name for a scalar.
    pub components: Vec<String>,
    /// All components of the first point, then of the next.
    pub values: Vec<f64>,
    /// Whether all values are whole numbers, which the file holds as `UInt32` instead of `Float64`.
    pub is_index: bool,
}

impl Array {
    /// An array with one number for each point.
    pub(crate) fn scalar(name: &str, values: Vec<f64>, is_index: bool) -> Self {
        Self { name: name.to_owned(), components: vec![String::new()], values, is_index }
    }

    /// The array at some of the points.
    pub(super) fn select(&self, points: &[usize]) -> Self {
        let width = self.components.len();
        let values = points.iter().flat_map(|point| &self.values[point * width..][..width]).copied().collect();
        Self { name: self.name.clone(), components: self.components.clone(), values, is_index: self.is_index }
    }

    /// The values as a file holds them.
    pub(super) fn bytes(&self) -> Vec<u8> {
        to_bytes(&self.values, self.is_index)
    }

    /// The names of the components, as in a table.
    pub(crate) fn columns(&self) -> Vec<String> {
        self.components.iter().map(|component| column(&self.name, component)).collect()
    }
}

/// The background grid of a snapshot, kept as field data so that a picture can show the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// Number of dimensions.
    pub dimension: u32,
    /// Lower corner; 0 along missing axes.
    pub origin: [f64; 3],
    /// Distance between neighbouring nodes.
    pub spacing: f64,
    /// Cells along each axis; 0 along missing ones.
    pub cells: [u32; 3],
}

impl Background {
    fn check(&self) -> Result<(), String> {
        let finite = self.origin.iter().all(|x| x.is_finite()) && self.spacing.is_finite() && self.spacing > 0.0;
        let axes = self.cells.get(..self.dimension as usize);
        let whole = axes.is_some_and(|cells| !cells.is_empty() && !cells.contains(&0));
        if finite && whole { Ok(()) } else { Err(format!("{self:?} is no grid")) }
    }
}

/// Points with arrays, at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Time.
    pub time: f64,
    /// The background grid.
    pub background: Background,
    /// The points; missing coordinates are 0.
    pub points: Vec<[f64; 3]>,
    /// Arrays of the points.
    pub arrays: Vec<Array>,
    /// The number of points of a cell: 1 for particles, 2 for segments, 3 for triangles. No cells share a point.
    pub corners: usize,
}

/// The numbers as a file holds them.
pub(super) fn to_bytes(values: &[f64], is_index: bool) -> Vec<u8> {
    if is_index { values.iter().flat_map(|&x| (x as u32).to_le_bytes()).collect() } else { bytes(values) }
}

/// A block in the format of zlib.
pub(super) fn compressed(block: &[u8], how: Compression) -> Vec<u8> {
    let mut out = Vec::new();
    // Reading from memory into memory cannot fail.
    let _ = ZlibEncoder::new(block, how).read_to_end(&mut out);
    out
}

/// The values of an array as bytes.
pub(super) fn bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

impl Snapshot {
    /// Reads a file that this program has written.
    ///
    /// # Errors
    /// The operating system refuses, or the file is not a snapshot, or is damaged.
    pub fn read(path: &Path) -> Result<Self, OutputError> {
        let content = std::fs::read(path).map_err(OutputError::io("read", path))?;
        Self::parse(&content)
            .map_err(|what| OutputError::content(path, format!("is not a snapshot written by bfree: {what}")))
    }

    fn parse(content: &[u8]) -> Result<Self, String> {
        const MARK: &[u8] = b"<AppendedData encoding=\"raw\">\n_";
        let split = content.windows(MARK.len()).position(|window| window == MARK).ok_or("no appended raw data")?;
        let (xml, data) = (&content[..split], &content[split + MARK.len()..]);
        let xml = std::str::from_utf8(xml).map_err(|_| "the header is not UTF-8")?;
        let numbers = |name: &str| -> Result<Vec<f64>, String> {
            let (_, text) =
                elements(xml).find(|(tag, _)| attribute(tag, "Name") == Some(name)).ok_or(format!("no {name}"))?;
            text.split_whitespace().map(|x| x.parse().map_err(|_| format!("{name} holds {x:?}"))).collect()
        };
        let scalar = |name: &str| numbers(name)?.first().copied().ok_or(format!("{name} is empty"));
        let triple = |name: &str| <[f64; 3]>::try_from(numbers(name)?).map_err(|_| format!("{name} has not 3 numbers"));
        let background = Background {
            dimension: scalar("grid_dimension")? as u32,
            origin: triple("grid_origin")?,
            spacing: scalar("grid_spacing")?,
            cells: triple("grid_cells")?.map(|x| x as u32),
        };
        background.check()?;
        let time = scalar("TimeValue")?;
        let size = |name: &str| {
            let number = |piece: &str| attribute(piece.split('>').next()?, name)?.parse::<usize>().ok();
            xml.split_once("<Piece").and_then(|(_, piece)| number(piece)).ok_or(format!("no {name}"))
        };
        let count = size("NumberOfPoints")?;
        let corners = count.checked_div(size("NumberOfCells")?).unwrap_or(1);
        // The arrays of the cells have other types and hold no information.
        let holds_numbers = |tag: &str| matches!(attribute(tag, "type"), Some("Float64" | "UInt32"));
        let appended = |tag: &str| attribute(tag, "format") == Some("appended") && holds_numbers(tag);
        let tags = elements(xml).map(|(tag, _)| tag).filter(|tag| appended(tag));
        let mut arrays = tags.map(|tag| read_array(tag, data, count)).collect::<Result<Vec<_>, _>>()?;
        let points = arrays.pop_if(|array| array.name == "Points").ok_or("no points")?;
        Ok(Self { time, background, points: points.values.as_chunks().0.to_vec(), arrays, corners })
    }
}

/// The start tags of all data arrays, with the text that follows each.
fn elements(xml: &str) -> impl Iterator<Item = (&str, &str)> {
    xml.split("<DataArray ").skip(1).filter_map(|element| {
        let (tag, rest) = element.split_once('>')?;
        Some((tag, rest.split('<').next().unwrap_or_default()))
    })
}

/// The value of an attribute in a start tag.
fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let mut parts = tag.split('"');
    while let (Some(key), Some(value)) = (parts.next(), parts.next()) {
        if key.trim().strip_suffix('=') == Some(name) {
            return Some(value);
        }
    }
    None
}

/// An appended array of floats or indices.
fn read_array(tag: &str, data: &[u8], count: usize) -> Result<Array, String> {
    let get = |name: &str| attribute(tag, name).ok_or(format!("an array without {name}"));
    let name = get("Name")?;
    let number = |text: &str| text.parse::<usize>().map_err(|_| format!("{name}: {text:?} is no number"));
    let width = number(attribute(tag, "NumberOfComponents").unwrap_or("1"))?;
    let offset = number(get("offset")?)?;
    let bytes = data.get(offset..).and_then(inflated).ok_or(format!("{name}: damaged data"))?;
    let is_index = get("type")? == "UInt32";
    let values: Vec<f64> = if is_index {
        bytes.as_chunks().0.iter().map(|&x| f64::from(u32::from_le_bytes(x))).collect()
    } else {
        bytes.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x)).collect()
    };
    if Some(values.len()) != count.checked_mul(width) {
        return Err(format!("{name}: {} numbers for {count} points of {width} components", values.len()));
    }
    let component = |k| attribute(tag, &format!("ComponentName{k}")).unwrap_or_default().to_owned();
    Ok(Array { name: name.to_owned(), components: (0..width).map(component).collect(), values, is_index })
}

/// Decompresses the data of a column.
fn inflated(data: &[u8]) -> Option<Vec<u8>> {
    let word = |k: usize| {
        let bytes = data.get(k.checked_mul(8)?..)?.first_chunk::<8>()?;
        usize::try_from(u64::from_le_bytes(*bytes)).ok()
    };
    let blocks = word(0)?;
    let mut start = blocks.checked_add(3)?.checked_mul(8)?;
    let mut out = Vec::new();
    for k in 0..blocks {
        let end = start.checked_add(word(3 + k)?)?;
        ZlibDecoder::new(data.get(start..end)?).read_to_end(&mut out).ok()?;
        start = end;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(count: usize) -> Snapshot {
        let wild = [0.1, -0.0, f64::MIN_POSITIVE / 8.0, f64::MAX, 1.0 / 3.0];
        let x = |k: usize| wild[k % wild.len()] * (1.0 + k as f64 * 1e-3);
        let array = |name: &str, components: &[&str], values| Array {
            name: name.to_owned(),
            components: components.iter().map(|&c| c.to_owned()).collect(),
            values,
            is_index: name == "body",
        };
        Snapshot {
            time: 0.1 + 0.2,
            background: Background { dimension: 2, origin: [-0.5, 1e-9, 0.0], spacing: 0.1, cells: [20, 15, 0] },
            points: (0..count).map(|k| [x(k), x(k + 1), 0.0]).collect(),
            arrays: vec![
                array("velocity", &["x", "y", "z"], (0..3 * count).map(x).collect()),
                array("jacobian", &[""], (0..count).map(x).collect()),
                array("body", &[""], (0..count).map(|k| k as f64).collect()),
            ],
            corners: 1,
        }
    }

    #[test]
    fn a_snapshot_reads_back_bit_for_bit() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("a.vtu");
        // none; one block; whole blocks exactly (2¹⁶ / 8 doubles in a scalar); several and a rest
        for count in [0, 1, 8192, 10_007] {
            let written = snapshot(count);
            written.write(&path)?;
            let read = Snapshot::read(&path)?;
            assert_eq!(read, written);
            let bits = |s: &Snapshot| s.points.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&read), bits(&written)); // == does not see the sign of zero
        }
        Ok(())
    }

    #[test]
    fn a_damaged_file_is_an_error_wherever_it_breaks_off() -> Result<(), Box<dyn std::error::Error>> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("a.vtu");
        snapshot(7).write(&path)?;
        let whole = std::fs::read(&path)?;
        let mark = whole.windows(2).position(|window| window == b"\n_").ok_or("no data")?;
        for length in 0..mark + 60 {
            assert!(Snapshot::parse(&whole[..length]).is_err(), "{length}");
        }
        Ok(())
    }
}
