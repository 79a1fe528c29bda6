//! Tests of mimic joints: followers without the option `mimic`, and the limits, damping and friction that followers add
//! to their leader.

use super::{INERTIAL, LIMIT, model, robot, warnings};
use condyle_model::{Inertia, Joint, Mimic, Model, ModelBuilder, SdfOptions, Se3, Sym3, UrdfOptions, Vec3, WORLD};

/// Returns a robot with two more links. The joint of the third link follows `j`, and the joint of the fourth link
/// follows the joint of the third.
fn followers(first: &str, second: &str) -> String {
    let link = |name: &str, on: &str, joint: &str, mimic: &str| {
        format!(
            "<link name='{name}'>{INERTIAL}</link>\n<joint name='{joint}' type='revolute'><parent link='{on}'/>\
             <child link='{name}'/>{LIMIT}<mimic {mimic}/></joint>"
        )
    };
    robot("revolute", LIMIT, &(link("c", "b", "k", first) + &link("d", "c", "l", second)))
}

#[test]
fn mimics() {
    let text = followers("joint='j' multiplier='2' offset='0.5'", "joint='k' multiplier='-3' offset='0.25'");
    let free = |joint: &str, leader: &str| {
        format!("joint `{joint}`: has a <mimic> of joint `{leader}`: it is left free unless `mimic` is asked for")
    };
    assert_eq!(warnings(&text), [format!("6: {}", free("k", "j")), format!("8: {}", free("l", "k"))]);
    assert_eq!(model(&text).nv(), 3);
    let options = UrdfOptions { mimic: true, ..UrdfOptions::default() };
    let read = |text: &str| Model::from_urdf_str(text, &options);
    let model = read(&text).unwrap();
    assert!(model.warnings().is_empty());
    let mimics: Vec<_> = model.bodies()[1..].iter().map(|b| b.mimic).collect();
    let (first, second) = (Mimic { ratio: 2.0, offset: 0.5 }, Mimic { ratio: -6.0, offset: -1.25 });
    assert_eq!(mimics, [None, Some(first), Some(second)]);
    let said = |first: &str, second: &str| read(&followers(first, second)).unwrap_err().to_string();
    assert_eq!(said("joint='l'", "joint='k'"), "<string>:6: joint `k`: mimics itself, alone or by way of others");
    assert_eq!(said("joint='k'", "joint='j'"), "<string>:6: joint `k`: mimics itself, alone or by way of others");
    assert_eq!(said("joint='x'", "joint='j'"), "<string>:6: joint `k`: mimics `x`: no joint is named `x`");
    let missing = "6: joint `k`: has a <mimic>, but no joint is named `x`: it is free";
    assert_eq!(warnings(&followers("joint='x'", "joint='k'"))[0], missing);
}

/// Checks that limits, damping and friction of a follower act on its leader. With x = −2 q + 0.5, the limits −1 and 1
/// of x are the limits −0.25 and 0.75 of q. A damping coefficient d of x consumes the power d ẋ² = 4 d q̇².
#[test]
fn limits_and_losses_of_followers() {
    let free = followers("joint='j' multiplier='-2' offset='0.5'", "joint='j' multiplier='0'");
    let text = free
        .replace("<mimic", "<dynamics damping='3' friction='4'/><mimic")
        .replace(&format!("'b'/>{LIMIT}"), &format!("'b'/>{LIMIT}<dynamics damping='0.5' friction='0.25'/>"));
    let read = |text: &str| Model::from_urdf_str(text, &UrdfOptions { mimic: true, ..UrdfOptions::default() });
    let found = read(&text).unwrap();
    let limits = found.limits();
    assert_eq!((limits.lower[0], limits.upper[0], limits.velocity[0]), (-0.25, 0.75, 1.0));
    assert_eq!((limits.effort_lower[0], limits.effort_upper[0]), (-3.0, 3.0));
    assert_eq!((found.damping()[0], found.friction()[0]), (12.5, 8.25));
    // a copy of the robot is equal to the original, and so is a robot read from another format
    let copied = found.clone().with_gravity(*found.gravity()).unwrap();
    assert_eq!((copied.damping(), copied.limits()), (found.damping(), limits));
    let mut two = ModelBuilder::new("two");
    two.append(WORLD, Se3::identity(), &found, "");
    let two = two.build().unwrap();
    assert_eq!((two.damping(), two.friction(), two.limits()), (found.damping(), found.friction(), limits));
    let axis = |inside: &str| {
        format!(
            "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper><velocity>2</velocity></limit><dynamics>\
             <damping>3</damping><friction>4</friction></dynamics>{inside}</axis>"
        )
    };
    let mimic = "<mimic joint='j'><multiplier>-2</multiplier><offset>0.5</offset><reference>0</reference></mimic>";
    let sdf = format!(
        "<sdf version='1.11'><model name='m'><link name='a'/><link name='b'/><link name='c'/><joint name='j' type='revolute'>\
         <parent>a</parent><child>b</child>{}</joint><joint name='k' type='revolute'><parent>b</parent><child>c</child>{}\
         </joint></model></sdf>",
        axis(""),
        axis(mimic)
    );
    let found = Model::from_sdf_str(&sdf, &SdfOptions { mimic: true, ..SdfOptions::default() }).unwrap();
    assert_eq!((found.damping(), found.friction()), (&[15.0][..], &[12.0][..]));
    assert_eq!((found.limits().lower[0], found.limits().upper[0], found.limits().velocity[0]), (-0.25, 0.75, 1.0));
    // limits that leave no range for the leader are ignored; the grippers of many robots have such limits
    let apart = read(&followers("joint='j' offset='5'", "joint='j'").replacen(
        "velocity='2'/><mimic",
        "velocity='0'/><mimic",
        1,
    ));
    let apart = apart.unwrap();
    assert_eq!((apart.limits().lower[0], apart.limits().upper[0], apart.limits().velocity[0]), (-1.0, 1.0, 2.0));
    let said: Vec<_> = apart.warnings().iter().map(ToString::to_string).collect();
    let position = "joint `k`: its limits of position, -6 to -4 for its leader `j`, leave the leader no motion: they have \
                    no effect";
    let velocity = "joint `k`: its limit of velocity, 0, leaves its leader `j` no motion: it has no effect";
    assert_eq!(said, [velocity, position]);
    let gravity = *apart.gravity();
    assert_eq!(apart.clone().with_gravity(gravity).unwrap().warnings(), apart.warnings());
}

/// Checks that a long chain of followers is read quickly, because the time is proportional to its length.
#[test]
fn long_chains_of_mimics() {
    let hinge = Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) };
    let ball = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0));
    for is_reversed in [false, true] {
        let mut builder = ModelBuilder::new("row");
        let ids: Vec<_> =
            (0..4000).map(|i| builder.body(&i.to_string(), WORLD, hinge, Se3::identity(), ball)).collect();
        for pair in ids.windows(2) {
            let (follower, leader) = if is_reversed { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
            builder.mimic(follower, leader, Mimic { ratio: -1.0, offset: 1.0 });
        }
        let model = builder.build().unwrap();
        assert_eq!(model.nv(), 1);
        let last = model.bodies().iter().filter_map(|b| b.mimic).filter(|m| m.ratio == -1.0 && m.offset == 1.0);
        assert_eq!(last.count(), 2000);
    }
}
