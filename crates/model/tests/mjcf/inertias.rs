//! Tests of MJCF: masses and inertias of geoms and meshes, and of bodies that are fixed to the world.

use super::*;

/// Tolerance for meshes: MuJoCo computes the principal axes of a mesh only up to 1e-7.
const MESH: f64 = 1e-7;

/// Returns an MJCF with a dented mesh, and a body with this mesh.
fn mesh(attributes: &str, geom: &str, before: &str) -> String {
    let points = "vertex='0 0 0  1 0 0  0 2 0  0 0 3  0.4 0.4 0.4'";
    let faces = "face='0 2 1  0 1 3  0 3 2  1 2 4  2 3 4  3 1 4'";
    let asset = format!("{before}<asset><mesh name='m' {points} {faces} {attributes}/></asset>");
    robot(&asset, &format!("<body name='b'><joint/><geom mesh='m' pos='0.1 0.2 0.3' {geom}/></body>"), "")
}

#[track_caller]
fn weighs(text: &str, expected: &[f64], tolerance: f64) {
    near(text, &inertia(&read(text).unwrap().bodies()[1]), expected, tolerance);
}

#[test]
fn rules_of_meshes() {
    let convex = [1000.0, 0.35, 0.7, 1.05, 487.5, 375.0, 187.5, 25.0, 37.5, 75.0];
    let exact = [
        &[733.3333442608516, 0.3136363651264798, 0.6636363651264798, 1.01363636512648][..],
        &[360.3606112701158, 275.19394343509174, 135.0272747922834],
        &[19.56969722878932, 27.40303073773141, 53.56969784863731],
    ]
    .concat();
    let legacy = [
        &[794.0330451295457, 0.34421575953668987, 0.6794954749575327, 0.9921464732986216][..],
        &[384.39769792859306, 293.85704288941145, 148.4526190129348],
        &[20.11230279329423, 31.6212670888217, 60.7022417258391],
    ]
    .concat();
    let shell = [
        &[9169.427261858753, 0.300345811463577, 0.7423759050192196, 1.178864514462259][..],
        &[7231.342238246195, 5489.983888256404, 2754.553842110464],
        &[398.6751509066015, 547.4333735294155, 1221.292174069122],
    ]
    .concat();
    let mirrored = [
        &[4400.000065565109, 0.21363636512647974, 1.1272727302529593, -1.8409090953794387][..],
        &[16156.564221830344, 13663.818048672563, 2791.909109385578],
        &[234.8351630845724, -493.25435888540335, -1928.5090262358174],
    ]
    .concat();
    for (rule, expected) in [("convex", &convex[..]), ("exact", &exact), ("legacy", &legacy), ("shell", &shell)] {
        weighs(&mesh(&format!("inertia='{rule}'"), "type='mesh'", ""), expected, MESH);
    }
    weighs(&mesh("", "type='mesh'", ""), &legacy, MESH);
    weighs(&mesh("", "type='mesh'", "<compiler exactmeshinertia='true'/>"), &exact, MESH);
    weighs(
        &mesh("class='q'", "type='mesh'", "<default><default class='q'><mesh inertia='shell'/></default></default>"),
        &shell,
        MESH,
    );
    let moved = "inertia='exact' scale='1 -2 3' refpos='0.1 0 0' refquat='0 1 0 0'";
    weighs(&mesh(moved, "type='mesh'", ""), &mirrored, MESH);
    // a mesh with an explicit mass, and a mesh with points but no triangles
    let given = read(&mesh("", "type='mesh' mass='6'", "")).unwrap();
    assert_eq!(given.total_mass(), 6.0);
    weighs(&mesh("inertia='exact'", "type='mesh'", "").replace("face=", "user="), &convex, MESH);
}

