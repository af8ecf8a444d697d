//! How much memory the machine has left, and how much this process has used at most.

use crate::error::{Error, Result};
use sysinfo::{MemoryRefreshKind, Process, ProcessRefreshKind, ProcessesToUpdate, System};

const MB: u64 = 1 << 20;

/// What to change where a bake needs more than there is.
pub const REMEDY: &str = "lower --resolution or --texels-per-meter, or --rays, or add --no-reuse";

/// Refuses what needs more than there is; `remedy`: what to change.
pub fn fits(need_mb: u64, free_mb: u64, remedy: &str) -> Result<()> {
    if need_mb > free_mb { Err(Error::Memory { need_mb, free_mb, remedy: remedy.into() }) } else { Ok(()) }
}

/// Memory (MB) that can be had without swapping, within the limits of this process and of the container it runs in. Huge
/// where the system does not tell.
pub fn free_mb() -> u64 {
    let free = |mut system: System| {
        system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
        // What the container holds beyond its resident set is file cache, which gives way.
        let left = |limit: sysinfo::CGroupLimits| limit.total_memory.saturating_sub(limit.rss);
        let own = with_own_process(&mut system, |p| p.cgroup_limits()).flatten();
        let limits = [system.cgroup_limits(), own].into_iter().flatten().map(left);
        limits.chain(address_space()).fold(system.available_memory(), u64::min)
    };
    System::new().map_or(u64::MAX, free) / MB
}

/// Largest resident memory (MB) of this process so far; where the system does not tell, the present one.
pub fn peak_mb() -> u64 {
    high_water_mark().unwrap_or_else(|| resident().unwrap_or(0)).div_ceil(MB)
}

/// Resident memory (MB) of this process; 0 where the system does not tell.
pub fn resident_mb() -> u64 {
    resident().unwrap_or(0).div_ceil(MB)
}

fn high_water_mark() -> Option<u64> {
    status("VmHWM:")
}

/// Bytes of addresses that this process may still take, if they are limited (`ulimit -v`).
fn address_space() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|l| l.strip_prefix("Max address space"))?;
    let limit = line.split_whitespace().next()?.parse::<u64>().ok()?;
    Some(limit.saturating_sub(status("VmSize:")?))
}

/// Bytes that Linux counts under `key` for this process.
fn status(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kb| kb * 1024)
}

fn resident() -> Option<u64> {
    with_own_process(&mut System::new().ok()?, |p| p.memory())
}

fn with_own_process<T>(system: &mut System, ask: impl Fn(&Process) -> T) -> Option<T> {
    let pid = sysinfo::get_current_pid().ok()?;
    let what = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[pid]), false, what);
    system.process(pid).map(ask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_holds_what_was_once_used() {
        let before = peak_mb();
        let block = std::hint::black_box(vec![1u8; 64 << 20]);
        assert_eq!(block[block.len() / 2], 1);
        drop(block);
        assert!(before > 0 && peak_mb() >= 64);
    }

    #[test]
    fn some_memory_is_free() {
        assert!(free_mb() > 0);
    }
}
