//! Calls kernels through a driver without a GPU (`tests/cuda_driver`), and compares the results with the library's
//! functions.
#![allow(non_snake_case, unsafe_code)]

mod common;
#[path = "../../dynamics/tests/common/mod.rs"]
mod trees;

use common::{compile, folder, is_there};
use condyle_codegen::cuda::{Compiler, Device, DeviceArray, Driver, Error, Kernels, Real, Stream};
use condyle_codegen::{Array, Function, Language, Settings, functions};
use condyle_dynamics::{
    Data, Model, aba, aba_derivatives, crba, minv, random_configuration, rnea, rnea_derivatives, robots,
};
use condyle_spatial::{Scalar, Se3};
use libloading::Library;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::ffi::{CStr, CString, c_char, c_int, c_long, c_uint, c_void};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, MutexGuard, OnceLock};
use trees::Tree;

/// Tolerance, relative to the largest number of an array. A kernel adds in another order than the library, and the
/// inverse inertia matrix M⁻¹ amplifies the rounding errors.
const ROUNDING: f64 = 1e-11;

/// Maximum error of an `f32` kernel, divided by the error of the library in `f32` for the same states. Both errors are
/// differences from `f64` results.
const FURTHER: f64 = 4.0;

/// Fake driver and fake compiler, with access to the calls and objects that the fake driver records.
struct Fake {
    driver: Driver,
    compiler: Compiler,
    library: Library,
    _alone: MutexGuard<'static, ()>,
}

impl Fake {
    /// Builds the fake libraries once, and loads them for one test at a time. Returns `None` if no C compiler exists.
    fn new() -> Option<Self> {
        static FILES: OnceLock<Option<[PathBuf; 2]>> = OnceLock::new();
        static ALONE: Mutex<()> = Mutex::new(());
        let files = FILES.get_or_init(|| {
            let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cuda_driver");
            let build = |from: &str, to: &str| {
                let to = folder(&format!("cuda_{from}")).join(to);
                let flags = ["-Wall", "-Wextra", "-shared", "-fPIC", "-pthread", "-ldl", "-o"];
                compile(Command::new("cc").arg(source.join(from)).args(flags).arg(&to));
                to
            };
            let can = cfg!(target_os = "linux") && is_there("cc") && is_there("g++");
            can.then(|| [build("driver.c", "libcuda.so.1"), build("nvrtc.c", "libnvrtc.so.12")])
        });
        let [driver, nvrtc] = files.as_ref()?;
        let alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        Some(Self {
            driver: Driver::open(driver).unwrap(),
            compiler: Compiler::open(nvrtc).unwrap(),
            // SAFETY: this test built the library.
            library: unsafe { Library::new(driver) }.unwrap(),
            _alone: alone,
        })
    }

    /// Returns the numbers of memory blocks, streams, events, modules and contexts that exist now.
    fn live(&self) -> [c_long; 5] {
        // SAFETY: the declared type equals the function's type in the fake driver.
        let live = unsafe { self.library.get::<unsafe extern "C" fn(c_int) -> c_long>(b"fake_live\0") }.unwrap();
        // SAFETY: the function accepts the indices 0 to 4 of object types.
        core::array::from_fn(|kind| unsafe { live(kind as c_int) })
    }

    fn complaint(&self) -> String {
        // SAFETY: the declared type equals the function's type in the fake driver, and the function returns a string.
        unsafe {
            let complaint = self.library.get::<unsafe extern "C" fn() -> *const c_char>(b"fake_complaint\0").unwrap();
            CStr::from_ptr(complaint()).to_string_lossy().into_owned()
        }
    }

    /// Makes the next call of `function` in the fake driver return `status`.
    fn fail(&self, function: &str, status: c_int) {
        let name = CString::new(function).unwrap();
        // SAFETY: the declared type equals the function's type in the fake driver.
        unsafe {
            let fail = self.library.get::<unsafe extern "C" fn(*const c_char, c_int)>(b"fake_fail\0").unwrap();
            fail(name.as_ptr(), status);
        }
    }

