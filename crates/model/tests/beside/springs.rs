//! Tests of MJCF: springs, damping, tendons and gravity compensation.

use super::*;

/// Compares springs and damping of joints with MuJoCo's `jnt_stiffness`, `qpos_spring` and `dof_damping`.
#[test]
fn springs_of_joints() {
    let found = model("", "<joint axis='0 1 0' stiffness='5 1 2' springref='10' ref='30' damping='3 1 2'/>", "");
    let expected = Spring { body: 1, stiffness: [5.0, 1.0, 2.0], rest: vec![0.17453292519943295] };
    assert_eq!(found.springs(), [expected]);
    assert_eq!((found.damping(), found.damping_polynomial()), (&[3.0][..], &[[1.0, 2.0]][..]));
    let found = model("<compiler angle='radian'/>", "<joint axis='0 1 0' stiffness='5' springref='0.1'/>", "");
    assert_eq!(found.springs()[0].rest, [0.1]);
    let found = model("", "<joint type='slide' stiffness='5' springref='10'/>", "");
    assert_eq!(found.springs()[0].rest, [10.0]);
    let found = model("", "<joint type='ball' stiffness='5' springref='10'/>", "");
    assert_eq!(found.springs()[0].rest, [0.0, 0.0, 0.0, 1.0]);
    // `springdamper` replaces the linear coefficients
    let both = "<joint axis='0 1 0' springdamper='0.5 1' stiffness='9' damping='3 1 2' armature='0.1'/>";
    let found = model("", both, "");
    close(&[found.springs()[0].stiffness[0], found.damping()[0]], &[0.6, 0.6]);
    assert_eq!(found.damping_polynomial(), [[1.0, 2.0]]);
}

/// Compares springs and gains that depend on inertia with MuJoCo's `jnt_stiffness`, `dof_damping` and
/// `actuator_biasprm`. In these robots, joints carry other joints. The inertia is the inverse of J M⁻¹ Jᵀ in the
/// initial configuration of the file. J is the Jacobian of a length, and M is the inertia matrix with the rotors of
/// joints and tendons.
#[test]
fn springs_and_gains_from_inertia() {
    let text = format!(
        "<mujoco><worldbody><body><joint name='p' axis='0 1 0' armature='0.1'/>{INERTIAL}
        <body pos='0.3 0 0.1'><joint name='s' type='slide' axis='1 0 1' springdamper='0.4 0.7'/>{INERTIAL}
        <body pos='0 0.2 0.3' euler='20 30 0'>
        <joint name='o' type='ball' springdamper='0.2 1.5' stiffness='0 2' armature='0.02'/>{INERTIAL}</body></body></body>
        <body pos='1 2 3' euler='0 40 10'><joint name='f' type='free' springdamper='0.5 0.8' frictionloss='0.3'/>{INERTIAL}
        <site name='site' pos='0.2 0 0'/></body></worldbody>
        <tendon><fixed name='t' armature='0.2'><joint joint='p' coef='1.5'/></fixed></tendon>
        <actuator><position joint='p' kp='50' dampratio='0.7' gear='2'/><position tendon='t' kp='20' dampratio='1'/>
        <position joint='o' kp='3' dampratio='1' gear='1 2 0'/><position joint='f' kp='3' dampratio='1' gear='1 2 0 0 1 0'/>
        <position site='site' kp='3' dampratio='0.5' gear='0 0 1'/><pid joint='s' kp='4' dampratio='1' input='pos'/></actuator></mujoco>"
    );
    let found = read(&text).unwrap();
    let stiffness: Vec<f64> = found.springs().iter().map(|spring| spring.stiffness[0]).collect();
    close(&stiffness, &[43.581938682902695, 0.614243397210021, 0.3396226415094344]);
    assert_eq!(found.springs()[1].stiffness[1], 2.0);
    close(
        &found.damping()[..6],
        &[0.0, 17.08411996369786, 0.552819057489019, 0.552819057489019, 0.552819057489019, 0.21735849056603804],
    );
    let kv: Vec<f64> = found.actuators().iter().map(|actuator| actuator.kv).collect();
    let expected = [
        5.980114713494406,
        7.204107871896225,
        0.36260195824674335,
        0.5403460004034449,
        1.897366596101027,
        7.393861229684606,
    ];
    close(&kv, &expected);
    let rest = &found.springs()[2].rest;
    close(&rest[..3], &[1.0, 2.0, 3.0]);
    close(&rest[3..], &[0.02980901962620916, 0.34071865342161006, 0.08189960831908934, 0.9361168066628592]);
}

