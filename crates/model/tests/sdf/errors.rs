//! Tests of SDF: errors of a file, and the tree, limits and warnings of a robot with many elements.

use super::*;

const LINKAGE: &str = include_str!("../../../dynamics/tests/data/linkage.sdf");

/// Checks the tree of a robot, its limits, its placement if its root is fixed, and the warnings about omitted elements.
#[test]
fn tree_and_limits() {
    let model = read(LINKAGE).unwrap();
    let names: Vec<&str> = model.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["turn", "cross#1", "cross", "slide", "spin"]);
    assert_eq!((model.nq(), model.nv()), (6, 5));
    assert_eq!((model.limits().lower[0], model.limits().upper[0]), (-1.0, 2.0));
    assert_eq!(model.limits().lower[1], f64::NEG_INFINITY); // the file has −1e16, which means no limit
    assert_eq!((model.limits().effort()[0], model.limits().velocity[0]), (30.0, f64::INFINITY));
    assert_eq!((model.damping()[0], model.friction()[0]), (0.4, 0.3));
    let base = &model.frames()[model.frame("base").unwrap()];
    assert_eq!((base.body, base.placement.translation), (0, Vec3::new(0.1, 0.0, 1.0)));
    let said: Vec<String> = model.warnings().iter().map(ToString::to_string).collect();
    let left_out =
        "joint `loop`: the gearbox is left out: no revolute joints about its axes join its links to its reference body";
    assert_eq!(said, [format!("<string>:42: {left_out}")]);
    let strict = Model::from_sdf_str(LINKAGE, &SdfOptions { strict: true, ..SdfOptions::default() });
    assert!(matches!(strict, Err(Error::Strict { warning: Warning::LeftOut { .. }, .. })));
}

#[test]
fn errors_name_line_and_element() {
    let model =
        |inside: &str| format!("<sdf version='1.8'><model name='m'>\n<link name='a'/>\n{inside}\n</model></sdf>");
    let joint = |kind: &str, inside: &str| {
        let ends = "<parent>a</parent><child>b</child>";
        model(&format!("<link name='b'/>\n<joint name='j' type='{kind}'>{ends}{inside}</joint>"))
    };
    let cases = [
        (model("<link name='a'/>"), "<string>:3: link `a`: the name is taken by the link on line 2"),
        (model("<link/>"), "<string>:3: <link>: has no name"),
        (model("<joint name='j'><child>a</child></joint>"), "<string>:3: joint `j`: has no parent"),
        (
            model("<joint name='j'><parent>world</parent><child>b</child></joint>"),
            "<string>:3: joint `j`: no link, joint or frame is named `b`",
        ),
        (joint("cylindrical", ""), "<string>:4: joint `j`: joints of type `cylindrical` are not supported"),
        (
            joint("screw", "<thread_pitch>0</thread_pitch><axis><xyz>0 0 1</xyz></axis>"),
            "<string>:4: joint `j`: has no finite screw_thread_pitch",
        ),
        (joint("revolute", ""), "<string>:4: joint `j`: has no <axis>"),
        (joint("revolute", "<axis><xyz>0 0</xyz></axis>"), "<string>:4: joint `j`: xyz: expected 3 numbers, found 2"),
        (joint("revolute", "<axis><xyz>0 0 0</xyz></axis>"), "<string>:4: joint `j`: axis: xyz is no direction"),
        (
            joint("revolute", "<axis><xyz expressed_in='c'>0 0 1</xyz></axis>"),
            "<string>:4: joint `j`: axis: expressed in `c`",
        ),
        (
            joint("revolute", "<axis><limit><lower>x</lower></limit></axis>"),
            "<string>:4: joint `j`: lower: `x` is no number",
        ),
        (
            joint("revolute", "<axis><limit><lower>1</lower><upper>0</upper></limit></axis>"),
            "<string>:4: joint `j`: lower limit 1 is above",
        ),
        (joint("fixed", "<pose relative_to='k'/>"), "<string>:4: joint `j`: no link, joint or frame is named `k`"),
        (joint("fixed", "<pose relative_to='j'/>"), "<string>:4: joint `j`: its pose depends on itself"),
        (joint("fixed", "<pose>0 0 1</pose>"), "<string>:4: joint `j`: pose: expected 6 numbers, found 3"),
        (model("<frame name='f' attached_to='f'/>"), "<string>:3: frame `f`: "),
        ("<sdf version='1.9'/>".to_owned(), "<string>:1: <sdf>: has no model"),
        ("<robot/>".to_owned(), "<string>:1: <robot>: the root element of an SDF"),
    ];
    for (text, expected) in cases {
        let said = read(&text).expect_err(&text).to_string();
        assert!(said.starts_with(expected), "{said}\n{expected}");
    }
}