    /// Returns the numbers of blocks, of threads per block and of rows of blocks in the last launch, and the number of
    /// launches.
    fn launches(&self) -> ([c_uint; 3], c_long) {
        let mut last = [0; 3];
        // SAFETY: the declared type equals the function's type in the fake driver.
        unsafe {
            let launches = self.library.get::<unsafe extern "C" fn(*mut c_uint) -> c_long>(b"fake_launches\0").unwrap();
            let count = launches(last.as_mut_ptr());
            (last, count)
        }
    }

    /// Checks that all objects were freed and that no error occurred.
    fn end(self) {
        assert_eq!(self.complaint(), "");
        assert_eq!(self.live(), [0; 5]);
    }
}

/// Computes the results of a function with the library, as reference for the kernel.
fn library<S: Scalar>(model: &Model, name: &str, [q, v, x]: &[Vec<S>; 3]) -> Vec<Vec<S>> {
    let data = &mut Data::new(model);
    match name {
        "rnea" => vec![rnea(model, data, q, v, x, &[]).to_vec()],
        "aba" => vec![aba(model, data, q, v, x, &[]).to_vec()],
        "crba" => vec![crba(model, data, q).as_slice().to_vec()],
        "minv" => vec![minv(model, data, q).as_slice().to_vec()],
        "rnea_derivatives" => {
            let d = rnea_derivatives(model, data, q, v, x, &[]);
            [d.dtau_dq, d.dtau_dv, d.dtau_da].map(|m| m.as_slice().to_vec()).into()
        }
        "aba_derivatives" => {
            let a = aba(model, data, q, v, x, &[]).to_vec();
            let d = aba_derivatives(model, data, q, v, x, &[]);
            [vec![a], [d.da_dq, d.da_dv, d.da_dtau].map(|m| m.as_slice().to_vec()).into()].concat()
        }
        other => panic!("{other}"),
    }
}

/// Returns the arrays of all states in the layout of kernels: the first number of every state, then the second number
/// of every state, and so on.
fn side_by_side<T: Copy>(states: &[Vec<Vec<T>>]) -> Vec<Vec<T>> {
    let of = |a: usize, k: usize| states.iter().map(move |state| state[a][k]);
    (0..states[0].len()).map(|a| (0..states[0][a].len()).flat_map(|k| of(a, k)).collect()).collect()
}

trait Number: Real + Scalar + Into<f64> {
    fn nearest(x: f64) -> Self;
}

impl Number for f64 {
    fn nearest(x: f64) -> Self {
        x
    }
}

impl Number for f32 {
    fn nearest(x: f64) -> Self {
        x as f32
    }
}

/// Calls a kernel once for each number of states in `counts`, and compares all results with the library.
fn check<T: Number>(device: &Device, kernels: &Kernels<T>, model: &Model, name: &str, counts: &[usize]) {
    let (stream, kernel) = (device.stream().unwrap(), kernels.kernel(name).unwrap());
    for &n in counts {
        let rng = &mut StdRng::seed_from_u64(n as u64);
        let (mut inputs, mut expected, mut alike) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..n {
            let q = random_configuration(model, rng);
            let [v, x] = [(); 2].map(|()| (0..model.nv()).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f64>>());
            let state = [q, v, x].map(|numbers| numbers.into_iter().map(T::nearest).collect::<Vec<T>>());
            expected.push(library(model, name, &state.clone().map(|x| x.into_iter().map(Into::into).collect())));
            alike.push(library(model, name, &state));
            inputs.push(state[..kernel.inputs().len()].to_vec());
        }
        let inputs: Vec<_> =
            side_by_side(&inputs).iter().map(|x| DeviceArray::from_slice(&stream, x).unwrap()).collect();
        let new = |array: &Array| DeviceArray::<T>::new(device, array.len() * n).unwrap();
        let mut outputs: Vec<_> = kernel.outputs().iter().map(new).collect();
        let given: Vec<_> = inputs.iter().collect();
        kernel.call(&stream, n, &given, &mut outputs.iter_mut().collect::<Vec<_>>()).unwrap();
        let (expected, alike): (Vec<Vec<f64>>, Vec<Vec<T>>) = (side_by_side(&expected), side_by_side(&alike));
        assert_eq!(outputs.len(), expected.len());
        for ((output, expected), alike) in outputs.iter().zip(&expected).zip(&alike) {
            let error = |found: &[T]| {
                assert_eq!(found.len(), expected.len());
                let apart = found.iter().zip(expected).map(|(&x, y)| -> f64 { (x.into() - y).abs() });
                apart.fold(0.0, |max: f64, x| if max.is_nan() || x <= max { max } else { x }) // keeps NaN
            };
            let scale = expected.iter().fold(1.0, |max: f64, x| max.max(x.abs()));
            let (found, bound) = (error(&output.to_vec(&stream).unwrap()), ROUNDING * scale + FURTHER * error(alike));
            assert!(found <= bound, "{kernel:?}, {n} states: {found:e} where {bound:e} are allowed");
        }
    }
}

