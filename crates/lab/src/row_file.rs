//! A file of rows, each a line of JSON: what stands in it, and a row more, whatever kills the program meanwhile.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use serde::Deserialize;

use crate::Error;

#[derive(Deserialize)]
struct Known {
    id: String,
}

/// What a row begins with, so that one that was cut off is known from other text.
const BEGINS: &str = "{\"id\":\"";

/// Rows that the file holds whole. One that was cut off while it was written is taken away; a file of anything else is left
/// as it is.
pub(crate) fn known(path: &Path) -> Result<BTreeSet<String>, Error> {
    let mut file = match OpenOptions::new().read(true).write(true).open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeSet::new()),
        Err(source) => return Err(Error::File { what: "cannot read", path: path.to_owned(), source }),
    };
    lock(&file);
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(Error::file("cannot read", path))?;
    let id = |line: &[u8]| serde_json::from_slice::<Known>(line).ok().map(|row| row.id);
    let blank = |line: &[u8]| line.iter().all(u8::is_ascii_whitespace);
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
    let (lines, last) = bytes.split_at(whole);
    let no_row = |number: usize| {
        let path = path.display();
        Error::Work(format!(
            "{path}, line {number}: it is no row of a sweep; name another file, or take the line away"
        ))
    };
    let mut known = BTreeSet::new();
    let numbered = (1..).zip(lines.split(|byte| *byte == b'\n'));
    for (number, line) in numbered.filter(|(_, line)| !blank(line)) {
        known.insert(id(line).ok_or_else(|| no_row(number))?);
    }
    if blank(last) {
        return Ok(known);
    }
    if let Some(id) = id(last) {
        // Whole but for the end of its line.
        known.insert(id);
        file.write_all(b"\n").map_err(Error::file("cannot write", path))?;
    } else if last.starts_with(BEGINS.as_bytes()) || BEGINS.as_bytes().starts_with(last) {
        file.set_len(whole as u64).map_err(Error::file("cannot write", path))?;
    } else {
        return Err(no_row(lines.split(|byte| *byte == b'\n').count()));
    }
    Ok(known)
}

/// Appends a line, whole or not at all for those who read it with [`known`].
pub(crate) fn append(path: &Path, line: &str) -> Result<(), Error> {
    let write = || -> std::io::Result<()> {
        let mut file = OpenOptions::new().create(true).append(true).open(path)?;
        lock(&file);
        file.seek(SeekFrom::End(0))?;
        file.write_all(format!("{line}\n").as_bytes())?;
        file.sync_data()
    };
    write().map_err(Error::file("cannot write", path))
}

/// Other processes wait; the lock ends with the file. Where a file system has none, each process needs a file of its own.
fn lock(file: &File) {
    let _ = file.lock();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str) -> std::path::PathBuf {
        std::env::temp_dir().join(format!("chiaro_sweep_{}_{name}.jsonl", std::process::id()))
    }

    #[test]
    fn a_row_cut_off_is_taken_away_and_whole_ones_are_known() {
        let path = file("cut");
        std::fs::write(&path, "{\"id\":\"a\",\"x\":1}\n{\"id\":\"b\"}\n{\"id\":\"c").unwrap();
        let ids: Vec<_> = known(&path).unwrap().into_iter().collect();
        assert_eq!(ids, ["a", "b"]);
        append(&path, "{\"id\":\"d\"}").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "{\"id\":\"a\",\"x\":1}\n{\"id\":\"b\"}\n{\"id\":\"d\"}\n");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_file_of_something_else_is_left_alone_and_named() {
        let path = file("else");
        for (text, line) in [
            ("{\"id\":\"a\"}\ndear diary\n", "line 2"),
            ("{\"asset\":{\"version\":\"2.0\"}}", "line 1"),
            ("{\"id\":\"a\"}\n\u{feff}x", "line 2"),
            ("v/1\u{1}", "line 1"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = known(&path).unwrap_err().to_string();
            assert!(error.contains(line), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        // Whole but for the end of its line, as editors may leave it.
        std::fs::write(&path, "{\"id\":\"a\"}\n{\"id\":\"b\"}").unwrap();
        assert_eq!(known(&path).unwrap().len(), 2);
        append(&path, "{\"id\":\"c\"}").unwrap();
        assert_eq!(known(&path).unwrap().len(), 3);
        std::fs::remove_file(path).unwrap();
    }
}
