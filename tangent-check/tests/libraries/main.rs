//! Laws in Fortran and C, compiled here and called in this program and in a child process.

#![cfg(all(unix, feature = "libraries"))]

mod answers;
mod compiled;
mod faults;
mod steps;

use std::time::{Duration, Instant};

use compiled::{host, umat};
use steps::general_step;
use tangent_check::convention::Measure;
use tangent_check::library::child::{Child, LIMIT};
use tangent_check::library::{Caller, empty_response, open};

const LAMBDA: f64 = 3.0;
const MU: f64 = 2.0;

/// Calls per second, in this program and through the child. `cargo test --release … speed -- --nocapture` prints them.
#[test]
fn speed() {
    let Some(description) = umat("neo_hookean.f", Measure::JaumannKirchhoff, &[LAMBDA, MU], 0) else { return };
    let callers: [(&str, Box<dyn Caller>); 2] = [
        ("in this program", open(&description).unwrap()),
        ("through the child", Box::new(Child::start(host(), description, LIMIT).unwrap())),
    ];
    for (place, mut caller) in callers {
        let step = general_step(caller.signature(), false);
        let mut response = empty_response();
        let start = Instant::now();
        let mut calls = 0;
        while start.elapsed() < Duration::from_millis(300) {
            caller.call(&step, &mut response).unwrap();
            calls += 1;
        }
        println!("neo_hookean.f {place}: {:.0} calls a second", f64::from(calls) / start.elapsed().as_secs_f64());
        assert!(calls > 100);
    }
}
