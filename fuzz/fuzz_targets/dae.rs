//! Fuzzes the reader of meshes from DAE.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Dae);