fn of(model: &Model, names: &[&str]) -> Vec<Function> {
    functions(model, names, &Settings::default()).unwrap()
}

#[test]
fn kernels_compute_what_the_library_computes() {
    let Some(fake) = Fake::new() else { return };
    let device = fake.driver.device(0).unwrap();
    let robots: [(Model, &[&str]); 3] = [
        (robots::arm7(), &["rnea", "aba", "crba", "aba_derivatives"]),
        (robots::quadruped(), &["rnea", "aba_derivatives"]),
        (robots::humanoid(), &["rnea", "aba"]),
    ];
    for (model, names) in &robots {
        let all = of(model, names);
        let double = device.compile::<f64>(&fake.compiler, "robot", &all).unwrap();
        let single = device.compile::<f32>(&fake.compiler, "robot", &all).unwrap();
        for name in *names {
            check(&device, &double, model, name, &[1, 31, 129, 1000]);
            check(&device, &single, model, name, &[1, 129]);
        }
    }
    drop(device);
    fake.end();
}

/// Returns functions whose kernels have `partitions` partitions, or fewer if the robot does not have enough limbs.
fn in_partitions(model: &Model, names: &[&str], partitions: usize) -> Vec<Function> {
    functions(model, names, &Settings { partitions: NonZero::new(partitions), ..Settings::default() }).unwrap()
}

#[test]
fn limbs_are_computed_by_threads_of_their_own() {
    let Some(fake) = Fake::new() else { return };
    let device = fake.driver.device(0).unwrap();
    let names = ["rnea", "crba", "minv", "rnea_derivatives"];
    // A quadruped has four legs and a trunk. A humanoid has two legs, two arms, a head and a trunk.
    for (model, number) in [(robots::quadruped(), 2), (robots::quadruped(), 5), (robots::humanoid(), 4)] {
        let all = in_partitions(&model, &names, number);
        let double = device.compile::<f64>(&fake.compiler, "robot", &all).unwrap();
        let single = device.compile::<f32>(&fake.compiler, "robot", &all).unwrap();
        for name in names {
            assert_eq!(double.kernel(name).unwrap().partitions(), number);
            for n in [1, 77, 2500] {
                check(&device, &double, &model, name, &[n]);
                assert_eq!(fake.launches().0[2] as usize, number);
            }
            check(&device, &single, &model, name, &[33]);
            assert_eq!(fake.launches().0[2] as usize, number);
        }
    }
    drop(device);
    fake.end();
}

