//! Fuzzes the reader of robots from SDF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Sdf);
