//! Which vector instructions this machine has, and which of them are used.
//!
//! A build holds code for every level of its architecture; the best that the processor has is chosen at the first call. The
//! environment variable `CONDYLE_LEVEL` (`baseline`, `neon`, `avx2`, `avx512`) or [`pin`] chooses a lower one, so that
//! results can be repeated to the last bit on machines of one architecture that differ: a level decides where products and
//! sums are fused. (On Arm they are wherever an algorithm asks for it, at the baseline too.)

use core::fmt;
use core::sync::atomic::{AtomicU8, Ordering};

/// A set of vector instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// One number at a time, with what every processor of its architecture has: SSE2, or fused products on Arm.
    Baseline = 1,
    /// NEON, which every 64-bit Arm has: four numbers at once in two registers, fused products.
    Neon = 2,
    /// AVX2 and FMA: four numbers at once, fused products.
    Avx2 = 3,
    /// AVX-512 (F, DQ, VL, BW): eight numbers at once.
    Avx512 = 4,
}

impl Level {
    /// All levels, the lowest first.
    pub const ALL: [Self; 4] = [Self::Baseline, Self::Neon, Self::Avx2, Self::Avx512];

    /// Whether this processor can run it.
    pub fn is_supported(self) -> bool {
        match self {
            Self::Baseline => true,
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_supported()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The name of a level, as `CONDYLE_LEVEL` writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
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

/// A level that this processor does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unsupported(
    /// The level.
    pub Level,
);

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "this processor cannot run level {}", self.0)
    }
}

impl std::error::Error for Unsupported {}

/// A `CONDYLE_LEVEL` that cannot be obeyed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refused {
    /// The value names no level.
    Unknown(
        /// The value.
        String,
    ),
    /// This processor does not have the level.
    Unsupported(
        /// The level.
        Level,
    ),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(name) => write!(f, "CONDYLE_LEVEL: expected {}, found `{name}`", List(&Level::ALL))?,
            Self::Unsupported(level) => write!(f, "CONDYLE_LEVEL: {}", Unsupported(*level))?,
        }
        let here: Vec<Level> = Level::ALL.into_iter().filter(|level| level.is_supported()).collect();
        write!(f, " (this processor has {})", List(&here))
    }
}

impl std::error::Error for Refused {}

/// Levels as a sentence names them.
struct List<'a>(&'a [Level]);

impl fmt::Display for List<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, level) in self.0.iter().enumerate() {
            let before = if i == 0 {
                ""
            } else if i + 1 == self.0.len() {
                " or "
            } else {
                ", "
            };
            write!(f, "{before}{level}")?;
        }
        Ok(())
    }
}

/// The level in use; 0 until it is first asked for.
static LEVEL: AtomicU8 = AtomicU8::new(0);

/// The level in use: the one pinned, else `CONDYLE_LEVEL`, else the best that this processor has.
///
/// A `CONDYLE_LEVEL` that cannot be obeyed ([`requested`]) is reported on the standard error, once, and the best level is
/// used.
///
/// ```
/// let level = condyle_spatial::level::level();
/// assert!(level.is_supported());
/// ```
#[inline]
pub fn level() -> Level {
    match LEVEL.load(Ordering::Relaxed) {
        2 => Level::Neon,
        3 => Level::Avx2,
        4 => Level::Avx512,
        1 => Level::Baseline,
        _ => choose(),
    }
}

/// The level that `CONDYLE_LEVEL` asks for, if it is set.
///
/// ```
/// let requested = condyle_spatial::level::requested()?; // a program that would rather stop than run another level
/// assert!(requested.is_none_or(|level| level.is_supported()));
/// # Ok::<(), condyle_spatial::level::Refused>(())
/// ```
///
/// # Errors
/// [`Refused`], if it names no level, or one that this processor does not have.
pub fn requested() -> Result<Option<Level>, Refused> {
    let Some(name) = std::env::var_os("CONDYLE_LEVEL") else { return Ok(None) };
    let Some(level) = Level::ALL.into_iter().find(|level| name == level.name()) else {
        return Err(Refused::Unknown(name.to_string_lossy().into_owned()));
    };
    if level.is_supported() { Ok(Some(level)) } else { Err(Refused::Unsupported(level)) }
}

/// Asserts that this processor has a level: at each door to code that is compiled for it.
#[inline(always)]
pub(crate) fn assert_supported(level: Level) {
    /// The best level of this processor; 0 until it is first asked for. (Each has all below, Arm's only one too.)
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
    let (level, refused) = match requested() {
        Ok(level) => (level.unwrap_or(best), None),
        Err(refused) => (best, Some(refused)),
    };
    // another thread may have chosen or pinned one meanwhile
    match LEVEL.compare_exchange(0, level as u8, Ordering::Relaxed, Ordering::Relaxed) {
        Ok(_) => {
            if let Some(refused) = refused {
                eprintln!("{refused}; using {best}");
            }
            level
        }
        Err(chosen) => Level::from_number(chosen).unwrap_or(level),
    }
}

/// Uses this level from now on, in all threads.
///
/// ```
/// use condyle_spatial::level::{Level, level, pin};
/// pin(Level::Baseline)?;
/// assert_eq!(level(), Level::Baseline);
/// # Ok::<(), condyle_spatial::level::Unsupported>(())
/// ```
///
/// # Errors
/// [`Unsupported`], if this processor does not have it.
pub fn pin(level: Level) -> Result<(), Unsupported> {
    if !level.is_supported() {
        return Err(Unsupported(level));
    }
    LEVEL.store(level as u8, Ordering::Relaxed);
    Ok(())
}