/// Compares tendons with MuJoCo's `qfrc_spring`, `qfrc_damper` and `ten_length`. A tendon over one joint is a spring, a
/// damper and a limit of this joint.
#[test]
fn tendons_over_one_joint() {
    let fixed = |attributes: &str| {
        format!("<tendon><fixed name='t' {attributes}><joint joint='j' coef='-2'/></fixed></tendon>")
    };
    let found = model("", HINGE, &fixed("damping='1 2 3' stiffness='3 4 5' springlength='0.2' frictionloss='0.3'"));
    let [spring] = found.springs() else { panic!() };
    close(&spring.rest, &[-0.1]);
    let torque = |q: f64| {
        let x = q - spring.rest[0];
        -(spring.stiffness[0] + spring.stiffness[1] * x + spring.stiffness[2] * x * x) * x
    };
    close(&[torque(0.3), torque(-0.3)], &[-4.8, 4.32]);
    close(found.friction(), &[0.6]);
    let d = |v: f64| {
        -(found.damping()[0] + found.damping_polynomial()[0][0] * v + found.damping_polynomial()[0][1] * v * v) * v
    };
    close(&[d(0.7)], &[-27.104]);
    // by default, the rest length of the tendon's spring is its length at the rest position of the joint's spring
    let found = model("", "<joint name='j' axis='0 1 0' springref='20'/>", &fixed("stiffness='3'"));
    close(&found.springs()[0].rest, &[0.3490658503988659]);
    let found = model("", HINGE, &fixed("range='-1 0.5'"));
    close(&[found.limits().lower[0], found.limits().upper[0]], &[-0.25, 0.5]);
    let excluded = model("", HINGE, &fixed("range='4 5'"));
    close(&[excluded.limits().lower[0], excluded.limits().upper[0]], &[-30f64.to_radians(), 60f64.to_radians()]);
    let what = "range: its length has no limits, for they exclude those of its joint";
    assert_eq!(said(&excluded), [format!("<string>:1: fixed `t`: {what}")]);
    let yields = model("", HINGE, &fixed("stiffness='3' springyield='0.1'"));
    let what = "springyield: the spring does not yield, however far it is stretched";
    assert_eq!(said(&yields), [format!("<string>:1: fixed `t`: {what}")]);
    let slack = model("", HINGE, &fixed("stiffness='3' springlength='0.2 0.3'"));
    assert!(slack.springs().is_empty());
    let what = "stiffness: its spring does not act, for its spring is slack between two lengths";
    assert_eq!(said(&slack), [format!("<string>:1: fixed `t`: {what}")]);
}

/// Compares the inertia matrix M with MuJoCo's `mj_fullM`, for tendons over several joints. Only effects that the
/// diagonal of M cannot represent cause warnings.
#[test]
fn tendons_over_several_joints() {
    let text = |first: &str, second: &str, attributes: &str| {
        let ball = "<geom size='0.1'/>";
        format!(
            "<mujoco><worldbody><body><joint name='r'/>{ball}<body pos='1 0 0'><joint name='a' axis='0 1 0'/>{ball}</body>
            <body pos='0 1 0'><joint name='b' axis='1 0 0'/>{ball}</body></body></worldbody>
            <tendon><fixed name='t' {attributes}><joint joint='{first}' coef='2'/><joint joint='{second}' coef='3'/></fixed></tendon>
            </mujoco>"
        )
    };
    // MuJoCo's M has no entry for two joints on different branches
    let found = read(&text("a", "b", "armature='1'")).unwrap();
    assert_eq!((found.armature(), said(&found).len()), (&[0.0, 4.0, 9.0][..], 0));
    let found = read(&text("r", "b", "armature='1'")).unwrap();
    assert_eq!(found.armature(), [0.0; 3]);
    let what = "it is missing in M, for the tendon runs over several joints";
    assert_eq!(said(&found), [format!("<string>:3: fixed `t`: armature: {what}")]);
    let found = read(&text("a", "b", "stiffness='1' damping='2' frictionloss='3' range='-1 1'")).unwrap();
    let names: Vec<String> = said(&found).iter().map(|said| said.split(": ").nth(2).unwrap().to_owned()).collect();
    assert_eq!(names, ["stiffness", "damping", "frictionloss", "range"]);
    assert!(said(&read(&text("a", "b", "")).unwrap()).is_empty());
    let spatial = HINGE.to_owned();
    let path = "<tendon><spatial name='t' stiffness='3'><site site='s'/><site site='s'/></spatial></tendon>";
    let motor = "<actuator><motor name='m' tendon='t'/></actuator>";
    let found = model("", &spatial, &format!("{path}{motor}"));
    let expected = [
        "<string>:1: spatial `t`: stiffness: its spring does not act, for a spatial tendon is left out",
        "<string>:1: motor `m`: it is left out of the table of actuators: it drives a spatial tendon",
    ];
    assert_eq!(said(&found), expected);
}

