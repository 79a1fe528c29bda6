//! Meshes from DAE.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Dae);
