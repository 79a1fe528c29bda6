//! Mutations of an input: changes of bytes, of words, of XML elements, and of values in JSON.

use super::Kind;
use rand::RngExt;
use rand::rngs::StdRng;
use serde_json::{Value, json};

/// Returns a copy of an input with one to four changes.
pub fn mutated(kind: Kind, input: &[u8], seeds: &[Vec<u8>], rng: &mut StdRng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..rng.random_range(1..5) {
        bytes = match (kind, rng.random_range(0..10)) {
            _ if std::str::from_utf8(&bytes).is_err() => {
                mutate_bytes(bytes, &seeds[rng.random_range(0..seeds.len())], rng)
            }
            (Kind::Pickle, _) | (_, 0) => mutate_bytes(bytes, &seeds[rng.random_range(0..seeds.len())], rng),
            (Kind::Model | Kind::Problem, 1..=6) => mutate_value(&bytes, rng),
            (_, 1 | 2) => mutate_tokens(&String::from_utf8_lossy(&bytes), rng).into(),
            (_, 3..=6) => mutate_words(&String::from_utf8_lossy(&bytes), rng).into(),
            _ => mutate_elements(&String::from_utf8_lossy(&bytes), rng).into(),
        };
    }
    bytes
}

/// Numbers that are invalid in all files, or invalid in some attributes.
const NUMBERS: &[&str] = &[
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e200",
    "1e150",
    "1e-308",
    "5e-324",
    "-0",
    "0",
    "1",
    "-1",
    "0.5",
    "2",
    "1e999",
    "99999999999999999999",
    "1000000",
    "",
    "0x10",
    "1 2",
    "null",
];

/// Characters and words that have a meaning in XML or in an input format.
const PIECES: &[&str] = &[
    "<",
    ">",
    "\"",
    "'",
    "/",
    "=",
    "&",
    "&amp;",
    "&#9;",
    "&#10;",
    "&#0;",
    "&nothing;",
    "\t",
    "\n",
    "\r\n",
    "\u{0}",
    "é",
    "\u{feff}",
    " ",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "<?x",
    "<!DOCTYPE a [<!ENTITY b 'b'>]>",
    " xmlns:a=\"b\"",
    " xmlns=\"\"",
    "a:",
    "world",
    "universe",
    "root_joint",
    "__model__",
    " encoding='utf-16'",
    "gz:",
    "xacro:",
    "drake:joint",
    "mimic",
    "transmission",
    "replicate",
    "frame",
    "include",
    "static",
    "floating",
    "planar",
    "ball",
    "free",
];

fn any<T: Clone>(of: &[T], rng: &mut StdRng) -> T {
    of[rng.random_range(0..of.len())].clone()
}

/// Flips, removes, swaps or repeats bytes, or inserts bytes of another input.
fn mutate_bytes(mut bytes: Vec<u8>, donor: &[u8], rng: &mut StdRng) -> Vec<u8> {
    if bytes.is_empty() {
        return donor.to_vec();
    }
    let (at, other) = (rng.random_range(0..bytes.len()), rng.random_range(0..bytes.len()));
    let end = (at + rng.random_range(1..200)).min(bytes.len());
    match rng.random_range(0..7) {
        0 => bytes[at] ^= 1 << rng.random_range(0..8),
        1 => bytes[at] = rng.random_range(0..=255),
        2 => drop(bytes.drain(at..end)),
        3 => bytes.swap(at, other),
        4 => drop(bytes.splice(other..other, bytes[at..end].to_vec())),
        5 => bytes.truncate(at),
        _ => {
            let from = rng.random_range(0..donor.len());
            let piece = donor[from..(from + end - at).min(donor.len())].to_vec();
            drop(bytes.splice(at..end, piece));
        }
    }
    bytes
}

/// Returns the byte ranges of words, which punctuation separates.
fn words(text: &str) -> Vec<(usize, usize)> {
    let (mut found, mut begin) = (Vec::new(), None);
    for (i, c) in text.char_indices().chain([(text.len(), ' ')]) {
        let sign = c.is_whitespace() || "<>\"'/=,:[]{}".contains(c);
        match begin {
            None if !sign => begin = Some(i),
            Some(from) if sign => {
                found.push((from, i));
                begin = None;
            }
            _ => {}
        }
    }
    found
}

fn replaced(text: &str, (from, to): (usize, usize), by: &str) -> String {
    [&text[..from], by, &text[to..]].concat()
}

/// Inserts one of [`PIECES`], removes a word, or replaces a word by another one.
fn mutate_tokens(text: &str, rng: &mut StdRng) -> String {
    let words = words(text);
    if words.is_empty() {
        return any(PIECES, rng).to_string();
    }
    let (at, other) = (any(&words, rng), any(&words, rng));
    match rng.random_range(0..4) {
        0 => replaced(text, (at.0, at.0), any(PIECES, rng)),
        1 => replaced(text, at, ""),
        2 => replaced(text, at, any(PIECES, rng)),
        _ => replaced(text, at, &text[other.0..other.1]),
    }
}

