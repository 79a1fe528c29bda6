//! Tests of physically impossible inertias, and of joints along which the inertia matrix is singular.

use condyle_model::{Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, Warning, neutral};

fn z() -> Joint {
    Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) }
}

fn ball() -> Inertia<f64> {
    Inertia::from_com(1.0, Vec3::new(0.1, 0.0, 0.0), Sym3::diagonal(0.01))
}

#[test]
fn a_massless_leaf_is_singular_and_named() {
    let mut builder = ModelBuilder::new("leaf");
    let arm = builder.body("arm", WORLD, z(), Se3::identity(), ball());
    builder.body("leaf", arm, z(), Se3::new(Se3::identity().rotation, Vec3::new(1.0, 0.0, 0.0)), Inertia::zero());
    let model = builder.build().unwrap();
    assert_eq!(model.singular_joints(), [2]);
    let said: Vec<String> = model.warnings().iter().map(ToString::to_string).collect();
    assert_eq!(said[0], "body `leaf` moves and has no mass");
    assert!(said[1].starts_with("joint `leaf` moves nothing"), "{said:?}");
    assert!(model.with_armature(&[0.0, 0.1]).unwrap().singular_joints().is_empty());
}

#[test]
fn a_mass_point_on_its_axis_is_singular_wherever_it_is() {
    let mut builder = ModelBuilder::new("point");
    let far = Se3::new(Se3::identity().rotation, Vec3::new(3.0, -2.0, 1.0));
    let arm = builder.body("arm", WORLD, z(), far, ball());
    let point = Inertia::from_com(0.7, Vec3::new(0.0, 0.0, 0.3), Sym3::zero());
    builder.body("point", arm, z(), far, point);
    assert_eq!(builder.build().unwrap().singular_joints(), [2]);
}

#[test]
fn a_chain_may_have_massless_bodies_inside() {
    let mut builder = ModelBuilder::new("chain");
    builder.spherical_zyx("ball", WORLD, Se3::identity(), ball());
    let model = builder.build().unwrap();
    assert!(model.singular_joints().is_empty() && model.warnings().is_empty());
}

#[test]
fn impossible_inertias_are_named() {
    let body = |rotational| {
        let mut builder = ModelBuilder::new("odd");
        builder.body("odd", WORLD, z(), Se3::identity(), Inertia::from_com(1.0, Vec3::zero(), rotational));
        builder.build().unwrap().warnings().to_vec()
    };
    let flat = |xx, yy, zz| Sym3 { xx, xy: 0.0, yy, xz: 0.0, yz: 0.0, zz };
    assert!(matches!(body(flat(0.1, 0.1, 0.3))[..], [Warning::Triangle { .. }]));
    assert!(matches!(body(flat(0.1, -0.1, 0.1))[..], [Warning::Negative { .. }]));
    assert!(body(flat(0.1, 0.1, 0.2)).is_empty()); // a flat plate is possible
}

/// Returns a robot with a hinge and with one joint of each kind whose position contains a rotation of length 1.
fn turning() -> Model {
    let mut builder = ModelBuilder::new("turning");
    let axis = Vec3::new(0.0, 0.0, 1.0);
    let free = builder.body("free", WORLD, Joint::FreeFlyer, Se3::identity(), ball());
    let hinge = builder.body("hinge", free, z(), Se3::identity(), ball());
    let wheel = builder.body("wheel", hinge, Joint::Continuous { axis }, Se3::identity(), ball());
    let socket = builder.body("socket", wheel, Joint::Spherical, Se3::identity(), ball());
    builder.body("plane", socket, Joint::Planar, Se3::identity(), ball());
    builder.build().unwrap()
}

#[test]
fn positions_are_finite_and_rotations_of_length_1() {
    let model = turning();
    let q = neutral(&model);
    for (part, joint) in [(3..7, "free"), (8..10, "wheel"), (10..14, "socket"), (16..18, "plane")] {
        let scaled = |factor: f64| {
            let mut q = q.clone();
            q[part.clone()].iter_mut().for_each(|x| *x *= factor);
            model.check_position(&q).map_err(|error| error.to_string())
        };
        for factor in [0.0, 0.99, 1.1, 2.0, 1e200] {
            let length = if factor == 1e200 { f64::INFINITY } else { factor };
            let (first, end) = (part.start, part.end);
            let expected =
                format!("joint `{joint}`: its rotation, q[{first}..{end}], has the length {length}, expected 1");
            assert_eq!(scaled(factor), Err(expected));
        }
        assert_eq!((scaled(1.0), scaled(-1.0), scaled(1.0 + 9e-4)), (Ok(()), Ok(()), Ok(())));
    }
    for k in 0..model.nq() {
        for value in [f64::NAN, f64::NEG_INFINITY] {
            let mut q = q.clone();
            q[k] = value;
            let error = model.check_position(&q).unwrap_err().to_string();
            assert!(error.ends_with(&format!("`: q[{k}] is {value}, which is not finite")), "{error}");
        }
    }
}

#[test]
fn velocities_are_finite() {
    let model = turning();
    let (q, mut v) = (neutral(&model), vec![0.0; model.nv()]);
    assert_eq!(model.check_state(&q, &v), Ok(()));
    v[8] = f64::NAN;
    let error = model.check_state(&q, &v).unwrap_err().to_string();
    assert_eq!(error, "joint `socket`: v[8] is NaN, which is not finite");
}
