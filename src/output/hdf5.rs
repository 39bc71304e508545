//! A writer of HDF5 files: groups, attributes, and datasets that grow chunk by chunk.
//!
//! Format: "HDF5 File Format Specification Version 3.0" of The HDF Group. The file has a superblock of version 1, object headers of version 1,
//! compact links, and chunks in B-trees of version 1, which all releases of the HDF5 library since 1.8 read. Chunks are shuffled and deflated,
//! and written as soon as they are known, so the writer holds few. The same content gives the same bytes.

use super::vtu::compressed;
use crate::parallel;
use flate2::Compression;
use std::io::{Error, Result, Seek, SeekFrom, Write};

/// Chunks that are compressed at the same time.
const AT_ONCE: usize = 64;

/// The address that stands for a missing object.
const NOWHERE: u64 = u64::MAX;

/// Bytes of the superblock.
const SUPERBLOCK: u64 = 100;

/// The type of numbers and texts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Type {
    F64,
    I64,
    U32,
    U8,
    /// ASCII of so many bytes.
    Text(u32),
}

impl Type {
    fn size(self) -> u32 {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::U32 => 4,
            Self::U8 => 1,
            Self::Text(size) => size,
        }
    }

    fn message(self) -> Vec<u8> {
        // The message has class and version, three bytes of flags, and the size. For numbers, the offset and the count of their bits follow.
        let (head, bits): ([u8; 4], &[u8]) = match self {
            // The sign is bit 63. The exponent has 11 bits from bit 52 on and the bias 1023. The mantissa has 52 bits without its leading 1.
            Self::F64 => ([0x11, 0x20, 63, 0], &[0, 0, 64, 0, 52, 11, 0, 52, 0xff, 0x03, 0, 0]),
            Self::I64 => ([0x10, 0x08, 0, 0], &[0, 0, 64, 0]),
            Self::U32 => ([0x10, 0, 0, 0], &[0, 0, 32, 0]),
            Self::U8 => ([0x10, 0, 0, 0], &[0, 0, 8, 0]),
            Self::Text(_) => ([0x13, 0x01, 0, 0], &[]),
        };
        [&head, &self.size().to_le_bytes()[..], bits].concat()
    }
}

/// Whether an object can have this name.
pub(super) fn is_link(name: &str) -> bool {
    !name.is_empty() && name != "." && !name.contains(['/', '\0'])
}

/// The bytes of signed whole numbers.
pub(super) fn whole(numbers: impl IntoIterator<Item = usize>) -> Vec<u8> {
    numbers.into_iter().flat_map(|number| (number as i64).to_le_bytes()).collect()
}

/// A dataset that grows along its first axis. Each of its columns has chunks of its own, because columns alone compress better.
#[derive(Debug)]
pub(super) struct Chunked {
    numbers: Type,
    /// The number of rows in a chunk.
    rows: usize,
    columns: usize,
    /// Address and bytes of each chunk, the chunks of the first rows first.
    chunks: Vec<(u64, u32)>,
    /// Rows that fill no chunk yet.
    held: Vec<u8>,
}

impl Chunked {
    /// A dataset without rows.
    pub(super) fn new(numbers: Type, rows: usize, columns: usize) -> Self {
        Self { numbers, rows, columns, chunks: Vec::new(), held: Vec::new() }
    }

    /// The bytes of a row.
    pub(super) fn width(&self) -> usize {
        self.columns * self.numbers.size() as usize
    }

    /// The extents of an array with this number of `rows`.
    fn extents(&self, rows: usize) -> Vec<u64> {
        let extents = [rows as u64, self.columns as u64];
        extents.into_iter().take(self.columns.min(2)).collect()
    }
}

/// A file under construction.
#[derive(Debug)]
pub(super) struct Writer<W> {
    out: W,
    end: u64,
    /// Half of the number of chunks in a node of a B-tree. Every dataset has one node.
    half_node: u16,
}

impl<W: Write + Seek> Writer<W> {
    /// Begins the file.
    pub(super) fn new(mut out: W) -> Result<Self> {
        out.write_all(&[0; SUPERBLOCK as usize])?;
        Ok(Self { out, end: SUPERBLOCK, half_node: 1 })
    }

    /// Appends bytes at a multiple of eight, and returns their address.
    fn put(&mut self, bytes: &[u8]) -> Result<u64> {
        let address = self.end.next_multiple_of(8);
        self.out.write_all(&[0; 8][..(address - self.end) as usize])?;
        self.out.write_all(bytes)?;
        self.end = address + bytes.len() as u64;
        Ok(address)
    }

