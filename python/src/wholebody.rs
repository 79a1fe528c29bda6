//! Whole-body control in Python: the module `condyle.wholebody`.

mod contacts;
mod controller;
mod plan;
mod references;
mod settings;
mod tasks;

pub(crate) use contacts::FrictionContact;
pub(crate) use controller::{WholeBodyController, controller_from_numbers};
pub(crate) use plan::Plan;
pub(crate) use references::{check_pose, check_rotations};
pub(crate) use tasks::Task;
