//! The file format: a header in JSON and arrays of floats, each with a checksum.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `bfree\r\n` and 0x1A: a transfer as text changes these bytes, so the damage is detected |
//! | 4 | version of the format |
//! | 4 | length of the header |
//! | … | the header in JSON: names, types and lengths of the arrays, and the content given by the writer |
//! | 4 | CRC-32 of version, length and header |
//! | … | the numbers of each array, followed by their CRC-32 |
//!
//! All numbers are little endian. The file ends with the last checksum. A file that is shorter or longer is refused.

use crc32fast::{Hasher, hash};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};

const MAGIC: &[u8; 8] = b"bfree\r\n\x1a";

/// Version of the format.
const VERSION: u32 = 9;

/// Numbers converted to bytes at a time.
const CHUNK: usize = 8192;

/// The arrays of a file, by name.
pub(super) type Arrays = BTreeMap<String, Vec<f64>>;

/// Reason why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Damage {
    /// The file cannot be read.
    #[error("it cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The file is not a checkpoint of bfree.
    #[error("it is no checkpoint of bfree")]
    Foreign,
    /// The file has another version of the format.
    #[error("its format is version {0}, this program reads version {VERSION}")]
    Version(u32),
    /// The file has the wrong length: it is cut off, or bytes were appended.
    #[error("it has {found} bytes and should have {expected}")]
    Length {
        /// Bytes found in the file.
        found: u64,
        /// Bytes that the file should have.
        expected: u64,
    },
    /// A checksum is wrong.
    #[error("its {0} is damaged: the checksum is wrong")]
    Checksum(String),
    /// All checksums are right, but the content does not describe a checkpoint.
    #[error("its content is not understood: {0}")]
    Content(String),
}

