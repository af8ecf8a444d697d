//! Time of this process on the processors, in which other programs on the machine do not count.

use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

/// Seconds that this process has run, all threads together, to a hundredth; `None` where the system does not tell.
pub fn seconds() -> Option<f64> {
    let mut system = System::new().ok()?;
    let pid = sysinfo::get_current_pid().ok()?;
    system.refresh_processes_specifics(
        ProcessesToUpdate::Some(&[pid]),
        false,
        ProcessRefreshKind::nothing().with_cpu(),
    );
    system.process(pid).map(|p| p.accumulated_cpu_time() as f64 * 1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[test]
    fn work_counts_and_sleep_does_not() {
        let work = |time: Duration| {
            let start = Instant::now();
            let mut x = 0u64;
            while start.elapsed() < time {
                x = std::hint::black_box(x.wrapping_add(1));
            }
        };
        let before = seconds().unwrap();
        work(Duration::from_millis(600));
        // Other tests of this process run at the same time: only the lower end is certain.
        assert!(seconds().unwrap() - before > 0.1);
    }
}
