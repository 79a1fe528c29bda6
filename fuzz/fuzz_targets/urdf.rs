//! Fuzzes the reader of robots from URDF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Urdf);