#[test]
fn weight_is_compensated() {
    let inside = format!("{HINGE}{INERTIAL}<body name='c' pos='0 0 1' gravcomp='0.5'>{INERTIAL}</body>");
    let text = format!(
        "<mujoco><worldbody><body name='b' gravcomp='2'>{inside}</body><body gravcomp='1'>{INERTIAL}</body></worldbody></mujoco>"
    );
    let found = read(&text).unwrap();
    let carried = |model: &Model| {
        let [compensation] = model.gravity_compensation() else { panic!() };
        assert_eq!((compensation.body, compensation.ratio), (1, 2.0));
        compensation.carried(model.bodies()[1].inertia)
    };
    assert_eq!(carried(&found).mass, 5.0);
    close(&carried(&found).mass_com.to_array(), &[0.5, 0.0, 1.0]); // 4 kg at (0.1, 0, 0) and 1 kg at (0.1, 0, 1)
    let scaled = read(&text.replace("<worldbody>", "<compiler settotalmass='12'/><worldbody>")).unwrap();
    close(&[carried(&scaled).mass], &[10.0]);
    // as in MuJoCo, a negative `gravcomp` acts only if another `gravcomp` is positive
    let negative = text.replace("gravcomp='0.5'", "gravcomp='-0.5'");
    close(&[carried(&read(&negative).unwrap()).mass], &[3.0]);
    let alone = read(&negative.replace("gravcomp='2'", "").replace("gravcomp='1'", "")).unwrap();
    assert!(alone.gravity_compensation().is_empty());
    let what = "gravcomp: below 0, it acts in MuJoCo only if that of another body is above 0";
    assert_eq!(said(&alone), [format!("<string>:1: body `c`: {what}")]);
    let acting = "<joint name='j' axis='0 1 0' actuatorgravcomp='true' actuatorfrcrange='-1 1'/>";
    let found = read(&text.replace(HINGE, acting)).unwrap();
    let what = "actuatorgravcomp: the compensation of gravity acts as a passive force, outside the limits of effort; MuJoCo \
                adds it to the efforts of the actuators";
    assert_eq!(said(&found), [format!("<string>:1: joint `j`: {what}")]);
}

/// Compares passive forces with MuJoCo's `qfrc_passive`, and checks the effect of `disable` on forces and limits.
#[test]
fn switches() {
    let joint = "<joint name='j' axis='0 1 0' stiffness='1' damping='2' frictionloss='3' range='-10 10'/>";
    let after = "<equality><weld body1='b'/></equality><actuator><motor joint='j' ctrlrange='-1 1' group='3' armature='0.1'/></actuator>";
    let with = |flags: &str| {
        read(&one(&format!("<option {flags}</option>"), joint, after).replace("name='b'", "name='b' gravcomp='1'"))
            .unwrap()
    };
    let flag = |names: &[&str]| {
        let flags: String = names.iter().map(|name| format!("{name}='disable' ")).collect();
        with(&format!("><flag {flags}/>"))
    };
    let on = flag(&[]);
    assert_eq!((on.springs().len(), on.damping()[0], on.friction()[0], on.constraints().len()), (1, 2.0, 3.0, 1));
    assert_eq!((on.gravity_compensation().len(), on.armature()[0]), (1, 0.1));
    assert!(flag(&["spring"]).springs().is_empty());
    assert_eq!(flag(&["damper"]).damping(), [0.0]);
    assert_eq!(flag(&["spring", "damper"]).gravity_compensation(), []); // without both, MuJoCo has no passive force
    assert_eq!(flag(&["frictionloss"]).friction(), [0.0]);
    assert_eq!(flag(&["limit"]).limits().upper, [f64::INFINITY]);
    assert!(flag(&["equality"]).constraints().is_empty());
    let free = flag(&["constraint"]);
    assert_eq!((free.constraints().len(), free.friction()[0], free.limits().upper[0]), (0, 0.0, f64::INFINITY));
    for off in [flag(&["actuation"]), with("actuatorgroupdisable='2 3'>")] {
        assert_eq!((effort(&off)[1], off.armature()[0], off.actuators().len()), (f64::INFINITY, 0.1, 0));
        let what = "it is disabled by <option>: it is no actuator, and no limit of effort";
        assert_eq!(said(&off), [format!("<string>:1: <motor>: {what}")]);
    }
}

