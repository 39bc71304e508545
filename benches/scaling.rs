//! The speed-up by threads that the measured tasks allow: `cargo bench --bench scaling -- --cells 20`, with `--detail` for the
//! regions that limit it.
//!
//! The block of `verification/race` with 8 cells³ particles runs on one thread. The times of all tasks are replayed for T threads: each task goes
//! to the first free thread, and nothing else runs at the same time. The prediction knows no cost of waking threads, and no limit of the memory.
//! Processes share the passes over the particles, and each of them does the rest of the work. Their speed-up is that of messages without cost.

use bfree::parallel::{Region, record, threads};
use bfree::scene::{self, Override};
use bfree::simulation::Simulation;
use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

/// The four problems: name, steps, changes of `scenes/block_static.json`.
const PROBLEMS: [(&str, usize, &[&str]); 4] = [
    ("dynamic, cubic", 10, &[DYNAMIC, CUBIC, "gravity.curve=[[0,1]]"]),
    ("dynamic, linear", 10, &[DYNAMIC, LINEAR, "gravity.curve=[[0,1]]"]),
    ("static, cubic", 4, &[STATIC, CUBIC]),
    ("static, linear", 4, &[STATIC, LINEAR]),
];
const CUBIC: &str = "approximation={\"bspline\":{\"degree\":3}}";
const LINEAR: &str = "approximation=\"linear\"";
const STATIC: &str = "time.step=0.25";
const DYNAMIC: &str = "time.scheme=\"newmark\"";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let cells = arguments.iter().skip_while(|one| *one != "--cells").nth(1).map_or(Ok(20), |cells| cells.parse())?;
    let detail = arguments.iter().any(|one| one == "--detail");
    let only = arguments.iter().skip_while(|one| *one != "--only").nth(1);
    println!("{} particles", 8 * cells * cells * cells);
    println!("problem          seconds  outside  regions a step  speed-up with 2, 4, 8, 16, 32, 64 threads");
    for (name, steps, changes) in PROBLEMS {
        if only.is_some_and(|only| !name.starts_with(only.as_str())) {
            continue;
        }
        let mut simulation = block(cells, changes)?;
        let begin = Instant::now();
        let (result, regions) = record(|| (0..steps).try_for_each(|_| simulation.advance().map(drop)));
        let end = Instant::now();
        result?;
        let total = (end - begin).as_secs_f64();
        let inside: f64 = regions.iter().map(|region| (region.end - region.begin).as_secs_f64()).sum();
        let outside = total - inside;
        let speed_up =
            |threads| total / (outside + regions.iter().map(|region| makespan(region, threads)).sum::<f64>());
        let speed_ups: Vec<_> = [2, 4, 8, 16, 32, 64].map(|threads| format!("{:.2}", speed_up(threads))).into();
        let (share, regions_a_step) = (100.0 * outside / total, regions.len() / steps);
        println!("{name:15} {total:8.2} {share:7.2}% {regions_a_step:15}  {}", speed_ups.join(", "));
        let passes: f64 = regions.iter().filter(|one| is_shared(one)).map(|one| one.tasks.iter().sum::<f64>()).sum();
        let by_processes = [2.0, 4.0, 8.0].map(|count| format!("{:.2}", total / (total - passes + passes / count)));
        println!(
            "{:15} passes {:.1} %, speed-up with 2, 4, 8 processes at most {}",
            "",
            100.0 * passes / total,
            by_processes.join(", ")
        );
        if detail {
            print_regions(&regions);
            print_gaps(begin, end, &regions);
        }
    }
    println!("the machine has {} threads here", threads());
    Ok(())
}

/// The block of the race with `cells` cells along each edge.
fn block(cells: usize, changes: &[&str]) -> Result<Simulation<3>, Box<dyn Error>> {
    let spacing = 1.0 / cells as f64;
    // Courant number 1.3 with the longitudinal wave, as in the race.
    let step = 1.3 * spacing / (1000.0_f64 * 0.7 / (1.3 * 0.4)).sqrt();
    let mut overrides = vec![format!("grid.spacing={spacing}").parse::<Override>()?];
    if changes.contains(&DYNAMIC) {
        overrides.push(format!("time.step={step}").parse()?);
    }
    for change in changes {
        overrides.push(change.parse()?);
    }
    let scene = scene::read_file("scenes/block_static.json".as_ref(), &overrides)?;
    Ok(scene.build("scenes".as_ref())?)
}

/// Whether processes share the tasks of a region.
fn is_shared(region: &Region) -> bool {
    ["sweep/regions.rs", "sweep/tiled.rs"].iter().any(|file| region.place.file().ends_with(file))
}

/// Seconds that the tasks of a region take on `threads` threads.
fn makespan(region: &Region, threads: usize) -> f64 {
    let mut free = vec![0.0_f64; threads];
    for task in &region.tasks {
        if let Some(first) = free.iter_mut().min_by(|a, b| a.total_cmp(b)) {
            *first += task;
        }
    }
    free.into_iter().fold(0.0, f64::max)
}

fn place(region: &Region) -> String {
    format!("{}:{}", region.place.file(), region.place.line())
}

/// Prints the regions of each line that lose most time with 16 threads.
fn print_regions(regions: &[Region]) {
    let mut lines = BTreeMap::<String, (usize, f64, f64)>::new();
    for region in regions {
        let (count, alone, shared) = lines.entry(place(region)).or_default();
        *count += 1;
        *alone += (region.end - region.begin).as_secs_f64();
        *shared += makespan(region, 16);
    }
    let mut lines: Vec<_> = lines.into_iter().collect();
    lines.sort_by(|a, b| b.1.2.total_cmp(&a.1.2));
    for (place, (count, alone, shared)) in lines {
        println!("    {alone:8.4} s, {shared:8.4} s with 16 threads, {count:6} regions of {place}");
    }
}

/// Prints the longest times between two regions, summed over the pairs of lines.
fn print_gaps(begin: Instant, end: Instant, regions: &[Region]) {
    let mut gaps = BTreeMap::<(String, String), (f64, usize)>::new();
    let (mut last, mut from) = (begin, "the beginning".to_owned());
    let places = regions
        .iter()
        .map(|region| (region.begin, region.end, format!("{}:{}", region.place.file(), region.place.line())));
    for (begin, until, place) in places.chain([(end, end, "the end".to_owned())]) {
        let gap = gaps.entry((std::mem::replace(&mut from, place.clone()), place)).or_default();
        gap.0 += (begin - last).as_secs_f64();
        gap.1 += 1;
        last = until;
    }
    let mut gaps: Vec<_> = gaps.into_iter().collect();
    gaps.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    for ((from, to), (seconds, count)) in gaps.into_iter().take(12) {
        println!("    {seconds:8.4} s in {count:6} times  from {from} to {to}");
    }
}
