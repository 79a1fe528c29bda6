//! Computes on this machine the efforts that `examples/embedded` computes, and prints them for comparison.

#[path = "../../../examples/embedded/src/arm.rs"]
mod arm;
#[path = "../../../examples/embedded/src/motions.rs"]
mod motions;

fn main() {
    let arm = arm::model();
    for (motion, tau) in motions::efforts(&arm, &mut condyle_dynamics::Data::new(&arm)).iter().enumerate() {
        println!("tau {motion}: {tau:?}");
    }
}
