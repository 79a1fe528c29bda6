//! Tests of values in SDF: inertias, unknown names, invalid numbers, and elements of Drake.

use super::*;

/// Compares the mass, the mass times the centre of mass, and the moments about the link's origin (xx yy zz xy xz yz)
/// with Drake's numbers.
#[test]
fn inertias_of_shapes() {
    let of = |inertial: &str, collisions: &str| {
        let text = format!(
            "<sdf version='1.11'><model name='m'><frame name='f'><pose>0 0 1 0 0 0</pose></frame><link name='a'>
             <pose>1 0 0 0 0 0.5</pose>{inertial}{collisions}</link></model></sdf>"
        );
        let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), ..SdfOptions::default() };
        Model::from_sdf_str(&text, &free).map(|m| {
            let I = m.bodies()[1].inertia;
            let r = I.rotational;
            let numbers = [I.mass, I.mass_com.x, I.mass_com.y, I.mass_com.z, r.xx, r.yy, r.zz, r.xy, r.xz, r.yz];
            (numbers.to_vec(), said(&m))
        })
    };
    let auto = "<inertial auto='true'/>";
    let collision =
        |inside: &str, shape: &str| format!("<collision name='c'>{inside}<geometry>{shape}</geometry></collision>");
    let placed = "<pose>0.1 0.2 0.3 0.4 0.5 0.6</pose><density>500</density>";
    let cylinder = "<cylinder><radius>0.1</radius><length>0.4</length></cylinder>";
    #[rustfmt::skip]
    let shapes = [
        ("<box><size>0.2 0.3 0.4</size></box>", [
            12.0, 1.2, 2.4, 3.6, 1.762329301569, 1.411913478072, 0.765757220359, -0.219106986365, -0.410424888811,
            -0.727800659467,
        ]),
        ("<sphere><radius>0.2</radius></sphere>", [
            16.755160819146, 1.675516081915, 3.351032163829, 5.026548245744, 2.446253479595, 1.943598655021,
            1.105840614064, -0.335103216383, -0.502654824574, -1.005309649149,
        ]),
        ("<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>", [
            12.566370614359, 1.256637061436, 2.513274122872, 3.769911184308, 1.881602913175, 1.525825153989,
            0.814872459261, -0.218974806926, -0.462526642125, -0.76457414061,
        ]),
        (cylinder, [
            core::f64::consts::TAU, 0.628318530718, 1.256637061436, 1.884955592154, 0.893056352371, 0.72744878805,
            0.369170206853, -0.12279733123, -0.220645448819, -0.373026072392,
        ]),
        ("<cone><radius>0.1</radius><length>0.4</length></cone>", [
            2.094395102393, 0.08705688944, 0.433972469686, 0.45902709453, 0.20301650876, 0.119882318798,
            0.103090802624, -0.017641878617, -0.023531720113, -0.094564433128,
        ]),
        ("<capsule><radius>0.1</radius><length>0.4</length></capsule>", [
            8.377580409573, 0.837758040957, 1.675516081915, 2.513274122872, 1.249565249156, 1.059859361584,
            0.522197567695, -0.159834444963, -0.337884807374, -0.491979700625,
        ]),
    ];
    for (shape, expected) in shapes {
        let (found, warned) = of(auto, &collision(placed, shape)).unwrap();
        assert!(warned.is_empty(), "{warned:?}");
        let worst = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-11, "{shape}: {found:?}");
    }
    // the names of the elements in <collision> are checked if the link's mass is computed from the shape
    for (inside, near) in [
        ("<posse>1 1 1 0 0 0</posse><density>5</density>", "<posse> in <collision>; nearest is `pose`"),
        ("<densitty>5</densitty>", "<densitty> in <collision>; nearest is `density`"),
        ("<density>5</density><inertial/>", "<inertial> in <collision>"),
    ] {
        let shape = collision(inside, "<box><size>1 1 1</size></box>");
        let (_, warned) = of(auto, &shape).unwrap();
        assert!(warned[0].contains(near), "{warned:?}");
        let (_, warned) = of("<inertial><mass>1</mass></inertial>", &shape).unwrap();
        assert_eq!(warned.iter().any(|w| w.contains("in <collision>")), inside.contains("inertial"), "{warned:?}");
    }
    // a shape without a density has the density of the link, or of water; an explicit mass scales the result
    let density = |inertial: &str| of(inertial, &collision("", "<box><size>1 1 1</size></box>")).unwrap();
    assert_eq!(density("<inertial auto='1'><density>700</density></inertial>").0[0], 700.0);
    let (found, warned) = density(auto);
    assert_eq!(found[0], 1000.0);
    assert!(warned[0].ends_with("has no density: 1000 kg/m³, as SDF has it"));
    let (found, warned) = density("<inertial auto='true'><mass>6</mass></inertial>");
    close(&found, &[6.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(warned.is_empty());
    // the pose of a shape may be relative to a frame
    let (found, _) =
        of(auto, &collision("<pose relative_to='f'>1 0 0 0 0 0</pose>", "<box><size>1 1 1</size></box>")).unwrap();
    close(&found[1..4], &[0.0, 0.0, 1000.0]);
    let wrong = |inertial: &str, collisions: &str| of(inertial, collisions).unwrap_err().to_string();
    assert!(wrong(auto, "").ends_with("link `a`: inertial: auto=\"true\" needs a collision, and there is none"));
    let mesh = collision("", "<mesh><uri>a.stl</uri></mesh>");
    assert!(wrong(auto, &mesh).ends_with("inertial: auto=\"true\" is not supported for the shape <mesh>"));
    assert!(wrong(auto, &collision("", "<sphere/>")).ends_with("sphere: expected a radius above 0"));
    assert!(
        wrong("<inertial auto='maybe'/>", &mesh).ends_with("inertial: auto: expected true or false, found `maybe`")
    );
}

#[test]
fn missing_inertias() {
    let of = |inside: &str| said(&model("1.9", &format!("<link name='a'>{inside}</link>")));
    let warned = |inside: &str, what: &str| {
        let found = of(inside);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].ends_with(what), "{found:?}");
    };
    warned("", "link `a`: has no <inertial>: 1 kg and 1 kg m², as SDF has it");
    warned("<inertial><mass>0</mass></inertial>", "inertial: has no ixx, iyy, izz: 1 kg m², as SDF has it");
    let moments = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>";
    warned(&format!("<inertial>{moments}</inertial>"), "inertial: has no mass: 1 kg, as SDF has it");
    let some = "<inertial><mass>1</mass><inertia><ixx>1</ixx><izz>1</izz></inertia></inertial>";
    warned(some, "inertial: has no iyy: 1 kg m², as SDF has it");
    let added = format!("<inertial><mass>1</mass>{moments}<fluid_added_mass><xx>1</xx></fluid_added_mass></inertial>");
    warned(&added, "fluid_added_mass is left out: the link moves as in a vacuum");
    let density = format!("<inertial><mass>1</mass><density>3</density>{moments}</inertial>");
    warned(&density, "density is left out: it counts only with auto=\"true\"");
    let frame = format!("<inertial><pose relative_to='a'/><mass>1</mass>{moments}</inertial>");
    warned(&frame, "inertial: the pose is in the link's frame, not relative to `a`");
}