#[test]
fn states_are_shared_out_while_they_are_few() {
    let Some(fake) = Fake::new() else { return };
    let (device, quadruped) = (fake.driver.device(0).unwrap(), robots::quadruped());
    let kernels = device.compile::<f64>(&fake.compiler, "quadruped", &of(&quadruped, &["rnea_derivatives"])).unwrap();
    let partitions = kernels.kernel("rnea_derivatives").unwrap().partitions();
    assert_eq!(partitions, of(&quadruped, &["rnea_derivatives"])[0].partitions(Language::Cuda));
    // The fake device runs eight blocks of 256 threads at the same time.
    let most = 2048 / partitions;
    for (n, rows) in [(1, partitions), (most, partitions), (most + 1, 1), (3000, 1)] {
        check(&device, &kernels, &quadruped, "rnea_derivatives", &[n]);
        assert_eq!(fake.launches().0[2] as usize, rows, "{n} states");
    }
    drop((kernels, device));
    fake.end();
}

#[test]
fn shares_are_as_many_as_pay() {
    let partitions = |model: &Model, name: &str| {
        let function = &of(model, &[name])[0];
        [Language::Cuda, Language::CudaFloat, Language::C, Language::Rust].map(|language| function.partitions(language))
    };
    // These functions are not split. An arm has only one limb. In the other robots, efforts of the trunk and all
    // accelerations need the values of all limbs.
    assert_eq!(partitions(&robots::arm7(), "aba_derivatives"), [1; 4]);
    for model in [robots::quadruped(), robots::humanoid()] {
        for name in ["rnea", "aba", "gravity", "nonlinear_effects"] {
            assert_eq!(partitions(&model, name), [1; 4], "{name}");
        }
        for name in ["rnea_derivatives", "aba_derivatives"] {
            let [double, single, others @ ..] = partitions(&model, name);
            assert!(double > 2 && single > 2 && others == [1; 2], "{name}: {double}, {single}, {others:?}");
        }
    }
    // Two arms that are attached to the world have no common values, so each arm is one partition.
    let arm = robots::arm7();
    let two = &of(&arm.append(0, Se3::identity(), &arm, "other_").unwrap(), &["aba_derivatives"])[0];
    let text = Language::Cuda.text("robot", core::slice::from_ref(two)).remove(0).text;
    let all = two.operations().total();
    let half = all / 2;
    let head = format!("// Partitions: 2, of {half}, {half} operations; all results together take {all}.");
    assert!(text.contains(&head));
    // The requested number of partitions is used, up to the number of limbs.
    let asked =
        |model: &Model, name: &str, number| in_partitions(model, &[name], number)[0].partitions(Language::CudaFloat);
    assert_eq!([1, 2, 3, 9].map(|number| asked(&robots::quadruped(), "rnea", number)), [1, 2, 3, 5]);
    assert_eq!([1, 2, 9].map(|number| asked(&robots::arm7(), "aba_derivatives", number)), [1; 3]);
}

#[test]
fn a_split_kernel_says_how_it_is_launched() {
    let quadruped = robots::quadruped();
    let text = |partitions| {
        Language::CudaFloat.text("robot", &in_partitions(&quadruped, &["rnea_derivatives"], partitions)).remove(0).text
    };
    let split = text(3);
    assert!(
        split.contains("// Partitions: 3, of ")
            && split.contains("name<<<dim3((n + 127) / 128, partitions), 128>>>(n, ...).")
    );
    assert!(
        split.contains("partition < 3;")
            && split.contains("_partition2(int n, int i, ")
            && !split.contains("gridDim.y == 1")
    );
    assert_eq!(split, text(3), "the same functions give the same text");
    let whole = text(1);
    assert!(!whole.contains("hare") && !whole.contains("blockIdx.y"));
    // Without a requested number, the launch selects the whole function or the partitions.
    let as_pays = Language::CudaFloat.text("robot", &of(&quadruped, &["rnea_derivatives"])).remove(0).text;
    assert!(as_pays.contains("if (gridDim.y == 1) return robot_float_rnea_derivatives_whole(n, i, q, v, a, "));
}

