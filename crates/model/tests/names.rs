//! Test of the nearest name in an error about an unknown name.

use condyle_model::{Error, Inertia, Joint, ModelBuilder, Se3, WORLD};

/// Returns all words of the given letters up to a length, in the order of their lengths.
fn words(letters: &str, length: usize) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut from = 0;
    for _ in 0..length {
        let to = words.len();
        for i in from..to {
            letters.chars().for_each(|c| words.push(format!("{}{c}", words[i])));
        }
        from = to;
    }
    words.split_off(1)
}

/// Checks that the nearest name is the first name with the smallest optimal string alignment distance. Names that
/// differ in more than half of their characters are ignored.
#[test]
fn nearest_names_are_those_of_strsim() {
    let mut builder = ModelBuilder::new("words");
    builder.body("arm", WORLD, Joint::Planar, Se3::identity(), Inertia::zero());
    for word in words("abc", 4).iter().step_by(3) {
        builder.frame(word, WORLD, Se3::identity());
    }
    let model = builder.build().expect("a body and its frames");
    let mut far = 0;
    for asked in words("abcd", 5) {
        let Err(Error::UnknownFrame { nearest, .. }) = model.frame(&asked) else {
            continue;
        };
        let distance = |name: &&str| strsim::osa_distance(name, &asked);
        let names = model.frames().iter().map(|frame| frame.name.as_str());
        let similar = names.filter(|name| 2 * distance(name) <= name.len().max(asked.len()));
        let expected = similar.min_by_key(distance).unwrap_or_default();
        far += usize::from(expected.is_empty());
        assert_eq!(nearest, expected, "{asked}");
    }
    assert!(far > 0, "a word without similar ones was asked for");
}
