//! Where and with what a result was measured.

use serde::Serialize;
use std::{fmt, fs, process::Command, thread::available_parallelism};

/// Machine, date and versions.
#[derive(Serialize)]
pub struct Machine {
    cpu: String,
    cores: usize,
    threads: usize,
    /// Processes that wanted a core, mean of the minute before: more than none of them make wall time worth less.
    load: f64,
    date: String,
    luxel: String,
    rustc: String,
    embree: Option<String>,
}

impl Machine {
    /// This one, now.
    pub fn new(embree: Option<String>) -> Self {
        let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let model = info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": "));
        Machine {
            cpu: model.map_or("unknown".into(), |(_, name)| name.into()),
            cores: available_parallelism().map_or(1, usize::from),
            threads: rayon::current_num_threads(),
            load: load.split(' ').next().and_then(|l| l.parse().ok()).unwrap_or(f64::NAN),
            date: says("date", &["-u", "+%F"]),
            luxel: says("git", &["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--dirty"]),
            rustc: says("rustc", &["--version"]),
            embree,
        }
    }
}

fn says(program: &str, arguments: &[&str]) -> String {
    let said = Command::new(program).args(arguments).output().ok().filter(|o| o.status.success());
    said.map_or("unknown".into(), |o| String::from_utf8_lossy(&o.stdout).trim().into())
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Machine { cpu, cores, threads, load, date, luxel, rustc, embree } = self;
        let embree = embree.as_deref().unwrap_or("none");
        write!(
            f,
            "{date}, {cpu}, {cores} cores, {threads} threads, load {load}, luxel {luxel}, {rustc}, Embree {embree}"
        )
    }
}