/// Checks that misspelt and misplaced elements cause warnings, and so do known elements that a model cannot represent.
/// Visual elements and sensors cause no warnings.
#[test]
fn what_a_model_does_not_hold() {
    let turn = |inside: &str| joint("j", "revolute", ["a", "b"], inside);
    let axis = |inside: &str| turn(&format!("<axis><xyz>0 1 0</xyz>{inside}</axis>"));
    let with = |inside: &str| said(&model("1.9", &format!("{}{}{inside}", link("a"), link("b"))));
    let whole =
        "<visual name='v'><geometry/><mteral/></visual><sensor name='s' type='imu'><x/></sensor><light name='l'/>";
    let fine = [
        axis("<limit><stiffness>1e8</stiffness><dissipation>1</dissipation></limit>"),
        turn(
            "<axis/><sensor name='f' type='force_torque'><x/></sensor><physics><ode><cfm_damping>1</cfm_damping><limit><cfm>0</cfm></limit></ode></physics>",
        ),
        format!("{}<plugin name='p' filename='f'><anything/></plugin><self_collide>true</self_collide>", axis("")),
        format!("{}<link name='c'>{INERTIAL}{whole}<collision name='x'><surface/></collision></link>", axis(""))
            + &joint("k", "fixed", ["a", "c"], ""),
    ];
    for inside in &fine {
        assert_eq!(with(inside), Vec::<String>::new());
    }
    let cases = [
        (
            axis("<dynamics><dampng>1</dampng></dynamics>"),
            "unknown element <dampng> in <dynamics>; nearest is `damping`",
        ),
        (
            axis("").replace("<xyz>", "<xyz expresed_in='a'>"),
            "unknown attribute `expresed_in`; nearest is `expressed_in`",
        ),
        (axis("").replace("</axis>", "</axis><damping>1</damping>"), "misplaced element <damping> in <joint>"),
        (axis("<initial_position>1</initial_position>"), "initial_position is left out"),
        (turn("<axis/><physics><ode><max_force>2</max_force></ode></physics>"), "the max_force 2 of its motor in ODE"),
        (
            turn("<axis/><physics><ode><suspension><cfm>1</cfm></suspension></ode></physics>"),
            "the suspension is left out",
        ),
        (axis("").replace("</axis>", "</axis><axis2/>"), "axis2 is left out: a revolute joint has none"),
        (axis("") + "<enable_wind>true</enable_wind>", "enable_wind is left out"),
        (
            axis("").replace("revolute", "continuous").replace("</xyz>", "</xyz><limit><lower>0</lower></limit>"),
            "limits 0 and inf are left out: a continuous joint has none",
        ),
    ];
    for (inside, what) in cases {
        let found = with(&inside);
        assert!(found.iter().any(|w| w.contains(what)), "{what}\n{found:?}");
        let text = format!("<sdf version='1.9'><model name='m'>{}{}{inside}</model></sdf>", link("a"), link("b"));
        let strict = SdfOptions { strict: true, ..SdfOptions::default() };
        assert!(matches!(Model::from_sdf_str(&text, &strict), Err(Error::Strict { .. })));
        let allow = vec![WarningKind::LeftOut, WarningKind::Unknown, WarningKind::Assumed];
        assert!(Model::from_sdf_str(&text, &SdfOptions { allow, ..strict }).is_ok());
    }
    for (inside, what) in [
        ("<kinematic>true</kinematic>", "kinematic is left out"),
        ("<velocity_decay><linear>0.1</linear></velocity_decay>", "velocity_decay: linear 0.1 is left out"),
        ("<velocity_decay><angular>bad</angular></velocity_decay>", "velocity_decay: angular bad is left out"),
        ("<enable_wind>1</enable_wind>", "enable_wind is left out"),
        ("<inertal/>", "unknown element <inertal> in <link>; nearest is `inertial`"),
    ] {
        let found = said(&model("1.9", &format!("<link name='a'>{INERTIAL}{inside}</link>")));
        assert!(found.iter().any(|w| w.contains(what)), "{what}\n{found:?}");
    }
    for inside in
        ["<kinematic>false</kinematic><velocity_decay/><enable_wind/>", "<must_be_base_link>1</must_be_base_link>"]
    {
        let found = said(&model("1.9", &format!("<link name='a'>{INERTIAL}{inside}</link>")));
        assert_eq!(found, Vec::<String>::new());
    }
    let world = "<sdf version='1.6'><world name='w'><population name='p'/><state world_name='w'/><scene/><gui/>
      <model name='m'><link name='a'/></model></world></sdf>";
    let found = said(&read(world).unwrap());
    assert!(found[0].contains("the models of a population are left out"), "{found:?}");
    assert!(found[1].contains("the positions of a saved state are left out"), "{found:?}");
}

