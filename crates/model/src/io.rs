//! Reading and writing files of robots: URDF, MJCF, SDF, SRDF, and formats of serde.

#[cfg(feature = "loaders")]
pub(crate) mod collisions;
#[cfg(feature = "serde")]
mod description;
#[cfg(feature = "loaders")]
mod files;
#[cfg(feature = "meshes")]
pub(crate) mod fit;
#[cfg(feature = "loaders")]
mod known;
#[cfg(feature = "loaders")]
pub(crate) mod mjcf;
#[cfg(feature = "loaders")]
pub(crate) mod sdf;
#[cfg(feature = "loaders")]
mod srdf;
#[cfg(feature = "loaders")]
pub(crate) mod urdf;
#[cfg(feature = "loaders")]
mod write;
#[cfg(feature = "loaders")]
mod xml;

#[cfg(feature = "loaders")]
use condyle_spatial::{Mat3, Vec3};

/// Returns the rotation matrix R = Rz(yaw) Ry(pitch) Rx(roll), given angles (rad). This is the convention of URDF and
/// SDF.
#[cfg(feature = "loaders")]
fn from_rpy(rpy: [f64; 3]) -> Mat3<f64> {
    let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(f64::sin_cos);
    Mat3 {
        x: Vec3::new(cy * cp, sy * cp, -sp),
        y: Vec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        z: Vec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    }
}
