//! Fuzzes the reader of meshes from OBJ.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Obj);
