//! Names that are similar to one that is not there.

#[cfg(feature = "loaders")]
use crate::error::near_or;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// How much of a name is compared (characters), and the number of pairs of characters that are compared in all: the
/// distance takes the product of the lengths.
const COMPARED: [usize; 2] = [128, 1 << 22];

/// The most similar of some names ([`distance`]), as far as so many can be compared; empty if even that one differs in more
/// than half of its characters.
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

/// The optimal string alignment distance: how many characters are to be put in, left out, replaced, or swapped with their
/// neighbours (none of them twice), so that b becomes of a.
fn distance(a: &[char], b: &[char]) -> usize {
    // d_ij is that of the first i of a and the first j of b; of its rows, three are needed
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

/// The end of a message about a name that is not there: the nearest one, if there is one.
#[cfg(feature = "loaders")]
pub(crate) fn near(nearest: &str) -> String {
    near_or(nearest, "")
}
