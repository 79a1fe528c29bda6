//! Measures the energy error of each integrator in motions of 10 s without motors and friction. One robot is a double
//! pendulum that swings chaotically. The other is a humanoid that falls and tumbles with loose joints.
//!
//! The example prints a table and draws the energy error |E(t) − E(0)|. Each point of a curve is the greatest value in
//! a hundredth of the time.
//!
//! The humanoid is difficult. Its wrists are light and loose, and sometimes come near the position in which yaw and
//! roll have the same axis. Near this position, joint speeds change abruptly. Euler's method uses the Coriolis forces
//! from the beginning of a step, which adds energy without bound. With steps of 2 ms, the variational integrator
//! reports that its equation has no solution.
//!
//! ```text
//! cargo run --release --example energy_drift -- energy_drift.svg
//! ```

use condyle::simulation::{Integrator, Settings, Simulation, Status};
use condyle::{
    Data, Error, Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, forward_velocities, neutral, robots,
};
use std::fmt::Write;

const TIME: f64 = 10.0; // s
const STEPS: [f64; 2] = [1e-3, 5e-4]; // s; the first one is drawn
const POINTS: usize = 100;
const INTEGRATORS: [(&str, Integrator, &str); 3] = [
    ("semi-implicit Euler", Integrator::SemiImplicitEuler, "#d1495b"),
    ("Runge–Kutta 4", Integrator::RungeKutta4, "#30638e"),
    ("variational", Integrator::Variational, "#2e933c"),
];

/// A robot with its initial state.
struct System {
    name: &'static str,
    model: Model,
    q: Vec<f64>,
    v: Vec<f64>,
}

/// Creates a pendulum of two rods, each of 1 m and 1 kg.
fn double_pendulum() -> Result<System, Error> {
    let joint = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3 { zz: 0.001, ..Sym3::diagonal(1.0 / 12.0) });
    let mut robot = ModelBuilder::new("double pendulum");
    let upper = robot.body("upper", WORLD, joint, Se3::identity(), rod);
    let elbow = Se3 { translation: Vec3::new(0.0, 0.0, -1.0), ..Se3::identity() };
    robot.body("lower", upper, joint, elbow, rod);
    Ok(System { name: "double pendulum", model: robot.build()?, q: vec![2.0, 1.0], v: vec![0.0; 2] })
}

/// Creates a tumbling humanoid, with joint speeds up to 1 rad/s.
fn humanoid() -> System {
    let model = robots::humanoid();
    let q = neutral(&model);
    let v = (0..model.nv()).map(|k| if k < 3 { 0.0 } else { (k as f64).sin() }).collect();
    System { name: "falling humanoid", model, q, v }
}

/// Energy error of an integrator over time.
struct Drift {
    /// Energy at the start, E(0) (J).
    start: f64,
    /// Greatest kinetic energy (J).
    kinetic: f64,
    /// Greatest energy error |E(t) − E(0)| in each hundredth of the time (J).
    errors: Vec<f64>,
    /// Energy error at the end, E(10 s) − E(0) (J).
    end: f64,
}

fn drift(system: &System, integrator: Integrator, dt: f64) -> Result<Drift, Status> {
    let System { model, q, v, .. } = system;
    let mut data = Data::new(model);
    let mut energy = |q: &[f64], v: &[f64]| {
        let velocities = forward_velocities(model, &mut data, q, v);
        (velocities.mechanical_energy(), velocities.kinetic_energy())
    };
    let mut simulation = Simulation::new(model, Settings { integrator, dt, ..Settings::default() });
    simulation.set_state(q, v).expect("the state is valid");
    let (start, _) = energy(q, v);
    let mut drift = Drift { start, kinetic: 0.0, errors: Vec::new(), end: 0.0 };
    let (efforts, steps) = (vec![0.0; model.nv()], (TIME / dt).round() as usize);
    for part in 0..POINTS {
        let mut error: f64 = 0.0;
        for _ in part * steps / POINTS..(part + 1) * steps / POINTS {
            let status = simulation.step(&efforts, &[]);
            if !status.is_done() {
                return Err(status);
            }
            let (total, kinetic) = energy(simulation.q(), simulation.v());
            drift.end = total - start;
            drift.kinetic = drift.kinetic.max(kinetic);
            error = error.max(drift.end.abs());
        }
        drift.errors.push(error);
    }
    Ok(drift)
}

/// Figure with one panel for each system, which shows the energy error |E(t) − E(0)| on a logarithmic axis.
struct Figure {
    svg: String,
    panels: usize,
}

