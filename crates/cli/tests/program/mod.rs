//! The program's output, and folders for its files.

use std::path::PathBuf;
use std::process::Output;

pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Makes sure that it ended with this status and a message on one screen that has these words, and no defect of its own.
#[track_caller]
pub fn assert_fails(output: &Output, status: i32, words: &[&str]) {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{error}");
    for word in words {
        assert!(error.contains(word), "`{word}` is not in: {error}");
    }
    assert!(error.lines().count() <= 24, "longer than a screen: {error}");
    for word in ["defect", "panicked", "backtrace"] {
        assert!(!error.contains(word), "`{word}` is in: {error}");
    }
}

/// An empty folder for a test of these tests.
pub fn folder(tests: &str, name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(tests).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Arguments of a command with which its frames are cheap: indirect light as it is by default takes a second a frame without a
/// GPU, however small the picture is. What the arguments set wins.
#[allow(dead_code)]
pub fn cheap<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let (command, rest) = arguments.split_at(1.min(arguments.len()));
    let draws = matches!(command, ["render" | "bench" | "compare" | "sweep"]);
    let light: &[_] = if draws { &["--set", "indirect.technique=ambient"] } else { &[] };
    [command, light, rest].concat()
}
