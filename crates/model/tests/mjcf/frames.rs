//! Tests of MJCF: sites, cameras, and frames with a name.

use super::*;
use condyle_model::FrameKind;

const INSIDE: &str = "<frame name='f' pos='1 0 0' euler='0 0 90'>
    <site name='s' type='capsule' size='0.01' fromto='0 0 0 0.2 0.1 0.3'/><camera name='c' pos='0 1 0' euler='10 20 30'/></frame>";

#[test]
fn sites_cameras_and_frames_are_frames() {
    let model = model("", &body("", INSIDE), "");
    let site = [0.95, 0.1, 0.15, 0.720713490294909, -0.6396432548525455, 0.2672612419124243, -0.4414269805898186];
    let site = [&site[..], &[-0.720713490294909, -0.5345224838248488, 0.5345224838248488, 0.2672612419124244]].concat();
    near("site", &placement(&model, "s"), &[&site[..], &[-0.8017837257372731]].concat(), 1e-12);
    let camera = [0.0, 0.0, 0.0, -0.5438381424823253, -0.8231729446455008, 0.16317591116653485, 0.8137976813493736];
    let rest = [-0.46984631039295394, 0.3420201433256686, -0.2048741287028621, 0.31879577759716776, 0.9254165783983233];
    near("camera", &placement(&model, "c"), &[&camera[..], &rest].concat(), 1e-12);
    near("frame", &placement(&model, "f"), &[1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], 1e-12);
    assert_eq!(model.warnings(), []);
}

#[test]
fn a_site_keeps_its_name() {
    let inside = "<camera name='x' pos='3 0 0'/><frame name='x' pos='2 0 0'/><site name='x' pos='1 0 0'/>";
    let model = model("", &body("", inside), "");
    for (name, at) in [("x", 1.0), ("frame:x", 2.0), ("camera:x", 3.0)] {
        near(name, &placement(&model, name)[..3], &[at, 0.0, 0.0], 0.0);
    }
    let kinds = model.frames().iter().filter(|f| f.name.ends_with('x')).map(|f| f.kind);
    assert!(kinds.into_iter().all(|kind| kind == FrameKind::User));
    for twice in ["<frame name='x'/><frame name='x'/>", "<camera name='x'/><camera name='x'/>"] {
        assert!(refused("", &body("", twice), "").contains("the name is taken by the"));
    }
}

#[test]
fn cameras_that_turn_are_no_frames() {
    let tracking = model("", &body("", "<camera name='c' mode='track'/>"), "");
    assert!(tracking.frame("c").is_err());
    assert_eq!(tracking.warnings(), []);
    let in_world = model("", "<camera name='c' pos='1 2 3'/><frame name='f' pos='4 5 6'/>", "");
    near("camera", &placement(&in_world, "c")[..3], &[1.0, 2.0, 3.0], 0.0);
    near("frame", &placement(&in_world, "f")[..3], &[4.0, 5.0, 6.0], 0.0);
}
