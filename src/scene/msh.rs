//! Meshes of Gmsh: files in the format MSH 4.1, as text and binary.
//!
//! Nothing is allocated for a number that is announced and not there: each entry takes bytes of the file.

use super::file::FileError;
use crate::problems::LARGEST;
use memchr::memmem;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Display;
use std::str::FromStr;

/// The dimension and the number of nodes of the elements of first order, by their type.
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
    /// The tags of the groups that each entity belongs to.
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
        let (mut mesh, mut file) = (Self::default(), Reader { bytes, at: 0, binary: false });
        file.format()?;
        loop {
            let section = file.line();
            // Binary numbers begin right behind the line.
            file.at += 1;
            match section.as_str() {
                "" => return Ok(mesh),
                "$PhysicalNames" => mesh.read_names(&mut file)?,
                "$Entities" => mesh.read_entities(&mut file)?,
                "$Nodes" => mesh.read_nodes(&mut file)?,
                "$Elements" => mesh.read_elements(&mut file)?,
                "$PartitionedEntities" => {
                    return Err(file.wrong("a partitioned mesh; save it before it is partitioned"));
                }
                _ if section.starts_with('$') => file.skip(&section)?,
                _ => return Err(file.wrong(format!("{:?} instead of a section such as $Nodes", shown(&section)))),
            }
            file.end(&section)?;
        }
    }

    /// The dimension and the elements of the physical group with this name, or with this tag if it has no name. It must have `dimension`
    /// dimensions, or one less.
    pub(super) fn group(&self, name: &str, dimension: i32) -> Result<(i32, Vec<&Block>), FileError> {
        let of_entity =
            |(entity, tags): (&(i32, i32), &Vec<i32>)| tags.iter().map(|&tag| (entity.0, tag)).collect::<Vec<_>>();
        let all: BTreeSet<(i32, i32)> =
            self.names.keys().copied().chain(self.groups.iter().flat_map(of_entity)).collect();
        let named = |group: &(i32, i32)| self.names.get(group).cloned().unwrap_or_else(|| group.1.to_string());
        let known = all.iter().filter(|group| (dimension - 1..=dimension).contains(&group.0));
        let found: Vec<_> = known.clone().filter(|group| named(group) == name).collect();
        let &[&(of, tag)] = found.as_slice() else {
            let kind = |of: i32| ["point", "curve", "surface", "volume"].get(of as usize).copied().unwrap_or("thing");
            if !found.is_empty() {
                let what = format!(
                    "has several physical groups {name:?}, a {} and a {}",
                    kind(dimension - 1),
                    kind(dimension)
                );
                return Err(FileError(format!("{what}; give each a name of its own")));
            }
            let list: Vec<_> =
                known.take(NAMED).map(|group| format!("{:?} ({})", shown(&named(group)), kind(group.0))).collect();
            let list = if list.is_empty() { "none of this kind".to_owned() } else { list.join(", ") };
            let kinds = format!("{} or {}", kind(dimension), kind(dimension - 1));
            return Err(FileError(format!("has no physical {kinds} {:?}; its groups are: {list}", shown(name))));
        };
        let is_own = |block: &&Block| {
            block.entity.0 == of && self.groups.get(&block.entity).is_some_and(|groups| groups.contains(&tag))
        };
        let blocks: Vec<_> = self.blocks.iter().filter(is_own).collect();
        if blocks.iter().all(|block| block.nodes.is_empty()) {
            return Err(FileError(format!(
                "has no elements in the group {name:?}; mesh all of the part before saving it"
            )));
        }
        Ok((of, blocks))
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
                // A group that turns an entity around has it with a negative tag.
                let count = file.size("the number of groups of an entity")?;
                let groups = (0..count).map(|_| file.int("the tag of a group").map(i32::saturating_abs));
                self.groups.insert((dimension, tag), groups.collect::<Result<_, _>>()?);
                let sides = if dimension == 0 { 0 } else { file.size("the number of sides of an entity")? };
                for _ in 0..sides {
                    file.int("the tag of a side")?;
                }
            }
        }
        Ok(())
    }

    fn read_nodes(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let [blocks, all] = file.counts()?;
        for _ in 0..blocks {
            let dimension = file.int("the dimension of an entity")?;
            file.int("the tag of an entity")?;
            let parametric = file.int("0, or 1 for parametric nodes")? != 0;
            let count = file.size("the number of nodes in a block")?;
            let tags = (0..count).map(|_| file.size("the tag of a node")).collect::<Result<Vec<_>, _>>()?;
            for tag in tags {
                let mut x = [0.0; 3];
                for x in &mut x {
                    *x = file.real("a coordinate of a node")?;
                }
                // The parameters of the node on its entity.
                for _ in 0..if parametric { dimension.clamp(0, 3) } else { 0 } {
                    file.real("a parameter of a node")?;
                }
                if !x.iter().all(|x| x.abs() <= LARGEST) {
                    return Err(
                        file.wrong(format!("node {tag} at {x:?}; coordinates must be finite, up to {LARGEST:e}"))
                    );
                }
                if self.nodes.insert(tag, x).is_some() {
                    return Err(file.wrong(format!("node {tag} for the second time")));
                }
            }
        }
        file.has_all(self.nodes.len() as u64, all, "nodes")
    }

    fn read_elements(&mut self, file: &mut Reader) -> Result<(), FileError> {
        let [blocks, all] = file.counts()?;
        let mut found: u64 = 0;
        for _ in 0..blocks {
            let entity = (file.int("the dimension of an entity")?, file.int("the tag of an entity")?);
            let kind = file.int("the type of elements")?;
            let Some(&(_, dimension, size)) = ELEMENTS.iter().find(|(own, ..)| *own == kind) else {
                let what = "must be of first order: mesh with `Mesh.ElementOrder = 1`, or `gmsh -order 1`";
                return Err(file.wrong(format!("elements of type {kind}; elements {what}")));
            };
            if dimension != entity.0 {
                let what = format!("elements of type {kind}, which have dimension {dimension}");
                return Err(file.wrong(format!("{what}, in an entity of dimension {}", entity.0)));
            }
            let mut nodes = Vec::new();
            for _ in 0..file.size("the number of elements in a block")? {
                let tag = file.size("the tag of an element")?;
                for _ in 0..size {
                    let node = file.size("a node of an element")?;
                    if !self.nodes.contains_key(&node) {
                        return Err(file.wrong(format!("element {tag} with node {node}, which is not in $Nodes")));
                    }
                    nodes.push(node);
                }
                found += 1;
            }
            self.blocks.push(Block { entity, kind, size, nodes });
        }
        file.has_all(found, all, "elements")
    }
}

