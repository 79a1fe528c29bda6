//! The limbs of one robot side by side: the passes over the schedule of [`condyle_model::limbs`], four bodies at a time.

mod constrained;
mod forces;
mod held;
mod inverse;
mod lanes;
mod pass;
mod seen;

pub(crate) use condyle_model::limbs::{LANES, Plan};
pub(crate) use constrained::run as run_constrained;
pub(crate) use held::Held;
pub(crate) use pass::{Scratch, Task, run, spread};
pub(crate) use seen::Seen;
