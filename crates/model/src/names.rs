//! Search for the known name that is most similar to an unknown name.

#[cfg(feature = "loaders")]
use crate::error::near_or;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// Limits of a search: the number of compared characters of each name, and the total number of compared pairs of
/// characters. For two names, the number of pairs is the product of their lengths.
const COMPARED: [usize; 2] = [128, 1 << 22];

/// Returns the most similar name by [`distance`], among the names that can be compared within the limit. Returns an
/// empty text if even this name differs in more than half of its characters.
pub(crate) fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> String {
    let [length, mut left] = COMPARED;
    let begin = |name: &str| name.chars().take(length).collect::<Vec<char>>();
    let name = begin(name);
    let mut best = (usize::MAX, "");
    for found in names {
        let other = begin(found);
        let pairs = name.len() * other.len();
        if pairs > left {
            break;
        }
        left -= pairs;
        let distance = distance(&other, &name);
        if 2 * distance <= other.len().max(name.len()) && distance < best.0 {
            best = (distance, found);
        }
    }
    best.1.to_owned()
}

/// Returns the optimal string alignment distance: the number of edits that turn `a` into `b`. An edit inserts, removes
/// or replaces a character, or swaps two neighbouring characters. Each character is edited at most once.
fn distance(a: &[char], b: &[char]) -> usize {
    // d_ij is the distance between the first i characters of `a` and the first j characters of `b`. Only three rows of
    // d are stored.
    let (mut before, mut last, mut row) = (Vec::new(), Vec::new(), (0..=b.len()).collect::<Vec<usize>>());
    for i in 1..=a.len() {
        (before, last, row) = (last, row, before);
        row.clear();
        row.push(i);
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(before[j - 2] + 1);
            }
            row.push(least);
        }
    }
    row[b.len()]
}

/// Returns the end of a message about an unknown name: the nearest name, or nothing if `nearest` is empty.
#[cfg(feature = "loaders")]
pub(crate) fn near(nearest: &str) -> String {
    near_or(nearest, "")
}
