//! Tests of model files that users have edited. Each file must give a working model, or an error with the reason.

use crate::common;

use common::table::{Input, Output, functions};
use common::{Tree, embedded, rng};
use condyle_dynamics::{Data, Model, Warning};
use rand::RngExt;
use rand::rngs::StdRng;
use serde_json::{Value, json};

fn read(file: &Value) -> Result<Model, String> {
    serde_json::from_value(file.clone()).map_err(|e| e.to_string())
}

fn arm() -> Value {
    serde_json::to_value(&embedded()[0]).unwrap()
}

/// Checks the error message for a file in which the value at `pointer` was replaced.
#[track_caller]
fn expect(pointer: &str, value: Value, message: &str) {
    let mut file = arm();
    *file.pointer_mut(pointer).expect(pointer) = value;
    let said = read(&file).expect_err(message);
    assert!(said.starts_with(message), "{said}\n{message}");
}

#[test]
fn mistakes_have_names() {
    expect("/bodies/3/parent", json!(5), "body `link3`: number 3 on body 5: bodies stand parents first, depth first");
    expect("/bodies/3/parent", json!(3), "body `link3`: number 3 on body 3");
    expect("/bodies/3/name", json!("link2"), "two bodies are named `link2`");
    expect("/bodies/3/idx_v", json!(3), "body `link3`: begins at 2 in q and 3 in v, expected 2 and 2");
    expect("/bodies/3/inertia/mass", json!(-1.0), "body `link3`: mass is -1");
    expect("/bodies/3/placement/rotation/x/x", json!(0.5), "body `link3`: placement is no rotation");
    expect("/bodies/3/joint", json!("Planar"), "body `link4`: begins at 3 in q and 3 in v");
    let none = json!({"Revolute": {"axis": {"x": 0.0, "y": 0.0, "z": 0.0}}});
    expect("/bodies/3/joint", none, "body `link3`: axis");
    let mimic = json!({"ratio": 2.0, "offset": 0.0});
    expect("/bodies/7/mimic", mimic, "joint `joint7`: mimics the joint whose velocity begins at 6: there is none");
    expect("/bodies", json!([]), "bodies: expected 1 entries, found 0");
    expect("/frames/2/body", json!(99), "frame `link1`: there is no body 99");
    expect("/frames/2/placement/rotation/z/z", json!(-1.0), "frame `link1`: placement is no rotation");
    expect("/limits/lower", json!([0.0]), "limits.lower: expected 7 entries, found 1");
    expect("/limits/lower/2", json!(9.0), "joint `joint3`: lower limit 9 is above upper limit");
    expect("/damping", json!([0.0]), "damping: expected 7 entries, found 1");
    expect("/armature", json!([]), "armature: expected 7 entries, found 0");
    expect("/damping/2", json!(-1.0), "joint `joint3`: damping is -1, expected a finite number of at least 0");
    expect("/friction/2", json!(-1.0), "joint `joint3`: friction is -1");
    expect("/armature/0", json!(-1e-3), "joint `joint1`: armature is -0.001");
    expect(
        "/limits/velocity/0",
        json!(-1.0),
        "joint `joint1`: limit of velocity is -1, expected a number of at least 0",
    );
    expect(
        "/limits/effort_upper/6",
        json!(-100.0),
        "joint `joint7`: lower limit of effort -12 is above upper limit -100",
    );
    expect("/gravity/z", json!(null), "invalid type: null, expected f64");
    let mut file = arm();
    file["nodes"] = json!([]);
    assert!(read(&file).unwrap_err().starts_with("unknown field `nodes`"));
}

/// Reads a file of an earlier version, whose limits of effort are the same in both directions.
#[test]
fn one_limit_of_effort_is_read_as_two() {
    let mut file = arm();
    let limits = file.pointer_mut("/limits").unwrap().as_object_mut().unwrap();
    limits.remove("effort_lower");
    limits.remove("effort_upper");
    limits.insert("effort".into(), json!([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, null]));
    let model = read(&file).unwrap();
    assert_eq!(model.limits().effort_upper, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, f64::INFINITY]);
    assert_eq!(model.limits().effort_lower, [-1.0, -2.0, -3.0, -4.0, -5.0, -6.0, f64::NEG_INFINITY]);
}

