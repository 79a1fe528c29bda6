//! Tests identifiers. Their module is compiled into this program, without the rest of the library.

#[allow(dead_code, unreachable_pub)] // the crate uses the whole module, and exports some of its functions
#[path = "../src/identifiers.rs"]
mod identifiers;

use identifiers::identifiers;

#[test]
fn names_become_identifiers() {
    let names = identifiers(["LF_foot", "tool 1", "tool-1", "7th", "é"].into_iter());
    assert_eq!(names, ["LF_foot", "tool_1", "tool_1_2", "robot7th", "robot_"]);
}
