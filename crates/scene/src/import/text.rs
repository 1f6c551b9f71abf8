//! Text from bytes whose encoding the format leaves open.

use std::borrow::Cow;

/// The text of a file, its lines ended by `\n` or `\r\n`.
///
/// UTF-8, UTF-16 where a byte order mark says so, and what is neither as [`latin1`] has it. The mark is no part of the
/// text; a `\r` alone, as old systems ended lines, becomes `\n`. The error says what is wrong and where.
pub(super) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let text = match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => {
            return Err("it is UTF-32 text; save it as UTF-8".to_owned());
        }
        [0xff, 0xfe, units @ ..] => utf16(units, u16::from_le_bytes)?.into(),
        [0xfe, 0xff, units @ ..] => utf16(units, u16::from_be_bytes)?.into(),
        utf8 => latin1(utf8.strip_prefix(b"\xef\xbb\xbf").unwrap_or(utf8)),
    };
    let is_lone = |at: usize| text.as_bytes().get(at + 1) != Some(&b'\n');
    Ok(if text.match_indices('\r').any(|(at, _)| is_lone(at)) {
        text.replace("\r\n", "\n").replace('\r', "\n").into()
    } else {
        text
    })
}

/// UTF-8, in which every byte that is none stands for the Latin-1 letter of its number: names that differ stay
/// different, and those of a Latin-1 file are found where another writes them in UTF-8.
pub(super) fn latin1(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return text.into();
    }
    let chars = |chunk: std::str::Utf8Chunk<'_>| {
        chunk.valid().chars().chain(chunk.invalid().iter().map(|&byte| char::from(byte))).collect()
    };
    bytes.utf8_chunks().map(chars).collect::<Vec<String>>().concat().into()
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let mut text = String::with_capacity(pairs.len());
    let mut at = 2;
    for decoded in char::decode_utf16(pairs.iter().map(|&pair| unit(pair))) {
        let decoded = decoded.map_err(|_| format!("byte {at} is half of a UTF-16 pair; save it as UTF-8"))?;
        text.push(decoded);
        at += 2 * decoded.len_utf16();
    }
    if !rest.is_empty() {
        return Err("it is UTF-16 text with half a letter at its end; it was cut off".to_owned());
    }
    Ok(text)
}

/// Where a comment may begin: each `#` at the start or after a space. Names may hold others, and even these.
pub(super) fn comments(line: &str) -> impl DoubleEndedIterator<Item = usize> {
    let begins = |at: usize| line[..at].chars().next_back().is_none_or(char::is_whitespace);
    line.match_indices('#').map(|(at, _)| at).filter(move |&at| begins(at))
}

/// A line up to its comment, without spaces around.
pub(super) fn uncommented(line: &str) -> &str {
    let end = comments(line).next().unwrap_or(line.len());
    line[..end].trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `text` in UTF-16 with its mark.
    fn utf16_bytes(text: &str, bytes_of: fn(u16) -> [u8; 2]) -> Vec<u8> {
        std::iter::once('\u{feff}')
            .chain(text.chars())
            .collect::<String>()
            .encode_utf16()
            .flat_map(bytes_of)
            .collect()
    }

    #[test]
    fn marked_text_is_the_same_in_every_encoding() {
        let text = "usemtl Grün 立方体 🎲\n";
        let utf8 = format!("\u{feff}{text}").into_bytes();
        for bytes in [utf8, utf16_bytes(text, u16::to_le_bytes), utf16_bytes(text, u16::to_be_bytes)] {
            assert_eq!(decode(&bytes).unwrap(), text);
        }
        for mark in [&b"\xef\xbb\xbf"[..], b"\xff\xfe", b"\xfe\xff", b""] {
            assert_eq!(decode(mark).unwrap(), "");
        }
    }

    #[test]
    fn broken_utf16_and_utf32_are_one_error_each() {
        for (bytes, problem) in [
            (&b"\xff\xfev\0 "[..], "cut off"),
            (b"\xfe\xff\0", "cut off"),
            (b"\xff\xfev\0\x00\xd8v\0", "byte 4 is half"),
            (b"\xfe\xff\xdc\x00", "byte 2 is half"),
            (b"\xff\xfe\0\0v\0\0\0", "UTF-32"),
        ] {
            let error = decode(bytes).unwrap_err();
            assert!(error.contains(problem), "{bytes:?}: {error}");
        }
    }

    #[test]
    fn lines_may_end_with_a_carriage_return_alone() {
        assert_eq!(decode(b"a\rb\r\rc\r\nd\r").unwrap(), "a\nb\n\nc\nd\n");
        assert!(matches!(decode(b"a\r\nb\r\n").unwrap(), Cow::Borrowed("a\r\nb\r\n")));
    }

    #[test]
    fn bytes_that_are_no_utf8_are_latin_1() {
        assert_eq!(decode(b"gr\xfcn\xff \xc3\xbc").unwrap(), "grünÿ ü");
    }

    #[test]
    fn a_comment_begins_after_a_space() {
        assert_eq!(uncommented("wall#2.png  # the second"), "wall#2.png");
        assert_eq!(uncommented("# all of it"), "");
        assert_eq!(comments("a #1 b #2").collect::<Vec<_>>(), [2, 7]);
    }
}