/// Checks that all partitions are computed even if a launch has fewer rows of blocks than partitions.
#[test]
fn shares_without_a_row_of_their_own_are_not_left_out() {
    let Some(fake) = Fake::new() else { return };
    let quadruped = robots::quadruped();
    let all = in_partitions(&quadruped, &["crba"], 5);
    let image = String::from_utf8(fake.compiler.ptx::<f64>("robot", &all, (7, 0)).unwrap()).unwrap();
    let path = image.split_whitespace().nth(4).unwrap(); // the path follows the words FAKE, PTX and 70
    type Thread = unsafe extern "C" fn(*mut *mut c_void, *const c_uint, *const c_uint, c_uint, c_uint);
    // SAFETY: this test built the library.
    let library = unsafe { Library::new(path) }.unwrap();
    let q = random_configuration(&quadruped, &mut StdRng::seed_from_u64(1));
    let expected = crba(&quadruped, &mut Data::new(&quadruped), &q).as_slice().to_vec();
    for rows in [1, 2, 3, 5, 7] {
        let (mut n, mut M) = (1 as c_int, vec![f64::NAN; expected.len()]);
        let (mut from, mut to) = (q.as_ptr(), M.as_mut_ptr());
        let mut parameters = [(&raw mut n).cast(), (&raw mut from).cast(), (&raw mut to).cast()];
        for row in 0..rows {
            // SAFETY: the declared type equals the function's type, and the arrays have the lengths that the function
            // reads and writes.
            unsafe {
                let thread = library.get::<Thread>(b"fake_thread_robot_crba\0").unwrap();
                thread(parameters.as_mut_ptr(), [1, rows].as_ptr(), [0, row].as_ptr(), 0, 1);
            }
        }
        let scale = expected.iter().fold(1.0, |max: f64, x| max.max(x.abs()));
        assert!(M.iter().zip(&expected).all(|(x, y)| (x - y).abs() <= ROUNDING * scale), "{rows} rows");
    }
    drop(library);
    fake.end();
}

/// Compares partitioned kernels with the library for random trees with every type of joint and with mimic joints.
#[test]
fn trees_of_any_form_are_shared_out() {
    let Some(fake) = Fake::new() else { return };
    let device = fake.driver.device(0).unwrap();
    let mut split = 0;
    for seed in 0..4 {
        let rng = &mut trees::rng(seed);
        let tree = if seed % 2 == 0 { Tree::random(rng) } else { Tree::random_with_mimics(rng) };
        let model = tree.build();
        for (number, names) in [(2, &["rnea", "crba"][..]), (20, &["rnea_derivatives"])] {
            let all = in_partitions(&model, names, number);
            let kernels = device.compile::<f64>(&fake.compiler, "tree", &all).unwrap();
            for function in &all {
                let partitions = kernels.kernel(&function.name).unwrap().partitions();
                assert!(partitions <= number);
                split += usize::from(partitions > 1);
                check(&device, &kernels, &model, &function.name, &[5]);
            }
        }
    }
    assert!(split > 9, "{split}");
    drop(device);
    fake.end();
}