#[test]
fn primitives_fitted_to_meshes() {
    for (kind, fit, mass) in [
        ("sphere", "false", 139.74948843659737),
        ("sphere", "true", 2748.6445030644195),
        ("capsule", "false", 172.70343290594155),
        ("capsule", "true", 1237.7695211146593),
        ("cylinder", "false", 161.29690334428784),
        ("cylinder", "true", 1556.5783154435926),
        ("ellipsoid", "false", 86.50065914704324),
        ("ellipsoid", "true", 454.9763225600576),
        ("box", "false", 165.20408980750923),
        ("box", "true", 868.9407687024695),
    ] {
        let compiler = format!("<compiler fitaabb='{fit}'/>");
        let body = &read(&mesh("", &format!("type='{kind}' fitscale='0.5'"), &compiler)).unwrap();
        near(kind, &[body.total_mass()], &[mass], 1e-6);
    }
    let boxed = [
        &[165.20408980750923, 0.34421575953668987, 0.6794954749575327, 0.9921464732986216][..],
        &[19.994152699285475, 15.284749671895305, 7.721649607029771],
        &[1.0461260703441848, 1.6447560589612014, 3.157380746023156],
    ]
    .concat();
    weighs(&mesh("", "type='box' fitscale='0.5'", ""), &boxed, MESH);
    assert!((read(&mesh("", "", "")).unwrap().total_mass() - 8.0 * 139.74948843659737).abs() < 1e-4); // a sphere
}

#[test]
fn shells() {
    for (kind, expected) in [
        ("sphere", [125.66370614359174, 0.8377580409572783, 0.8377580409572783, 0.8377580409572783]),
        ("capsule", [376.9911184307752, 12.985249634837814, 12.985249634837814, 3.351032163829113]),
        ("cylinder", [314.1592653589793, 7.278022980816355, 7.278022980816355, 2.827433388230814]),
        ("ellipsoid", [489.7193333371731, 18.075174882542342, 14.068366576335393, 8.102680936804973]),
        ("box", [880.0, 54.13333333333334, 42.13333333333334, 24.266666666666673]),
    ] {
        let geom = format!("<body><joint/><geom type='{kind}' size='0.1 0.2 0.3' shellinertia='true'/></body>");
        let found = inertia(&model("", &geom, "").bodies()[1]);
        // the layer of an ellipsoid is 1 µm thick, so its moments are differences of nearly equal numbers
        near(
            kind,
            &[found[0], found[4], found[5], found[6]],
            &expected,
            if kind == "ellipsoid" { 1e-9 } else { 1e-12 },
        );
    }
    let wrong = mesh("", "type='mesh' shellinertia='true'", "");
    assert!(read(&wrong).unwrap_err().to_string().contains("shellinertia: a mesh has an attribute `inertia` for it"));
}

#[test]
fn shapes_that_mujoco_makes() {
    let shape = |kind: &str, params: &str| {
        let asset = format!("<asset><mesh name='m' builtin='{kind}' params='{params}'/></asset>");
        read(&robot(&asset, "<body><joint/><geom type='mesh' mesh='m'/></body>", ""))
    };
    for (kind, params, mass) in [
        ("sphere", "0", 2536.1504726624075),
        ("sphere", "2", 4047.0446616510244),
        ("hemisphere", "3", 1909.7436909829885),
        ("supersphere", "5 0.5 1.5", 2616.03796525723),
        ("supertorus", "9 0.5 0.7 1.3", 4907.751565541698),
        ("wedge", "5 6 40 30 0.3", 85.04873616151886),
        ("cone", "5 0.4", 2472.746976824322),
        ("cone", "6 0", 1732.0507764816284),
    ] {
        near(kind, &[shape(kind, params).unwrap().total_mass()], &[mass], 1e-9);
    }
    for (kind, params) in
        [("sphere", "5"), ("sphere", "1 2"), ("cone", "2 0"), ("prism", "5"), ("supersphere", "1e9 1 1")]
    {
        assert!(shape(kind, params).unwrap_err().to_string().contains(&format!("builtin: a {kind} with params")));
    }
}

