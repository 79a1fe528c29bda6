//! Inertias that no body has, and joints along which the inertia matrix is singular.

use condyle_model::{Inertia, Joint, ModelBuilder, Se3, Sym3, Vec3, WORLD, Warning};

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
    assert!(body(flat(0.1, 0.1, 0.2)).is_empty()); // a flat plate
}
