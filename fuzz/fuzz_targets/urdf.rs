//! Robots from URDF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Urdf);
