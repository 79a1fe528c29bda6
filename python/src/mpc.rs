//! Controllers at a rate in Python: the module `condyle.mpc`.

mod arm;
mod controller;
mod feet;
mod policy;
mod settings;
mod whole_body;

pub(crate) use arm::ArmMpc;
pub(crate) use feet::{Foot, Gait};
pub(crate) use policy::JointPolicy;
pub(crate) use whole_body::WholeBodyMpc;
