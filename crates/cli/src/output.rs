//! Standard output: text for people, JSON for scripts.

use std::io::{ErrorKind, Write, stdout};

use serde::Serialize;

/// Prints `text` as it is.
///
/// `print!` panics when the reader of a pipe has left (`chiaro settings | head`); this returns the error instead,
/// which [`is_closed_pipe`] recognises.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Prints one line of JSON.
pub fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string(value)? + "\n"))
}

/// An error with its causes, on one line. A cause that the error's own words already hold is not said twice.
pub fn sentence(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| {
        if said.is_empty() {
            cause
        } else if said.contains(&cause) {
            said
        } else {
            format!("{said}: {cause}")
        }
    })
}

/// Whether the error says only that nobody reads the output any more.
pub fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}

/// What the user asked for cannot be asked for: the exit status is 2, as for flags that do not parse.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct WrongUsage(pub String);

/// Whether the command line is to blame, rather than a file, the device or the work.
pub fn is_wrong_usage(error: &anyhow::Error) -> bool {
    use chiaro_lab::is_usage;
    error.is::<WrongUsage>()
        || error.downcast_ref::<chiaro_lab::Error>().is_some_and(chiaro_lab::Error::is_usage)
        || error.downcast_ref::<chiaro::Error>().is_some_and(is_usage)
}