#[test]
fn blocks_keep_every_multiprocessor_busy() {
    let Some(fake) = Fake::new() else { return };
    let (device, arm) = (fake.driver.device(0).unwrap(), robots::arm7());
    let kernels = device.compile::<f64>(&fake.compiler, "arm7", &of(&arm, &["rnea"])).unwrap();
    // The fake device has four multiprocessors, and at most 256 threads per block.
    for (n, [blocks, threads]) in [(1, [1, 32]), (100, [4, 32]), (129, [3, 64]), (1024, [4, 256]), (3000, [12, 256])] {
        check(&device, &kernels, &arm, "rnea", &[n]);
        assert_eq!(fake.launches().0, [blocks, threads, 1], "{n} states");
    }
    // A function with partitions is launched with one row of blocks for each partition. The rows share the
    // multiprocessors, so each row gets fewer and larger blocks.
    let quadruped = robots::quadruped();
    let split = device.compile::<f64>(&fake.compiler, "quadruped", &in_partitions(&quadruped, &["rnea"], 4)).unwrap();
    for (n, [blocks, threads]) in [(1, [1, 32]), (30, [1, 32]), (100, [1, 128]), (129, [1, 160]), (3000, [12, 256])] {
        check(&device, &split, &quadruped, "rnea", &[n]);
        assert_eq!(fake.launches().0, [blocks, threads, 4], "{n} states");
    }
    let kernel = kernels.kernel("rnea").unwrap();
    assert_eq!((kernel.registers(), kernel.local_bytes()), (96, 64));
    assert_eq!(kernel.most_states(), i32::MAX as usize / 7);
    assert_eq!(format!("{kernel:?}"), "rnea(q, v, a) -> tau");
    let before = fake.launches().1;
    let none = || DeviceArray::<f64>::new(&device, 0).unwrap();
    let stream = device.default_stream();
    kernel.call(&stream, 0, &[&none(), &none(), &none()], &mut [&mut none()]).unwrap();
    assert_eq!(none().to_vec(&stream).unwrap(), []);
    assert_eq!(fake.launches().1, before, "nothing is launched for no states");
}

#[test]
fn streams_are_ordered_by_what_is_said() {
    let Some(fake) = Fake::new() else { return };
    let (device, arm) = (fake.driver.device(0).unwrap(), robots::arm7());
    let kernels = device.compile::<f64>(&fake.compiler, "arm7", &of(&arm, &["crba"])).unwrap();
    let kernel = kernels.kernel("crba").unwrap();
    let (first, second) = (device.stream().unwrap(), device.stream().unwrap());
    let q = DeviceArray::from_slice(&first, &[0.3; 7]).unwrap();
    let mut M = DeviceArray::new(&device, 49).unwrap();
    kernel.call(&first, 1, &[&q], &mut [&mut M]).unwrap();
    assert!(M.to_vec(&second).unwrap().iter().all(|x| x.is_nan()), "the other stream does not wait");
    second.wait_for(&first).unwrap();
    let expected = crba(&arm, &mut Data::new(&arm), &[0.3; 7]).as_slice().to_vec();
    let found = M.to_vec(&second).unwrap();
    assert!(found.iter().zip(&expected).all(|(x, y)| (x - y).abs() < ROUNDING));
    // Objects that are dropped while a kernel waits stay alive until the kernel has run.
    let mut again = DeviceArray::new(&device, 49).unwrap();
    kernel.call(&second, 1, &[&q], &mut [&mut again]).unwrap();
    drop(q);
    drop(second);
    drop(kernels);
    assert_eq!(again.to_vec(&first).unwrap(), found);
    drop((M, again, first, device));
    fake.end();
}

#[test]
fn memory_and_streams_of_others_are_used_where_they_are() {
    let Some(fake) = Fake::new() else { return };
    let (device, arm) = (fake.driver.device(0).unwrap(), robots::arm7());
    let kernels = device.compile::<f64>(&fake.compiler, "arm7", &of(&arm, &["gravity"])).unwrap();
    let theirs = device.stream().unwrap();
    let (q, mut g) = (DeviceArray::from_slice(&theirs, &[0.3; 14]).unwrap(), DeviceArray::new(&device, 14).unwrap());
    // SAFETY: both arrays and the stream live until the end of this test.
    let (stream, [from, mut to]) = unsafe {
        let array = |a: &DeviceArray<f64>| DeviceArray::from_raw(&device, a.as_raw(), a.len());
        (Stream::from_raw(&device, theirs.as_raw()), [array(&q), array(&g)])
    };
    kernels.kernel("gravity").unwrap().call(&stream, 2, &[&from], &mut [&mut to]).unwrap();
    drop((from, to, stream));
    let found = g.to_vec(&theirs).unwrap();
    assert!(found.iter().all(|x| x.is_finite()));
    assert_eq!(found[2], found[3]);
    g.write(&theirs, &[1.0; 14]).unwrap();
    assert_eq!(g.to_vec(&theirs).unwrap(), [1.0; 14]);
    drop((q, g, theirs, kernels, device));
    fake.end();
}

