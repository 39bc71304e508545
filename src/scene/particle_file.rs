//! Particles from a CSV file: `x[,y[,z]],volume[,vx[,vy[,vz]]]`.

use super::file::FileError;
use crate::tensor::Vector;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Maximum number of particles in one file.
const MAX_PARTICLES: usize = 100_000_000;

/// Maximum length of a line in bytes.
const MAX_LINE: u64 = 4096;

const AXES: [&str; 3] = ["x", "y", "z"];
const VELOCITIES: [&str; 3] = ["vx", "vy", "vz"];

/// The particles of a file. Each particle has one entry in every list.
#[derive(Clone, Debug, PartialEq)]
pub struct FileParticles<const D: usize> {
    /// Positions (length).
    pub positions: Vec<Vector<f64, D>>,
    /// Reference volumes (length^D), each > 0.
    pub volumes: Vec<f64>,
    /// Velocities, if the file has them.
    pub velocities: Option<Vec<Vector<f64, D>>>,
}

/// Reads the particle file at `path`.
///
/// ```
/// use bfree::scene::particle_file::{read, read_file};
///
/// let text = "x,y,volume\n0.25,0.25,0.25\n0.75,0.25,0.25\n";
/// let file = tempfile::NamedTempFile::new()?;
/// std::fs::write(file.path(), text)?;
/// let particles = read_file::<2>(file.path())?;
/// assert_eq!(particles, read(text.as_bytes())?);
/// assert_eq!(particles.volumes.iter().sum::<f64>(), 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first wrong line, and the wrong column in that line.
pub fn read_file<const D: usize>(path: &Path) -> Result<FileParticles<D>, FileError> {
    read(BufReader::new(File::open(path)?))
}

/// Reads particles from CSV text; blank lines are skipped.
///
/// ```
/// use bfree::scene::particle_file::read;
///
/// let bar = read::<1>("x,volume,vx\n0.5,1,2\n1.5,1,-2\n".as_bytes())?;
/// assert_eq!(bar.velocities.ok_or("velocities")?.iter().sum::<bfree::tensor::Vector<f64, 1>>()[0], 0.0);
/// // An error names line and column.
/// let error = read::<1>("x,volume\n0.5,1\n1.5,-1\n".as_bytes()).unwrap_err();
/// assert!(error.to_string().starts_with("line 3, column 2 (volume): \"-1\" is not allowed"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first wrong line, and the wrong column in that line.
pub fn read<const D: usize>(mut text: impl BufRead) -> Result<FileParticles<D>, FileError> {
    let mut particles = FileParticles { positions: Vec::new(), volumes: Vec::new(), velocities: None };
    let (mut names, mut velocities) = (Vec::new(), Vec::new());
    for line in 1.. {
        let fail = |what: String| FileError(format!("line {line}{what}"));
        let mut row = String::new();
        let length = text.by_ref().take(MAX_LINE + 1).read_line(&mut row);
        let length = length.map_err(|error| fail(format!(": cannot be read: {error}")))?;
        if length as u64 > MAX_LINE {
            return Err(fail(format!(": is longer than {MAX_LINE} bytes")));
        }
        if line == 1 {
            names = columns::<D>(&row).map_err(fail)?;
            continue;
        }
        if length == 0 {
            break;
        }
        if row.trim().is_empty() {
            continue;
        }
        if particles.volumes.len() == MAX_PARTICLES {
            return Err(fail(format!(": more than {MAX_PARTICLES} particles")));
        }
        let values = numbers(&row, &names).map_err(fail)?;
        particles.positions.push(Vector::from_fn(|k, _| values[k]));
        particles.volumes.push(values[D]);
        velocities.push(Vector::from_fn(|k, _| values[D + 1 + k]));
    }
    if particles.volumes.is_empty() {
        return Err(FileError("the file has no particles".to_owned()));
    }
    particles.velocities = (names.len() > D + 1).then_some(velocities);
    Ok(particles)
}

