//! Models in files of serde's formats.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Model);
