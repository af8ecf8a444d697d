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

    #[test]
    fn work_counts() {
        let before = seconds().unwrap();
        // Ten thousand million steps, which take longer than a tenth of a second on any processor.
        assert!((0..1000).any(|_| {
            (0..10_000_000u32).fold(0, |x, step| std::hint::black_box(x ^ step));
            seconds().unwrap() - before > 0.1
        }));
    }
}
