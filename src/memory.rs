//! Memory of the machine and of this process.

use sysinfo::System;

/// Memory that can be used now, in MB; a container's limit counts.
pub fn free_mb() -> u64 {
    let mut system = System::new();
    system.refresh_memory();
    let free = system.cgroup_limits().map_or(u64::MAX, |c| c.free_memory).min(system.available_memory());
    free >> 20
}

/// Largest memory this process has held, in MB; 0 where the system does not tell.
pub fn peak_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).map_or(0, |kb| kb >> 10)
}