    /// Adds rows to a dataset, and writes its chunks that are full.
    pub(super) fn add(&mut self, array: &mut Chunked, bytes: &[u8]) -> Result<()> {
        array.held.extend(bytes);
        if array.held.len() < array.rows * array.width() { Ok(()) } else { self.flush(array) }
    }

    /// Writes the rows that fill no chunk yet, and zeros after them. All datasets must be flushed before the first is written.
    pub(super) fn flush(&mut self, array: &mut Chunked) -> Result<()> {
        let size = array.numbers.size() as usize;
        // The format counts bytes of a chunk in 32 bits, and chunks of a node in 16.
        small::<u32>(array.rows * size)?;
        let mut held = std::mem::take(&mut array.held);
        held.resize(held.len().next_multiple_of(array.rows * array.width()), 0);
        let (columns, width) = (array.columns, array.width());
        let chunks = held.chunks(array.rows * width).flat_map(|block| (0..columns).map(move |k| (block, k)));
        let chunks: Vec<(&[u8], usize)> = chunks.collect();
        let packed = |&(block, column): &(&[u8], usize)| {
            let plane = |byte: usize| block.iter().skip(column * size + byte).step_by(width).copied();
            let shuffled: Vec<u8> = (0..size).flat_map(plane).collect();
            compressed(&shuffled, Compression::default())
        };
        for some in chunks.chunks(AT_ONCE) {
            for packed in parallel::collect(some.iter(), &packed) {
                array.chunks.push((self.put(&packed)?, small(packed.len())?));
            }
        }
        small::<u16>(array.chunks.len())?;
        self.half_node = self.half_node.max(small(array.chunks.len().div_ceil(2))?);
        Ok(())
    }

    /// Writes a dataset of chunks.
    pub(super) fn chunked(&mut self, array: &Chunked, attributes: &[Attribute]) -> Result<u64> {
        let (chunk, count) = (array.extents(array.rows), array.chunks.len());
        // A key has the size of a chunk, a mask of the filters left out, and the position of the chunk along every axis and in a number.
        let key = |size: u32, k: usize| {
            let place = [(k / array.columns * array.rows) as u64, (k % array.columns) as u64]
                .into_iter()
                .take(chunk.len())
                .chain([0]);
            [size, 0]
                .into_iter()
                .flat_map(u32::to_le_bytes)
                .chain(place.flat_map(u64::to_le_bytes))
                .collect::<Vec<u8>>()
        };
        let mut tree = [&b"TREE\x01\0"[..], &small::<u16>(count)?.to_le_bytes(), &[0xff; 16]].concat();
        for (k, &(address, size)) in array.chunks.iter().enumerate() {
            tree.extend(key(size, k));
            tree.extend(address.to_le_bytes());
        }
        let last = key(0, count);
        tree.extend(&last);
        tree.resize(tree.len() + (2 * usize::from(self.half_node) - count) * (last.len() + 8), 0);
        let mut layout = vec![3, 2, small(chunk.len() + 1)?];
        layout.extend(self.put(&tree)?.to_le_bytes());
        for extent in [array.rows, 1].into_iter().take(chunk.len()).chain([array.numbers.size() as usize]) {
            layout.extend(small::<u32>(extent)?.to_le_bytes());
        }
        let dims = array.extents(count / array.columns * array.rows);
        // The message has version 2 and two filters: shuffle (2) by the size of a number, then deflate (1) with its level.
        let mut pipeline = vec![2, 2];
        for (filter, value) in [(2, array.numbers.size()), (1, Compression::default().level())] {
            pipeline.extend([filter, 0, 0, 0, 1, 0]);
            pipeline.extend(value.to_le_bytes());
        }
        self.dataset(array.numbers, &dims, vec![(0x08, layout), (0x0b, pipeline)], attributes)
    }

    /// Writes a dataset at once. Its bytes must fill `dims`.
    pub(super) fn values(&mut self, numbers: Type, dims: &[u64], bytes: &[u8]) -> Result<u64> {
        let place = [self.put(bytes)?, bytes.len() as u64].map(u64::to_le_bytes).concat();
        self.dataset(numbers, dims, vec![(0x08, [&[3, 1], &place[..]].concat())], &[])
    }

    /// Writes a dataset of whole numbers at once.
    pub(super) fn whole(&mut self, dims: &[u64], numbers: impl IntoIterator<Item = usize>) -> Result<u64> {
        self.values(Type::I64, dims, &whole(numbers))
    }

    fn dataset(
        &mut self,
        numbers: Type,
        dims: &[u64],
        storage: Vec<(u16, Vec<u8>)>,
        attributes: &[Attribute],
    ) -> Result<u64> {
        // The third message says that no fill value is written.
        let about = [(0x01, space(dims)), (0x03, numbers.message()), (0x05, vec![2, 2, 1, 0])];
        self.object(about.into_iter().chain(storage), attributes)
    }

