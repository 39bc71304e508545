//! Meshes of Gmsh: files in the format MSH 4.1, as text and binary.
//!
//! Counts in a file reserve no memory, so a wrong count cannot exhaust it: each entry that is kept has taken bytes of the file.

use super::file::FileError;
use crate::problems::LARGEST;
use memchr::{memchr_iter, memmem};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::str::FromStr;

/// The elements of first order: the number of Gmsh for the type, the dimension and the number of nodes.
const ELEMENTS: [(i32, i32, usize); 8] =
    [(15, 0, 1), (1, 1, 2), (2, 2, 3), (3, 2, 4), (4, 3, 4), (5, 3, 8), (6, 3, 6), (7, 3, 5)];

/// The most characters shown of a text in a file.
const SHOWN: usize = 40;

/// The most groups named in a message.
const NAMED: usize = 10;

/// A mesh. Entities and physical groups are known by their dimension and tag.
#[derive(Default)]
pub(super) struct Mesh {
    names: BTreeMap<(i32, i32), String>,
    /// The tags of the groups of each entity.
    groups: HashMap<(i32, i32), Vec<i32>>,
    /// The positions of the nodes by their tags.
    pub nodes: HashMap<u64, [f64; 3]>,
    blocks: Vec<Block>,
}

/// The elements of one type in one entity.
pub(super) struct Block {
    entity: (i32, i32),
    /// The number of Gmsh for the type.
    pub kind: i32,
    /// The number of nodes of an element.
    pub size: usize,
    /// The nodes of all elements, one element after the other.
    pub nodes: Vec<u64>,
}