#[test]
fn files_of_meshes() {
    let stl = |points: [[f32; 3]; 4]| {
        let mut bytes = vec![0; 80];
        bytes.extend(4u32.to_le_bytes());
        for t in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            bytes.extend([0; 12]);
            bytes.extend(t.iter().flat_map(|&k| points[k]).flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
        }
        bytes
    };
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
    let stl = stl(corners);
    let obj = b"v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let mut msh: Vec<u8> = [4i32, 0, 0, 4].iter().flat_map(|x| x.to_le_bytes()).collect();
    msh.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
    msh.extend([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3].iter().flat_map(|x: &i32| x.to_le_bytes()));
    let main = |file: &str, compiler: &str| {
        let before = format!("<compiler {compiler}/><asset><mesh file='{file}'/></asset>");
        robot(&before, "<body><joint/><geom type='mesh' mesh='a'/></body>", "").into_bytes()
    };
    let mass = |file: &str, compiler: &str| {
        let main = main(file, compiler);
        let files: [(&str, &[u8]); 6] = [
            ("main.xml", &main),
            ("m/a.stl", &stl),
            ("m/a.obj", obj),
            ("a.msh", &msh),
            ("m/b/a.stl", &stl[..100]),
            ("m/a.dae", b"<COLLADA/>"),
        ];
        let name = format!("{}{}", file.replace(['/', '.'], "-"), compiler.len());
        Folder::new(&name, &files).read("main.xml").map(|m| m.total_mass())
    };
    for (file, compiler) in [
        ("a.stl", "meshdir='m'"),
        ("a.obj", "assetdir='m'"),
        ("m/a.stl", ""),
        ("a.msh", ""),
        ("far/away/a.obj", "meshdir='m' strippath='true'"),
    ] {
        near(file, &[mass(file, compiler).unwrap()], &[1000.0], 1e-12);
    }
    for (file, expected) in [
        ("m/b/a.stl", "a.stl`: 4 triangles need 284 bytes, there are 100"),
        ("a.stl", "a.stl`: "),
        ("m/a.dae", "a.dae`: is no STL, OBJ or MSH"),
    ] {
        let error = mass(file, "").unwrap_err().to_string();
        assert!(error.contains("has the mass of mesh `a`") && error.contains(expected), "{error}");
    }
}

/// Compares the mass of a mesh with faces of five corners with `body_mass` and `body_ipos` of MuJoCo 4.0.0. If the face
/// were cut as a fan from its first corner, the mass would be 17500 kg.
#[test]
fn faces_of_five_corners_that_are_in_no_plane() {
    let mut obj = "v 3 1 0\nv 5 1 0.5\nv 6 3 0\nv 4 5 1\nv 2 3 -0.5\nv 4 2 -5\nf 1 2 3 4 5\n".to_owned();
    obj += "f 6 2 1\nf 6 3 2\nf 6 4 3\nf 6 5 4\nf 6 1 5\n";
    let main = robot("<asset><mesh file='a.obj'/></asset>", "<body><joint/><geom type='mesh' mesh='a'/></body>", "");
    let files: [(&str, &[u8]); 2] = [("main.xml", main.as_bytes()), ("a.obj", obj.as_bytes())];
    let found = Folder::new("pentagon", &files).read("main.xml").unwrap();
    near("mass", &[found.total_mass()], &[18166.666666666668], 1e-12);
    let com = found.bodies()[1].inertia.mass_com.scale(1.0 / found.total_mass());
    near("com", &com.to_array(), &[4.033256880733944, 2.561926605504587, -1.0057339449541285], 1e-12);
    assert!(found.warnings().is_empty());
    // a face without an ear
    let obj = obj.replace(
        "f 1 2 3 4 5",
        "v 3 0 -0.5\nv 3 3 -0.5\nv -3 1 0\nv -2 -1 -1\nv 2 2 0.5\nf 1 2 3 4 5\nf 7 8 9 10 11 9",
    );
    let files: [(&str, &[u8]); 2] = [("main.xml", main.as_bytes()), ("a.obj", obj.as_bytes())];
    let found = Folder::new("no-ear", &files).read("main.xml").unwrap();
    near("mass", &[found.total_mass()], &[18166.666666666668], 1e-12);
    let said = "mesh `a`: 1 of its faces are not cut into triangles, or in part, as in MuJoCo: its surface has holes";
    assert!(found.warnings().iter().any(|warning| warning.to_string().ends_with(said)), "{:?}", found.warnings());
}

