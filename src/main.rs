//! The program `luxel`. Everything it knows of its command line is in [`cli`].

mod cli;

fn main() -> std::process::ExitCode {
    cli::run(std::env::args_os())
}
