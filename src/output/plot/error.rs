//! Errors of drawing.

use crate::output::{OutputError, vtu};
use std::path::PathBuf;

/// Pictures could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// A file of the run cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A table lacks a column.
    #[error("{} has no column {column:?}", path.display())]
    Column {
        /// The table.
        path: PathBuf,
        /// The column.
        column: String,
    },
    /// A cell of a table is no number.
    #[error("{}, line {line}: {cell:?} is not a number", path.display())]
    Cell {
        /// The table.
        path: PathBuf,
        /// The line; the header is line 1.
        line: usize,
        /// The content of the cell.
        cell: String,
    },
    /// The file is not a report of bfree.
    #[error("{} is no report written by bfree: {source}", path.display())]
    Report {
        /// The file.
        path: PathBuf,
        /// The reason given by the JSON parser.
        source: serde_json::Error,
    },
    /// A snapshot cannot be read.
    #[error(transparent)]
    Snapshot(#[from] vtu::ReadError),
    /// There are no snapshots for a movie.
    #[error("{} holds no snapshots: give the scene output.every", directory.display())]
    NoSnapshots {
        /// The directory.
        directory: PathBuf,
    },
    /// The snapshots do not hold the field asked for.
    #[error("the snapshots hold no field {field:?}; they hold {there}; the key output.fields says what a run writes")]
    Field {
        /// The field.
        field: String,
        /// The fields of the snapshots.
        there: String,
    },
    /// The renderer refused.
    #[error("cannot draw {name}: {reason}")]
    Draw {
        /// The picture.
        name: &'static str,
        /// The reason given by the renderer.
        reason: String,
    },
    /// A picture cannot be written.
    #[error(transparent)]
    Write(#[from] OutputError),
}