    /// Writes a group of objects, given by names and addresses; see [`is_link`].
    pub(super) fn group(&mut self, links: &[(impl AsRef<str>, u64)], attributes: &[Attribute]) -> Result<u64> {
        self.links(links.iter().map(|(name, address)| (name.as_ref(), 0, address.to_le_bytes().to_vec())), attributes)
    }

    /// Writes a group of soft links, given by names and paths. Paths here are short.
    pub(super) fn soft_links(&mut self, links: &[(String, String)]) -> Result<u64> {
        let target = |path: &str| [&(path.len() as u16).to_le_bytes(), path.as_bytes()].concat();
        self.links(links.iter().map(|(name, path)| (name.as_str(), 1, target(path))), &[])
    }

    /// Writes a group of links: names, types and targets. Readers of blocks need the order of the links.
    fn links<'a>(
        &mut self,
        links: impl Iterator<Item = (&'a str, u8, Vec<u8>)>,
        attributes: &[Attribute],
    ) -> Result<u64> {
        let mut messages = Vec::new();
        for (name, kind, target) in links {
            // The link has version 1, a type, its place in the order, the character set UTF-8, and two bytes for the length of the name.
            let place = (messages.len() as u64).to_le_bytes();
            let head = [&[1, 0x1d, kind], &place[..], &[1], &small::<u16>(name.len())?.to_le_bytes()].concat();
            messages.push((0x06, [&head, name.as_bytes(), &target].concat()));
        }
        // The order is tracked: the message has the number of links, and no addresses of an index.
        let about = [&[0, 1], &(messages.len() as u64).to_le_bytes()[..], &[0xff; 16]].concat();
        self.object([(0x02, about)].into_iter().chain(messages), attributes)
    }

    /// Writes the header of an object, and returns its address.
    fn object(&mut self, messages: impl IntoIterator<Item = (u16, Vec<u8>)>, attributes: &[Attribute]) -> Result<u64> {
        let (mut count, mut body) = (0, Vec::new());
        let attributes = attributes.iter().map(|one| (0x0c, attribute(one)));
        for (kind, data) in messages.into_iter().chain(attributes) {
            let padded = data.len().next_multiple_of(8);
            body.extend([kind, small(padded)?, 0, 0].map(u16::to_le_bytes).concat());
            body.extend(&data);
            body.resize(body.len() + padded - data.len(), 0);
            count += 1;
        }
        let head = [[1, small::<u16>(count)?].map(u16::to_le_bytes).concat(), vec![1, 0, 0, 0]].concat();
        self.put(&[&head, &small::<u32>(body.len())?.to_le_bytes()[..], &[0; 4], &body].concat())
    }

    /// Ends the file, whose root group is at `root`.
    pub(super) fn finish(mut self, root: u64) -> Result<()> {
        // The block begins with versions, bytes of an address and of a length, and sizes of nodes. Readers use only the last size.
        let mut block = b"\x89HDF\r\n\x1a\n\x01\0\0\0\0\x08\x08\0".to_vec();
        block.extend([4, 16, 0, 0, self.half_node, 0].map(u16::to_le_bytes).concat());
        // Then come the addresses of base, free space, end and driver, and the root group: its name, its header, and nothing cached.
        block.extend([0, NOWHERE, self.end, NOWHERE, 0, root, 0, 0, 0].map(u64::to_le_bytes).concat());
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&block)
    }
}

/// A value of a group or a dataset: its name, its type, its extents and its bytes.
pub(super) type Attribute<'a> = (&'a str, Type, Vec<u64>, Vec<u8>);

/// The message of an attribute. Names and types of attributes here are short.
fn attribute((name, numbers, dims, bytes): &Attribute) -> Vec<u8> {
    let parts = [[name.as_bytes(), &[0]].concat(), numbers.message(), space(dims)];
    let mut out = vec![1, 0];
    parts.iter().for_each(|part| out.extend((part.len() as u16).to_le_bytes()));
    for part in &parts {
        out.extend(part);
        out.resize(out.len().next_multiple_of(8), 0);
    }
    out.extend(bytes);
    out
}

/// The message of the extents of an array; a single value has none.
fn space(dims: &[u64]) -> Vec<u8> {
    let extents = dims.iter().flat_map(|extent| extent.to_le_bytes());
    [1, dims.len() as u8, 0, 0, 0, 0, 0, 0].into_iter().chain(extents).collect()
}

/// A number in a field of the format that may be too small for it.
fn small<T: TryFrom<usize>>(number: usize) -> Result<T> {
    number.try_into().map_err(|_| {
        Error::other(format!("{number} is more than HDF5 counts here: write fewer snapshots or particles"))
    })
}
