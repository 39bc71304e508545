//! The files of a run: tables by column, snapshots by point.

use crate::support::{Failure, said};
use bfree::output::vtu::Snapshot;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

/// The columns of a table, by name. Texts are NaN.
pub struct Table(pub HashMap<String, Vec<f64>>);

impl Table {
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().ok_or("an empty table")?.split(',').collect();
        let mut columns: HashMap<String, Vec<f64>> = names.iter().map(|name| ((*name).to_owned(), vec![])).collect();
        for line in lines {
            for (name, cell) in names.iter().zip(line.split(',')) {
                columns.get_mut(*name).ok_or("a column")?.push(cell.parse().unwrap_or(f64::NAN));
            }
        }
        Ok(Self(columns))
    }

    /// A column. Asking for it counts as comparing it.
    pub fn column(&self, name: &str) -> &[f64] {
        self.0.get(name).unwrap_or_else(|| panic!("no column {name} among {:?}", self.0.keys()))
    }

    /// Three columns, row by row.
    pub fn vectors(&self, prefix: &str) -> Vec<Vector3<f64>> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| self.column(&format!("{prefix}{axis}")));
        (0..x.len()).map(|k| Vector3::new(x[k], y[k], z[k])).collect()
    }
}

/// The files of a run.
pub struct Run {
    folder: tempfile::TempDir,
}

impl Run {
    pub fn of(scene: &Value) -> Result<Self, Failure> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("scene.json");
        std::fs::write(&path, scene.to_string())?;
        let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
        let (code, _, text) =
            said(program.arg("run").arg(&path).arg("--out").arg(folder.path().join("out")).arg("--quiet"))?;
        assert_eq!(code, Some(0), "{scene}: {text}");
        Ok(Self { folder })
    }

    pub fn table(&self, name: &str) -> Result<Table, Failure> {
        Table::read(&self.folder.path().join("out").join(name))
    }

    pub fn report(&self) -> Result<Value, Failure> {
        Ok(serde_json::from_slice(&std::fs::read(self.folder.path().join("out/report.json"))?)?)
    }

    /// The snapshots of all steps, from the start on.
    pub fn snapshots(&self, kind: &str) -> Result<Vec<State>, Failure> {
        let path = |k: usize| self.folder.path().join(format!("out/{kind}_{k:06}.vtu"));
        let paths = (0..).map(path).take_while(|path| path.exists());
        let states: Vec<State> = paths.map(|path| Ok(State(Snapshot::read(&path)?))).collect::<Result<_, Failure>>()?;
        assert!(states.len() > 1, "no snapshots of {kind}");
        Ok(states)
    }
}

/// A snapshot.
pub struct State(pub Snapshot);

impl State {
    pub fn len(&self) -> usize {
        self.0.points.len()
    }

    /// The numbers of a point in an array.
    pub fn at(&self, name: &str, point: usize) -> &[f64] {
        let array = self.0.arrays.iter().find(|array| array.name == name);
        let array = array.unwrap_or_else(|| panic!("no array {name}"));
        let count = array.components.len();
        &array.values[count * point..count * (point + 1)]
    }

    pub fn scalar(&self, name: &str, point: usize) -> f64 {
        self.at(name, point)[0]
    }

    pub fn vector(&self, name: &str, point: usize) -> Vector3<f64> {
        Vector3::from_column_slice(self.at(name, point))
    }

    pub fn position(&self, point: usize) -> Vector3<f64> {
        Vector3::from(self.0.points[point])
    }

    pub fn gradient(&self, point: usize) -> Matrix3<f64> {
        Matrix3::from_row_slice(self.at("deformation_gradient", point))
    }

    /// Σ over the points that a condition holds for.
    pub fn sum<T: std::iter::Sum>(&self, of: impl Fn(usize) -> T) -> T {
        (0..self.len()).map(of).sum()
    }

    /// Σ m v or Σ m x × v of a body.
    pub fn momenta(&self, body: f64) -> [Vector3<f64>; 2] {
        let of = |p: usize| {
            let momentum = self.vector("velocity", p) * self.scalar("mass", p);
            if self.scalar("body", p) == body { momentum } else { Vector3::zeros() }
        };
        [self.sum(of), self.sum(|p| self.position(p).cross(&of(p)))]
    }
}
