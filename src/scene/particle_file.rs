//! Particles from a CSV file: `x[,y[,z]],volume[,vx[,vy[,vz]]]`.

use crate::tensor::Vector;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
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

/// A particle file that cannot be used: the line, and what is wrong there. Lines and columns are counted from 1.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ParticleFileError(String);

impl ParticleFileError {
    fn in_line(line: usize, what: impl Display) -> Self {
        Self(format!("line {line}: {what}"))
    }
}

fn unreadable(line: usize) -> impl Fn(io::Error) -> ParticleFileError {
    move |source| ParticleFileError::in_line(line, format_args!("cannot be read: {source}"))
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
pub fn read_file<const D: usize>(path: &Path) -> Result<FileParticles<D>, ParticleFileError> {
    let file = File::open(path).map_err(unreadable(1))?;
    read(BufReader::new(file))
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
pub fn read<const D: usize>(text: impl BufRead) -> Result<FileParticles<D>, ParticleFileError> {
    let mut lines = Lines { text, line: 0 };
    let header = lines.next_line()?.unwrap_or_default();
    let header = header.trim_start_matches('\u{feff}');
    let plain: Vec<&'static str> = AXES.into_iter().take(D).chain(["volume"]).collect();
    let moving: Vec<&'static str> = plain.iter().copied().chain(VELOCITIES.into_iter().take(D)).collect();
    let found: Vec<&str> = header.split(',').map(str::trim).collect();
    let names = if found == moving {
        moving
    } else if found == plain {
        plain
    } else {
        let (expected, with_velocity) = (plain.join(","), moving.join(","));
        let found = shortened(header);
        let what = format!("the header {found:?} is not allowed; must be {expected:?} or {with_velocity:?}");
        return Err(ParticleFileError::in_line(1, what));
    };

    let mut particles = FileParticles { positions: Vec::new(), volumes: Vec::new(), velocities: None };
    let mut velocities = Vec::new();
    while let Some(text) = lines.next_line()? {
        let line = lines.line;
        if text.trim().is_empty() {
            continue;
        }
        if particles.volumes.len() == MAX_PARTICLES {
            return Err(ParticleFileError::in_line(line, format_args!("more than {MAX_PARTICLES} particles")));
        }
        let found = text.split(',').count();
        if found != names.len() {
            let expected = names.len();
            let what = format!("{found} columns are not allowed; must be {expected}, as in the header");
            return Err(ParticleFileError::in_line(line, what));
        }
        let mut row = [0.0; 7];
        for (column, ((value, name), word)) in row.iter_mut().zip(&names).zip(text.split(',')).enumerate() {
            *value = number(word, line, column + 1, name)?;
        }
        particles.positions.push(Vector::from_fn(|k, _| row[k]));
        particles.volumes.push(row[D]);
        velocities.push(Vector::from_fn(|k, _| row[D + 1 + k]));
    }
    if particles.volumes.is_empty() {
        return Err(ParticleFileError("the file has no particles".to_owned()));
    }
    particles.velocities = (names.len() > D + 1).then_some(velocities);
    Ok(particles)
}

fn number(word: &str, line: usize, column: usize, name: &'static str) -> Result<f64, ParticleFileError> {
    let word = word.trim();
    let volume = name == "volume";
    match word.parse::<f64>() {
        Ok(x) if x.abs() <= 1e100 && (!volume || x > 0.0) => Ok(x),
        _ => {
            let allowed = if volume { "a finite number > 0" } else { "a finite number, at most 1e100 in size" };
            let found = shortened(word);
            let place = format!("line {line}, column {column} ({name})");
            Err(ParticleFileError(format!("{place}: {found:?} is not allowed; must be {allowed}")))
        }
    }
}

fn shortened(text: &str) -> String {
    text.trim_end().chars().take(80).collect()
}

/// Reads lines of bounded length, and counts them.
struct Lines<R> {
    text: R,
    line: usize,
}

impl<R: BufRead> Lines<R> {
    fn next_line(&mut self) -> Result<Option<String>, ParticleFileError> {
        self.line += 1;
        let line = self.line;
        let mut text = String::new();
        let read = self.text.by_ref().take(MAX_LINE + 1).read_line(&mut text);
        match read.map_err(unreadable(line))? {
            0 => Ok(None),
            length if length as u64 > MAX_LINE => {
                Err(ParticleFileError::in_line(line, format_args!("is longer than {MAX_LINE} bytes")))
            }
            _ => Ok(Some(text)),
        }
    }
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
