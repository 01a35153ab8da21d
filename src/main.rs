//! The command line: parse, dispatch, one error printer, exit codes.

use std::process::ExitCode;

use glintmap::cli;

fn main() -> ExitCode {
    let cli = cli::parse();
    let json = cli.wants_json();
    match cli::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // A reader that closed our output (`glintmap suns … | head`) is no failure.
            let closed = error
                .chain()
                .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
                .any(|e| e.kind() == std::io::ErrorKind::BrokenPipe);
            if closed {
                return ExitCode::SUCCESS;
            }
            cli::tell(&error, json);
            ExitCode::from(cli::exit_code(&error).exit_code())
        }
    }
}