impl Mesh {
    /// The mesh in the bytes of a file.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, FileError> {
        let (mut mesh, mut file) = (Self::default(), Reader { bytes, position: 0, binary: false });
        file.format()?;
        loop {
            let section = file.line();
            // Binary numbers begin behind the end of the line.
            file.position += usize::from(file.binary);
            match section.as_str() {
                "" => return Ok(mesh),
                "$PhysicalNames" => mesh.read_names(&mut file)?,
                "$Entities" => mesh.read_entities(&mut file)?,
                "$Nodes" => mesh.read_nodes(&mut file)?,
                "$Elements" => mesh.read_elements(&mut file)?,
                "$PartitionedEntities" => {
                    return Err(file.wrong("a partitioned mesh; save it before it is partitioned"));
                }
                _ => file.skip(&section)?,
            }
            file.end(&section)?;
        }
    }

    /// The dimension and the elements of the physical group with this name, or with this tag if it has no name. The group has `dimension`
    /// dimensions, or one less.
    pub(super) fn group(&self, name: &str, dimension: i32) -> Result<(i32, Vec<&Block>), FileError> {
        let of_entities = self.groups.iter().flat_map(|(entity, tags)| tags.iter().map(|&tag| (entity.0, tag)));
        let mut known: BTreeMap<_, _> = of_entities.map(|group| (group, group.1.to_string())).collect();
        known.extend(self.names.clone());
        known.retain(|group, _| (dimension - 1..=dimension).contains(&group.0));
        let found: Vec<_> = known.iter().filter(|(_, known)| *known == name).map(|(group, _)| *group).collect();
        let [(found_dimension, tag)] = found[..] else {
            let kinds = if dimension == 2 { "surface or curve" } else { "volume or surface" };
            let (count, known) = (found.len(), known.values().take(NAMED).map(|name| shown(name)).collect::<Vec<_>>());
            let name = shown(name);
            return Err(FileError(format!(
                "has {count} physical groups {name:?}; must be the name of one {kinds}: {known:?}"
            )));
        };
        let is_own = |entity: &(i32, i32)| self.groups.get(entity).is_some_and(|groups| groups.contains(&tag));
        let blocks = self.blocks.iter().filter(|block| block.entity.0 == found_dimension && is_own(&block.entity));
        let blocks: Vec<_> = blocks.filter(|block| !block.nodes.is_empty()).collect();
        let empty = || FileError(format!("has no elements in the group {name:?}; mesh the part before saving it"));
        if blocks.is_empty() { Err(empty()) } else { Ok((found_dimension, blocks)) }
    }

    /// Reads the names of groups, which are text in binary files, too.
    fn read_names(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let binary = std::mem::take(&mut file.binary);
        for _ in 0..file.size("the number of names")? {
            let group = (file.int("the dimension of a group")?, file.int("the tag of a group")?);
            let line = file.line();
            let name = line.strip_prefix('"').and_then(|line| line.strip_suffix('"'));
            let name = name.ok_or_else(|| file.wrong(format!("{:?} instead of a name in quotes", shown(&line))))?;
            self.names.insert(group, name.to_owned());
        }
        file.binary = binary;
        Ok(())
    }

    fn read_entities(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let counts = [0; 4].map(|_| file.size("the number of entities"));
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..count? {
                let tag = file.int("the tag of an entity")?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    file.real("the box around an entity")?;
                }
                let count = file.size("the number of groups of an entity")?;
                // An entity that a group turns around has the group's tag with a minus.
                let groups = (0..count).map(|_| file.int("the tag of a group").map(i32::saturating_abs));
                self.groups.insert((dimension, tag), groups.collect::<Result<_, _>>()?);
                for _ in 0..if dimension == 0 { 0 } else { file.size("the number of sides of an entity")? } {
                    file.int("the tag of a side")?;
                }
            }
        }
        Ok(())
    }

    fn read_nodes(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let [blocks, all] = file.counts()?;
        for _ in 0..blocks {
            let (dimension, _) = file.entity()?;
            // The parameters of a node on its entity stand behind its coordinates.
            let parameters = if file.int("0 or 1")? == 0 { 0 } else { dimension.clamp(0, 3) };
            let count = file.size("the number of nodes of a block")?;
            let tags = (0..count).map(|_| file.size("the tag of a node")).collect::<Result<Vec<_>, _>>()?;
            for tag in tags {
                let [x, y, z] = [0; 3].map(|_| file.real("a coordinate of a node"));
                let x = [x?, y?, z?];
                (0..parameters).try_for_each(|_| file.real("a parameter of a node").map(drop))?;
                let allowed = x.iter().all(|x| x.abs() <= LARGEST);
                file.require(allowed, format_args!("node {tag} at {x:?}; must be finite and at most {LARGEST:e}"))?;
                file.require(self.nodes.insert(tag, x).is_none(), format_args!("node {tag} for the second time"))?;
            }
        }
        let found = self.nodes.len();
        file.require(found as u64 == all, format_args!("{found} nodes where {all} are announced"))
    }

    fn read_elements(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let ([blocks, all], mut found) = (file.counts()?, 0);
        for _ in 0..blocks {
            let (entity, kind) = (file.entity()?, file.int("the type of elements")?);
            let Some(&(_, dimension, size)) = ELEMENTS.iter().find(|(own, ..)| *own == kind) else {
                let order = "elements must be of first order: `Mesh.ElementOrder = 1`, or `gmsh -order 1`";
                return Err(file.wrong(format!("elements of type {kind}; {order}")));
            };
            let is_own = dimension == entity.0;
            file.require(is_own, format_args!("elements of {dimension} dimensions in an entity of {}", entity.0))?;
            let mut nodes = Vec::new();
            for _ in 0..file.size("the number of elements of a block")? {
                let tag = file.size("the tag of an element")?;
                for _ in 0..size {
                    let node = file.size("a node of an element")?;
                    let exists = self.nodes.contains_key(&node);
                    file.require(exists, format_args!("element {tag} with node {node}, which is not in $Nodes"))?;
                    nodes.push(node);
                }
                found += 1;
            }
            self.blocks.push(Block { entity, kind, size, nodes });
        }
        file.require(found == all, format_args!("{found} elements where {all} are announced"))
    }
}

/// The beginning of a text.
fn shown(text: &str) -> String {
    text.chars().take(SHOWN).collect()
}

/// The bytes of a file, and the position up to which they have been read.
struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
    binary: bool,
}

impl<'a> Reader<'a> {
    /// The error for `found` at the position of the reader.
    fn wrong(&self, found: impl Display) -> FileError {
        let before = &self.bytes[..self.position.min(self.bytes.len())];
        let line = 1 + memchr_iter(b'\n', before).count();
        let place = if self.binary { format!("before byte {}", before.len()) } else { format!("in line {line}") };
        FileError(format!("has, {place}, {found}"))
    }

