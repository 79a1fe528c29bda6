//! Files of robots: URDF, MJCF, SDF, and those of serde.

mod description;
pub(crate) mod mjcf;
mod packages;
pub(crate) mod sdf;
pub(crate) mod urdf;
mod xml;

use condyle_spatial::{Mat3, Vec3};

/// R = Rz(yaw) Ry(pitch) Rx(roll), as URDF and SDF have it (rad).
fn from_rpy(rpy: [f64; 3]) -> Mat3<f64> {
    let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(f64::sin_cos);
    Mat3 {
        x: Vec3::new(cy * cp, sy * cp, -sp),
        y: Vec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        z: Vec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    }
}
