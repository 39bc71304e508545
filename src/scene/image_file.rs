//! Pictures (PNG, in 2D) and scans (raw voxels, in 3D) as shapes.

use super::file::{FileError, ending, open};
use super::vector::corners;
use crate::problems::Problems;
use crate::shape::{Mask, Pixels};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Maximum number of pixels of a file.
const MAX_PIXELS: u64 = 1 << 27;

/// Maximum number of bytes that deflate packs into one byte: a PNG file that claims more is broken.
const MAX_COMPRESSION: u64 = 1032;

/// Pixels of a picture, or voxels of a scan, whose value lies in a range.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageFile {
    /// Path of the file, relative to the scene's folder. In 2D, a grey PNG of at most 8 bits (with fewer bits, white is still 255). In 3D,
    /// a `.raw` file of one unsigned byte per voxel, x fastest, then y, then z.
    #[schemars(length(min = 1))]
    pub file: PathBuf,
    /// The lower corner of the box that the picture covers (length). The last row of a PNG, at the bottom of the picture, begins at this
    /// corner.
    pub min: Vec<f64>,
    /// The upper corner (length), above `min` in every component.
    pub max: Vec<f64>,
    /// The smallest and the largest value, 0 to 255, of pixels that belong to the shape: one label twice, or a threshold and 255.
    pub values: [u8; 2],
    /// Number of voxels of a raw file along x, y and z; a PNG file states its own size.
    #[schemars(inner(range(min = 1)))]
    pub size: Option<[u32; 3]>,
    /// The pixels, once the file has been read.
    #[serde(skip)]
    read: OnceLock<Mask>,
}

impl ImageFile {
    /// The solid; `None` if it is not allowed, with the reasons in `problems`, and before the file has been read.
    pub(super) fn build<const D: usize>(&self, problems: &mut Problems, path: &str) -> Option<Pixels<D>> {
        if D < 2 {
            problems.refuse(path, "an image", "needs a grid of 2 or 3 dimensions");
            return None;
        }
        let format = if D == 2 { "png" } else { "raw" };
        let allowed = format!("must end in .{format} in {D} dimensions");
        let named = ending(&self.file) == format;
        problems.require(named, &format!("{path}.file"), format_args!("{:?}", self.file), allowed);
        let corners = corners::<D>(problems, path, &self.min, &self.max);
        let ([least, most], allowed) = (self.values, "must be the least value, then the greatest");
        problems.require(least <= most, &format!("{path}.values"), format_args!("[{least}, {most}]"), allowed);
        let path = format!("{path}.size");
        match self.size {
            None => _ = problems.require(D == 2, &path, "nothing", "must give the voxels along x, y and z"),
            Some(size) if D == 2 => {
                problems.refuse(&path, format_args!("{size:?}"), "must not be given: the picture knows its size");
            }
            Some(size) => {
                let allowed = format!("must be three numbers of at least 1 whose product is at most {MAX_PIXELS}");
                problems.require(pixels(&size).is_some(), &path, format_args!("{size:?}"), allowed);
            }
        }
        let [min, max] = corners?;
        Pixels::new(min, max, self.read.get()?.clone())
    }

    /// Reads the file, unless it has been read.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or size, or has no pixel in the range of values.
    pub(super) fn read(&self, folder: &Path) -> Result<(), FileError> {
        if self.read.get().is_some() {
            return Ok(());
        }
        let (file, length) = open(&folder.join(&self.file))?;
        let (count, bytes) = match self.size {
            Some(size) => (size, raw(file, &size, length)?),
            None => grey(file, length)?,
        };
        let [least, most] = self.values;
        let inside = bytes.iter().map(|value| (least..=most).contains(value));
        let mask = Mask::new(count.map(|n| n as usize), inside).ok_or_else(|| {
            let (low, high) = bytes.iter().fold((u8::MAX, 0), |(low, high), &value| (low.min(value), high.max(value)));
            FileError(format!("has no pixel of a value from {least} to {most}: its values are from {low} to {high}"))
        })?;
        let _ = self.read.set(mask);
        Ok(())
    }
}

/// The number of pixels, if it is allowed.
fn pixels(size: &[u32]) -> Option<u64> {
    let product = size.iter().try_fold(1_u64, |all, &n| all.checked_mul(n.into()));
    product.filter(|pixels| (1..=MAX_PIXELS).contains(pixels))
}

fn wrong_length(found: u64, asked: u64) -> FileError {
    FileError(format!("has {found} bytes, and {asked} pixels"))
}

/// The voxels of a raw file.
fn raw(mut file: BufReader<File>, size: &[u32; 3], found: u64) -> Result<Vec<u8>, FileError> {
    let asked = pixels(size).unwrap_or(u64::MAX);
    if found != asked {
        return Err(wrong_length(found, asked));
    }
    let mut bytes = vec![0; asked as usize];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// The pixels of a PNG file, the last row first, so that y increases upwards.
fn grey(file: BufReader<File>, found: u64) -> Result<([u32; 3], Vec<u8>), FileError> {
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(io::Error::from)?;
    let info = reader.info();
    let (width, height) = info.size();
    let (color, depth, transparent) = (info.color_type, info.bit_depth, info.trns.is_some());
    if color != png::ColorType::Grayscale || depth == png::BitDepth::Sixteen || transparent {
        let transparent = if transparent { ", transparent" } else { "" };
        return Err(FileError(format!(
            "is a PNG of {color:?} and {} bits{transparent}; grey ones of 1, 2, 4 or 8 bits are allowed, without transparency",
            depth as u8
        )));
    }
    let asked = pixels(&[width, height])
        .ok_or_else(|| FileError(format!("has {width} × {height} pixels; 1 to {MAX_PIXELS} in all are allowed")))?;
    if asked * depth as u64 / 8 > MAX_COMPRESSION * found {
        return Err(wrong_length(found, asked));
    }
    let mut bytes = vec![0; asked as usize];
    reader.next_frame(&mut bytes).map_err(io::Error::from)?;
    let rows = bytes.chunks_exact(width as usize).rev();
    Ok(([width, height, 1], rows.flatten().copied().collect()))
}