/// Checks that the compensated weight changes with the inertia. In MuJoCo, `gravcomp` is a ratio: if masses are
/// doubled, `body_mass · body_gravcomp` is doubled, too. A part of the body with another ratio keeps this ratio.
#[test]
fn compensation_follows_the_inertia() {
    let text = format!(
        "<mujoco><worldbody><body name='b' gravcomp='0.5'>{HINGE}{INERTIAL}
        <body name='part' pos='0 0 1'>{INERTIAL}</body></body></worldbody></mujoco>"
    );
    let found = read(&text).unwrap();
    let carried = |model: &Model| {
        let [compensation] = model.gravity_compensation() else { panic!() };
        let carried = compensation.carried(model.bodies()[1].inertia);
        [carried.mass, carried.mass_com.x, carried.mass_com.y, carried.mass_com.z]
    };
    close(&carried(&found), &[1.0, 0.1, 0.0, 0.0]); // 0.5 · 2 kg at (0.1, 0, 0)
    // 4 kg are added at the centre of the moving link, to which `write_mjcf` writes the difference
    let more = Inertia::from_com(4.0, Vec3::new(0.1, 0.0, 0.0), Sym3::diagonal(0.1));
    let heavier = found.with_inertias(|i, I| if i == 1 { I + more } else { I }).unwrap();
    close(&carried(&heavier), &[3.0, 0.3, 0.0, 0.0]); // 0.5 · 6 kg
    let (folder, file) = (std::env::temp_dir(), format!("condyle_gravcomp_{}.xml", std::process::id()));
    let path = folder.join(file);
    std::fs::write(&path, &text).unwrap();
    heavier.write_mjcf(&path, &path).unwrap();
    let written = Model::from_mjcf(&path, &MjcfOptions::default()).unwrap();
    close(&carried(&written), &carried(&heavier));
    // with a smaller inertia, the whole inertia is written to the moving link, so the part loses its inertia and the
    // compensated mass changes
    let light = found.with_inertias(|i, I| if i == 1 { I.scale(0.3) } else { I }).unwrap();
    let said = light.write_mjcf(&path, &path).unwrap_err().to_string();
    let what = "cannot be written, for its links have different ratios: the file gives";
    assert!(said.contains(&format!("body `b`: its compensated mass -0.4 kg {what} 0.6 kg")), "{said}");
    std::fs::remove_file(path).unwrap();
}

/// Checks that a locked body keeps its own ratio of compensated weight. The base of a robot that is attached to another
/// robot also keeps its ratio.
#[test]
fn compensation_of_merged_bodies() {
    let text = |ratio: [&str; 2]| {
        format!(
            "<mujoco><worldbody><body name='a' gravcomp='{}'><joint name='a' axis='0 1 0'/>{INERTIAL}
            <body name='b' pos='0 0 1' gravcomp='{}'><joint name='b' axis='0 1 0'/>{INERTIAL}</body></body></worldbody>
            </mujoco>",
            ratio[0], ratio[1]
        )
    };
    // each body has 2 kg with its centre at x = 0.1 m, and the second body is 1 m above the first one
    for (ratio, mass, moment) in [(["0.5", "1"], 3.0, 2.0), (["0.5", "0"], 1.0, 0.0), (["0", "0.25"], 0.5, 0.5)] {
        let found = read(&text(ratio)).unwrap();
        let locked = found.lock(&[2], &[0.0; 2]).unwrap();
        let [compensation] = locked.gravity_compensation() else { panic!() };
        let carried = compensation.carried(locked.bodies()[1].inertia);
        close(&[carried.mass, carried.mass_com.x, carried.mass_com.z], &[mass, 0.1 * mass, moment]);
    }
    let base = read(&format!("<mujoco><worldbody><body name='c'>{INERTIAL}</body></worldbody></mujoco>")).unwrap();
    let both = read(&text(["0", "0.5"])).unwrap().append(2, Se3::identity(), &base, "c_").unwrap();
    let carried = both.gravity_compensation()[0].carried(both.bodies()[2].inertia);
    close(&[carried.mass, carried.mass_com.x], &[1.0, 0.1]);
}
