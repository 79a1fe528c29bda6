//! Program with most tests of this crate. Each test program compiles the generic algorithms again, so one program is
//! faster. Tests that read environment variables or select a SIMD level are separate programs.
#![allow(non_snake_case)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/common/counting.rs"]
mod counting;

mod accelerations;
mod allocations;
mod book;
mod centroidal;
mod closed_forms;
mod complexity;
mod compose;
mod constrained;
mod constrained_derivatives;
mod coriolis;
mod counted;
mod derivatives;
mod distances;
mod divide_conquer;
mod energy;
mod factorisation;
mod forward_dynamics;
mod free_armature;
mod ground;
mod guarantees;
mod identities;
mod inertial_parameters;
mod inputs;
mod islands;
mod kinematics;
mod mimic;
mod mjcf;
mod model_files;
mod motion_derivatives;
mod panics;
mod passive;
mod points;
mod regressor;
mod sdf;
mod second_order;
mod simulation;
mod single_calls_f32;
mod springs;
mod urdf;
mod validity;
