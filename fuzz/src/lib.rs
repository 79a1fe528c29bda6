//! Hostile input for cargo-fuzz (`cargo +nightly fuzz run urdf`). There is one fuzz target for each file format of
//! robots, problems and meshes. Mutations begin with robots of the repository, which are compiled into the program. So
//! the corpora need no copies of these robots.
//!
//! The test `tests/hostile.rs` uses the same mutations, and checks the same property for a fixed number of inputs.

mod hostile;

pub use hostile::Kind;
use hostile::mutated;
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Mutates the first `size` bytes of `data`, and returns the new size, which is at most `data.len()`. If the input has
/// at most 64 bytes, writes a mutated seed of the same format instead. Some calls use libFuzzer's own mutations.
pub fn mutate(kind: Kind, data: &mut [u8], size: usize, seed: u32) -> usize {
    let (room, mut rng) = (data.len(), StdRng::seed_from_u64(seed.into()));
    if seed.is_multiple_of(4) && size > 64 {
        return libfuzzer_sys::fuzzer_mutate(data, size, room);
    }
    let seeds = kind.seeds();
    let from = if size > 64 { &data[..size] } else { &seeds[seed as usize % seeds.len()] };
    let new = mutated(kind, from, &seeds, &mut rng);
    let size = new.len().min(room);
    data[..size].copy_from_slice(&new[..size]);
    size
}

/// Defines a libFuzzer target for an input format.
#[macro_export]
macro_rules! target {
    ($kind:expr) => {
        libfuzzer_sys::fuzz_target!(|data: &[u8]| {
            $kind.check(data);
        });
        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            $crate::mutate($kind, &mut data[..max_size], size, seed)
        });
    };
}
