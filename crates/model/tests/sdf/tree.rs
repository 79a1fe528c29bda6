//! Tests of the tree of an SDF: placement, static models, several models, root links, loops, gearboxes, springs,
//! followers.

use super::*;

#[test]
fn placement_frames() {
    let z = |attribute: &str, inside: &str| {
        let a = format!("<link name='a'><pose>0 0 1 0 0 0</pose>{INERTIAL}</link>");
        let text =
            format!("<sdf version='1.8'><model name='m' {attribute}><pose>0 0 3 0 0 0</pose>{a}{inside}</model></sdf>");
        read(&text).map(|m| frame(&m, "a", FrameKind::Link).translation.z).map_err(|e| e.to_string())
    };
    assert_eq!(z("", ""), Ok(4.0));
    assert_eq!(z("placement_frame='a'", ""), Ok(3.0));
    assert_eq!(z("placement_frame='f'", "<frame name='f' attached_to='a'><pose>0 0 0.5 0 0 0</pose></frame>"), Ok(2.5));
    let expected = "<string>:1: model `m`: placement_frame: no link, joint or frame is named `b`";
    assert_eq!(z("placement_frame='b'", ""), Err(expected.to_owned()));
}

/// Checks that a static model and the models nested in it do not move.
#[test]
fn static_models() {
    let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 0 1</xyz></axis>");
    let nested = format!("<model name='n'><pose>0 0 1 0 0 0</pose>{}</model>", link("c"));
    let inside = format!("<static>true</static>{}{}{nested}{}", link("a"), link("b"), turn("j", ["a", "b"]));
    let m = model("1.9", &inside);
    assert_eq!((m.nv(), m.bodies().len(), m.bodies()[0].inertia.mass), (0, 1, 6.0));
    assert_eq!(frame(&m, "n::c", FrameKind::Link).translation.z, 1.0);
    let what = "<string>:3: joint `j`: does not move: its model is static, and all links of it are fixed to the world";
    assert_eq!(said(&m).len(), 1);
    assert!(said(&m)[0].ends_with(what.split_once(": ").unwrap().1), "{:?}", said(&m));
    assert!(said(&model("1.9", "<static>true</static><link name='wall'/>")).is_empty());
    let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), ..SdfOptions::default() };
    let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
    assert_eq!(Model::from_sdf_str(&text, &free).unwrap().nv(), 0);
    // a joint connects a robot to a link of a static model
    let robot = format!("<model name='r'>{}</model>", link("base"));
    let ground = format!("<model name='ground'><static>1</static>{}</model>", link("plane"));
    let on = turn("on", ["ground::plane", "r::base"]);
    let text = format!("<sdf version='1.10'><world name='w'>{robot}{ground}{on}</world></sdf>");
    let m = Model::from_sdf_str(&text, &free).unwrap();
    assert_eq!((m.nv(), m.bodies()[1].name.as_str(), m.bodies()[1].parent), (1, "r::base", 0));
}

#[test]
fn several_models() {
    let robot = |name: &str, x: f64| {
        let turn = joint("j", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
        format!("<model name='{name}'><pose>{x} 0 0 0 0 0</pose>{}{}{turn}</model>", link("a"), link("b"))
    };
    let text = format!("<sdf version='1.6'>{}\n<world name='w'>{}</world></sdf>", robot("one", 1.0), robot("two", 2.0));
    let both = read(&text).unwrap();
    assert_eq!(both.name(), "w");
    let names: Vec<&str> = both.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["one::j", "two::j"]);
    assert_eq!(frame(&both, "two::a", FrameKind::Link).translation.x, 2.0);
    assert_eq!(frame(&both, "two", FrameKind::User).translation.x, 2.0);
    let fixed = "link `a`: no joint carries it: it is fixed to the world, unless a root joint is asked for";
    assert_eq!(said(&both).iter().filter(|w| w.ends_with(fixed)).count(), 2, "{:?}", said(&both));
    let named = |name: &str| {
        let options = SdfOptions { model: Some(name.to_owned()), ..SdfOptions::default() };
        Model::from_sdf_str(&text, &options)
    };
    let one = named("two").unwrap();
    assert_eq!((one.name(), one.nv(), said(&one).len()), ("two", 1, 0));
    assert_eq!(frame(&one, "a", FrameKind::Link).translation.x, 2.0);
    let error = named("three").unwrap_err().to_string();
    assert_eq!(error, "<string>:1: <sdf>: no model is named `three`; there are `one`, `two`");
    let twice = text.replace("'two'", "'one'");
    assert!(read(&twice).unwrap_err().to_string().contains("model `one`: the name is taken by the model on line 1"));
    let worlds = text.replace("</sdf>", "<world name='second'/></sdf>");
    let warned = said(&read(&worlds).unwrap());
    assert!(warned.iter().any(|w| w.ends_with("world `second`: is not the first world of the file, and is left out")));
}

