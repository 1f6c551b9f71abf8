//! The `chiaro` command line: renders, measures and explains scenes without a window.
//!
//! Exit status: 0 done, 1 the work failed, 2 wrong usage.

mod args;
mod asked;
mod bench;
mod camera_path;
mod compare;
mod diff;
mod frames;
mod info;
mod interrupt;
mod left;
mod output;
mod reference;
mod render;
mod suite;
mod values;
mod view;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};

fn main() -> ExitCode {
    // A panic is a defect of chiaro; the user gets one line that says so, not a backtrace.
    std::panic::set_hook(Box::new(|panic| {
        let message = panic.payload_as_str().unwrap_or("no message");
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        eprintln!(
            "error: chiaro has a defect: {message} ({place}); please report it with the command you ran"
        );
    }));
    let cli = Cli::parse();
    match std::panic::catch_unwind(|| run(&cli.command)) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(error)) if output::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Ok(Err(error)) => {
            eprintln!("error: {}", output::sentence(&error));
            if output::is_wrong_usage(&error) { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
        Err(_) => ExitCode::FAILURE,
    }
}

fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Render(args) => render::run(args),
        Command::View(args) => view::run(args),
        Command::Reference(args) => reference::run(args),
        Command::Merge(args) => reference::merge(args),
        Command::Bench(args) => bench::run(args),
        Command::Compare(args) => compare::compare(args),
        Command::Sweep(args) => compare::sweep(args),
        Command::Diff(args) => diff::run(args),
        Command::Scenes(args) => info::scenes(args),
        Command::Settings(args) => info::settings(args),
        Command::Info(args) => info::run(args),
    }
}