#[test]
fn invalid_values() {
    let cases = [
        ("<link name='a'><gravity>no</gravity></link>", "link `a`: gravity: expected true or false, found `no`"),
        ("<static>yes</static><link name='a'/>", "model `m`: static: expected true or false, found `yes`"),
        (
            "<link name='a'><pose degrees='2'>0 0 0 0 0 0</pose></link>",
            "pose: degrees: expected true or false, found `2`",
        ),
        (
            "<link name='a'><pose rotation_format='rpy'>0 0 0 0 0 0</pose></link>",
            "pose: rotation_format `rpy` is unknown; known are euler_rpy and quat_xyzw",
        ),
        (
            "<link name='a'><pose rotation_format='quat_xyzw' degrees='true'>0 0 0 0 0 0 1</pose></link>",
            "pose: a quaternion is not in degrees",
        ),
        ("", "model `m`: has no links"),
        ("<link name='a'/><model name='n'/>", "model `n`: has no links"),
        ("<link name='a'/><link name='world'/>", "link `world`: the name belongs to SDF"),
        (
            "<link name='a'/><joint name='j' type='hinge'><parent>world</parent><child>a</child></joint>",
            "joints of type `hinge` are not supported; known are fixed, revolute, continuous, prismatic, screw, ball, universal, revolute2 and gearbox",
        ),
        (
            "<link name='a'/><joint name='j' type='fixed'><parent>a</parent><child>world</child></joint>",
            "joint `j`: its child is the world",
        ),
        (
            "<link name='a'/><joint name='j' type='fixed'><parent>a</parent><child>a</child></joint>",
            "joint `j`: its parent and its child are one link, `a`",
        ),
        (
            "<link name='a'/><link name='b'/><joint name='j' type='revolute'><parent>a</parent><child>b</child>
            <axis><dynamics><spring_stiffness>-1</spring_stiffness></dynamics></axis></joint>",
            "spring_stiffness -1 is below 0",
        ),
    ];
    for (inside, what) in cases {
        let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
        let error = read(&text).expect_err(what).to_string();
        assert!(error.contains(what), "{error}\n{what}");
    }
    // an empty element means the default value, and the type of a joint may have capital letters
    let m = model("1.9", "<static/><link name='a'><pose/><gravity/></link><link name='b'/>
      <joint name='j' type='Revolute'><parent>a</parent><child>b</child><axis><xyz/><limit><upper/></limit></axis></joint>");
    assert_eq!((m.nv(), m.limits().upper[0]), (1, f64::INFINITY));
}

/// Checks that text after a number is dropped with a warning, and that text without a number is an error.
#[test]
fn numbers_followed_by_text() {
    let limit = |text: &str| {
        let axis = format!("<axis><xyz>0 0 1</xyz><limit><velocity>{text}</velocity></limit></axis>");
        let joint = joint("j", "revolute", ["a", "b"], &axis);
        read(&format!("<sdf version='1.9'><model name='m'>{}{}{joint}</model></sdf>", link("a"), link("b")))
    };
    for (text, value) in [("2.5\"", 2.5), ("2.5 rad/s", 2.5), ("1e1x", 10.0), ("7,5", 7.0)] {
        let m = limit(text).unwrap();
        assert_eq!(m.limits().velocity[0], value);
        let what = format!("<velocity>: `{text}` is no number; it is read as ");
        assert!(said(&m)[0].contains(&what), "{:?}", said(&m));
    }
    let twice = "<link name='a'><inertial><mass>1</mass><mass>2</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>";
    let m = model("1.9", twice);
    assert_eq!(m.bodies()[0].inertia.mass, 1.0);
    assert_eq!(said(&m), ["<string>:1: <mass>: is the second <mass> here, and is left out"]);
    let physics = |version: &str| {
        let world = format!("<physics><gravity>0 0 -1</gravity></physics><model name='m'>{}</model>", link("a"));
        let m = read(&format!("<sdf version='{version}'><world name='w'>{world}</world></sdf>")).unwrap();
        (m.gravity().z, said(&m).len())
    };
    assert_eq!((physics("1.5"), physics("1.6")), ((-1.0, 0), (-9.81, 1)));
    assert!(limit("fast").unwrap_err().to_string().ends_with("joint `j`: velocity: `fast` is no number"));
}

/// Checks that Drake's elements for a rotor give the armature: ratio² times the inertia of the rotor. A type of joint
/// that only Drake defines is an error.
#[test]
fn elements_of_drake() {
    let of = |inside: &str, model: &str| {
        let axis = format!("<axis><xyz>0 0 1</xyz></axis>{inside}");
        let joint = joint("j", "revolute", ["a", "b"], &axis);
        read(&format!(
            "<sdf version='1.9' xmlns:drake='x'><model name='m'>{}{}{joint}{model}</model></sdf>",
            link("a"),
            link("b")
        ))
    };
    let rotor = "<drake:rotor_inertia>0.02</drake:rotor_inertia><drake:gear_ratio>10</drake:gear_ratio>";
    let m = of(rotor, "<other:thing/>").unwrap();
    assert_eq!((m.armature()[0], said(&m)), (2.0, Vec::new()));
    for (name, near) in [("drake:rotor_inertiax", "drake:rotor_inertia"), ("drake:mimicx", "drake:mimic")] {
        let expected = format!("<string>:3: <{name}>: unknown element <{name}> in <joint>; nearest is `{near}`");
        assert_eq!(said(&of(&format!("<{name}>1</{name}>"), "").unwrap()), [expected]);
    }
    let m = of("", "<drake:linear_bushing_rpy/>").unwrap();
    assert!(said(&m)[0].ends_with("a force or constraint of Drake's own is left out"));
    let error = of("", "<drake:joint name='k' type='planar'/>").unwrap_err().to_string();
    assert!(error.ends_with("drake:joint `k`: joints of Drake's own are not supported: `planar`"), "{error}");
}

/// Checks that a screw without a pitch makes one turn per metre.
#[test]
fn a_screw_without_a_pitch() {
    let screw = joint("j", "screw", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let m = model("1.9", &format!("{}{}{screw}", link("a"), link("b")));
    let Joint::Helical { pitch, .. } = m.bodies()[1].joint else { panic!("no screw") };
    assert_eq!(pitch, 1.0 / core::f64::consts::TAU);
    assert!(said(&m)[0].ends_with("has no screw_thread_pitch: 1 m for each turn, as SDF has it"));
}

/// Checks that elements of a robot cause a warning inside elements that do not change the robot, because they have no
/// effect there.
#[test]
fn misplaced_elements() {
    let world = |version: &str, physics: &str, visual: &str| {
        let link = link("a").replace("</link>", &format!("<visual name='v'>{visual}</visual></link>"));
        let text = format!(
            "<sdf version='{version}'><world name='w'><physics type='ode'>{physics}</physics><model name='m'>{link}\
             </model></world></sdf>"
        );
        said(&read(&text).unwrap())
    };
    let physics = "<max_step_size>0.1</max_step_size><ode><solver><type>quick</type></solver></ode>";
    let visual = "<geometry><box><size>1 1 1</size></box></geometry><plugin name='p'><joint>j</joint></plugin>";
    assert_eq!(world("1.6", physics, visual), [""; 0]);
    let near = "<string>:1: <gravityx>: unknown element <gravityx> in <physics>; nearest is `gravity`";
    assert_eq!(world("1.4", "<gravityx>0 0 -3</gravityx>", visual), [near]);
    let misplaced = "<string>:2: <inertial>: misplaced element <inertial> in <visual>";
    assert_eq!(world("1.6", physics, "<inertial/>"), [misplaced]);
}
