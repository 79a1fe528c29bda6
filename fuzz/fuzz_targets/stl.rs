//! Fuzzes the reader of meshes from STL.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Stl);