    fn require(&self, allowed: bool, found: impl Display) -> Result<(), FileError> {
        if allowed { Ok(()) } else { Err(self.wrong(found)) }
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or_default()
    }

    /// The text up to the next byte of the kind `ends`, without blanks around it.
    fn text(&mut self, ends: fn(&u8) -> bool) -> String {
        let rest = self.rest().trim_ascii_start();
        let text = rest.split(ends).next().unwrap_or_default();
        self.position = self.bytes.len() - rest.len() + text.len();
        String::from_utf8_lossy(text).trim().to_owned()
    }

    /// The next line that is not blank; empty at the end of the file.
    fn line(&mut self) -> String {
        self.text(|byte| *byte == b'\n')
    }

    fn word(&mut self) -> String {
        self.text(u8::is_ascii_whitespace)
    }

    /// The next number: N bytes, or a word.
    fn number<T: FromStr, const N: usize>(&mut self, what: &str, decode: fn([u8; N]) -> T) -> Result<T, FileError> {
        if self.binary {
            let bytes = self.rest().first_chunk();
            self.position += N;
            return bytes
                .map(|bytes| decode(*bytes))
                .ok_or_else(|| self.wrong(format_args!("its end instead of {what}")));
        }
        let word = self.word();
        word.parse().map_err(|_| self.wrong(format_args!("{:?} instead of {what}", shown(&word))))
    }

    fn int(&mut self, what: &str) -> Result<i32, FileError> {
        self.number(what, i32::from_le_bytes)
    }

    fn size(&mut self, what: &str) -> Result<u64, FileError> {
        self.number(what, u64::from_le_bytes)
    }

    fn real(&mut self, what: &str) -> Result<f64, FileError> {
        self.number(what, f64::from_le_bytes)
    }

    /// The dimension and the tag of an entity.
    fn entity(&mut self) -> Result<(i32, i32), FileError> {
        Ok((self.int("the dimension of an entity")?, self.int("the tag of an entity")?))
    }

    /// The number of blocks and of entries in a section, with the lowest and highest tag behind them.
    fn counts(&mut self) -> Result<[u64; 2], FileError> {
        let [blocks, all, lowest, highest] = [0; 4].map(|_| self.size("the number of blocks, of entries, or a tag"));
        lowest.and(highest)?;
        Ok([blocks?, all?])
    }

    /// Reads the end of a section.
    fn end(&mut self, section: &str) -> Result<(), FileError> {
        let (line, end) = (self.line(), section.replacen('$', "$End", 1));
        self.require(line == end, format_args!("{:?} instead of {end}", shown(&line)))
    }

    /// Goes to the end of a section that is not needed.
    fn skip(&mut self, section: &str) -> Result<(), FileError> {
        self.require(section.starts_with('$'), format_args!("{:?} instead of a section", shown(section)))?;
        let end = memmem::find(self.rest(), section.replacen('$', "$End", 1).as_bytes());
        self.position += end.ok_or_else(|| self.wrong(format_args!("{:?} without its end", shown(section))))?;
        Ok(())
    }

    /// Reads the first section.
    fn format(&mut self) -> Result<(), FileError> {
        let section = self.line();
        self.require(section == "$MeshFormat", "another beginning than $MeshFormat: it is no mesh of Gmsh")?;
        let [version, mode, size] = [0; 3].map(|_| self.word());
        let allowed = "must be 4.1: save it with `Mesh.MshFileVersion = 4.1`, or `gmsh -format msh41`";
        self.require(version == "4.1", format_args!("the version {:?} of MSH; {allowed}", shown(&version)))?;
        let allowed = ["0", "1"].contains(&mode.as_str()) && size == "8";
        self.require(allowed, "another type of file than 0 or 1, or another size of numbers than 8")?;
        self.binary = mode == "1";
        if self.binary {
            self.position += 1;
            let order = "numbers in another order of bytes; save it as text, `Mesh.Binary = 0`";
            let is_one = self.int("the number 1")? == 1;
            self.require(is_one, order)?;
        }
        self.end(&section)
    }
}
