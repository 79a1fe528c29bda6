//! Encodings of XML files. The byte order mark or the XML declaration gives the encoding of a file.

/// Returns the text of a file. A byte that is invalid in the file's encoding becomes U+FFFD, which the parser accepts
/// only in comments.
pub(super) fn decode(bytes: Vec<u8>) -> String {
    match &bytes[..] {
        [0xef, 0xbb, 0xbf, ..] => utf8(bytes),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [b'<', 0, ..] => utf16(&bytes, u16::from_le_bytes),
        [0, b'<', ..] => utf16(&bytes, u16::from_be_bytes),
        _ => match declared(&bytes).map(|name| name.to_ascii_lowercase()).as_deref() {
            // A file in UTF-16 was recognized above by its first bytes. So a file that reaches this line and declares
            // UTF-16 is in ASCII or UTF-8.
            None | Some(b"utf-8" | b"utf8" | b"us-ascii" | b"ascii" | b"utf-16" | b"utf16") => utf8(bytes),
            Some(
                b"iso-8859-1" | b"iso8859-1" | b"iso_8859-1" | b"latin1" | b"latin-1" | b"windows-1252" | b"cp1252",
            ) => bytes.iter().map(|&byte| western(byte)).collect(),
            Some(_) => bytes.iter().map(|&byte| if byte.is_ascii() { byte as char } else { INVALID }).collect(),
        },
    }
}

/// Character that replaces a byte that is invalid in the encoding.
pub(super) const INVALID: char = char::REPLACEMENT_CHARACTER;

fn utf8(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap_or_else(|e| String::from_utf8_lossy(e.as_bytes()).into_owned())
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks(2).map(|pair| pair.try_into().map_or(INVALID as u16, unit));
    char::decode_utf16(units).map(|c| c.unwrap_or(INVALID)).collect()
}

/// Returns the character of a byte in windows-1252. This encoding contains ISO-8859-1, except its control characters.
fn western(byte: u8) -> char {
    const CONTROLS: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";
    match byte {
        0x80..=0x9f => CONTROLS.chars().nth(usize::from(byte - 0x80)).unwrap_or(INVALID),
        _ => byte as char,
    }
}

/// Returns the name of the encoding in the XML declaration. Spaces and comments may precede the declaration.
pub(super) fn declared(text: &[u8]) -> Option<&[u8]> {
    let find = |text: &[u8], what: &[u8]| text.windows(what.len()).position(|window| window == what);
    let mut rest = text.trim_ascii_start();
    while let Some(comment) = rest.strip_prefix(b"<!--") {
        rest = comment[find(comment, b"-->")? + 3..].trim_ascii_start();
    }
    let inside = rest.strip_prefix(b"<?xml")?;
    let inside = &inside[..find(inside, b"?>")?];
    let value = inside[find(inside, b"encoding")? + 8..].trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let quote = *value.first().filter(|quote| b"\"'".contains(quote))?;
    value[1..].split(|&byte| byte == quote).next()
}