const PANEL: (f64, f64) = (400.0, 300.0); // size of a panel, without its labels
const LEFT: f64 = 70.0;
const TOP: f64 = 64.0;
const DECADES: (i32, i32) = (-12, 15); // J

impl Figure {
    fn new(panels: usize) -> Self {
        let (width, height) = (panels as f64 * (PANEL.0 + LEFT) + 30.0, PANEL.1 + TOP + 50.0);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\" fill=\"#333\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        let mut x = LEFT;
        for (name, _, colour) in INTEGRATORS {
            let _ = writeln!(svg, "<path d=\"M{x} 17h24\" stroke=\"{colour}\" stroke-width=\"2\"/>");
            let _ = writeln!(svg, "<text x=\"{}\" y=\"21\">{name}</text>", x + 30.0);
            x += 180.0;
        }
        Self { svg, panels: 0 }
    }

    fn panel(&mut self, title: &str, curves: &[Option<Vec<f64>>]) {
        let x0 = LEFT + self.panels as f64 * (PANEL.0 + LEFT);
        let x = |t: f64| x0 + t / TIME * PANEL.0;
        let decades = f64::from(DECADES.1 - DECADES.0);
        let y = |e: f64| {
            let part = (e.max(1e-300).log10() - f64::from(DECADES.0)) / decades;
            TOP + PANEL.1 * (1.0 - part.clamp(0.0, 1.0))
        };
        let svg = &mut self.svg;
        let _ = writeln!(svg, "<text x=\"{x0}\" y=\"{}\" font-weight=\"bold\">{title}</text>", TOP - 10.0);
        for decade in (DECADES.0..=DECADES.1).step_by(3) {
            let at = y(10f64.powi(decade));
            let _ = writeln!(svg, "<path d=\"M{x0} {at}h{}\" stroke=\"#ddd\"/>", PANEL.0);
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">10<tspan dy=\"-5\" font-size=\"9\">{}</tspan></text>",
                x0 - 8.0,
                at + 4.0,
                format!("{decade}").replace('-', "−")
            );
        }
        for t in (0..=10).step_by(2) {
            let (at, below) = (x(f64::from(t)), TOP + PANEL.1 + 18.0);
            let _ = writeln!(svg, "<text x=\"{at}\" y=\"{below}\" text-anchor=\"middle\">{t}</text>");
        }
        let below = TOP + PANEL.1 + 38.0;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{below}\" text-anchor=\"middle\">time (s)</text>", x(TIME / 2.0));
        let (ax, ay) = (x0 - 50.0, TOP + PANEL.1 / 2.0);
        let _ = writeln!(
            svg,
            "<text transform=\"translate({ax} {ay}) rotate(-90)\" text-anchor=\"middle\">|E(t) − E(0)| (J)</text>"
        );
        for (curve, (_, _, colour)) in curves.iter().zip(INTEGRATORS) {
            let Some(errors) = curve else { continue };
            let points: Vec<String> = errors
                .iter()
                .enumerate()
                .map(|(k, &e)| format!("{:.1},{:.1}", x((k as f64 + 0.5) * TIME / POINTS as f64), y(e)))
                .collect();
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\" points=\"{}\"/>",
                points.join(" ")
            );
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{x0}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>",
            PANEL.0, PANEL.1
        );
        self.panels += 1;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let systems = [double_pendulum()?, humanoid()];
    let mut figure = Figure::new(systems.len());
    println!("energy over {TIME} s, E(0) and the greatest kinetic energy T in J, errors in J\n");
    println!("| system | integrator | step | E(0) | greatest T | greatest error | error at the end |");
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: |");
    for system in &systems {
        let mut curves = Vec::new();
        for dt in STEPS {
            for (name, integrator, _) in INTEGRATORS {
                print!("| {} | {name} | {} ms |", system.name, dt * 1e3);
                match drift(system, integrator, dt) {
                    Ok(Drift { start, kinetic, errors, end }) => {
                        let greatest = errors.iter().copied().fold(0.0, f64::max);
                        println!(" {start:.1} | {kinetic:.2e} | {greatest:.1e} | {end:.1e} |");
                        curves.push(Some(errors));
                    }
                    Err(status) => {
                        println!(" | | {status:?} | |");
                        curves.push(None);
                    }
                }
            }
        }
        figure.panel(&format!("{}, step {} ms", system.name, STEPS[0] * 1e3), &curves);
    }
    let path = std::env::args().nth(1).unwrap_or_else(|| "energy_drift.svg".to_owned());
    std::fs::write(&path, figure.svg + "</svg>\n")?;
    println!("\nThe curves are in {path}.");
    Ok(())
}