/// Replaces a number or a name by another; sometimes replaces all equal numbers or names.
fn mutate_words(text: &str, rng: &mut StdRng) -> String {
    let words = words(text);
    let is_number = |&(from, to): &(usize, usize)| text[from..to].parse::<f64>().is_ok();
    let (numbers, names): (Vec<_>, Vec<_>) = words.into_iter().partition(is_number);
    if numbers.is_empty() || names.is_empty() {
        return text.to_owned();
    }
    let name = |rng: &mut StdRng| {
        let (from, to) = any(&names, rng);
        text[from..to].to_owned()
    };
    match rng.random_range(0..6) {
        0..=2 => replaced(text, any(&numbers, rng), any(NUMBERS, rng)),
        3 => replaced(text, any(&names, rng), &name(rng)),
        4 => {
            let (from, to) = (name(rng), name(rng));
            text.replace(&from, &to)
        }
        _ => {
            let (from, to) = any(&numbers, rng);
            text.replacen(&text[from..to], any(NUMBERS, rng), rng.random_range(1..20))
        }
    }
}

/// Returns the byte ranges of closed elements, from the `<` of the start tag to the `>` of the end tag.
fn elements(text: &str) -> Vec<(usize, usize)> {
    let (mut found, mut open) = (Vec::new(), Vec::new());
    for (from, _) in text.match_indices('<') {
        let Some(length) = text[from..].find('>') else { break };
        let to = from + length + 1;
        match text.as_bytes().get(from + 1) {
            Some(b'/') => found.extend(open.pop().map(|begin| (begin, to))),
            Some(b'!' | b'?') => {}
            _ if text[..to].ends_with("/>") => found.push((from, to)),
            _ => open.push(from),
        }
    }
    found
}

/// Removes, repeats, moves or replaces an element, or copies it into itself.
fn mutate_elements(text: &str, rng: &mut StdRng) -> String {
    let elements = elements(text);
    if elements.is_empty() {
        return text.to_owned();
    }
    // Prefer small elements. Otherwise, the root and other large elements would be copied too often.
    let pick = |rng: &mut StdRng| {
        let (a, b) = (any(&elements, rng), any(&elements, rng));
        if a.1 - a.0 < b.1 - b.0 { a } else { b }
    };
    let (at, other) = (pick(rng), pick(rng));
    let own = &text[at.0..at.1];
    match rng.random_range(0..6) {
        0 => replaced(text, at, ""),
        1 => replaced(text, (at.1, at.1), own),
        2 => replaced(text, (other.1, other.1), own),
        3 => replaced(text, other, own),
        4 => match own.find('>').filter(|_| !own.ends_with("/>")) {
            Some(end) => replaced(text, (at.0 + end + 1, at.0 + end + 1), own),
            None => text.to_owned(),
        },
        _ => {
            let attributes = own.find(char::is_whitespace).zip(own.find('>'));
            let Some((from, to)) = attributes.filter(|(from, to)| from < to) else { return text.to_owned() };
            replaced(text, (at.0 + from, at.0 + to), if own[..to].ends_with('/') { "/" } else { "" })
        }
    }
}

/// Changes, removes, repeats or replaces a value in a JSON text.
fn mutate_value(bytes: &[u8], rng: &mut StdRng) -> Vec<u8> {
    let Ok(mut file) = serde_json::from_slice::<Value>(bytes) else {
        return mutate_words(&String::from_utf8_lossy(bytes), rng).into();
    };
    let numbers = [
        json!(0),
        json!(-1),
        json!(1e300),
        json!(-1e300),
        json!(1e-300),
        json!(u64::MAX),
        json!(1 << 30),
        json!(null),
        json!(0.5),
    ];
    let (change, other, number) = (rng.random_range(0..5), anywhere(&mut file, rng).clone(), any(&numbers, rng));
    let place = anywhere(&mut file, rng);
    match place {
        Value::Array(list) if change == 0 && !list.is_empty() => drop(list.remove(rng.random_range(0..list.len()))),
        Value::Array(list) if change == 1 => list.push(list.last().cloned().unwrap_or(number)),
        Value::Array(list) if change == 2 && !list.is_empty() => {
            let (a, b) = (rng.random_range(0..list.len()), rng.random_range(0..list.len()));
            list.swap(a, b);
        }
        Value::Object(map) if change < 2 => {
            let key = map.keys().nth(rng.random_range(0..map.len().max(1))).cloned().unwrap_or_default();
            let value = map.remove(&key);
            if let (1, Some(value)) = (change, value) {
                map.insert(
                    any(&["0", "1", "1000000000", "18446744073709551615", "-1", "name"], rng).to_string(),
                    value,
                );
            }
        }
        Value::Number(_) => *place = number,
        _ => *place = other,
    }
    file.to_string().into_bytes()
}

/// Returns a random value inside a JSON value.
fn anywhere<'a>(file: &'a mut Value, rng: &mut StdRng) -> &'a mut Value {
    let inside = match file {
        Value::Array(list) => list.len(),
        Value::Object(map) => map.len(),
        _ => 0,
    };
    if inside == 0 || rng.random::<f64>() < 0.1 {
        return file;
    }
    let at = rng.random_range(0..inside);
    let next = match file {
        Value::Array(list) => list.get_mut(at),
        Value::Object(map) => map.values_mut().nth(at),
        _ => None,
    };
    anywhere(next.expect("it has so many"), rng)
}