/// Checks that edited values of a file have an effect on computations.
#[test]
fn edits_count() {
    let mut file = arm();
    file["bodies"][7]["inertia"]["mass"] = json!(10.0);
    file["gravity"]["z"] = json!(-1.62);
    let (before, after) = (&embedded()[0], read(&file).unwrap());
    assert_eq!(after.total_mass(), before.total_mass() - before.bodies()[7].inertia.mass + 10.0);
    assert_eq!(after.gravity().z, -1.62);
    file["bodies"][7]["inertia"] = json!({"mass": 0.0, "mass_com": {"x": 0.0, "y": 0.0, "z": 0.0},
        "rotational": {"xx": 0.0, "xy": 0.0, "yy": 0.0, "xz": 0.0, "yz": 0.0, "zz": 0.0}});
    file["armature"][6] = json!(0.0);
    let light = read(&file).unwrap();
    assert_eq!(light.singular_joints(), [7]);
    assert!(matches!(light.warnings().last(), Some(Warning::Singular { joint }) if joint == "joint7"));
}

/// Returns a random element of a file.
fn anywhere<'a>(file: &'a mut Value, rng: &mut StdRng) -> &'a mut Value {
    let inside = match file {
        Value::Array(list) => list.len(),
        Value::Object(map) => map.len(),
        _ => 0,
    };
    if inside == 0 || rng.random::<f64>() < 0.1 {
        return file;
    }
    let at = rng.random_range(0..inside);
    let next = match file {
        Value::Array(list) => list.get_mut(at),
        Value::Object(map) => map.values_mut().nth(at),
        _ => None,
    };
    anywhere(next.expect("it has so many"), rng)
}

/// Makes a random change in a file: changes a number, adds or removes an entry, or swaps two elements.
fn edit(file: &mut Value, rng: &mut StdRng) {
    let numbers = [json!(0), json!(1), json!(2), json!(-1.0), json!(1e300), json!(u64::MAX), json!(null), json!(0.5)];
    let (change, other) = (rng.random_range(0..4), anywhere(file, rng).clone());
    let number = numbers[rng.random_range(0..numbers.len())].clone();
    let place = anywhere(file, rng);
    match place {
        Value::Array(list) if change == 0 && !list.is_empty() => drop(list.remove(rng.random_range(0..list.len()))),
        Value::Array(list) if change == 1 => list.push(list.last().cloned().unwrap_or(number)),
        Value::Array(list) if change == 2 && !list.is_empty() => {
            let (a, b) = (rng.random_range(0..list.len()), rng.random_range(0..list.len()));
            list.swap(a, b);
        }
        Value::Number(_) => *place = number,
        _ => *place = other,
    }
}

/// Number of edited files that the test reads.
const FILES: usize = 3000;

#[test]
fn edited_files_never_panic() {
    let mut rng = rng(0);
    let models = [embedded()[0].clone(), Tree::random_with_mimics(&mut rng).build(), embedded()[1].clone()];
    let files = models.map(|model| serde_json::to_value(model).unwrap());
    let mut good = 0;
    for k in 0..FILES {
        let mut file = files[k % files.len()].clone();
        for _ in 0..rng.random_range(1..3) {
            edit(&mut file, &mut rng);
        }
        match read(&file) {
            Err(said) => assert!(!said.is_empty()),
            Ok(model) => {
                good += 1;
                if good % 10 == 0 && model.singular_joints().is_empty() {
                    let input = Input::<f64>::random(&model, &mut rng);
                    for (_, function) in functions() {
                        function(&model, &mut Data::new(&model), &input, &mut Output::new(&model));
                    }
                }
            }
        }
    }
    assert!(good > FILES / 10 && good < FILES, "{good} of {FILES} could be read");
}