/// The type of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Type {
    F64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Shape {
    name: String,
    r#type: Type,
    length: u64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header<H> {
    arrays: Vec<Shape>,
    content: H,
}

/// Writes `content` and `arrays` in the format of this module.
pub(super) fn write(
    out: &mut impl Write,
    content: &impl Serialize,
    arrays: &[(&str, Cow<'_, [f64]>)],
) -> io::Result<()> {
    let shape = |(name, values): &(&str, Cow<'_, [f64]>)| Shape {
        name: (*name).to_owned(),
        r#type: Type::F64,
        length: values.len() as u64,
    };
    let header = serde_json::to_vec(&Header { arrays: arrays.iter().map(shape).collect(), content })?;
    let length = u32::try_from(header.len()).map_err(|_| io::Error::other("its header would be too long"))?;
    let mut head = [VERSION.to_le_bytes(), length.to_le_bytes()].concat();
    head.extend(header);
    out.write_all(MAGIC)?;
    out.write_all(&head)?;
    out.write_all(&hash(&head).to_le_bytes())?;
    for (_, values) in arrays {
        let mut sum = Hasher::new();
        for chunk in values.chunks(CHUNK) {
            let bytes: Vec<u8> = chunk.iter().flat_map(|x| x.to_le_bytes()).collect();
            sum.update(&bytes);
            out.write_all(&bytes)?;
        }
        out.write_all(&sum.finalize().to_le_bytes())?;
    }
    Ok(())
}

/// Reads the bytes of a file.
pub(super) fn read<H: DeserializeOwned>(bytes: &[u8]) -> Result<(H, Arrays), Damage> {
    let found = bytes.len() as u64;
    let long_enough = |expected: u64| if found >= expected { Ok(()) } else { Err(Damage::Length { found, expected }) };
    if !bytes.starts_with(MAGIC) {
        return Err(Damage::Foreign);
    }
    let prefix = MAGIC.len() + 8;
    long_enough(prefix as u64)?;
    let (version, length) = (word(&bytes[MAGIC.len()..]), word(&bytes[MAGIC.len() + 4..]));
    if version != VERSION {
        return Err(Damage::Version(version));
    }
    let mut expected = prefix as u64 + u64::from(length) + 4;
    long_enough(expected)?;
    let (head, mut rest) = bytes.split_at(prefix + length as usize);
    if word(rest) != hash(&head[MAGIC.len()..]) {
        return Err(Damage::Checksum("header".to_owned()));
    }
    rest = &rest[4..];
    let Header { arrays: shapes, content } =
        serde_json::from_slice::<Header<H>>(&head[prefix..]).map_err(|error| Damage::Content(error.to_string()))?;
    for shape in &shapes {
        let bytes = shape.length.checked_mul(8).and_then(|bytes| bytes.checked_add(4));
        let sum = bytes.and_then(|bytes| expected.checked_add(bytes));
        expected = sum.ok_or_else(|| Damage::Content(format!("{} numbers of {}", shape.length, shape.name)))?;
    }
    mutant!("checkpoint: a file may be longer than its arrays": expected = expected.max(found));
    if found != expected {
        return Err(Damage::Length { found, expected });
    }
    let mut arrays = Arrays::new();
    for Shape { name, r#type: Type::F64, length } in shapes {
        let (numbers, after) = rest.split_at(8 * length as usize);
        let is_whole = word(after) == hash(numbers);
        mutant!("checkpoint: checksums of arrays are not compared": is_whole = true);
        if !is_whole {
            return Err(Damage::Checksum(format!("array {name}")));
        }
        arrays.insert(name, numbers.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x)).collect());
        rest = &after[4..];
    }
    Ok((content, arrays))
}

/// The number in the first four bytes, of which there are at least four.
fn word(bytes: &[u8]) -> u32 {
    bytes.first_chunk().map_or(0, |&word| u32::from_le_bytes(word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::{Value, json};

    const WILD: [f64; 6] = [0.1, -0.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE / 8.0, 1.0 / 3.0];

    fn written(lengths: &[usize]) -> Vec<u8> {
        let values: Vec<Vec<f64>> =
            lengths.iter().map(|&n| (0..n).map(|k| WILD[k % 6] * (1 + k / 6) as f64).collect()).collect();
        let names = ["position", "velocity", "λ"];
        let arrays: Vec<(&str, Cow<'_, [f64]>)> = names.into_iter().zip(values.into_iter().map(Cow::from)).collect();
        let mut bytes = Vec::new();
        write(&mut bytes, &json!({"title": "two blocks"}), &arrays).unwrap();
        bytes
    }

    fn parsed(bytes: &[u8]) -> Result<(Value, Arrays), Damage> {
        read(bytes)
    }

    #[test]
    fn what_is_written_is_read_bit_for_bit() {
        for lengths in [&[][..], &[0], &[1, 0, 5], &[CHUNK], &[CHUNK + 1, 3 * CHUNK]] {
            let bytes = written(lengths);
            let (content, arrays) = parsed(&bytes).unwrap();
            assert_eq!(content["title"], "two blocks");
            // The names are in alphabetical order.
            assert_eq!(arrays.values().map(Vec::len).collect::<Vec<_>>(), lengths);
            for (name, values) in &arrays {
                let wild = (0..values.len()).map(|k| (WILD[k % 6] * (1 + k / 6) as f64).to_bits());
                assert!(values.iter().map(|x| x.to_bits()).eq(wild), "{name}");
            }
        }
    }

    #[test]
    fn a_file_of_any_other_length_is_refused() {
        let whole = written(&[7, 0, 40]);
        for length in 0..whole.len() {
            assert!(parsed(&whole[..length]).is_err(), "{length}");
        }
        let longer = [&whole[..], b"\0"].concat();
        assert!(matches!(parsed(&longer), Err(Damage::Length { .. })));
    }

    #[test]
    fn another_version_is_named() {
        let mut bytes = written(&[3]);
        bytes[8] = 200;
        let said = parsed(&bytes).unwrap_err().to_string();
        assert!(said.contains(&format!("version 200, this program reads version {VERSION}")), "{said}");
        assert!(matches!(parsed(b"{\"grid\": {}}, and so on"), Err(Damage::Foreign)));
    }

    #[test]
    fn a_header_that_asks_for_too_much_is_refused_before_anything_is_allocated() {
        for length in [u64::MAX, u64::MAX / 8, 1 << 50] {
            let header =
                json!({"arrays": [{"name": "x", "type": "f64", "length": length}], "content": null}).to_string();
            let mut head = [VERSION.to_le_bytes(), (header.len() as u32).to_le_bytes()].concat();
            head.extend(header.bytes());
            let bytes = [&MAGIC[..], &head, &crc32fast::hash(&head).to_le_bytes()].concat();
            assert!(matches!(parsed(&bytes), Err(Damage::Content(_) | Damage::Length { .. })), "{length}");
        }
    }

    proptest! {
        #[test]
        fn a_flipped_bit_is_seen_wherever_it_is(place in any::<prop::sample::Index>(), bit in 0..8) {
            let mut bytes = written(&[5, 0, 300]);
            let at = place.index(bytes.len());
            bytes[at] ^= 1_u8 << bit;
            prop_assert!(parsed(&bytes).is_err(), "byte {at}");
        }

        #[test]
        fn no_bytes_bring_the_reader_down(
            rubbish in prop::collection::vec(any::<u8>(), 0..200), from in 0..400_usize, headed in any::<bool>(),
        ) {
            let mut bytes = written(&[5, 20]);
            let from = if headed { from.min(bytes.len()) } else { 0 };
            bytes.truncate(from);
            bytes.extend(rubbish);
            let whole = written(&[5, 20]);
            prop_assert!(parsed(&bytes).is_err() || bytes == whole);
        }
    }
}