#[test]
fn a_newer_device_gets_ptx_and_so_does_a_machine_without_a_compiler() {
    let Some(fake) = Fake::new() else { return };
    let (old, new, arm) = (fake.driver.device(0).unwrap(), fake.driver.device(1).unwrap(), robots::arm7());
    assert_eq!((old.capability(), new.capability()), ((9, 0), (9, 9)));
    assert_eq!((new.name().unwrap(), fake.driver.devices().unwrap()), ("No GPU 1".to_owned(), 2));
    let all = of(&arm, &["aba"]);
    let kernels = new.compile::<f64>(&fake.compiler, "arm7", &all).unwrap();
    check(&new, &kernels, &arm, "aba", &[33]);
    let ptx = fake.compiler.ptx::<f32>("arm7", &all, (7, 0)).unwrap();
    // SAFETY: the image was compiled from these functions, with this name and number type.
    let loaded = unsafe { old.load::<f32>("arm7", &all, &ptx) }.unwrap();
    check(&old, &loaded, &arm, "aba", &[33]);
    // Objects of another device are rejected.
    let (stream, other) = (new.default_stream(), old.default_stream());
    let on = |device| DeviceArray::<f64>::new(device, 7).unwrap();
    let [q, v, tau, mut a] = [&new, &new, &old, &new].map(on);
    let kernel = kernels.kernel("aba").unwrap();
    let said = kernel.call(&stream, 1, &[&q, &v, &tau], &mut [&mut a]).unwrap_err();
    assert_eq!(said.to_string(), "tau: expected one of device 1, found one of device 0");
    let said = kernel.call(&other, 1, &[&q, &v, &q], &mut [&mut a]).unwrap_err();
    assert_eq!(said.to_string(), "stream: expected one of device 1, found one of device 0");
    assert!(matches!(a.to_vec(&other), Err(Error::OtherDevice { .. })));
    drop((kernels, loaded, q, v, tau, a, stream, other, old, new));
    fake.end();
}

#[test]
fn what_is_wrong_is_said() {
    let Some(fake) = Fake::new() else { return };
    let (device, arm) = (fake.driver.device(0).unwrap(), robots::arm7());
    let said = |error: Error| error.to_string();
    assert_eq!(said(fake.driver.device(2).unwrap_err()), "no CUDA device 2: found 2 device(s)");
    let all = of(&arm, &["crba"]);
    let kernels = device.compile::<f64>(&fake.compiler, "arm7", &all).unwrap();
    let kernel = kernels.kernel("crba").unwrap();
    assert_eq!(said(kernels.kernel("aba").unwrap_err()), "no kernel `aba`; there are crba");
    let stream = device.stream().unwrap();
    let (q, mut M) = (DeviceArray::from_slice(&stream, &[0.1; 14]).unwrap(), DeviceArray::new(&device, 98).unwrap());
    let mut call = |n, q: &[&DeviceArray<f64>]| said(kernel.call(&stream, n, q, &mut [&mut M]).unwrap_err());
    assert_eq!(call(3, &[&q]), "q: expected 21 numbers, found 14");
    assert_eq!(call(2, &[&q, &q]), "crba: expected 1 inputs, found 2");
    assert_eq!(call(100_000_000, &[&q]), "crba: expected at most 43826196 states, found 100000000");
    fake.fail("cuLaunchKernel", 2);
    assert_eq!(call(2, &[&q]), "cuLaunchKernel: CUDA_ERROR_OUT_OF_MEMORY, out of memory (status 2)");
    assert_eq!(said(kernel.call(&stream, 2, &[&q], &mut []).unwrap_err()), "crba: expected 1 outputs, found 0");
    assert_eq!(said(M.write(&stream, &[0.0; 3]).unwrap_err()), "numbers: expected 98 numbers, found 3");
    fake.fail("cuStreamSynchronize", 700);
    let failed = said(M.to_vec(&stream).unwrap_err());
    assert!(failed.contains("CUDA_ERROR_ILLEGAL_ADDRESS, an illegal memory access was encountered"), "{failed}");
    fake.fail("cuMemAlloc_v2", 999);
    assert!(said(DeviceArray::<f64>::new(&device, 5).unwrap_err()).contains("unknown (status 999)"));

    let failed = fake.compiler.ptx::<f64>("arm7", &all, (1, 0)).unwrap_err();
    assert!(said(failed).starts_with("arm7: not compiled for compute_10: status 5: "));
    // SAFETY: the fake driver reads the image only up to the first zero.
    let failed = said(unsafe { device.load::<f64>("arm7", &all, b"no code") }.unwrap_err());
    assert_eq!(
        failed,
        "arm7: not loaded: CUDA_ERROR_INVALID_PTX, a PTX JIT compilation failed: ptxas: this is no code"
    );
    fake.fail("cuModuleGetFunction", 500);
    let failed = device.compile::<f64>(&fake.compiler, "arm7", &all).unwrap_err();
    assert!(said(failed).contains("named symbol not found"));
    drop((kernels, q, M, stream, device));
    fake.end();
}

