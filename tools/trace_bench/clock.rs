//! Processor time, in which other programs on the machine do not count.
#![allow(unsafe_code)]

/// Seconds that this process has run, all threads together.
pub fn process_seconds() -> f64 {
    seconds(2)
}

/// Seconds that this thread has run.
pub fn thread_seconds() -> f64 {
    seconds(3)
}

#[repr(C)]
struct Timespec {
    seconds: i64,
    nanoseconds: i64,
}

unsafe extern "C" {
    fn clock_gettime(clock: i32, time: *mut Timespec) -> i32;
}

/// The clocks by their Linux numbers: CLOCK_PROCESS_CPUTIME_ID is 2, CLOCK_THREAD_CPUTIME_ID is 3.
fn seconds(clock: i32) -> f64 {
    let mut t = Timespec { seconds: 0, nanoseconds: 0 };
    // SAFETY: the call fills the structure, whose layout is that of 64-bit Linux.
    let failed = unsafe { clock_gettime(clock, &mut t) };
    assert_eq!(failed, 0, "64-bit Linux has this clock");
    t.seconds as f64 + t.nanoseconds as f64 * 1e-9
}