/// Checks that each link without a joint that carries it is the root of its own tree.
#[test]
fn several_roots() {
    let turn = joint("j", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let inside = format!("{}{}{turn}{}", link("a"), link("b"), link_at("c", "0 0 5 0 0 0"));
    let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
    let fixed = read(&text).unwrap();
    assert_eq!((fixed.nv(), said(&fixed).len()), (1, 2));
    assert!(said(&fixed).iter().all(|w| w.contains("is fixed to the world, unless a root joint is asked for")));
    assert_eq!(frame(&fixed, "c", FrameKind::Link).translation.z, 5.0);
    let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), strict: true, ..SdfOptions::default() };
    let names = |text: &str| {
        let m = Model::from_sdf_str(text, &free).unwrap();
        m.bodies().iter().skip(1).map(|b| b.joint_name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&text), ["root_joint", "j", "root_joint#2"]);
    assert_eq!(names(&text.replace("'j'", "'root_joint'")), ["root_joint#2", "root_joint", "root_joint#3"]);
    // a joint connects one root link to the world, so only the other root links are free
    let anchored = text.replace("</model>", &format!("{}</model>", joint("w", "fixed", ["world", "a"], "")));
    assert_eq!(names(&anchored), ["j", "root_joint"]);
    let warned = said(&read(&anchored).unwrap());
    assert_eq!(warned.len(), 1);
    assert!(warned[0].contains("link `c`"), "{warned:?}");
}

/// Checks joints that are visited from their child link, because their parent link cannot be reached in another way.
/// The child link then carries the parent link, and the axis is reversed.
#[test]
fn joints_walked_from_their_child() {
    let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 1 0</xyz></axis>");
    let inside = format!("{}{}{}{}{}", link("a"), link("c"), link("b"), turn("ac", ["a", "c"]), turn("bc", ["b", "c"]));
    let m = model("1.9", &inside);
    let found: Vec<_> = m.bodies().iter().skip(1).map(|b| (b.name.as_str(), b.joint_name.as_str(), b.parent)).collect();
    assert_eq!(found, [("c", "ac", 0), ("b", "bc", 1)]);
    close(&m.bodies()[2].joint.axis().unwrap().to_array(), &[0.0, -1.0, 0.0]);
    assert!(said(&m).is_empty());
    let ball = inside.replacen("name='bc' type='revolute'", "name='bc' type='ball'", 1);
    assert!(said(&model("1.9", &ball))[0].contains("its position is that of the parent, seen from the child"));
}