#[test]
fn without_a_driver_that_is_said() {
    let missing = Path::new("no-such-file.so");
    let said = Driver::open(missing).unwrap_err().to_string();
    assert!(said.starts_with("CUDA's driver: cannot be loaded: no-such-file.so: "), "{said}");
    assert!(said.ends_with("; the environment variable CONDYLE_CUDA_LIBRARY may name its file"), "{said}");
    let said = Compiler::open(missing).unwrap_err().to_string();
    assert!(said.starts_with("NVIDIA's run-time compiler: cannot be loaded: no-such-file.so: "), "{said}");
    // A library that is not CUDA's driver is refused.
    if let Some(fake) = Fake::new() {
        let other = folder("cuda_other").join("libother.so");
        let source = other.with_extension("c");
        std::fs::write(&source, "int other;\n").unwrap();
        compile(Command::new("cc").args(["-shared", "-o"]).arg(&other).arg(&source));
        assert!(Driver::open(&other).unwrap_err().to_string().contains("cuInit"));
        drop(fake);
    }
    match Device::new(0) {
        Ok(device) => println!("there is a GPU: {}", device.name().unwrap()),
        Err(error) => println!("{error}"),
    }
}

#[test]
fn several_threads_may_call_at_a_time() {
    let Some(fake) = Fake::new() else { return };
    let (device, arm) = (fake.driver.device(0).unwrap(), robots::arm7());
    let kernels = device.compile::<f64>(&fake.compiler, "arm7", &of(&arm, &["rnea", "aba"])).unwrap();
    std::thread::scope(|scope| {
        for name in ["rnea", "aba", "rnea", "aba"] {
            let (device, kernels, arm) = (&device, &kernels, &arm);
            scope.spawn(move || check(device, kernels, arm, name, &[50, 77, 3]));
        }
    });
    drop((kernels, device));
    fake.end();
}

/// Checks that NVIDIA's own compiler accepts the generated code, if this compiler is installed. Compiling needs no GPU.
#[test]
fn nvidias_compiler_takes_the_code() {
    let Ok(compiler) = Compiler::new() else {
        println!("NOT RUN: NVIDIA's run-time compiler is not installed");
        return;
    };
    let all = of(&robots::arm7(), &["aba_derivatives"]);
    let ptx = String::from_utf8(compiler.ptx::<f32>("arm7", &all, (7, 5)).unwrap()).unwrap();
    assert!(ptx.contains(".visible .entry arm7_aba_derivatives(") && ptx.contains(".target sm_75"));
    let failed = compiler.ptx::<f32>("arm7", &all, (1, 0)).unwrap_err();
    assert!(matches!(&failed, Error::Compile { log, .. } if log.contains("gpu-architecture")), "{failed}");
}
