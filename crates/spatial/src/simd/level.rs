//! SIMD levels: the vector instructions that this machine has, and the vector instructions that are used.
//!
//! A build contains code for every SIMD level of its architecture. The first call chooses the best level that the
//! processor has. The environment variable `CONDYLE_LEVEL` (`baseline`, `simd128`, `neon`, `avx2`, `avx512`) or [`pin`]
//! chooses a lower level.
//!
//! The level decides which products and sums are fused. At the same level, different machines of one architecture give
//! the same results to the last bit. (On Arm, every level, including the baseline, fuses the products for which an
//! algorithm calls `mul_add`.)
//!
//! A WebAssembly module cannot query the processor. It has SIMD128 if it was compiled with `-C
//! target-feature=+simd128`, and then it runs only in browsers with SIMD128: every browser since 2023. A program
//! without the standard library cannot query the processor either. Such a program runs at the baseline or, on 64-bit
//! Arm, with NEON.

#[cfg(feature = "std")]
mod requested;

use core::fmt;
use core::sync::atomic::{AtomicU8, Ordering};
#[cfg(feature = "std")]
pub use requested::{Refused, requested};

/// SIMD level: a set of vector instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// One number at a time, with instructions that every processor of the architecture has: SSE2 on x86-64, fused
    /// products on Arm.
    Baseline = 1,
    /// SIMD128 of WebAssembly: four numbers at once, in two registers, without fused products.
    Simd128 = 2,
    /// NEON, which every 64-bit Arm processor has: four numbers at once, in two registers, with fused products.
    Neon = 3,
    /// AVX2 and FMA: four numbers at once, with fused products.
    Avx2 = 4,
    /// AVX-512 (F, DQ, VL, BW): eight numbers at once, with fused products.
    Avx512 = 5,
}

/// SIMD level with vectors of four numbers, on the architecture for which this crate is compiled.
#[doc(hidden)]
pub const NARROW: Level = if cfg!(target_arch = "aarch64") {
    Level::Neon
} else if cfg!(target_arch = "wasm32") {
    Level::Simd128
} else {
    Level::Avx2
};

/// Whether a level above the baseline is possible on this target. If not, no run-time query is needed.
#[doc(hidden)]
pub const VECTORS: bool = cfg!(any(
    all(target_arch = "x86_64", feature = "std"),
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
));

impl Level {
    /// All levels, lowest first.
    pub const ALL: [Self; 5] = [Self::Baseline, Self::Simd128, Self::Neon, Self::Avx2, Self::Avx512];

    /// Returns whether this processor can run the level.
    pub fn is_supported(self) -> bool {
        match self {
            Self::Baseline => true,
            Self::Simd128 => cfg!(all(target_arch = "wasm32", target_feature = "simd128")),
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            Self::Avx512 => {
                Self::Avx2.is_supported()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
            }
            #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Returns the name of the level, as used in `CONDYLE_LEVEL`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Simd128 => "simd128",
            Self::Neon => "neon",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    fn from_number(n: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|&level| level as u8 == n)
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Error: this processor does not have the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unsupported(
    /// Level that this processor does not have.
    pub Level,
);

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "this processor cannot run level {}", self.0)
    }
}

impl core::error::Error for Unsupported {}

/// Level in use; 0 before the first query.
static LEVEL: AtomicU8 = AtomicU8::new(0);

/// Returns the SIMD level in use: the level set by [`pin`], otherwise the level in `CONDYLE_LEVEL`, otherwise the best
/// level of this processor.
///
/// If `CONDYLE_LEVEL` is invalid or unsupported ([`requested`]), this is reported once on standard error, and the best
/// level is used.
///
/// ```
/// let level = condyle_spatial::level::level();
/// assert!(level.is_supported());
/// ```
#[inline]
pub fn level() -> Level {
    if !VECTORS {
        return Level::Baseline;
    }
    match LEVEL.load(Ordering::Relaxed) {
        2 => Level::Simd128,
        3 => Level::Neon,
        4 => Level::Avx2,
        5 => Level::Avx512,
        1 => Level::Baseline,
        _ => choose(),
    }
}

/// Panics if this processor does not have a level. Each function that enters code compiled for a level calls
/// `assert_supported`.
#[doc(hidden)]
#[inline(always)]
pub fn assert_supported(level: Level) {
    /// Best level of this processor; 0 before the first query. (A processor with this level also has all lower levels
    /// of its architecture.)
    static BEST: AtomicU8 = AtomicU8::new(0);
    #[cold]
    fn find(level: Level) {
        let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).unwrap_or(Level::Baseline);
        BEST.store(best as u8, Ordering::Relaxed);
        assert!(level <= best, "{}", Unsupported(level));
    }
    if BEST.load(Ordering::Relaxed) < level as u8 {
        find(level);
    }
}

#[cold]
fn choose() -> Level {
    let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).unwrap_or(Level::Baseline);
    #[cfg(feature = "std")]
    let (level, refused) = match requested() {
        Ok(level) => (level.unwrap_or(best), None),
        Err(refused) => (best, Some(refused)),
    };
    #[cfg(not(feature = "std"))]
    let level = best;
    // Another thread may have chosen or pinned a level in the meantime.
    match LEVEL.compare_exchange(0, level as u8, Ordering::Relaxed, Ordering::Relaxed) {
        Ok(_) => {
            #[cfg(feature = "std")]
            if let Some(refused) = refused {
                eprintln!("{refused}; using {best}");
            }
            level
        }
        Err(chosen) => Level::from_number(chosen).unwrap_or(level),
    }
}

/// Sets the level to use from now on, in all threads.
///
/// ```
/// use condyle_spatial::level::{Level, level, pin};
/// pin(Level::Baseline)?;
/// assert_eq!(level(), Level::Baseline);
/// # Ok::<(), condyle_spatial::level::Unsupported>(())
/// ```
///
/// # Errors
/// Returns [`Unsupported`] if this processor does not have the level.
pub fn pin(level: Level) -> Result<(), Unsupported> {
    if !level.is_supported() {
        return Err(Unsupported(level));
    }
    LEVEL.store(level as u8, Ordering::Relaxed);
    Ok(())
}
