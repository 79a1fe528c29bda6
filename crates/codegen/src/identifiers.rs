//! Valid identifiers for generated code.

/// Makes identifiers from names. Invalid characters become `_`, and equal names get numbers.
pub(crate) fn identifiers<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for name in names {
        let first = identifier(name);
        let mut own = first.clone();
        let mut k = 2;
        while found.contains(&own) {
            own = format!("{first}_{k}");
            k += 1;
        }
        found.push(own);
    }
    found
}

/// Makes an identifier from a name. If the name does not begin with a letter, `robot` is prepended.
pub fn identifier(name: &str) -> String {
    let mut own: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !own.starts_with(|c: char| c.is_ascii_alphabetic()) {
        own = format!("robot{own}");
    }
    own
}