/// The beginning of a text.
fn shown(text: &str) -> String {
    text.chars().take(SHOWN).collect()
}

/// The bytes of a file, and the position up to which they have been read.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Reader<'a> {
    /// What is wrong where the file has been read up to.
    fn wrong(&self, what: impl Display) -> FileError {
        let before = &self.bytes[..self.at.min(self.bytes.len())];
        let line = || 1 + memchr::memchr_iter(b'\n', before).count();
        let place = if self.binary { format!("before byte {}", before.len()) } else { format!("in line {}", line()) };
        FileError(format!("has, {place}, {what}"))
    }

    /// The rest of the file, with or without the blanks at its beginning.
    fn rest(&mut self, blanks: bool) -> &'a [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let rest = if blanks { rest } else { rest.trim_ascii_start() };
        self.at = self.bytes.len() - rest.len();
        rest
    }

    /// The text up to the next byte of the kind `ends`.
    fn text(&mut self, ends: fn(&u8) -> bool) -> String {
        let rest = self.rest(false);
        let text = rest.split(ends).next().unwrap_or_default();
        self.at += text.len();
        String::from_utf8_lossy(text).trim().to_owned()
    }

    /// The next line that is not blank; empty at the end of the file.
    fn line(&mut self) -> String {
        self.text(|byte| *byte == b'\n')
    }

    /// The next number: N bytes, or a word.
    fn number<T: FromStr, const N: usize>(&mut self, what: &str, of: fn([u8; N]) -> T) -> Result<T, FileError> {
        if self.binary {
            let bytes = self.rest(true).first_chunk();
            self.at += N;
            return bytes.map(|bytes| of(*bytes)).ok_or_else(|| self.wrong(format!("its end instead of {what}")));
        }
        let word = self.text(u8::is_ascii_whitespace);
        word.parse().map_err(|_| self.wrong(format!("{:?} instead of {what}", shown(&word))))
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

    /// The numbers of blocks and of entries in a section.
    fn counts(&mut self) -> Result<[u64; 2], FileError> {
        let counts = [self.size("the number of blocks")?, self.size("the number of entries")?];
        self.size("the lowest tag")?;
        self.size("the highest tag")?;
        Ok(counts)
    }

    fn has_all(&self, found: u64, announced: u64, what: &str) -> Result<(), FileError> {
        let all = found == announced;
        if all { Ok(()) } else { Err(self.wrong(format!("{found} {what}, where {announced} are announced"))) }
    }

    /// Reads the end of a section.
    fn end(&mut self, section: &str) -> Result<(), FileError> {
        let (line, end) = (self.line(), section.replacen('$', "$End", 1));
        if line == end { Ok(()) } else { Err(self.wrong(format!("{:?} instead of {end}", shown(&line)))) }
    }

    /// Goes to the end of a section that is not needed.
    fn skip(&mut self, section: &str) -> Result<(), FileError> {
        let end = section.replacen('$', "\n$End", 1);
        // The section may be empty.
        self.at -= 1;
        let length = memmem::find(self.rest(true), end.as_bytes());
        self.at += length.ok_or_else(|| self.wrong(format!("{:?} without its end", shown(section))))?;
        Ok(())
    }

    /// Reads the first section.
    fn format(&mut self) -> Result<(), FileError> {
        let section = self.line();
        if section != "$MeshFormat" {
            return Err(FileError("is no file of Gmsh, which begins with $MeshFormat".to_owned()));
        }
        let [version, mode, size] = [0; 3].map(|_| self.text(u8::is_ascii_whitespace));
        if version != "4.1" {
            let what = "4.1 is read: save with `Mesh.MshFileVersion = 4.1`, or `gmsh -format msh41`";
            return Err(self.wrong(format!("the format MSH {:?}; {what}", shown(&version))));
        }
        if !["0", "1"].contains(&mode.as_str()) || size != "8" {
            return Err(self.wrong("another type of file or size of numbers than 0 or 1, and 8"));
        }
        if mode == "1" {
            (self.binary, self.at) = (true, self.at + 1);
            if self.int("the number 1")? != 1 {
                return Err(self.wrong("numbers whose bytes are in another order; save as text, `Mesh.Binary = 0`"));
            }
        }
        self.end(&section)
    }
}
