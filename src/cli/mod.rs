//! The command line: arguments to what they ask for, its results to files, text and an exit code. The only code that knows clap.
//!
//! stdout carries the result (a summary, or the report's JSON); stderr everything else.
//! Exit: 0 done, 1 failed (with `--strict` also: done with warnings), 2 wrong usage, 3 input, 4 target missed, 130 interrupted.

mod args;
mod audit;
mod bake;
mod baked;
mod camera;
mod chart;
mod console;
mod folder;
mod inspect;
mod lights;
mod outputs;
mod pictures;
mod progress;
mod render;
mod signals;
mod summary;
mod units;
mod values;

use args::{Args, Command};
use clap::Parser;
use std::{ffi::OsString, process::ExitCode};

/// Runs the program and says how it ended.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = match Args::try_parse_from(arguments) {
        Ok(args) => args,
        Err(message) => {
            // Help and version go to stdout, mistakes to stderr; a closed pipe is nobody's mistake.
            let _ = message.print();
            return ExitCode::from(message.exit_code() as u8);
        }
    };
    let result = match args.command {
        Command::Bake(options) => bake::run(&options),
        Command::Audit(options) => audit::run(&options),
        Command::Render(options) => render::run(&options),
        Command::Inspect(options) => inspect::run(&options),
        Command::Chart(options) => chart::run(&options),
    };
    result.unwrap_or_else(|error| {
        console::error(&error);
        ExitCode::from(error.exit_code())
    })
}
