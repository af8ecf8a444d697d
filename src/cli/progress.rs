//! Where the bake is: a bar on a terminal, sparse lines elsewhere, nothing with `--quiet`.

use super::console;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use luxel::progress::Observer;
use std::{
    io::IsTerminal,
    sync::{
        Mutex,
        atomic::{AtomicU32, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

/// Least time between two plain lines about the same room.
const PAUSE: Duration = Duration::from_secs(5);

/// An observer that talks to the user.
pub struct Progress {
    voice: Voice,
    /// Rays of the attempt; 0 where there is only one.
    rays: AtomicU32,
    room: Mutex<Option<Room>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Voice {
    Quiet,
    Lines,
    Bar,
}

struct Room {
    name: String,
    began: Instant,
    said: Instant,
    done: u64,
    total: u64,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// `quiet`: says nothing.
    pub fn new(quiet: bool) -> Self {
        let voice = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Voice::Quiet,
            (false, true) => Voice::Bar,
            (false, false) => Voice::Lines,
        };
        Progress { voice, rays: AtomicU32::new(0), room: Mutex::new(None) }
    }

    /// The last room is done; the terminal is clean again.
    pub fn finish(&self) {
        self.change(None);
    }

    fn change(&self, next: Option<Room>) {
        let mut room = self.lock();
        if let Some(last) = std::mem::replace(&mut *room, next) {
            if let Some(bar) = last.bar {
                bar.finish_and_clear();
            }
            let seconds = last.began.elapsed();
            if self.voice == Voice::Lines && seconds >= Duration::from_secs(1) {
                console::note(&format!("{}: done in {:.1} s", last.name, seconds.as_secs_f64()));
            }
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Option<Room>> {
        self.room.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Observer for Progress {
    fn attempt(&self, rays: u32) {
        self.rays.store(rays, Relaxed);
    }

    fn begin(&self, room: &'static str, total: u64) {
        if self.voice == Voice::Quiet {
            return;
        }
        let name = match self.rays.load(Relaxed) {
            0 => room.to_owned(),
            rays => format!("{rays} rays: {room}"),
        };
        let bar = (self.voice == Voice::Bar).then(|| bar(&name, total));
        let now = Instant::now();
        let begins = format!("{name} ...");
        self.change(Some(Room { name, began: now, said: now, done: 0, total, bar }));
        if self.voice == Voice::Lines {
            console::note(&begins);
        }
    }

    fn advance(&self, units: u64) {
        if self.voice == Voice::Quiet {
            return;
        }
        let mut room = self.lock();
        let Some(room) = room.as_mut() else { return };
        room.done += units;
        match &room.bar {
            Some(bar) => bar.inc(units),
            None if room.said.elapsed() >= PAUSE => {
                room.said = Instant::now();
                console::note(&line(&room.name, room.done, room.total, room.began.elapsed()));
            }
            None => {}
        }
    }

    fn plan(&self, line: &str) {
        match self.lock().as_ref().and_then(|r| r.bar.as_ref()) {
            Some(bar) => bar.suspend(|| console::note(line)),
            None if self.voice != Voice::Quiet => console::note(line),
            None => {}
        }
    }
}

fn bar(name: &str, total: u64) -> ProgressBar {
    let (length, template) = match total {
        0 => (None, "{msg:<12} {spinner} {elapsed}"),
        n => (Some(n), "{msg:<12} [{bar:32}] {percent:>3} %, {eta} left"),
    };
    let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr_with_hz(8));
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.progress_chars("=> "));
    bar.set_message(name.to_owned());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

fn line(name: &str, done: u64, total: u64, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    if total == 0 || done == 0 {
        return format!("{name}: {seconds:.0} s so far");
    }
    let share = (done as f64 / total as f64).min(1.0);
    let left = seconds * (1.0 - share) / share;
    format!("{name}: {:.0} %, about {left:.0} s left", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_the_time_left() {
        assert_eq!(line("transport", 1, 4, Duration::from_secs(10)), "transport: 25 %, about 30 s left");
        assert_eq!(line("atlas", 0, 0, Duration::from_secs(10)), "atlas: 10 s so far");
        assert_eq!(line("solve", 9, 4, Duration::from_secs(10)), "solve: 100 %, about 0 s left");
    }

    #[test]
    fn quiet_is_quiet() {
        let progress = Progress::new(true);
        progress.begin("atlas", 3);
        progress.advance(3);
        progress.finish();
        assert!(progress.lock().is_none());
    }
}
