//! Writes `arm7.rs`, which `src/lib.rs` includes.

use condyle_codegen::{Language, Settings, generate};
use condyle_model::robots;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::var("OUT_DIR")?;
    generate(&robots::arm7(), &["rnea", "aba"], &Settings::default(), Language::Rust, folder.as_ref())?;
    println!("cargo::rerun-if-changed=build.rs");
    Ok(())
}
