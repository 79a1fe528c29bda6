//! Dynamics of one arm, without `std` and without dependencies.
#![no_std]

mod arm7 {
    include!(concat!(env!("OUT_DIR"), "/arm7.rs"));
}

pub use arm7::{aba, rnea};

#[cfg(test)]
mod tests {
    use super::{aba, rnea};

    #[test]
    fn forward_and_inverse_dynamics_are_inverses() {
        let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
        let (mut tau, mut back) = ([0.0; 7], [0.0; 7]);
        rnea(&q, &v, &a, &mut tau);
        aba(&q, &v, &tau, &mut back);
        assert!(a.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-10));
    }
}
