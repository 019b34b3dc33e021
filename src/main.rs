//! The `surefoot` binary.

use std::process::ExitCode;
fn main() -> ExitCode {
    let _telemetry = surefoot::cli::telemetry::start();
    match surefoot::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // One line with all causes: a backtrace tells the person at the terminal nothing.
            eprintln!("surefoot: {error:#}");
            ExitCode::FAILURE
        }
    }
}