/// The names of the columns, from the header. An error continues "line 1".
fn columns<const D: usize>(header: &str) -> Result<Vec<&'static str>, String> {
    let header = header.trim_start_matches('\u{feff}');
    let plain: Vec<&'static str> = AXES.into_iter().take(D).chain(["volume"]).collect();
    let moving: Vec<&'static str> = plain.iter().copied().chain(VELOCITIES.into_iter().take(D)).collect();
    let found: Vec<&str> = header.split(',').map(str::trim).collect();
    let allowed = format!("must be {:?} or {:?}", plain.join(","), moving.join(","));
    let names = [plain, moving].into_iter().find(|names| *names == found);
    names.ok_or_else(|| format!(": the header {:?} is not allowed; {allowed}", shortened(header)))
}

/// The numbers of a row, one for each column. An error continues "line 7".
fn numbers(row: &str, names: &[&str]) -> Result<[f64; 7], String> {
    let (found, expected) = (row.split(',').count(), names.len());
    if found != expected {
        return Err(format!(": {found} columns are not allowed; must be {expected}, as in the header"));
    }
    let mut numbers = [0.0; 7];
    for (i, ((number, name), word)) in numbers.iter_mut().zip(names).zip(row.split(',')).enumerate() {
        let (word, is_volume) = (word.trim(), *name == "volume");
        let parsed = word.parse().ok().filter(|x: &f64| x.abs() <= 1e100 && (!is_volume || *x > 0.0));
        *number = parsed.ok_or_else(|| {
            let allowed = if is_volume { "a finite number > 0" } else { "a finite number, at most 1e100 in size" };
            format!(", column {} ({name}): {:?} is not allowed; must be {allowed}", i + 1, shortened(word))
        })?;
    }
    Ok(numbers)
}

fn shortened(text: &str) -> String {
    text.trim_end().chars().take(80).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_volumes_and_velocities_are_read() {
        let text = "\u{feff}x, y, volume, vx, vy\r\n1, 2, 0.25, -1, 0\r\n\n3,4,.5,1e-3,2\n";
        let particles: FileParticles<2> = read(text.as_bytes()).unwrap();
        assert_eq!(particles.positions, [Vector::from([1.0, 2.0]), Vector::from([3.0, 4.0])]);
        assert_eq!(particles.volumes, [0.25, 0.5]);
        assert_eq!(particles.velocities, Some(vec![Vector::from([-1.0, 0.0]), Vector::from([1e-3, 2.0])]));
        let particles: FileParticles<1> = read("x,volume\n7,1".as_bytes()).unwrap();
        assert_eq!((particles.positions[0][0], particles.velocities), (7.0, None));
    }

    #[test]
    fn errors_name_line_and_column() {
        let cases = [
            ("", "line 1: the header \"\" is not allowed; must be \"x,y,volume\" or \"x,y,volume,vx,vy\""),
            ("x,y\n", "line 1: the header \"x,y\""),
            ("x,y,z,volume\n", "line 1: the header"),
            ("x,y,volume\n", "the file has no particles"),
            ("x,y,volume\n1,2,1\n1,2\n", "line 3: 2 columns are not allowed; must be 3"),
            ("x,y,volume\n1,two,1\n", "line 2, column 2 (y): \"two\" is not allowed; must be a finite number"),
            ("x,y,volume\n1,2,-1\n", "line 2, column 3 (volume): \"-1\" is not allowed; must be a finite number > 0"),
            ("x,y,volume\n\nNaN,2,1\n", "line 3, column 1 (x): \"NaN\""),
            ("x,y,volume\n1,2,1e999\n", "line 2, column 3 (volume): \"1e999\""),
        ];
        for (text, words) in cases {
            let error = read::<2>(text.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with(words), "{text:?}: {error}");
        }
        let long = format!("x,y,volume\n1,2,{}", "1".repeat(5000));
        let error = read::<2>(long.as_bytes()).unwrap_err().to_string();
        assert!(error.starts_with("line 2: ") && error.contains("longer than"), "{error}");
        let error = read::<2>(&b"x,y,volume\n\xff,2,1"[..]).unwrap_err().to_string();
        assert!(error.starts_with("line 2: cannot be read"), "{error}");
    }
}