/// Checks a ring of links: the joint that is visited last becomes a constraint. The two frames of this constraint
/// coincide at the links' poses in the file.
#[test]
fn loops() {
    let ring = |kind: &str, inside: &str| {
        let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 1 0</xyz></axis>");
        let close = joint("close", kind, ["b", "c"], &format!("<pose>0.2 0 0.1 0 0 0</pose>{inside}"));
        let links = format!("{}{}{}", link("a"), link_at("b", "1 0 0 0 0 0.3"), link_at("c", "0 0 1 0 0.2 0"));
        model("1.9", &format!("{links}{}{}{close}", turn("ab", ["a", "b"]), turn("ac", ["a", "c"])))
    };
    let ends = |m: &Model, k: usize| {
        let (ModelConstraintKind::Point { frames } | ModelConstraintKind::Rigid { frames }) = m.constraints()[k].kind
        else {
            panic!("no frames");
        };
        // at q = 0, the pose of a body is the product of the placements of the joints that carry it
        frames.map(|f| {
            let frame = &m.frames()[f];
            (frame.body, m.bodies()[frame.body].placement * frame.placement)
        })
    };
    let axis = "<axis><xyz>0 1 0</xyz></axis>";
    let names = |m: &Model| m.constraints().iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    for (kind, count) in [("fixed", 1), ("ball", 1), ("revolute", 2), ("continuous", 2)] {
        let m = ring(kind, if kind == "fixed" { "" } else { axis });
        assert_eq!((m.nv(), said(&m), names(&m).len()), (2, Vec::new(), count), "{kind}");
        assert_eq!(matches!(m.constraints()[0].kind, ModelConstraintKind::Rigid { .. }), kind == "fixed");
        for k in 0..count {
            let [(first, X), (second, Y)] = ends(&m, k);
            assert_eq!((first, second), (1, 2));
            close(&X.translation.to_array(), &Y.translation.to_array());
            close(&X.rotation.x.to_array(), &Y.rotation.x.to_array());
        }
    }
    let m = ring("revolute", axis);
    assert_eq!(names(&m), ["close", "close#2"]);
    let [X, Y] = [ends(&m, 0)[0].1, ends(&m, 1)[0].1];
    let c = Vec3::new(0.0, 0.0, 1.0); // origin of c, which is rotated about y by 0.2
    close(
        &(X.translation - c).to_array(),
        &[0.2 * 0.2f64.cos() + 0.1 * 0.2f64.sin(), 0.0, 0.1 * 0.2f64.cos() - 0.2 * 0.2f64.sin()],
    );
    close(&(Y.translation - X.translation).to_array(), &[0.0, 1.0, 0.0]);
    let dynamics =
        "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower></limit><dynamics><damping>1</damping></dynamics></axis>";
    let what = "closes a loop: its limits, damping are left out, the constraint has none";
    assert!(said(&ring("revolute", dynamics))[0].ends_with(what));
    let open = ring("prismatic", axis);
    assert!(open.constraints().is_empty());
    assert!(said(&open)[0].contains("joint `close`: closes a loop that no constraint holds"));
    let cross = ring("universal", "<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>");
    assert_eq!(names(&cross), ["close"]);
    assert!(said(&cross)[0].ends_with("only its point is held, and it may turn about all axes"));
}

/// Checks that a gearbox couples two angles by θ₂ = −ratio θ₁. Each angle is about its own axis, relative to the
/// reference body.
#[test]
fn gearboxes() {
    let geared = |axes: [&str; 2], reference: &str| {
        let turn =
            |name: &str, ends, axis: &str| joint(name, "revolute", ends, &format!("<axis><xyz>{axis}</xyz></axis>"));
        let gearbox = format!(
            "<gearbox_ratio>5</gearbox_ratio>{reference}
             <axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>"
        );
        let links = format!("{}{}{}", link("base"), link("in"), link("out"));
        let joints = turn("i", ["base", "in"], axes[0]) + &turn("o", ["base", "out"], axes[1]);
        model("1.9", &format!("{links}{joints}{}", joint("g", "gearbox", ["in", "out"], &gearbox)))
    };
    let reference = "<gearbox_reference_body>base</gearbox_reference_body>";
    for (axes, factor) in [(["0 0 1", "0 0 1"], -5.0), (["0 0 -1", "0 0 1"], 5.0), (["0 0 -2", "0 0 -1"], -5.0)] {
        let m = geared(axes, reference);
        let expected =
            ModelConstraintKind::Coupling { follower: 2, leader: Some(1), coefficients: [0.0, factor, 0.0, 0.0, 0.0] };
        assert_eq!((&m.constraints()[0].kind, m.constraints()[0].name.as_str()), (&expected, "g"));
        assert!(said(&m).is_empty());
    }
    for (axes, reference) in [(["0 0 1", "0 1 0"], reference), (["0 0 1", "0 0 1"], "")] {
        let m = geared(axes, reference);
        assert!(m.constraints().is_empty());
        assert!(said(&m)[0].contains("joint `g`: the gearbox is left out"), "{:?}", said(&m));
    }
}

