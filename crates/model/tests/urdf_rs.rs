//! Tests that robots that urdf-rs has read are equal to robots that the reader of this crate has read.

use condyle_model::{Error, Joint, Model, UrdfOptions, robots};
use std::path::Path;

/// Parts of error messages for faults that urdf-rs does not detect.
const UNSEEN: [&str; 3] = ["limit", "belongs to xacro", "drake:"];

/// Compares the models that urdf-rs and the reader of this crate give for one text. Only the file names in warnings may
/// differ.
fn compare(name: &str, text: &str, robot: &urdf_rs::Robot) -> bool {
    for root_joint in [None, Some(Joint::FreeFlyer)] {
        for mimic in [false, true] {
            let options = UrdfOptions { root_joint, mimic, ..UrdfOptions::default() };
            let (ours, theirs) = (Model::from_urdf_str(text, &options), Model::from_urdf_robot(robot, &options));
            let (ours, theirs) = match (ours, theirs) {
                (Ok(ours), Ok(theirs)) => (ours, theirs),
                (Err(_), Err(_)) => return false,
                // urdf-rs represents a missing effort by zeros; elements that urdf-rs drops cannot cause an error
                (Err(ours), Ok(_)) if UNSEEN.iter().any(|what| ours.to_string().contains(what)) => return false,
                (ours, theirs) => panic!("{name}: {:?} {:?}", ours.map(drop), theirs.map(drop)),
            };
            assert_eq!(ours.bodies(), theirs.bodies(), "{name}");
            let drakes = |f: &&condyle_model::Frame| f.kind != condyle_model::FrameKind::User;
            assert!(ours.frames().iter().filter(drakes).eq(theirs.frames()), "{name}");
            for joint in ours.bodies()[1..].iter().filter(|b| matches!(b.joint, Joint::Continuous { .. })) {
                let v = joint.idx_v; // in urdf-rs, a limit of 0 means no limit
                let is_none = |x: f64, y: f64| x == 0.0 && y.is_infinite();
                let (a, b) = (ours.limits(), theirs.limits());
                assert!(a.velocity[v] == b.velocity[v] || is_none(a.velocity[v], b.velocity[v]), "{name}");
                let (a, b) = (a.effort_upper[v], b.effort_upper[v]);
                assert!(a == b || is_none(a, b), "{name}");
            }
            if ours.bodies()[1..].iter().all(|b| !matches!(b.joint, Joint::Continuous { .. })) {
                assert_eq!(ours.limits(), theirs.limits(), "{name}");
            }
            assert_eq!((ours.damping(), ours.friction()), (theirs.damping(), theirs.friction()), "{name}");
        }
    }
    true
}

#[test]
fn embedded_robots() {
    for (name, text) in [("arm7", robots::ARM7), ("quadruped", robots::QUADRUPED), ("humanoid", robots::HUMANOID)] {
        assert!(compare(name, text, &urdf_rs::read_from_string(text).unwrap()));
    }
}

/// Reads the URDFs in the folders that `CONDYLE_ROBOTS` lists, if this variable is set.
#[test]
fn robots_of_others() {
    let folders = std::env::var_os("CONDYLE_ROBOTS").unwrap_or_default();
    let mut waiting: Vec<_> = std::env::split_paths(&folders).filter(|f| f.is_dir()).collect();
    let (mut equal, mut read) = (0, 0);
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.is_symlink() {
                waiting.push(path);
            } else if path.extension().is_some_and(|extension| extension == "urdf") {
                let name = path.display().to_string();
                let Ok(text) = std::fs::read_to_string(&path) else { continue };
                let Some(robot) = read_by_urdf_rs(&path) else { continue };
                read += 1;
                equal += usize::from(compare(&name, &text, &robot));
            }
        }
    }
    println!("{equal} robots are equal, of {read} that urdf-rs reads");
}

fn read_by_urdf_rs(path: &Path) -> Option<urdf_rs::Robot> {
    let text = std::fs::read_to_string(path).ok()?;
    std::panic::catch_unwind(|| urdf_rs::read_from_string(&text).ok()).ok().flatten()
}

const JOINT: &str =
    "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='continuous'><parent link='a'/>
<child link='b'/><limit lower='-1' upper='1' effort='3' velocity='2'/></joint></robot>";

#[test]
fn limits() {
    let read = |text: &str| {
        let robot = urdf_rs::read_from_string(text).unwrap();
        Model::from_urdf_robot(&robot, &UrdfOptions::default())
    };
    let bounds = |model: Model| (model.limits().velocity[0], model.limits().effort_upper[0]);
    assert_eq!(bounds(read(JOINT).unwrap()), (2.0, 3.0));
    let open = JOINT.replace(" effort='3' velocity='2'", " velocity='0'");
    assert_eq!(bounds(read(&open).unwrap()), (f64::INFINITY, f64::INFINITY));
    let without = JOINT.replace("continuous", "revolute").replace(" effort='3'", "");
    let model = read(&without).unwrap();
    assert_eq!(bounds(model.clone()), (2.0, 0.0));
    assert!(model.warnings().iter().any(|w| w.to_string().contains("effort are 0")));
}

#[test]
fn errors_name_link_and_joint() {
    let mut robot = urdf_rs::read_from_string(JOINT).unwrap();
    let said = |robot: &urdf_rs::Robot| Model::from_urdf_robot(robot, &UrdfOptions::default()).unwrap_err();
    robot.joints[0].child.link = "c".to_owned();
    assert_eq!(said(&robot).to_string(), "<urdf-rs>:1: joint `j`: no link is named `c`");
    robot.joints[0].child.link = "b".to_owned();
    robot.links[1].inertial.mass.value = f64::NAN;
    assert_eq!(said(&robot).to_string(), "<urdf-rs>:2: link `b`: mass value: `NaN` is no finite number");
    robot.links.clear();
    assert!(matches!(said(&robot), Error::Element { .. }));
}