#[test]
fn invalid_meshes() {
    let flat = "<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 1 1 0'/></asset>";
    let inside = |geom: &str| format!("<body><joint/><geom type='mesh' {geom}/></body>");
    assert!(
        refused(flat, &inside("mesh='m'"), "").contains("<geom>: has the mass of mesh `m`: its points lie in a plane")
    );
    assert!(refused(flat, &inside("mesh='n'"), "").contains("mesh: no <mesh> of <asset> is named `n`"));
    assert!(refused("", &inside(""), "").contains("a geom of type mesh has no mesh"));
    let bad = flat.replace("/></asset>", " face='0 1 9'/></asset>");
    assert!(refused(&bad, &inside("mesh='m'"), "").contains("face: there is no vertex 9, of 4"));
    let inside_out = mesh("inertia='exact' scale='1 1 1'", "type='mesh'", "").replace("0 2 1  0 1 3", "0 1 2  0 3 1");
    let inside_out = inside_out.replace("0 3 2  1 2 4  2 3 4  3 1 4", "0 2 3  1 4 2  2 4 3  3 4 1");
    assert!(read(&inside_out).unwrap_err().to_string().contains("is negative: its triangles are inside out"));
    // an invalid mesh is accepted in a body that is fixed to the world; a body with an <inertial> does not need its
    // mesh
    let fixed = model(flat, "<body name='w'><geom type='mesh' mesh='m'/></body>", "");
    assert!(said(&fixed, WarningKind::LeftOut)[0].contains("the mass of a mesh on body `w` is left out"));
    assert_eq!(model(flat, &body("", "<geom type='mesh' mesh='m'/>"), "").warnings(), []);
    let capped = mesh("inertia='convex' maxhullvert='4'", "type='mesh'", "").replace("0.4 0.4 0.4", "1 2 3");
    let left_out = said(&read(&capped).unwrap(), WarningKind::LeftOut).join("");
    assert!(left_out.contains("maxhullvert of mesh `m`: its hull has all its 5 corners, not 4"), "{left_out}");
}

#[test]
fn bodies_fixed_to_the_world_have_mass() {
    let fixed = format!("<body><geom size='0.1' mass='7'/>{}</body>", body("", ""));
    assert_eq!(model("", &fixed, "").total_mass(), 9.0);
    near("scaled", &[model("<compiler settotalmass='3'/>", &fixed, "").total_mass()], &[3.0], 1e-15);
    // geoms that belong to the world itself have no mass
    assert_eq!(model("", &format!("<geom size='1'/>{}", body("", "")), "").total_mass(), 2.0);
    let field = "<asset><hfield name='h' nrow='2' ncol='2' size='1 2 3 4'/></asset>";
    assert_eq!(model(field, "<body><joint/><geom type='hfield' hfield='h'/></body>", "").total_mass(), 44000.0);
}

/// Checks a body whose <inertial> has a mass but no moments. MuJoCo refuses such a body if it moves: "mass and inertia
/// of moving bodies must be larger than mjMINVAL".
#[test]
fn an_inertial_without_moments() {
    let read = model("", "<body name='b'><joint/>\n<inertial pos='0 0.1 0' mass='2'/></body>", "");
    let what = "has neither diaginertia nor fullinertia: 0 kg m², which MuJoCo refuses in a moving body";
    assert_eq!(said(&read, WarningKind::Assumed), [format!("<string>:2: <inertial>: {what}")]);
    near("inertia", &inertia(&read.bodies()[1]), &[2.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-15);
}

#[test]
fn geoms_in_place_of_an_inertial() {
    let both = body("", "<geom size='0.1' mass='5'/>");
    assert_eq!(model("<compiler inertiafromgeom='true'/>", &both, "").total_mass(), 5.0);
    assert_eq!(model("<compiler inertiafromgeom='auto'/>", &both, "").total_mass(), 2.0);
    // the <inertial> is used if no geom has mass
    let light = body("", "<geom size='0.1' mass='0'/>");
    assert_eq!(model("<compiler inertiafromgeom='true'/>", &light, "").total_mass(), 2.0);
}