#[test]
fn springs_and_links_without_weight() {
    let sprung = |kind: &str, numbers: &str| {
        let dynamics = format!("<axis><xyz>0 1 0</xyz><dynamics>{numbers}</dynamics></axis>");
        let b = format!("<link name='b'><gravity>false</gravity>{INERTIAL}</link>");
        model(
            "1.9",
            &format!(
                "{}{b}{}",
                link("a"),
                joint("j", kind, ["a", "b"], &format!("<pose>0 0 0.5 0 0 0</pose>{dynamics}"))
            ),
        )
    };
    let numbers = "<spring_stiffness>5</spring_stiffness><spring_reference>0.3</spring_reference>";
    for (kind, rest) in
        [("revolute", vec![0.3]), ("prismatic", vec![0.3]), ("continuous", vec![0.3f64.cos(), 0.3f64.sin()])]
    {
        let m = sprung(kind, numbers);
        let spring = &m.springs()[0];
        assert_eq!((spring.body, spring.stiffness, &spring.rest), (1, [5.0, 0.0, 0.0], &rest));
        let compensation = m.gravity_compensation()[0];
        let carried = compensation.carried(m.bodies()[1].inertia);
        assert_eq!((compensation.body, carried.mass), (1, 2.0));
        // the compensated mass is 2 kg at (0.1, 0, −0.5) from the joint
        close(&carried.mass_com.to_array(), &[0.2, 0.0, -1.0]);
        assert!(said(&m).is_empty());
    }
    assert!(sprung("revolute", "<spring_reference>0.3</spring_reference>").springs().is_empty());
    assert!(said(&sprung("ball", numbers))[0].contains("the spring of a ball is left out"));
    let fixed = model("1.9", &format!("<link name='a'><gravity>0</gravity>{INERTIAL}</link>"));
    assert!(fixed.gravity_compensation().is_empty());
}

/// Checks that a joint that follows a follower gets the leader of this follower.
#[test]
fn chains_of_followers() {
    let turn = |name: &str, ends, inside: &str| {
        joint(name, "revolute", ends, &format!("<axis><xyz>0 0 1</xyz>{inside}</axis>"))
    };
    let mimic = |leader: &str| {
        format!(
            "<mimic joint='{leader}'><multiplier>2</multiplier><offset>0.5</offset><reference>0.1</reference></mimic>"
        )
    };
    let links = ["a", "b", "c", "d"].map(link).concat();
    let chain = |last: &str| {
        let joints =
            turn("j", ["a", "b"], last) + &turn("l", ["c", "d"], &mimic("k")) + &turn("k", ["b", "c"], &mimic("j"));
        let text = format!("<sdf version='1.11'><model name='m'>{links}{joints}</model></sdf>");
        Model::from_sdf_str(&text, &SdfOptions { mimic: true, ..SdfOptions::default() })
    };
    let m = chain("").unwrap();
    assert_eq!(m.nv(), 1);
    let rules: Vec<_> =
        m.bodies().iter().filter_map(|b| b.mimic.map(|r| (b.joint_name.as_str(), r.ratio, r.offset))).collect();
    // the composed relation is 2 (2 (q − 0.1) + 0.5 − 0.1) + 0.5
    assert_eq!(rules.iter().map(|r| (r.0, r.1)).collect::<Vec<_>>(), [("k", 2.0), ("l", 4.0)]);
    close(&[rules[0].2, rules[1].2], &[0.3, 0.9]);
    let missing = chain(&mimic("jj")).unwrap_err().to_string();
    assert!(missing.ends_with("joint `j`: mimic: no joint is named `jj`; nearest is `j`"), "{missing}");
    let free = format!("{links}{}", turn("j", ["a", "b"], &mimic("x")));
    let free = said(&model("1.11", &free));
    assert!(free.iter().any(|w| w.ends_with("has a <mimic>, but no joint is named `x`: it is free")), "{free:?}");
    assert!(chain(&mimic("l")).unwrap_err().to_string().ends_with("mimic: follows itself, through others"));
}

/// Checks that a reference means the link if a link and a joint have the same name, as in older files.
#[test]
fn joints_named_as_links() {
    let turn = joint("b", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let m = model("1.6", &format!("{}{turn}{}", link("a"), link_at("b", "0 0 1 0 0 0")));
    assert_eq!((m.nv(), m.bodies()[1].joint_name.as_str(), m.bodies()[1].name.as_str()), (1, "b", "b"));
}
